"""Linearisation: state space, inputs, outputs, operating points, and what it refuses."""

from types import SimpleNamespace

import attrs
import numpy as np
import pytest
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.result import UnknownNameError


def cart(**start):
    """A cart of 2 kg on a rail with spring and damper, a pendulum of 1 kg below, three inputs."""
    scene = dap.Scene(name="cart")
    scene.add_body("cart", mass=2.0, Jp=np.diag([0.1, 0.1, 0.1]), r=[0, 0, 0], **start)
    scene.add_body("bob", mass=1.0, Jp=np.diag([0.02, 0.02, 0.01]), r=[0, 0, -0.5])
    scene.add_point("pin", "bob", [0, 0, 0.5])
    scene.add_point("wall", "ground", [-1.0, 0, 0])
    scene.add_joint("tran", "rail", P_i="cart.O", P_j="ground.O", a_j="ground.x")
    scene.add_joint("rev", "hinge", P_i="pin", P_j="cart.O", a_i="bob.y", a_j="cart.y")
    scene.add_force("weight", "gravity")
    scene.add_force("ptp", "spring", P_i="cart.O", P_j="wall", k=40.0, c=3.0, l0=1.0)
    scene.add_force("f", "push", body_i="cart", f=[0, 0, 0])
    scene.add_force("n", "motor", body_i="bob", n=[0, 0, 0])
    return scene


#: Of the cart: mass matrix, stiffness, damping of (x, angle about y); m l sits between them.
MASS = np.array([[3.0, -0.5], [-0.5, 0.02 + 0.25]])
STIFFNESS = np.diag([40.0, 1.0 * 9.81 * 0.5])
DAMPING = np.diag([3.0, 0.0])


def transfer(lin, s):
    """C (s - A)^-1 B + D."""
    return lin.C @ np.linalg.solve(s * np.eye(len(lin.A)) - lin.A, lin.B) + lin.D


def test_transfer_functions():
    """From force and moment to positions, velocities, accelerations, reactions.
    By minimal coordinates: q = (M s^2 + C s + K)^-1 Q, and the force of the hinge on the bob along
    x is its mass times its acceleration, x_ddot - l phi_ddot."""
    outputs = ("cart.r.x", "bob.w.y", "pin.v.x", "bob.rdd.x", "hinge.force.x", "cart.p.e0")
    lin = dap.linearize(cart(), inputs=("push.f.x", "motor.n.y"), outputs=outputs)
    for s in (0.3 + 1.1j, 2.0j):
        q = np.linalg.inv(MASS * s**2 + DAMPING * s + STIFFNESS)
        bob = (q[0] - 0.5 * q[1]) * s**2
        expected = np.array([q[0], s * q[1], s * q[0], bob, bob, 0.0 * bob])
        np.testing.assert_allclose(transfer(lin, s), expected, rtol=1e-11, atol=1e-12)


def test_parameters_as_inputs():
    """Any number of a force is an input: a stiffness, a component, all of a force.
    With the spring stretched by 0.1 m, F = k (l - l0): dF/dk = 0.1, dF/dl0 = -k; a factor on the
    spring is F itself."""
    scene = cart()
    scene.forces["spring"].fields["l0"] = 0.9
    names = ("spring.k", "spring.l0", "spring", "push.f.x")
    lin = dap.linearize(scene, inputs=names)
    push = lin.B[:, 3]
    for column, force in enumerate((0.1, -40.0, 4.0)):
        np.testing.assert_allclose(lin.B[:, column], -force * push, rtol=1e-12, atol=1e-14)
    assert lin.input_units == ("N/m", "m", "1", "N")


