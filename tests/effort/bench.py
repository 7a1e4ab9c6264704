"""An arm under a controller whose commands are held, integrated by LSODA: no dynamics of the package."""

import numpy as np
from scipy.integrate import odeint

import fes_pin as fp

INERTIA, DAMPING, WEIGHT, DT = 0.08, 0.05, 1.2, 0.004
LEVER = 0.3
MASS = WEIGHT / (9.81 * LEVER)
URDF = f"""<robot name="arm"><link name="base"/><link name="moving">
<inertial><origin xyz="0 0 {-LEVER}"/><mass value="{MASS}"/>
<inertia ixx="{{about}}" iyy="{{about}}" izz="{{about}}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="joint" type="revolute"><parent link="base"/><child link="moving"/><axis xyz="0 1 0"/>
<limit lower="-9" upper="9" effort="1e3" velocity="1e3"/></joint></robot>""".format(about=INERTIA - MASS * LEVER**2)


def trial(seed, count=0.0, friction=0.0, offset=0.0, drag=0.0, play=0.0, frame=None, teeth=None, seconds=8.0):
    """Efforts that were commanded and positions that were read, by an encoder of a `count`, behind a `play`.

    `frame` has a coupling, a frequency and a damping ratio, `teeth` a torque and its waves per rad.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds / DT)) * DT
    waves = [(f, p) for f, p in zip(rng.uniform(0.2, 1.0, 3), rng.uniform(0.0, 6.0, 3), strict=True)]
    wanted = sum(0.35 * (np.sin(2.0 * np.pi * f * time + p) - np.sin(p)) for f, p in waves)
    state, effort, read = np.zeros(4), np.empty(len(time)), np.empty(len(time))
    pushed, rate, followed = 0.0, 0.0, 0.0
    size, waves_per_rad = teeth or (0.0, 0.0)
    coupling, omega, zeta = (frame[0], 2.0 * np.pi * frame[1], frame[2]) if frame else (0.0, 0.0, 0.0)

    def moves(x, _, command):
        torque = command + offset - DAMPING * x[1] - WEIGHT * np.sin(x[0]) - drag * x[1] * abs(x[1])
        torque += size * np.sin(waves_per_rad * x[0])
        pull = (torque - friction * np.tanh(x[1] / 0.02)) / INERTIA
        swings = -(omega**2) * x[2] - 2.0 * zeta * omega * x[3] - coupling * pull
        return [x[1], pull - swings, x[3], swings]

    for k in range(len(time)):
        followed = min(max(followed, state[0] - play), state[0] + play)
        seen = followed + 1e-4 * rng.standard_normal()
        read[k] = round(seen / count) * count if count else seen
        rate += 0.3 * ((read[k] - read[max(k - 1, 0)]) / DT - rate)
        effort[k] = 12.0 * (wanted[k] - read[k]) - 1.0 * rate
        pushed = 0.97 * pushed + 0.003 * rng.standard_normal()
        state = odeint(moves, state, [0.0, DT], args=(effort[k] + pushed,))[-1]
    return fp.Trial(f"{seed}", "motion", {"effort": effort, "position": read}, time)


def study(folder, trials):
    """The arm, with an inertia and a damping that are believed to be others."""
    (folder / "rig.urdf").write_text(URDF)
    start = {"inertia_scale": 1.2, "damping": 2.0 * DAMPING, "gravity_scale": 1.0}
    return fp.Study("arm", "joint", {}, start, tuple(trials), folder, {"urdf": folder / "rig.urdf"})
