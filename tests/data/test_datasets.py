"""Public data sets, fetched from a server on this machine that has made-up files in the layouts of the real ones."""

import functools
import hashlib
import json
import re
import shlex
import sys
import threading
from dataclasses import replace
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

from fes_pin.cli import main
from fes_pin.cli.main import app
from fes_pin.data import conversions, datasets
from fes_pin.data.datasets import DATASETS, download_all, fetch
from fes_pin.data.errors import InputError
from fes_pin.data.study import read_study


def _fetched(name, **more):
    return download_all([name], **more)[name]


pytest.importorskip("pooch")
TIME = np.arange(0.0, 2.0, 1.0 / 1024)
PUT = {"servo_pendulum", "friction_damper", "free_pendulum", "torque_limited_pendulum"}
SERVO_LOGS = tuple(DATASETS["servo_pendulum"].upstream)


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def servo(path, number):
    """Rows of 5 to 6 ms; the motor is off in the last quarter."""
    rng = np.random.default_rng(number)
    t = 0.004 + np.cumsum(rng.uniform(0.005, 0.006, 200))
    entries = [
        {
            **{"position": 0.3 * np.sin(x), "speed": 0.5, "load": 100 + k, "input_volts": 7.3, "temp": 28},
            **{"timestamp": x, "goal_position": 0.0, "torque_enable": k < 150},
        }
        for k, x in enumerate(t.tolist())
    ]
    kinds = ("sin_sin", "lift_and_drop", "up_and_down", "sin_time_square")
    log = {"mass": 0.49, "length": 0.1, "kp": 100 * 2 ** (number // 4), "trajectory": kinds[number % 4]}
    path.write_text(json.dumps({**log, "entries": entries}))


def damper(path):
    rows = np.stack([TIME, np.sin(TIME), 0.1 * np.cos(TIME), np.cos(TIME), 0 * TIME, 0 * TIME], axis=1)
    path.write_text(json.dumps({"data": rows.tolist()}))


def pendulum(path):
    from scipy.io import savemat

    def cells(count):
        out = np.empty((count, 2), dtype=object)
        for k in range(count):
            out[k, 0] = np.stack([np.cos(TIME + k), -np.sin(TIME + k)])
            out[k, 1] = 10.0 * k + 1e-3 * np.arange(len(TIME))
        return out

    made = {
        f"{n}_{which}": cells(c)[:, i : i + 1]
        for which, c in (("id", 3), ("vad", 2))
        for i, n in enumerate(("Y", "Time"))
    }
    savemat(path, {**made, "dt": 1e-3})


def swing(path):
    rows = [f"{x:.6f},{np.sin(3.0 * x):.6f},{3.0 * np.cos(3.0 * x):.6f},{0.1 * np.cos(x):.6f}" for x in TIME.tolist()]
    path.write_text("\n".join(["time,position,velocity,torque", *rows]) + "\n")


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    pytest.importorskip("pymatreader")
    root = tmp_path_factory.mktemp("served")
    for name in PUT:
        one = DATASETS[name]
        for number, place in enumerate(one.upstream):
            path = root / one.repository / one.commit / place
            path.parent.mkdir(parents=True, exist_ok=True)
            put = {"friction_damper": damper, "free_pendulum": pendulum, "torque_limited_pendulum": swing}
            {"servo_pendulum": lambda p, k=number: servo(p, k), **put}[name](path)
    serving = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=root))
    thread = threading.Thread(target=serving.serve_forever)
    thread.start()
    yield root, f"http://127.0.0.1:{serving.server_address[1]}"
    serving.shutdown()
    thread.join()
    serving.server_close()


@pytest.fixture
def here(server, tmp_path, monkeypatch):
    monkeypatch.setattr(datasets, "SOURCE_URL", server[1])
    monkeypatch.setenv("FES_PIN_DATA", str(tmp_path))
    return tmp_path


def with_checksums(monkeypatch, root, name, **other):
    one = DATASETS[name]
    base = root / one.repository / one.commit
    known = {p: hashlib.sha256((base / p).read_bytes()).hexdigest() for p in one.upstream}
    monkeypatch.setitem(DATASETS, name, replace(one, upstream={**known, **other}))


