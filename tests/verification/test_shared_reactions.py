"""Forces that read reactions which are not unique: friction in redundant hinges, brakes on them.
A door on two coaxial hinges has ten rows of rank five. How the hinges share the load is open, and
with it the friction: without a choice there is no motion to compute. With the least multipliers it
is compared with a solution of its own: the loads of a turning door in closed form, shared by numpy,
and scipy's DOP853 for the speed."""

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.levels import quickly
from support.on_reactions import Brake
from support.own_types import registry_of

import dap3d_core as dap
from dap3d_core.cli import main

G, MASS, ARM, J_Z = 9.81, 12.0, 0.45, 0.9
MU, RADIUS, W0 = 0.2, 0.01, 3.0
HEIGHTS = (-0.7, 0.7)
#: The size of the leaf, its longest arm, which makes forces of moments.
PARTS = np.hypot(ARM, HEIGHTS[1])


def door(kinds=("rev", "rev"), unit=1.0, mu=MU, heights=HEIGHTS, **shared):
    """A door that turns about z; unit: of length, for one metre. Its J_x and J_y are equal."""
    scene = dap.Scene(name="door")
    Jp = (4.0 * unit**2, 4.0 * unit**2, J_Z * unit**2)
    scene.add_body("leaf", mass=MASS, Jp=Jp, r=(ARM * unit, 0.0, 0.0), w=(0.0, 0.0, W0),
                   r_dot=(0.0, ARM * W0 * unit, 0.0))  # fmt: skip
    for k, (kind, z) in enumerate(zip(kinds, heights, strict=True)):
        scene.add_point(f"l{k}", "leaf", (-ARM * unit, 0.0, z * unit))
        scene.add_point(f"g{k}", "ground", (0.0, 0.0, z * unit))
        axes = {} if kind == "sph" else {"a_i": "leaf.z", "a_j": "ground.z"}
        scene.add_joint(kind, f"h{k}", P_i=f"l{k}", P_j=f"g{k}", **axes)
        scene.add_force("friction", f"f{k}", joint=f"h{k}", mu=mu, radius=RADIUS * unit,
                        v_tol=1e-4 * unit, **shared)  # fmt: skip
    scene.add_force("weight", gravity=G * unit)
    return scene


def rows_of_door():
    """(10, 6) rows of the two hinges by (force, moment about the mass centre), axes of the leaf."""
    rows = []
    for z in HEIGHTS:
        rows += [[*-e, *-np.cross((-ARM, 0.0, z), e)] for e in np.eye(3)]
        rows += [[0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 1, 0]]
    return np.array(rows, dtype=float)


def friction_moment(w, compliance=None):
    """Moment of friction at the speed w, with the share of least lambda . c lambda.
    c: by default 1 for forces, 1 / length^2 for moments. Friction turns the load by its
    deceleration: iterated until it agrees."""
    D = rows_of_door()
    c = np.where(np.arange(10) % 5 < 3, 1.0, PARTS**-2) if compliance is None else compliance
    moment = 0.0
    for _ in range(100):
        alpha = -moment / (J_Z + MASS * ARM**2)
        load = [-MASS * ARM * w**2, MASS * ARM * alpha, MASS * G, 0.0, 0.0, J_Z * alpha + moment]
        lam = (D / c[:, None]) @ np.linalg.pinv(D.T @ (D / c[:, None])) @ load
        moment = MU * RADIUS * sum(np.linalg.norm(lam[k : k + 3]) for k in (0, 5))
    return moment


def speed_after(t_end):
    """W of the door with the least share, by scipy."""
    J = J_Z + MASS * ARM**2
    solution = solve_ivp(lambda t, w: [-friction_moment(w[0]) / J], (0.0, t_end), [W0], "DOP853",
                         rtol=1e-11, atol=1e-13)  # fmt: skip
    return solution.y[0, -1]


@pytest.mark.parametrize("method", ["auto", "lsq", "penalty", "joint"])
@pytest.mark.parametrize(
    "scene",
    [
        door(),
        door(mu=1e-6),
        door(("sph", "sph")),
        door(("rev", "cyl")),
        door(("rev", "sph")),
        door(unit=1e3),
    ],
)
def test_friction_in_redundant_hinges_is_refused(scene, method):
    """No method has a motion to offer; the message names what to do."""
    words = r'f0, f1.*not unique.*independent.*bushing.*shared = "least"'
    with pytest.raises(dap.RedundantError, match=words):
        dap.simulate(scene, t_end=1.0, method=method)


