"""Programs on CasADi's virtual machine: the oracle of the machine code, and what runs where that cannot be made."""

from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from fes_pin.models.compile.equations import Equations
from fes_pin.models.compile.layout import REST_ITERATIONS, REST_STEP


class VirtualProgram:
    """The same equations and time loop as the machine code, interpreted lane by lane."""

    def __init__(self, equations: Equations) -> None:
        self.layout, self.equations = equations.layout, equations
        self._trajectory = cache(lambda n, substeps: self._sample(substeps).mapaccum("trajectory", n, 2))

    def run(
        self, inputs: np.ndarray, values: np.ndarray, constants: np.ndarray, guess: np.ndarray, substeps: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Simulate all lanes; see `Program`."""
        width, n, lead, channels = self.layout.width, inputs.shape[0], self.layout.reported, self.layout.channels
        out = np.empty((n, self.equations.sizes.reading, width))
        for lane in range(width):
            p, c = values[:, lane], constants[:, lane]
            state, memory = self.equations.functions["start"](self._rest(float(guess[lane]), p, c), p, c)
            trajectory = self._trajectory(n, substeps)
            times = self._times(c, n)
            ended = trajectory(state, memory, inputs[:, :, lane].T, times, ca.repmat(p, 1, n), ca.repmat(c, 1, n))
            out[:, :, lane] = np.array(ended[2]).T
        return out[:, :lead], out[:, lead:].reshape(n, channels, len(self.layout.columns), width)

    def _times(self, constants: np.ndarray, n: int) -> np.ndarray:
        """Time of every sample, shape (1, n)."""
        names = self.layout.constants
        return (constants[names.index("t0")] + np.arange(n) * constants[names.index("dt")])[None, :]

    def _rest(self, z: float, p: np.ndarray, c: np.ndarray) -> float:
        for _ in range(REST_ITERATIONS):
            g, slope = self.equations.functions["rest"](z, p, c)
            with np.errstate(all="ignore"):
                z -= float(np.clip(np.float64(g) / np.float64(slope), -REST_STEP, REST_STEP))
        return z

    def _sample(self, substeps: int) -> ca.Function:
        """From one sample to the next, by classical Runge-Kutta steps of order four."""
        e, layout, f = self.equations, self.layout, self.equations.functions
        names = ("state", "memory", "u", "t", "p", "c")
        sizes = (e.sizes.state, e.sizes.memory, len(layout.inputs), 1, len(layout.values), len(layout.constants))
        state, memory, u, t, p, c = given = [ca.MX.sym(n, k) for n, k in zip(names, sizes, strict=True)]
        held = f["sample"](state, memory, u, t, p, c)
        if "correct" in f:
            state, y = f["correct"](state, held, u, t, p, c)
        else:
            y = f["output"](state, held, u, t, p, c)
        h = c[layout.constants.index("step")]
        for j in range(substeps):

            def rates(x: Any, at: float, since: Any = j * h, begun: Any = (state,) if "follow" in f else ()) -> Any:
                return f["rates"](x, *begun, held, u, t, since, at * h, p, c)

            begun = state[: e.sizes.integrated]
            first = rates(begun, 0.0)
            second = rates(begun + 0.5 * h * first, 0.5)
            third = rates(begun + 0.5 * h * second, 0.5)
            fourth = rates(begun + h * third, 1.0)
            end = begun + h / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
            state = f["follow"](state, end, held, u, t, j * h, 0.5 * h, p, c) if "follow" in f else end
        return ca.Function("sample", given, [state, held, y])
