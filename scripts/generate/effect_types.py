"""Writes fes_pin/models/effects/__init__.pyi, by which type checkers know the effects of that folder by name."""

from pathlib import Path

from fes_pin.models import effects

FILE = Path(effects.__file__).with_suffix(".pyi")
HEAD = '''"""The effects by the names of their classes; written by `scripts/generate/effect_types.py`."""

'''
REST = """
EFFECTS: tuple[type[Effect], ...]

def effect_named(name: str) -> type[Effect]: ...
def effects_for(rig: str) -> tuple[type[Effect], ...]: ...
"""


def text() -> str:
    """The content of the file."""
    of = sorted((one.__module__, one.__name__) for one in effects.EFFECTS)
    lines = [f"from {module} import {name} as {name}\n" for module, name in of]
    return f"{HEAD}{''.join(lines)}from fes_pin.models.stage import Effect\n{REST}"


if __name__ == "__main__":
    FILE.write_text(text())
