"""A model evaluated at any state: accelerations, multipliers, residuals, power.
The dense saddle-point systems of tests/models/reference/kkt.py judge them: these know positions
alone, and get Jacobian and accelerations by exact differentiation along a motion. States are taken
at random, far off the constraints, where a simplified row would show."""

import numpy as np
import pytest
from support.internals import Evaluator, correct_initial, join, split
from support.motions import G, Motion
from support.process import REPOSITORY
from support.results import model_of
from support.rotations import rotation, to_body

import dap3d_core as dap
from dap3d_core.formulations import RHS

REFERENCE = REPOSITORY / "tests/models/reference"
#: Relative: condition numbers up to 1e5 of matrices that are inverted by another method.
TOLERANCE = 1e-9


@pytest.fixture(scope="module")
def reference():
    """The reference simulators, which are plain scripts."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(REFERENCE)
        import fourbar2
        import fourbar3
        import kkt
        import pen2

        yield {"pen2": pen2.SYSTEM, "fourbar2": fourbar2.SYSTEM, "fourbar3": fourbar3.SYSTEM,
               "carousel": carousel_reference(kkt)}  # fmt: skip


ARMS = 6
SIZES = np.random.default_rng(8).uniform(0.5, 2.0, (ARMS + 3, 4))
SPOTS = np.random.default_rng(9).uniform(-1.0, 1.0, (ARMS + 3, 2, 3)).round(3)


def carousel():
    """A hub on ground with six arms, each arm tied to the next: loops, all through the hub; and two
    bodies on a revolute that hang on nothing."""
    scene = dap.Scene(name="carousel")
    for n in range(ARMS + 3):
        scene.add_body(f"b{n}", mass=SIZES[n, 0], Jp=2.0 + SIZES[n, 1:])
        for end in range(2):
            scene.add_point(f"P{n}{end}", f"b{n}", SPOTS[n, end])
    scene.add_joint("sph", "J0", P_i="P00", P_j="ground.O")
    for n in range(1, ARMS + 1):
        scene.add_joint("sph", f"J{n}", P_i=f"P{n}0", P_j="P01")
    for n in range(1, ARMS + 1):
        after = n % ARMS + 1
        scene.add_joint("sph-sph", f"L{n}", P_i=f"P{n}1", P_j=f"b{after}.O", length=1.5)
    last = f"b{ARMS + 2}"
    scene.add_joint("rev", "R", P_i=f"P{ARMS + 1}0", P_j=f"P{ARMS + 2}0",
                    a_i=f"b{ARMS + 1}.y", a_j=f"{last}.x")  # fmt: skip
    scene.add_force("weight", "gravity")
    return scene


def carousel_reference(kkt):
    def at(n, end):
        return kkt.Fixed(n, tuple(SPOTS[n, end]))

    joints = [kkt.sph("J0", at(0, 0), kkt.Fixed(kkt.GROUND, (0.0, 0.0, 0.0)))]
    joints += [kkt.sph(f"J{n}", at(n, 0), at(0, 1)) for n in range(1, ARMS + 1)]
    for n in range(1, ARMS + 1):
        centre = kkt.Fixed(n % ARMS + 1, (0.0, 0.0, 0.0))
        joints.append(kkt.distance(f"L{n}", at(n, 1), centre, 1.5))
    i, j = ARMS + 1, ARMS + 2
    axes = kkt.Fixed(i, (0.0, 1.0, 0.0)), kkt.Fixed(j, (1.0, 0.0, 0.0))
    joints.append(kkt.rev("R", at(i, 0), at(j, 0), *axes))
    bodies = [
        kkt.Body(f"b{n}", SIZES[n, 0], tuple(2.0 + SIZES[n, 1:]), (0.0, 0.0, 0.0))
        for n in range(ARMS + 3)
    ]
    return kkt.System(bodies=bodies, joints=joints)


def evaluator_of(scene):
    """The machine of a scene, which need not be assembled."""
    model = model_of(scene)
    return Evaluator(model, "standard" if model.row_count else "unconstrained")


MECHANISMS = ("pen2", "fourbar2", "fourbar3", "carousel")
SCENES = {name: dap.load(name) for name in MECHANISMS if name != "carousel"}
SCENES["carousel"] = carousel()


@pytest.fixture(scope="module")
def machines():
    return {name: evaluator_of(scene) for name, scene in SCENES.items()}


mechanisms = pytest.mark.parametrize("name", MECHANISMS)
seeds = pytest.mark.parametrize("seed", range(3))


def state_of(evaluator, seed):
    """A state taken at random, as u and as the arguments of the reference."""
    n = evaluator.model.body_count
    u = Motion(n, np.random.default_rng(seed)).u(0.1)
    r, p, _, _ = split(u)
    return u, (r, rotation(p), u[7 * n :])


def close(found, wanted, tolerance=TOLERANCE):
    return np.max(np.abs(found - wanted)) <= tolerance * (1.0 + np.max(np.abs(wanted)))


@mechanisms
@seeds
def test_accelerations_and_multipliers_solve_the_dense_system(name, seed, reference, machines):
    """v_dot and lambda are those of [M, -D^T; D, 0] (v_dot; lambda) = (g; gamma) solved by LU."""
    evaluator = machines[name]
    u, arguments = state_of(evaluator, seed)
    v_dot, multipliers = reference[name].solve(*arguments)
    n, m = evaluator.model.body_count, evaluator.model.row_count
    report = evaluator.report(0.2, u)
    assert close(evaluator.rhs(0.2, u)[7 * n :], v_dot)
    assert close(report[: 6 * n], v_dot)
    assert close(report[6 * n : 6 * n + m], multipliers)


@mechanisms
@seeds
def test_rows_are_those_of_the_differentiated_positions(name, seed, reference, machines):
    """C, D, nu and gamma agree row by row, also off the constraints: rounding alone."""
    evaluator = machines[name]
    u, arguments = state_of(evaluator, seed)
    C, D, nu, gamma = reference[name].constraints(*arguments)
    rows = evaluator.rows(0.2, u)
    assert close(rows.C[evaluator.model.position_row], C, 1e-13)
    assert close(rows.dense(), D, 1e-13)
    assert close(rows.nu, nu, 1e-13)
    assert close(rows.gamma, gamma, 1e-13)


@mechanisms
@seeds
def test_residuals_of_the_three_levels_are_reported(name, seed, machines):
    """The last three numbers of a report are the largest |C|, |D v - nu| and |D v_dot - gamma|, the
    last one rounding; before them stands the potential energy."""
    evaluator = machines[name]
    u, _ = state_of(evaluator, seed)
    n, m = evaluator.model.body_count, evaluator.model.row_count
    rows, report = evaluator.rows(0.2, u), evaluator.report(0.2, u)
    D, v = rows.dense(), u[7 * n :]
    angles = evaluator.model.angle_count  # of the hinges
    assert len(report) == evaluator.report_size == 6 * n + m + angles + 4
    position, velocity, acceleration = report[-3:]
    assert position == pytest.approx(np.max(np.abs(rows.C)), rel=1e-13)
    assert velocity == pytest.approx(np.max(np.abs(D @ v - rows.nu)), rel=1e-12)
    scale = 1.0 + np.max(np.abs(rows.gamma))
    assert acceleration <= TOLERANCE * scale
    assert np.max(np.abs(D @ report[: 6 * n] - rows.gamma)) <= TOLERANCE * scale


def test_potential_energy_is_reported(machines, reference):
    """m g z of all bodies, and k (l - l0)^2 / 2 of the spring, by the reference: rounding."""
    for name in ("pen2", "fourbar3"):
        u, arguments = state_of(machines[name], 7)
        _, potential = reference[name].loads(*arguments)
        assert machines[name].report(0.0, u)[-4] == pytest.approx(potential, rel=1e-13)


@mechanisms
@pytest.mark.parametrize("length", [1.0, 1.7])
def test_layout_of_the_rates(name, length, machines):
    """du/dt holds r_dot and p_dot = 1/2 G^T omega of each body, then r_ddot and omega_dot; Euler
    parameters that have drifted off unit length keep it, and change no acceleration."""
    evaluator = machines[name]
    n = evaluator.model.body_count
    u, _ = state_of(evaluator, 4)
    r, p, v, w = split(u)
    stretched = join(r, length * p, v, w)
    r_dot, p_dot, a, w_dot = split(evaluator.rhs(0.0, stretched))
    assert np.array_equal(r_dot, v)
    for b in range(n):
        assert p_dot[b] == pytest.approx(0.5 * G(length * p[b]).T @ w[b], abs=1e-14)
    report = evaluator.report(0.0, u)[: 6 * n].reshape(n, 6)
    assert close(np.hstack([a, w_dot]), report, 1e-11)  # rounding of p, times the condition


def in_other_axes(turns):
    """pen2 with a spring and a damper, its bodies described in axes turned by these matrices."""
    rod, cylinder = turns
    scene = dap.Scene(name="turned")
    for name, R, mass, moments, y in [
        ("rod", rod, 0.5, (0.3, 0.2, 0.45), 0.5),
        ("cylinder", cylinder, 10.0, (0.2333, 0.2, 0.3), 1.3),
    ]:
        scene.add_body(name, mass=mass, Jp=R.T @ np.diag(moments) @ R, r=(0, y, 0), p=euler(R))

    def spot(name, body, where, R):
        return scene.add_point(name, body, R.T @ np.array(where, dtype=float))

    spot("inner", "rod", (0, -0.5, 0), rod)
    spot("outer", "rod", (0, 0.5, 0), rod)
    spot("face", "cylinder", (0, -0.3, 0), cylinder)
    spot("rim", "cylinder", (0.2, 0.2, 0), cylinder)
    scene.add_vector("a_rod", "rod", rod.T @ np.array([0.0, 1.0, 0.0]))
    scene.add_vector("a_cyl", "cylinder", cylinder.T @ np.array([0.0, 1.0, 0.0]))
    scene.add_point("hook", "ground", (0.5, 1.0, 1.0))
    scene.add_joint("sph", "J1", P_i="inner", P_j="ground.O")
    scene.add_joint("rev", "J2", P_i="face", P_j="outer", a_i="a_cyl", a_j="a_rod")
    scene.add_force("weight", "gravity")
    scene.add_force("ptp", "spring", P_i="rim", P_j="hook", k=30.0, c=4.0, l0=0.5)
    return scene


def euler(A):
    """Euler parameters of a rotation matrix with a positive first one."""
    e0 = 0.5 * np.sqrt(1.0 + np.trace(A))
    return np.array([e0, *(A[[2, 0, 1], [1, 2, 0]] - A[[1, 2, 0], [2, 0, 1]]) / (4.0 * e0)])


def test_accelerations_do_not_depend_on_the_axes_of_a_body():
    """The same mechanism described in other body axes, where J' is a full matrix, moves alike: so
    the factor of J' stands in the right places (condition of J' about 3, some roundings)."""
    rng = np.random.default_rng(12)
    turns = [rotation([1.5, *rng.uniform(-1, 1, 3)]) for _ in range(2)]
    plain, turned = evaluator_of(in_other_axes([np.eye(3)] * 2)), evaluator_of(in_other_axes(turns))
    assert np.max(np.abs(turned.model.Jp - plain.model.Jp)) > 0.01
    v = rng.normal(size=12)
    found = []
    for evaluator in (plain, turned):
        u = np.concatenate([evaluator.model.u0[:14], v])
        found.append(evaluator.report(0.0, u))
    assert close(found[1][:12], found[0][:12], 1e-12)
    assert found[1][20:23] == pytest.approx(found[0][20:23], rel=1e-11)  # potential, |C|, |D v|


def power_and_rate(evaluator, t, u):
    """Power that the formulation reports, and dT/dt from the accelerations by their definition."""
    model = evaluator.model
    y = evaluator.integrated(u)
    out = np.zeros_like(y)
    evaluator.functions[RHS](t, y, out, evaluator.system, evaluator.loops)
    _, p, v, w = split(u)
    _, _, a, w_dot = split(evaluator.rhs(t, u))
    spin, spin_rate = to_body(p, w), to_body(p, w_dot)
    rate = np.sum(model.mass[:, None] * v * a) + np.einsum("bi,bij,bj", spin, model.Jp, spin_rate)
    return out[-1], rate


@seeds
def test_power_of_forces_on_free_bodies_is_the_rate_of_kinetic_energy(seed):
    """Springs, dampers and weight on bodies without joints: dT/dt = sum of F . v + n . omega, at
    any state; the gyroscopic moment does no work. Rounding of sums of some hundred watts."""
    evaluator = evaluator_of(dap.load("bodies2"))
    assert evaluator.method == "unconstrained"
    power, rate = power_and_rate(evaluator, 0.0, Motion(2, np.random.default_rng(seed)).u(0.1))
    assert power == pytest.approx(rate, rel=1e-12)


@pytest.mark.parametrize("name", ["pen2", "fourbar2", "fourbar3"])
def test_power_of_forces_and_drivers_is_the_rate_of_kinetic_energy(name, machines):
    """On the constraints the reactions work with nu alone: dT/dt = F . v + lambda . nu, to the
    1e-10 of the assembly times forces of some hundred newtons."""
    evaluator = machines[name]
    u = evaluator.model.u0.copy()
    n = evaluator.model.body_count
    u[7 * n :] = np.random.default_rng(2).normal(size=6 * n)
    u = correct_initial(evaluator, u).u
    power, rate = power_and_rate(evaluator, 0.0, u)
    assert abs(rate) > 1e-3
    assert power == pytest.approx(rate, rel=1e-8)


def test_without_joints_both_formulations_agree():
    """The standard formulation of a scene without rows gives the unconstrained accelerations."""
    model = model_of(dap.load("bodies2"))
    u = Motion(2, np.random.default_rng(1)).u(0.1)
    free, standard = (Evaluator(model, method) for method in ("unconstrained", "standard"))
    assert close(free.rhs(0.0, u), standard.rhs(0.0, u), 1e-15)
    assert free.report(0.0, u)[-4:] == pytest.approx(standard.report(0.0, u)[-4:], rel=1e-15)
