"""The answer of a diagnosis: which causes are named, how sure, with what gain, what stays open; and it in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.log import Log
from fes_pin.data.provenance import Provenance
from fes_pin.data.results import Saveable, shown
from fes_pin.data.show import by_columns, explaining, from_to, last_notes
from fes_pin.data.study import Study
from fes_pin.diagnosis import recorded
from fes_pin.diagnosis.cause import CELLS, Cause, Ranked
from fes_pin.diagnosis.errors_ahead import AheadErrors, RandomPart
from fes_pin.diagnosis.experiment import NextExperiment
from fes_pin.diagnosis.remainder.open_set import Remainder
from fes_pin.diagnosis.text import (
    ahead_notes,
    cause_columns,
    cause_row,
    left_out_text,
    percent,
    probability,
)
from fes_pin.identify.fit import Fit
from fes_pin.identify.stored import log_table
from fes_pin.models.catalogue import Catalogue, installed
from fes_pin.models.model import Model

STOPPED = "stopped"
"""The verdict where a limit of time ended the search, or fits did not converge: the set is the best so far."""
HEADLINES = {
    STOPPED: "stopped: best set so far: no cause, and no claim about causes that were not tried.",
    "adequate": "the model is adequate: these data justify no extension of it.",
    "unexplained": "the model misses something, and nothing in the library explains it.",
}

EACH_TRIAL = (
    "size and phase are each trial's own; in a held-out trial its other parts tell them, and a prediction from inputs "
    "alone leaves the effect out"
)
"""What is said of effects whose amplitudes are each trial's own."""

