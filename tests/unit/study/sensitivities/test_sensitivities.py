"""Derivatives of runs: bits of values, blocks, breaks, data sets, what is refused."""

import numpy as np
import pytest
import xarray
from support.bouncing import swinging
from support.on_axles import wheel
from support.plain import jit_is_on

import dap3d_core as dap
from dap3d_core.result import ResultError

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="derivatives are of compiled code")
BY = ["bodies.rod.mass", "forces.gravity.gravity"]
SHORT = {"t_end": 0.2, "dt": 0.05}


def arrays(result):
    return [array.tobytes() for array in result.arrays.columns()]


@pytest.fixture(scope="module")
def reference():
    return dap.sensitivities("pen2", BY, **SHORT, rtol=1e-12, atol=1e-14)


@pytest.mark.every(3)
@pytest.mark.parametrize(
    "settings",
    [
        {"method": "standard"},
        {"method": "penalty"},
        {"method": "lsq"},
        {"method": "joint"},
        {"integrator": "dopri5"},
        {"integrator": "adams"},
        {"integrator": "radau"},
        {"integrator": "rk4", "step": 0.001},
        {"project": False},
    ],
    ids=lambda s: "-".join(map(str, s.values())),
)
def test_values_are_those_of_the_run_alone_and_derivatives_agree(settings, reference):
    """All that is reported has the same bits; formulations and integrators find one derivative."""
    tight = {"rtol": 1e-10, "atol": 1e-12}
    s = dap.sensitivities("pen2", BY, **SHORT, **settings, **tight)
    assert arrays(s.result) == arrays(dap.simulate("pen2", **SHORT, **settings, **tight))
    for quantity in ("cylinder.r.z", "cylinder.rd.z", "energy.kinetic"):
        scale = np.max(np.abs(reference.of(quantity)))
        # penalty keeps constraints to some 1e-7 alone
        part = 1e-5 if settings.get("method") == "penalty" else 1e-7
        np.testing.assert_allclose(
            s.of(quantity), reference.of(quantity), rtol=0.0, atol=part * scale
        )


@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("scene", "by"),
    [
        (wheel, ["bodies.wheel.mass"]),
        (lambda: "bodies2", ["forces.spring1.k", "points.A.sPp.x"]),
        (lambda: "fourbar3", ["points.P2.sPp.y", "functions.motor.coeff.2"]),
        (lambda: "bicycle", ["parameters.wheelbase"]),
    ],
)
def test_values_of_many_kinds_of_scenes(scene, by):
    s = dap.sensitivities(scene(), by, **SHORT)
    assert arrays(s.result) == arrays(dap.simulate(scene(), **SHORT))
    for body in s.result.summary.body_names:
        assert np.all(np.isfinite(s.of(f"{body}.r")))


def rubbing(joint, **friction):
    """A rod that swings on, slides along or turns about a joint with friction."""
    slides = joint == "tran"
    scene = dap.Scene(name=f"rubbing {joint}")
    scene.add_force("weight", "gravity", gravity=9.81)
    scene.add_body("b", mass=1.0, Jp=(0.01, 0.015, 0.02), r=(0.3, 0.0, 0.0),
                   r_dot=(0.5, 0.0, 0.0) if slides else (0.0, 0.0, -0.6),
                   w=(0.0, 0.0 if slides else 2.0, 0.0))  # fmt: skip
    scene.add_point("A", "b", (-0.3, 0.0, 0.0))
    axes = {"rev": {"a_i": "b.y", "a_j": "ground.y"}, "tran": {"a_j": "ground.x"}}
    scene.add_joint(joint, "h", P_i="A", P_j="ground.O", **axes.get(joint, {}))
    scene.add_force(*friction.pop("type", ("friction", "f")), joint="h", **friction)
    return scene, list(friction)


def rolling(**resists):
    """A ball that slides, spins and comes to roll."""
    scene = dap.Scene(name="rolling")
    scene.add_force("weight", "gravity", gravity=9.81)
    scene.add_body("b", mass=1.2, Jp=(0.004, 0.004, 0.004), r=(0.0, 0.0, 0.1),
                   r_dot=(0.5, 0.2, 0.0), w=(1.0, 2.0, 3.0))  # fmt: skip
    scene.add_contact("ball_plane", "f", P_i="b.O", radius=0.1, mu=0.3, **resists)
    return scene, ["mu", *resists]


