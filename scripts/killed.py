"""Kills `fes-pin diagnose` at random moments, half of them while it writes: every file is whole or absent.

    .venv/bin/python scripts/killed.py --count 50 --seed 1

Before every second run the folder holds an earlier answer, of another seed. Afterwards it holds that one, the new one,
or nothing; between two renames, some microseconds, it may hold some files of the new one, each whole. What a killed run
left is gone after the next.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter
from pathlib import Path

STUDY = Path(__file__).parents[1] / "analysis" / "studies" / "ankle_demo"
FILES = {"diagnosis.json", "model.toml", "report.html"}
SAID = {"7": "the earlier answer", "8": "the new answer"}
LONGEST_S = 120.0


def command(out: Path, seed: int) -> list[str]:
    """A diagnosis that does not search long: what is tried is its end."""
    words = ["diagnose", str(STUDY), "--out", str(out), "--seed", str(seed), "--limit", "0"]
    return [sys.executable, "-m", "fes_pin.cli.main", *words]


def kill_one(out: Path, seed: int, whole_s: float, while_writing: bool, chance: random.Random) -> bool:
    """Run until a random moment; True if it was killed before it ended."""
    with subprocess.Popen(command(out, seed), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        if while_writing:
            until = time.monotonic() + LONGEST_S
            while process.poll() is None and time.monotonic() < until:
                if out.is_dir() and any(n.startswith(".fes_pin-") for n in os.listdir(out)):
                    time.sleep(chance.uniform(0.0, 0.01))
                    break
                time.sleep(0.0002)
        else:
            time.sleep(chance.uniform(0.0, whole_s))
        was_running = process.poll() is None
        process.send_signal(signal.SIGKILL)
    return was_running


def state(out: Path) -> str:
    """What stands there: "nothing", "some files", or the seed of the answer.

    Raises
    ------
    AssertionError
        A file is cut, or of another run than the others.
    """
    there = {p.name for p in out.iterdir() if not p.name.startswith(".")} if out.is_dir() else set()
    made = set()
    if "diagnosis.json" in there:
        found = json.loads((out / "diagnosis.json").read_text())["provenance"]
        made.add(found["date"])
        seed = str(found["seed"])
    if "report.html" in there:
        page = (out / "report.html").read_text()
        assert page.endswith("</html>\n"), "the report is cut"
        made.add(re.search(r"<td[^>]*>(\d{4}-[^<]*Z)</td>", page)[1])
    if "model.toml" in there:
        assert tomllib.loads((out / "model.toml").read_text()), "the model is cut"
    assert len(made) < 2, "report and record are of two runs"
    if there < FILES:
        return "some files" if there else "nothing"
    return seed


def main() -> None:
    """Kill, look, and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    chance, seen = random.Random(asked.seed), Counter[str]()
    with tempfile.TemporaryDirectory() as folder:
        earlier, out = Path(folder) / "earlier", Path(folder) / "out"
        subprocess.run(command(earlier, 7), check=True, capture_output=True)
        began = time.perf_counter()
        subprocess.run(command(Path(folder) / "warm", 8), check=True, capture_output=True)
        whole_s = time.perf_counter() - began
        for k in range(asked.count):
            shutil.rmtree(out, ignore_errors=True)
            if k % 2:
                shutil.copytree(earlier, out)
            killed = kill_one(out, 8, whole_s, while_writing=k % 4 > 1, chance=chance)
            now = state(out)
            assert now != "7" or k % 2, "an answer came from nowhere"
            seen[f"{'killed' if killed else 'had ended'}: {SAID.get(now, now)}"] += 1
        subprocess.run(command(out, 8), check=True, capture_output=True)
        assert state(out) == "8" and not [n for n in os.listdir(out) if n.startswith(".fes_pin-")]
    for what, count in sorted(seen.items()):
        print(f"{count:4d}  {what}")
    print(f"{asked.count} runs, every file whole or absent; nothing left behind")


if __name__ == "__main__":
    main()
