"""Solids of bodies and shapes, arrows, colours, camera and instants follow the result."""

import numpy as np
import pytest
from support.internals import SYMBOLS, specs_of
from support.own_types import registry_of
from support.results import model_of, result_of, rows_of
from support.rotations import to_global
from support.scenes import scene_for
from unit.view.test_page import numbers, shaped

import dap3d_core as dap
from dap3d_core.interface import Body, Force, Joint, Point, Vector, body, examine, point, vector
from dap3d_core.kernels import dot, sub
from dap3d_core.model import build_model
from dap3d_core.scene import check
from dap3d_core.view.scene3d.colors import CYCLE, chains_of, colors
from dap3d_core.view.scene3d.elements import elements_of, joints_of
from dap3d_core.view.scene3d.primitives import SOLIDS, solid, spring, turned_to
from dap3d_core.view.scene3d.sampled_motion import Extent, Motion, instants_to_show, stage
from dap3d_core.view.scene3d.scene_data import (
    DRAWINGS,
    MODEST,
    Drawer,
    geometry_of,
    inertia_ellipsoid,
)

TYPES = [
    (row.kind, row.keyword)
    for row in dap.load_registry().listing()
    if row.kind in ("joint", "force") and row.state == "ok"
]
#: Forces without fields that could be drawn: these are arrows alone.
LOADS = {"f", "fp", "n", "np"}


@pytest.fixture(scope="module")
def four():
    return dap.simulate("fourbar3", t_end=0.1, dt=0.01)


@pytest.fixture(scope="module")
def page(four):
    return dap.view(four)


def test_arrows_are_reactions_and_forces_of_the_result(four, page):
    found = {(a["layer"], a["what"], a["name"], a["body"]): a for a in page.data["arrows"]}
    force = numbers(found["reactions", "force", "J1", 1]["values"]).reshape(-1, 3)
    np.testing.assert_allclose(force, four.reaction("J1")["i"].force, rtol=1e-6)
    assert found["reactions", "force", "J1", 1]["at"] == (0.0, 0.0, -1.0)
    moment = numbers(found["reactions", "moment", "J1", 1]["values"]).reshape(-1, 3)
    expected = four.reaction("J1")["i"].moment_at_point
    np.testing.assert_allclose(moment, expected, rtol=1e-6, atol=1e-6)
    spring = numbers(found["forces", "force", "spring1", 2]["values"]).reshape(-1, 3)
    np.testing.assert_allclose(spring, four.force("spring1").on["i"].force, rtol=1e-6)
    assert ("reactions", "moment", "J2", 1) not in found  # a ball joint passes none but rounding
    assert not any(body == 0 for *_, body in found)


@pytest.mark.parametrize("fps", [1.0, 30.0, 77.0, 1e6])
def test_frames_are_the_nearest_reported_instants(fps):
    t = np.cumsum(np.random.default_rng(0).uniform(0.001, 0.02, 400))
    places = instants_to_show(t, 3, fps)
    assert places[0] == 0
    assert places[-1] == len(t) - 1
    assert np.all(np.diff(places) > 0)
    wanted = np.arange(t[0], t[-1], 1.0 / fps) if fps < 1e3 else t
    off = np.abs(t[places][None] - wanted[:, None]).min(axis=1)
    np.testing.assert_allclose(off, np.abs(t[None] - wanted[:, None]).min(axis=1), atol=1e-15)


def test_without_fps_all_instants_are_there_as_far_as_they_fit():
    t = np.linspace(0.0, 1.0, 5001)
    np.testing.assert_array_equal(instants_to_show(t, 4, None), np.arange(5001))
    at_instants = instants_to_show(t, 1000, None)
    assert 500 < len(at_instants) < 600
    assert (at_instants[0], at_instants[-1]) == (0, 5000)
    assert list(instants_to_show(t[:1], 4, 10.0)) == [0]


def test_bodies_without_shapes_are_links_between_their_points(page):
    marks = [m for m in page.data["marks"] if (m[0], m[7]) == ("bodies", "coupler")]
    rods = [m for m in marks if m[1] == "cylinder"]
    np.testing.assert_allclose(sorted(at[2] for _, _, _, at, *_ in rods), [-1.6, 1.6])
    assert all(size[2] == pytest.approx(3.2) for _, _, _, _, size, *_ in rods)
    assert {color for *_, color, _ in rods} == {"#ff7f0e"}