def test_other_readers_of_what_is_not_unique_are_refused():
    """A hinge beside one that says least, a brake, a linearisation."""
    scene = door()
    scene.forces["f0"].fields["shared"] = "least"
    for other, words in ((scene, r"^force f1: .* of joint h1"),
                         (braked("h0"), r"force brake1: .* of joint h0")):  # fmt: skip
        with pytest.raises(dap.RedundantError, match=words):
            dap.simulate(other, t_end=0.1)
    with pytest.raises(dap.RedundantError, match="not unique"):
        dap.linearize(door())


def test_check_says_it(tmp_path, capsys):
    """Exit code 2, as for a scene that no run can take; with "least" it names the readers."""
    path = tmp_path / "door.toml"
    for shared, code in ({}, 2), ({"shared": "least"}, 0):
        door(**shared).save(path, force=True)
        assert main(["check", str(path)]) == code
        assert "read by f0, f1" in capsys.readouterr().out


def test_independent_hinges_run_as_before():
    """One hinge: its load is the closed form of the turning door, friction mu r |load|."""
    scene = door(("rev",), heights=(0.0,))
    J = J_Z + MASS * ARM**2

    def rate(t, w):
        # m r (w^4 r^2 + alpha^2 r^2 + g^2)^(1/2), and alpha from mu r of it
        alpha = 0.0
        for _ in range(60):
            load = MASS * np.sqrt((ARM * w[0] ** 2) ** 2 + (ARM * alpha) ** 2 + G**2)
            alpha = -MU * RADIUS * load / J
        return [alpha]

    wanted = solve_ivp(rate, (0.0, 1.0), [W0], "DOP853", rtol=1e-12, atol=1e-14).y[0, -1]
    result = dap.simulate(scene, t_end=1.0, rtol=1e-10)
    assert result.w[-1, 0, 2] == pytest.approx(wanted, abs=1e-9)  # rtol 1e-10 of 3 rad/s


@pytest.mark.slow
@pytest.mark.parametrize("unit", quickly([1.0, 1e3, 1e-3]))
@pytest.mark.parametrize("integrator", ["dop853", "adams"])
def test_the_least_share_is_that_of_its_definition(integrator, unit):
    """The speed after 3 s in metres, millimetres and kilometres; iterations converge."""
    result = dap.simulate(
        door(unit=unit, shared="least"), t_end=3.0, rtol=1e-10, integrator=integrator
    )
    # rtol 1e-10 over 20 to 200 steps, of adams some times that
    assert result.w[-1, 0, 2] == pytest.approx(speed_after(3.0), abs=2e-9)
    assert not any("did not settle" in note for note in result.notes)
    assert not any("Accelerations are unique" in note for note in result.notes)
    assert result.ledger["energy"].ok


@pytest.mark.slow
def test_little_friction_converges_too():
    """Mu = 1e-6: what remains of the load is rounding, and no iteration fails by it."""
    result = dap.simulate(door(mu=1e-6, shared="least"), t_end=3.0)
    assert not any("did not settle" in note for note in result.notes)


def spread(result):
    """Work by the least share, and the range of others, J, in the note."""
    (note,) = (n for n in result.notes if n.startswith('shared = "least"'))
    return [float(x) for x in re.findall(r"took (\S+) J.*between (\S+) and (\S+) J", note)[0]]


@pytest.mark.slow
def test_the_note_has_the_spread_of_the_outcome():
    """It holds what the same motion would lose by two shares that numpy finds.
    Hinges that keep the axes parallel stiffly carry little by forces, soft ones all of it."""
    result = dap.simulate(door(shared="least"), t_end=3.0, dt=0.05)
    least, low, high = spread(result)
    J = J_Z + MASS * ARM**2
    lost = 0.5 * J * (W0**2 - result.w[-1, 0, 2] ** 2)
    assert least == pytest.approx(lost, rel=1e-3)  # the trapezoidal rule over 0.05 s
    works = []
    for compliance in (1e-3, 1e3):
        c = np.where(np.arange(10) % 5 < 3, 1.0, compliance)
        powers = [friction_moment(w, c) * w for w in result.w[:, 0, 2]]
        works.append(np.trapezoid(powers, result.t))
    stiff, soft = works
    assert soft > 1.1 * stiff
    # 64 random shares come within 1 % of the one where rows of moments carry all that they can
    assert low == pytest.approx(stiff, rel=0.01)
    assert low <= least <= soft <= high


