"""The body extended by the causes of a diagnosis, for `linearize`, `allocate` and the viewer."""

from dataclasses import replace
from xml.etree.ElementTree import tostring

import numpy as np
import pinocchio as pin
from defusedxml.ElementTree import fromstring

from fes_pin.body.build import Body
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import in_full
from fes_pin.data.urdf import MOMENTS
from fes_pin.walk.models import WalkFit, WalkModels

ROUNDED = 1e-3
"""Share by which rounded moments of inertia may miss the triangle inequality."""


def extended_body(models: WalkModels, best: WalkFit) -> Body:
    """Return the body with the segments' masses, centres and inertias of a set of causes.

    Raises
    ------
    InputError
        If the parameters are impossible, as a mass that is not positive.
    """
    designs = models.designs
    body = designs.as_read.trials[0].motion.body
    believed = designs.as_read.trials[0].motion.parameters
    changed: dict[str, np.ndarray] = {}
    for name, sizes in models.sizes(best).items():
        change = designs.forms[name].segments
        if change is not None:
            for segment, columns in change(believed).items():
                changed[segment] = changed.get(segment, believed[segment]) + columns @ sizes
    return with_segments(body, changed) if changed else body


def with_segments(body: Body, parameters: dict[str, np.ndarray]) -> Body:
    """Return a body with other mass parameters (10,) of some segments, in their links' frames.

    Raises
    ------
    InputError
        If a segment's mass is not positive, or its inertia is impossible.
    """
    tree = fromstring(body.urdf)
    for name, own in parameters.items():
        one = pin.Inertia.FromDynamicParameters(own)
        mass, moments = one.mass, np.linalg.eigvalsh(one.inertia)
        if mass <= 0.0 or moments[0] <= 0.0 or moments[2] > (moments[0] + moments[1]) * (1.0 + ROUNDED):
            has = f"{mass:.3g} kg with moments {np.round(moments, 5).tolist()} kg m2"
            raise InputError(f"no body has a {name} of {has}")
        written = {
            "origin": {"xyz": in_full(*one.lever), "rpy": "0 0 0"},
            "mass": {"value": in_full(mass)},
            "inertia": dict(zip(MOMENTS, map(in_full, one.inertia[np.triu_indices(3)]), strict=True)),
        }
        for child in tree.iterfind(f"link[@name='{name}']/inertial/*"):
            child.attrib.update(written.get(child.tag, {}))
    text = '<?xml version="1.0"?>\n' + tostring(tree, encoding="unicode") + "\n"
    return replace(body, urdf=text, label=f"{body.label}, extended")