def test_a_bare_body_is_the_ellipsoid_of_its_inertia():
    """A solid ellipsoid with semi-axes a, b, c has J = m/5 (b^2+c^2, ...)."""
    a, b, c, mass = 0.3, 0.2, 0.1, 5.0
    J = np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) * mass / 5.0
    p = np.array([0.5, 0.1, -0.7, 0.4])
    A = to_global(p / np.linalg.norm(p), np.eye(3)).T
    mark = inertia_ellipsoid(1, mass, A @ J @ A.T, np.inf, "red", "b")
    assert sorted(mark.size) == pytest.approx([c, b, a])
    axis = to_global(mark.q, np.eye(3)[int(np.argmax(mark.size))])
    assert abs(axis @ A[:, 0]) == pytest.approx(1.0)
    assert max(inertia_ellipsoid(1, mass, J, 0.06, "red", "b").size) == pytest.approx(0.06)


def test_a_bare_body_hides_nothing_and_shows_that_it_turns():
    scene = dap.Scene(name="thrown")
    scene.add_body("b", Jp=(9.0, 9.0, 9.0), r_dot=(2.0, 0.0, 0.0), w=(0.0, 0.0, 1.0))
    marks = dap.view(dap.simulate(scene, t_end=1.0, dt=0.5)).data["marks"]
    (ellipsoid,) = (m for m in marks if m[0] == "inertia")
    assert max(ellipsoid[4]) == pytest.approx(MODEST * 2.0, rel=1e-6)  # it flies 2 m
    arms = [m for m in marks if m[1] == "cylinder"]
    assert [m[4][2] for m in arms] == pytest.approx([0.09] * 3, rel=1e-6)
    assert {m[7] for m in marks} == {"b"}


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 0, -2), (1, 0, 0), (0.3, -4.0, 0.5)])
def test_marks_turn_to_their_axes(axis):
    found = to_global(turned_to(axis), [0.0, 0.0, 1.0])
    np.testing.assert_allclose(found, np.array(axis) / np.linalg.norm(axis), atol=1e-12)


@pytest.mark.parametrize("form", [*map(solid, SOLIDS), spring(10.0)])
def test_solids_are_closed_and_look_outwards(form):
    """By the divergence theorem the volume within is positive; each edge has two triangles."""
    vertices, inverse = np.unique(form.vertices.round(9), axis=0, return_inverse=True)
    faces = inverse.reshape(-1)[form.triangles]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() > 0.0
    edges = {(int(i), int(j)) for f in faces for i, j in zip(f, np.roll(f, -1), strict=True)}
    open_edges = {e for e in edges if e[::-1] not in edges}
    assert len(open_edges) <= 16  # the two ends of a spring's wire
    assert (len(open_edges) == 0) or form.vertices[:, 2].max() <= 0.51


def test_colours_are_those_of_the_scene_or_differ():
    found = colors(["tab:blue", "", "#123456", "", "javascript:alert(1)", "rot{}"])
    assert found[0] == "#1f77b4"
    assert found[2] == "#123456"
    assert [found[k] for k in (1, 3, 4, 5)] == list(CYCLE[:4])


def test_of_many_bodies_a_chain_has_one_hue():
    """Fifty links in six colours in turn say nothing; light tells the first from the last."""
    chain = [(k, k + 1) for k in range(1, 50)]
    found = colors([""] * 50, chain)
    levels = np.array([[int(c[k : k + 2], 16) for k in (1, 3, 5)] for c in found], dtype=float)
    depth = 255.0 - levels  # all of one hue: in one ratio
    np.testing.assert_allclose(
        depth / depth[:, :1], np.tile(depth[0] / depth[0, 0], (50, 1)), atol=0.02
    )
    assert (np.diff(levels.sum(axis=1)) > 0.0).all()
    two = colors([""] * 20, [(k, k + 1) for k in range(1, 20) if k != 10])
    assert two[0] == CYCLE[0]
    assert two[10] == CYCLE[1]
    assert len(set(two)) == 20
    star = colors(["", "#123456", *[""] * 10], [(1, k) for k in range(2, 13)])
    assert star[1] == "#123456"
    assert chains_of(3, [(1, 2)]) == [[1, 2], [3]]


