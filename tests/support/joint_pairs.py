"""Two bodies with general poses, points and axes, joined by one joint of any type."""

import numpy as np

import dap3d_core as dap
from dap3d_core.simulation import CompiledModel
from dap3d_joints.universal import Universal
from support.derived_types import from_C_alone
from support.joint_types import (
    OnGround,
    Parabola,
    PinInSlot,
    RepeatedRow,
    Rising,
    Shelf,
    Sleeve,
    Trolley,
    TwoHinges,
    Upright,
)
from support.own_types import registry_of

#: Fields of one joint of every standard type with three rows or more between two bodies.
STANDARD = {
    "sph": {"P_i": "P_i", "P_j": "P_j"},
    "rev": {"P_i": "P_i", "P_j": "P_j", "a_i": "a_i", "a_j": "a_j"},
    "univ": {"P_i": "P_i", "P_j": "P_j", "a_i": "a_i", "n_j": "a_j"},
    "cyl": {"d": "d", "a_i": "a_i", "a_j": "a_j"},
    "tran": {"d": "d", "a_j": "a_j"},
}


BETWEEN = {"P_i": "P_i", "P_j": "P_j", "a_i": "a_i", "a_j": "a_j"}


def unit(rng, size=3):
    x = rng.normal(size=size)
    return tuple((x / np.linalg.norm(x)).tolist())


def pair(seed=1, *, on_ground=False):
    """A scene of body i and body j, or ground, as drawn: nothing is on a constraint.
    Points P_i, P_j, vector d from the one to the other, axes a_i, b_i and the triad a_j, n_j,
    m_j."""
    rng = np.random.default_rng(seed)
    scene = dap.Scene(name="pair")
    names = {"i": "body", "j": "ground" if on_ground else "base"}
    for name in dict.fromkeys(names.values()):
        if name != "ground":
            scene.add_body(name, mass=1.5, Jp=(0.3, 0.4, 0.5), r=tuple(rng.normal(size=3)),
                           p=unit(rng, 4))  # fmt: skip
    a_j = np.array(unit(rng))
    n_j = np.cross(a_j, unit(rng))
    n_j /= np.linalg.norm(n_j)
    local = {"a_j": a_j, "n_j": n_j, "m_j": np.cross(a_j, n_j), "a_i": unit(rng), "b_i": unit(rng)}
    for name, components in local.items():
        scene.add_vector(name, names[name[-1]], tuple(map(float, components)))
    for slot, name in names.items():
        scene.add_point(f"P_{slot}", name, tuple(rng.normal(size=3)))
    scene.add_vector2("d", "P_i", "P_j")
    return scene


OWN = (from_C_alone(Universal, "derived-univ"), PinInSlot, TwoHinges, Parabola, RepeatedRow,
       Upright, Rising, OnGround, Shelf, Sleeve, Trolley)  # fmt: skip


def compiled_pair(keyword, fields, seed=3, *, on_ground=False):
    """The model of one joint of a type between two bodies, or a body and ground."""
    scene = pair(seed, on_ground=on_ground)
    scene.add_joint(keyword, "J", **fields)
    return CompiledModel(scene, registry=registry_of(*OWN))
