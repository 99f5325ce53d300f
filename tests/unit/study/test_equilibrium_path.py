"""Equilibria over a parameter, against closed forms: turning points, stability, other paths."""

import matplotlib
import numpy as np
import pytest
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.result import UnknownNameError

pytestmark = long_in_plain_python


#: Truss of von Mises: a node 0.5 m above the line between two supports, 2 m apart.
K, LENGTH = 1000.0, np.sqrt(1.25)


def truss(load=0.0):
    """Two springs as bars, unloaded at a height of 0.5 m; a load along z on their node."""
    scene = dap.Scene(name="truss")
    scene.add_body("node", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(0.0, 0.0, 0.5))
    scene.add_joint("tran", "rail", P_i="node.O", P_j="ground.O", a_j="ground.z")
    for name, x in (("left", -1.0), ("right", 1.0)):
        scene.add_point(name, body="ground", sPp=(x, 0.0, 0.0))
        scene.add_force("ptp", f"{name}_bar", P_i="node.O", P_j=name, k=K, l0=LENGTH)
    scene.add_force("f", "load", body_i="node", f=(0.0, 0.0, load))
    return scene


def truss_load(z):
    """The load along z that holds the node at a height z: 2 k (1 - L0 / L) z."""
    return 2.0 * K * (1.0 - LENGTH / np.hypot(1.0, z)) * z


def turning_height():
    """Where its derivative vanishes: L0 a^2 = L^3 with a = 1 m."""
    return np.sqrt(LENGTH ** (2.0 / 3.0) - 1.0)


def pendulum():
    """A pendulum of 2 kg, 0.5 m from its hinge, with a torque about it."""
    scene = dap.Scene(name="pendulum")
    scene.parameters["torque"] = 0.0
    scene.add_body("bob", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, -0.5))
    scene.add_point("top", body="bob", sPp=(0.0, 0.0, 0.5))
    scene.add_joint("rev", "hinge", P_i="top", P_j="ground.O", a_i="bob.y", a_j="ground.y")
    scene.add_force("weight", "gravity", gravity=9.81)
    scene.add_force("n", "drive", body_i="bob", n=(0.0, "= torque", 0.0))
    return scene


def column(push=0.0):
    """A rigid column of 2 m on a spring of 100 N m/rad, a load P and a push on its tip."""
    scene = dap.Scene(name="column")
    scene.parameters["P"] = 0.0
    scene.add_body("bar", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 1.0))
    scene.add_point("foot", body="bar", sPp=(0.0, 0.0, -1.0))
    scene.add_point("tip", body="bar", sPp=(0.0, 0.0, 1.0))
    scene.add_joint("rev", "hinge", P_i="foot", P_j="ground.O", a_i="bar.y", a_j="ground.y")
    scene.add_force("rot_sda", "spring", v_i="bar.x", v_j="ground.x", axis="bar.y", k=100.0)
    scene.add_force("f", "load", P_i="tip", f=(push, 0.0, "= -P"))
    return scene


@pytest.fixture(scope="module")
def snap():
    """The truss from a pull of 50 N through both turning points to a push of 50 N."""
    return dap.equilibrium_path(truss(), "forces.load.f.z", "50:-50:5")


@pytest.mark.slow
def test_truss_snaps_through(snap):
    """Loads and heights of both turning points are those of the closed form, to rounding."""
    z = turning_height()
    assert np.sum(snap.turning) == 2
    np.testing.assert_allclose(snap.values[snap.turning], truss_load(np.array([z, -z])), rtol=1e-12)
    np.testing.assert_allclose(snap.of("node.r.z")[snap.turning], [z, -z], atol=1e-10)
    assert snap.end == "reached"
    assert snap.unit == "N"


@pytest.mark.slow
def test_all_points_are_equilibria(snap):
    """The load of each point is that of its height; -50 to 50 N are met where they are given."""
    z = snap.of("node.r.z")
    np.testing.assert_allclose(truss_load(z), snap.values, atol=1e-11)
    assert snap.residual.max() < 1e-12
    assert set(snap.values[snap.given]) == set(np.linspace(50.0, -50.0, 5))
    assert snap.values[0] == 50.0
    assert snap.values[-1] == -50.0
    assert np.sum(snap.values == 0.0) == 3


