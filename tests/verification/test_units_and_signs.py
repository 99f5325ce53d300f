"""Signs of drivers and actuators against the coordinates of joints; loads of legs and wheels.
Units of outputs: test_units_of_outputs.py."""

import numpy as np
import pytest
from support.command_line import output_of

import dap3d_core as dap

TIGHT = {"rtol": 1e-11, "atol": 1e-13}
#: (body i, body j): ground on either side, and two free bodies in both orders.
ORDERS = [("a", "ground"), ("ground", "a"), ("a", "b"), ("b", "a")]
#: Inertia about the axes, and mass, of both bodies.
INERTIA, MASS = {"a": 0.2, "b": 0.5}, {"a": 2.0, "b": 3.0}
#: Of a driver f(t) = 0.3 t + 0.2 t^2, and of its end after 1 s.
LAW, TRAVEL = (0.0, 0.3, 0.2), 0.5
EFFORT = 0.7


def pair(joint, i, j):
    """Two bodies, or one and ground, on a joint along an axis that is no axis of ground."""
    scene = dap.Scene(name="pair")
    half, axis = 0.4, np.array([0.0, np.sin(0.8), np.cos(0.8)])
    p = (np.cos(half), -np.sin(half), 0.0, 0.0)  # turns z to the axis
    for name in {i, j} - {"ground"}:
        scene.add_body(name, mass=MASS[name], Jp=(INERTIA[name],) * 3, p=p)
    scene.add_vector("z_ground", "ground", axis)
    scene.add_vector("x_ground", "ground", (1.0, 0.0, 0.0))
    a_i, a_j = (f"{n}.z" if n != "ground" else "z_ground" for n in (i, j))
    fields = {"P_i": f"{i}.O", "P_j": f"{j}.O", "a_j": a_j}
    if joint == "tran":
        A = {n: np.array([[1, 0, 0], [0, np.cos(0.8), np.sin(0.8)],
                          [0, -np.sin(0.8), np.cos(0.8)]]) if n != "ground" else np.eye(3)
             for n in (i, j)}  # fmt: skip
        fields["A_c"] = (A[i].T @ A[j]).tolist()
    else:
        fields["a_i"] = a_i
    scene.add_joint(joint, "q", **fields)
    scene.add_function("a", "law", coeff=LAW)
    scene.add_input("u", value=1.0)
    return scene, a_j


def moved(scene, quantity):
    """How far a coordinate of the joint is after 1 s, and its rate."""
    result = dap.simulate(scene, t_end=1.0, dt=0.25, **TIGHT)
    assert result.ledger["energy"].ok
    rate = {"angle": "q.angle_rate", "length": "q.length_rate"}[quantity]
    return result.quantity(f"q.{quantity}").values[-1], result.quantity(rate).values[-1]


#: Type and its fields, besides bodies and axis -> sense of the coordinate for a positive function.
TURNS = [("drive-rot", {"function": "law"}, 1.0), ("rel-rot", {"function": "law"}, -1.0)]
SLIDES = [
    ("drive-tran", {"function": "law"}, 1.0),
    ("drive-tran", {"function": "law", "length": 0.0}, 1.0),
    ("rel-tran", {"function": "law"}, -1.0),
]


@pytest.mark.parametrize(("i", "j"), ORDERS)
@pytest.mark.parametrize("is_cylindrical", [False, True])
@pytest.mark.parametrize(
    ("kind", "type_", "fields", "sense"),
    [("angle", *turn) for turn in TURNS] + [("length", *slide) for slide in SLIDES],
)
def test_a_driver_moves_its_coordinate(kind, type_, fields, sense, is_cylindrical, i, j):
    """By f(t) - f(0): drive-rot and drive-tran; the types of the manual: by its negative.
    Position level to 1e-11 by projection; velocity level to the tolerance, some 1e-10."""
    scene, axis = pair("cyl" if is_cylindrical else {"angle": "rev", "length": "tran"}[kind], i, j)
    scene.add_joint(type_, "drive", body_i=i, body_j=j, a_j=axis, **fields)
    moved_by, rate = moved(scene, kind)
    assert moved_by == pytest.approx(sense * TRAVEL, abs=1e-9)
    assert rate == pytest.approx(sense * 0.7, abs=1e-9)


@pytest.mark.parametrize(("i", "j"), ORDERS)
@pytest.mark.parametrize(("type_", "sense"), [("rel-rot", -1.0), ("rel-tran", -1.0)])
def test_an_input_of_a_driver_has_the_sign_of_its_function(type_, sense, i, j):
    """A rate of 1 held for 1 s."""
    is_turn = type_ == "rel-rot"
    scene, axis = pair("rev" if is_turn else "tran", i, j)
    scene.add_joint(type_, "drive", body_i=i, body_j=j, a_j=axis, input="u")
    assert moved(scene, "angle" if is_turn else "length")[0] == pytest.approx(sense, abs=1e-9)


