"""Which code an answer was made by."""

import hashlib
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
PARTS = (".py", ".csv", ".json", ".css", ".js", ".urdf")
"""Suffixes of the files that an answer or its report may depend on."""


@cache
def code_hash(package: Path = PACKAGE) -> str:
    """SHA-256 of the package's sources, tables and URDFs, as a hexadecimal number.

    Stored answers hold it, so that no answer of other code is served. The version says less: it changes with a release.

    Parameters
    ----------
    package
        Folder of the package. Its URDFs are in it where it is installed, next to it in the repository.
    """
    digest = hashlib.sha256()
    for folder in (package, package.parent / "urdf"):
        for path in sorted(p for p in folder.rglob("*") if p.suffix in PARTS):
            digest.update(path.relative_to(package.parent).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()
