"""Public measured data that the documentation and the tests refer to: where they come from, fetched and made studies.

`datasets.json` next to this file is written by `scripts/generate/dataset_registry.py`: repositories at a pinned commit,
licences, checksums.
"""

import hashlib
import json
import logging
import os
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

from fes_pin.data.conversions import CONVERTERS, Files, as_published
from fes_pin.data.errors import InputError, fault_at, optional_library
from fes_pin.data.outputs import Outputs
from fes_pin.data.schema import check_known

VARIABLE = "FES_PIN_DATA"
REGISTRY = Path(__file__).with_name("datasets.json")
SOURCE_URL = "https://raw.githubusercontent.com"
"""Where repositories are fetched from, `/<repository>/<commit>/<path>` below it."""
WALKING_NAME = "walking_subject01"
TIMEOUT_S = 30.0
"""Seconds without an answer after which a server is given up."""


@dataclass(frozen=True)
class Dataset:
    """One public recording.

    Parameters
    ----------
    name
        Of the folder that holds its `study.toml`.
    what
        One line on what was measured.
    repository, commit, file
        Origin on GitHub; `file` is where a person begins to look.
    licence
        SPDX identifier.
    upstream
        SHA-256 of the files that a conversion needs, by path; None where it is not known.
    converted
        SHA-256 of the trials that the documentation was written with, by path in the study.
    reference
        Publication, if there is one.
    by_hand
        Why it cannot be fetched, and what to do instead; "" where it can.
    published
        Of recordings that a study reads as they are, what `as_published` takes; else empty.
    """

    name: str
    what: str
    repository: str
    commit: str
    file: str
    licence: str
    upstream: Mapping[str, str | None] = field(default_factory=dict)
    converted: Mapping[str, str] = field(default_factory=dict)
    reference: str = ""
    by_hand: str = ""
    published: Mapping[str, Any] = field(default_factory=dict)

    @property
    def origin(self) -> str:
        """Where a person finds the upstream file."""
        return f"https://github.com/{self.repository}/blob/{self.commit}/{quote(self.file)}"


DATASETS: Mapping[str, Dataset] = {
    name: Dataset(name=name, **known) for name, known in json.loads(REGISTRY.read_text(encoding="utf-8")).items()
}
WALKING = DATASETS[WALKING_NAME]
"""Not a study: tables of its own (`fes_pin.body.measured_walk.read_walk`)."""


def folders() -> tuple[Path, ...]:
    """Where data sets are looked for: in FES_PIN_DATA and its `data`, else in the user's cache."""
    named = os.environ.get(VARIABLE, "")
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return (Path(named), Path(named) / "data") if named else (cache / "fes_pin" / "datasets",)


def _known(name: str) -> Dataset:
    check_known([name], DATASETS, fault_at())
    return DATASETS[name]


def fetch(name: str) -> Path:
    """Folder of a public data set that is on this machine, as a study that `read_study` reads.

    Parameters
    ----------
    name
        One of `DATASETS`.

    Returns
    -------
    Path
        Its folder below one of `folders`.

    Raises
    ------
    InputError
        Unknown name, or nothing of that name there; the message says how to get it.
    """
    dataset = _known(name)
    for folder in folders():
        if (folder / name / "study.toml").is_file():
            return folder / name
    how = dataset.by_hand or f"`fes-pin datasets {name}` fetches it"
    missing = f"no {name}/study.toml there, nor in another folder that {VARIABLE} names"
    raise InputError(f"{missing}; {how} ({dataset.origin}, {dataset.licence})", file=folders()[0])


def download_all(
    names: Iterable[str], folder: str | Path | None = None, unverified: bool = False, force: bool = False
) -> dict[str, Path]:
    """Fetch data sets from their repositories, and make studies of them: nothing is written where one of them fails.

    Each upstream file must have its checksum, where one is known; where none is, the converted trials must have
    theirs. Nothing is kept of what does not.

    Parameters
    ----------
    names
        Of the data sets.
    folder
        To make `<name>` in; without it the first of `folders`.
    unverified
        Keep files without a known checksum, or whose conversion differs. A wrong checksum of an upstream file is an
        error all the same.
    force
        Write over files in it that were not fetched, or have been changed since.

    Returns
    -------
    dict of Path
        Of each study, by name.

    Raises
    ------
    InputError
        Unknown name, a set that cannot be fetched, no pooch, no answer, a wrong checksum, files that were changed.
    """
    outputs = Outputs("datasets", force)
    places = {name: Path(folder or folders()[0]) / name for name in names}
    made = {name: _fetched(name, place, unverified, outputs) for name, place in places.items()}
    for name, files in made.items():
        outputs.write(places[name], files)
    return places


def _fetched(name: str, target: Path, unverified: bool, outputs: Outputs) -> Files:
    """The files of a data set's study."""
    dataset = _known(name)
    if dataset.by_hand or not (dataset.published or name in CONVERTERS):
        raise InputError(f"{dataset.by_hand}; it is at {dataset.origin} ({dataset.licence})", column=name)
    outputs.claim(target, ("study.toml", *dataset.converted, *dataset.published.get("files", ())))
    with tempfile.TemporaryDirectory(prefix="fes-pin-") as scratch:
        _retrieve(dataset, Path(scratch))
        if dataset.published:
            made = as_published(Path(scratch), dataset.published)
        else:
            made = CONVERTERS[name](Path(scratch), dataset.upstream)
    trusted = all(dataset.upstream.values())
    found = {place: hashlib.sha256(text.encode()).hexdigest() for place, text in made.items()}
    other = [place for place, known in dataset.converted.items() if found.get(place) != known]
    if not trusted and other and not unverified:
        differ = f"{len(other)} of {len(dataset.converted)} trials differ from those that the documentation was written"
        hint = "unverified=True keeps them all the same"
        message = f"{differ} with ({other[0]} is one), and no checksum of its origin is known; {hint}"
        raise InputError(message, column=name)
    how = "as they are" if dataset.published else "converted by fes-pin datasets"
    about = f"# From {dataset.origin}\n# {dataset.licence}; {how}. {dataset.reference}".rstrip()
    made["study.toml"] = f"{about}\n{made['study.toml']}"
    return made


def _retrieve(dataset: Dataset, scratch: Path) -> None:
    """Fetch every upstream file into a folder."""
    pooch = optional_library("pooch", "datasets", "fetching needs pooch", column=dataset.name)
    pooch.get_logger().setLevel(logging.ERROR)
    fetcher = pooch.HTTPDownloader(timeout=TIMEOUT_S)
    for place, known in dataset.upstream.items():
        target = scratch / place
        target.parent.mkdir(parents=True, exist_ok=True)
        address = f"{SOURCE_URL}/{dataset.repository}/{dataset.commit}/{quote(place)}"
        try:
            expected = None if known is None else f"sha256:{known}"
            pooch.retrieve(address, expected, fname=target.name, path=target.parent, downloader=fetcher)
        except Exception as error:
            what = " ".join(f"{type(error).__name__}: {error}".split())
            reason = "its checksum is another" if "does not match the known hash" in what else what[:160]
            raise InputError(f"cannot be fetched: {reason}", file=address) from None
