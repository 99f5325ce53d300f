"""Tests by evaluation if potentials account for all work that can be done in a scene.

A force with an energy may have a damper and a spring; what its kernels say is compared at a
few states taken at random about the start.
"""

import numpy as np

from dap3d_core.assembly.arrays import ENERGY, RATE, VALUE, WRENCH
from dap3d_core.assembly.evaluate import call_kinds, place_state
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model.rigid_motion import quaternion_product
from dap3d_core.model.rotations import to_global
from dap3d_core.model.state_layout import join, split, velocities_of, y_from_u

#: States that are tried, and the largest displacement of a body there, in lengths of
#: the scene and rad.
STATES, REACH = 3, 0.1
#: Central differences of order four, over H seconds at speeds of order one: truncation is of order
#: H^4, rounding eps / H, of the energy.
OFFSETS, WEIGHTS, H = (-2, -1, 1, 2), (1 / 12, -2 / 3, 2 / 3, -1 / 12), 1e-3
#: The same where elements have states: a belt of little pretension is soon slack.
H_STATES = 1e-5
#: Power and rate of the potential agree to this part of their size.
AGREE = 1e-6


@IGNORE_FLOAT_ERRORS
def is_conservative(evaluator: Evaluator, u: Floats) -> bool:
    """True if neither dampers, drivers, friction nor forces without a potential can do work.

    Contacts, which are open here, and friction that is one, may do work all the same.

    u: (13 n,) a state about which the forces are tried.
    """
    model = evaluator.model
    driven = any(np.any(g.functions > 0) for g in model.joints)
    driven = driven or any(
        np.any(g.functions[:, : len(g.type_info.layout.functions)] > 0) for g in model.forces
    )
    drivers = any(getattr(g.type_info.type, "drives", False) for g in model.joints)
    reads = model.friction or any(group.read for group in model.forces)
    if driven or reads or (drivers and np.any(evaluator.rows(0.0, u).nu)):
        return False
    if any("energy" not in g.type_info.kernels for g in model.forces):
        return False
    rng, length = np.random.default_rng(1), model.length
    r, p, _, _ = split(u)
    h = H_STATES if model.state_count else H
    for _ in range(STATES):
        v, w = length * rng.normal(size=r.shape), rng.normal(size=r.shape)
        shift, turn = length * rng.normal(size=r.shape), rng.normal(size=r.shape)
        near = _moved(r, p, shift, turn, REACH)
        power, size, rates = _power(evaluator, join(*near, v, to_global(near[1], w)))
        rate = sum(c * _energy(evaluator, *near, v, w, rates, k * h)
                   for k, c in zip(OFFSETS, WEIGHTS, strict=True)) / h  # fmt: skip
        if not abs(power + rate) <= AGREE * (size + abs(rate)):
            return False
    return True


def _moved(r: Floats, p: Floats, v: Floats, w: Floats, h: float) -> tuple[Floats, Floats]:
    """Poses after h seconds at constant velocity v and body-frame angular velocity w."""
    angle = np.linalg.norm(w, axis=1, keepdims=True)
    half = 0.5 * h * angle
    c, e = np.cos(half), np.sin(half) * w / np.where(angle > 0.0, angle, 1.0)
    return r + h * v, quaternion_product(p, np.hstack([c, e]))


def _power(evaluator: Evaluator, u: Floats) -> tuple[float, float, Floats]:
    """Power of the applied forces, the sum of its parts' sizes, and the rates of states."""
    s = evaluator.system
    place_state(evaluator.integrated(u), s)
    s.force[:] = 0.0
    _call(evaluator, VALUE, s.force)
    _call(evaluator, WRENCH, s.force)
    parts = s.force[6:] * velocities_of(u)
    _call(evaluator, RATE, np.zeros(0))
    return float(np.sum(parts)), float(np.sum(np.abs(parts))), s.rates.copy()


def _energy(
    evaluator: Evaluator, r: Floats, p: Floats, v: Floats, w: Floats, rates: Floats, h: float
) -> float:
    """The potential energy h seconds later at constant velocities and rates of states."""
    s = evaluator.system
    u = join(*_moved(r, p, v, w, h), v, w)
    place_state(y_from_u(u, states=evaluator.states + h * rates), s)
    value = np.zeros(1)
    _call(evaluator, ENERGY, value)
    return float(value[0])


def _call(evaluator: Evaluator, kind: int, out: Floats) -> None:
    s = evaluator.system
    call_kinds(kind, kind, 0.0, s, evaluator.loops, out, out, out)