def reduced(values, i, j):
    """The mass or inertia that a force between two bodies moves."""
    return 1.0 / sum(1.0 / values[name] for name in {i, j} - {"ground"})


#: Coordinate, and what an actuator has besides its effort.
ACTUATORS = [
    *(("angle", fields) for fields in (
        {}, {"turns": True}, {"input": "u"}, {"input": "u", "turns": True}, {"function": "zero"},
        {"function": "zero", "input": "u", "turns": True})),
    *(("length", fields) for fields in (
        {}, {"input": "u"}, {"function": "zero"}, {"function": "zero", "input": "u"})),
]  # fmt: skip


@pytest.mark.parametrize(("i", "j"), ORDERS)
@pytest.mark.parametrize("is_cylindrical", [False, True])
@pytest.mark.parametrize(("kind", "fields"), ACTUATORS)
def test_a_positive_effort_of_an_actuator_increases_its_coordinate(
    kind, fields, is_cylindrical, i, j
):
    """n_a t^2 / (2 I) and f_a t^2 / (2 m), with the reduced inertia I and mass m."""
    scene, axis = pair("cyl" if is_cylindrical else {"angle": "rev", "length": "tran"}[kind], i, j)
    scene.add_function("a", "zero", coeff=(0.0, 0.0, 0.0))
    if kind == "angle":
        scene.add_force("rot_sda", "m", v_i=f"{i}.x", v_j=f"{j}.x", axis=axis, n_a=EFFORT, **fields)
    else:
        ends = {"P_i": f"{i}.O", "P_j": f"{j}.O", "a_j": axis}
        scene.add_force("tran_sda", "m", **ends, f_a=EFFORT, **fields)
    expected = 0.5 * EFFORT / reduced(INERTIA if kind == "angle" else MASS, i, j)
    assert moved(scene, kind)[0] == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize(("i", "j"), ORDERS)
@pytest.mark.parametrize("fields", [{}, {"input": "u"}, {"factor": "one"}])
def test_tension_of_a_spring_between_points_decreases_the_length(fields, i, j):
    """ptp keeps the sign of the manual: f_a pulls, here at a point beyond P_j along the axis."""
    scene, _ = pair("tran", i, j)
    z = np.array([0.0, np.sin(0.8), np.cos(0.8)]) if j == "ground" else (0.0, 0.0, 1.0)
    scene.add_point("near", j, tuple(-2.0 * np.asarray(z)))
    scene.add_function("a", "one", coeff=(1.0, 0.0, 0.0))
    scene.add_force("ptp", "m", P_i=f"{i}.O", P_j="near", f_a=EFFORT, **fields)
    expected = -0.5 * EFFORT / reduced(MASS, i, j)
    assert moved(scene, "length")[0] == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize(("i", "j"), ORDERS)
def test_a_leg_grows_with_its_function(i, j):
    """sph-sph from 2 m before P_j to P_i: its length is 2 m + f."""
    scene, _ = pair("tran", i, j)
    z = np.array([0.0, np.sin(0.8), np.cos(0.8)]) if j == "ground" else (0.0, 0.0, 1.0)
    scene.add_point("near", j, tuple(-2.0 * np.asarray(z)))
    scene.add_joint("sph-sph", "leg", P_i=f"{i}.O", P_j="near", function="law")
    assert moved(scene, "length")[0] == pytest.approx(TRAVEL, abs=1e-9)


def test_a_plane_moves_a_point_along_its_normal():
    """rP: length + f(t) along the vector of ground."""
    scene, axis = pair("tran", "a", "ground")
    scene.add_joint("rP", "lift", body_i="a", a_j=axis, length=0.0, function="law")
    assert moved(scene, "length")[0] == pytest.approx(TRAVEL, abs=1e-9)


