"""Writes fes_pin/data/datasets.json from the descriptions (SOURCE.md) of the public data in FES_PIN_DATA or ../shared.

    scripts/generate/dataset_registry.py              repositories, commits, licences, checksums of the converted trials
    scripts/generate/dataset_registry.py --download   also checksums of the upstream files, from their repositories

Upstream files are those that are in the registry already, and their checksums stay; the files of a new data set are
listed there by hand. Data sets that are read as published, or by a command, stay as they are. `--download` needs the
network, and pooch.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import tempfile
from pathlib import Path

from fes_pin.data.conversions import CONVERTERS
from fes_pin.data.datasets import REGISTRY, SOURCE_URL

ROOT = Path(__file__).parents[2]
WANTED = {  # name: first file, SPDX identifier, publication, why not to be fetched
    "biceps_fes": (
        "cocofest/examples/data/biceps_force.pkl", "MIT", "",
        "its file is a pickle, which runs code when it is read: convert it by hand",
    ),
    "free_pendulum": ("SinglePendulumDataForParameterEstimation.mat", "MIT", "arXiv:2205.06231", ""),
    "friction_damper": ("data", "CC-BY-SA-4.0", "Coble, Huggins, Cao, Ricles, Downey, GitHub 2022", ""),
    "rat_muscle": (
        "data/GMe1/dataExp", "MIT", "Reuvers et al., Accuracy of Experimentally Estimated Muscle Properties",
        "the layout of its files is not known here: convert them by hand",
    ),
    "servo_pendulum": ("bam/data.bak/raw", "Apache-2.0", "", ""),
    "walking_subject01": (
        "Pipelines/Gait2354_Simbody", "CC-BY-3.0", "",
        "joint angles and inverse dynamics are computed with OpenSim 4.6: run it on the origin's markers and forces",
    ),
}  # fmt: skip
WHOLE = {"0e09aa9": "0e09aa9d950760277e31c08cd93fd01f39a5af09", "af22604": "af2260462471ff45ac18af159b1327ea51d8db15"}
"""Commits that the descriptions shorten."""


def described(folder: Path) -> tuple[str, str, str]:
    """Title, repository and commit of a SOURCE.md."""
    text = (folder / "SOURCE.md").read_text()
    title = text.splitlines()[0].lstrip("# ")
    found = re.search(r"Origin: (?P<repository>[\w.-]+/[\w.-]+), commit (?P<commit>[0-9a-f]+)", text)
    if found is None:
        found = re.search(r"Origin: (?P<repository>\S+), commit\s+(?P<commit>[0-9a-f]+)", text)
    assert found is not None, folder
    return title, found["repository"], WHOLE.get(found["commit"], found["commit"])


def entry(name: str, folder: Path, known: dict[str, str | None]) -> dict[str, object]:
    """One data set's part of the registry."""
    title, repository, commit = described(folder)
    file, licence, reference, by_hand = WANTED[name]
    trials = sorted((folder / "trials").glob("*.csv")) if name in CONVERTERS else []
    return {
        **{"what": title, "repository": repository, "commit": commit, "file": file, "licence": licence},
        "upstream": known,
        "converted": {f"trials/{t.name}": hashlib.sha256(t.read_bytes()).hexdigest() for t in trials},
        **{"reference": reference, "by_hand": by_hand},
    }


def downloaded(one: dict) -> dict[str, str]:
    """Checksums of a data set's upstream files, fetched."""
    import pooch  # noqa: PLC0415 - only where there is a network

    out = {}
    with tempfile.TemporaryDirectory() as scratch:
        for place in one["upstream"]:
            address = f"{SOURCE_URL}/{one['repository']}/{one['commit']}/{place.replace(' ', '%20')}"
            out[place] = pooch.file_hash(pooch.retrieve(address, None, path=scratch))
    return out


def main() -> None:
    """Write the registry."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--download", action="store_true")
    asked = parser.parse_args()
    data = Path(os.environ.get("FES_PIN_DATA", ROOT.parent / "shared")) / "data"
    before = json.loads(REGISTRY.read_text()) if REGISTRY.exists() else {}
    made = {n: entry(n, data / n, before.get(n, {}).get("upstream", {})) for n in sorted(WANTED)}
    made |= {n: one for n, one in before.items() if n not in WANTED}
    if asked.download:
        for one in made.values():
            one["upstream"] = downloaded(one)
    REGISTRY.write_text(json.dumps({n: made[n] for n in sorted(made)}, indent=1) + "\n")


if __name__ == "__main__":
    main()
