"""The joint formulation against method standard, which solves the saddle-point equations."""

import attrs
import numpy as np
import pytest
from support import trees
from support.internals import TOLERANCE_C, TOLERANCE_V, correct_initial, pose, u_from_y
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.formulations import PROJECT
from dap3d_core.simulation import CompiledModel

#: Accelerations and multipliers of two factorisations of equations with condition numbers up to
#: some 1e3 differ by rounding times that.
ACCELERATIONS, MULTIPLIERS = 1e-12, 1e-11


def closed(evaluator, u=None):
    """A state, by default the start, on its constraints to rounding: a correction leaves 1e-10."""
    u = evaluator.model.u0 if u is None else u
    y = evaluator.integrated(correct_initial(evaluator, u).u)
    evaluator.system.settings[[TOLERANCE_C, TOLERANCE_V]] = 0.0
    out = np.zeros(4 + evaluator.length_count)
    evaluator.functions[PROJECT](0.0, y, out, evaluator.system, evaluator.loops)
    return u_from_y(y)


def both_reports(scene):
    """What methods standard and joint report at the start of a scene, and its numbers of v_dot."""
    standard, joint = (CompiledModel(scene, method=m) for m in ("standard", "joint"))
    u = closed(standard.evaluator)
    split = 6 * standard.model.body_count
    return standard.evaluator.report(0.0, u), joint.evaluator.report(0.0, u), split


def differences(scene):
    """Relative differences of accelerations and of multipliers."""
    right, found, split = both_reports(scene)
    difference = np.abs(found - right)
    sizes = np.max(np.abs(right[:split])), np.max(np.abs(right[split:-4]), initial=1e-300)
    rest = np.max(difference[split:-4], initial=0.0)
    return np.max(difference[:split]) / sizes[0], rest / sizes[1]


@pytest.mark.parametrize("tree", [*range(6), "pen1", "pen2", "A05"])
def test_accelerations_and_multipliers_are_those_of_standard(tree):
    """Random trees of revolute, spherical, cylindrical, translational, universal joints, free; all
    shipped models without loops or rows of velocities; A05 has masses that differ by 1e3."""
    is_shipped = isinstance(tree, str)
    scene = dap.load(tree) if is_shipped else trees.random_tree(2 + tree, tree, free=0.1)
    a, multipliers = differences(scene)
    assert a < ACCELERATIONS
    assert multipliers < MULTIPLIERS


@pytest.mark.parametrize("joint", ["rev", "tran", "sph", "cyl", "free"])
@pytest.mark.parametrize("hangs", [False, True])
def test_a_body_alone_accelerates_as_by_standard(joint, hangs):
    """One body on ground, whose rates need no recursion; and with another one that hangs on it."""
    scene = trees.random_tree(1, 4, joints=(joint,), free=float(joint == "free"))
    body, arm = scene.bodies["b0"], np.array([0.3, -0.4, 0.5])
    scene.add_point("tip", "b0", arm)
    scene.add_force("ptp", "spring", P_i="tip", P_j="ground.O", k=20.0, c=0.5, l0=1.0)
    if hangs:
        tip = body.r + np.array(pose(body.r, body.p).A) @ arm
        scene.add_body("bob", mass=0.3, Jp=(0.01, 0.02, 0.03), r=tip, w=(1.0, 2.0, 3.0))
        scene.add_joint("sph", "ball", P_i="bob.O", P_j="tip")
    assert max(differences(scene)) < ACCELERATIONS


def test_friction_changes_the_multipliers_as_it_does_in_standard():
    """Cylindrical, revolute and translational joints rub; multipliers settle to 1e-10 of them."""
    scene = trees.random_tree(5, 3, joints=("rev", "cyl", "tran"))
    for name in scene.joints:
        scene.add_force("friction", joint=name, mu=0.1, radius=0.05, v_tol=0.1)
    right, found, split = both_reports(scene)
    assert np.max(np.abs(found - right)[:-4]) < 1e-8 * np.max(np.abs(right[:-4]))
    still = attrs.evolve(scene, forces={k: f for k, f in scene.forces.items() if k == "weight"})
    assert np.max(np.abs(both_reports(still)[0] - right)[:split]) > 1e-3  # it does something


def test_a_run_is_that_of_standard():
    """Motion, multipliers, energy and work of a tree with springs, to ten times the tolerance."""
    scene = trees.random_tree(4, 8)
    scene.add_force("ptp", "spring", P_i="b3.O", P_j="ground.O", k=20.0, c=0.5, l0=1.0)
    settings = {"t_end": 0.5, "dt": 0.125, "rtol": 1e-9, "atol": 1e-11}
    right = dap.simulate(scene, method="standard", **settings)
    found = dap.simulate(scene, method="joint", **settings)
    assert found.u == pytest.approx(right.u, abs=1e-8 * np.max(np.abs(right.u)))
    assert found.Lam == pytest.approx(right.Lam, abs=1e-7 * np.max(np.abs(right.Lam)))
    assert found.energy.total == pytest.approx(right.energy.total, rel=1e-7)
    assert all(entry.ok for entry in found.ledger.values())
    assert found.method == "joint"


