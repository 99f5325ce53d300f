"""Joints and forces are drawn by the symbol that their type declares, else by its fields."""

import numpy as np
import pytest
from support.own_types import registry_of
from support.results import model_of, result_of, rows_of
from support.scenes import scene_for

import dap3d_core as dap
from dap3d_core.interface import Body, Force, Joint, Point, Vector, body, point, vector
from dap3d_core.interface.examine.examine import PluginError, examine
from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.types import SYMBOLS
from dap3d_core.kernels import dot, sub
from dap3d_core.model import build_model
from dap3d_core.model.rotations import to_global
from dap3d_core.registry import load_registry
from dap3d_core.scene import check
from dap3d_core.view.scene3d.elements import elements_of, joints_of
from dap3d_core.view.scene3d.sampled_motion import Motion
from dap3d_core.view.scene3d.scene_data import geometry_of
from dap3d_core.view.scene3d.symbols import DRAWINGS, Drawer

TYPES = [
    (row.kind, row.keyword)
    for row in load_registry().listing()
    if row.kind in ("joint", "force") and row.state == "ok"
]
#: Forces without fields that could be drawn: these are arrows alone.
LOADS = {"f", "fp", "n", "np"}


@pytest.fixture(scope="module")
def four():
    """Symbols of the four-bar model: owner -> solids of its joint."""
    data = dap.view(dap.simulate("fourbar3", t_end=0.1, dt=0.05)).data
    keys = ("layer", "kind", "body", "at", "size", "q", "color", "owner")
    marks = [dict(zip(keys, row, strict=True)) for row in data["marks"]]
    joints = [m for m in marks if m["layer"] == "joints"]
    return {m["owner"]: [j for j in joints if j["owner"] == m["owner"]] for m in joints}, data


def axis(q):
    return to_global(q, [0.0, 0.0, 1.0])


def test_joints_look_like_their_kind(four):
    marks, _ = four
    pin, collar = marks["J1"]
    assert {pin["kind"], collar["kind"]} == {"cylinder"}
    assert (pin["body"], pin["at"]) == (1, [0.0, 0.0, -1.0])
    np.testing.assert_allclose(axis(pin["q"]), [1, 0, 0], atol=1e-6)
    assert pin["size"][2] > 4 * pin["size"][0]
    (ball,) = marks["J2"]
    assert (ball["kind"], ball["body"], ball["at"]) == ("sphere", 1, [0.0, 0.0, 1.0])
    (ring,) = marks["J5"]  # the motor is at the hinge it turns, about its axis
    assert (ring["kind"], ring["body"]) == ("ring", 0)
    np.testing.assert_allclose(ring["at"], [0, 0, 0], atol=1e-6)
    np.testing.assert_allclose(axis(ring["q"]), [1, 0, 0], atol=1e-6)


def test_springs_run_between_their_ends(four):
    (spring,) = four[1]["spans"]
    assert (spring["kind"], spring["layer"], spring["owner"]) == ("spring", "forces", "spring1")
    assert spring["start"] == (2, (0.0, 0.0, 3.2))
    assert spring["end"] == (0, (0.0, 0.0, 0.0))


def test_a_cable_runs_from_point_to_point():
    """Two blocks over a movable pulley: three spans of points of which two are on ground."""
    scene = dap.Scene(name="tackle")
    scene.add_body("block", r=(0.0, 0.0, -1.0))
    scene.add_body("weight", r=(2.0, 0.0, -1.0))
    scene.add_point("rail", "ground", (1.0, 0.0, 0.0))
    scene.add_joint("cable", "rope", points=["ground.O", "block.O", "rail", "weight.O"])
    spans = [
        s for s in dap.view(dap.simulate(scene, t_end=0.1)).data["spans"] if s["owner"] == "rope"
    ]
    assert [s["start"] for s in spans[1:]] == [s["end"] for s in spans[:-1]]
    assert [s["start"][0] for s in spans] + [spans[-1]["end"][0]] == [0, 1, 0, 2]
    assert spans[1]["end"] == (0, (1.0, 0.0, 0.0))


def test_a_rail_is_as_long_as_the_motion():
    scene = dap.Scene(name="sliding")
    scene.add_body("block", r=(0.5, 0.0, 0.0))
    scene.add_joint("tran", "rail", P_i="block.O", P_j="ground.O", a_j="ground.x")
    scene.add_force("f", "push", body_i="block", f=(1.0, 0.0, 0.0))
    data = dap.view(dap.simulate(scene, t_end=2.0, dt=0.5)).data
    rail, sleeve = (row for row in data["marks"] if row[0] == "joints")
    half = 0.5 * rail[4][2]
    assert rail[3][0] - half < 0.0 < 0.5 + 2.0 < rail[3][0] + half
    assert (sleeve[1], sleeve[2]) == ("box", 1)


