"""Joints with unknowns of their own against minimal coordinates, which SciPy integrates.
Tolerances: 1e-9 of motions of some m in runs with rtol 1e-11."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support.levels import quickly
from support.own_types import registry_of
from support.unknown_types import WITH_UNKNOWNS

import dap3d_core as dap
from dap3d_core.simulation import CompiledModel

G = 9.81
REGISTRY = registry_of(*WITH_UNKNOWNS)
SETTINGS = {"rtol": 1e-11, "atol": 1e-13}
A, B, H = 1.0, 0.6, 0.2


def curve(s, order=0):
    """The closed curve, its first and its second derivative."""
    return (
        np.array([A * np.cos(s), B * np.sin(s), H * np.sin(2 * s)]),
        np.array([-A * np.sin(s), B * np.cos(s), 2 * H * np.cos(2 * s)]),
        np.array([-A * np.cos(s), -B * np.sin(s), -4 * H * np.sin(2 * s)]),
    )[order]


def bead(keyword="on-curve", speed=2.0, **fields):
    scene = dap.Scene(name="bead")
    velocity = tuple(speed * curve(0.0, 1))
    scene.add_body("bead", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(A, 0.0, 0.0), r_dot=velocity)
    scene.add_joint(keyword, "wire", P_i="bead.O", P_j="ground.O", **fields)
    scene.add_force("weight")
    return scene


def on_the_wire(speed, t):
    """s, s_dot (2, nt) of a bead under its weight: c' . (c' s_ddot + c'' s_dot^2 + g z) = 0."""

    def rates(_, y):
        tangent = curve(y[0], 1)
        force = curve(y[0], 2) * y[1] ** 2 + np.array([0.0, 0.0, G])
        return y[1], -tangent @ force / (tangent @ tangent)

    return solve_ivp(rates, (0, t[-1]), (0.0, speed), "DOP853", t, rtol=1e-13, atol=1e-14).y


def compiled(scene, method=None):
    return CompiledModel(scene, method=method, registry=REGISTRY)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", quickly(["dop853", "radau", "dopri5", "adams"], 2))
@pytest.mark.parametrize("method", ["standard", "lsq"])
@pytest.mark.parametrize("speed", [2.0, 6.0], ids=["to and fro", "round and round"])
def test_a_point_on_a_closed_curve(method, integrator, speed):
    """Positions, the curve's parameter, and the ledger."""
    result = dap.simulate(compiled(bead(speed=speed), method), integrator=integrator,
                          t_end=2.0, dt=0.5, **SETTINGS)  # fmt: skip
    s, s_dot = on_the_wire(speed, result.t)
    assert result.r[:, 0] == pytest.approx(curve(s).T, abs=1e-9)
    assert result.rd[:, 0] == pytest.approx(curve(s, 1).T * s_dot[:, None], abs=1e-8)
    assert result.quantity("wire.s").values == pytest.approx(s, abs=1e-9)
    assert bool(s[-1] > 2 * np.pi) is (speed > 5)
    assert all(entry.ok for entry in result.ledger.values())


def test_the_reaction_holds_the_bead_on_the_wire():
    """Force on the bead: m (a - g), normal to the curve."""
    result = dap.simulate(compiled(bead()), t_end=1.0, dt=0.25, **SETTINGS)
    force = result.reaction("wire")["i"].force
    assert force == pytest.approx(result.rdd[:, 0] + [0.0, 0.0, G], abs=1e-9)
    tangents = curve(result.quantity("wire.s").values, 1).T
    assert np.sum(force * tangents, axis=1) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_periodic_unknowns_begin_again():
    """Round and round, s stays between its bounds, and the motion is the same."""
    result = dap.simulate(compiled(bead("on-curve-again", 6.0)), t_end=2.0, dt=0.1, **SETTINGS)
    s, _ = on_the_wire(6.0, result.t)
    assert s[-1] > 2 * np.pi
    found = result.quantity("wire.s").values
    assert np.exp(1j * found) == pytest.approx(np.exp(1j * s), abs=1e-9)
    assert np.all((found > -1e-9) & (found < 2 * np.pi + 1e-9))