@pytest.mark.parametrize("name", sorted(PUT - {"friction_damper"}))
def test_a_data_set_with_its_checksums_becomes_a_study(server, here, monkeypatch, name):
    with_checksums(monkeypatch, server[0], name)
    assert _fetched(name) == here / name == fetch(name)
    study = read_study(here / name)
    assert len(study.trials) == {"servo_pendulum": 16, "free_pendulum": 5, "torque_limited_pendulum": 6}[name]
    assert {t.role for t in study.trials} == {"fit", "held_out"}


def test_the_steps_of_each_conversion(server):
    root = server[0]
    at = {n: root / DATASETS[n].repository / DATASETS[n].commit for n in PUT}
    files = conversions.servo_pendulum(at["servo_pendulum"], DATASETS["servo_pendulum"].upstream)
    rows = np.genfromtxt(files["trials/sin_sin_kp100.csv"].splitlines(), delimiter=",", names=True)
    log = json.loads((at["servo_pendulum"] / SERVO_LOGS[0]).read_text())["entries"]
    t = np.array([e["timestamp"] for e in log])
    assert rows["time_s"][1] == 0.005 and np.allclose(rows["position"], 0.3 * np.sin(t[0] + rows["time_s"]), atol=1e-5)
    volts = 103 / 885 * 7.3  # of the fourth row, which holds until the fifth
    k = int(np.argmax(rows["time_s"] >= t[3] - t[0]))
    assert rows["effort"][k] == pytest.approx(0.3232 / 4.7637 * (volts - 0.3232 * 0.5), rel=1e-5)
    assert not rows["effort"][rows["time_s"] > t[150] - t[0]].any() and rows["effort"].any()
    files = conversions.friction_damper(at["friction_damper"], DATASETS["friction_damper"].upstream)
    rows = np.genfromtxt(files["trials/d3_30lb_1hz_0.5in.csv"].splitlines(), delimiter=",", names=True)
    assert np.allclose(np.diff(rows["time_s"]), 0.002)
    assert np.allclose(rows["position"], 0.0254 * np.sin(rows["time_s"]), rtol=1e-5, atol=1e-7)
    assert np.allclose(rows["effort"], 444.822 * np.cos(rows["time_s"]), rtol=1e-5)
    assert 'kind = "imposed"' in files["study.toml"] and 'group = "30 lb, 2023"' in files["study.toml"]
    files = conversions.free_pendulum(at["free_pendulum"], DATASETS["free_pendulum"].upstream)
    rows = np.genfromtxt(files["trials/held_1.csv"].splitlines(), delimiter=",", names=True)
    assert rows["time_s"][:2].tolist() == [0.0, 0.001]
    assert np.allclose(rows["velocity"], -np.sin(TIME + 1), atol=1e-6)


def test_recordings_that_are_read_as_they_are_stay_so(server, here, monkeypatch):
    with_checksums(monkeypatch, server[0], "torque_limited_pendulum")
    one = DATASETS["torque_limited_pendulum"]
    folder = _fetched(one.name)
    for ours, theirs in one.published["files"].items():
        assert (folder / ours).read_bytes() == (server[0] / one.repository / one.commit / theirs).read_bytes()
    assert (folder / "study.toml").read_text().startswith(f"# From {one.origin}\n# {one.licence}; as they are. ")
    assert set(one.published["files"].values()) == set(one.upstream)
    rates = {t.name: 1.0 / t.dt for t in read_study(folder)}
    stated = {row["file"][9:-4]: row["rate"] for row in one.published["tables"]["trial"] if "rate" in row}
    assert stated and {n: rates[n] for n in stated} == pytest.approx(stated)


def test_a_wrong_checksum_keeps_nothing(server, here, monkeypatch):
    place = SERVO_LOGS[7]
    with_checksums(monkeypatch, server[0], "servo_pendulum", **{place: "0" * 64})
    for unverified in (False, True):
        with pytest.raises(InputError, match=rf"{place}: cannot be fetched: its checksum is another"):
            _fetched("servo_pendulum", unverified=unverified)
    assert not list(here.iterdir())