def spinning_wheel(speed):
    scene = dap.Scene(name="wheel")
    scene.add_body("wheel", mass=1.0, Jp=(0.1, 0.2, 0.1), w=(0.0, speed, 0.0))
    scene.add_joint("rev", "pin", P_i="wheel.O", P_j="ground.O", a_i="wheel.y", a_j="ground.y")
    return scene


@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "adams"])
def test_an_angle_keeps_its_digits_over_many_turns(integrator):
    """After 300 turns Euler parameters are those of the closed form, with their sign."""
    speed, t = 20.0, 100.0
    found = dap.simulate(spinning_wheel(speed), t_end=t, dt=t / 8, method="joint", rtol=1e-10,
                         integrator=integrator)  # fmt: skip
    half = 0.5 * speed * found.t
    assert found.p[:, 0, 0] == pytest.approx(np.cos(half), abs=1e-9)
    assert found.p[:, 0, 2] == pytest.approx(np.sin(half), abs=1e-9)


def test_the_first_step_from_rest_is_no_shorter_than_that_of_standard():
    """Angles do not begin at zero, where they would have no size to choose a step by."""
    scene = trees.mixed_chain(1)
    settings = {"t_end": 10.0, "dt": 10.0, "rtol": 1e-3, "atol": 1e-3}
    steps = {
        method: dap.simulate(scene, method=method, **settings).stats
        for method in ("standard", "joint")
    }
    assert steps["joint"].rhs <= 1.05 * steps["standard"].rhs


def test_events_are_found_in_steps_that_bring_an_angle_back():
    """Ten turns: each step in which an angle is shifted by two turns is interpolated unshifted."""
    speed = 7.0
    event = dap.Event("wheel.p.e0", below=0.0)
    found = dap.simulate(spinning_wheel(speed), t_end=9.0, dt=9.0, method="joint", events=[event])
    expected = np.arange(np.pi, 9.0 * speed, 4.0 * np.pi) / speed
    assert [one.t for one in found.events] == pytest.approx(expected, abs=1e-8)


def test_what_hangs_on_a_fixed_body_moves_as_on_ground():
    """A joint that leaves nothing free is a node of the tree, with the multipliers of standard."""
    scene = trees.mixed_chain(2)
    scene.add_body("post", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(0.0, 0.0, -1.0))
    scene.add_joint("fix", "foot", body_i="post")
    scene.add_body("arm", mass=1.0, Jp=(0.1, 0.2, 0.2), r=(0.5, 0.0, -1.0), w=(0.0, 1.0, 0.0),
                   r_dot=(0.0, 0.0, -0.5))  # fmt: skip
    scene.add_point("end", "arm", (-0.5, 0.0, 0.0))
    scene.add_joint("rev", "hinge", P_i="end", P_j="post.O", a_i="arm.y", a_j="post.y")
    a, multipliers = differences(scene)
    assert a < ACCELERATIONS
    assert multipliers < MULTIPLIERS


@pytest.mark.parametrize("method", ["standard", "joint"])
def test_a_state_at_a_knot_is_refused_by_linearisation(method):
    """It looks at switches through the state of the formulation, also after a run."""
    compiled = dap.compile(hinged_spring(theta_0=-1.0), method=method)
    dap.simulate(compiled, t_end=0.1, dt=0.1)
    with pytest.raises(dap.SimulationError, match="at a switch of spring"):
        dap.linearize(compiled)


def test_the_explanation_has_the_tree():
    """Nodes and coordinates by their sort, in place of the matrix."""
    text = dap.compile("pen2", method="joint").explain()
    assert "tree       2 nodes: 1 angle, 1 ball" in text
    assert "matrix" not in text


def test_stepping_says_that_it_keeps_body_coordinates():
    """It is refused, with what fits."""
    words = 'use method auto, or integrator dop853 with contact = "events"'
    with pytest.raises(dap.SimulationError, match=words):
        dap.simulate("pen1", t_end=0.1, dt=0.1, step=1e-3, method="joint", integrator="moreau")


@pytest.mark.slow
@long_in_plain_python
def test_a_stiff_tree_is_handed_over_to_radau():
    """Integrator auto goes on in joint coordinates."""
    found = dap.simulate("A05", t_end=0.1, dt=0.05, rtol=1e-5, method="joint", integrator="auto")
    assert found.method == "joint"
    assert any("then radau" in note for note in found.notes)


