"""`fes-pin urdf` changes the numbers that were fitted, and nothing else of a URDF, to the byte."""

import codecs
import re

import numpy as np
import pinocchio as pin
import pytest

from fes_pin.data.errors import InputError
from fes_pin.data.urdf import check_inertias, impossible_inertias
from fes_pin.models.effects import CoulombFriction
from fes_pin.models.model import Model
from fes_pin.models.rigs.joint import joint_model
from fes_pin.models.urdf_out import extended_urdf

COMMENTS = ("", "<!-- a > b, 'c' & <mass value=\"9\"/> -->", "<!-- Träger für α, 2 µm -->", "<?tool keep='this'?>")
ASIDE = (
    "<transmission name='t'>{n}  <type>simple</type><joint name='pivot'/>{n}</transmission>",
    "<gazebo reference=\"arm\"><mu1>0.2</mu1><![CDATA[ <mass value='7'/> ]]></gazebo>",
    "<xacro:property name='m' value='${{mass}}'/>",
    "<material name='grün'><color rgba='0 0 1 1'/></material>",
    "<link name='leaf'/><joint type='continuous' name='copy'><mimic multiplier='2' joint='pivot'/>{n}"
    "<parent link='base'/><child link='leaf'/></joint>",
    "<link name='bolt'><inertial><mass value='0'/><inertia ixx='0' iyy='0' izz='9'/></inertial></link>{n}"
    "<joint name='fix' type='fixed'><parent link='base'/><child link='bolt'/></joint>",
)
MESH = "<mesh filename=\"package://a/ä.stl\" scale='1 1 1'/>"
SHAPES = f"<visual><origin xyz='0 0 -.1'/><geometry>{MESH}</geometry></visual>"


def drawn(rng: np.random.Generator, plain: bool) -> tuple[str, dict[str, float]]:
    """A URDF in odd form, as text, and what it says; a plain one is of the XML that Pinocchio's own parser accepts."""
    quote, newline = rng.choice(["'", '"']), rng.choice(["\n", "\r\n", "\n\n\t", " "])
    comments = iter(rng.choice(COMMENTS[: 3 if plain else 4], 9))

    def tag(element: str, close: str = "/", **attributes: object) -> str:
        items = [*attributes.items()]
        rng.shuffle(items)
        space = rng.choice([" ", "  ", newline + "   "])
        inner = "".join(f"{space}{k}{rng.choice(['=', ' = '])}{quote}{v}{quote}" for k, v in items)
        return f"<{element}{inner}{rng.choice(['', ' '])}{close}>"

    mass, height = round(float(rng.uniform(0.2, 2.0)), 3), round(float(rng.uniform(-0.4, -0.1)), 3)
    moments = {k: f"{m:.4g}" for k, m in zip(("ixx", "iyy", "izz"), (0.02 + 0.01 * rng.random(3)), strict=True)}
    moments |= {k: f"{rng.choice([0, 1e-3]):g}" for k in ("ixy", "ixz", "iyz") if plain or rng.random() < 0.5}
    stated = ({"damping": 0.25, "friction": 0.5}, {"damping": 0.25}, {})[rng.integers(3)]
    dynamics = tag("dynamics", **stated) if stated else ""
    inertial = [tag("origin", xyz=f"0  0 {height}"), tag("mass", value=mass), next(comments), tag("inertia", **moments)]
    rng.shuffle(inertial)
    aside = [next(comments), *(a.format(n=newline) for a in rng.choice(ASIDE, 3, replace=False))]
    arm = [next(comments), SHAPES, "<inertial>", *inertial, "</inertial>", next(comments)]
    joint = ["<parent link='base'/>", "<child link='arm'/>", tag("axis", xyz="0 1 0"), dynamics, next(comments)]
    head = tag("joint", "", name="pivot", type="continuous")
    robot = [next(comments), "<link name='base'/>", tag("link", "", name="arm"), *arm, "</link>", head, *joint]
    parts = ["<robot xmlns:xacro='http://x' name='é'>", *robot, "</joint>", *aside, "</robot>", next(comments)]
    return newline.join(p for p in parts if p) + newline, {"mass": mass, **stated}


