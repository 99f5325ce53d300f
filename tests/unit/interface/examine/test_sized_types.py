"""Types with lists of a length that the scene gives."""

from math import nan
from typing import ClassVar

import numpy as np
import pytest
from support.internals import Shape, entry_fields, sample_classes, shared_slots, sized

import dap3d_core as dap
from dap3d_core.interface import (
    Force,
    Function,
    Joint,
    examine,
    number,
    numbers,
    points,
    table,
    vectors,
)
from dap3d_core.kernels import by_body, cross, dot, item, neg, scale, sub
from dap3d_core.testing import check_type


class Anchors(Force):
    """Each point is pulled towards the first by a spring of its own, with a memory."""

    keyword = "anchors"
    states: ClassVar = {"q": "n"}
    points: tuple = points("n", least=2)
    stiffness: tuple = numbers("n", 2.0)
    tau: float = number(1.0, positive=True)

    def wrench(r_points, s_points, on_points, stiffness, q, n, body_count):
        parts, on = [], []
        for k in range(1, n):
            F = scale(stiffness[k] + q[k], sub(r_points[0], r_points[k]))
            parts += [(F, cross(s_points[k], F)), (neg(F), neg(cross(s_points[0], F)))]
            on += [on_points[k], on_points[0]]
        return by_body(on, parts, body_count)

    def rate(q, n, tau):
        return (tuple(-q[k] / tau for k in range(n)),)


class Aligned(Joint):
    """The axes have a constant sum of cosines with the first; its rows are derived."""

    keyword, rows = "aligned", 1
    axes: tuple = vectors("m", least=2)

    def prepare(self, bodies):
        a = [pose.to_global(v) for v, pose in zip(self.axes, bodies["axes"], strict=True)]
        return {"total": sum(dot(a[0], b) for b in a[1:])}

    def C(axes, total):
        return sum(dot(axes[0], a) for a in axes[1:]) - total


@pytest.mark.slow
def test_the_formulas_of_all_samples_are_checked():
    report = check_type(examine(Anchors), poses=2)
    assert report.ok, report
    report = check_type(examine(Aligned), poses=2)
    assert report.ok, report
    assert [len(c.shape_of_lists.on[0][1]) for c in sample_classes(Aligned)] == [3, 4]


class Cam(Function):
    """Steps of a table, by the index of its rows."""

    keyword, smooth = "cam", True
    heights: tuple = table()

    def value(x, heights):
        return item(heights, 3.0 * x)[0], 0.0, 0.0, 0.0


def test_a_row_is_read_by_its_index():
    """The whole index below; outside of the table its first and its last row; also compiled."""
    heights = [5.0, 6.0, 7.0, 8.0], 1, 3, (0.0,)
    for k, want in ((-4, 6.0), (0, 6.0), (1, 7.0), (1.9, 7.0), (2, 8.0), (9, 8.0), (nan, 6.0)):
        assert item(heights, k) == (want,)
    (compiled,) = [o for o in check_type(examine(Cam), poses=4).outcomes if o.check == "compiled"]
    assert compiled.ok, compiled


def test_parts_are_summed_for_each_body():
    parts = [((1.0, 2.0), 3.0), ((10.0, 20.0), 30.0), ((100.0, 200.0), 300.0)]
    sums = by_body((1, 0, 1), parts, 3)
    assert sums == (parts[1], ((101.0, 202.0), 303.0), ((0.0, 0.0), 0.0))


def test_a_shape_has_one_type():
    """Equal lists share a compiled loop."""
    shape = Shape((("m", 2),), (("axes", ("i", "j")),))
    type_info = sized(Aligned, shape, examine)
    assert type_info is sized(Aligned, shape, examine)
    assert type_info.layout.slots == ("i", "j")
    assert entry_fields("axes", ("i", "j")) == ["axes_0_i", "axes_1_j"]


def test_bodies_share_slots_in_the_order_of_the_list():
    assert shared_slots([3], {"points": [5, 3, 5]}) == ([3, 5], {"points": ("j", "i", "j")})
    with pytest.raises(ValueError, match="acts on 25 bodies; an element acts on 24 at most"):
        shared_slots([], {"points": list(range(25))})


def cable(**fields):
    scene = dap.Scene(name="cable")
    scene.add_body("a", mass=1.0, Jp=[0.1, 0.1, 0.1], r=[0.0, 0.0, -1.0])
    scene.add_joint("cable", "rope", **fields)
    return scene


