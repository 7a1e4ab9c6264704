"""The machine code against CasADi's virtual machine: two ways from the same expressions to numbers."""

import logging
import re
from dataclasses import dataclass

import llvmlite.binding as llvm
import numpy as np
import pytest
from models.cases import CASES, KINDS, RIGS, everything, forget_programs, jitter, name_of, trial, with_effect

from fes_pin import settings
from fes_pin.data.errors import InputError
from fes_pin.models.compile import machine, native, program
from fes_pin.models.compile.equations import derive
from fes_pin.models.compile.layout import WIDE, WIDTH, make_layout
from fes_pin.models.compile.program import VirtualProgram
from fes_pin.models.effects.sensor_offset import SensorOffset
from fes_pin.models.model import Model
from fes_pin.models.simulate import Simulator, max_step, simulate, substeps

TOLERANCE = 1e-10


def lanes(model, kind, rng, n, width=WIDTH):
    """Arguments of `Program.run`: every lane another trial with other parameter values; many have no sensitivities."""
    rig = model.rig
    trials = [trial(rig.name, kind, rng, n) for _ in range(width)]
    inputs = rig.input_columns(trials[0])
    columns = (*model.fitted_parameters(), *rig.unknowns(kind)) if width == WIDTH else ()
    layout = make_layout(model, kind, inputs, columns, width=width)
    steps = substeps(model, trials[0].dt, max_step(model))
    u = np.stack([np.stack([t[c] for c in inputs], axis=1) for t in trials], axis=2)
    values = [jitter(rng, model.parameters(), model.parameter_info()) | rig.initial_unknowns(t) for t in trials]
    delays = np.array([v.get("electromechanical_delay.delay_s", 0.0) for v in values])
    shift = np.floor(delays / trials[0].dt)
    timing = {"t0": 0.3, "dt": trials[0].dt, "step": trials[0].dt / steps}
    constants = [{**rig.constants_of(t), **timing, "shift": k} for t, k in zip(trials, shift, strict=True)]
    p = np.array([[v[name] for v in values] for name in layout.values])
    c = np.array([[k[name] for k in constants] for name in layout.constants])
    return layout, (u, p, c, np.array([rig.guess(t) for t in trials]), steps)


def compare(model, kind, n, width=WIDTH):
    model = model.acting(kind)
    layout, arguments = lanes(model, kind, np.random.default_rng(len(model.effects)), n, width)
    equations = derive(model, layout)
    fast = native.NativeProgram(layout, native.compile_equations(equations)).run(*arguments)
    slow = VirtualProgram(equations).run(*arguments)
    for one, other in zip(fast, slow, strict=True):
        assert np.isfinite(other).all()
        size = np.maximum(np.abs(other).max(axis=0), 1.0)
        assert (np.abs(one - other) / size).max(initial=0.0) <= TOLERANCE
    assert np.ptp(slow[0], axis=2).max() > 0.0  # the lanes do differ
    return fast[1]


@pytest.mark.parametrize(("effect", "rig", "kind"), CASES, ids=name_of)
def test_every_effect_is_the_same_on_both(effect, rig, kind):
    sensitivities = compare(with_effect(rig, effect), kind, 60)
    assert sensitivities.shape[1:] == (len(RIGS[rig].outputs(kind)), sensitivities.shape[2], WIDTH)


@pytest.mark.parametrize("width", [WIDTH, WIDE])
@pytest.mark.parametrize(("rig", "kind"), [(r, k) for r in RIGS for k in KINDS[r]])
def test_all_effects_at_once_are_the_same_on_both(rig, kind, width):
    compare(everything(rig), kind, 40, width)


@pytest.mark.parametrize("count", [3, 6, 11])
def test_a_trial_is_the_same_whoever_runs_beside_it(count):
    model, rng = everything("ankle"), np.random.default_rng(count)
    trials = [trial("ankle", "motion", rng, 30 + k) for k in range(count)]
    together = Simulator(model, trials).run(model.parameters())
    for one, run in zip(trials, together, strict=True):
        (alone,) = Simulator(model, [one]).run(model.parameters())
        assert run.readings == pytest.approx(alone.readings, rel=1e-12, abs=1e-12)


def test_the_guess_is_not_written_to():
    layout, (u, p, c, guess, steps) = lanes(Model(RIGS["ankle"]), "motion", np.random.default_rng(0), 10)
    equations, before = derive(Model(RIGS["ankle"]), layout), guess.copy()
    native.NativeProgram(layout, native.compile_equations(equations)).run(u, p, c, guess, steps)
    assert np.array_equal(guess, before)