def written(text: str, form: int) -> bytes:
    """The text in one of five encodings."""
    if form == 0:
        return codecs.BOM_UTF8 + text.encode()
    if form == 1:
        return codecs.BOM_UTF16_LE + ('<?xml version="1.0" encoding="UTF-16"?>' + text).encode("utf-16-le")
    if form == 2:
        plain = text.replace("α", "a")
        return (f"<?xml version='1.0' encoding='ISO-8859-1' standalone='yes'?>\r\n{plain}").encode("latin-1")
    return (f'<?xml  version="1.0"?>\n{text}' if form == 3 else text).encode()


def blanked(content: bytes) -> str:
    """The text without the numbers that may change: of the arm's mass and inertia, and of the joint's dynamics."""
    mark = next((m for m in (codecs.BOM_UTF16_LE,) if content.startswith(m)), None)
    text = content.decode("utf-16-le" if mark else "latin-1")
    arm = text.index("<inertial>", text.index("arm"))
    end = text.index("</joint>", arm)
    part = re.sub(r"<!--.*?-->", lambda c: c[0].translate(str.maketrans("<>", "{}")), text[arm:end])
    part = re.sub(
        r"<(mass|inertia|dynamics)\b[^>]*>", lambda t: re.sub(r"(=\s*)(['\"])[^'\"]*\2", r"\1\2#\2", t[0]), part
    )
    return text[:arm] + part + text[end:]


@pytest.mark.parametrize("seed", range(120))
def test_only_numbers_of_the_fitted_link_and_joint_change(tmp_path, seed):
    rng = np.random.default_rng(seed)
    text, said = drawn(rng, seed % 5 > 2)
    path, out = tmp_path / "a.urdf", tmp_path / "b.urdf"
    path.write_bytes(before := written(text, seed % 5))
    scales = {"inertia_scale": float(rng.uniform(1.0, 1.6)), "gravity_scale": float(rng.uniform(0.8, 1.0))}
    model = Model(joint_model(path, {}, {"damping": 0.03, **scales})) + CoulombFriction(torque_nm=0.2)
    after, _, changed = extended_urdf(model, path)
    assert not changed
    same = blanked(after) == blanked(before)
    assert same or not ("friction" in said and all(key in text for key in ("ixy", "ixz", "iyz")))
    if not same:  # an attribute that was missing, or the element, is new
        new = r"\s*<dynamics[^>]*>|\s+(friction|ixy|ixz|iyz)\s*=\s*(['\"])#\2"
        assert re.sub(new, "", blanked(after)) == re.sub(new, "", blanked(before))
    out.write_bytes(after)
    again = joint_model(out, {}, {"damping": 0.03, "inertia_scale": 1.0, "gravity_scale": 1.0})
    first = model.rig.constants
    assert again.constants["inertia"] == pytest.approx(scales["inertia_scale"] * first["inertia"], rel=1e-9)
    assert again.constants["gravity_sin"] == pytest.approx(scales["gravity_scale"] * first["gravity_sin"], rel=1e-9)
    if seed % 5 > 2:  # Pinocchio reads the file as it stands; a joint that mimics is one of its own there
        read = pin.buildModelFromXML(after.decode())
        at = read.joints[read.getJointId("pivot")].idx_v
        assert (read.damping[at], read.friction[at]) == pytest.approx((0.03, 0.2 + said.get("friction", 0.0)))
        assert pin.crba(read, read.createData(), pin.neutral(read))[at, at] == pytest.approx(again.constants["inertia"])


@pytest.mark.parametrize("seed", range(10))
def test_what_is_as_it_was_believed_stays_to_the_byte(tmp_path, seed):
    text, said = drawn(np.random.default_rng(seed), seed % 5 > 2)
    path = tmp_path / "a.urdf"
    path.write_bytes(written(text, seed % 5))
    known = {"inertia_scale": 1.0, "gravity_scale": 1.0, "damping": said.get("damping", 0.0)}
    model = Model(joint_model(path, {}, known))
    assert extended_urdf(model, path)[0] == path.read_bytes()