def test_the_least_share_needs_lsq_and_an_explicit_integrator():
    """The others share in ways of their own, and would give other motions."""
    scene = door(shared="least")
    for settings, words in (
        ({"method": "joint"}, "needs method lsq"),
        ({"method": "penalty"}, "needs method lsq"),
        ({"integrator": "radau"}, "needs an explicit integrator"),
    ):
        with pytest.raises(dap.RedundantError, match=words):
            dap.simulate(scene, t_end=1.0, **settings)


def braked(joint):
    """A door on two hinges, and a wheel on a hinge of its own, braked by the load of a joint."""
    scene = door(mu=0.0)
    for name in ("f0", "f1"):
        del scene.forces[name]
    scene.add_body("wheel", mass=1.0, Jp=(0.1, 0.1, 0.2), r=(5.0, 0.0, 0.0), w=(0.0, 0.0, 10.0))
    scene.add_joint("rev", "axle", P_i="wheel.O", P_j="wheel_at", a_i="wheel.z", a_j="ground.z")
    scene.add_point("wheel_at", "ground", (5.0, 0.0, 0.0))
    scene.add_force("brake", a_i="wheel.z", a_j="ground.z", shoe=joint, mu=0.3, radius=0.1)
    return dap.compile(scene, registry=registry_of(Brake))


def test_a_brake_on_a_unique_reaction_of_a_redundant_scene_runs():
    """Load m g, so that w falls by mu r m g / J_z each second."""
    result = dap.simulate(braked("axle"), t_end=1.0)
    wanted = 10.0 - 0.3 * 0.1 * 1.0 * G / 0.2
    assert result.w[-1, 1, 2] == pytest.approx(wanted, rel=1e-7)


def test_sweeps_refuse_each_point():
    """Runs of a sweep are judged as single ones are."""
    swept = dap.sweep(door(), {"forces.f0.mu": [0.1, 0.2]}, outputs=["leaf.w.z"], t_end=0.1)
    assert list(swept["status"].values) == [3, 3]  # failed


def test_feet_that_share_carry_the_centre_of_what_their_cones_allow():
    """Of the forces that hold a crate none makes |f|^2 / (2 size^2) - sum log (r^2 - |v|^2) less.

    Its slope along all that may be added is the rounding of forces: 1e-14 of them.
    """
    mu, feet = (
        np.array([0.5, 0.4, 0.6, 0.5]),
        [(x, y, -0.25) for x in (-0.5, 0.5) for y in (-0.3, 0.4)],
    )
    pull, columns = np.array([12.0, -9.0, 5.0]), []
    scene = dap.Scene(name="crate")
    scene.add_body("crate", mass=MASS, Jp=(1.0, 1.0, 1.0), r=(0.0, 0.0, 0.25))
    for k, foot in enumerate(feet):
        scene.add_point(f"P{k}", "crate", foot)
        scene.add_contact("ball_plane", f"foot{k}", P_i=f"P{k}", mu=mu[k])
        columns += [[*e, *np.cross(foot, e)] for e in np.eye(3)[[2, 0, 1]]]
    scene.add_force("weight", gravity=G)
    scene.add_force("f", body_i="crate", f=tuple(pull))
    result = dap.simulate(scene, t_end=0.1, dt=0.1)
    contacts = [result.contact(f"foot{k}") for k in range(4)]
    x = np.array([[c.normal_force[-1], *c.friction[-1, :2]] for c in contacts])
    A, load = np.array(columns).T, np.append(pull - [0.0, 0.0, MASS * G], np.zeros(3))
    assert A @ x.ravel() == pytest.approx(-load, abs=1e-12)
    size = np.abs(np.linalg.lstsq(A, -load, rcond=None)[0]).max()
    left = (mu * x[:, 0]) ** 2 - (x[:, 1:] ** 2).sum(axis=1)
    slope = x / size**2 - 2.0 / left[:, None] * np.column_stack([mu**2 * x[:, 0], -x[:, 1:]])
    added = np.linalg.svd(A)[2][6:]
    assert np.abs(added @ slope.ravel()).max() < 1e-10 * np.abs(slope).max()
