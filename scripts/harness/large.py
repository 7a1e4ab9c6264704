"""Rigs whose hidden causes are large and whose start values are far off: `large_rigs`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from large_rigs import ankle, joint, muscle
from large_rigs.recorded import Recording, recorded, recording_of

import fes_pin as fp
from harness.generator import Item, Truth

FAMILIES = ("free", "driven", "muscle", "turning", "free", "ankle", "twitches", "coasting")
"""In turn."""
WORDS = {
    "free": "a joint that swings freely",
    "driven": "a joint that an effort swings",
    "turning": "a joint that an effort turns round",
    "coasting": "a joint that runs out",
    "muscle": "a muscle",
    "ankle": "an ankle",
    "twitches": "strength of twitches",
}
RIGS = {"muscle": muscle, "twitches": muscle, "ankle": ankle}
CAUSES = {**joint.CAUSES, "muscle": muscle.CAUSES, "ankle": ankle.CAUSES, "twitches": (("gain",), ("gain",))}
MANY = 3
"""Trials where there is more than one."""
NULLS = 4
"""Every fourth study of a family hides nothing."""


class Large:
    """Every cause of each family in turn, nothing in every fourth; one trial or three."""

    def plan(self, seed: int) -> Iterator[Item]:
        for k in count(seed):
            turn, place = divmod(k, len(FAMILIES))
            family = FAMILIES[place]
            causes, null = CAUSES[family], (turn + place) % NULLS == NULLS - 1
            alone = family != "twitches" and (turn + turn // NULLS + place // 2) % 2 == 0
            trials = 1 if alone else MANY
            many = "" if family == "twitches" else f", {'one trial' if alone else 'three trials'}"
            hidden = () if null else causes[(turn + place // 4 * 5 + turn // NULLS) % len(causes)]
            yield Item(f"{family}_{trials}-{k}", k, hidden, WORDS[family] + many)

    def make(self, item: Item, folder: Path, faster: int = 1) -> tuple[fp.Study, Truth]:
        """Make a study.

        Parameters
        ----------
        faster
            Multiple of its sample rate: the rig, its inputs and the size of its noise are the same.
        """
        family, trials = item.key.split("-")[0].split("_")
        draw = RIGS.get(family, joint).draw
        drawn = draw(family, item.hidden, int(trials), faster, np.random.default_rng([item.seed, 84]))
        how = recording_of(np.random.default_rng([item.seed, 85]))
        noise = np.random.default_rng([item.seed, 86])
        study = recorded(drawn, how, noise, folder)
        return study, Truth(drawn.truth, unseen=unseen(drawn, how, noise))

    def ask(self, study: fp.Study, **options: Any) -> Any:
        """The contrast of groups where there are some, else the diagnosis."""
        return (fp.contrast if study.trials[0].group else fp.diagnose)(study, **options)


def unseen(drawn: Any, how: Recording, rng: np.random.Generator) -> Mapping[str, Any]:
    """The trial that no answer is made from: see `Truth`."""
    if drawn.unseen is None:
        return {}
    one = how.read(drawn.unseen, drawn.size, rng)
    columns = {n: [float(x) for x in v] for n, v in {**one.inputs, one.output: one.values}.items()}
    return {
        "kind": one.kind,
        "dt": one.dt,
        "output": one.output,
        "columns": columns,
        "conditions": dict(one.conditions),
    }
