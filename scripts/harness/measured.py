"""Errors of the model of a diagnosis, of the believed model and of a regression, of studies with recorded efforts.

Trials of the role "held_out" are unseen; of studies without them the last trial is, or the end of a single one.
"""

import sys
import time
from collections.abc import Sequence

import fes_pin as fp
from harness.never_worse import errors_against, withheld


def main(folders: Sequence[str]) -> None:
    """Print a table for each study."""
    for folder in folders:
        study, unseen = withheld(fp.read_study(folder))
        began = time.perf_counter()
        found = fp.diagnose(study)
        named = ", ".join(c.name for c in found.causes)
        print(f"{study.name}: {found.verdict} {named} ({time.perf_counter() - began:.0f} s)")
        print(f"  {'E of, %':18s} {'diagnosis':>10s} {'believed':>10s} {'regression':>10s} {'ratio':>7s}")
        for measure, errors in errors_against(study, found, unseen).items():
            ratio = errors[0] / max(min(errors[1:]), 1e-300)
            print(f"  {measure:18s} {' '.join(f'{e:10.4g}' for e in errors)} {ratio:7.3f}")


if __name__ == "__main__":
    main(sys.argv[1:])
