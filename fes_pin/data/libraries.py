"""Libraries that are installed with an extra of the package only."""

import importlib
from pathlib import Path
from typing import Any

from fes_pin.data.errors import InputError


def optional_library(
    module: str, extra: str, needed: str, *, file: str | Path | None = None, column: str | None = None
) -> Any:
    """A module of a library that an extra brings.

    Parameters
    ----------
    module, extra
        Its name, and that of the extra.
    needed
        What needs it, as in "frames need pandas".
    file, column
        Where an error is.

    Raises
    ------
    InputError
        It is not installed; the message says how to install it.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        message = f"{needed}: pip install 'fes-pin[{extra}]'"
        raise InputError(message, file=file, column=column) from None