@pytest.mark.parametrize(("i", "j"), ORDERS)
@pytest.mark.parametrize("kind", ["turn", "slide", "leg"])
def test_inverse_dynamics_finds_actions_that_increase_the_coordinate(kind, i, j):
    """The actuation of drivers and of actuators is q'' times the reduced inertia, of one sign.
    q'' = 0.4; splines through positions are not needed: the motion is a result."""
    scene, axis = pair("rev" if kind == "turn" else "tran", i, j)
    if kind == "turn":
        scene.add_joint("drive-rot", "drive", body_i=i, body_j=j, a_j=axis, function="law")
        scene.add_force("rot_sda", "act", v_i=f"{i}.x", v_j=f"{j}.x", axis=axis)
    elif kind == "slide":
        scene.add_joint("drive-tran", "drive", body_i=i, body_j=j, a_j=axis, function="law")
        scene.add_force("tran_sda", "act", P_i=f"{i}.O", P_j=f"{j}.O", a_j=axis)
    else:  # the row of a leg of 2 m is twice as long as one of its force
        z = np.array([0.0, np.sin(0.8), np.cos(0.8)]) if j == "ground" else (0.0, 0.0, 1.0)
        scene.add_point("near", j, tuple(-2.0 * np.asarray(z)))
        scene.add_joint("sph-sph", "drive", P_i=f"{i}.O", P_j="near", function="law")
        scene.add_force("tran_sda", "act", P_i=f"{i}.O", P_j=f"{j}.O", a_j=axis)
    motion = dap.simulate(scene, t_end=1.0, dt=0.25, **TIGHT)
    expected = 0.4 * reduced(INERTIA if kind == "turn" else MASS, i, j)
    unit = "N m" if kind == "turn" else "N"
    for name in ("drive", "act"):
        moving = scene.copy()
        if name == "act":
            del moving.joints["drive"]
        found = dap.inverse(moving, motion, actuators=[name]).quantity(f"{name}.actuation")
        assert found.values == pytest.approx(expected, abs=1e-8)
        assert found.unit == unit


@pytest.mark.parametrize("type_", ["drive-rot", "drive-tran"])
@pytest.mark.parametrize(("i", "j"), ORDERS[:2])
def test_kinematics_over_a_driver_moves_the_coordinate_along(type_, i, j):
    """The coordinate of the joint is that of the driver."""
    joint, quantity = {"drive-rot": ("rev", "angle"), "drive-tran": ("tran", "length")}[type_]
    scene, axis = pair(joint, i, j)
    scene.add_joint(type_, "drive", body_i=i, body_j=j, a_j=axis, function="law")
    result = dap.kinematics(scene, over="drive.q=0:0.5:6")
    assert result.quantity(f"q.{quantity}").values == pytest.approx(result.t, abs=1e-9)


@pytest.mark.parametrize("type_", ["drive-rot", "drive-tran", "rel-rot", "rel-tran", "rot_sda",
                                   "tran_sda", "ptp", "rP", "sph-sph"])  # fmt: skip
def test_describe_says_the_sign_in_its_first_lines(type_):
    """Which way a positive function, force or moment moves the coordinate."""
    text = output_of("describe", type_)[:900]
    words = ("increases", "decreases")
    assert any(word in " ".join(text.split()) for word in words)


# ---------------------------------------------------------------------------- ground as body i


def hanging(type_, ground_first):
    """Two bodies that hang from ground by a joint and a ball, with springs to ground."""
    scene = dap.Scene(name="hanging")
    scene.add_body("a", mass=2.0, Jp=(0.2, 0.3, 0.4), r=(0.5, 0.0, 0.0))
    scene.add_body("b", mass=1.0, Jp=(0.1, 0.15, 0.12), r=(1.5, 0.0, 0.0))
    for name, body, x in (("A", "a", -0.5), ("B", "a", 0.5), ("C", "b", -0.5)):
        scene.add_point(name, body, (x, 0.0, 0.0))
    for body in ("a", "ground"):
        scene.add_vector(f"{body}_u", body, (0.6, 0.8, 0.0))
        scene.add_vector(f"{body}_n", body, (-0.8, 0.6, 0.0))
    (i, P), (j, Q) = ("a", "A"), ("ground", "ground.O")
    if ground_first:
        i, j, P, Q = j, i, Q, P
    first, second = ("n", "u") if ground_first else ("u", "n")  # the arms of a cross
    fields = {
        "rev": {"P_i": P, "P_j": Q, "a_i": f"{i}_u", "a_j": f"{j}_u"},
        "tran": {"P_i": P, "P_j": Q, "a_j": f"{j}_u"},
        "sph": {"P_i": P, "P_j": Q},
        "univ": {"P_i": P, "P_j": Q, "a_i": f"{i}_{first}", "n_j": f"{j}_{second}"},
        "weld": {"body_i": i, "body_j": j},
    }
    fields["cyl"] = fields["rev"]
    scene.add_joint(type_, "q", **fields[type_])
    scene.add_joint("sph", "ball", P_i="C", P_j="B")
    ends = {"P_i": "C", "P_j": "ground.O"}
    scene.add_vector2("d", *(reversed(ends.values()) if ground_first else ends.values()))
    scene.add_force("ptp", "spring", d="d", k=30.0, c=0.5, l0=0.8)
    scene.add_force("sph_sd", "bush", body_i=i, body_j=j, k=1.0, c=0.1)
    scene.add_force("rot_friction", "drag", body_i=i, body_j=j, axis="ground_u", n_c=0.2, w_tol=0.1)
    scene.add_force("weight", "gravity")
    return scene


