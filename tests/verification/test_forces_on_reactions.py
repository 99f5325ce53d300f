"""Forces that depend on the reactions of joints: closed forms, other formulations, and jamming."""

import numpy as np
import pytest
from support.on_reactions import ON_REACTIONS, SeizingServo, WornBrake
from support.own_types import registry_of
from support.unknown_types import OnCurve

import dap3d_core as dap
from dap3d_core.simulation import CompiledModel

G = 9.81
REGISTRY = registry_of(*ON_REACTIONS, SeizingServo, WornBrake, OnCurve)
SETTINGS = {"t_end": 0.4, "dt": 0.1, "rtol": 1e-10, "atol": 1e-12}


def compiled(scene, method=None):
    return CompiledModel(scene, method=method, registry=REGISTRY)


def drum(push=40.0):
    """A drum on its axle, braked by a shoe that a force of 40 N presses onto its guide."""
    scene = dap.Scene(name="drum")
    scene.add_body("drum", mass=2.0, Jp=(0.02, 0.02, 0.04), w=(0.0, 0.0, 50.0))
    scene.add_body("shoe", mass=0.5, Jp=(0.001, 0.001, 0.001), r=(0.1, 0.0, 0.0))
    scene.add_joint("rev", "axle", P_i="drum.O", P_j="ground.O", a_i="drum.z", a_j="ground.z")
    scene.add_joint("rP", "guide", body_i="shoe", a_j="ground.x", length=0.1)
    scene.add_force("f", "press", body_i="shoe", f=(-push, 0.0, 0.0))
    scene.add_force("brake", "brake", a_i="drum.z", a_j="ground.z", shoe="guide")
    return scene


@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "adams", "radau", "rk4"])
@pytest.mark.parametrize("method", ["standard", "lsq"])
def test_a_brake_pressed_by_another_joint(method, integrator):
    """w = w_0 - mu R F / J t, with each method and integrator; the shoe is pressed by 40 N."""
    step = {"step": 0.01} if integrator == "rk4" else {}
    model = compiled(drum(), method)
    result = dap.simulate(model, integrator=integrator, **step, **SETTINGS)
    assert result.w[:, 0, 2] == pytest.approx(50.0 - 0.3 * 0.1 * 40.0 / 0.04 * result.t, abs=1e-9)
    assert result.force("brake").on["i"].moment[:, 2] == pytest.approx(-1.2, rel=1e-12)
    assert result.force("brake").on["j"].moment[:, 2] == pytest.approx(1.2, rel=1e-12)
    assert result.ledger["energy"].ok


#: Mass, moment of inertia about the axle, radius, and force per load and sliding velocity.
TYRE = 20.0, 0.9, 0.3, 0.05


def tyre(spin=0.0):
    """A wheel on the ground z = 0."""
    m, J, R, k = TYRE
    scene = dap.Scene(name="tyre")
    scene.add_body("wheel", mass=m, Jp=(0.5, J, 0.5), r=(0, 0, R), w=(0.0, spin, 0.0))
    scene.add_joint("rP", "contact", body_i="wheel", a_j="ground.z", length=R)
    scene.add_force("weight")
    scene.add_force("loaded-tyre", P_i="wheel.O", contact="contact", radius=R, stiffness=k)
    return scene


def test_a_tyre_loaded_by_its_contact():
    """A locked slide of a wheel: forward and spin velocities meet at the rate of the load's slip.
    With N = m g, u = v - R w decays as exp(-k N (1 / m + R^2 / J) t), by the change of momentum."""
    m, J, R, k = TYRE
    result = dap.simulate(compiled(tyre(10.0)), **SETTINGS)
    rate = k * m * G * (1 / m + R**2 / J)
    slip = -R * 10.0 * np.exp(-rate * result.t)
    force = -k * m * G * slip
    assert result.rd[:, 0, 0] - R * result.w[:, 0, 1] == pytest.approx(slip, abs=1e-9)
    assert result.rd[:, 0, 0] == pytest.approx(force[0] / m / rate * (1 - slip / slip[0]), abs=1e-9)


@pytest.mark.parametrize("integrator", ["dop853", "adams", "radau"])
def test_a_rate_reads_reactions(integrator):
    """The work that a brake takes is the kinetic energy that its drum loses."""
    scene = drum()
    scene.forces["brake"].type = "worn-brake"
    result = dap.simulate(compiled(scene), integrator=integrator, **SETTINGS)
    lost = 0.5 * 0.04 * (50.0**2 - result.w[:, 0, 2] ** 2)
    assert result.quantity("brake.worn").values == pytest.approx(lost, abs=1e-8)


def pendulum(own):
    """Two links in a chain; the lower pin rubs, by its own type or by a force on its reaction."""
    scene = dap.Scene(name="chain")
    for k, name in enumerate("ab"):
        scene.add_body(name, mass=1.0 + k, Jp=(0.1, 0.2, 0.15), r=(0.5 + k, 0.0, 0.1 * k))
    scene.add_point("end", "a", (0.5, 0.0, 0.05))
    scene.add_point("begin", "b", (-0.5, 0.0, -0.05))
    scene.add_point("top", "a", (-0.5, 0.0, 0.0))
    scene.add_joint("rev", "pivot", P_i="top", P_j="ground.O", a_i="a.y", a_j="ground.y")
    scene.add_joint("rev", "pin", P_i="end", P_j="begin", a_i="a.y", a_j="b.y")
    scene.add_force("weight")
    if own:
        scene.add_force("pin-friction", "rub", body_i="a", a_j="b.y", pin="pin", v_tol=0.1)
    else:
        scene.add_force("friction", "rub", joint="pin", mu=0.3, radius=0.02, v_tol=0.1)
    return scene