def test_without_checksums_of_the_origin_the_conversion_must_have_its_own(here):
    with pytest.raises(InputError, match=r"12 of 12 trials differ from those .*unverified=True keeps them"):
        _fetched("friction_damper")
    assert not list(here.iterdir())
    assert (_fetched("friction_damper", unverified=True) / "trials" / "d1_20lb_1hz.csv").is_file()


def test_a_server_that_does_not_have_it(here, monkeypatch):
    monkeypatch.setitem(DATASETS, "free_pendulum", replace(DATASETS["free_pendulum"], commit="0" * 40))
    with pytest.raises(InputError, match="cannot be fetched: HTTPError: 404"):
        _fetched("free_pendulum")
    monkeypatch.setattr(datasets, "SOURCE_URL", "http://127.0.0.1:9")
    with pytest.raises(InputError, match="cannot be fetched: ConnectionError"):
        _fetched("free_pendulum")
    assert not list(here.iterdir())


def test_what_cannot_be_fetched_says_why(here):
    with pytest.raises(InputError, match="pickle, which runs code"):
        _fetched("biceps_fes")
    with pytest.raises(InputError, match="`fes-pin datasets free_pendulum` fetches it"):
        fetch("free_pendulum")
    with pytest.raises(InputError, match="did you mean free_pendulum"):
        _fetched("free_pendulums")


def test_they_are_looked_for_in_the_named_folder_and_its_data(tmp_path, monkeypatch):
    monkeypatch.setenv("FES_PIN_DATA", str(tmp_path))
    for name, folder in (("free_pendulum", tmp_path / "data"), ("biceps_fes", tmp_path)):
        (folder / name).mkdir(parents=True)
        (folder / name / "study.toml").write_text("")
        assert fetch(name) == folder / name
    monkeypatch.delenv("FES_PIN_DATA")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    with pytest.raises(InputError, match=r"cache/fes_pin/datasets: no free_pendulum/study.toml there"):
        fetch("free_pendulum")


def test_the_command(server, here, monkeypatch, capsys):
    with_checksums(monkeypatch, server[0], "free_pendulum")

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["fes-pin", "datasets", *words])
        with pytest.raises(SystemExit) as ended:
            main.main()
        return ended.value.code or 0, capsys.readouterr()

    code, printed = run()
    assert code == 0
    for one in DATASETS.values():
        words = f"{one.name}: {one.what} {one.origin} ({one.licence}) "
        assert words in " ".join(printed.out.split())
    assert "  fes-pin datasets free_pendulum\n" in printed.out
    assert run("free_pendulum")[0] == 0
    assert f"here: {here / 'free_pendulum'}" in run()[1].out
    code, printed = run("rat_muscle")
    assert code == 2 and printed.out == "" and printed.err.count("\n") == 1


def test_commands_that_make_studies_of_recordings_have_options_that_exist(capsys):
    with pytest.raises(SystemExit):
        app(["new-study", "--help"])
    known = set(re.findall(r"--[a-z-]+", capsys.readouterr().out))
    commands = [w.group(1) for one in DATASETS.values() if (w := re.match("`fes-pin new-study (.*)`", one.by_hand))]
    assert len(commands) >= 11
    for command in commands:
        assert {word for word in shlex.split(command) if word.startswith("--")} <= known


@pytest.mark.shared
def test_the_registry_is_what_the_descriptions_say(shared):
    for name, one in DATASETS.items():
        if one.published:  # described by its study
            assert one.upstream and all(one.upstream.values())
            continue
        if not (shared / "data" / name).exists():
            assert one.by_hand and len(one.commit) == 40 and not one.upstream
            continue
        text = (shared / "data" / name / "SOURCE.md").read_text()
        assert one.repository in text and one.commit[:7] in text and text.startswith(f"# {one.what}")
        for place, known in one.converted.items():
            assert hashlib.sha256((shared / "data" / name / place).read_bytes()).hexdigest() == known
        made = name in conversions.CONVERTERS
        assert made == bool(one.upstream) and made != bool(one.by_hand)