@pytest.mark.slow
def test_stability_between_turning_points(snap):
    """Unstable from the first turning point to the second: the stiffness is dP/dz."""
    z, h = snap.of("node.r.z"), 1e-5
    slope = (truss_load(z + h) - truss_load(z - h)) / (2.0 * h)
    np.testing.assert_allclose(snap.stiffness, slope * snap_length() ** 2, atol=1e-5)
    first, second = np.flatnonzero(snap.turning)
    k = np.arange(len(z))
    assert snap.stable.tolist() == ((k < first) | (k > second)).tolist()
    assert not snap.branching.any()


def snap_length():
    """The length, m, that displacements of the truss are parts of."""
    return dap.compile(truss()).model.part_size


@pytest.mark.slow
def test_quantities_depend_on_the_parameter(snap):
    """Forces and reactions are those with the values of each point."""
    z = snap.of("node.r.z")
    np.testing.assert_allclose(snap.of("load.force.z"), snap.values, atol=1e-12)
    tension = K * (np.hypot(1.0, z) - LENGTH)
    np.testing.assert_allclose(snap.of("left_bar.tension"), tension, atol=1e-10)
    assert snap.of("node.r").shape == (len(z), 3)
    with pytest.raises(UnknownNameError, match=r"did you mean 'node\.r\.z'"):
        snap.of("nod.r.z")


@pytest.mark.slow
def test_point_as_equilibrium(snap):
    """A point is an equilibrium with a scene of its own."""
    k = int(np.flatnonzero(snap.given)[3])
    found = snap.equilibrium(k)
    assert found.stable
    np.testing.assert_allclose(found.u, snap.u[k], atol=1e-12)
    assert found.scene().forces["load"].fields["f"][2] == snap.values[k]


@pytest.mark.slow
def test_data_of_a_path(snap):
    """The same numbers as data of lists, and as a data set."""
    data = snap.to_dict("node.r.z")
    assert data["values"] == snap.values.tolist()
    assert data["quantities"]["node.r.z"] == snap.of("node.r.z").tolist()
    assert data["end"] == "reached"
    found = snap.to_xarray("node.r.z", "rail.force")
    assert found["node.r.z"].attrs["units"] == "m"
    assert found["rail.force"].shape == (len(snap.values), 3)
    np.testing.assert_array_equal(found.value[found.turning], snap.values[snap.turning])
    assert "2 turning points, reached" in repr(snap)


@pytest.mark.slow
def test_pendulum_turns_at_its_largest_torque():
    """m g l sin(theta) turns at m g l; the path comes back upside down, and ends there."""
    found = dap.equilibrium_path(pendulum(), "parameters.torque", "0:20:5")
    largest, theta = 9.81, found.of("hinge.angle")
    np.testing.assert_allclose(found.values[found.turning], [largest], rtol=1e-13)
    np.testing.assert_allclose(theta[found.turning], [np.pi / 2.0], atol=1e-10)
    np.testing.assert_allclose(found.values, largest * np.sin(theta), atol=1e-12)
    assert found.end == "returned"
    assert abs(theta[-1] - np.pi) < 1e-12
    assert found.stable.tolist() == (theta < np.pi / 2.0 - 1e-9).tolist()
    assert "turns before parameters.torque = 20" in found.notes[-1]


@pytest.mark.slow
def test_turns_are_counted():
    """A spring of 2 N m/rad winds up by more than a turn: angle = torque / 2."""
    scene = pendulum()
    del scene.forces["gravity"]
    scene.add_force("rot_sda", "spring", v_i="bob.x", v_j="ground.x", axis="bob.y", k=2.0)
    found = dap.equilibrium_path(scene, "parameters.torque", "0:30:4")
    np.testing.assert_allclose(found.of("hinge.angle"), found.values / 2.0, atol=1e-11)
    assert found.stable.all()


