"""Several copies of a model side by side as one model, which takes one step for all of them.

A small scene leaves much of a processor idle: loops over one body, sums over fourteen components.
Loops over the bodies of many copies keep its vector units at work (docs/concepts/studies.md says
what it gives). The copies share their steps, which are as short as the worst of them needs.
"""

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.formulations.evaluator import Machine
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH
from dap3d_core.model import Group, Model
from dap3d_core.model.state_layout import coordinates_of, velocities_of

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

METRIC_WIDTH = 16


def packed(model: Model, count: int) -> Model:
    """A model of ``count`` copies: bodies, joints, forces, functions of one behind the other's."""
    lanes = range(count)
    tile = np.tile
    return attrs.evolve(
        model,
        body_names=_names(model.body_names, count),
        mass=tile(model.mass, count),
        Jp=tile(model.Jp, (count, 1, 1)),
        r=tile(model.r, (count, 1)),
        p=tile(model.p, (count, 1)),
        v=tile(model.v, (count, 1)),
        w=tile(model.w, (count, 1)),
        joint_names=_names(model.joint_names, count),
        force_names=_names(model.force_names, count),
        function_names=_names(model.function_names, count),
        joint_rows=tile(model.joint_rows, count),
        joint_start=np.concatenate([[0], np.cumsum(tile(model.joint_rows, count))]),
        joint_slots=tuple(
            tuple(b + lane * model.body_count if b else 0 for b in slots)
            for lane in lanes
            for slots in model.joint_slots
        ),
        position_row=tile(model.position_row, count),
        joints=tuple(_copies(g, model, count) for g in model.joints),
        forces=tuple(_copies(g, model, count) for g in model.forces),
        functions=tuple(_copies(g, model, count) for g in model.functions),
        friction=tuple(_copies(g, model, count) for g in model.friction),
        function_count=count * model.function_count,
        point_names=(),
        point_body=model.point_body[:0],
        point_local=model.point_local[:0],
        notes=(),
    )


def _names(names: tuple[str, ...], count: int) -> tuple[str, ...]:
    return tuple(f"{name} [{lane + 1}]" for lane in range(count) for name in names)


def _copies(group: Group, model: Model, count: int) -> Group:
    """A group with the instances of all copies, those of one behind the other's."""
    kind, n, m = group.examined.type.kind, model.body_count, group.count
    elements = {
        "joint": len(model.joint_names),
        "force": len(model.force_names),
        "function": model.function_count,
    }
    rubs = group.joints is not None
    members = elements["force"] if rubs else elements[kind]
    functions = len(group.examined.layout.functions)
    bodies, integers = [], []
    for lane in range(count):
        bodies.append(np.where(group.bodies > 0, group.bodies + lane * n, 0))
        own = group.functions.copy()
        shift = np.full(own.shape[1], lane * n)
        shift[:functions] = lane * model.function_count
        integers.append(np.where(own > 0, own + shift, 0))
    return attrs.evolve(
        group,
        members=_shifted(group.members, members, count),
        joints=_shifted(group.joints, elements["joint"], count) if rubs else None,
        bodies=np.concatenate(bodies),
        functions=np.concatenate(integers),
        numbers=np.tile(group.numbers, (count, 1)),
        tables=tuple(
            (k + lane * m, offset, rows)
            for lane in range(count)
            for k, offset, rows in group.tables
        ),
    )


def _shifted(places: Integers | None, by: int, count: int) -> Integers:
    assert places is not None
    found: Integers = (places[None] + by * np.arange(count)[:, None]).ravel()
    return found


class Lanes:
    """Where the numbers and the state of each copy stand in a machine of many."""

    def __init__(self, one: Machine, many: Machine, count: int) -> None:
        """Args: a machine of the model, one of ``packed(model, count)``, how many copies."""
        self.count = count
        self._n = one.model.body_count
        self._row, self._row_of_many = one.model.row_layout, many.model.row_layout
        self._angles = [g.count * len(g.examined.layout.angles) for g in one.model.acting]
        self._par = _places_of_par(one, many, count)
        self._sizes = (one.system.par.size, one.system.body.size)
        self._first = (many.system.par.size, many.system.par.size + many.system.body.size)

    def places(self, places: Integers) -> Integers:
        """(count, w) places in the machine of many of places (w,) in that of one.

        Both count par, body and metric one behind the other.
        """
        par, body = self._sizes
        found = np.empty((self.count, len(places)), dtype=np.int64)
        lanes = np.arange(self.count)[:, None]
        in_par, in_metric = places < par, places >= par + body
        in_body = ~in_par & ~in_metric
        found[:, in_par] = self._par[:, places[in_par]]
        step = lanes * self._n
        found[:, in_body] = self._first[0] + places[in_body] - par + step * BODY_WIDTH
        found[:, in_metric] = self._first[1] + places[in_metric] - par - body + step * METRIC_WIDTH
        return found

    def join(self, states: Floats) -> Floats:
        """(k, 13 n count + 1) one integrated state of all, of (k, count, 13 n + 1)."""
        k, parts = len(states), (coordinates_of(states), velocities_of(states))
        work = np.zeros((k, 1))
        return np.hstack([*(part.reshape(k, self.count * part.shape[-1]) for part in parts), work])

    def rows_of(self, rows: Floats) -> Floats:
        """(k, count, nt, width) rows of the single copies, of (k, nt, width of many).

        Work, potential energy and residuals, which all share, are NaN.
        """
        k, nt, _ = rows.shape
        count, one, many = self.count, self._row, self._row_of_many
        out = np.full((k, count, nt, one.size), np.nan)
        out[..., one["t"]] = rows[:, None, :, many["t"]]
        for name in ("coordinates", "velocities", "v_dot", "Lam"):
            part = rows[..., many[name]].reshape(k, nt, count, one.length(name))
            out[..., one[name]] = part.transpose(0, 2, 1, 3)
        source, target = many["angles"].start, one["angles"].start
        for width in self._angles:
            part = rows[:, :, source : source + width * count].reshape(k, nt, count, width)
            out[..., target : target + width] = part.transpose(0, 2, 1, 3)
            source, target = source + width * count, target + width
        return out


def _places_of_par(one: Machine, many: Machine, count: int) -> Integers:
    """(count, par) the place in the machine of many of each number of par."""
    found = np.full((count, one.system.par.size), -1, dtype=np.int64)
    for q, (_, group) in enumerate(one.what):
        first, first_of_many = (int(m.system.groups[q, 1]) for m in (one, many))
        size = group.numbers.size
        own = np.arange(size)
        found[:, first : first + size] = first_of_many + own + size * np.arange(count)[:, None]
    return found