def test_up_is_against_gravity_and_planar_motion_is_seen_squarely():
    low, high = np.array([-1.0, -1.0, 0.0]), np.array([1.0, 1.0, 0.01])
    found = stage(Extent(low, high, np.zeros((1, 3))), (0.0, -9.81, 0.0))
    assert found["up"] == (0.0, 1.0, 0.0)
    assert found["eye"][2] > 0.9
    assert found["ground"] < -1.0
    rising = stage(Extent(np.zeros(3), np.array([1.0, 1.0, 1.0]), np.zeros((1, 3))), None)
    assert (rising["up"], rising["ground"]) == ((0.0, 0.0, 1.0), 0.0)


def test_shapes_take_the_place_of_links(tmp_path):
    pytest.importorskip("trimesh")
    result = dap.simulate(shaped(tmp_path), t_end=0.1, dt=0.05)
    data = dap.view(result, model=tmp_path).data
    ((layer, kind, body, at, size, *_, color, owner),) = data["marks"]
    assert (layer, kind, body, at, owner) == ("shapes", "box", 1, [0.0, 0.0, 0.5], "case")
    assert (size, color) == ([0.1, 0.2, 0.3], "#d62728")
    assert data["lines"][0]["points"] == ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    (mesh,) = data["meshes"]
    assert len(numbers(mesh["vertices"])) == 9
    assert sorted(numbers(mesh["triangles"], "<u4")) == [0, 1, 2]
    assert data["about"]["view_notes"] == []


def test_the_camera_sees_shapes_as_large_as_they_are():
    """A flat plate on the ground at height 0: the grid stays there, and the plate is in view."""
    scene = dap.Scene(name="plate")
    scene.add_body("b", Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 1.0))
    scene.add_shape("disk", body="ground", radius=2.0)
    scene.add_shape("cone", body="b", radius=0.1, length=0.5, axis=(0.0, 0.0, 1.0))
    found = dap.view(dap.simulate(scene, t_end=0.0)).data["stage"]
    assert found["ground"] == 0.0
    low = np.subtract(found["center"], np.multiply(0.5, found["extent"]))
    high = np.add(found["center"], np.multiply(0.5, found["extent"]))
    np.testing.assert_allclose(high, [2.0, 2.0, 1.5], atol=0.15)
    np.testing.assert_allclose(low, [-2.0, -2.0, 0.0], atol=0.15)


def test_a_result_does_not_know_where_meshes_lie_and_says_so(tmp_path):
    result = dap.simulate(shaped(tmp_path), t_end=0.1, dt=0.05)
    page = dap.view(result)
    assert page.data["meshes"] == []
    (note,) = page.data["about"]["view_notes"]
    assert "shape part is not drawn" in note
    assert "--model" in note
    (tmp_path / "cube.stl").write_bytes(b"\x00\x01nonsense")
    (note,) = dap.view(result, model=tmp_path).data["about"]["view_notes"]
    assert "shape part is not drawn" in note


@pytest.fixture(scope="module")
def four_symbols():
    """Symbols of the four-bar model: owner -> solids of its joint."""
    data = dap.view(dap.simulate("fourbar3", t_end=0.1, dt=0.05)).data
    keys = ("layer", "kind", "body", "at", "size", "q", "color", "owner")
    marks = [dict(zip(keys, row, strict=True)) for row in data["marks"]]
    joints = [m for m in marks if m["layer"] == "joints"]
    return {m["owner"]: [j for j in joints if j["owner"] == m["owner"]] for m in joints}, data


def axis(q):
    return to_global(q, [0.0, 0.0, 1.0])


def test_joints_look_like_their_kind(four_symbols):
    marks, _ = four_symbols
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


def test_springs_run_between_their_ends(four_symbols):
    (spring,) = four_symbols[1]["spans"]
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


@pytest.mark.every(5)
@pytest.mark.parametrize("ground", [None, "j"])
@pytest.mark.parametrize(("kind", "keyword"), TYPES)
def test_every_installed_type_is_drawn_with_finite_sizes(kind, keyword, ground):
    """In any pose, free or tied to ground: numbers are finite, axes of unit length."""
    type_info = dap.load_registry().get(kind, keyword)
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
    with pytest.raises(dap.PluginError, match=words):
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
