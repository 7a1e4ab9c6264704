"""Charts as SVG text: panels with axes, lines, dots and bands whose colours are those of the page.

A report draws every trial of a study; this writes only what it shows: a few milliseconds a figure.
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from fes_pin.view.style import COLOURS

TICKS = 5
"""Ticks of an axis, about."""

STYLE = """
svg.chart { font: 11px system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
.chart path, .chart rect, .chart circle { vector-effect: non-scaling-stroke; }
.chart .line { fill: none; stroke-linejoin: round; stroke-linecap: round; }
.chart .tick { font-size: 10px; } .chart text { fill: INK; stroke: none; }
.chart .axis { fill: none; stroke: INK; stroke-width: 0.8; }
"""
"""What a chart looks like; INK is replaced by the colour of its axes."""


def colour(name: str) -> str:
    """A colour by its name in `style.COLOURS`, which a page may give another shade."""
    return f"var(--{name}, {COLOURS[name]})"


def ticks(low: float, high: float, count: int = TICKS) -> list[float]:
    """Round numbers between two others: multiples of 1, 2 or 5 times a power of ten."""
    if not high > low:
        return [low]
    rough = (high - low) / max(count, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next((m for m in (1.0, 2.0, 5.0) if m * power >= rough), 10.0)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [k * step for k in range(first, last + 1)]


def tick_text(value: float, step: float) -> str:
    """A tick's number with the digits that distinguish it from its neighbours."""
    if value and (abs(value) >= 1e5 or step < 1e-4):
        return f"{value:.3g}".replace("e+0", "e").replace("e-0", "e-").replace("-", "\N{MINUS SIGN}")
    digits = max(0, -math.floor(math.log10(step) + 1e-9)) if step > 0 else 2
    return f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}")


def limits_of(*curves: np.ndarray) -> tuple[float, float]:
    """What an axis shows of curves: all of them, and some room."""
    low, high = min(float(v.min()) for v in curves), max(float(v.max()) for v in curves)
    room = 0.05 * (high - low) or 1.0
    return low - room, high + room