@long_in_plain_python
def test_outputs_that_read_inputs():
    """What an input does to an output by itself: as the force that it sets, by a state that lags,
    in an expression and in an energy. By hand: a mass on a spring has x / F =
    1 / (2 s^2 + 3 s + 40), the lag 1 / (1 + 0.1 s); of the spring, 0.1 m longer, V = k d^2 / 2."""
    scene = dap.Scene(name="slider")
    for name in ("u", "w"):
        scene.add_input(name, 0.0)
    scene.add_body("cart", mass=2.0, Jp=np.diag([0.1, 0.1, 0.1]), r=[0, 0, 0])
    scene.add_point("wall", "ground", [-1.0, 0, 0])
    scene.add_joint("tran", "rail", P_i="cart.O", P_j="ground.O", a_j="ground.x")
    scene.add_force("ptp", "spring", P_i="cart.O", P_j="wall", k=40.0, c=3.0, l0=0.9)
    scene.add_force(
        "actuator", "lags", joint="rail", control="u", gain=2.0, activation="lag", time=0.1
    )
    scene.add_force("f", "push", body_i="cart", f=[3.0, 0, 0], input="w")
    scene.add_output("sum_of_it", "2 * push.force.x + w")
    outputs = ("cart.r.x", "lags.force.x", "push.force.x", "sum_of_it", "w")
    lin = dap.linearize(scene, inputs=("u", "w"), outputs=outputs)
    assert not any("no effect" in note for note in lin.notes)
    s = 0.3 + 1.1j
    x, lag = 1.0 / (2.0 * s**2 + 3.0 * s + 40.0), 2.0 / (1.0 + 0.1 * s)
    expected = np.array([[lag * x, lag, 0.0, 0.0, 0.0], [3.0 * x, 0.0, 3.0, 7.0, 1.0]]).T
    np.testing.assert_allclose(transfer(lin, s), expected, rtol=1e-10, atol=1e-11)

    inputs = ("spring.k", "spring.l0")
    lin = dap.linearize(scene, inputs=inputs, outputs=("energy.potential", "spring.tension"))
    by_motion = np.outer([4.0, 40.0 + 3.0 * s], [-0.1 * x, 40.0 * x])
    expected = by_motion + np.array([[0.5 * 0.01, -40.0 * 0.1], [0.1, -40.0]])
    np.testing.assert_allclose(transfer(lin, s), expected, rtol=1e-10)
    with pytest.raises(UnknownNameError, match="a factor of which is an input"):
        dap.linearize(scene, inputs=("spring",), outputs=("energy.total",))


@long_in_plain_python
def test_norms_of_forces_that_a_step_would_turn_around():
    """A stiff spring holds 9.81 N: a newton less for a newton of lift, at any stiffness."""
    scene = dap.Scene(name="hung")
    scene.add_body("mass", mass=1.0, Jp=(0.1, 0.1, 0.1))
    scene.add_point("hook", "ground", (0.0, 0.0, 0.5))
    scene.add_joint("tran", "guide", P_i="mass.O", P_j="ground.O", a_j="ground.z")
    scene.add_force("ptp", "wire", P_i="mass.O", P_j="hook", k=1e8, l0=0.5)
    scene.add_force("f", "lift", body_i="mass", f=(0.3, 0.0, 0.0))
    scene.add_force("weight", "gravity", gravity=9.81)
    scene.add_output("load", "norm(wire.force)")
    scene.add_output("side", "norm(guide.force)")
    at = dap.equilibrium(scene)
    lin = dap.linearize(scene, at=at, inputs=("lift.f.x", "lift.f.z"),
                        outputs=("load", "side", "wire.tension", "mass.r.z"))  # fmt: skip
    load, side, tension, height = lin.C
    # differences of a force of 9.81 N that 1e8 N/m holds: rounding of 1e-16 m over 1e-7 m
    np.testing.assert_allclose(load, tension, rtol=1e-6)
    np.testing.assert_allclose(tension[0], -1e8 * height[0], rtol=1e-9)
    np.testing.assert_allclose(side, 0.0, atol=1e-3)
    # the guide holds what is across it: 0.3 N
    np.testing.assert_allclose(lin.D[1], [1.0, 0.0], atol=1e-9)


def test_state_space_follows_the_motion():
    """After a small kick the simulated motion is that of z_dot = A z."""
    kick = 1e-5
    lin = dap.linearize(cart(), outputs=("cart.r.x",))
    run = dap.simulate(cart(r_dot=[kick, 0, 0]), t_end=1.0, dt=1.0, rtol=1e-12, atol=1e-16)
    start = np.linalg.lstsq(lin.basis, np.concatenate([np.zeros(12), run.u[0, -12:]]), rcond=None)
    values, vectors = np.linalg.eig(lin.A)
    z = vectors @ (np.exp(values) * np.linalg.solve(vectors, start[0]))
    np.testing.assert_allclose(float(np.real(lin.C @ z)[0]), run.r[-1, 0, 0], atol=1e-3 * kick)


def test_state_of_a_result():
    """About an instant of a run the state is that of the run, and a state in motion gets a note."""
    run = dap.simulate(cart(r_dot=[0.5, 0, 0]), t_end=1.0, dt=0.25)
    lin = dap.linearize(cart(), at=run, t=0.5)
    np.testing.assert_array_equal(lin.u, run.u[2])
    assert not lin.is_steady
    assert any("neither at rest nor in steady motion" in note for note in lin.notes)
    with pytest.raises(
        dap.SimulationError, match=r"no instant at t = 0\.6 s; the nearest is t = 0\.5"
    ):
        dap.linearize(cart(), at=run, t=0.6)
    with pytest.raises(dap.SimulationError, match="of another scene"):
        dap.linearize("pen1", at=run)