RUBS = {"mu": 0.4, "radius": 0.05}


@pytest.mark.every(40)
@pytest.mark.parametrize("settings", [{"method": "lsq"}, {"method": "joint"},
                                      {"integrator": "radau"}], ids=str)  # fmt: skip
@pytest.mark.parametrize(
    "made",
    [
        (rubbing, "rev", RUBS),
        (rubbing, "rev", RUBS | {"v_tol": 0.01}),
        (rubbing, "sph", RUBS | {"v_tol": 0.01}),
        (rubbing, "tran", {"mu": 0.1}),
        (rubbing, "tran", {"mu": 0.4, "v_tol": 0.01}),
        (rubbing, "rev", {"type": ("rot_friction", "f"), "n_c": 0.9, "n_s": 1.2}),
        (rubbing, "rev", {"type": ("rot_friction", "f"), "n_c": 0.9, "w_tol": 0.1}),
        (rubbing, "tran", {"type": ("tran_friction", "f"), "f_c": 0.9, "f_s": 1.2}),
        (rolling, {}),
        (rolling, {"mu_roll": 0.003, "mu_spin": 0.002}),
    ],
    ids=lambda made: "-".join(map(str, (made[0].__name__, *made[1:]))),
)
def test_values_of_friction(made, settings):
    """An iteration that goes on for derivatives leaves its values as they are."""
    make, *joint, numbers = made
    scene, names = make(*joint, **numbers)
    kind = "contacts" if scene.contacts else "forces"
    by = ["bodies.b.mass", *(f"{kind}.f.{name}" for name in names)][:3]
    settings = settings | {"t_end": 0.6, "dt": 0.1, "rtol": 1e-8, "atol": 1e-10}
    s = dap.sensitivities(scene, by, **settings)
    assert arrays(s.result) == arrays(dap.simulate(scene, **settings))


@pytest.mark.slow
def test_more_directions_than_lanes():
    """Blocks of runs; each direction is what it is alone."""
    by = [f"bodies.{body}.{field}" for body in ("rod", "cylinder")
          for field in ("mass", "Jp.x", "Jp.y", "Jp.z", "w.y")]  # fmt: skip
    s = dap.sensitivities("pen2", by, **SHORT)
    assert s.of("cylinder.r.z").shape == (5, 10)
    alone = dap.sensitivities("pen2", by[7], **SHORT).of("cylinder.r.z")[:, 0]
    np.testing.assert_allclose(s.of("cylinder.r.z")[:, 7], alone, rtol=1e-12, atol=1e-15)


def test_a_break_point_that_depends_on_a_parameter():
    """A push that is switched off: x = v t + ... by the instant where it ends."""
    scene = dap.Scene(name="pushed")
    scene.add_body("mass", mass=2.0, Jp=(1.0, 1.0, 1.0))
    scene.add_function("step", "push", x_start=0.4, x_end=0.7, f_start=6.0, f_end=0.0)
    scene.add_force("f", "force", body_i="mass", f=(1.0, 0.0, 0.0), function="push")
    by = ["functions.push.x_start", "functions.push.x_end", "functions.push.f_start"]
    s = dap.sensitivities(scene, by, t_end=1.0, dt=0.5, rtol=1e-12, atol=1e-14)
    # velocity: the integral of the push, by symmetry of the step f (x_start + x_end) / 2 over m
    expected = [6.0 / 2.0 / 2.0, 6.0 / 2.0 / 2.0, 0.55 / 2.0]
    np.testing.assert_allclose(s.final("mass.rd.x"), expected, rtol=1e-9)


def test_data_sets(tmp_path):
    s = dap.sensitivities("pen2", BY, **SHORT)
    assert repr(s).startswith(f"<Sensitivities by {', '.join(BY)} of <Result 'pen2': done")
    data = s.to_xarray()
    np.testing.assert_array_equal(data["d cylinder.r"].values, s.of("cylinder.r"))
    assert list(data.parameter.values) == BY
    s.save(tmp_path / "s.nc", ["energy.total"])
    with xarray.open_dataset(tmp_path / "s.nc", engine="netcdf4") as read:
        np.testing.assert_array_equal(read["d energy.total"].values, s.of("energy.total"))
        assert read["energy.total"].attrs["units"] == "J"


