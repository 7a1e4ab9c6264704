"""Called from many threads at once, the library answers what it answers one: no state that they share changes."""

import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from models.cases import RIGS, forget_programs, trial
from threadpoolctl import threadpool_info, threadpool_limits

from fes_pin import workers
from fes_pin.body.build import Body
from fes_pin.body.linearize import linearize
from fes_pin.models.compile import machine, program
from fes_pin.models.compile.native import NativeProgram
from fes_pin.models.compile.program import VirtualProgram
from fes_pin.models.effects.electromechanical_delay import ElectromechanicalDelay
from fes_pin.models.effects.sensor_offset import SensorOffset
from fes_pin.models.model import Model
from fes_pin.models.predictor import Predictor, StateSpaceNoise
from fes_pin.models.simulate import Simulator, simulated_trial
from fes_pin.muscles.nerves import Nerves
from fes_pin.search.fit import fit
from fes_pin.workers import in_parallel, one_thread_each

THREADS = 8


def elsewhere_at_every_line(frame, event, _):
    """A trace that lets other threads run before every line of the package's own code."""
    if "fes_pin" not in frame.f_code.co_filename:
        return None
    if event == "line":
        time.sleep(0.0)
    return elsewhere_at_every_line


def alone_and_together(function, items, same=np.testing.assert_array_equal):
    """Every item by one thread, then all of them by eight that start at once."""
    alone, gate = [function(item) for item in items], threading.Barrier(THREADS)

    def wait_and_do(share):
        gate.wait()
        sys.settrace(elsewhere_at_every_line)
        try:
            return [function(item) for item in share]
        finally:
            sys.settrace(None)

    with ThreadPoolExecutor(THREADS) as pool:
        shares = list(pool.map(wait_and_do, [items[k::THREADS] for k in range(THREADS)]))
    for k, share in enumerate(shares):
        for one, other in zip(alone[k::THREADS], share, strict=True):
            same(one, other)


def test_a_simulator_that_delays_the_stimulus_is_shared():
    """Every delay shifts the inputs by other samples; the last shifted ones are kept."""
    rng = np.random.default_rng(0)
    model = Model(RIGS["muscle"]) + ElectromechanicalDelay(delay_s=0.01)
    simulator = Simulator(model, [trial("muscle", "isometric", rng, 200) for _ in range(2)])

    def run(delay_s):
        values = {**model.parameters(), "electromechanical_delay.delay_s": delay_s}
        return np.array([s.readings for s in simulator.run(values)])

    alone_and_together(run, list(rng.choice([0.005, 0.010, 0.015, 0.020, 0.025], 400)))


def test_a_predictor_that_delays_the_stimulus_is_shared():
    rng = np.random.default_rng(5)
    model = Model(RIGS["muscle"]) + ElectromechanicalDelay(delay_s=0.01)
    bare = trial("muscle", "isometric", rng, 100)
    measured = bare.with_columns(force_n=simulated_trial(model, bare)["force_n"] + 0.2 * rng.standard_normal(100))
    predictor, noise = Predictor(model, [measured], (), (), [{}]), StateSpaceNoise({"force_n": 0.2})

    def run(delay_s):
        values = {**model.parameters(), "electromechanical_delay.delay_s": delay_s}
        (told,) = predictor.run(values, noise, [{}])
        return told.values

    alone_and_together(run, list(rng.choice([0.005, 0.010, 0.015, 0.020, 0.025], 400)))


@pytest.mark.parametrize("engine", program.settings.ENGINES)
def test_models_are_compiled_and_run_side_by_side(engine, monkeypatch):
    """From an empty memory: threads meet while a program is made."""
    monkeypatch.setenv("FES_PIN_ENGINE", engine)
    rng = np.random.default_rng(1)
    models = [Model(rig) + SensorOffset() for rig in RIGS.values()]
    models += [Model(rig) for rig in RIGS.values()]
    kinds = {"ankle": "motion", "joint": "motion", "muscle": "isometric"}
    cases = [(m, trial(m.rig.name, kinds[m.rig.name], rng, 40)) for m in models for _ in range(4)]

    def run(case):
        model, one = case
        simulated = simulated_trial(model, one)
        return np.column_stack([simulated[n] for n in model.rig.outputs(one.kind)])

    alone = [run(case) for case in cases]
    forget_programs()
    with ThreadPoolExecutor(THREADS) as pool:
        together = list(pool.map(run, cases))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one, other)