@dataclass
class Panel:
    """A rectangle with two axes.

    Parameters
    ----------
    left, top, width, height
        Of the rectangle, in the chart's units.
    x, y
        Least and greatest values shown; `y` from bottom to top.
    logarithmic
        True if x is drawn on a logarithmic scale.
    """

    left: float
    top: float
    width: float
    height: float
    x: tuple[float, float]
    y: tuple[float, float]
    logarithmic: bool = False
    parts: list[str] = field(default_factory=list)

    def _across(self, x: np.ndarray | float) -> np.ndarray:
        low, high = self.x
        x = np.asarray(x, dtype=float)
        if self.logarithmic:
            share = np.log(np.maximum(x, low) / low) / math.log(high / low)
        else:
            share = (x - low) / ((high - low) or 1.0)
        return self.left + self.width * share

    def _down(self, y: np.ndarray | float) -> np.ndarray:
        low, high = self.y
        far = 3.0 * ((high - low) or 1.0)
        inside = np.clip(np.asarray(y, dtype=float), low - far, high + far)
        return self.top + self.height * (high - inside) / ((high - low) or 1.0)

    def line(self, x: Sequence[float] | np.ndarray, y: Sequence[float] | np.ndarray, name: str, width: float = 1.0,
             opacity: float = 1.0) -> None:  # fmt: skip
        """A curve; gaps where it is not finite."""
        path, pen = [], "M"
        for a, b in zip(self._across(np.asarray(x)).tolist(), self._down(np.asarray(y)).tolist(), strict=True):
            if math.isnan(b):
                pen = "M"
                continue
            path.append(f"{pen}{a:.1f} {b:.1f}")
            pen = "L" if pen == "M" else ""
        faint = f' opacity="{opacity:g}"' if opacity < 1 else ""
        drawn = " ".join(path).replace(" L", "L").replace(" M", "M")
        self.parts.append(
            f'<path class="line" d="{drawn}" style="stroke: {colour(name)}" stroke-width="{width:g}"{faint}/>'
        )

    def filled(self, x: np.ndarray, y: np.ndarray, name: str, opacity: float = 1.0) -> None:
        """The area between a curve and zero, held from one sample to the next."""
        held = np.repeat(np.asarray(x, dtype=float), 2)[1:]
        values = np.repeat(np.asarray(y, dtype=float), 2)[:-1]
        points = zip(self._across(held).tolist(), self._down(values).tolist(), strict=True)
        base, ends = float(self._down(0.0)), self._across(np.array([held[0], held[-1]])).tolist()
        path = f"M{ends[0]:.1f} {base:.1f}L" + " ".join(f"{a:.1f} {b:.1f}" for a, b in points)
        self.parts.append(
            f'<path d="{path} {ends[1]:.1f} {base:.1f}Z" style="fill: {colour(name)}" opacity="{opacity:g}"/>'
        )

    def dots(self, x: np.ndarray, y: np.ndarray, name: str, size: float = 2.4, opacity: float = 1.0) -> None:
        """Dots as one path of round pen-downs."""
        inside = (np.asarray(y) >= self.y[0]) & (np.asarray(y) <= self.y[1])
        points = zip(
            self._across(np.asarray(x)[inside]).tolist(), self._down(np.asarray(y)[inside]).tolist(), strict=True
        )
        drawn = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in points)
        self.parts.append(
            f'<path class="line" d="{drawn}" style="stroke: {colour(name)}" stroke-width="{size:g}" '
            f'opacity="{opacity:g}"/>'
        )

    def box(self, x: tuple[float, float], y: tuple[float, float], name: str, opacity: float = 1.0) -> None:
        """A filled rectangle, cut at the panel."""
        a, b = np.clip(self._across(np.array(x)), self.left, self.left + self.width).tolist()
        low, high = np.clip(self._down(np.array(y)), self.top, self.top + self.height).tolist()
        self.parts.append(
            f'<rect x="{min(a, b):.1f}" y="{min(low, high):.1f}" width="{abs(b - a):.1f}" '
            f'height="{abs(high - low):.1f}" style="fill: {colour(name)}" opacity="{opacity:g}"/>'
        )

    def dot(self, x: float, y: float, name: str, hollow: bool = False) -> None:
        """One marker."""
        fill = "none" if hollow else colour(name)
        self.parts.append(
            f'<circle cx="{float(self._across(x)):.1f}" cy="{float(self._down(y)):.1f}" r="4" '
            f'style="fill: {fill}; stroke: {colour(name)}" stroke-width="1.6"/>'
        )

    def zero(self) -> None:
        """A faint line at y = 0."""
        self.line(list(self.x), [0.0, 0.0], "faint", 0.8)

    def text(self, x: float, y: float, words: str, anchor: str = "start", name: str = "", class_: str = "tick",
             turned: bool = False) -> None:  # fmt: skip
        """Words at a place of the chart, not of the axes."""
        style = f' style="fill: {colour(name)}"' if name else ""
        turn = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turned else ""
        self.parts.append(
            f'<text class="{class_}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{style}{turn}>'
            f"{html.escape(words)}</text>"
        )

    def x_axis(self, words: str, at: Sequence[tuple[float, str]] | None = None) -> None:
        """The axis beneath, with its title."""
        bottom = self.top + self.height
        made = _labelled(self.x, max(3, round(self.width / 55))) if at is None else at
        marks = "".join(f"M{float(self._across(v)):.1f} {bottom:.1f}v4" for v, _ in made)
        self.parts.append(f'<path class="axis" d="M{self.left:.1f} {bottom:.1f}h{self.width:.1f}{marks}"/>')
        for value, shown in made:
            self.text(float(self._across(value)), bottom + 15, shown, "middle")
        self.text(self.left + self.width / 2, bottom + 30, words, "middle", class_="title")

    def y_axis(self, words: str, at: Sequence[tuple[float, str]] | None = None, title_at: float = 14.0) -> None:
        """The axis on the left, with its title turned."""
        made = _labelled(self.y, max(2, round(self.height / 34))) if at is None else at
        marks = "".join(f"M{self.left:.1f} {float(self._down(v)):.1f}h-4" for v, _ in made)
        self.parts.append(f'<path class="axis" d="M{self.left:.1f} {self.top:.1f}v{self.height:.1f}{marks}"/>')
        for value, shown in made:
            self.text(self.left - 6, float(self._down(value)) + 3.5, shown, "end")
        lines = words.split("\n")
        for k, line in enumerate(lines):
            self.text(
                title_at + 12 * (k - len(lines) + 1), self.top + self.height / 2, line, "middle", "", "title", True
            )


def _labelled(limits: tuple[float, float], count: int) -> list[tuple[float, str]]:
    made = next((m for k in range(count, 3 * count) if len(m := ticks(*limits, k)) > 1), [limits[0]])
    step = made[1] - made[0] if len(made) > 1 else abs(made[0]) or 1.0
    return [(v, tick_text(v, step)) for v in made]


def svg(panels: Sequence[Panel], width: float, height: float, description: str, alone: bool = False) -> str:
    """A chart as an `<svg>` element.

    Parameters
    ----------
    panels
        What it shows.
    width, height
        Its units; in a page it fills its place.
    description
        What it shows, with its values, for those who cannot see it.
    alone
        True for a file of its own, which brings its colours.
    """
    label = html.escape(description, quote=True)
    inner = "".join("".join(p.parts) for p in panels)
    style, size = "", ""
    if alone:
        style = f"<style>{STYLE.replace('INK', COLOURS['ink'])}</style>"
        for name, value in COLOURS.items():
            inner = inner.replace(colour(name), value)
        style += f'<rect width="{width:g}" height="{height:g}" fill="#ffffff"/>'
        size = f' width="{width:g}" height="{height:g}"'
    return (
        f'<svg class="chart" viewBox="0 0 {width:g} {height:g}"{size} role="img" aria-label="{label}" '
        f'xmlns="http://www.w3.org/2000/svg">{style}{inner}</svg>'
    )
