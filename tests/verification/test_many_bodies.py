"""Types of more than three bodies, through every formulation and integrator, with derived formulas.
A string of constant length runs from one weight to four others: the sum of its four parts is
constant. It has no mass, and all its points are mass centres: particles, whose motion numpy and
SciPy find without anything of dap3d."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import dap3d_core as dap
from dap3d_core.interface import Force, PluginError, Point, Vector, examine, point, vector
from dap3d_core.testing import check_type

PLUGIN = '''
from dap3d_core.interface import Force, Joint, Point, hookimpl, number, point
from dap3d_core.kernels import norm2, sqrt, sub

interface_version = 1


def distance(a, b):
    return sqrt(norm2(sub(a, b)))


class Star(Joint):
    """The distances from P_i to the other four points have a constant sum."""

    keyword, rows = "star", 1
    P_i: Point = point()
    P_j: Point = point()
    P_k: Point = point()
    P_l: Point = point()
    P_m: Point = point()
    length: float = number()

    def C(r_P_i, r_P_j, r_P_k, r_P_l, r_P_m, length):
        ends = (r_P_j, r_P_k, r_P_l, r_P_m)
        return sum(distance(r_P_i, end) for end in ends) - length


class Net(Force):
    """An elastic string through four points, of stiffness k and no length at rest."""

    keyword = "net"
    P_i: Point = point()
    P_j: Point = point()
    P_k: Point = point()
    P_l: Point = point()
    k: float = number()

    def energy(r_P_i, r_P_j, r_P_k, r_P_l, k):
        pairs = ((r_P_i, r_P_j), (r_P_j, r_P_k), (r_P_k, r_P_l))
        return 0.5 * k * sum(norm2(sub(a, b)) for a, b in pairs)


@hookimpl
def dap3d_joints():
    return [Star]


@hookimpl
def dap3d_forces():
    return [Net]
'''

MASS = np.array([2.0, 1.0, 1.5, 0.5, 0.8])
R = np.array([[0, 0, 0], [1, 0, 0.2], [0, 1.2, 0], [-0.9, 0.1, 0], [0.1, -1.1, 0.3]], dtype=float)
V = np.array([[0, 0, 0.3], [0, 0.5, 0], [-0.4, 0, 0], [0, -0.6, 0], [0.5, 0, 0]], dtype=float)
K, T_END = 3.0, 0.5


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("star")
    (folder / "plugin.py").write_text(PLUGIN)
    made = dap.Scene(name="star")
    for k in range(5):
        made.add_body(f"b{k}", mass=MASS[k], Jp=[0.1, 0.2, 0.3], r=R[k], r_dot=V[k], w=[0.1, k, 0])
    points = {f"P_{s}": f"b{k}.O" for k, s in enumerate("ijklm")}
    length = float(np.sum(np.linalg.norm(R[1:] - R[0], axis=1)))
    made.add_joint("star", "star", **points, length=length)
    net = dict(zip(("P_i", "P_j", "P_k", "P_l"), ("b1.O", "b2.O", "b3.O", "b4.O"), strict=True))
    made.add_force("net", "net", **net, k=K)
    made.save(folder)
    return dap.load(folder)


def directions(r):
    d = r[1:] - r[0]
    distances = np.linalg.norm(d, axis=1)[:, None]
    return d / distances, distances


def slope(t, y):
    """Accelerations of the particles with one multiplier, by hand."""
    r, v = y[:15].reshape(5, 3), y[15:].reshape(5, 3)
    u, distances = directions(r)
    G = np.vstack([-np.sum(u, axis=0), u])
    relative = v[1:] - v[0]
    along = np.sum(relative * u, axis=1)[:, None]
    gamma = -np.sum((np.sum(relative**2, axis=1)[:, None] - along**2) / distances)
    f = np.zeros((5, 3))
    for a, b in ((1, 2), (2, 3), (3, 4)):
        f[a] += K * (r[b] - r[a])
        f[b] -= K * (r[b] - r[a])
    M = MASS[:, None]
    lam = (gamma - np.sum(G * f / M)) / np.sum(G * G / M)
    return np.concatenate([v.ravel(), ((f + lam * G) / M).ravel()])


@pytest.fixture(scope="module")
def reference():
    """Positions of the particles at the end, from the velocities that the constraint allows."""
    u, _ = directions(R)
    G = np.vstack([-np.sum(u, axis=0), u])
    M = MASS[:, None]
    v = V - G / M * np.sum(G * V) / np.sum(G * G / M)  # the least correction, by mass
    found = solve_ivp(slope, (0.0, T_END), np.concatenate([R.ravel(), v.ravel()]),
                      method="DOP853", rtol=1e-13, atol=1e-13)  # fmt: skip
    return found.y[:15, -1].reshape(5, 3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "integrator"),
    [
        ("standard", "dop853"),
        ("joint", "dop853"),
        *(
            pytest.param(*names, marks=pytest.mark.slow)
            for names in (("lsq", "dop853"), ("standard", "adams"), ("standard", "radau"))
        ),
    ],
)
def test_five_bodies_move_as_particles_do(scene, reference, method, integrator):
    """Tolerances of 1e-11 a step leave some 1e-9 of the motion."""
    scene = scene.copy()
    scene.simulation.correct_metric = "mass"
    result = dap.simulate(scene, t_end=T_END, dt=T_END, method=method, integrator=integrator,
                          rtol=1e-11, atol=1e-13, allow_code=True)  # fmt: skip
    np.testing.assert_allclose(result.r[-1], reference, atol=2e-9)
    assert all(item.ok for item in result.ledger.values())


@pytest.mark.slow
def test_its_formulas_are_right(scene):
    """Derived J and gamma, and the derived wrench on four bodies, against differences."""
    registry = dap.load_registry().with_file(scene.path.parent / "plugin.py")
    for kind, keyword in (("joint", "star"), ("force", "net")):
        report = check_type(registry.get(kind, keyword))
        assert report.ok, report


@pytest.mark.slow
def test_reactions_name_every_body(scene):
    """Internal forces: those on the five bodies cancel."""
    result = dap.simulate(scene, t_end=0.1, dt=0.1, allow_code=True)
    reaction = result.reaction("star")
    assert list(reaction) == list("ijklm")
    total = sum(reaction[s].force for s in "ijklm")
    np.testing.assert_allclose(total, 0.0, atol=1e-12)
    assert np.max(np.abs(result.quantity("star.m.force").values - reaction["m"].force)) == 0.0


def test_a_gap_between_the_bodies_is_refused():
    """A point on a body l, and none on a body k; a vector whose name ends in _n has no slot."""

    class Gap(Force):
        keyword = "gap"
        P_i: Point = point()
        P_l: Point = point()

        def wrench(r_P_i):
            return ((r_P_i, r_P_i),)

    with pytest.raises(PluginError, match=r"P_l is on a body l, but nothing is on a body k"):
        examine(Gap)

    class Axis(Force):
        keyword = "axis"
        P_i: Point = point()
        a_n: Vector = vector()

        def wrench(a_n):
            return ((a_n, a_n),)

    assert examine(Axis).layout.slots == ("i",)
