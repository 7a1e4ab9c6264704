"""Influence of inputs on joints and modes, as a table and as a heat map: what the paper announces at its end."""

import io
from pathlib import Path

import numpy as np

from fes_pin.body.controllability import ModalControllability
from fes_pin.data.errors import InputError


def _matrix(result: ModalControllability, on: str) -> tuple[np.ndarray, list[str]]:
    if on == "joints":
        return np.degrees(result.joint_influence), list(result.linear.joint_names)
    if on == "modes":
        return np.degrees(result.mode_influence), [mode.name for mode in result.modes]
    raise InputError(f"influence is on 'joints' or 'modes', not {on!r}")


def influence_table(result: ModalControllability, on: str = "joints") -> str:
    """Acceleration per full input, deg/s2, one row a joint or mode, one column an input.

    Parameters
    ----------
    result
        From `controllability`.
    on
        `joints` or `modes` (of a mode, its joint that moves most).

    Raises
    ------
    InputError
        Neither.
    """
    values, rows = _matrix(result, on)
    width = max(len(row) for row in rows)
    lines = [f"deg/s2 per full input; columns: {', '.join(f'{k + 1} {n}' for k, n in enumerate(result.inputs.names))}"]
    lines.append(" " * width + "".join(f"{k + 1:9d}" for k in range(result.inputs.n)))
    lines += [f"{row:{width}s}" + "".join(f"{v:9.0f}" for v in line) for row, line in zip(rows, values, strict=True)]
    return "\n".join(lines)


def check_image(path: str | Path) -> str:
    """The kind of image that a file's suffix names: png, svg, pdf ...

    Raises
    ------
    InputError
        It names none that can be drawn.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415

    kind = Path(path).suffix.lower().removeprefix(".")
    if kind not in (kinds := sorted(Figure().canvas.get_supported_filetypes())):
        raise InputError(f"expected a name that ends in one of {', '.join(kinds)}", file=path)
    return kind


def influence_image(result: ModalControllability, kind: str, on: str = "joints") -> bytes:
    """The table as a heat map (logarithmic, red positive, blue negative): an image of this kind.

    Raises
    ------
    InputError
        `on` is neither `joints` nor `modes`.
    """
    from matplotlib.colors import SymLogNorm  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    values, rows = _matrix(result, on)
    figure = Figure(figsize=(3.6 + 0.34 * values.shape[1] + 0.05 * max(map(len, rows)), 2.4 + 0.27 * len(rows)))
    axes = figure.subplots()
    top = np.abs(values).max(initial=1.0)
    image = axes.imshow(values, cmap="RdBu_r", norm=SymLogNorm(1e-3 * top, vmin=-top, vmax=top), aspect="auto")
    axes.set_xticks(range(values.shape[1]), result.inputs.names, rotation=60, ha="right", fontsize=8)
    axes.set_yticks(range(len(rows)), rows, fontsize=8)
    axes.set_title(f"What each input does to each of the {on}, at first", fontsize=10)
    figure.colorbar(image, ax=axes, label="deg/s² per full input")
    figure.tight_layout()
    stream = io.BytesIO()
    figure.savefig(stream, format=kind, dpi=120)
    return stream.getvalue()
