"""Forces of kinematics and inverse dynamics against Newton-Euler equations written in numpy."""

import numpy as np
import pytest
from support.rotations import rotation
from support.stewart import stewart

import dap3d_core as dap

GRAVITY = np.array([0.0, 0.0, -9.81])


class Body:
    """Motion, and inertial force and moment, of a body of a result at an instant."""

    def __init__(self, result, name, k, mass, J):
        b = result.summary.body_index[name]
        self.A = rotation(result.p[k, b])
        self.r, w = result.r[k, b], result.w[k, b]
        inertia = self.A @ np.diag(J) @ self.A.T
        self.force = mass * (result.rdd[k, b] - GRAVITY)  # what all but the weight gives
        self.moment = inertia @ result.wd[k, b] + np.cross(w, inertia @ w)


def test_driven_legs_of_a_stewart_platform_bear_what_newton_and_euler_say():
    """Thirteen bodies: each leg as a beam about its foot, then six equations of the platform.
    1e-10 of the largest force: rounding times the condition of the equations, some hundred."""
    scene = stewart(50.0, 2.0, 100.0, spins=False)
    result = dap.kinematics(scene, t_end=0.5, dt=0.1)
    heads = {k: np.array(scene.points[f"head{k}"].sPp) for k in range(6)}
    feet = {k: np.array(scene.points[f"foot{k}"].sPp) for k in range(6)}
    top_mass, top_J = scene.bodies["top"].mass, scene.bodies["top"].Jp
    push = np.array(scene.forces["push"].fields["f"])
    found = np.zeros((len(result.t), 6))
    expected = np.zeros_like(found)
    for instant in range(len(result.t)):
        top = Body(result, "top", instant, top_mass, top_J)
        sides, lines = [top.force - push, top.moment], []
        axial, shears = [], []
        for k in range(6):
            low, up = (Body(result, f"{part}{k}", instant, 2.0, scene.bodies[f"{part}{k}"].Jp)
                       for part in ("low", "up"))  # fmt: skip
            arm = top.A @ heads[k]
            leg = top.r + arm - feet[k]
            length = np.linalg.norm(leg)
            s = leg / length
            M = sum(np.cross(b.r - feet[k], b.force) + b.moment for b in (low, up))
            cross = np.cross(low.A[:, 1], scene.vectors[f"cross{k}"].sp)
            M = M - cross * (M @ s) / (cross @ s)  # the moment that keeps the leg from spinning
            shear = np.cross(M, s) / length  # of the force of the platform on the leg
            sides[0] = sides[0] + shear
            sides[1] = sides[1] + np.cross(arm, shear)
            lines.append(-np.concatenate([s, np.cross(arm, s)]))
            axial.append((up.force @ s, s))
            shears.append(shear)
        x = np.linalg.solve(np.array(lines).T, np.concatenate(sides))
        for k in range(6):
            need, s = axial[k]
            expected[instant, k] = need - x[k]
            found[instant, k] = result.reaction(f"D{k}")["i"].force[instant] @ s
    assert np.max(np.abs(expected)) > 100.0
    assert np.max(np.abs(found - expected)) < 1e-10 * np.max(np.abs(expected))


def platform_on_lines(number, *, spring):
    """A rigid platform held by ``number`` point-to-point elements, springs or actuators."""
    scene = dap.Scene(name="platform")
    scene.add_body("top", mass=12.0, Jp=[0.5, 0.7, 1.1], r=[0.0, 0.0, 1.0])
    rng = np.random.default_rng(4)
    for k in range(number):
        a = 2.0 * np.pi * k / number
        b = a + (0.5 if k % 2 else -0.5)
        foot = [np.cos(a), np.sin(a), 0.1 * rng.standard_normal()]
        head = [0.5 * np.cos(b), 0.5 * np.sin(b), 0.1 * rng.standard_normal()]
        scene.add_point(f"foot{k}", body="ground", sPp=foot)
        scene.add_point(f"head{k}", body="top", sPp=head)
        law = {"k": 3000.0, "c": 20.0, "l0": 1.1} if spring else {"f_a": 5.0 * k}
        scene.add_force("ptp", f"leg{k}", P_i=f"head{k}", P_j=f"foot{k}", **law)
    scene.add_force("weight", "weight")
    return scene


