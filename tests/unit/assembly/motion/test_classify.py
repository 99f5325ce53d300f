"""Motions of joints from C and J alone, against C of the whole model at random coordinates."""

import attrs
import numpy as np
import pytest
from support.internals import Pose, classify, compose
from support.joint_pairs import BETWEEN, STANDARD, compiled_pair, pair

from dap3d_core.simulation import CompiledModel
from dap3d_core.testing.checks.joints import axis_words, motion_words

#: C of lengths of 1 m to 3 m: some hundred operations of relative error 1e-16.
ROUNDING = 1e-13
#: Keyword -> fields and the parts of the motion.
JOINTS = {
    "sph": (STANDARD["sph"], [("ball", "j", "P_j")]),
    "rev": (STANDARD["rev"], [("rotation", "j", "a_j")]),
    "univ": (STANDARD["univ"], [("rotation", "j", "n_j"), ("rotation", "i", "a_i")]),
    "cyl": (STANDARD["cyl"], [("translation", "j", "a_j"), ("rotation", "j", "a_j")]),
    "tran": (STANDARD["tran"], [("translation", "j", "a_j")]),
    "screw": (BETWEEN | {"pitch": 0.3}, [("screw", "j", "a_j")]),
    "derived-univ": (STANDARD["univ"], [("rotation", "j", "n_j"), ("rotation", "i", "a_i")]),
    "planar": (
        BETWEEN,
        [("translation", "j", "n_j"), ("translation", "j", "m_j"), ("rotation", "j", "a_j")],
    ),
    "pin-in-slot": (BETWEEN, [("translation", "j", "a_j"), ("rotation", "i", "a_i")]),
    "sleeve": (
        BETWEEN,
        [("translation", "j", "a_j"), ("rotation", "j", "a_j"), ("rotation", "i", "a_i")],
    ),
    "two-hinges": (BETWEEN, [("rotation", "j", "a_j"), ("rotation", "i", "a_i")]),
}


def residual(compiled, motion, q, base):
    """The largest C of a model of one joint with body i placed by coordinates q, body j by base."""
    n = compiled.model.body_count
    j = Pose(*(np.asarray(x)[None] for x in base))
    there = compose(j, motion.pose(np.asarray(q, dtype=float)[None]))
    u = np.zeros(13 * n)
    placed = {int(motion.body_i[0]): there, int(motion.body_j[0]): j}
    u[: 7 * n] = np.hstack([np.hstack(placed[b + 1]) for b in range(n)]).ravel()
    return float(np.max(np.abs(compiled.evaluator.rows(0.0, u).C), initial=0.0))


@pytest.mark.every(4)
@pytest.mark.parametrize("on_ground", [False, True], ids=["between bodies", "on ground"])
@pytest.mark.parametrize("keyword", JOINTS)
def test_motion_keeps_the_constraints(keyword, on_ground):
    """C = 0 at random coordinates of the motion found, wherever body j is; named axes are right."""
    fields, parts = JOINTS[keyword]
    compiled = compiled_pair(keyword, fields, on_ground=on_ground)
    motions = classify(compiled.model)
    assert not motions.refused
    motion = motions.of(0)
    assert [(part.kind, part.constant_in, part.name) for part in motion.parts] == parts
    assert motion.size == 6 - compiled.model.row_count
    rng = np.random.default_rng(5)
    for _ in range(5):
        p = rng.normal(size=4)
        base = rng.normal(size=3), p / np.linalg.norm(p)
        if on_ground:
            base = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        q = rng.normal(size=motion.size) * 2.0
        assert residual(compiled, motion, q, base) < ROUNDING


ON_TIME = "its rows depend on time"
NOT_CONSTANT = "the axes of its free motions are constant in neither body"
REFUSED = {
    "sph-sph": ({"P_i": "P_i", "P_j": "P_j"}, "its 1 row costs less than 5 joint coordinates"),
    "parabola": (BETWEEN | {"b_i": "b_i"}, NOT_CONSTANT),
    "trolley": (BETWEEN, NOT_CONSTANT),  # its pin is fixed in neither of the two bodies
    "repeated-row": (BETWEEN, "its rows depend on each other where C = 0"),
    "upright": (BETWEEN, "its rows depend on where ground is"),
    "rising": (BETWEEN, ON_TIME),
    "rel-rot": ({"body_i": "body", "body_j": "base", "a_j": "a_j"},
                "it has rows of the velocity level"),
    "couple": ({"a_i": "a_i", "a_j": "a_j", "teeth_i": 10, "teeth_j": 20}, "it joins three bodies"),
}  # fmt: skip