@pytest.mark.parametrize("integrator", ["dop853", "radau"])
def test_an_unknown_that_leaves_its_bounds_ends_the_run(integrator):
    """At the instant, with the joint, the unknown, the bound."""
    model = compiled(bead(speed=6.0, s_max=1.0))
    with pytest.raises(
        dap.SimulationError, match=r"wire .* s passed its greatest .* s_max = 1"
    ) as caught:
        dap.simulate(model, integrator=integrator, t_end=2.0, dt=0.5, **SETTINGS)
    instant = caught.value.result.t[-1]
    reached = on_the_wire(6.0, np.array([0.0, instant]))[0][-1]
    assert reached == pytest.approx(1.0, abs=1e-9)


def test_where_the_unknown_begins():
    """A start on the other side of the curve, which s_0 tells from this one."""
    scene = bead(s_0=3.0, speed=0.0)
    scene.bodies["bead"].r = tuple(curve(np.pi + 0.1))
    result = dap.simulate(compiled(scene), t_end=0.1, dt=0.1)
    assert result.quantity("wire.s").values[0] == pytest.approx(np.pi + 0.1, abs=1e-9)


AXES = np.array([0.5, 0.4, 0.3])
MASS, INERTIA = 2.0, np.array([0.11, 0.13, 0.17])


def touching(R):
    """From the centre to the point of contact, global axes, and its part without a sign."""
    n = R.T @ [0.0, 0.0, 1.0]
    return -R @ (AXES**2 * n) / np.sqrt(n @ (AXES**2 * n))


def touching_rate(R, w):
    n = R.T @ [0.0, 0.0, 1.0]
    n_dot = -np.cross(R.T @ w, n)
    h = np.sqrt(n @ (AXES**2 * n))
    D, D_dot = AXES**2 * n, AXES**2 * n_dot
    return np.cross(w, -R @ D / h) + R @ (-D_dot / h + D * (D @ n_dot) / h**3)


def accelerations(R, w, rolls):
    """(v_dot, w_dot) of the ellipsoid: momentum about its centre, and contact at all levels.
    Rolling: v = -w x rho. Sliding: of that the vertical part, and a vertical force alone."""
    rho, rho_dot = touching(R), touching_rate(R, w)
    J = R @ np.diag(INERTIA) @ R.T
    held = np.arange(3) if rolls else np.array([2])
    K = np.zeros((9, 9))  # v_dot, w_dot, F
    side = np.zeros(9)
    K[:3, :3], K[:3, 6:], side[2] = MASS * np.eye(3), -np.eye(3), -MASS * G
    tilde = np.cross(np.eye(3), rho)  # rows e_k x rho
    K[3:6, 3:6], K[3:6, 6:], side[3:6] = J, tilde.T, -np.cross(w, J @ w)
    for k in range(3):
        if k in held:  # v_dot + w_dot x rho = -w x rho_dot
            K[6 + k, k], K[6 + k, 3:6] = 1.0, tilde[:, k]
            side[6 + k] = -np.cross(w, rho_dot)[k]
        else:
            K[6 + k, 6 + k] = 1.0
    x = np.linalg.solve(K, side)
    return x[:3], x[3:6]


@pytest.mark.slow
@pytest.mark.parametrize("rolls", [False, True], ids=["slides", "rolls"])
def test_an_ellipsoid_on_a_plane(rolls):
    """Position and attitude against Euler parameters and w alone, contact in closed form."""
    turn = Rotation.from_rotvec([0.4, -0.3, 0.2])
    R, w = turn.as_matrix(), np.array([1.5, -0.7, 0.4])
    v = -np.cross(w, touching(R)) if rolls else np.array([0.3, 0.1, -np.cross(w, touching(R))[2]])
    p = np.roll(turn.as_quat(), 1)
    scene = dap.Scene(name="ellipsoid")
    scene.add_body("egg", mass=MASS, Jp=tuple(INERTIA), r=(0.0, 0.0, -touching(R)[2]),
                   p=tuple(p), r_dot=tuple(v), w=tuple(w))  # fmt: skip
    x, y, z = R.T @ touching(R)
    scene.add_joint("rolling-ellipsoid" if rolls else "ellipsoid", "contact", body_i="egg",
                    x_0=round(x, 1), y_0=round(y, 1), z_0=round(z, 1))  # fmt: skip
    scene.add_force("weight")
    result = dap.simulate(compiled(scene), t_end=1.0, dt=0.25, **SETTINGS)

    def rates(_, u):
        _, q, v, w = np.split(u, [3, 7, 10])
        R = Rotation.from_quat(np.roll(q, -1)).as_matrix()
        e0, e = q[0], q[1:]
        q_dot = 0.5 * np.array([-e @ w, *(e0 * w + np.cross(w, e))])
        return np.concatenate([v, q_dot, *accelerations(R, w, rolls)])

    u0 = np.concatenate([[0.0, 0.0, -touching(R)[2]], p, v, w])
    u = solve_ivp(rates, (0, 1), u0, "DOP853", result.t, rtol=1e-13, atol=1e-14).y.T
    assert result.r[:, 0] == pytest.approx(u[:, :3], abs=1e-9)
    assert result.p[:, 0] == pytest.approx(u[:, 3:7], abs=1e-9)
    assert result.w[:, 0] == pytest.approx(u[:, 10:], abs=1e-8)
    point = [touching(Rotation.from_quat(np.roll(q, -1)).as_matrix()) for q in u[:, 3:7]]
    body = [Rotation.from_quat(np.roll(q, -1)).as_matrix().T @ s
            for q, s in zip(u[:, 3:7], point, strict=True)]  # fmt: skip
    for k, name in enumerate("xyz"):
        found = result.quantity(f"contact.{name}").values
        assert found == pytest.approx(np.array(body)[:, k], abs=1e-9)


