"""Which studies a cohort has, and what each is called in it."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from fes_pin.data.errors import InputError

STUDY = "study.toml"


def find_studies(places: Sequence[Path]) -> dict[str, Path]:
    """Every study that is named or lies beneath a folder that is named, by its name in the cohort, in order of names.

    A study is called by its folder, and where two folders have one name by as many of the folders above as tell them
    apart: `anna-knee`, `ben-knee`.

    Raises
    ------
    InputError
        A place that is not there, or holds no study.
    """
    found: dict[Path, None] = {}
    for place in places:
        folder = place.parent if place.name == STUDY else place
        if not folder.is_dir():
            raise InputError("no such folder; expected a study, or a folder that holds studies", file=place)
        own = [folder] if (folder / STUDY).exists() else sorted(p.parent for p in folder.rglob(STUDY))
        if not own:
            raise InputError(f"expected a study, or a folder that holds studies; no {STUDY} in it", file=place)
        found.update(dict.fromkeys(p.resolve() for p in own))
    return dict(sorted(_named(list(found)).items()))


def _named(folders: Sequence[Path]) -> dict[str, Path]:
    parts = [tuple(p for p in f.parts if p not in ("/", "\\")) for f in folders]
    count = Counter(own[-d:] for own in parts for d in range(1, len(own) + 1))
    ends = [next((own[-d:] for d in range(1, len(own)) if count[own[-d:]] == 1), own) for own in parts]
    names = ["-".join(end) or "study" for end in ends]
    many = Counter(names)
    return {_unique(n, k, many): f for k, (n, f) in enumerate(zip(names, folders, strict=True))}


def _unique(name: str, number: int, count: Counter[str]) -> str:
    safe = "".join(c if c.isalnum() or c in "-_.+" else "_" for c in name).lstrip(".")
    return safe if safe and count[name] == 1 else f"{safe}-{number + 1}"