@pytest.mark.parametrize(
    ("by", "said"),
    [
        ([], "name a parameter"),
        (["bodies.rood.mass"], "did you mean 'bodies.rod.mass'"),
        (["bodies.rod.mass", "bodies.rod.mass"], "only once"),
        (["simulation.step"], "says how a run is computed"),
        (["simulation.rtol"], "says how a run is computed"),
    ],
)
def test_what_is_refused(by, said):
    with pytest.raises(dap.SceneError, match=said):
        dap.sensitivities("pen2", by, **SHORT)


def test_the_values_of_a_control_history():
    """A push by a spline through samples: what one sample does is what it does alone."""

    def pushed(y):
        scene = dap.Scene(name="pushed")
        scene.add_body("mass", mass=2.0, Jp=(1.0, 1.0, 1.0))
        scene.add_function("spline", "push", x=(0.0, 0.3, 0.6, 1.0), y=y)
        scene.add_force("f", "force", body_i="mass", f=(1.0, 0.0, 0.0), function="push")
        return scene

    settings = {"t_end": 1.0, "dt": 0.5, "rtol": 1e-12, "atol": 1e-14}
    s = dap.sensitivities(
        pushed((1.0, -2.0, 0.5, 0.0)), ["functions.push.y.2", "functions.push.y.3"], **settings
    )
    for k, y in enumerate([(0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)]):
        alone = dap.simulate(pushed(y), **settings).quantity("mass.r.x").values[-1]
        assert s.final("mass.r.x")[k] == pytest.approx(alone, rel=1e-9)


@pytest.mark.slow
@pytest.mark.every(2)
@pytest.mark.parametrize("method", ["standard", "joint"])
def test_a_stop_of_an_angle(method):
    """Jumps in coordinates of bodies and of joints find one derivative."""
    settings = {"t_end": 1.2, "dt": 0.2, "rtol": 1e-12, "atol": 1e-14, "method": method}
    s = dap.sensitivities(swinging(), ["forces.stop.e", "bodies.bar.mass"], **settings)
    assert s.result.events
    h = 1e-4
    scenes = [swinging(), swinging()]
    for scene, sign in zip(scenes, (1.0, -1.0), strict=True):
        scene.forces["stop"].fields["e"] += sign * h
    ends = [dap.simulate(scene, **settings).quantity("bar.r.x").values[-1] for scene in scenes]
    # the difference errs by h^2
    assert s.final("bar.r.x")[0] == pytest.approx((ends[0] - ends[1]) / (2.0 * h), rel=1e-6)


@pytest.mark.every(3)
@pytest.mark.parametrize(
    "how",
    [
        {"method": "standard"},
        {"method": "lsq"},
        pytest.param({"integrator": "radau"}, marks=pytest.mark.slow),
    ],
)
def test_a_start_that_a_parameter_takes_off_the_constraints(how):
    """Its derivatives are brought onto them as its values would be, whether it is corrected or not.
    The model's start is on the constraints, where projections find nothing to do."""
    by, settings = ["points.P3.sPp.y"], SHORT | {"rtol": 1e-10, "atol": 1e-12}
    corrected = dap.sensitivities("pen2", by, correct=True, **settings).of("cylinder.r.z")
    s = dap.sensitivities("pen2", by, correct=False, **how, **settings)
    # the two corrections differ: unit metric, and that of the masses
    scale = np.max(np.abs(corrected))
    np.testing.assert_allclose(s.of("cylinder.r.z"), corrected, rtol=0.0, atol=1e-4 * scale)
    assert np.max(np.abs(s.of("constraint.position"))) < 1e-8


@pytest.mark.slow
def test_what_nothing_reads_has_derivatives_of_zero():
    """No rounding either, whose part of a quantity would look like a derivative."""
    scene = dap.load("pen2")
    scene.parameters["unread"] = 2.0
    s = dap.sensitivities(scene, ["parameters.unread", "bodies.rod.mass"], **SHORT)
    assert not np.any(s.of("cylinder.r")[..., 0])
    assert not np.any(s.of("cylinder.r")[0, :, 1])


