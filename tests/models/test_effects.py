"""What every effect promises; the tests find the effects, and each rig they name, by themselves."""

import inspect
import math
import re
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from models.cases import CASES, EFFECTS_OF_RIGS, IMPOSED_CASES, JOINT, RIGS, everything, name_of, trial, with_effect
from scipy.optimize import newton

from fes_pin.data.errors import InputError
from fes_pin.data.trial import Trial
from fes_pin.models import effects
from fes_pin.models.compile.equations import derive
from fes_pin.models.compile.layout import make_layout
from fes_pin.models.compile.program import VirtualProgram
from fes_pin.models.effects import EFFECTS, effect_named, effects_for
from fes_pin.models.model import Model
from fes_pin.models.rigs import Joint
from fes_pin.models.simulate import Simulator, max_step, simulate
from fes_pin.models.stage import Effect, classes_in, in_order

GOLDEN = Path(__file__).with_name("causes.txt")
NOT_YET = {
    "condition_misread": {"ankle", "joint", "muscle"},
}
"""Rigs of the contract on which a cause is not built yet."""
CASE = pytest.mark.parametrize(("one", "rig", "kind"), [*CASES, *IMPOSED_CASES], ids=name_of)


def golden():
    rows = [line.split() for line in GOLDEN.read_text().splitlines() if not line.startswith("#")]
    return {name: (stage, set(rigs)) for name, stage, *rigs in rows}


BEYOND = {"parallel_stiffness": {"muscle"}}
"""Rigs that a cause has beyond the contract's, which says where it applies at least."""


def test_names_stages_and_rigs_are_the_canonical_ones():
    here = {n: (s, rigs - NOT_YET.get(n, set()) | BEYOND.get(n, set())) for n, (s, rigs) in golden().items()}
    canonical = {n: row for n, row in here.items() if row[0] != "body" and row[1]}
    assert {e.name: (e.stage, set(e.rigs)) for e in EFFECTS} == canonical


def test_the_golden_table_is_the_contract(shared):
    contract = tomllib.loads((shared / "contract" / "effects.toml").read_text())
    assert golden() == {n: (c["stage"], set(c["rigs"])) for n, c in contract.items()}


@pytest.mark.parametrize("one", EFFECTS, ids=name_of)
def test_the_docstring_has_sentence_equation_tell_tale_and_source(one):
    text = inspect.getdoc(one)
    assert text.split("\n")[0].endswith(".")
    assert re.search(r"^\n {4}\S", text[text.index("\n") :], re.MULTILINE), "no indented equation"
    assert "\nTell-tale: " in text
    assert "\nSource: " in text
    assert issubclass(one, type(one.absent()))


@pytest.mark.parametrize("one", EFFECTS, ids=name_of)
def test_parameters_are_inside_their_bounds(one):
    assert one.amplitudes(), "nothing switches it off"
    for name, info in one.parameters().items():
        assert info.lower <= getattr(one(), name) <= info.upper
        assert info.null is None or info.lower <= info.null <= info.upper
        assert all(info.lower <= g <= info.upper for g in info.grid)
        assert info.scale > 0
        assert info.fitted or info.grid, "a choice needs something to choose from"


NEW_CAUSE = '''
from dataclasses import dataclass

from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage


@dataclass(frozen=True)
class JointCreep(Effect):
    """A cause of this test alone."""

    torque_nm: float = parameter(0.1, unit="N m", null=0.0)
    name, stage, signal, rigs = "joint_creep", Stage.JOINT, "torque", ("joint",)

    def apply(self, value, s):
        return value - self.torque_nm
'''


def test_a_cause_is_one_file(tmp_path, monkeypatch):
    """Nothing else has to be edited for it to stand at its place on the path."""
    (tmp_path / "joint_creep.py").write_text(NEW_CAUSE)
    monkeypatch.setattr(effects, "__path__", [*effects.__path__, str(tmp_path)])
    names = [e.name for e in in_order(classes_in(effects.__path__, effects.__name__, Effect))]
    sys.modules.pop("fes_pin.models.effects.joint_creep")
    at = names.index("joint_creep")
    assert names[at - 1 : at + 2] == ["effort_offset", "joint_creep", "joint_stop"]
    assert [n for n in names if n != "joint_creep"] == [e.name for e in EFFECTS]