@pytest.fixture
def fresh(monkeypatch, tmp_path):
    """No program in memory, and a cache folder of its own."""
    forget_programs()
    monkeypatch.setenv("FES_PIN_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


BARE_MUSCLE = (Model(RIGS["muscle"]), "isometric", ("pulse_width_us",), ())
"""What `answer` runs."""


def answer():
    model, one = Model(RIGS["muscle"]), trial("muscle", "isometric", np.random.default_rng(1))
    return simulate(model, one)["force_n"]


def test_the_environment_chooses_the_engine(fresh, monkeypatch):
    expected = answer()
    monkeypatch.setenv("FES_PIN_ENGINE", "casadi")
    assert answer() == pytest.approx(expected, abs=1e-10)
    assert isinstance(program.compiled_program(BARE_MUSCLE[0], make_layout(*BARE_MUSCLE)), VirtualProgram)
    monkeypatch.setenv("FES_PIN_ENGINE", "llvm")
    assert isinstance(program.compiled_program(BARE_MUSCLE[0], make_layout(*BARE_MUSCLE)), native.NativeProgram)
    monkeypatch.setenv("FES_PIN_ENGINE", "abacus")
    with pytest.raises(InputError, match="FES_PIN_ENGINE: expected llvm or casadi, found 'abacus'"):
        answer()


def test_generic_code_uses_no_wide_registers_and_says_the_same(fresh, monkeypatch):
    """What any x86-64 has: neither AVX nor a fused multiply-add; kept apart from this processor's own."""
    expected = answer()
    monkeypatch.setenv("FES_PIN_CPU", "generic")
    found = answer()
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)
    assert len(list(fresh.iterdir())) == 2
    if "x86_64" in llvm.get_default_triple():
        layout, _ = lanes(everything("ankle"), "motion", np.random.default_rng(0), 10)
        module = llvm.parse_assembly(native.emit(derive(everything("ankle"), layout))[0])
        text = machine.compiling_target(*settings.target()).emit_assembly(module)
        assert "mulpd" in text and not re.search(r"%[yz]mm|vfn?m(add|sub)|\bv[a-z]+pd\b", text)


@pytest.mark.parametrize(("rig", "kind"), [(r, k) for r in RIGS for k in KINDS[r]])
def test_all_effects_at_once_are_the_same_in_generic_code(monkeypatch, rig, kind):
    monkeypatch.setenv("FES_PIN_CPU", "generic")
    compare(everything(rig), kind, 40)


@pytest.mark.parametrize("error", [RuntimeError("no such\nprocessor"), NotImplementedError("CasADi operation 99")])
def test_where_nothing_compiles_the_virtual_machine_runs_and_says_so_once(fresh, monkeypatch, caplog, error):
    expected = answer()
    forget_programs()

    def broken(*_):
        raise error

    monkeypatch.setattr(native, "compile_equations", broken)
    monkeypatch.setenv("FES_PIN_CACHE", str(fresh / "other"))
    with caplog.at_level(logging.WARNING):
        assert answer() == pytest.approx(expected, abs=1e-10)
        simulate(Model(RIGS["joint"]), trial("joint", "motion", np.random.default_rng(1)))
    assert len(caplog.messages) == 1
    assert "virtual machine" in caplog.messages[0]
    assert "\n" not in caplog.messages[0]


def test_programs_are_kept_on_disk(fresh, monkeypatch):
    expected = answer()
    assert len(list(fresh.iterdir())) == 1
    forget_programs()
    monkeypatch.setattr(native, "compile_equations", None)  # would raise if called
    assert np.array_equal(answer(), expected)


@pytest.mark.parametrize("damage", ["empty", "cut", "flipped", "text"])
def test_a_damaged_cache_is_ignored_and_mended(fresh, damage):
    expected = answer()
    (entry,) = fresh.iterdir()
    whole = entry.read_bytes()
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 0x10
    entry.write_bytes({"empty": b"", "cut": whole[:-100], "flipped": bytes(flipped), "text": b"no"}[damage])
    forget_programs()
    assert np.array_equal(answer(), expected)
    assert entry.read_bytes() == whole


def test_a_cache_that_cannot_be_written_is_no_error(fresh, monkeypatch):
    expected = answer()
    forget_programs()
    fresh.parent.joinpath("a file").write_text("")
    monkeypatch.setenv("FES_PIN_CACHE", str(fresh.parent / "a file" / "cache"))
    assert np.array_equal(answer(), expected)


@dataclass(frozen=True)
class Offset(SensorOffset):
    """Somebody's own effect under a name that is taken, with twice the size."""

    def apply(self, value, s):
        return value + 2.0 * self.offset


def test_an_effect_of_the_same_name_is_another_program(fresh):
    one = trial("muscle", "isometric", np.random.default_rng(1))
    bare, ours, theirs = (
        simulate(model, one)["force_n"]
        for model in (
            Model(RIGS["muscle"]),
            Model(RIGS["muscle"]) + SensorOffset(0.5),
            Model(RIGS["muscle"]) + Offset(0.5),
        )
    )
    assert ours - bare == pytest.approx(0.5)
    assert theirs - bare == pytest.approx(1.0)
    assert len(list(fresh.iterdir())) == 2  # whose source may change unseen is not kept


def test_programs_outlive_each_other():
    """An execution engine that is collected must not take the compiler with it."""
    one = "define void @f(double* %x) {\n  ret void\n}"
    for _ in range(3):
        code = machine.MachineCode(machine.compile_object(one))
        assert code.function("f") is not None
        del code
    assert machine.compile_object(one)


@pytest.mark.parametrize(("rig", "kind"), [(r, k) for r in RIGS for k in KINDS[r]])
def test_a_trial_answers_the_same_alone_and_among_others(rig, kind):
    """Bitwise: 1 trial or 9, of other lengths too, in whatever lane."""
    rng = np.random.default_rng(3)
    model = everything(rig)
    trials = [trial(rig, kind, rng, n) for n in (40, 25, 60, 33, 40, 51, 27, 60, 38)]
    columns = model.fitted_parameters()
    together = Simulator(model, trials, columns).run(model.parameters())
    for one, packed in zip(trials, together, strict=True):
        (alone,) = Simulator(model, [one], columns).run(model.parameters())
        assert np.array_equal(alone.readings, packed.readings)
        assert np.array_equal(alone.sensitivities, packed.sensitivities)
