"""The result of a diagnosis: named causes with their significance and gain, lack of fit, errors; and it in words."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fes_pin.data.log import Log
from fes_pin.data.results import ModelResult
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.along_motion import effort_band
from fes_pin.diagnosis.errors_ahead import AheadErrors, RandomPart
from fes_pin.diagnosis.experiment import NextExperiment
from fes_pin.identify.error_measures import FREE, ONE_STEP
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.identify.stored import log_table, stored_tables
from fes_pin.infer.result import FITTED, SEEN, STOPPED, Explained, ParameterEstimate, Ranked, shown
from fes_pin.infer.text import percent
from fes_pin.models.assumed import assumed_of
from fes_pin.models.catalogue import Catalogue, installed
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect
from fes_pin.models.store import model_toml

EACH_TRIAL = (
    "amplitudes are each trial's own; in a held-out trial they are estimated from its other parts, and a "
    "prediction from inputs alone leaves the effect out"
)
"""Note for effects whose amplitudes are each trial's own."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Diagnosis(ModelResult):
    """Verdict of a study: "adequate", "causes_found", "unexplained" or "stopped", with the causes that are named.

    Attributes
    ----------
    model
        The extended model: it can be simulated, fitted and diagnosed again.
    nominal_error, extended_error
        E of free simulations.
    ranking
        For each cause, its rivals by shortfall in twice the log-likelihood.
    held_out_by
        The data on which gains and errors are found: a key of `infer.result.ON`.
    left_out
        Samples taken for spikes, by trial and column; in `study` they are interpolated.
    catalogue
        The causes that were searched, as far as the rig can have them.
    seen
        Of an adequate model, for each cause the size of its first amplitude above which it would have been named.
    random, ahead
        Of a driven rig: its process noise, and its errors by horizon.
    log
        Faults of the log that were found; in `study` they are corrected where that is possible.
    is_driven
        Whether a controller answers the reading, or imposes the motion: then errors are judged over the horizon, else
        those of free simulations.
    likeliest
        The maximum of the likelihood of the same set, with which sets and faults of the log are compared; None where
        `extended` is that.
    """

    nominal: LikelihoodFit
    extended: LikelihoodFit
    next_experiment: NextExperiment | None = None
    ranking: Mapping[str, tuple[Ranked, ...]] = field(default_factory=dict)
    held_out_by: str
    left_out: Mapping[str, Mapping[str, tuple[int, ...]]] = field(default_factory=dict)
    catalogue: Catalogue = field(default_factory=installed)
    seen: Mapping[str, ParameterEstimate] = field(default_factory=dict)
    random: tuple[RandomPart, ...] = ()
    ahead: AheadErrors | None = None
    log: Log = field(default_factory=Log)
    is_driven: bool = False
    likeliest: LikelihoodFit | None = None

    @property
    def is_falling(self) -> bool:
        """Whether a driven rig falls over by itself, so that a free simulation says nothing about the model."""
        return self.is_driven and self.ahead is not None and self.ahead.extended.free is None

    @property
    def over_horizon(self) -> AheadErrors | None:
        """Errors by which a rig in closed loop is judged; None of one that is simulated freely."""
        return self.ahead if self.is_driven else None

    @property
    def model(self) -> Model:
        """The extended model."""
        return self.extended.model

    @property
    def judged_on(self) -> str:
        """The predictions whose errors count: over the horizon for a rig in closed loop, else free simulations."""
        return FREE if (ahead := self.over_horizon) is None else ahead.words

    def errors(self) -> list[Explained]:
        """Errors of every kind of prediction, on fitted data and, last, on held-out data."""
        out, ahead, none = [], self.ahead, (None, None)
        fitted = (ahead.nominal, ahead.extended) if ahead else none
        held_out = (ahead.nominal_held_out, ahead.extended_held_out) if ahead else none
        on = (STOPPED if self.is_stopped else FITTED, self.held_out_by)
        for k, (before, after) in enumerate((fitted, held_out)):
            if ahead and before and after:
                out.append(Explained(ONE_STEP, on[k], before.one_step, after.one_step))
                out.append(Explained(ahead.words, on[k], before.horizon, after.horizon, after.noise))
            free, extended = self.nominal_error[k], self.extended_error[k]
            if free is not None and extended is not None:
                out.append(Explained(FREE, on[k], free, extended, self.ceiling_percent))
        return out

    def use_for(self) -> str:
        """See `Result.use_for`: a rig that is driven is predicted over a horizon, and may leave it when simulated."""
        if (ahead := self.over_horizon) is None:
            return ""
        free = (ahead.extended_held_out or ahead.extended).free
        leaves = "falls" if free is None else f"leaves E {percent(free)}"
        return f" for {ahead.words}: a free simulation {leaves}"

    def assumed(self) -> dict[str, str]:
        """See `Result.assumed`: constants that are held, how trials begin, and the estimator."""
        return {**assumed_of(self.nominal.model, self.nominal.trials), **super().assumed()}

    def effect(self, name: str) -> type[Effect] | None:
        """Return the class of a cause; None of a misread condition."""
        return next((e for e in self.catalogue.effects_for(self.model.rig) if e.name == name), None)

    def notes(self) -> list[tuple[str, str]]:
        """Return notes in addition to the table, by topic."""
        left, unit = self.remainder, self.model.rig.units().get("effort", "")
        state = "more than noise" if left.unexplained else "none found"
        where = f", most on {left.where}" if left.where else ""
        own = [e.name for e in self.model.effects if e.each_trial]
        topics = [
            ("noise of the readings alone", f"E {percent(self.ceiling_percent)}"),
            ("falls", "by itself: free errors are meaningless" if self.is_falling else ""),
            *((f"random {r.name}", r.words(unit)) for r in self.random),
            ("lack of fit", self.reason or f"{state} ({left.tested()}{where}){self._left()}"),
            ("left out as spikes", left_out_text(self.left_out, self.study.trials)),
            *(
                (f"{c.name} chosen again", f"in {k[0]} of {k[1]} folds, each without its trials")
                for c in self.causes
                if (k := c.chosen_in_some)
            ),
            (", ".join(own), EACH_TRIAL if own else ""),
            *(
                ("looked for as well", f"{', '.join(names)}, code of {Path(where).name}")
                for where, names in self.catalogue.origins().items()
            ),
            (f"absent ({SEEN} beyond)", ", ".join(f"{n} {p.value:.2g} {p.unit}".strip() for n, p in self.seen.items())),
            ("not testable here", ", ".join(self.absorbed)),
        ]
        return [(topic, words) for topic, words in topics if words] + super().notes()

    def _left(self) -> str:
        """Return how large a lack of fit is: what the extended model leaves of what counts, and what of it is noise."""
        if not self.remainder.unexplained or (one := self.explained) is None:
            return ""
        noise = "" if one.noise is None else f", noise alone {percent(one.noise)}"
        return f": E of {one.what} {percent(one.extended)} stays{noise}"

    def files(self) -> dict[str, str | bytes]:
        """Return the content of every file of the diagnosis but the report, by name: with the extended model."""
        return super().files() | {"model.toml": model_toml(self.model, stored_tables(self.extended, self.log))}

    def own_record(self) -> dict[str, Any]:
        """Return the part of `diagnosis.json` that only a rig has."""
        left_out = {t: {n: len(k) for n, k in columns.items()} for t, columns in self.left_out.items()}
        noise = {n: {"std": shown(m.std), "ar": [shown(a) for a in m.ar]} for n, m in self.extended.noise.items()}
        library = {Path(where).name: names for where, names in self.catalogue.origins().items()}
        seen = {n: {"size": shown(p.value), "unit": p.unit} for n, p in self.seen.items()}
        own = {"absent_beyond": seen, "left_out_samples": left_out, "reason": self.reason}
        own |= {"log": log_table(self.log), "library": library, "effort_band_hz": self._effort_band_hz()}
        models = self.models_record(self._model("nominal"), self._model("extended"), noise)
        return {**models, **{n: value for n, value in own.items() if value}, **self._ahead_record()}

    def _effort_band_hz(self) -> float | None:
        band = effort_band(self.model.rig, self.study.trials)
        return None if band is None else shown(band.low)

    def _ahead_record(self) -> dict[str, Any]:
        """Return the horizon, and of a driven rig its process noise; no key without errors over a horizon."""
        if self.ahead is None:
            return {}
        horizon = {"horizon_s": shown(self.ahead.horizon_s)}
        if not self.is_driven:
            return horizon
        errors, random = self.ahead.extended_held_out or self.ahead.extended, {r.name: r.record() for r in self.random}
        return {**horizon, "horizon_ceiling_percent": shown(errors.noise), "random": random}

    def _model(self, which: str) -> dict[str, Any]:
        fitted, (fit, held_out), ahead = getattr(self, which), getattr(self, f"{which}_error"), self.ahead
        errors = {"fit": shown(fit), "held_out": shown(held_out)}
        if ahead is not None:
            own = getattr(ahead, f"{which}_held_out") or getattr(ahead, which)
            errors |= {n: shown(getattr(own, n)) for n in ("one_step", "horizon", "free")}
        parameters = {n: ParameterEstimate.of(fitted, n, "").record() for n in fitted.free}
        return {"parameters": parameters, "error_percent": errors}


def left_out_text(left_out: Mapping[str, Mapping[str, Sequence[int]]], trials: Sequence[Trial]) -> str:
    """Return in words how many samples of each column were taken for spikes, and in which trials if they are few."""
    lengths = {t.name: len(t) for t in trials}
    found: dict[str, dict[str, int]] = {}
    for trial, columns in left_out.items():
        for name, samples in columns.items():
            found.setdefault(name, {})[trial] = len(samples)
    return ", ".join(
        f"{sum(counts.values())} of {sum(lengths[t] for t in counts)} samples of {name} in "
        + (" and ".join(counts) if len(counts) <= 2 else f"{len(counts)} trials")
        for name, counts in found.items()
    )