CROSS_VALIDATED = "cross-validation over trials"
SEPARATE = "the study's held-out trials"
NOTHING = "nothing: every gain is that on what was fitted"
"""What trials are held out by: `Diagnosis.held_out_by`."""


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Saveable):
    """What a simulation gets wrong.

    Attributes
    ----------
    verdict
        "adequate", "causes_found", "unexplained", or "stopped": a limit of time ended the search, or fits did not
        converge. Then the causes are the best set so far, and nothing is claimed of what is not among them.
    causes
        By held-out gain, largest first.
    model
        The extended model: it can be simulated, fitted and diagnosed again.
    absorbed
        Causes that these data could not show.
    ranking
        For each cause, its rivals by shortfall in twice the log-likelihood.
    left_out
        Samples taken for spikes, by trial and column; in `study` they hold what their neighbours say.
    warnings
        What is odd about the study, and what could not be done, one line each.
    reason
        Why something is unexplained, where it is no test of the remainder that says so: nothing could be fitted, or an
        error stays that is no noise.
    catalogue
        The causes that were looked for, of which the rig can have some.
    random, ahead
        Of a rig that a recorded effort drives: what acts on it at random, and its errors over time.
    log
        What was found that the log of the study does to its trials; in `study` it is undone, where it can be.
    provenance
        When, by which versions, from which files it was made.
    """

    study: Study
    verdict: str
    causes: tuple[Cause, ...]
    remainder: Remainder
    absorbed: tuple[str, ...]
    nominal: Fit
    extended: Fit
    nominal_error: tuple[float | None, float | None]
    extended_error: tuple[float | None, float | None]
    ceiling_percent: float
    next_experiment: NextExperiment | None
    ranking: Mapping[str, tuple[Ranked, ...]]
    held_out_by: str
    left_out: Mapping[str, Mapping[str, tuple[int, ...]]]
    wall_s: float = field(compare=False)
    warnings: tuple[str, ...] = ()
    reason: str | None = None
    catalogue: Catalogue = field(default_factory=installed, compare=False)
    random: tuple[RandomPart, ...] = ()
    ahead: AheadErrors | None = None
    log: Log = field(default_factory=Log)
    provenance: Provenance | None = field(default=None, compare=False)

    @property
    def was_held_out(self) -> bool:
        """False where there was nothing to hold out: then every gain is that on the trials that were fitted."""
        return self.held_out_by != NOTHING

    @property
    def gain_name(self) -> str:
        """What the gains of its causes are, in two words."""
        return "held-out gain" if self.was_held_out else "fitted gain"

    @property
    def is_driven(self) -> bool:
        """True of a rig whose effort answers what is read: it is judged by what is foretold one sample ahead."""
        return self.extended.doubt is not None

    @property
    def over_horizon(self) -> AheadErrors | None:
        """Errors that a driven rig is judged by; None of one that is simulated freely."""
        return self.ahead if self.is_driven else None

    @property
    def model(self) -> Model:
        """The extended model."""
        return self.extended.model

    def explained_percent(self) -> float:
        """Share of the nominal model's squared error above the noise that all causes together remove, 0 to 100.

        On trials that took no part, where there are such; of a driven rig of the errors over the horizon.
        """
        before, after, noise = self.judged_errors()
        least = noise or 0.0
        gone = 100.0 * (before - after) / max(before - least, before - after, 1e-300)
        return float(np.clip(gone, 0.0, 100.0))

    @property
    def is_judged_outside(self) -> bool:
        """Whether the errors that it is judged by are of trials that took no part."""
        if self.over_horizon is not None:
            return self.over_horizon.nominal_held_out is not None
        return self.nominal_error[1] is not None and self.extended_error[1] is not None

    def judged_errors(self) -> tuple[float, float, float | None]:
        """Error E of the nominal and of the extended model, and what noise alone leaves; see `explained_percent`."""
        if (ahead := self.over_horizon) is not None:
            one, other = ahead.nominal_held_out or ahead.nominal, ahead.extended_held_out or ahead.extended
            return one.horizon, other.horizon, other.noise
        before, after = (e[self.is_judged_outside] for e in (self.nominal_error, self.extended_error))
        assert before is not None
        assert after is not None
        return before, after, self.ceiling_percent

    def headline(self) -> str:
        """The verdict in one sentence, with how much is explained and how much is not."""
        count = len(self.causes)
        if not count:
            return HEADLINES[self.verdict].removesuffix(".") + (f": {self.reason}." if self.reason else ".")
        share = self.explained_percent()
        rest = ", and something is left" if self.remainder.unexplained else ""
        so_far = "stopped: best set so far: " if self.verdict == STOPPED else ""
        gone = f"{share:.0f} % of what the model gets wrong, {100.0 - share:.0f} % stays"
        return f"{so_far}{explaining(count)} {gone}{rest}."

    def footnotes(self) -> list[str]:
        """What stands beneath the table."""
        pairs = from_to(self.nominal_error, self.extended_error, ("fitted", "held out"))
        lines = [f"free error E {pairs}; noise floor {percent(self.ceiling_percent)}"] if pairs else []
        lines += ahead_notes(self.ahead, self.random, self.model.rig.units().get("effort", ""))
        left = self.remainder
        where = f", most on {left.where}" if left.where else ""
        if self.reason is None:
            state = "something is" if left.unexplained else "nothing"
            lines.append(f"{state} left unexplained ({probability(left.p_value)}{where})")
        elif self.causes:
            lines.append(f"something is left unexplained: {self.reason}")
        if self.left_out:
            lines.append(f"left out as spikes: {left_out_text(self.left_out, self.study.trials)}")
        some = {c.name: c.chosen_in_some for c in self.causes}
        lines += [f"{n} is chosen in {k[0]} of {k[1]} folds without their trials" for n, k in some.items() if k]
        own = [e.name for e in self.model.effects if e.each_trial]
        if own:
            lines.append(f"{', '.join(own)}: {EACH_TRIAL}")
        for where, names in self.catalogue.origins().items():
            lines.append(f"looked for as well: {', '.join(names)}, code of {Path(where).name}")
        return [*lines, *last_notes(self.absorbed, self.next_experiment, self.warnings)]

    def __repr__(self) -> str:
        names = f" ({', '.join(c.name for c in self.causes)})" if self.causes else ""
        return f"Diagnosis of {self.study.name}: {self.verdict}{names}"

    def record(self) -> dict[str, Any]:
        """`diagnosis.json` as a dictionary, without the text and the table that a saved result has as well."""
        return {
            "study": self.study.name,
            "verdict": self.verdict,
            "causes": [recorded.cause_record(c, self.was_held_out or c.trial is not None) for c in self.causes],
            "remainder": {
                "unexplained": self.remainder.unexplained,
                "p_value": recorded.p_shown(self.remainder.p_value),
                "where": self.remainder.where,
            },
            "absorbed": list(self.absorbed),
            "nominal": self._model("nominal"),
            "extended": self._model("extended"),
            "noise": {n: {"std": shown(m.std), "ar": [shown(a) for a in m.ar]} for n, m in self.extended.noise.items()},
            "ceiling_percent": shown(self.ceiling_percent),
            "next_experiment": recorded.experiment_record(self.next_experiment),
            **recorded.left_out_record(self.left_out),
            **({"reason": self.reason} if self.reason else {}),
            **({"log": log_table(self.log)} if self.log != Log() else {}),
            **recorded.library_record(self.catalogue),
            **recorded.ahead_record(self.ahead, self.is_driven, self.random),
            "warnings": list(self.warnings),
            "wall_s": round(self.wall_s, 2),
            **({"provenance": self.provenance.record()} if self.provenance else {}),
        }

    def _model(self, which: str) -> dict[str, Any]:
        errors = recorded.errors_record(getattr(self, f"{which}_error"), self.ahead, which)
        return {"parameters": recorded.parameters_record(getattr(self, which)), "error_percent": errors}

    def _notebook(self) -> tuple[str, Sequence[str], Sequence[Sequence[str]], Sequence[str]]:
        rows = [cause_row(c) for c in self.causes]
        return f"{self.study.name}: {self.headline()}", cause_columns(self.gain_name), rows, self.footnotes()

    def columns(self) -> dict[str, list[Any]]:
        """The table of `to_frame`, by columns: a row a parameter of each cause, none without a cause."""
        head = "cause", "stage", "parameter", *CELLS, "p_value", "gain_percent", "gain_low", "gain_high", "equivalents"
        rows = [
            (c.name, c.stage, n, *one.cells(), c.p_value, g.percent, g.low, g.high, ", ".join(c.equivalents))
            for c in self.causes
            for n, one in c.parameters.items()
            for g in (c.gain_held_out,)
        ]
        return by_columns(head, rows)