def belt():
    scene = dap.Scene(name="belt")
    scene.add_body("a", mass=1.0, Jp=[0.1, 0.1, 0.1], r=[1.0, 0.0, 0.0])
    scene.add_force("belt", "b", points=["a.O", "ground.O"], radii=[0.1], axis_i="ground.z", k=1.0)
    return scene


def coinciding():
    scene = cable(points=["a.O", "P", "ground.O"])
    scene.add_point("P", body="ground", sPp=[0.0, 0.0, -1.0])
    return scene


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: cable(points="a.O"), "should be a list of 2 or more points, by name"),
        (lambda: cable(points=["a.O"]), "should be a list of 2 or more points, by name"),
        (lambda: cable(points=["a.O", "b.O"]), "b"),
        (lambda: cable(points=["a.O"] * 2), "all are on a; an element acts between bodies"),
        (cable, "is required"),
        (coinciding, "points 1 and 2 of the cable coincide"),
        (belt, "has 1 entries, and points has 2: they go together"),
    ],
)
def test_a_wrong_list_is_refused(make, words):
    with pytest.raises(dap.SceneError, match=words):
        dap.compile(make())


def test_gravitation_of_all_pairs(tmp_path):
    """``each_pair``: the accelerations of three bodies are Newton's, to rounding."""
    (tmp_path / "plugin.py").write_text(GRAVITATION)
    (tmp_path / "scene.toml").write_text(THREE)
    scene = dap.load(tmp_path / "scene.toml")
    result = dap.simulate(scene, allow_code=True, t_end=1.0, dt=0.5, rtol=1e-10, atol=1e-12)
    m, r = np.array([5.0, 2.0, 1.0]), result.r[-1]
    want = [
        sum(m[j] * (r[j] - r[i]) / np.linalg.norm(r[j] - r[i]) ** 3 for j in range(3) if j != i)
        for i in range(3)
    ]
    np.testing.assert_allclose(result.rdd[-1], want, rtol=1e-12)
    energy = result.quantity("energy.total").values
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


GRAVITATION = '''
from dap3d_core.interface import Force, hookimpl, number
from dap3d_core.kernels import neg, norm2, scale, sqrt, sub

interface_version = 1
ZERO = (0.0, 0.0, 0.0)


class Gravitation(Force):
    """Every two bodies attract each other."""

    keyword, each_pair = "gravitation", True
    G: float = number(1.0)

    def wrench(r_i, r_j, mass_i, mass_j, G):
        d = sub(r_j, r_i)
        F = scale(G * mass_i * mass_j / (norm2(d) * sqrt(norm2(d))), d)
        return (F, ZERO), (neg(F), ZERO)

    def energy(r_i, r_j, mass_i, mass_j, G):
        return -G * mass_i * mass_j / sqrt(norm2(sub(r_j, r_i)))


@hookimpl
def dap3d_forces():
    return [Gravitation]
'''
THREE = """
[bodies.a]
mass = 5.0
Jp = [0.1, 0.1, 0.1]
[bodies.b]
mass = 2.0
Jp = [0.1, 0.1, 0.1]
r = [3.0, 0.0, 0.5]
r_dot = [0.0, 1.0, 0.0]
[bodies.c]
mass = 1.0
Jp = [0.1, 0.1, 0.1]
r = [0.0, -4.0, 0.0]
r_dot = [1.0, 0.0, 0.2]
[forces.g]
type = "gravitation"
[simulation]
t_end = 1.0
dt = 0.5
"""


class Level(Joint):
    """Points of different bodies stay at one height."""

    keyword, rows, ground_axes = "level", "n - 1", True
    unilateral = True
    points: tuple = points("n", least=2, apart=True)

    def C(r_points, n):
        return tuple(r_points[k][2] - r_points[0][2] for k in range(1, n))


@pytest.mark.slow
def test_rows_are_counted_by_a_list():
    """One less than points; lists that are apart have one sample."""
    assert check_type(examine(Level)).ok
    (class_,) = sample_classes(Level)
    assert (class_.rows, class_.unilateral) == (2, (0, 1))


@pytest.mark.parametrize("rows", ["m - 1", "n - x", "n + 1", ""])
def test_rows_of_no_list_are_refused(rows):
    wrong = type("Wrong", (Level,), {"rows": rows, "__module__": __name__})
    with pytest.raises(dap.PluginError, match=r"declares rows = .* size of a list \(n\), or one"):
        examine(wrong)
