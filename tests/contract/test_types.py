"""The contract of every registered type (spec 2), along random motions off the constraint manifold.

The tests run over the registry: a new type is covered without a new test, and so are its variants.
Tolerances: sixth-order differences with h = 3e-3 of functions whose seventh derivatives are of
order 1e3 leave about 1e3 h^6 / 140 = 5e-15 of truncation (a driver's angle near the pose where it
is undefined has derivatives a million times as large) and eps / h = 1e-13 of rounding; 1e-8 of the
largest term is asked for.
"""

import numpy as np
import pytest
from support.motions import Motion, derivative
from support.scenes import case_names, cases, scene_for, variant

from dap3d_core.formulations.machine import Machine
from dap3d_core.model import ModelError, build_model
from dap3d_core.model.kinematics import join, rotation, split
from dap3d_core.registry import load_registry
from dap3d_core.scene import check
from dap3d_core.simulation.initial import correct_initial

REGISTRY = load_registry()
H, TOLERANCE = 3e-3, 1e-8


def machine_for(kind, case, seed, ground=None):
    keyword, values = case
    examined = REGISTRY.get(kind, keyword)
    scene = scene_for(examined, np.random.default_rng(seed), ground=ground, values=values)
    model = build_model(check(scene, REGISTRY))
    return Machine(model, "standard")


def close(a, b, tolerance=TOLERANCE):
    scale = 1.0 + np.max(np.abs(b), initial=0.0)
    return np.max(np.abs(a - b), initial=0.0) <= tolerance * scale


def each(found):
    return pytest.mark.parametrize("case", found, ids=case_names(found))


def examined_of(kind, case):
    return variant(REGISTRY, kind, *case)


def slots(kind, case):
    return len(examined_of(kind, case).layout.slots)


#: Its moment is that of a potential only where the bodies turn about the common axis
#: (tests/verification/test_torsion.py).
ABOUT_AN_AXIS = "rot_sda"

JOINTS, FORCES = cases(REGISTRY, "joint"), cases(REGISTRY, "force")
joints = each(JOINTS)
between = each([c for c in JOINTS if slots("joint", c) > 1])
pairs = each([c for c in FORCES if slots("force", c) > 1])
POTENTIALS = [
    (case, ground)
    for case in FORCES
    for ground in (None, "j")[: slots("force", case)]
    if "energy" in examined_of("force", case).kernels and case[0] != ABOUT_AN_AXIS
]
with_energy = pytest.mark.parametrize(
    ("case", "ground"),
    POTENTIALS,
    ids=[f"{n}-{g}" for n, g in zip(case_names([c for c, _ in POTENTIALS]),
                                    [g for _, g in POTENTIALS], strict=True)],
)  # fmt: skip
grounded = pytest.mark.parametrize("ground", [None, "j"], ids=["body-body", "body-ground"])
seeds = pytest.mark.parametrize("seed", range(3))


@joints
@grounded
@seeds
def test_position_rows_have_the_velocity_form_as_their_rate(case, ground, seed):
    """d/dt C = D v - nu on the rows of the position level."""
    machine = machine_for("joint", case, seed, ground)
    motion = Motion(3, np.random.default_rng(seed + 100))
    rate = derivative(lambda t: machine.rows(t, motion.u(t)).C, 0.1, H)
    rows = machine.rows(0.1, motion.u(0.1))
    velocity = rows.dense() @ motion.u(0.1)[-18:] - rows.nu
    mask = machine.model.position_row
    assert close(rate[mask], velocity[mask])


@joints
@grounded
@seeds
def test_velocity_rows_have_the_acceleration_form_as_their_rate(case, ground, seed):
    """d/dt (D v - nu) = D v_dot - gamma on all rows."""
    machine = machine_for("joint", case, seed, ground)
    motion = Motion(3, np.random.default_rng(seed + 200))

    def velocity_form(t):
        rows = machine.rows(t, motion.u(t))
        return rows.dense() @ motion.u(t)[-18:] - rows.nu

    rows = machine.rows(0.1, motion.u(0.1))
    acceleration = rows.dense() @ motion.v_dot(0.1) - rows.gamma
    assert close(derivative(velocity_form, 0.1, H), acceleration)


@joints
@seeds
def test_rank_is_the_number_of_rows(case, seed):
    """At a pose taken at random the rows of a joint are independent."""
    machine = machine_for("joint", case, seed)
    rows = machine.rows(0.0, Motion(3, np.random.default_rng(seed + 300)).u(0.1))
    assert np.linalg.matrix_rank(rows.dense()) == machine.model.row_count