def test_numbers_that_an_event_has_changed():
    """A run whose event made the spring stiffer is linearised with that stiffness or not at all."""
    event = dap.Event(lambda t, _: t - 0.3, action=lambda state: state.set("spring", k=160.0))
    run = dap.simulate(cart(), t_end=0.5, dt=0.25, events=[event])
    scene = cart()
    soft = dap.linearize(scene, at=run, t=0.25)
    with pytest.raises(dap.SimulationError, match=r"has set k = 160\.0 of force spring"):
        dap.linearize(scene, at=run, t=0.5)
    scene.forces["spring"].fields["k"] = 160.0
    stiff = dap.linearize(scene, at=run, t=0.5)
    # det M^-1 K, in any basis: that of two freedoms is chosen by rounding
    assert np.linalg.det(stiff.A) / np.linalg.det(soft.A) == pytest.approx(4.0, rel=1e-9)


def pushed():
    """A carriage on a spring, with a force whose factor is an input, and a run that sets it."""
    scene = dap.Scene(name="pushed")
    scene.add_input("push", 0.5)
    scene.add_body("mass", mass=2.0, Jp=(1.0, 1.0, 1.0), r=(1.0, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="mass.O", P_j="ground.O", k=8.0, l0=1.0)
    scene.add_force("f", "pull", body_i="mass", f=(1.0, 0.0, 0.0), input="push")
    to_three = dap.Controller(every=0.1, update=lambda t, state: {"push": 3.0})
    return scene, dap.simulate(scene, t_end=0.4, dt=0.2, controllers=[to_three])


def test_inputs_of_a_result_are_those_of_its_equations_alone():
    """B of the field f is push / m; the model has its own inputs before and afterwards."""
    scene, result = pushed()
    model = dap.compile(scene)
    before = model.rhs(0.0, result.u[1])
    then = dap.linearize(model, at=result, t=0.2)
    assert (model.rhs(0.0, result.u[1]) == before).all()
    own = dap.linearize(model, at=result.u[1])
    for lin, push in ((then, 3.0), (own, 0.5)):  # in which order is all the same
        response = lin.frequency_response(1.0, inputs="pull.f.x", outputs="mass.rdd.x")[0, 0, 0]
        free = dap.linearize(scene, at=result.u[1]).frequency_response(1.0, "push", "mass.rdd.x")
        assert response == pytest.approx(push * free[0, 0, 0], rel=1e-9)


def test_counted_turns_of_a_result():
    """A spring that counts whole turns has the moment there that the run has there."""

    def wound():
        scene = dap.Scene(name="wound")
        scene.add_body("b", mass=1.0, Jp=np.eye(3), w=[0, 0, 10.0])
        scene.add_joint("rev", "J", P_i="b.O", P_j="ground.O", a_i="b.z", a_j="ground.z")
        scene.add_force("rot_sda", "S", v_i="b.x", v_j="ground.x", axis="b.z", k=0.1, turns=True)
        return scene

    run = dap.simulate(wound(), t_end=2.0, dt=0.5, rtol=1e-10)
    lin = dap.linearize(wound(), at=run, t=2.0, inputs=("S",))
    moment = np.abs(lin.B).max()  # on the only freedom, of inertia 1
    np.testing.assert_allclose(moment, 0.1 * 100.0**0.5 / 0.1**0.5 * np.sin(2.0 * 0.1**0.5),
                               rtol=1e-7)  # fmt: skip


def test_equilibrium_is_at_rest():
    """Of an equilibrium r and p are taken, the velocities are zero."""
    model = dap.compile(cart(r_dot=[0.5, 0, 0])).model
    lin = dap.linearize(cart(r_dot=[0.5, 0, 0]), at=SimpleNamespace(r=model.r, p=model.p))
    assert not np.any(lin.u[-12:])
    assert lin.is_steady


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"inputs": ("pusch.f.x",)}, r"no input, force or driver 'pusch'.*did you mean 'push'"),
        ({"inputs": ("push.g.x",)}, r"no number 'g'"),
        ({"inputs": ("push.f",)}, r"name a component of f \(x, y or z\)"),
        ({"inputs": ("spring.k.x",)}, r"name k alone"),
        ({"inputs": ("spring.function",)}, r"is no number that its force depends on directly"),
        (
            {"inputs": ("twist.theta_0",)},
            r"theta_0 of force twist is no number.*numbers: k, c, n_a",
        ),
        ({"inputs": ("rub",)}, r"rub acts by reactions of joints alone"),
        ({"inputs": ("rail.k",)}, r"no input, force or driver 'rail'"),
        ({"inputs": ("inputs.pull.value",)}, r"an input as a whole; name pull$"),
        ({"outputs": ("cart.r.y_",)}, r"did you mean 'cart\.r\.[xyz]'"),
        ({"outputs": ("cart.r",)}, r"has components: name one, as cart\.r\.x"),
        ({"inputs": ("spring",), "outputs": ("spring.tension",)}, "a factor of which is an input"),
        ({"outputs": ("work",)}, "work depends on the way"),
    ],
)
def test_unknown_names(settings, words):
    """Unknown inputs and outputs are refused with what there is, or the nearest name."""
    scene = cart()
    scene.add_force("rot_sda", "twist", v_i="bob.x", v_j="cart.x", axis="bob.y", k=1.0)
    scene.add_force("friction", "rub", joint="rail", mu=0.1, v_tol=1.0)
    scene.add_input("pull", 0.0)
    with pytest.raises(UnknownNameError, match=words):
        dap.linearize(scene, **settings)


