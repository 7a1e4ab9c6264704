"""Diagnoses of driven joints: how long they take, and how much of that any search may save.

.venv/bin/python scripts/benchmarks/show.py driven
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from harness.generators import generator_of

import fes_pin as fp
from fes_pin.diagnosis import diagnosis
from fes_pin.effort.search import searched
from fes_pin.infer.search import Policy
from fes_pin.models.catalogue import Catalogue
from fes_pin.models.nominal import nominal_model
from fes_pin.models.rigs.joint import Joint

GENERATORS, COUNT, SEED = ("driven", "laboratory", "swing-up"), 6, 20400000
"""The first studies of each generator, from a seed on."""

Rows = list[tuple[str, float, float | None, str]]


def run() -> Rows:
    """Rows of (name, measured, target, unit); each study is diagnosed twice, and the second time counts."""
    with tempfile.TemporaryDirectory(prefix="driven") as folder:
        many = [(name, one) for name in GENERATORS for one in islice(generator_of(name).plan(SEED), COUNT)]
        studies = [(one.hidden, generator_of(name).make(one, _within(Path(folder), one.key))[0]) for name, one in many]
        taken = np.array([_times(study, hidden) for hidden, study in studies])
    whole, effort, known = taken.T
    return [
        ("diagnosis, median", float(np.median(whole)), None, "s"),
        ("search by inverse dynamics, share of the diagnosis", float(np.median(effort / whole)), None, ""),
        ("diagnosis by the likelihood of what is hidden alone, share", float(np.median(known / whole)), None, ""),
    ]


def _within(folder: Path, name: str) -> Path:
    (inner := folder / name).mkdir()
    return inner


def _times(study: fp.Study, hidden: tuple[str, ...]) -> tuple[float, float, float]:
    """Return seconds of a processor: of a diagnosis, of inverse dynamics, and of a diagnosis that knows the answer."""
    joint, kinds = nominal_model(study).rig, Catalogue.effects_for
    assert isinstance(joint, Joint)
    few = patch.object(Catalogue, "effects_for", lambda own, rig: [e for e in kinds(own, rig) if e.name in hidden])
    alone = patch.object(diagnosis, "begun_by_effort", lambda *_: Policy())
    whole = _seconds(lambda: fp.diagnose(study))
    effort = _seconds(lambda: searched(joint, study.trials))
    with few, alone:
        return whole, effort, _seconds(lambda: fp.diagnose(study))


def _seconds(ask: Callable[[], Any]) -> float:
    ask()
    began = time.process_time()
    ask()
    return time.process_time() - began
