"""Writes docs/static/report_*.png: the report of the demo study by parts, numbered as docs/annotated_report.md counts.

Needs chromium or google-chrome.
"""

import itertools
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from fes_pin.data.study import read_study
from fes_pin.verdict.ask import diagnose
from fes_pin.view.report import report

ROOT = Path(__file__).parents[2]
WIDTH, HEIGHT, MARGIN = 1080, 4000, 12
"""Pixels of the window, and what remains below a part."""
COLOURS = 64
"""Of a picture's palette."""
PARTS = {"verdict": (0, 0), "causes": (1, 2), "missing": (3, 3), "trials": (4, 4), "model": (5, 8)}
"""The first and the last part of the page that a picture shows: its head is 0, its sections follow."""
STYLE = """<style>.n {display: inline-block; min-width: 1em; padding: 0 .25em; margin-right: .4em; border-radius: 1em;
background: #b3261e; color: #fff; font: bold 14px/1.5em sans-serif; text-align: center}
footer, h3 ~ h3, h3 ~ h3 ~ *, .grid ~ details,
.three ~ .three, .three figure:nth-child(n + 5) {display: none}</style>"""
HEADINGS = re.compile(r"<h1[^>]*>|<dt>|<section><h2>")


def main() -> None:
    """Diagnose, and photograph the page."""
    browser = next((p for n in ("chromium", "chromium-browser", "google-chrome") if (p := shutil.which(n))), None)
    if browser is None:
        sys.exit("no chromium or google-chrome on this machine")
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        os.chdir(ROOT)
        report(diagnose(read_study("analysis/studies/ankle_demo")), page)
        begin, *sections = re.split(r"(?=<section><h2>)", numbered(page.read_text(encoding="utf-8")))
        head, header = begin.split("<header>")
        for name, (first, last) in PARTS.items():
            shown = [f"<header>{header}", *sections][first : last + 1]
            page.write_text("".join([head, STYLE, *shown]), encoding="utf-8")
            picture = ROOT / "docs" / "static" / f"report_{name}.png"
            photograph(browser, page, picture)
            print(f"{picture.relative_to(ROOT)}: {picture.stat().st_size / 1000:.0f} kB")


def numbered(text: str) -> str:
    """The page with a number before its verdict, each row of its head, and each section."""
    count = itertools.count(1)
    return HEADINGS.sub(lambda m: f'{m[0]}<span class="n">{next(count)}</span>', text)


def photograph(browser: str, page: Path, picture: Path) -> None:
    """Write what a page shows, without the empty part below it."""
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--window-size={WIDTH},{HEIGHT}"]
    where = [f"--user-data-dir={page.parent / 'profile'}", f"--screenshot={picture}"]
    subprocess.run([browser, *flags, *where, page.as_uri()], check=True, capture_output=True, timeout=60)
    with Image.open(picture) as opened:
        shown = opened.convert("RGB")
    values = np.asarray(shown)
    used = np.flatnonzero((values != values[-1:]).any(axis=(1, 2)))
    shown.crop((0, 0, WIDTH, int(used[-1]) + MARGIN)).quantize(COLOURS).save(picture, optimize=True)


if __name__ == "__main__":
    main()
