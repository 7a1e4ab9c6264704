"""Names, order and sizes of what goes in and out of a program."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.models.model import Model
from fes_pin.models.session import PAST

WIDTH = 4
"""Lanes that run side by side: one AVX2 register. With eight, models with sensitivities spill (1.4 times slower)."""
WIDE = 8
"""Lanes without sensitivities: a chain of dependent operations takes as long for eight lanes as for four."""

REST_ITERATIONS = 40
"""Newton steps to the static equilibrium; steps are held to REST_STEP, so 40 of them cross any joint's range."""
REST_STEP = 0.2
"""Longest such step, rad."""

TIMING = ("t0", "dt", "step", "shift")
"""Constants that every program reads: time of the first sample, sample and integration step, whole samples of delay."""


@dataclass(frozen=True)
class Layout:
    """Names and order of what goes in and out of a compiled program."""

    kind: str
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    unknowns: tuple[str, ...]
    constants: tuple[str, ...]
    outputs: tuple[str, ...]
    columns: tuple[str, ...]
    """Parameters and unknowns with respect to which the program gives sensitivities."""
    fixed: tuple[tuple[str, float], ...]
    """Parameters of forms that are switched off, with the values that are compiled in: such forms cost nothing."""
    measured: tuple[str, ...] = ()
    """Outputs whose measurement corrects the states; none of a simulation. See `compile.predictor`."""
    width: int = WIDTH
    """Lanes that run side by side."""

    def parted(self, written: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What a program writes of each sample, as `Program.run` gives it: the readings, and their sensitivities.

        The readings of a predictor are innovations and their variances.
        """
        n, _, width = written.shape
        channels = len(self.measured or self.outputs)
        lead = 2 * channels if self.measured else channels
        return written[:, :lead], written[:, lead:].reshape(n, channels, len(self.columns), width)

    @property
    def values(self) -> tuple[str, ...]:
        """Everything that is a parameter to the program."""
        return (*self.parameters, *self.unknowns)


def widest(columns: Sequence[str]) -> int:
    """Return the number of lanes of a batch with sensitivities to such columns, or with none."""
    return WIDTH if columns else WIDE


def width_of(count: int) -> int:
    """Return the number of lanes of a program for at most so many trials."""
    return WIDTH if count <= WIDTH else WIDE


@dataclass(frozen=True)
class Sizes:
    """Lengths of the vectors that a program keeps, of what is integrated: the first entries of the states, and of what
    does not change in a run or a step (`kept`)."""

    state: int
    memory: int
    reading: int
    integrated: int
    kept: int = 0

    @property
    def scratch(self) -> int:
        """Vectors that a run works in: states five times, memories twice, each with one to spare, and what is kept."""
        return 5 * (self.state + 1) + 2 * (self.memory + 1) + self.kept


def make_layout(
    model: Model,
    kind: str,
    inputs: tuple[str, ...],
    columns: tuple[str, ...],
    measured: tuple[str, ...] = (),
    width: int = WIDTH,
) -> Layout:
    """The layout of a model's program.

    Parameters
    ----------
    kind
        Kind of trial.
    inputs
        Input columns of the trials.
    columns
        Parameters and unknowns to give sensitivities for.
    measured
        Outputs whose measurement corrects the states, for a predictor.
    width
        Lanes that run side by side.
    """
    rig = model.rig
    noise: tuple[str, ...] = ()  # of a predictor: deviations of reading noise and initial states, of random states too
    if measured:
        noise = (*(f"white.{n}" for n in measured), *(f"prior.{n}" for n in rig.unknowns(kind)))
        noise = (*noise, *(n for e in model.effects for n in e.random))
    # what was measured, whether it was, and how often the same was read in a row
    readings = (f"{what}.{n}" for what in ("measured", "seen", "repeated") for n in measured)
    past = PAST if any(e.remembers for e in model.effects) else ()
    fixed = {n: value for n, value in model.unused_parameters().items() if n not in columns}
    return Layout(
        kind=kind,
        inputs=(*inputs, *readings),
        parameters=tuple(n for n in model.parameters() if n not in fixed),
        unknowns=model.unknowns(kind),
        constants=(*rig.constant_names(kind), *rig.motion_names(kind), *past, *TIMING, *noise),
        outputs=rig.outputs(kind),
        columns=columns,
        fixed=tuple(fixed.items()),
        measured=measured,
        width=width,
    )
