"""A slice of `scripts/fuzz`: odd and spoilt input gets an answer or one line, and its checks see what they look for."""

import os
import signal
import tomllib

import numpy as np
import pytest
from fuzz_inputs.batch import in_batches
from fuzz_inputs.cases import KINDS, READING_KINDS, Result, run_case
from fuzz_inputs.check import Answer, call
from fuzz_inputs.oddities import ODDITIES
from fuzz_inputs.stated import mistyped
from fuzz_inputs.studies import RIGS, small_study

from fes_pin.data.errors import InputError
from fes_pin.data.study import Study
from fes_pin.models.compile.program import cache_folder
from fes_pin.models.nominal import nominal_model
from fes_pin.prepare.measured import check_study, measured_study

RNG = np.random.default_rng
FILES = [n for n in range(14) if KINDS[n % len(KINDS)] in {"csv", "model", "trial"}]


@pytest.mark.parametrize("number", FILES)
def test_spoilt_files(tmp_path, number):
    result = run_case(number, 3, tmp_path / "case", cache_folder())
    assert not result.faults, str(result)


@pytest.mark.parametrize("number", range(2 * len(READING_KINDS)))
def test_reading_alone(tmp_path, number):
    result = run_case(number, 3, tmp_path / "case", cache_folder(), reading=True)
    assert not result.faults, str(result)


@pytest.mark.parametrize(("number", "seed"), [(1218, 5)], ids=["a trial of milliseconds"])
def test_what_once_broke_a_promise(tmp_path, number, seed):
    result = run_case(number, seed, tmp_path / "case", cache_folder())
    assert not result.faults, str(result)


@pytest.mark.parametrize("rig", RIGS)
def test_what_is_odd_is_refused_in_one_line_or_told(rig):
    """Every oddity before any fit: the gate itself ends with an answer."""
    study = small_study(np.random.default_rng(1), rig)
    for name, make_odd in ODDITIES.items():
        try:
            odd = measured_study(make_odd(study, np.random.default_rng(1))).study
            assert isinstance(odd, Study), name
            said = check_study(odd, nominal_model(odd))
        except InputError as refused:
            said = [str(refused)]
        assert all(len(words.splitlines()) == 1 for words in said), name


def test_broken_promises_are_seen():
    def faults(code, out="", err="", strays=(), written=False):
        return Answer(code, out, err, 1.0, tuple(strays)).faults(written)

    assert faults(0) == faults(2, err="one line\n") == []
    assert "exit code 97" in faults(97, err="ValueError: no")[0]
    assert faults(-9) and faults(-11) and faults(1)
    assert faults(2, err="two\nlines\n") and faults(2, err="") and faults(2, "out", "line\n")
    assert faults(2, err="line\n", written=True) and faults(0, err="Traceback (most recent call last)")
    assert faults(0, strays=["open /etc/passwd"])
    assert faults(0, err="x.py:3: RuntimeWarning: overflow")
    given = ["check", "/tmp/made/study"]
    assert Answer(2, "", "fes-pin: nothing is right\n", 1.0, ()).faults(False, given)
    assert not Answer(2, "", "fes-pin: study: nothing is right\n", 1.0, ()).faults(False, given)


def test_many_cases_in_one_process_end_as_each_alone(tmp_path):
    def run(number, ask):
        return run_case(number, 5, tmp_path / ("alone" if ask is call else "case"), cache_folder(), True, ask)

    together = list(in_batches(range(len(READING_KINDS)), run))
    alone = [run(number, call) for number in range(len(READING_KINDS))]
    assert [(r.name, r.answer.code, r.faults) for r in together] == [(r.name, r.answer.code, r.faults) for r in alone]


def test_a_case_that_ends_its_process_is_seen_and_the_others_go_on():
    def run(number, ask):
        if number == 1 and ask is not call:
            os.kill(os.getpid(), signal.SIGXCPU)
        return Result(
            f"{number} none", Answer(0, "", "", 1.0, ()), ["of the batch"] * (number == 2 and ask is not call)
        )

    first, ended, odd, last = in_batches(range(4), run)
    assert not first.faults and not last.faults
    assert ended.faults == [f"ended its process, exit code {-signal.SIGXCPU}"]
    assert odd.faults == ["of the batch (not in a process of its own)"]


@pytest.mark.parametrize("number", range(20))
def test_what_is_mistyped_is_toml_again(number):
    text = mistyped(
        '[study]\nname = "a"\n[rig]\nurdf = "b"\n[rig.passive]\nx = 1.0\n[[trial]]\nat = [1]\n', RNG(number)
    )
    assert isinstance(tomllib.loads(text), dict)


def test_a_file_written_elsewhere_is_seen(tmp_path):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    study = small_study(np.random.default_rng(0), "muscle")
    from fes_pin.data.trial_files import write_trial
    from fes_pin.models.store import save_model

    save_model(nominal_model(study), tmp_path / "model.toml")
    write_trial(study.trials[0], tmp_path / "trial.csv")
    given = ["predict", str(tmp_path / "model.toml"), str(tmp_path / "trial.csv"), "--out", str(tmp_path / "out.csv")]
    answer = call(given, [tmp_path / "out.csv", cache_folder()], scratch)
    assert answer.code == 0 and not answer.faults(True), answer
    assert any("out.csv" in f for f in call(given, [cache_folder()], scratch).faults(True))
