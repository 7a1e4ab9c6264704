"""An answer keeps nothing alive: no object of the package is in a reference cycle once the answer is forgotten.

A cycle holds the arrays of a search until the garbage collector runs: a program that diagnoses one study after another
would use several times the memory, and a tenth more time.
"""

import gc
from collections import Counter

import pytest
from harness.generators import generator_of


@pytest.fixture
def uncollected():
    """The number of objects of the package, by type, that only the garbage collector can release after a call."""

    def left_by(call):
        call()  # what is kept for the next call is made
        gc.collect()
        gc.disable()
        gc.set_debug(gc.DEBUG_SAVEALL)
        try:
            call()
            gc.collect()
            names = [type(one).__module__ + "." + type(one).__qualname__ for one in gc.garbage]
        finally:
            gc.set_debug(0)
            gc.garbage.clear()
            gc.enable()
        return Counter(name for name in names if name.startswith("fes_pin."))

    return left_by


@pytest.mark.parametrize("name", ["free", "imposed", "contrast", "walking"])
def test_nothing_of_an_answer_is_in_a_cycle(name, uncollected, tmp_path):
    generator = generator_of(name)
    study, _ = generator.make(next(iter(generator.plan(20261201))), tmp_path)
    assert not uncollected(lambda: generator.ask(study))


def test_a_cycle_is_found(uncollected):
    class Held:
        __module__ = "fes_pin.of_this_test"

        def __init__(self):
            self.method = self.__init__

    assert uncollected(Held) == {"fes_pin.of_this_test.test_a_cycle_is_found.<locals>.Held": 1}
