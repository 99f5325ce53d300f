"""The motion of joint types in words, for every standard type and the reasons of refusals."""

import pytest
from support.joint_types import (
    Between,
    OnGround,
    Parabola,
    PinInSlot,
    RepeatedRow,
    Rising,
    Shelf,
    TwoHinges,
    Upright,
)

import dap3d_core as dap
from dap3d_core.interface import Joint, Point, choice, examine, point
from dap3d_core.kernels import dot, sub
from dap3d_core.testing import check_type
from dap3d_core.testing.kit import type_motions
from dap3d_forces.weight import Weight
from dap3d_joints.planar import Planar

ON_TIME = "rows stay: its rows depend on time"
ONE_ROW = "rows stay: its 1 row costs less than 5 joint coordinates"
ON_VELOCITY = "rows stay: it has rows of the velocity level"
INSTALLED = {
    "rev": ["1 rotation about a_j, constant in body j"],
    "sph": ["3 rotations about P_j, constant in body j"],
    "cyl": ["1 translation along a_j and 1 rotation about a_j, constant in body j"],
    "tran": ["1 translation along a_j, constant in body j"],
    "univ": [
        "1 rotation about n_j, constant in body j, and 1 rotation about a_i, constant in body i"
    ],
    "fix": ["none: the bodies move as one"],
    "weld": ["none: the bodies move as one"],
    "screw": ["1 screw about a_j, constant in body j"],
    "sph-sph": [ONE_ROW, ON_TIME, ON_VELOCITY],  # a link, a driven leg, one with an input
    "rP": [ONE_ROW, ON_VELOCITY],
    "disk": [ON_VELOCITY, ONE_ROW, ON_VELOCITY, ON_VELOCITY],
    "drive-rot": [ON_TIME, ON_VELOCITY],
    "drive-tran": [ON_TIME, ON_VELOCITY],
    "rel-rot": [ON_VELOCITY, ON_VELOCITY],
    "rel-tran": [ON_VELOCITY, ON_VELOCITY],
    "planar": ["2 translations along n_j and m_j and 1 rotation about a_j, constant in body j"],
    "parallel": ["rows stay: its 2 rows cost less than 4 joint coordinates"],
    "inline": ["rows stay: its 2 rows cost less than 4 joint coordinates"],
    "inplane": [ONE_ROW],
    "oncurve": ["rows stay: it has unknowns of its own: s"] * 2,
    "cv": ["rows stay: the axes of its free motions are constant in neither body"],
    "motor": [ON_TIME, *[ON_VELOCITY] * 2, ON_TIME, *[ON_VELOCITY] * 2],
    "couple": ["rows stay: it joins three bodies"],
    "gear": [ONE_ROW] * 2,
    "rack": [ONE_ROW],
    "belt": ["rows stay: it joins three bodies"],
    "cable": ["rows stay: it joins three bodies"] * 4 + [ON_TIME] * 2,  # two lists each
    "tendon": ["rows stay: it joins three bodies"] * 2,
    "follow": ["rows stay: it joins three bodies"] * 4,
    "point-on-plane": [ONE_ROW],
    "point-on-surface": [ONE_ROW],
}


class Undefined(Joint):
    """Its rows are not numbers where C would be zero."""

    keyword, rows = "undefined", 3
    P_i: Point = point()
    P_j: Point = point()

    def C(r_P_i, r_P_j):
        return tuple(x / (x * x) for x in sub(r_P_i, r_P_j))


class Either(Between):
    """A ball on a plane, or in a socket: a field says which."""

    keyword, rows = "either", 3
    held: str = choice(("plane", "socket"))

    def prepare(self, bodies):
        return super().prepare(bodies) | {"socket": float(self.held == "socket")}

    def C(r_P_i, r_P_j, a_i, a_j, n_j, m_j, socket):
        d = sub(r_P_i, r_P_j)
        plane = (dot(a_j, d), dot(a_i, n_j), dot(a_i, m_j))
        return tuple(socket * x + (1.0 - socket) * y for x, y in zip(d, plane, strict=True))


OWN = {
    PinInSlot: (
        "1 translation along a_j, constant in body j, and 1 rotation about a_i, constant in body i"
    ),
    TwoHinges: (
        "1 rotation about a_j, constant in body j, and 1 rotation about a_i, constant in body i"
    ),
    OnGround: "1 rotation about a_i, constant in body i",
    Shelf: "1 translation along (1, 0, 0), constant in ground",
    Parabola: "rows stay: the axes of its free motions are constant in neither body",
    RepeatedRow: "rows stay: its rows depend on each other where C = 0",
    Upright: "rows stay: its rows depend on where ground is",
    Rising: ON_TIME,
    Undefined: "rows stay: no pose with C = 0 was found from the one given",
    Either: "rows stay: its motion is another for other values of its fields",
}


def test_every_installed_joint_is_in_the_list():
    assert set(INSTALLED) == set(dap.load_registry().keywords("joint"))


@pytest.mark.every(5)
@pytest.mark.parametrize("keyword", INSTALLED)
def test_motion_of_installed_types(keyword):
    motions = type_motions(dap.load_registry().get("joint", keyword))
    assert [motion.words for motion in motions] == INSTALLED[keyword]
    assert [motion.parts is None for motion in motions] == [
        words.startswith("rows stay") for words in INSTALLED[keyword]
    ]


@pytest.mark.every(3)
@pytest.mark.parametrize("type_", OWN, ids=lambda type_: type_.keyword)
def test_motion_of_types_of_authors(type_):
    (motion,) = type_motions(examine(type_))
    assert motion.words == OWN[type_]


def test_the_report_has_the_motion_of_a_joint_alone():
    assert "motion: 2 translations along n_j and m_j" in str(check_type(Planar, poses=1))
    assert check_type(Weight, poses=1).motions == ()