def test_the_end_of_a_run():
    s = dap.sensitivities("pen2", "simulation.t_end")
    speed = s.result.quantity("cylinder.rd.z").values[-1]
    assert s.final("cylinder.r.z")[0] == pytest.approx(speed, rel=1e-9)


def test_an_end_that_is_given_is_the_one_that_varies():
    s = dap.sensitivities("pen2", "simulation.t_end", t_end=0.3)
    assert s.values == s.result.t[-1] == 0.3
    speed = s.result.quantity("cylinder.rd.z").values[-1]
    assert s.final("cylinder.r.z")[0] == pytest.approx(speed, rel=1e-9)


def test_quantities_that_read_a_parameter_by_themselves():
    """Gaps of contacts fall with the radius of a ball that flies, inputs are themselves."""
    scene = dap.Scene(name="ball")
    scene.add_input("push", 0.5)
    scene.add_body("ball", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 2.0))
    scene.add_force("f", "wind", body_i="ball", f=(1.0, 0.0, 0.0), input="push")
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.25)
    scene.add_output("both", "ball.r.z - 2 * floor.gap + push * ball.rd.x")
    s = dap.sensitivities(scene, ["contacts.floor.radius", "inputs.push.value"], **SHORT)
    t = s.result.t
    np.testing.assert_allclose(s.of("floor.gap"), [[-1.0, 0.0]] * len(t), rtol=1e-12)
    np.testing.assert_allclose(s.of("push"), [[0.0, 1.0]] * len(t), rtol=1e-12, atol=1e-13)
    by_push = 2.0 * 0.5 * t / 2.0  # push rd with rd = push t / m
    np.testing.assert_allclose(s.of("both")[:, 0], 2.0, rtol=1e-12)
    np.testing.assert_allclose(s.of("both")[:, 1], by_push, rtol=1e-10, atol=1e-12)


def test_radii_that_stand_for_teeth_have_no_derivative():
    scene = dap.Scene(name="gears")
    for name, x in (("small", 0.0), ("large", 0.3)):
        scene.add_body(name, mass=1.0, Jp=(1.0, 1.0, 1.0), r=(x, 0.0, 0.0))
        scene.add_point(f"axle_{name}", "ground", (x, 0.0, 0.0))
        scene.add_joint("rev", f"on_{name}", P_i=f"{name}.O", P_j=f"axle_{name}",
                        a_i=f"{name}.z", a_j="ground.z")  # fmt: skip
    radii = {"radius_i": 0.1, "radius_j": 0.2}
    scene.add_joint("gear", "mesh", joint_i="on_small", joint_j="on_large", **radii)
    with pytest.raises(dap.SimulationError, match="counts of teeth"):
        dap.sensitivities(scene, "joints.mesh.radius_i", **SHORT)
    dap.sensitivities(scene, "bodies.small.Jp.z", **SHORT)


def test_corrected_starts_are_exact():
    """The lever lies in the plane of a mechanism, across which it changes in second order alone."""
    by = "points.lever.sPp.z"
    s = dap.sensitivities("wiper", by, t_end=0.02, dt=0.01, rtol=1e-10, atol=1e-12)
    # starts to 1e-10 gave 2e-7
    assert np.max(np.abs(s.of("rocker.w"))) < 1e-9


