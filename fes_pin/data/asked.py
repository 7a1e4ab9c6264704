"""What is asked of a long search: checked once, where a public function is entered."""

import math
from collections.abc import Callable
from numbers import Integral

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import between, instance, shortened
from fes_pin.data.study import Study


def asked(
    study: Study, seed: int = 0, limit: float | None = None, progress: Callable[[float, str], None] | None = None
) -> Callable[[float, str], None]:
    """What is called with the progress of a search, once its study, seed and limit of time were checked.

    Raises
    ------
    InputError
        The study is none, the seed is no whole number of 0 or more, the limit no seconds of 0 or more, the progress
        cannot be called.
    """
    instance(study, Study, "study", ": read_study reads one" if isinstance(study, str) else "")
    if not isinstance(seed, Integral) or isinstance(seed, bool) or seed < 0:
        raise InputError(f"must be a whole number of 0 or more, got {shortened(seed)}", column="seed")
    if limit is not None:
        between(limit, 0.0, math.inf, "limit")
    if progress is not None and not callable(progress):
        raise InputError(f"expected a function of a share and words, got {shortened(progress)}", column="progress")
    return progress or (lambda _share, _words: None)
