"""A subject's ten segments from mass, height and sex, by published tables.

Sources
-------
Segment masses, lengths, centres of mass and radii of gyration: P. de Leva, "Adjustments to Zatsiorsky-Seluyanov's
segment inertia parameters", J. Biomech. 29(9):1223-1230, 1996, table 4 (100 men and 15 women, young adults). The
figures were compared with public transcriptions: a MATLAB look-up table by R. Gurchiek (all of them), biobuddy's
`de_leva.py` (trunk, head, arms) and pyomech (head, arms, thigh, foot). They agree but for slips in one at a time
(female head 6.69 %, male shank 4.32 %, decimal points); the knee-to-ankle shank of women and the shoulder height rest
on one. The article itself was not at hand.
Heights and breadths that de Leva does not give: D. A. Winter, "Biomechanics and Motor Control of Human Movement",
figure 4.1 (after Drillis and Contini 1966): ankle 0.039 H, half shoulder breadth 0.129 H, foot breadth 0.055 H (each
compared with public code that cites it; the book was not at hand).
Hip joint centres 0.095 H apart, MTP centre 0.011 H above the ground, ankle at 0.26 and MTP at 0.72 of the foot's
length from the heel, forefoot 0.138 of the foot's mass: rounded from the measured and scaled adult of
`walking_subject01` (hips 0.171 m at 1.80 m; heel markers against joint centres: 0.25-0.27 and 0.70-0.74; toes 0.209 kg
of 1.513 kg).
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from fes_pin.body.joints import SIDES
from fes_pin.body.skeleton import Segment, Skeleton
from fes_pin.data.numbers import between, known_word
from fes_pin.data.table import own_table

ANKLE_HEIGHT = 0.039
HIP_SPACING = 0.095
SHOULDER_HALF_BREADTH = 0.129
FOOT_BREADTH = 0.055
MTP_HEIGHT = 0.011
ANKLE_ALONG_FOOT = 0.26
MTP_ALONG_FOOT = 0.72
FOREFOOT_MASS = 0.138
MASS_RANGE_KG = (20.0, 250.0)
HEIGHT_RANGE_M = (1.0, 2.4)


@dataclass(frozen=True, eq=False)
class _Row:
    """One line of de Leva's table 4.

    `mass` in percent of the body, `length` in mm at the stature of the group, `com` in percent of the length from the
    upper end, `radii` of gyration in percent of the length about the forward, the leftward and the long axis.
    """

    mass: float
    length: float
    com: float
    radii: np.ndarray


@cache
def _segments(sex: str) -> dict[str, _Row]:
    """De Leva's table 4, of men or of women: segments.csv says what its columns are."""
    found = {}
    for row in own_table(Path(__file__).with_name("segments.csv")):
        if row["sex"] == sex:
            mass, length, com, *radii = (float(row[n]) for n in _NUMBERS)
            found[row["segment"]] = _Row(mass, length, com, np.array(radii))
    return found


_NUMBERS = ("mass", "length", "com", "forward", "leftward", "along")
_STATURE = {"male": 1741.0, "female": 1735.0}
_SHOULDERS_TO_HIPS = {"male": 515.5, "female": 497.9}
"""Mid-shoulder to mid-hip, mm (de Leva's alternative trunk)."""
_COLUMN = ("shank", "thigh", "lower_trunk", "middle_trunk", "upper_trunk", "head")
_PAIRED = ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")


@dataclass(frozen=True)
class Subject:
    """A person: mass (kg), standing height (m), `male` or `female` (whose segment table is used).

    Raises
    ------
    InputError
        Mass outside 20 to 250 kg, height outside 1.0 to 2.4 m, or another sex.
    """

    mass_kg: float
    height_m: float
    sex: str = "male"

    def __post_init__(self) -> None:
        for label, ends in (("mass_kg", MASS_RANGE_KG), ("height_m", HEIGHT_RANGE_M)):
            object.__setattr__(self, label, between(getattr(self, label), *ends, label))
        known_word(self.sex, _STATURE, "sex")