@between
@seeds
def test_an_assembled_joint_allows_a_common_rigid_motion(case, seed):
    """D v = 0 for bodies that move as one, at a pose on the constraints (frame indifference).

    Rows of the velocity level alone are asked for a common translation only: ``rel-tran`` is the
    manual's literal equation, which sees a common rotation (spec 4.8).
    """
    machine = machine_for("joint", case, seed)
    u = correct_initial(machine, Motion(3, np.random.default_rng(seed + 400)).u(0.0)).u
    r, p, _, w = split(u, 3)
    speed, nothing = np.array([1.0, 2.0, -0.5]), np.zeros(machine.model.row_count)
    together = join(r, p, np.broadcast_to(speed, r.shape), np.zeros_like(w))
    assert close(machine.rows(0.0, together).dense() @ together[-18:], nothing, 1e-12)
    spin = np.array([0.3, -0.7, 0.4])
    together = join(r, p, speed + np.cross(spin, r), np.broadcast_to(spin, w.shape))
    velocity = machine.rows(0.0, together).dense() @ together[-18:]
    mask = machine.model.position_row
    assert close(velocity[mask], nothing[mask], 1e-9)  # |C| <= 1e-10 times the spin


@with_energy
@seeds
def test_energy_is_the_potential_of_the_wrench(case, ground, seed):
    """At rest the power of the wrench along any motion is -dV/dt (types with an energy alone)."""
    machine = machine_for("force", case, seed, ground)
    motion = Motion(3, np.random.default_rng(seed + 500))
    last = 18  # the potential energy stands behind v_dot and no multipliers
    rate = derivative(lambda t: machine.report(0.0, motion.u(t))[last : last + 1], 0.1, H)
    assert close(np.array([applied(machine, at_rest(motion.u(0.1))) @ motion.u(0.1)[-18:]]), -rate)


@pairs
@seeds
def test_forces_between_bodies_balance(case, seed):
    """Force and moment of an element between bodies sum to zero about the origin."""
    machine = machine_for("force", case, seed)
    u = Motion(3, np.random.default_rng(seed + 600)).u(0.1)
    wrench = applied(machine, u) - applied(without_forces(seed, case), u)
    wrench = wrench.reshape(3, 6)
    r = split(u, 3)[0]
    assert close(wrench[:, :3].sum(axis=0), np.zeros(3), 1e-12)
    assert close((wrench[:, 3:] + np.cross(r, wrench[:, :3])).sum(axis=0), np.zeros(3), 1e-12)


@each(cases(REGISTRY, "function"))
@seeds
def test_function_derivatives(case, seed):
    """Each derivative is that of the one before, away from the ends of pieces."""
    machine = function_machine(case, seed)

    def at(x):
        machine.rows(x, machine.model.u0)
        return machine.system.F[1, :4].copy()

    for x in np.random.default_rng(seed).uniform(0.1, 2.0, 20):
        rate, values = derivative(at, x, 1e-3), at(x)
        if np.ptp([at(x + k * 1e-3)[3] for k in (-3, 3)]) > 0.1 * np.max(np.abs(values)):
            continue  # the third derivative jumps where a piece ends
        assert close(rate[:3], values[1:], 1e-7)


def function_machine(case, seed):
    """A machine whose first function is of a type; its prepare may refuse some random fields."""
    for attempt in range(200):
        rng = np.random.default_rng([seed, attempt])
        scene = scene_for(REGISTRY.get("function", case[0]), rng, values=case[1])
        # what no element uses is not evaluated
        scene.add_joint("rel-rot", body_i="b1", a_j="ground.z", function="element")
        try:
            return Machine(build_model(check(scene, REGISTRY)), "standard")
        except ModelError:
            continue
    raise AssertionError("no random fields are good for this type")


def at_rest(u):
    u = u.copy()
    u[-18:] = 0.0
    return u


def applied(machine, u):
    """Generalised forces (18,) at a state, M v_dot of free bodies."""
    v_dot = machine.report(0.0, u)[:18].reshape(3, 6)
    model = machine.model
    p = split(u, 3)[1]
    A = rotation(p)
    J = A @ model.Jp @ A.transpose(0, 2, 1)
    force = model.mass[:, None] * v_dot[:, :3]
    moment = np.einsum("brc,bc->br", J, v_dot[:, 3:])
    return np.hstack([force, moment]).ravel()


def without_forces(seed, case):
    """The machine of the same bodies without the element."""
    scene = scene_for(REGISTRY.get("force", case[0]), np.random.default_rng(seed), values=case[1])
    scene.forces.clear()
    return Machine(build_model(check(scene, REGISTRY)), "standard")
