"""Is a cause found that was hidden in a walk?

One stride of measured walking is repeated by a made-up person whose trunk is 15 % heavier than anybody believes. The
ground reaction is made by Newton and Euler in numpy, not by the engine that diagnoses; soft tissue, cameras, landmarks
and plates err as they do. Then the walk is diagnosed, and the stride is played with the reaction that the plates read
and the one that the believed body's motion requires.
Run the cells, or `python analysis/walk_hidden_cause.py`; picture and page go to out/.
"""

# %% A walk with a secret
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from walks.synthetic import Wrong, gait_of, make

import fes_pin as fp
from fes_pin.body.measured_walk import data_folder
from fes_pin.view.report_walk import show_reactions
from fes_pin.walk.motion import about
from fes_pin.walk.recording import recordings_of

OUT = Path("out")
HIDDEN, SEED = 0.15, 11
try:
    WALK = data_folder()
except fp.InputError as error:
    print(f"walk_hidden_cause: {error}", file=sys.stderr)
    raise SystemExit(2) from None
FOLDER = OUT / "walk_hidden_cause"
subject = make(gait_of(WALK), FOLDER, Wrong("segment_mass", "trunk", HIDDEN, tissue=0.4, strides=3), SEED)
study = fp.read_study(FOLDER)
print(
    f"hidden: a trunk {100 * HIDDEN:.0f} % heavier than that of {subject.mass_kg:g} kg and {subject.height_m:.2f} m\n"
)

# %% What the diagnosis makes of it
diagnosis = fp.diagnose(study)
print(diagnosis)
first = diagnosis.causes[0]
share = first.parameters.get("share")
if first.name == "segment_mass" and first.site == "trunk":
    low, high = share.interval
    print(f"\nfound: {100 * share.value:.1f} % [{100 * low:.1f}, {100 * high:.1f}], hidden: {100 * HIDDEN:.0f} %")
believed, found = fp.Body.from_subject(subject.mass_kg, subject.height_m), diagnosis.model
print(f"believed body {believed.mass_kg:.1f} kg, extended body {found.mass_kg:.1f} kg")

# %% The same walk, by the believed body and by the extended one
(recording,) = recordings_of(study)
motion, plates = recording.motion, recording.plates
centre = motion.centre
read, needed = about(plates.total, centre), about(motion.required, centre)
(again,) = recordings_of(study, body=found)
extended = about(again.motion.required, centre)


def rms(values):
    return np.sqrt(np.mean(np.square(values), axis=0))


before, after = rms(read - needed), rms(read - extended)
print(
    f"vertical force, read - required: {before[2]:.1f} N rms by the believed body, {after[2]:.1f} by the extended one"
)

# %% Picture and playback
OUT.mkdir(exist_ok=True)
figure, axes = plt.subplots(2, 1, figsize=(8, 5.2), sharex=True, layout="constrained")
for panel, channel, word in ((axes[0], 2, "vertical force (N)"), (axes[1], 4, "moment about left (N m)")):
    panel.plot(motion.time, read[:, channel], color="#17191c", lw=0.9, zorder=3, label="measured by the plates")
    panel.plot(motion.time, needed[:, channel], color="#d55e00", label="required, nominal body")
    panel.plot(motion.time, extended[:, channel], color="#56b4e9", lw=3.0, label="required, extended body")
    panel.set_ylabel(word)
    panel.spines[["top", "right"]].set_visible(False)
axes[0].legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)
axes[1].set_xlabel("time (s)")
figure.savefig(OUT / "walk_hidden_cause.png", dpi=130)
page = show_reactions(motion, plates, "a trunk heavier than believed").write(OUT / "walk_hidden_cause.html")
print(f"playback: {page}")
