"""The viewer, pages and live, in a real headless Chromium."""

import io
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest

from fes_pin.body.controllability import modal_controllability
from fes_pin.body.linearize import linearize, model_on_slope
from fes_pin.data.errors import InputError
from fes_pin.muscles.nerve_inputs import subject_nerves
from fes_pin.muscles.nerves import Nerves
from fes_pin.view import live
from fes_pin.view.influence import influence_image, influence_table
from fes_pin.view.live import LiveViewer
from fes_pin.view.viewer import BodyScene, show_influence, show_mode, show_posture, show_walk


@pytest.fixture(scope="session")
def chromium():
    """Path of a Chromium; installed by apt where this is root's machine, else the test says that there is none."""
    names = ("chromium", "chromium-browser", "google-chrome")
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None and shutil.which("apt-get") and os.geteuid() == 0:
        for command in (["apt-get", "update"], ["apt-get", "install", "--yes", "--no-install-recommends", "chromium"]):
            subprocess.run(command, check=False, capture_output=True, timeout=300)
        found = shutil.which("chromium")
    if found is None:
        pytest.skip(f"no browser: none of {', '.join(names)} is installed, and apt-get could not install chromium")
    return found


@pytest.fixture
def screenshot(chromium, tmp_path):
    from matplotlib import image

    def take(page, at="", milliseconds=2000):
        address = page if isinstance(page, str) else page.as_uri()
        out = tmp_path / f"shot{len(list(tmp_path.glob('*.png')))}.png"
        command = [
            *(chromium, "--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
            *(
                "--window-size=500,600",
                f"--virtual-time-budget={milliseconds}",
                f"--user-data-dir={tmp_path / 'profile'}",
            ),
            *(f"--screenshot={out}", f"{address}{at}"),
        ]
        subprocess.run(command, check=True, capture_output=True, timeout=90)
        return image.imread(out)[:, :, :3]

    return take


def skin(picture):
    """Pixels of the body's bare parts: orange-pink, neither floor nor sky."""
    return (picture[..., 0] > 0.55) & (picture[..., 0] - picture[..., 2] > 0.12)


def red(p):
    return ((p[..., 0] > 0.5) & (p[..., 1] < 0.25) & (p[..., 2] < 0.25)).sum()


def changed(one, other):
    return float(np.mean(np.abs(one - other).max(axis=2) > 0.1))


def test_a_mode_shows_a_body_that_moves(body, screenshot, tmp_path):
    linear = linearize(body, "mid_stance")
    page = show_mode(linear, linear.modes()[8]).write(tmp_path / "mode.html")
    forward, again, back = (screenshot(page, f"#t={t}") for t in (0.5, 0.5, 1.5))
    assert skin(forward).sum() > 500  # not blank: there is a person
    assert changed(forward, again) < 1e-4  # it stands still when told to
    assert changed(forward, back) > 0.01  # and moves with time
    left, right = (np.flatnonzero(skin(p).any(axis=0)).mean() for p in (forward, back))
    assert abs(left - right) > 5.0  # the whole body sways


def test_a_live_viewer_shows_one_scene_after_the_other_and_moves(body, screenshot):
    linear = linearize(body, "mid_stance")
    with LiveViewer() as viewer:
        viewer.show(BodyScene(body).pose({"right_ankle_dorsiflexion": 0.3}))
        forward = screenshot(viewer.url)
        viewer.show(BodyScene(body).pose({"right_ankle_dorsiflexion": -0.3}))
        back = screenshot(viewer.url)
        assert skin(forward).sum() > 500
        left, right = (np.flatnonzero(skin(p).any(axis=0)).mean() for p in (forward, back))
        assert abs(left - right) > 20.0
        viewer.show(show_influence(linear, Nerves(), "right_femoral"))
        assert red(screenshot(viewer.url)) > 100
        viewer.show(show_mode(linear, linear.modes()[8]))
        moving = [screenshot(viewer.url, milliseconds=t) for t in (1500, 2000, 2500, 3000)]
        assert red(moving[0]) < 100  # the scene before is gone
        assert max(changed(moving[0], p) for p in moving[1:]) > 0.005
    with pytest.raises(OSError):
        urlopen(viewer.url, timeout=2)


def test_an_open_page_follows_the_next_scene(body, screenshot, monkeypatch):
    """The second scene is shown once the page with the first is open."""
    answer, opened = live._Answer.do_GET, []

    def then_show_the_next(handler):
        answer(handler)
        if handler.path == "/":
            opened.append(handler)
            if len(opened) == 1:
                viewer.show(BodyScene(body).pose({"right_ankle_dorsiflexion": -0.3}))

    with LiveViewer() as viewer:
        viewer.show(BodyScene(body).pose({"right_ankle_dorsiflexion": 0.3}))
        forward = screenshot(viewer.url)
        monkeypatch.setattr(live._Answer, "do_GET", then_show_the_next)
        back = screenshot(viewer.url, milliseconds=4000)
    assert len(opened) == 2  # loaded anew, once
    left, right = (np.flatnonzero(skin(p).any(axis=0)).mean() for p in (forward, back))
    assert abs(left - right) > 20.0


@pytest.mark.parametrize("opened", [True, False], ids=["page open", "at once"])
def test_the_command_serves_until_it_is_interrupted(opened):
    heard = "from signal import *; signal(SIGINT, default_int_handler)"  # a runner may have it ignored
    run = f"{heard}; from fes_pin.cli.main import main; main()"
    command = [sys.executable, "-c", run, "body", "view", "--live", "--mode", "9"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        lines = [process.stdout.readline(), process.stdout.readline()]
        assert "to double" in lines[0]
        url = lines[1].split()[0]
        assert not opened or b"meshcat" in urlopen(url, timeout=10).read()
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=20)
        assert process.returncode == 0 and rest.strip() == "ended" and errors == ""
    finally:
        process.kill()
        process.wait()


def listening(root):
    """Addresses on which a process and its descendants listen, from /proc: hexadecimal IP, port."""
    table = Path("/proc")
    if not (table / "net/tcp").exists():
        pytest.skip("no /proc to list sockets from")
    parents = {}
    for stat in table.glob("[0-9]*/stat"):
        try:
            parents[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
    family = {root}
    while more := {child for child, parent in parents.items() if parent in family} - family:
        family |= more
    inodes = set()
    for member in family:
        for link in table.glob(f"{member}/fd/*"):
            try:
                inodes.add(os.readlink(link))
            except OSError:
                continue
    rows = [r.split() for n in ("tcp", "tcp6") for r in (table / "net" / n).read_text().splitlines()[1:]]
    found = {tuple(r[1].split(":")) for r in rows if r[3] == "0A" and f"socket:[{r[9]}]" in inodes}
    return {(address, int(port, 16)) for address, port in found}


def test_the_live_viewer_listens_to_this_machine_alone_and_dies_with_the_command():
    command = [sys.executable, "-c", "from fes_pin.cli.main import main; main()", "body", "view", "--live"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        process.stdout.readline()
        url = process.stdout.readline().split()[0]
        loopback = "0100007F"  # 127.0.0.1 as /proc writes it
        port = int(url.split(":")[2].split("/")[0])
        assert listening(process.pid) == {(loopback, port)}
        assert b"meshcat" in urlopen(url, timeout=10).read()
    finally:
        process.kill()  # the end that no program can tidy up after
        process.communicate()
    with pytest.raises(OSError):
        urlopen(url, timeout=2)


def test_two_live_viewers_have_a_port_each(body):
    with LiveViewer() as one, LiveViewer() as other:
        assert one.url != other.url
        other.show(BodyScene(body))


def test_a_nerve_paints_the_joints_that_it_turns(body, screenshot, tmp_path):
    linear = linearize(body, "mid_stance")
    plain = screenshot(BodyScene(body).pose("mid_stance").write(tmp_path / "plain.html"))
    scene = show_influence(linear, Nerves(), "right_femoral")
    painted = screenshot(scene.write(tmp_path / "nerve.html"))
    assert red(painted) > 100 > red(plain)
    assert "right_knee_flexion -" in scene.caption
    assert "left_" not in scene.caption


def test_a_page_needs_no_network(body, tmp_path):
    text = BodyScene(body, caption="<b>&").pose("neutral").write(tmp_path / "page.html").read_text()
    assert "src=" not in text.split("<script>")[0]
    assert "&lt;b&gt;&amp;" in text
    assert len(text) < 4_000_000


def test_walking_has_a_frame_a_posture(body):
    frames = np.zeros((5, 19))
    frames[:, body.joint_names.index("left_knee_flexion")] = np.linspace(0.0, 1.0, 5)
    last = show_walk(body, frames, fps=10).commands()[-1].lower()
    assert last["type"] == "set_animation"
    assert {len(track["keys"]) for part in last["animations"] for track in part["clip"]["tracks"]} == {5}
    with pytest.raises(InputError, match="frames"):
        show_walk(body, np.zeros((5, 18)))


def test_a_walk_on_the_spot_puts_a_foot_on_the_ground(body):
    """With the pelvis upright and level, the straight body stands on its sole; with it pitched, on toe or heel."""
    import pinocchio as pin

    frames = np.zeros((2, 19))
    tilted = pin.exp3(np.array([0.0, 0.3, 0.0]))
    scene = show_walk(body, frames, pelvis=np.array([np.eye(3), tilted]))
    level, pitched = scene.roots
    assert level.translation[2] == pytest.approx(0.0, abs=1e-5)
    assert np.allclose(pitched.rotation, tilted)
    assert pitched.translation[2] > 0.02
    with pytest.raises(InputError, match="pelvis"):
        show_walk(body, frames, pelvis=np.eye(3))


def test_heat_map_and_table(body):
    from matplotlib import image

    linear = linearize(body, "mid_stance")
    result = modal_controllability(linear, Nerves(("right_femoral", "right_tibial")))
    for on in ("joints", "modes"):
        picture = image.imread(io.BytesIO(influence_image(result, "png", on)))
        assert picture[..., :3].std() > 0.05
        assert len(influence_table(result, on).splitlines()) == 21
    row = next(line for line in influence_table(result).splitlines() if line.startswith("right_knee_flexion"))
    i = linear.joint_names.index("right_knee_flexion")
    assert float(row.split()[1]) == pytest.approx(np.degrees(result.joint_influence[i, 0]), abs=0.5)
    with pytest.raises(InputError, match="influence"):
        influence_table(result, "muscles")


def placements(scene):
    """Where each drawn thing is at first, by path."""
    lowered = [c.lower() for c in scene.commands()]
    return {c["path"]: np.array(c["matrix"]).reshape(4, 4, order="F") for c in lowered if c["type"] == "set_transform"}


def test_a_slope_tilts_the_floor_and_the_body_and_gravity_is_down(body):
    slope = (0.2, 0.1)
    level, tilted = (placements(show_posture(linearize(body, "mid_stance", s))) for s in ((0.0, 0.0), slope))
    normal = np.array([0.2, 0.1, np.sqrt(1.0 - 0.05)])
    floor = tilted["/meshcat/floor"]
    assert np.allclose(floor[:3, 2], normal)
    gravity = model_on_slope(body, slope).gravity.linear
    assert np.allclose(floor[:3, :3] @ gravity / np.linalg.norm(gravity), [0.0, 0.0, -1.0])
    for path, matrix in level.items():
        if "/body/" in path:
            placed = tilted["/meshcat/body"] @ tilted[path]
            assert np.allclose(placed[:3, :3], floor[:3, :3] @ matrix[:3, :3])
            assert np.allclose(placed[:3, 3], floor[:3, :3] @ matrix[:3, 3])


@pytest.mark.parametrize(
    ("posture", "slope", "says"),
    [
        ("mid_stance", (0.0, 0.0), "mid stance, right foot on the ground"),
        ("standing", (0.0, 0.0), "standing, both feet on the ground"),
        ("mid_stance", (0.2, 0.0), "slope 11.5 degrees (alpha 0.2, beta 0)"),
        ("initial_contact", (0.0, 0.0), "the left one lies 5.5 cm under the ground"),
    ],
)
def test_captions_say_posture_feet_slope_and_what_cannot_be(body, posture, slope, says):
    linear = linearize(body, posture, slope)
    nerves = subject_nerves(body, ["right_femoral"], strength=0.8)
    scenes = [show_posture(linear), show_mode(linear, linear.modes()[0]), show_influence(linear, nerves, nerves.names)]
    for scene in scenes:
        assert says in scene.caption
        assert ("under the ground" in scene.caption) == (posture == "initial_contact")
    assert "at 0.8 of a healthy person's strength" in scenes[2].caption
    assert "1 joints braced" in show_posture(linear.brace("lumbar_bending")).caption or posture == "standing"
