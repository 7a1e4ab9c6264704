"""Integration of the rigs of `oracle.rigs` by scipy, piece by piece between the instants at which an input jumps."""

import itertools
import math

import numpy as np
from scipy.integrate import odeint

from oracle.causes import effective_width, reading, recruited
from oracle.rigs import Ankle, Joint, Muscle

RIGS = {"ankle": Ankle, "joint": Joint, "muscle": Muscle}
RTOL, ATOL = 1e-10, 1e-12
HISTORY_S = 2.5e-3
"""Time between the velocities that a reflex with a pure delay remembers."""


def rig_of(constants):
    """Name of the rig that constants belong to."""
    if "foot_mass_kg" in constants:
        return "ankle"
    return "joint" if "inertia" in constants else "muscle"


def simulate(constants, nominal, causes, trial, disturbance=None):
    """Answer of a rig with causes to a trial's inputs.

    Parameters
    ----------
    constants, nominal
        Of the rig: see `oracle.rigs`.
    causes : dict of str to dict
        Parameters of each cause by its canonical name; `form` picks another functional form where there is one.
    trial
        Time, inputs and conditions; a joint starts at `position0` and `velocity0`.
    disturbance : ndarray, shape (n,), optional
        Torque that acts on the joint, held from sample to sample.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        The measured columns, without noise.
    """
    rig = RIGS[rig_of(constants)](constants, nominal, causes, trial)
    drives = _drives(rig, constants, causes, trial)
    if disturbance is not None:
        drives["disturbance"] = (np.asarray(disturbance, dtype=float), 0.0)
    states = _integrate(rig, trial.time - trial.time[0], drives)
    x = {name: states[:, k] for k, name in enumerate(rig.names)}
    return {
        column: reading(value, rate, trial.time, rest, causes) if sensed else value
        for column, (value, rate, rest, sensed) in rig.outputs(x).items()
    }


def _drives(rig, constants, causes, trial):
    """What jumps: by name, values at the samples and the time by which they come late."""
    if isinstance(rig, Joint):
        return {"effort": (trial["effort"], 0.0)} if "effort" in trial.columns else {}
    late = causes.get("electromechanical_delay", {}).get("delay_s", 0.0)
    if "stim" in trial.columns:
        fired = trial.time[trial["stim"] > 0.5]
        period = (fired[-1] - fired[0]) / (len(fired) - 1) if len(fired) > 1 else trial.dt
        return {"r": (trial["stim"] * period / trial.dt, late)}
    width = trial["pulse_width_us"]
    low, high = constants["threshold_us"], constants["saturation_us"]
    share = (effective_width(width, trial.time, causes) - low) / (high - low)
    drives = {"r": (recruited(share, causes), late)}
    p = causes.get("antagonist_spillover")
    if p:
        room = (width - p["onset_us"]) / (high - p["onset_us"])
        spilt = np.clip(room, 0.0, 1.0)
        if p.get("form") == "smooth":
            spilt = np.where(width > 0.0, np.log1p(np.exp(12.0 * room)) / math.log1p(math.exp(12.0)), 0.0)
        drives["spilt"] = (spilt, late)
    return drives


def _integrate(rig, time, drives):
    """States at the samples, shape (n, states): LSODA from jump to jump."""
    dt, end = (time[-1] - time[0]) / (len(time) - 1), time[-1]
    jumps = [np.array([0.0, end])]
    for values, late in drives.values():
        changed = np.flatnonzero(np.diff(values, prepend=0.0))
        jumps.append(time[changed] + late)
    if rig.causes.get("stretch_reflex", {}).get("form") == "pure":
        jumps.append(np.arange(0.0, end, HISTORY_S))
    edges = np.unique(np.round(np.concatenate(jumps), 12))
    edges = edges[(edges >= 0.0) & (edges <= end)]
    edges = edges[np.concatenate([[True], np.diff(edges) > 1e-9])]
    out = np.empty((len(time), len(rig.names)))
    x = np.array(rig.rest(), dtype=float)
    out[0] = x
    for start, stop in itertools.pairwise(edges):
        middle = 0.5 * (start + stop)
        held = {}
        for name, (values, late) in drives.items():
            k = math.floor((middle - late) / dt + 1e-9)
            held[name] = float(values[k]) if k >= 0 else 0.0
        inside = np.flatnonzero((time > start + 1e-11) & (time < stop - 1e-11))
        at = np.concatenate([[start], time[inside], [stop]])
        path = odeint(rig.rates, x, at, args=(held,), tfirst=True, rtol=RTOL, atol=ATOL, mxstep=100000)
        out[inside] = path[1:-1]
        x = path[-1]
        out[np.abs(time - stop) <= 1e-11] = x
        rig.passed(stop, x)
    return out