@pytest.mark.parametrize("keyword", REFUSED)
def test_joints_without_such_a_motion_are_refused_by_name(keyword):
    fields, reason = REFUSED[keyword]
    motions = classify(compiled_pair(keyword, fields).model)
    assert motions.refused == {0: reason}
    assert motions.of(0) is None


def test_a_driver_is_refused_for_its_time_and_without_function_for_its_one_row():
    scene = pair(3)
    scene.add_function("a", "motor", coeff=[0.0, 1.0, 0.0])
    for name, function in (("driven", "motor"), ("locked", None)):
        fields = {"body_i": "body", "body_j": "base", "a_j": "a_j"}
        scene.add_joint("drive-rot", name, function=function, **fields)
    refused = classify(CompiledModel(scene).model).refused
    assert refused == {0: ON_TIME, 1: REFUSED["sph-sph"][1]}


def test_ground_axes_and_joints_of_one_body():
    """Rows that name ground's axes are those of a motion where body j is ground."""
    upright = classify(compiled_pair("upright", BETWEEN, on_ground=True).model).of(0)
    assert [part.kind for part in upright.parts] == ["translation", "translation", "rotation"]
    hinge = classify(compiled_pair("on-ground", {"P_i": "P_i", "a_i": "a_i"}).model).of(0)
    assert [attrs.astuple(part) for part in hinge.parts] == [("rotation", "i", "a_i")]
    assert hinge.body_j.tolist() == [0]
    shelf = classify(compiled_pair("shelf", {"P_i": "P_i"}).model).of(0)
    assert motion_words(shelf.parts, axis_words(shelf)) == (
        "1 translation along (1, 0, 0), constant in ground"
    )


def test_many_joints_of_many_types_at_once():
    """Every joint of a mixed scene has the motion that it has alone, under its own place."""
    scene, alone = pair(3), {}
    keywords = ["rev", "univ", "sph", "cyl", "sph-sph", "tran"]
    for k, keyword in enumerate(keywords):
        fields = STANDARD.get(keyword, {"P_i": "P_i", "P_j": "P_j"})
        scene.add_joint(keyword, f"J{k}", **fields)
        alone[k] = classify(compiled_pair(keyword, fields).model).of(0)
    motions = classify(CompiledModel(scene).model)
    assert list(motions.refused) == [4]
    places = [k for group in motions.motions for k in group.joints.tolist()]
    assert sorted(places) == [0, 1, 2, 3, 5]
    for k in (0, 1, 2, 3, 5):
        found = motions.of(k)
        assert found.parts == alone[k].parts
        np.testing.assert_allclose(found.screws, alone[k].screws, atol=1e-13)


def test_classification_is_the_same_each_time():
    first, second = (classify(compiled_pair("univ", STANDARD["univ"]).model) for _ in range(2))
    np.testing.assert_array_equal(first.of(0).screws, second.of(0).screws)
    np.testing.assert_array_equal(first.of(0).start.p, second.of(0).start.p)


@pytest.mark.parametrize("scale", [1e-6, 1e5])
def test_scale_does_not_matter(scale):
    """A scene of micrometres, or of a hundred kilometres, has the same motions in its units."""
    scene = pair(3)
    for body in scene.bodies.values():
        body.r = tuple(scale * x for x in body.r)
        body.Jp = tuple(scale**2 * x for x in (0.3, 0.4, 0.5))
    for point in scene.points.values():
        point.sPp = tuple(scale * x for x in point.sPp)
    scene.add_joint("univ", "J", **STANDARD["univ"])
    small, usual = classify(CompiledModel(scene).model).of(0), classify(
        compiled_pair("univ", STANDARD["univ"]).model).of(0)  # fmt: skip
    assert small.parts == usual.parts
    units = np.repeat([scale, 1.0], 3)
    np.testing.assert_allclose(small.screws / units, usual.screws, atol=1e-12)


def test_named_axes_have_the_numbers_of_the_scene():
    """The twist of a revolute joint is a_i and P_i x a_i to the last digit, or minus these."""
    scene = pair(3)
    scene.add_joint("rev", "J", **STANDARD["rev"])
    compiled = CompiledModel(scene)
    (group,) = compiled.model.joints
    at = group.type_info.layout.numbers
    a_i, P_i = (group.numbers[0, at[name][0] : at[name][0] + 3] for name in ("a_i", "P_i"))
    (screw,) = classify(compiled.model).of(0).screws[0]
    sense = np.sign(screw[3:] @ a_i)
    np.testing.assert_allclose(screw[3:], sense * a_i, atol=1e-16)
    np.testing.assert_array_equal(screw[:3], np.cross(P_i, screw[3:]))