def test_an_effect_with_attributes_of_an_earlier_version_is_read_and_says_so():
    with pytest.warns(DeprecationWarning) as said:

        class Earlier(Effect):
            beside = ("force_velocity",)
            foretold_step_s = 2e-3

    assert Earlier.screened_with == ("force_velocity",) and Earlier.predictor_step_s == 2e-3
    assert [str(one.message).split(";")[0] for one in said] == [
        "Effect.beside is Effect.screened_with now",
        "Effect.foretold_step_s is Effect.predictor_step_s now",
    ]


def test_effects_are_found_by_name_and_rig():
    assert effect_named("fatigue").name == "fatigue"
    with pytest.raises(InputError, match="tiredness: no such effect: unknown; expected one of"):
        effect_named("tiredness")
    assert {e.name for e in effects_for("muscle")} == {e.name for e, rig in EFFECTS_OF_RIGS if rig == "muscle"}


def run(model, trials, columns=(), max_step_s=None, values=None):
    simulator = Simulator(model, trials, tuple(columns), max_step_s=max_step_s)
    return simulator.run({**model.parameters(), **(values or {})})


def trials_of(rig, kind, seed, count=2, n=300):
    rng = np.random.default_rng(seed)
    return [trial(rig, kind, rng, n) for _ in range(count)]


@CASE
def test_identity_at_the_null(one, rig, kind):
    """At the same integration step the readings are those of the nominal model, to rounding."""
    model, trials = Model(RIGS[rig]) + one.absent(), trials_of(rig, kind, 1)
    step = max_step(model)
    for with_it, without in zip(
        run(model, trials, max_step_s=step), run(Model(RIGS[rig]), trials, max_step_s=step), strict=True
    ):
        scale = np.abs(without.readings).max()
        assert np.abs(with_it.readings - without.readings).max() <= 1e-13 * max(scale, 1.0)


@CASE
def test_continuity_towards_the_null(one, rig, kind):
    """A small amplitude changes the readings in proportion, and as its sensitivity at the null says."""
    model, trials = with_effect(rig, one), trials_of(rig, kind, 2)
    keys = {f"{one.name}.{n}": one.parameters()[n] for n in one.amplitudes()}
    nulls = {k: info.null for k, info in keys.items()}
    at_null = run(model, trials, keys, values=nulls)
    for j, (key, info) in enumerate(keys.items()):
        small = 1e-3 * info.scale
        near, nearer = (run(model, trials, values={**nulls, key: info.null + s}) for s in (small, 0.1 * small))
        for base, a, b in zip(at_null, near, nearer, strict=True):
            slope = base.sensitivities[..., j]
            felt = np.abs(a.readings - base.readings).max()
            tenth = np.abs(b.readings - base.readings - 0.1 * small * slope).max()
            assert tenth <= 0.02 * np.abs(0.1 * small * slope).max() + 1e-11
            assert felt <= 2.0 * np.abs(small * slope).max() + 1e-11


@CASE
def test_sensitivities_are_central_differences(one, rig, kind):
    model = with_effect(rig, one).acting(kind)
    trials = trials_of(rig, kind, 3)
    unknowns = RIGS[rig].unknowns(kind)
    names = (*model.fitted_parameters(), *unknowns)
    info, values = model.parameter_info(), model.parameters()
    initial = [dict(RIGS[rig].initial_unknowns(t)) for t in trials]
    simulator = Simulator(model, trials, names)
    exact = simulator.run(values, initial)
    for j, name in enumerate(names):
        step = 1e-6 * (1.0 if name in unknowns else info[name].scale)

        def moved(by, name=name):
            if name in unknowns:
                return Simulator(model, trials).run(values, [{**u, name: u[name] + by} for u in initial])
            return Simulator(model, trials).run({**values, name: values[name] + by}, initial)

        for sens, up, down in zip(exact, moved(step), moved(-step), strict=True):
            difference = (up.readings - down.readings) / (2.0 * step)
            column = sens.sensitivities[..., j]
            size = np.abs(column).max() + 1e-3 * np.abs(sens.readings).max() / (step * 1e6)
            assert np.abs(difference - column).max() <= 2e-5 * size, name