@pytest.mark.slow
def test_what_derivatives_mean_is_noted():
    def notes(scene, by):
        found = dap.sensitivities(scene, by, t_end=0.02, dt=0.01).result.notes
        return [note for note in found if note.startswith("derivatives: ")]

    assert not notes("pen2", "bodies.rod.mass")
    (note,) = notes("pen2", ["bodies.rod.mass", "points.P4.sPp.y"])
    assert "leaves its constraints with points.P4.sPp.y and is not corrected" in note
    scene = dap.Scene(name="bristles")
    scene.add_body("cart", mass=2.0, Jp=(1.0, 1.0, 1.0), r_dot=(1.0, 0.0, 0.0))
    scene.add_force("lugre", "rub", P_i="cart.O", a_j="ground.x", f_n=20.0, mu_c=0.3, mu_s=0.5,
                    v_s=0.05, sigma_0=2e4, sigma_1=50.0, sigma_2=1.0)  # fmt: skip
    (note,) = notes(scene, "forces.rub.mu_c")
    assert "forces.rub (lugre) has a law with branches or corners and no switch" in note
    scene = dap.Scene(name="wheel")
    scene.add_body("wheel", mass=2.0, Jp=(1.0, 1.0, 1.0), w=(0.0, 0.0, 6.0))
    axle = {"P_i": "wheel.O", "P_j": "ground.O", "a_i": "wheel.z", "a_j": "ground.z"}
    scene.add_joint("rev", "axle", **axle)
    scene.add_force("rot_sda", "spring", joint="axle", k=0.3)
    (note,) = notes(scene, "forces.spring.k")
    assert "forces.spring (rot_sda) has a law with branches" in note  # it jumps at half a turn
    scene.forces["spring"].fields["turns"] = True
    assert not notes(scene, "forces.spring.k")
    scene = dap.Scene(name="slide")
    scene.add_body("block", mass=1.0, Jp=(1.0, 1.0, 1.0), r_dot=(1.5, 0.0, 0.0))
    scene.add_force("weight", "g", wgt=(0.0, -1.0, 0.0))
    scene.add_function("step", "f", x_start=0.4, x_end=1.0, f_end=-0.2)
    scene.add_contact("point_curve", "way", P_i="block.O", function="f", mu=0.2)
    (note,) = notes(scene, "bodies.block.mass")
    assert "contacts.way rubs along functions.f (step), whose curvature jumps" in note
    scene.functions["f"].type = "b"
    assert not notes(scene, "bodies.block.mass")


def test_a_vector_has_no_elasticity():
    s = dap.sensitivities("pen2", "bodies.rod.mass", **SHORT)
    with pytest.raises(ResultError, match=r"take cylinder\.r\.x"):
        s.elasticities("cylinder.r")
    with pytest.raises(TypeError, match="quantities should be a list of names"):
        s.to_xarray("cylinder.r")


def test_starts_without_a_residual_are_left():
    """Of an arm whose joints fit to the last digit; a pass would only move rounding about."""
    s = dap.sensitivities("two_link_arm", "bodies.lower.mass", t_end=0.02, dt=0.01)
    assert np.all(np.isfinite(s.of("lower.r")))


@pytest.mark.slow
@pytest.mark.parametrize(("size", "side"), [(0.03, 1.0), (3.162e-3, -1.0)])
@pytest.mark.parametrize("method", ["standard", "joint"])
def test_derivatives_at_the_edge_of_a_length_of_tolerances_are_those_of_its_side(
    size, side, method
):
    """With the arm grows the length in which velocities are corrected, by a power of ten.

    The derivative is that of the side on which the run is: beside one-sided differences of fourth
    order of runs of 1e-11.
    """

    def scene_of(arm):
        scene = dap.Scene(name="pendulum")
        Jp = [k * size**2 for k in (0.1, 0.2, 0.14)]
        motion = {"w": (1.0, 2.0, 3.0), "r_dot": (3.0 * size, 0.0, -size)}
        scene.add_body("bob", mass=2.0, Jp=Jp, r=(0.0, -size, 0.0), **motion)
        scene.add_point("A", "bob", (0.0, arm, 0.0))
        scene.add_joint("sph", "pivot", P_i="A", P_j="ground.O")
        return scene

    settings = {"method": method, "t_end": 0.2, "dt": 0.2, "rtol": 1e-11, "atol": 1e-13}
    found = dap.sensitivities(scene_of(size), "points.A.sPp.y", **settings).of("bob.r.x")[-1, 0]
    h = side * 1e-3 * size
    values = [dap.simulate(scene_of(size + k * h), **settings).r[-1, 0, 0] for k in range(5)]
    expected = np.dot([-25.0, 48.0, -36.0, 16.0, -3.0], values) / (12.0 * h)
    assert found == pytest.approx(expected, rel=1e-8)