def skeleton_of_subject(subject: Subject) -> Skeleton:
    """The subject's ten segments and joint centres.

    Segments keep the table's share of mass and, sideways and forwards, its share of stature. Ankle height and table do
    not add up to stature exactly, so the column of shank, thigh, trunk and head is scaled as one (by 0.98 for men, 1.00
    for women) to close it: total mass and height are the subject's to rounding. Arms hang; they are part of the trunk.
    """
    table = _segments(subject.sex)
    body_percent = sum(row.mass * (2 if name in _PAIRED else 1) for name, row in table.items())
    per_percent = subject.mass_kg / body_percent
    per_mm = subject.height_m / _STATURE[subject.sex]
    ankle = ANKLE_HEIGHT * subject.height_m
    column_mm = sum(table[name].length for name in _COLUMN)
    column = (subject.height_m - ankle) / column_mm

    bottoms, z = {}, ankle
    for name in _COLUMN:
        bottoms[name], z = z, z + column * table[name].length

    def upright(name: str, y: float, bottom: float, scale: float) -> Segment:
        row = table[name]
        length = scale * row.length
        mass = per_percent * row.mass
        radii = length * row.radii / 100.0
        return Segment(mass, np.array([0.0, y, bottom + length * (1.0 - row.com / 100.0)]), mass * np.diag(radii**2))

    hip, shoulder = 0.5 * HIP_SPACING * subject.height_m, SHOULDER_HALF_BREADTH * subject.height_m
    parts = [upright(name, 0.0, bottoms[name], column) for name in ("middle_trunk", "upper_trunk", "head")]
    shoulder_height = bottoms["lower_trunk"] + column * _SHOULDERS_TO_HIPS[subject.sex]
    for y in (shoulder, -shoulder):
        top = shoulder_height
        for name in ("upper_arm", "forearm", "hand"):
            top -= per_mm * table[name].length
            parts.append(upright(name, y, top, per_mm))
    segments = {"trunk": combined(parts), "pelvis": upright("lower_trunk", 0.0, bottoms["lower_trunk"], column)}
    centres = {"lumbar": np.array([0.0, 0.0, bottoms["middle_trunk"]])}
    points = {"vertex": np.array([0.0, 0.0, subject.height_m]), "neck": np.array([0.0, 0.0, bottoms["head"]])}
    for side, y in zip(SIDES, (hip, -hip), strict=True):
        segments[f"{side}_thigh"] = upright("thigh", y, bottoms["thigh"], column)
        segments[f"{side}_shank"] = upright("shank", y, bottoms["shank"], column)
        centres[f"{side}_hip"] = np.array([0.0, y, bottoms["lower_trunk"]])
        centres[f"{side}_knee"] = np.array([0.0, y, bottoms["thigh"]])
        centres[f"{side}_ankle"] = np.array([0.0, y, ankle])
        length = per_mm * table["foot"].length
        heel = -ANKLE_ALONG_FOOT * length
        centres[f"{side}_mtp"] = np.array([heel + MTP_ALONG_FOOT * length, y, MTP_HEIGHT * subject.height_m])
        points[f"{side}_heel"] = np.array([heel, y, 0.0])
        points[f"{side}_toe"] = np.array([heel + length, y, 0.0])
        points[f"{side}_shoulder"] = np.array([0.0, np.sign(y) * shoulder, shoulder_height])
        points[f"{side}_elbow"] = points[f"{side}_shoulder"] - [0.0, 0.0, per_mm * table["upper_arm"].length]
        points[f"{side}_fingers"] = np.array([0.0, np.sign(y) * shoulder, top])
        hind, fore = _split_foot(table["foot"], per_percent, length, centres[f"{side}_ankle"], centres[f"{side}_mtp"])
        segments[f"{side}_hindfoot"], segments[f"{side}_forefoot"] = hind, fore
    return Skeleton(segments, centres, points, subject.height_m)


def combined(parts: list[Segment]) -> Segment:
    """Several segments held rigidly together."""
    mass = sum(part.mass for part in parts)
    com = sum((part.mass * part.com for part in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        d = part.com - com
        inertia += part.inertia + part.mass * ((d @ d) * np.eye(3) - np.outer(d, d))
    return Segment(float(mass), com, inertia)


def _split_foot(
    row: _Row, per_percent: float, length: float, ankle: np.ndarray, mtp: np.ndarray
) -> tuple[Segment, Segment]:
    """Hindfoot and forefoot: together they have de Leva's mass, centre along the foot and inertia.

    The forefoot is an even slab from the MTP joint to the toe tip; the hindfoot is the foot without it. The hindfoot's
    centre lies on the line from ankle to MTP, as the paper assumes; its inertia is that of the foot less the
    forefoot's, along the foot.
    The greater of the two cross radii is about the vertical (a foot is wider than high; the table does not say).
    """
    mass = per_percent * row.mass
    heel = ankle[0] - ANKLE_ALONG_FOOT * length
    centre = heel + length * row.com / 100.0
    toes, toe_length = FOREFOOT_MASS * mass, (1.0 - MTP_ALONG_FOOT) * length
    toes_x = mtp[0] + 0.5 * toe_length
    rest = mass - toes
    rest_x = (mass * centre - toes * toes_x) / rest
    rest_z = mtp[2] + (ankle[2] - mtp[2]) * (mtp[0] - rest_x) / (mtp[0] - ankle[0])
    width, thick = FOOT_BREADTH / ANKLE_HEIGHT * ankle[2], 2.0 * mtp[2]
    toes_inertia = toes / 12.0 * np.array([width**2 + thick**2, toe_length**2 + thick**2, toe_length**2 + width**2])
    vertical, cross, along = (row.radii / 100.0 * length) ** 2 * mass
    apart = toes * (toes_x - centre) ** 2 + rest * (rest_x - centre) ** 2
    whole = np.array([along, cross - apart, vertical - apart])
    hind = Segment(rest, np.array([rest_x, ankle[1], rest_z]), np.diag(whole - toes_inertia))
    fore = Segment(toes, np.array([toes_x, mtp[1], mtp[2]]), np.diag(toes_inertia))
    return hind, fore