def one_link(moments: dict[str, str], base: str = "", name: str = "arm") -> str:
    inner = " ".join(f'{k}="{v}"' for k, v in moments.items())
    return (
        f'<robot name="r">\n<link name="base">{base}</link>\n<link name="{name}"><inertial><origin xyz="0 0 -0.1"/>'
        f'<mass value="1"/>\n<inertia {inner}/></inertial></link>\n<joint name="j" type="continuous">'
        f'<parent link="base"/><child link="{name}"/><axis xyz="0 1 0"/></joint></robot>'
    )


def turned(principal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return axes @ np.diag(principal) @ axes.T


def printed(matrix: np.ndarray, form: str) -> dict[str, str]:
    at = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    return {k: format(matrix[ij], form) for k, ij in at.items()}


@pytest.mark.parametrize("seed", range(60))
def test_a_thin_plate_passes_however_it_is_printed(tmp_path, seed):
    """The largest moment of a plate is the sum of the two others: rounding to few digits breaks that by itself."""
    rng = np.random.default_rng(seed)
    a, b = 10.0 ** rng.uniform(-6, 1) * rng.uniform(0.2, 1.0, 2)
    matrix = turned(np.array([a, b, a + b]), rng) if seed % 2 else np.diag([a, b, a + b])
    path = tmp_path / "a.urdf"
    for form in (".3g", ".4g", ".6e", ".17g", f".{3 - int(np.floor(np.log10(a + b)))}f"):
        path.write_text(one_link(printed(matrix, form)))
        assert impossible_inertias(path) == []


@pytest.mark.parametrize("seed", range(60))
def test_moments_that_no_body_has_are_refused_with_row_and_link(tmp_path, seed):
    rng = np.random.default_rng(seed)
    a, b = 10.0 ** rng.uniform(-6, 1) * rng.uniform(0.2, 1.0, 2)
    matrix = turned(np.array([a, b, rng.uniform(1.06, 3.0) * (a + b)]), rng)
    path = tmp_path / "a.urdf"
    path.write_text(one_link(printed(matrix, rng.choice([".4g", ".17g"])), name="le+g"))
    with pytest.raises(InputError, match="no body has the principal moments") as caught:
        check_inertias(path)
    assert (caught.value.file, caught.value.row, caught.value.column) == (path, 3, "le+g")
    rod = {"damping": 0.1, "inertia_scale": 1.0}
    with pytest.raises(InputError, match="no body has"):
        extended_urdf(Model(joint_model(path, {}, rod)), path)


@pytest.mark.parametrize("base", ["<mass value='0'/>", "<mass value='1'/><inertia ixx='1' iyy='1' izz='9'/>"])
def test_links_that_do_not_move_are_not_judged(tmp_path, base):
    path = tmp_path / "a.urdf"
    path.write_text(one_link(dict.fromkeys(("ixx", "iyy", "izz"), "0.1"), f"<inertial>{base}</inertial>"))
    check_inertias(path)
    assert joint_model(path, {}, {"damping": 0.1, "inertia_scale": 1.0}).constants["inertia"] == pytest.approx(0.11)


@pytest.mark.parametrize("seed", range(20))
def test_what_is_written_is_a_body_again(tmp_path, seed):
    """Whatever the scale, a rotor's inertia on a thin rod or on a plate among them."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.0, 0.02, 2)
    path, out = tmp_path / "a.urdf", tmp_path / "b.urdf"
    path.write_text(one_link(printed(turned(np.array([a, b, a + b]), rng), ".17g")))
    scales = {"inertia_scale": float(np.exp(rng.uniform(-1.5, 1.5))), "gravity_scale": float(rng.uniform(0.7, 1.4))}
    out.write_bytes(extended_urdf(Model(joint_model(path, {}, {"damping": 0.1, **scales})), path)[0])
    check_inertias(out)