def hinged_spring(theta_0=0.0):
    """A rod on a hinge; the moment of its torsion spring has a knot that it passes, with turns."""
    scene = dap.Scene(name="hinged spring")
    scene.add_body("rod", mass=1.0, Jp=(0.1, 0.1, 0.01), r=(0.5, 0.0, 0.0), w=(0.0, 0.0, 9.0),
                   r_dot=(0.0, 4.5, 0.0))  # fmt: skip
    scene.add_point("A", "rod", (-0.5, 0.0, 0.0))
    scene.add_joint("rev", "hinge", P_i="A", P_j="ground.O", a_i="rod.z", a_j="ground.z")
    scene.add_function("spline", "curve", x=(-9.0, 1.0, 9.0), y=(0.0, 1.0, 0.0))
    scene.add_force("rot_sda", "spring", v_i="rod.x", v_j="ground.x", axis="ground.z", k=1.0,
                    theta_0=theta_0, function="curve")  # fmt: skip
    return scene


@pytest.mark.slow
@long_in_plain_python
def test_turns_knots_and_events_are_those_of_standard():
    """A spring over more than a turn, a knot of its law, a quantity that passes a level."""
    settings = {"t_end": 2.0, "dt": 0.25, "rtol": 1e-10, "atol": 1e-12}
    results = [
        dap.simulate(hinged_spring(), method=method, events=[dap.Event("rod.r.x", below=-0.2)],
                     **settings)
        for method in ("standard", "joint")
    ]  # fmt: skip
    right, found = results
    assert found.u == pytest.approx(right.u, abs=1e-8)
    assert np.count_nonzero(np.diff(np.sign(found.p[:, 0, 0]))) > 1  # more than a turn and a half
    assert len(found.events) == len(right.events) > 1
    for one, other in zip(found.events, right.events, strict=True):
        assert one.t == pytest.approx(other.t, abs=1e-8)
        assert np.asarray(one.u) == pytest.approx(np.asarray(other.u), abs=1e-7)


@pytest.mark.parametrize("thin", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("holder", ["ground", "post"])
def test_a_thin_rod_on_a_ball_turns_as_euler_says(thin, holder):
    """Euler's equations about the ball, in its axes; the spin about itself alone loses digits.
    That of a moment is lost to rounding of the moments across, 5e-15 N m here, over its inertia."""
    e, length, mass = np.array([0.8, 0.3, -0.4, 0.33]), 0.7, 2.0
    e /= np.linalg.norm(e)
    A, w = pose((0.0, 0.0, 0.0), e).A, np.array([0.3, -0.5, 0.7])
    A, arm = np.array(A), np.array([0.0, 0.0, length])
    scene = dap.Scene(name="thin")
    scene.add_body("rod", mass=mass, Jp=(1.0, 1.0, thin), r=A @ arm, p=e, w=A @ w,
                   r_dot=np.cross(A @ w, A @ arm))  # fmt: skip
    scene.add_point("end", body="rod", sPp=-arm)
    if holder == "post":
        scene.add_body("post", mass=1.0, Jp=(1.0, 1.0, 1.0))
        scene.add_joint("fix", "foot", body_i="post")
    scene.add_joint("sph", "ball", P_i="end", P_j=f"{holder}.O")
    scene.add_force("weight", "gravity")
    compiled = CompiledModel(scene, method="joint")
    found = A.T @ compiled.evaluator.report(0.0, compiled.model.u0)[3:6]
    J = np.array([1.0, 1.0, thin]) + mass * length**2 * np.array([1.0, 1.0, 0.0])
    weight = A.T @ np.array([0.0, 0.0, -9.81 * mass])
    right = (np.cross(arm, weight) - np.cross(w, J * w)) / J
    assert np.abs(found - right)[:2].max() < 1e-14
    assert abs(found[2]) < 5e-15 / thin


@pytest.mark.parametrize("on_ground", [False, True])
def test_a_thin_rotor_alone_keeps_its_spin(on_ground):
    """Euler's equations of a symmetric body: nothing turns about its axis, at 1000 rad/s.
    A C of 1e-9 of the other moments would divide the rounding of moments summed in global axes:
    1e-4 rad/s^2. In the rotor's axes that of w is left, 1e-13 rad/s times w across."""
    e, w, J = (
        np.array([0.8, 0.3, -0.4, 0.33]),
        np.array([0.3, -0.5, 1e3]),
        np.array([1.0, 1.0, 1e-9]),
    )
    e /= np.linalg.norm(e)
    A = np.array(pose((0.0, 0.0, 0.0), e).A)
    scene = dap.Scene(name="rotor")
    scene.add_body("rotor", mass=1.0, Jp=J, p=e, w=A @ w)
    scene.add_body("other", mass=1.0, Jp=(1.0, 1.0, 1.0))
    hung = "rotor" if on_ground else "other"
    scene.add_joint("sph", "ball", P_i=f"{hung}.O", P_j="ground.O")
    compiled = CompiledModel(scene, method="joint")
    found = A.T @ compiled.evaluator.report(0.0, compiled.model.u0)[3:6]
    error = np.abs(found + np.cross(w, J * w) / J)
    assert error[2] < 1e-12
    assert error[:2].max() < 1e-9