@pytest.mark.slow
def test_column_buckles():
    """P L = k, where another path crosses: the straight column goes on, without stability."""
    found = dap.equilibrium_path(column(), "parameters.P", "0:120:4")
    np.testing.assert_allclose(found.values[found.branching], [50.0], rtol=1e-12)
    np.testing.assert_allclose(found.of("hinge.angle"), 0.0, atol=1e-12)
    where = ~found.branching
    assert found.stable[where].tolist() == (found.values[where] < 50.0).tolist()
    assert "another path crosses at parameters.P = 50" in found.notes[-1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("push", "values"), [(0.5, "0:120:4"), (0.01, "0:120:3"), (1e-3, "0:60:2")]
)
def test_column_that_is_pushed_follows_one_path(push, values):
    """k theta = P L sin(theta) + F L cos(theta), without turning points and branches.

    By little it bends near P = k / L alone, past which long steps came to the straight path.
    """
    found = dap.equilibrium_path(column(push), "parameters.P", values)
    theta, P = found.of("hinge.angle"), found.values
    moment = 2.0 * P * np.sin(theta) + 2.0 * push * np.cos(theta)
    np.testing.assert_allclose(100.0 * theta, moment, atol=1e-10)
    assert found.stable.all()
    assert not (found.turning | found.branching).any()


@pytest.mark.slow
@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("parameter", "values"),
    [
        ("points.tip.sPp.z", "1:0.6:3"),
        ("forces.spring.k", "50:300:4"),
        ("bodies.bar.mass", "1:9:3"),
    ],
)
def test_path_without_turns_is_that_of_separate_searches(parameter, values):
    """Each given value has the equilibrium that a search of its own finds there."""
    scene = column(push=0.5)
    scene.parameters["P"] = 20.0
    scene.add_force("weight", "gravity")
    found = dap.equilibrium_path(scene, parameter, values)
    assert found.end == "reached"
    for k in np.flatnonzero(found.given):
        alone = dap.equilibrium(found.equilibrium(int(k)).compiled.scene)
        np.testing.assert_allclose(found.u[k], alone.u, atol=1e-9)
        np.testing.assert_allclose(found.Lam[k], alone.Lam, atol=1e-9 * 100.0)
        assert found.stable[k] == alone.stable


@pytest.mark.slow
def test_path_begins_where_a_start_leads():
    """The truss below its supports, from an equilibrium of another load."""
    below = truss(-50.0)
    start = dap.equilibrium(below)
    found = dap.equilibrium_path(truss(), "forces.load.f.z", [-20.0, 20.0], start=start)
    assert found.of("node.r.z")[0] < -0.4
    assert found.stable.all()


@pytest.mark.slow
def test_picture_of_a_path(snap):
    """Unstable parts are dashed, turning points marked."""
    matplotlib.use("Agg")
    ax = dap.plot(snap, "node.r.z")
    dashed = [line for line in ax.lines if line.get_linestyle() == "--" and len(line.get_xdata())]
    assert len(dashed) == 1
    assert ax.get_xlabel() == "forces.load.f.z [N]"
    marked = next(line for line in ax.lines if line.get_label() == "turning point")
    np.testing.assert_array_equal(marked.get_xdata(), snap.values[snap.turning])


@pytest.mark.parametrize(
    ("parameter", "values", "said"),
    [
        ("forces.load.f.q", "0:1:3", "did you mean 'forces.load.f"),
        ("forces.laod.f.z", "0:1:3", "did you mean 'forces.load.f.z'"),
        ("forces.load.f.z", "0:1:1", "one value does not reach"),
        ("forces.load.f.z", [1.0], "a path takes two values or more"),
        ("forces.load.f.z", "0,2,1", "rise or fall"),
        ("forces.load.f.z", "1~2", "values are 1:5:9"),
        ("bodies.node.mass", "1:-5:3", "should be greater than 0"),
        ("forces.left_bar.c", "0:1:3", "forces.left_bar.c does not matter"),
        ("simulation.t_end", "1:2:3", "simulation.t_end does not matter"),
    ],
)
def test_what_is_refused(parameter, values, said):
    """An unknown parameter with the nearest one; values that are none; one without effect."""
    with pytest.raises(dap.SceneError, match=said):
        dap.equilibrium_path(truss(), parameter, values)


def test_no_equilibrium_at_the_start():
    """The message names the value, and what gives way."""
    scene = truss()
    del scene.forces["left_bar"], scene.forces["right_bar"]
    with pytest.raises(dap.SimulationError, match=r"at forces\.load\.f\.z = 1: .*nothing stops"):
        dap.equilibrium_path(scene, "forces.load.f.z", "1:2:3")