def test_state_off_the_constraints():
    """A state that breaks the constraints is refused, with how far off it is."""
    scene = cart()
    u = dap.compile(scene).model.u0.copy()
    u[7] += 0.01
    with pytest.raises(dap.SimulationError, match=r"off the constraints \(position 0\.01"):
        dap.linearize(scene, at=u)


def test_state_at_a_switch():
    """Where a spring's table has a kink there is no derivative; beside it there is."""
    scene = dap.Scene(name="kink")
    scene.add_body("b", mass=1.0, Jp=np.eye(3), r=[1.0, 0, 0])
    scene.add_function("b", "curve", x_start=0.0, x_end=1.0, f_start=0.0, f_end=5.0)
    scene.add_force("ptp", "S", P_i="b.O", P_j="ground.O", l0=1.0, function="curve")
    with pytest.raises(dap.SimulationError, match=r"at a switch of S.*move the state"):
        dap.linearize(scene)
    scene.bodies["b"] = attrs.evolve(scene.bodies["b"], r=[1.25, 0, 0])
    assert dap.linearize(scene).dof == 6


@long_in_plain_python
def test_control():
    """python-control gets the same matrices and names."""
    lin = dap.linearize(cart(), inputs=("push.f.x",), outputs=("cart.r.x", "bob.r.x"))
    system = lin.to_control()
    assert (system.input_labels, system.output_labels) == (["push_f_x"], ["cart_r_x", "bob_r_x"])
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(system, name), getattr(lin, name))
    np.testing.assert_allclose(system(1j), transfer(lin, 1j), rtol=1e-12)


def test_motion_of_a_mode():
    """The motion of a mode is a result over one period, along the mode, its joints closed."""
    lin = dap.linearize(cart())
    run = lin.motion(0, size=0.1, instants=9)
    np.testing.assert_allclose(run.t[-1], 2 * np.pi / abs(lin.mode_eigenvalues[0].imag))
    np.testing.assert_allclose(run.u[-1], run.u[0], atol=1e-12)
    assert np.ptp(run.r[:, 0, 0]) > 0.01
    assert run.ledger["position"].value < 1e-9
    with pytest.raises(IndexError, match="no mode 3: the modes are 1 to 2"):
        lin.motion(2)


def test_friction_is_a_damper_at_rest():
    """Smooth friction at rest damps with mu N / v_tol, and a note says what that means."""
    scene = dap.Scene(name="sledge")
    scene.add_body("b", mass=2.0, Jp=np.eye(3))
    scene.add_joint("tran", "rail", P_i="b.O", P_j="ground.O", a_j="ground.x")
    scene.add_force("weight", "gravity")
    scene.add_force("friction", "rub", joint="rail", mu=0.1, v_tol=0.01)
    lin = dap.linearize(scene)
    np.testing.assert_allclose(lin.eigenvalues, [0.0, -0.1 * 9.81 / 0.01], rtol=1e-9, atol=1e-12)
    assert any("no stiction" in note for note in lin.notes)


