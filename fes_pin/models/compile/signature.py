"""A fingerprint of the source that compiled models come from."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import version
from pathlib import Path

from fes_pin.data.sources import code_hash


@cache
def source_signature() -> str:
    """Changes whenever an equation, the compiler or CasADi changes."""
    return hashlib.sha256(f"{version('casadi')} {code_hash(Path(__file__).parents[1])}".encode()).hexdigest()
