"""The same studies diagnosed under other kernels of linear algebra and in generic machine code: verdicts compared.

Rounding differs between processors. What is compared is what a person reads: the verdict, the causes in their order
with what they cannot be told from, and whether something is left unexplained. Exit code 1 if a study's answers differ.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

SETTINGS = {
    "as it is": {},
    "Prescott": {"OPENBLAS_CORETYPE": "Prescott"},
    "Haswell": {"OPENBLAS_CORETYPE": "Haswell"},
    "generic code": {"FES_PIN_CPU": "generic"},
    "generic, Prescott": {"FES_PIN_CPU": "generic", "OPENBLAS_CORETYPE": "Prescott"},
}
"""Names and environment. Prescott has SSE3 only, Haswell AVX2; OpenBLAS takes a processor's own kernels else."""


def answer(study: Path, setting: dict[str, str]) -> str:
    """What a person reads of a study's diagnosis under a setting, in one line."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "fes_pin.cli.main", "diagnose", str(study), "--out", out]
        ended = subprocess.run(command, env={**os.environ, **setting}, capture_output=True, text=True, check=False)
        if ended.returncode:
            return f"exit code {ended.returncode}: {ended.stderr.strip().splitlines()[-1:]}"
        found = json.loads((Path(out) / "diagnosis.json").read_text())
    causes = [" or ".join([one["name"], *sorted(one["equivalents"])]) for one in found["causes"]]
    left = ["something is left"] if found["remainder"]["unexplained"] else []
    return "; ".join([found["verdict"], *causes, *left])


def main() -> int:
    """Print a line a study, and a line for each answer that differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("studies", nargs="+", type=Path, metavar="STUDY", help="folder of a study")
    parser.add_argument("--settings", nargs="+", choices=SETTINGS, default=list(SETTINGS), help="which to compare")
    given = parser.parse_args()
    odd = 0
    for study in given.studies:
        first, *others = (answer(study, SETTINGS[name]) for name in given.settings)
        print(f"{study.name}: {first}", flush=True)
        for name, other in zip(given.settings[1:], others, strict=True):
            if other != first:
                print(f"    {name}: {other}", flush=True)
        odd += any(other != first for other in others)
    print(f"{len(given.studies)} studies, {len(given.settings)} settings ({', '.join(given.settings)}): {odd} differ")
    return 1 if odd else 0


if __name__ == "__main__":
    raise SystemExit(main())