@pytest.mark.parametrize("ground", [None, "j"])
@pytest.mark.parametrize(("kind", "keyword"), TYPES)
def test_every_installed_type_is_drawn_with_finite_sizes(kind, keyword, ground):
    """In any pose, free or tied to ground: numbers are finite, axes of unit length."""
    type_info = load_registry().get(kind, keyword)
    if any(spec.kind == "joint" for spec in specs_of(type_info.type).values()):
        pytest.skip("it acts in a joint, which is drawn itself")
    scene = scene_for(type_info, np.random.default_rng(5), ground=ground)
    model = model_of(scene)
    t = np.array([0.0, 1.0])
    v_dot, Lam = np.zeros((2, 18)), np.zeros((2, model.row_count))
    result = result_of(scene, rows_of(model, t, np.stack([model.u0, model.u0]), v_dot, Lam), model)
    found = geometry_of(result, scene, elements_of(result))
    assert [one["type"] for one in (*found["joints"], *found["forces"])] in ([keyword], [])
    for row in found["marks"]:
        values = np.array([*row[3], *row[4], *row[5]], dtype=float)
        assert np.all(np.isfinite(values))
        assert np.all(np.array(row[4]) > 0.0)
        assert np.linalg.norm(row[5]) == pytest.approx(1.0, abs=1e-6)
    drawn = [row for row in found["marks"] if row[-1] == "element"]
    drawn += [span for span in found["spans"] if span["owner"] == "element"]
    assert drawn or keyword in LOADS or getattr(type_info.type, "each_body", False)


class Hook(Joint):
    """A third-party type: a point stays in a plane. It has the fields that most symbols need."""

    keyword, rows = "test-hook", 1
    P_i: Point = point()
    P_j: Point = point()
    a_i: Vector = vector()
    a_j: Vector = vector()
    n_j: Vector = vector()

    def C(r_P_i, r_P_j, n_j):
        return (dot(sub(r_P_i, r_P_j), n_j),)


def drawn(type_):
    """The elements of one joint of a type, and the kinds of solids that show it."""
    scene = dap.Scene()
    scene.add_body("b")
    scene.add_point("P", "b", (0.1, 0.2, 0.3))
    scene.add_joint(type_.keyword, "hook", P_i="P", P_j="ground.O", a_i="b.x", a_j="ground.y",
                    n_j="ground.z")  # fmt: skip
    model = build_model(check(scene, registry_of(type_)))
    u, Lam = model.u0[None], np.zeros((1, model.row_count))
    result = result_of(scene, rows_of(model, np.zeros(1), u, np.zeros((1, 6)), Lam), model)
    joints = joints_of(model)
    pieces = Drawer(Motion(result), 0.01, joints).joint(joints[0])
    return joints[0], [piece.kind for piece in pieces]


def test_a_type_without_a_symbol_is_drawn_by_its_fields():
    hook, kinds = drawn(Hook)
    assert hook.bodies == {"i": 1, "j": 0}
    assert hook.points == {"i": (1, (0.1, 0.2, 0.3)), "j": (0, (0.0, 0.0, 0.0))}
    assert hook.vectors["n_j"] == (0, (0.0, 0.0, 1.0))
    assert kinds == ["sphere", "sphere", "cylinder", "cylinder", "cylinder"]


@pytest.mark.parametrize(
    ("symbol", "kinds"),
    [
        ("ball", ["sphere"]),
        ("hinge", ["cylinder", "cylinder"]),
        ("cross", ["sphere", "cylinder", "cylinder"]),
        ("sleeve", ["cylinder", "cylinder"]),
        ("slider", ["cylinder", "box"]),
        ("link", ["rod", "sphere", "sphere"]),
        ("plate", ["sphere", "cylinder"]),
        ("ring", ["ring"]),
        ("block", ["box"]),
        ("spring", ["spring"]),
    ],
)
def test_a_third_party_type_is_drawn_by_the_symbol_that_it_declares(symbol, kinds):
    type_ = type("Drawn", (Hook,), {"symbol": symbol, "keyword": "drawn", "__doc__": "A hook."})
    assert drawn(type_)[1] == kinds


def test_each_symbol_has_a_drawing():
    assert set(DRAWINGS) == {"", *SYMBOLS}


@pytest.mark.parametrize(
    ("symbol", "words"), [("hing", "is not one of ball"), ("wheel", "drawn from radius")]
)
def test_a_symbol_that_cannot_be_drawn_is_refused(symbol, words):
    type_ = type("Odd", (Hook,), {"symbol": symbol, "keyword": "odd", "__doc__": "A hook."})
    with pytest.raises(PluginError, match=words):
        examine(type_)


def test_a_contact_is_no_rod():
    """A force between bodies whose type declares no place on them does not join them."""

    class Contact(Force):
        keyword = "touch"
        body_i: Body = body()
        body_j: Body = body()

        def wrench(r_i, r_j):
            return ((sub(r_j, r_i), (0.0, 0.0, 0.0)), (sub(r_i, r_j), (0.0, 0.0, 0.0)))

    scene = dap.Scene(name="balls")
    for name, x in (("a", 0.0), ("b", 5.0)):
        scene.add_body(name, r=[x, 0.0, 0.0])
        scene.add_shape("sphere", f"s{name}", body=name, radius=1.0)
    scene.add_force("touch", "t", body_i="a", body_j="b")
    model = build_model(check(scene, registry_of(Contact)))
    u = np.zeros((1, 26))
    u[0, [3, 10]], u[0, 7] = 1.0, 5.0
    result = result_of(
        scene, rows_of(model, np.zeros(1), u, np.zeros((1, 12)), np.zeros((1, 0))), model
    )
    found = geometry_of(result, scene, elements_of(result))
    assert found["spans"] == []
    assert {mark[0] for mark in found["marks"]} == {"shapes"}