def test_fits_side_by_side():
    rng = np.random.default_rng(2)
    model = Model(RIGS["muscle"])
    trials = []
    for _ in range(8):
        bare = trial("muscle", "isometric", rng, 200)
        force = simulated_trial(model, bare)["force_n"]
        trials.append(bare.with_columns(force_n=force + 0.2 * rng.standard_normal(200)))
    start = model.with_parameters({n: 1.2 * model.parameters()[n] for n in model.fitted_parameters()})
    names = model.fitted_parameters()

    def fitted(one):
        values = fit(start, [one]).values
        return np.array([values[n] for n in names])

    alone_and_together(fitted, trials)


def test_a_body_and_its_nerves_are_shared():
    body = Body.from_subject(mass_kg=72.6, height_m=1.80, sex="male", stance="right")
    nerves, rng = Nerves(["left_femoral", "left_tibial", "right_hamstrings"]), np.random.default_rng(3)
    postures = [{"left_knee_flexion": a, "right_hip_flexion": b} for a, b in rng.uniform(0.0, 0.5, (24, 2))]

    def seen(posture):
        linear = linearize(body, posture)
        return np.concatenate([linear.A.ravel(), linear.B.ravel(), nerves.torque_matrix(posture).ravel()])

    alone_and_together(seen, postures)


def linear_algebra_threads():
    return [one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"]


def in_another_thread(function):
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(function).result()


def test_linear_algebra_is_limited_whichever_thread_asks_for_it():
    """Although the thread that set the pool before still lives, and holds it."""
    with threadpool_limits(2, user_api="blas"):
        before = linear_algebra_threads()
        assert set(before) == {2}

        def limited():
            with one_thread_each():
                return linear_algebra_threads()

        for ask in (limited, lambda: in_another_thread(limited), limited):
            assert set(ask()) == {1}
            assert linear_algebra_threads() == before


def test_the_limit_that_one_thread_began_another_ends():
    with threadpool_limits(2, user_api="blas"):
        before, one = linear_algebra_threads(), one_thread_each()
        in_another_thread(one.__enter__)
        assert set(linear_algebra_threads()) == {1}
        one.__exit__(None, None, None)
        assert linear_algebra_threads() == before


@pytest.mark.parametrize("engine", program.settings.ENGINES)
def test_no_lock_is_held_while_a_model_is_simulated(engine, monkeypatch):
    monkeypatch.setenv("FES_PIN_ENGINE", engine)
    rng, held = np.random.default_rng(4), []
    model = Model(RIGS["muscle"]) + SensorOffset()
    bare = trial("muscle", "isometric", rng, 60)
    measured = bare.with_columns(force_n=simulated_trial(model, bare)["force_n"] + 0.2 * rng.standard_normal(60))
    kind = VirtualProgram if engine == "casadi" else NativeProgram
    run = kind.run

    def watched(*given):
        held.extend(lock.locked() for lock in (program._LOCK, machine._LOCK, workers._LIMIT._lock))
        return run(*given)

    monkeypatch.setattr(kind, "run", watched)
    fit(model, [measured])
    assert len(held) > 10
    assert not any(held)


def test_the_limit_on_linear_algebra_ends_with_its_last_user():
    before = linear_algebra_threads()
    first, second = one_thread_each(), one_thread_each()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert set(linear_algebra_threads()) <= {1}  # the second still counts on it
    second.__exit__(None, None, None)
    assert linear_algebra_threads() == before


def test_work_beside_other_work_stays_in_its_own_thread(monkeypatch):
    """A fit among others evaluates its points one after another: threads are not multiplied."""
    monkeypatch.setenv("FES_PIN_THREADS", "4")

    def rows(k):
        return threading.get_ident(), in_parallel(lambda j: (threading.get_ident(), 10 * k + j), range(5))

    outer = in_parallel(rows, range(6))
    assert [[value for _, value in inner] for _, inner in outer] == [[10 * k + j for j in range(5)] for k in range(6)]
    assert all(thread == own for own, inner in outer for thread, _ in inner)
    assert all(own != threading.get_ident() for own, _ in outer)
