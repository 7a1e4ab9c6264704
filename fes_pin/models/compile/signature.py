"""A fingerprint of the source that compiled models come from."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import version
from pathlib import Path


@cache
def source_signature() -> str:
    """Changes whenever an equation, the compiler or CasADi changes."""
    digest = hashlib.sha256(version("casadi").encode())
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