@pytest.mark.parametrize("method", ["standard", "lsq", "joint"])
def test_a_law_of_one_s_own_is_that_of_the_joint(method):
    """The friction of a pin by ``lam_pin`` moves a chain as the type's own friction does."""
    own, given = (dap.simulate(compiled(pendulum(k), method), **SETTINGS) for k in (True, False))
    assert own.u == pytest.approx(given.u, abs=1e-9)
    assert own.Lam == pytest.approx(given.Lam, abs=1e-6)  # of the last digits of the iteration
    assert np.ptp(own.w[:, 1, 1]) > 0.1


def sliders(*parts):
    """Bodies on a plane; the friction of each presses it down by a part of the load."""
    scene = dap.Scene(name="sliders")
    for k, part in enumerate(parts):
        name = f"b{k}"
        scene.add_body(name, mass=2.0, Jp=(1, 1, 1), r=(0, k, 0), r_dot=(5.0, 0, 0))
        scene.add_joint("rP", f"p{k}", body_i=name, a_j="ground.z", length=0.0)
        scene.add_force("pressed-servo", f"s{k}", body_i=name, a_j="ground.x", n_j="ground.z",
                        plane=f"p{k}", mu=0.02, k=part)  # fmt: skip
    scene.add_force("weight")
    return scene


@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_sliders_that_load_themselves(integrator):
    """N = m g / (1 - k), however different the gains: the iteration learns one a pass."""
    parts = np.array([0.1, 0.3, 0.5, 0.7, 0.9, 0.95])
    result = dap.simulate(compiled(sliders(*parts), "standard"), integrator=integrator, **SETTINGS)
    load = 2.0 * G / (1 - parts)
    assert result.Lam[:] == pytest.approx(np.tile(load, (len(result.t), 1)), rel=1e-9)
    wanted = 5.0 - 0.02 * load / 2.0 * result.t[:, None]
    assert result.rd[:, :, 0] == pytest.approx(wanted, abs=1e-9)
    assert not any("did not settle" in note for note in result.notes)


@pytest.mark.parametrize("integrator", ["dop853", "adams", "radau"])
def test_a_brake_that_loads_itself_too_much_jams(integrator):
    """With k > 1 no load fits: the run ends, and names the force."""
    with pytest.raises(dap.SimulationError, match=r"force s0: the reactions .* jams"):
        dap.simulate(compiled(sliders(1.5), "standard"), integrator=integrator, **SETTINGS)


@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_no_step_goes_into_a_jam(integrator):
    """It slows down by mu g / (1 - k) to 4.9 m/s: no slope across the jam takes a step beyond."""
    scene = sliders(0.5)
    scene.forces["s0"].type = "seizing-servo"
    with pytest.raises(dap.SimulationError, match="force s0: the reactions") as caught:
        dap.simulate(compiled(scene, "joint"), integrator=integrator, **SETTINGS)
    stopped = float(str(caught.value).split(" s:")[0].split("t = ")[1])
    assert stopped == pytest.approx(0.1 / (0.02 * G / 0.5), rel=1e-8)


def test_a_jam_in_the_course_of_a_run_keeps_what_was_computed():
    """An event sets the gain beyond one at 0.2 s: the run ends there, and names the force."""
    event = dap.Event(lambda t, _: t - 0.2, action=lambda instant: instant.set("s0", k=1.5))
    with pytest.raises(dap.SimulationError, match="force s0") as caught:
        dap.simulate(compiled(sliders(0.5), "standard"), events=[event], **SETTINGS)
    assert caught.value.result.t[-1] == pytest.approx(0.2)


def test_other_rows_than_a_type_takes_are_refused():
    """``joint(rows=1)`` names a joint of one row; a kernel that reads more than there are, too."""
    scene = drum()
    scene.add_force("loaded-tyre", "wrong", P_i="drum.O", contact="axle")
    with pytest.raises(
        dap.SceneError, match=r"contact is to be a joint of 1 row; joint axle has 5"
    ):
        compiled(scene)


def test_reactions_that_only_their_joint_knows_are_refused():
    """Those of a joint with unknowns: its multipliers are there, its force is not."""
    scene = drum()
    scene.add_joint("on-curve", "wire", P_i="shoe.O", P_j="ground.O")
    scene.forces["brake"].fields["shoe"] = "wire"
    with pytest.raises(dap.PluginError, match=r"on-curve depends on s, .* take lam_shoe"):
        compiled(scene)


def test_statics_names_forces_on_reactions_that_it_cannot_take():
    with pytest.raises(dap.SimulationError, match="reactions of joints: leave brake"):
        dap.equilibrium(compiled(drum()))


def test_inverse_dynamics_finds_what_a_brake_takes_from_its_own_load():
    scene = drum()
    scene.add_force("n", "twist", body_i="drum", n=(0.0, 0.0, 0.3))
    model = compiled(scene)
    run = dap.simulate(model, **SETTINGS)
    found = dap.inverse(model, run, actuators=["twist"])
    assert found.record.actuation["twist"] == pytest.approx([0.3] * 5, abs=1e-9)
    assert found.Lam == pytest.approx(run.Lam, abs=1e-9)


def test_a_linearised_tyre_has_the_rate_of_its_slip():
    """The eigenvalues of slip, along and across, are -k N (1 / m + R^2 / J)."""
    m, J, R, k = TYRE
    modes = np.sort(dap.linearize(compiled(tyre())).eigenvalues.real)
    wanted = [-k * m * G * (1 / m + R**2 / inertia) for inertia in (0.5, J)]
    assert modes[:2] == pytest.approx(wanted, rel=1e-9)