def test_friction_follows_the_load():
    """Where the load changes with the motion, friction's derivative by the multipliers counts.
    A mass on a rail is pressed by a spring across it, hung ahead of the mass by d: the load is
    N = k (l - l0) h / l, its slope by x is exact by hand. With speed v far above v_tol friction is
    -mu N: the linear equation is m x'' = Fx' x - mu N' x."""
    m, k, l0, mu, d, h, speed = 1.0, 50.0, 0.5, 0.2, 0.6, 0.8, 1.0
    scene = dap.Scene(name="pressed")
    scene.add_body("b", mass=m, Jp=np.eye(3), r_dot=[speed, 0, 0])
    scene.add_point("hook", "ground", [d, 0, h])
    scene.add_joint("tran", "rail", P_i="b.O", P_j="ground.O", a_j="ground.x")
    scene.add_force("ptp", "S", P_i="b.O", P_j="hook", k=k, l0=l0)
    scene.add_force("friction", "rub", joint="rail", mu=mu, v_tol=1e-3)
    lin = dap.linearize(scene)
    length = np.hypot(d, h)
    dl = -d / length
    pull, slope = k * (length - l0), k * dl
    along = slope * d / length - pull / length - pull * d * dl / length**2
    load = slope * h / length - pull * h * dl / length**2
    square = (along - mu * load) / m
    np.testing.assert_allclose(np.sort(lin.eigenvalues**2), [square, square], rtol=1e-9)


def test_picture_of_the_eigenvalues():
    """``dap.plot`` draws the eigenvalues of a linearisation, and nothing else of it."""
    from matplotlib.figure import Figure

    lin = dap.linearize(cart())
    ax = dap.plot(lin, ax=Figure().add_subplot())
    x, y = np.concatenate([line.get_xydata() for line in ax.lines[1:]]).T
    np.testing.assert_allclose(np.sort_complex(x + 1j * y), np.sort_complex(lin.eigenvalues))
    assert [text.get_text() for text in ax.texts] == ["1", "2"]
    with pytest.raises(ValueError, match="leave names out"):
        dap.plot(lin, "cart.r.x", ax=ax)


@pytest.mark.parametrize(("level", "sense"), [("drive-tran", 1.0), ("rel-tran", -1.0)])
def test_driver_as_input(level, sense):
    """A cart that a driver moves: its acceleration swings the pendulum, and the driver's force.
    (J + m l^2) phi'' + m g l phi = m l x'' about y. The driver moves the cart, x'' = a, and pushes
    it with (M + m) x'' - m l phi''; rel-tran has the sign of the manual, x'' = -a."""
    scene = cart()
    for name in ("spring", "push"):
        del scene.forces[name]
    fields = {"function": scene.add_function("a", "rest", coeff=[0.0, 0.0, 0.0])}
    scene.add_joint(level, "drive", body_i="cart", a_j="ground.x", **fields)
    lin = dap.linearize(scene, inputs=("drive",), outputs=("bob.w.y", "cart.r.x", "drive.force.x"))
    assert any("input drive is the acceleration" in note for note in lin.notes)
    s = 0.4 + 1.7j
    phi = sense * 0.5 / (0.27 * s**2 + 0.5 * 9.81)
    expected = [s * phi, sense / s**2, sense * 3.0 - 0.5 * phi * s**2]
    np.testing.assert_allclose(transfer(lin, s)[:, 0], expected, rtol=1e-11)
    # at the velocity level alone the place of the cart is free: an eigenvalue of zero besides
    np.testing.assert_allclose(np.abs(lin.eigenvalues[-2:]), np.sqrt(0.5 * 9.81 / 0.27))


def test_driver_at_a_later_time():
    """Without a state the start is brought onto the constraints of the time: drivers have moved."""
    scene = dap.Scene(name="crank")
    scene.add_body("crank", mass=1.0, Jp=np.eye(3), r=[1.0, 0, 0], w=[0, 0, 2.0],
                   r_dot=[0, 2.0, 0])  # fmt: skip
    scene.add_point("pin", "crank", [-1.0, 0, 0])
    scene.add_joint("rev", "J", P_i="pin", P_j="ground.O", a_i="crank.z", a_j="ground.z")
    scene.add_function("a", "turn", coeff=[0.0, 2.0, 0.0])
    scene.add_joint("drive-rot", "motor", body_i="crank", a_j="ground.z", function="turn")
    lin = dap.linearize(scene, t=0.4)
    np.testing.assert_allclose(lin.u[:3], [np.cos(0.8), np.sin(0.8), 0.0], atol=1e-9)
    assert lin.dof == 0
    assert lin.stable
