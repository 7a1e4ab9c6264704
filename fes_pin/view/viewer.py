"""The body to look at: poses, gait, modes in motion, and what a nerve turns, as one HTML page that needs no server.

Pages hold meshcat's own viewer and the drawing commands; they open in any browser, without a network. With `#t=0.4` at
the end of its address a page stands still at that many seconds.
"""

from __future__ import annotations

import base64
import html
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from string import Template
from types import SimpleNamespace

import numpy as np
import pinocchio as pin

from fes_pin.body.build import Body
from fes_pin.body.ground import LEVEL_M, sole
from fes_pin.body.inputs import Inputs
from fes_pin.body.joints import JOINTS, SIDES, BodyJoint
from fes_pin.body.linear_body import LinearBody
from fes_pin.body.linearize import ground_normal
from fes_pin.body.modes import Mode
from fes_pin.data.errors import InputError
from fes_pin.data.named import NamedArray
from fes_pin.data.numbers import instance
from fes_pin.data.outputs import HTML, written_by
from fes_pin.view.arrows import Arrow, draw_arrow

FRAMES_A_SECOND = 30
MODE_SWING_DEG, MODE_PERIOD_S = 12.0, 2.0
"""Range and speed of the joint that moves most in an animation: to be visible, not to scale."""


@dataclass
class BodyScene:
    """A body in a pose or in motion.

    Parameters
    ----------
    body
        The body.
    caption
        Text shown on the page.
    fps
        Frames a second of motions.
    opacity
        Of the body, 0 to 1: what lies within it is seen through it.
    slope
        Of the ground under the stance foot, as `linearize` takes it: ground and body are tilted.
    """

    body: Body
    caption: str = ""
    fps: int = FRAMES_A_SECOND
    opacity: float = 1.0
    slope: Sequence[float] = (0.0, 0.0)
    frames: list[np.ndarray] = field(default_factory=list)
    roots: list[pin.SE3] = field(default_factory=list)
    balls: list[tuple[np.ndarray, float, int]] = field(default_factory=list)
    arrows: list[Arrow] = field(default_factory=list)

    def pose(self, posture) -> BodyScene:
        """Show one posture (as `Body.angles` takes it)."""
        self.frames = [self.body.angles(posture, check=False)]
        return self

    def play(self, postures: np.ndarray) -> BodyScene:
        """Show postures one after the other: (T, 19) rad, with names or in the order of `body.joint_names`.

        Raises
        ------
        InputError
            Wrong shape.
        """
        if isinstance(postures, NamedArray) and postures.names is not None:
            postures = postures.arranged(self.body.joint_names)
        postures = np.asarray(postures, dtype=float)
        if postures.ndim != 2 or postures.shape[1] != self.body.model.nq or not len(postures):
            raise InputError(f"frames must be of shape (T, {self.body.model.nq}), got {postures.shape}")
        self.frames = list(postures)
        return self

    def carry(self, roots: Sequence[pin.SE3]) -> BodyScene:
        """Move the whole body, frame by frame, as a walk does that takes the foot off the ground.

        Raises
        ------
        InputError
            Not one placement a frame.
        """
        if len(roots) != len(self.frames):
            raise InputError(f"{len(self.frames)} frames need as many placements, got {len(roots)}")
        self.roots = list(roots)
        return self

    def commands(self) -> list:
        """meshcat's drawing commands."""
        meshcat = import_meshcat()
        from meshcat.animation import Animation  # noqa: PLC0415
        from meshcat.geometry import Box, MeshLambertMaterial, Sphere  # noqa: PLC0415

        if not self.frames:
            self.pose("neutral")
        commands: list = []
        window = SimpleNamespace(send=commands.append)  # replaces a browser: what is sent to it is kept
        page, animation = meshcat.Visualizer(window=window), Animation(default_framerate=self.fps)
        for hidden in ("/Grid", "/Axes"):
            page[hidden].set_property("visible", False)
        page["/Background"].set_property("top_color", [0.93, 0.95, 0.97])
        page["/Background"].set_property("bottom_color", [0.70, 0.75, 0.80])
        page["/Cameras/default/rotated/<object>"].set_property("position", [1.3, 0.2, 1.8])
        page.set_transform(_moved([0.1, 0.0, -0.9]))  # the camera looks at the origin
        tilt = pin.SE3(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), ground_normal(self.slope)), np.zeros(3))
        page["floor"].set_object(Box([3.0, 1.6, 0.02]), MeshLambertMaterial(color=0x9DAA9D))
        page["floor"].set_transform(tilt.homogeneous @ _moved([0.0, 0.0, -0.011]))
        drawn = self._body_on(page)
        roots = [(tilt * root).homogeneous for root in self.roots or [pin.SE3.Identity()] * len(self.frames)]
        seen = [page, *(animation.at_frame(page, t) for t in range(len(self.frames)))]  # at rest, and moving
        for place, root, q in zip(seen, [roots[0], *roots], [self.frames[0], *self.frames], strict=True):
            drawn.viewer = place
            drawn.display(q)
            place["body"].set_transform(root)
        for k, (centre, radius, colour) in enumerate(self.balls):
            page[f"ball/{k}"].set_object(Sphere(radius), MeshLambertMaterial(color=colour))
            page[f"ball/{k}"].set_transform(_moved(tilt.act(centre)))
        for k, arrow in enumerate(self.arrows):
            draw_arrow(arrow, page[f"arrow/{k}"], animation)
        if len(self.frames) > 1:
            page.set_animation(animation, play=True, repetitions=1_000_000)
        return commands

    def _body_on(self, page):
        """Pinocchio's viewer of the body, which is drawn on a page."""
        from pinocchio.visualize import MeshcatVisualizer  # noqa: PLC0415

        shapes = pin.buildGeomFromUrdfString(self.body.model, self.body.urdf, pin.GeometryType.VISUAL)
        for shape in shapes.geometryObjects:
            shape.meshColor = np.append(shape.meshColor[:3], self.opacity)
        drawn = MeshcatVisualizer(self.body.model, None, shapes)
        drawn.initViewer(page)
        drawn.loadViewerModel("body")
        return drawn

    def html(self) -> str:
        """The page."""
        import umsgpack  # noqa: PLC0415

        script = (Path(import_meshcat().__file__).parent / "viewer/dist/main.min.js").read_text("utf-8")
        texts = (base64.b64encode(umsgpack.packb(one.lower())).decode() for one in self.commands())
        packed = ",\n".join(f'"{text}"' for text in texts)
        page = Template(resources.files("fes_pin.view").joinpath("viewer.html").read_text(encoding="utf-8"))
        return page.substitute(script=script, commands=packed, caption=html.escape(self.caption))

    def write(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the page to a file, into a folder that is there; raises as `fp.report`, with the same `overwrite`."""
        written_by("BodyScene.write", path, self.html(), HTML, overwrite)
        return Path(path)


def show_mode(linear: LinearBody, mode: Mode) -> BodyScene:
    """A mode in motion about its posture; a fall is shown to and fro, too, for it can go either way.

    Raises
    ------
    InputError
        No linearized body, or no mode.
    """
    body = instance(linear, LinearBody, "linear").body
    instance(mode, Mode, "mode")
    q = np.asarray(body.angles(linear.whole_posture, check=False))
    shape = np.asarray(body.rates(dict(zip(mode.joint_names, MODE_SWING_DEG * mode.one_degree, strict=True))))
    count = int(MODE_PERIOD_S * FRAMES_A_SECOND)
    phases = np.sin(2.0 * np.pi * np.arange(count + 1) / count)
    caption = f"{mode.name}; to and fro, not to scale; {said_of(linear)}"
    return BodyScene(body, caption=caption, slope=linear.slope).play(q + phases[:, None] * shape)


def show_posture(linear: LinearBody) -> BodyScene:
    """A linearized body in its posture, on its slope.

    Raises
    ------
    InputError
        No linearized body.
    """
    instance(linear, LinearBody, "linear")
    scene = BodyScene(linear.body, caption=f"{linear.body}; {said_of(linear)}", slope=linear.slope)
    return scene.pose(linear.whole_posture)


def said_of(linear: LinearBody) -> str:
    """Posture, feet, slope and braces of a linearized body, for a caption; and a foot that lies under the ground."""
    name = linear.posture_name.replace("_", " ") or "a posture of its own"
    parts = [f"{name}, {'both feet' if linear.both_feet else f'{linear.body.stance} foot'} on the ground"]
    if any(linear.slope):
        tilt = np.degrees(np.arccos(ground_normal(linear.slope)[2]))
        forward, left = linear.slope
        parts.append(f"slope {tilt:.1f} degrees (alpha {forward:g}, beta {left:g})")
    if linear.braced:
        parts.append(f"{len(linear.braced)} joints braced")
    other = SIDES[1 - SIDES.index(linear.body.stance)]
    below = -sole(linear.body, linear.body.angles(linear.whole_posture, check=False), other, heel=False)[:, 2].min()
    if below > LEVEL_M:
        flat = f"with the {linear.body.stance} forefoot flat, as the model has it"
        parts.append(f"{flat}, the {other} one lies {100 * below:.1f} cm under the ground")
    return "; ".join(parts)


def show_walk(
    body: Body,
    postures: np.ndarray,
    fps: int = FRAMES_A_SECOND,
    caption: str = "Walking",
    pelvis: np.ndarray | None = None,
) -> BodyScene:
    """Gait playback.

    Parameters
    ----------
    body
        The body.
    postures
        Joint angles, (T, 19) rad, with names or in the order of `body.joint_names`.
    fps
        Postures a second.
    caption
        Text on the page.
    pelvis
        Orientation of the pelvis in the world, (T, 3, 3). With it the body walks on the spot, either foot on the
        ground: it is turned as measured and put down on its lowest foot, hips above the middle of the floor. Without it
        the stance foot stays where it is.

    Raises
    ------
    InputError
        Shapes that do not fit.
    """
    scene = BodyScene(body, caption=caption, fps=fps).play(postures)
    if pelvis is None:
        return scene
    if np.shape(pelvis) != (len(scene.frames), 3, 3):
        raise InputError(f"the pelvis needs shape ({len(scene.frames)}, 3, 3), got {np.shape(pelvis)}")
    return scene.carry([_put_down(body, q, turn) for q, turn in zip(scene.frames, pelvis, strict=True)])


def _put_down(body: Body, q: np.ndarray, turn: np.ndarray) -> pin.SE3:
    """Return the pose of the stance foot: the pelvis is oriented as given, the lowest sole touches the floor."""
    held, hip = body.placement("pelvis", q)  # links begin at the joint towards the ground
    _, other = body.placement("left_thigh" if body.stance == "right" else "right_thigh", q)
    rotation = turn @ held.T
    middle = rotation @ (0.5 * (hip + other))
    lowest = min(float((rotation @ sole(body, q, side, heel=True).T)[2].min()) for side in SIDES)
    return pin.SE3(rotation, np.array([-middle[0], -middle[1], -lowest]))


def show_influence(linear: LinearBody, inputs, names: str | Sequence[str]) -> BodyScene:
    """Show the torques of nerves: a ball at each joint, larger and redder with the nerves' torque there.

    Raises
    ------
    InputError
        Inputs that are none, or a name that is not among them.
    """
    strength = getattr(inputs, "assumed_strength", None)
    inputs = Inputs.of(inputs, linear).select([names] if isinstance(names, str) else names)
    torque = dict(zip(inputs.joint_names, inputs.matrix.sum(axis=1).tolist(), strict=True))
    size = {j.name: float(np.linalg.norm([torque.get(r, 0.0) for r in j.revolutes])) for j in JOINTS}
    greatest = max(size.values())
    posture = linear.whole_posture
    scene = BodyScene(linear.body, slope=linear.slope).pose(posture)
    said = []
    for joint in JOINTS:
        share = size[joint.name] / greatest if greatest > 0.0 else 0.0
        if share < 0.01:
            continue
        scene.balls.append((_centre(linear.body, joint, posture), 0.05 + 0.06 * share, _red(share)))
        said += [f"{r} {torque[r]:+.0f} N m" for r in joint.revolutes if abs(torque.get(r, 0.0)) >= 0.01 * greatest]
    how = "full recruitment" if strength is None else f"full recruitment at {strength:g} of a healthy person's strength"
    scene.caption = f"{' and '.join(inputs.names)}, {how}: {', '.join(said) or 'no torque'}; {said_of(linear)}"
    return scene


def _centre(body: Body, joint: BodyJoint, posture: Mapping[str, float]) -> np.ndarray:
    """Return the place of a joint in the world, (3,) m; its ball is outside the limb, on the limb's own side."""
    outside = {"left": 0.09, "right": -0.09}.get(joint.name.partition("_")[0], -0.16)
    return body.placement(joint.revolutes[0], posture)[1] + np.array([0.0, outside, 0.0])


def _red(share: float) -> int:
    """White to red."""
    rest = int(230 * (1.0 - share))
    return (225 << 16) + (rest << 8) + rest


def _moved(translation: Sequence[float] | np.ndarray) -> np.ndarray:
    return pin.SE3(np.eye(3), np.asarray(translation)).homogeneous


def import_meshcat():
    """meshcat, without the warning that its import of an old pyzmq module raises."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        import meshcat  # noqa: PLC0415
    return meshcat