@pytest.mark.parametrize("type_", ["rev", "cyl", "tran", "sph", "univ", "weld"])
@pytest.mark.parametrize(
    ("method", "integrator"),
    [
        ("standard", "dop853"),
        ("joint", "dop853"),
        pytest.param("lsq", "dopri5", marks=pytest.mark.slow),
        pytest.param("standard", "radau", marks=pytest.mark.slow),
    ],
)
def test_bodies_of_a_joint_to_ground_may_be_exchanged(type_, method, integrator):
    """The motion, the reactions and the energy stay; rtol 1e-10 leaves some 1e-8."""
    settings = {"t_end": 0.5, "dt": 0.25, "method": method, "integrator": integrator,
                "rtol": 1e-10, "atol": 1e-12}  # fmt: skip
    usual, exchanged = (
        dap.simulate(hanging(type_, ground_first), **settings) for ground_first in (False, True)
    )
    assert exchanged.u == pytest.approx(usual.u, abs=1e-7)
    forces = [usual.reaction("q")["i"].force, exchanged.reaction("q")["j"].force]
    assert forces[1] == pytest.approx(forces[0], abs=1e-5)
    assert exchanged.energy.total == pytest.approx(usual.energy.total, abs=1e-7)
    assert exchanged.ledger["energy"].ok


# ---------------------------------------------------------------------------- legs


@pytest.mark.parametrize("function", [None, "still", "slow"])
@pytest.mark.parametrize(("place", "sense"), [(-5.0, -1.0), (0.8, 1.0)])
def test_lambda_of_a_leg_times_its_length_is_its_force(function, place, sense):
    """200 kg that hang or stand: lambda |d| = -+ m (g + l''), negative in tension.
    The leg of 5 m pulls, that of 0.8 m pushes, at whose end guides keep the load."""
    m, g, pace = 200.0, 9.81, 0.3
    scene = dap.Scene(name="leg")
    scene.add_body("load", mass=m, Jp=(5.0, 5.0, 5.0), r=(0.0, 0.0, place))
    scene.add_force("weight", "w", gravity=g)
    scene.add_function("a", "still", coeff=(0.0, 0.0, 0.0))
    scene.add_function("a", "slow", coeff=(0.1, 0.2, pace))  # f(0) counts for nothing
    for axis in "xy":
        scene.add_joint("rP", f"guide_{axis}", body_i="load", a_j=f"ground.{axis}", length=0.0)
    scene.add_joint("sph-sph", "leg", P_i="load.O", P_j="ground.O", function=function)
    result = dap.simulate(scene, t_end=1.0, dt=0.25, **TIGHT)
    faster = 2.0 * pace if function == "slow" else 0.0
    length = abs(place) + (0.2 * result.t + pace * result.t**2 if faster else 0.0)
    assert result.quantity("load.r.z").values == pytest.approx(sense * length, abs=1e-9)
    force = sense * m * (g + sense * faster)
    assert result.quantity("leg.lambda.1").values * length == pytest.approx(force, rel=1e-9)
    assert result.quantity("leg.force.norm").values == pytest.approx(abs(force), rel=1e-9)
    if function is not None:  # a push is positive: it makes the leg longer
        found = dap.inverse(scene, result, actuators=["leg"]).quantity("leg.actuation")
        assert found.values == pytest.approx(force, rel=1e-8)
        assert found.unit == "N"


def test_a_leg_is_not_drawn_through_its_end():
    """A leg of 1 m that is to become -0.2 m long: the run ends, it does not turn round."""
    scene = dap.Scene(name="leg")
    scene.add_body("load", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(0.0, 0.0, 1.0))
    scene.add_function("step", "draw", x_end=1.0, f_end=-1.2)
    for axis in "xy":
        scene.add_joint("rP", f"guide_{axis}", body_i="load", a_j=f"ground.{axis}", length=0.0)
    scene.add_joint("sph-sph", "leg", P_i="load.O", P_j="ground.O", function="draw")
    with pytest.raises(dap.SimulationError):
        dap.simulate(scene, t_end=1.0, dt=0.25)


# ---------------------------------------------------------------------------- what wheels carry


@pytest.mark.parametrize("type_", ["couple", "follow"])
def test_describe_says_what_bearings_of_wheels_carry(type_):
    """In its first lines: moments alone, and nothing of the tooth force."""
    text = " ".join(output_of("describe", type_).split())[:500]
    assert "transmits moments" in text
    assert "bearings" in text