def lines_of(scene, body):
    """(6, n) force and moment on the platform of a unit tension in each leg."""
    columns = []
    for force in scene.forces.values():
        if force.type == "ptp":
            foot, head = (scene.points[force.fields[end]].sPp for end in ("P_j", "P_i"))
            arm = body.A @ np.array(head)
            d = np.array(foot) - body.r - arm
            u = d / np.linalg.norm(d)
            columns.append(np.concatenate([u, np.cross(arm, u)]))
    return np.array(columns).T


@pytest.mark.parametrize("number", [6, 8])
def test_tensions_of_a_platform_are_those_of_newton_and_euler(number):
    """As many legs as freedoms: their one solution; more: the least of all, and a note.
    The motion is that of a run of the platform on springs: its accelerations are exact."""
    motion = dap.simulate(platform_on_lines(number, spring=True), t_end=0.3, dt=0.1)
    scene = platform_on_lines(number, spring=False)
    result = dap.inverse(scene, motion, [f"leg{k}" for k in range(number)])
    for k in range(len(result.t)):
        top = Body(result, "top", k, 12.0, [0.5, 0.7, 1.1])
        needed = np.concatenate([top.force, top.moment])
        tension = np.linalg.pinv(lines_of(scene, top)) @ needed
        for leg in range(number):
            force = result.force(f"leg{leg}")
            assert abs(force.tension[k] - tension[leg]) < 1e-10 * np.max(np.abs(tension))
            assert abs(result.record.actuation[f"leg{leg}"][k] - force.tension[k]) < 1e-10
    assert any("redundant" in note for note in result.notes) == (number > 6)
    if number == 6:  # the springs were the one solution
        for leg in range(number):
            spring = motion.force(f"leg{leg}").tension
            assert np.max(np.abs(result.force(f"leg{leg}").tension - spring)) < 1e-9


def test_the_motion_of_a_run_has_its_states_and_inputs():
    """A driven body that a spring and damper in series and a sampled input pull: D = m x'' - F - u,
    with the damper's z' = a (e - z) in closed form. Limit: errors of the run's states, 1e-10."""
    k, c, X, w = 100.0, 20.0, 0.2, 5.0
    scene = dap.Scene()
    scene.add_body("b", mass=2.0, Jp=(1.0, 1.0, 1.0))
    scene.add_point("wall", "ground", (1.5, 0.0, 0.0))
    scene.add_joint("tran", "guide", P_i="b.O", P_j="ground.O", a_j="ground.x")
    scene.add_force("maxwell", "leg", P_i="b.O", P_j="wall", k=k, c=c, l0=1.5)
    scene.add_function("harmonic", "swing", amplitude=X, frequency=w)
    scene.add_joint("drive-tran", "driver", joint="guide", function="swing")
    scene.add_input("u")
    scene.add_force("f", "pull", body_i="b", f=(1.0, 0.0, 0.0), input="u")
    controller = dap.Controller(every=0.1, update=lambda t, state: {"u": 3.0 * t})
    run = dap.simulate(scene, t_end=2.0, dt=0.1, rtol=1e-11, controllers=[controller])
    result = dap.inverse(scene, run, "driver")
    t, e = run.t, -X * np.sin(w * run.t)
    size = -X * (k / c) / (k / c + 1j * w)
    z = (size * np.exp(1j * w * t)).imag - size.imag * np.exp(-k / c * t)
    u = 3.0 * np.minimum(np.round(t, 1), 1.9)  # a run takes no sample at its end
    expected = -2.0 * X * w**2 * np.sin(w * t) - k * (e - z) - u
    np.testing.assert_allclose(result.record.actuation["driver"], expected, rtol=0, atol=1e-8)
    assert not any("initial values" in note for note in result.notes)
    scene.add_force("maxwell", "other", P_i="b.O", P_j="wall", k=0.1, c=c, l0=1.5)
    assert any("other.z" in note and "leg.z" not in note
               for note in dap.inverse(scene, run, "driver").notes)  # fmt: skip