@pytest.mark.parametrize(("one", "rig", "kind"), [c for c in CASES if c[1] != "joint"], ids=name_of)
def test_a_trial_starts_at_rest(one, rig, kind):
    """All rates vanish at the start, with the effect on; only a joint is given in motion."""
    model, (first,) = with_effect(rig, one).acting(kind), trials_of(rig, kind, 4, count=1)
    layout = make_layout(model, kind, RIGS[rig].input_columns(first), ())
    program = VirtualProgram(derive(model, layout))
    timing = {"t0": 0.0, "dt": first.dt, "step": first.dt / 4, "shift": 0.0}
    p = np.array([model.parameters()[n] for n in layout.values])
    c = np.array([{**RIGS[rig].constants_of(first), **timing}[n] for n in layout.constants])
    z = newton(lambda z: float(program.equations.functions["rest"](z, p, c)[0]), RIGS[rig].guess(first))
    state, memory = program.equations.functions["start"](z, p, c)
    held = program.equations.functions["sample"](state, memory, [0.0], 0.0, p, c)
    rates = np.array(program.equations.functions["rates"](state, held, [0.0], 0.0, 0.0, 0.0, p, c)).ravel()
    assert np.abs(rates).max() <= 1e-9


@pytest.mark.parametrize("rig", ["ankle", "muscle"])
def test_nothing_moves_without_a_stimulus(rig):
    """All effects at once but those that act by the clock."""
    model = everything(rig)
    for effect in model.effects:
        if effect.name in ("periodic_torque", "sensor_drift", "mains_hum"):
            model = model - effect
    for kind in ("motion", "isometric") if rig == "ankle" else ("isometric",):
        (still,) = trials_of(rig, kind, 5, count=1)
        still = still.with_columns(pulse_width_us=np.zeros(len(still)))
        (answer,) = run(model, [still])
        assert np.ptp(answer.readings) <= 1e-9


@pytest.mark.parametrize("one", [e for e in EFFECTS if e.dissipative], ids=name_of)
@pytest.mark.parametrize("speed", [0.05, 1.0, 4.0])
def test_dissipative_effects_add_no_energy(one, speed):
    """Free swings without damping: the energy falls at every sample; with a spring inside it never passes the first."""
    bare = Joint(1.0, 0.0, 1.0, constants=JOINT)
    time = np.arange(4000) * 1e-3
    swing = Trial("swing", "motion", {}, time, {"position0": 0.9 * speed / 4.0, "velocity0": speed})
    frictionless, answer = simulate(Model(bare), swing), simulate(Model(bare) + one(), swing)

    def energy(t):
        q, v = t["position"], t["velocity"]
        height = JOINT["gravity_cos"] * np.sin(q) - JOINT["gravity_sin"] * np.cos(q)
        return 0.5 * JOINT["inertia"] * v * v + height + math.hypot(JOINT["gravity_cos"], JOINT["gravity_sin"])

    start = energy(answer)[0]
    assert np.abs(energy(frictionless) - start).max() <= 1e-9 * start  # the measure itself
    grown = energy(answer) - start if one.states else np.diff(energy(answer))
    assert grown.max() <= 1e-9 * start
    assert energy(answer)[-1] < 0.999 * start


def test_those_that_only_take_energy_say_so():
    assert {e.name for e in EFFECTS if e.dissipative} == {"coulomb_friction", "quadratic_damping", "passive_relaxation"}


def test_a_contact_stretches_by_little_of_the_motion():
    """Where it is read as a position and free: an imposed way, and rates, say nothing of a contact."""
    position = np.linspace(-0.2, 0.3, 50)
    moved = {"position": position, "reading": position, "time": np.arange(50) * 0.01}
    assert effects.CoulombFriction().limits(moved)["stretch"] == (0.0, pytest.approx(0.05))
    assert max(effects.CoulombFriction.grids(moved)["stretch"]) < 0.05
    assert "stretch" not in effects.CoulombFriction().limits({"time": moved["time"]})


def test_a_threshold_may_shift_by_the_widest_pulse():
    """A shift of 417 us was hidden where 400 us were the bound."""
    assert effects.ThresholdShift().limits({"pulse_width_us": np.array([0.0, 957.0])}) == {"shift_us": (-957.0, 957.0)}
    assert effects.ThresholdShift().limits({"time": np.zeros(2)}) == {}


def test_a_reading_that_turns_has_no_curved_characteristic():
    """A wheel of which the speed was recorded was named with a curvature of 2.6e-4 per rad, over 300 rad."""
    cause = effects.SensorNonlinearity(curvature=2.6e-4)
    assert cause.smallest({"position": np.linspace(0.0, 300.0, 50)})["curvature"] > cause.curvature
    assert cause.smallest({"position": np.linspace(-1.5, 1.5, 50)}) == {}
