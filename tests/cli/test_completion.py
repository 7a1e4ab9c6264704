"""Completion of the shell offers the values that an option or an argument takes."""

import os
import subprocess
import sys

import pytest

from fes_pin.comparison.literature import LITERATURE
from fes_pin.data.datasets import DATASETS
from fes_pin.data.schema import known_rigs

MODELS = [f"hill,{one.name}" for one in LITERATURE]


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        (["diagnose", "it", "--why", "coulomb"], ["coulomb_friction"]),
        (["contrast", "it", "--why", "segment_m"], ["segment_mass"]),
        (["diagnose", "it", "--fail-on", "c"], ["causes_found", "changed"]),
        (["datasets", ""], list(DATASETS)),
        (["new-study", "--rig", ""], list(known_rigs())),
        (["compare", "it", "--models", "hill,"], MODELS),
        (["verif"], ["verify"]),
        (["datasets", "nothing"], []),
    ],
    ids=lambda one: " ".join(one) if isinstance(one, list) else None,
)
def test_values_are_offered(line, offered):
    told = {
        "_FES_PIN_COMPLETE": "complete_bash",
        "COMP_WORDS": " ".join(["fes-pin", *line]),
        "COMP_CWORD": f"{len(line)}",
    }
    code = "from fes_pin.cli.main import main; main()"
    ran = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **told}, capture_output=True, text=True, check=True
    )
    assert sorted(ran.stdout.split()) == sorted(offered), ran.stderr