def resting():
    """A bead near the lowest point of its wire, s = 3 pi / 4."""
    scene = bead(s_0=2.0, speed=0.0)
    scene.bodies["bead"].r = tuple(curve(2.2))
    return scene


@pytest.mark.slow
def test_a_bead_comes_to_rest_where_its_wire_is_lowest():
    """Statics moves along the wire; a run from it begins with its unknown."""
    model = compiled(resting())
    rest = dap.equilibrium(model)
    assert rest.r[0] == pytest.approx(curve(0.75 * np.pi), abs=1e-9)
    result = dap.simulate(model, start=rest, t_end=0.1, dt=0.1)
    assert result.quantity("wire.s").values == pytest.approx(0.75 * np.pi, abs=1e-9)


def test_the_frequency_of_a_bead_at_the_lowest_point():
    """w^2 = g z'' / |c'|^2, z'' = 4 h."""
    model = compiled(resting())
    found = dap.linearize(model, at=dap.equilibrium(model)).frequencies
    wanted = np.sqrt(G * 4 * H) / np.linalg.norm(curve(0.75 * np.pi, 1)) / (2 * np.pi)
    assert np.min(np.abs(found - wanted)) < 1e-9


def test_a_run_from_a_result_goes_on():
    """The unknown is found again where the result ends, beyond a whole turn too."""
    scene = bead(speed=6.0)
    whole = dap.simulate(compiled(scene), t_end=1.0, dt=0.25)
    half = dap.simulate(compiled(scene), t_end=0.5, dt=0.25)
    again = dap.simulate(compiled(scene), start=half, t_end=0.5, dt=0.25)
    assert again.r[-1] == pytest.approx(whole.r[-1], abs=1e-6)
    found = [x.quantity("wire.s").values[-1] for x in (again, whole)]
    assert found[0] == pytest.approx(found[1], abs=1e-6)


PLUGIN = """
from support.unknown_types import OnCurve

from dap3d_core.interface import hookimpl

interface_version = 1


@hookimpl
def dap3d_joints():
    return [OnCurve]
"""


def test_points_of_a_sweep_seek_their_own_unknowns(tmp_path):
    """Each point is the run alone."""
    bead(speed=2.0).save(tmp_path / "scene.toml")
    (tmp_path / "plugin.py").write_text(PLUGIN)
    heights = [0.1, 0.2]
    swept = dap.sweep(tmp_path, {"joints.wire.h": heights}, outputs="bead.r.z", t_end=0.5, dt=0.25,
                      allow_code=True, threads=1)  # fmt: skip
    for k, h in enumerate(heights):
        alone = dap.simulate(compiled(bead(speed=2.0, h=h)), t_end=0.5, dt=0.25)
        found = np.asarray(swept["bead.r.z"]).reshape(2, -1)[k, -1]
        assert found == pytest.approx(alone.r[-1, 0, 2], abs=1e-9)


def test_a_start_from_which_no_unknown_is_found_is_told():
    """Where the rows cannot close, the joint is named."""
    scene = bead()
    scene.add_joint("sph", "pin", P_i="bead.O", P_j="ground.O")  # at the centre, off the curve
    with pytest.raises(dap.SimulationError, match="wire"):
        dap.simulate(compiled(scene), t_end=0.1)
