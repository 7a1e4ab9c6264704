"""Small studies as text, to be spoilt one line at a time."""

from pathlib import Path

URDF = """<?xml version="1.0"?>
<robot name="pendulum">
  <link name="base"/>
  <link name="arm">
    <inertial>
      <origin xyz="0 0 0.15"/>
      <mass value="0.15"/>
      <inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-6"/>
    </inertial>
  </link>
  <joint name="pivot" type="continuous">
    <parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
  </joint>
</robot>
"""
ANKLE = """[study]
name = "small"
rig = "ankle"

[rig]
foot_mass_kg = 0.1
com_distance_m = 0.08
moment_arm_m = 0.04
force_scale_n = 56.0
threshold_us = 180.0
saturation_us = 1000.0

[rig.passive]
f0_n = 4.0
f1_per_rad = 2.2
theta_r_rad = 1.3

[start]
gain = 0.65
time_constant_s = 0.05
inertia_kgm2 = 0.001
damping_nms = 0.06

[[trial]]
file = "trials/00.csv"
kind = "motion"
load_kg = 1.0
role = "fit"

[[trial]]
file = "trials/10.csv"
kind = "isometric"
angle_rad = 1.9
"""
MOTION = """time_s,pulse_width_us,angle_rad
0.000,0.0,1.80
0.005,200.0,1.81
0.010,300.0,1.82
0.015,0.0,1.83
0.020,0.0,1.84
"""
JOINT = """[study]
name = "swing"
rig = "joint"
[rig]
urdf = "rig.urdf"
[start]
inertia_scale = 1.0
damping = 1e-3
[[trial]]
file = "a.csv"
[[trial]]
file = "b.csv"
"""
SWING = "time_s,position,velocity\n0.0,1.0,0.0\n0.1,0.9,-0.1\n0.2,0.7,-0.2\n"
MUSCLE = """[study]
name = "muscle"
rig = "muscle"
[rig]
threshold_us = 100
saturation_us = 400
[start]
gain = 30.0
time_constant_s = 0.05
[[trial]]
file = "a.csv"
start_s = 2.5
"""
PULSES = "time_s,pulse_width_us,force_n\n0.0,300,0.0\n0.1,0,0.1\n0.2,0,0.2\n"


def ankle(folder: Path) -> Path:
    return _write(
        folder,
        {
            "study.toml": ANKLE,
            "trials/00.csv": MOTION,
            "trials/10.csv": MOTION.replace("angle_rad", "force_n"),
        },
    )


def joint(folder: Path) -> Path:
    return _write(folder, {"study.toml": JOINT, "rig.urdf": URDF, "a.csv": SWING, "b.csv": SWING})


OWN = """[columns]
time_s = { name = "t_ms", unit = "ms" }
position = { name = "Angle", unit = "deg", zero = 1.5, scale = -1.0 }
effort = { name = "Torque", unit = "mN m" }
ignored = ["state"]
[columns.file]
delimiter = ";"
decimal = ","
header_row = 2
first_row = 4
comment = "#"
missing = "interpolate"
resample_hz = 80.0
"""
RECORDED = "made by hand\nt_ms;Angle;Torque;state\nms;deg;mNm;-\n# begins\n" + "".join(
    f"{10.2 * k:.1f};{k % 7},5;{'' if k == 5 else f'-{k},25'};on\n".replace(".", ",") for k in range(40)
)


def own(folder: Path) -> Path:
    """A joint's study whose recordings stay as an instrument wrote them."""
    text = JOINT.replace("[[trial]]", f"{OWN}[[trial]]", 1)
    return _write(folder, {"study.toml": text, "rig.urdf": URDF, "a.csv": RECORDED, "b.csv": RECORDED})


def muscle(folder: Path) -> Path:
    return _write(folder, {"study.toml": MUSCLE, "a.csv": PULSES})


def _write(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder
