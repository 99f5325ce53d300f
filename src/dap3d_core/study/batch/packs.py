"""Runs several points at a time, as one model of copies that share their steps.

A small scene leaves much of a processor idle: loops over one body, sums over fourteen components.
Loops over the bodies of many copies use its vector units (docs/concepts/studies.md has figures).
Steps are as short as the worst copy needs.
"""

from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.assembly.turns import CONSTANT_WIDTH, CONSTANTS, STATE, STATE_WIDTH
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH
from dap3d_core.model import Group, Model
from dap3d_core.model.groups import Floats, Integers
from dap3d_core.model.state_layout import bodies_of, coordinates_of, velocities_of
from dap3d_core.simulation import CompiledModel
from dap3d_core.study.batch.compiled_batch import BatchRows, CompiledBatch
from dap3d_core.study.batch.parameter_map import METRIC_WIDTH


class PackedBatch:
    """Runs points of one model, ``count`` at a time. Not for two threads at once."""

    def __init__(self, compiled: CompiledModel, one: Evaluator, times: Floats, count: int) -> None:
        """Args: the model, an evaluator of it, reporting times, points at a time."""
        many = Evaluator(packed(compiled.model, count), compiled.method)
        self._lanes = LaneLayout(one, many, count)
        stops = compiled.breakpoints(float(times[-1])).stops
        self._batch = CompiledBatch(many, compiled.scene.simulation, times, stops)
        self._shape = len(times), one.model.row_layout["inputs"].start
        self.count = count

    def run(self, table: Floats, places: Integers, y0: Floats) -> BatchRows:
        """As ``CompiledBatch.run``, uncorrected; points that fill no pack are not done."""
        count, total = self.count, len(table)
        packs = total // count
        used = packs * count
        joined = table[:used].reshape(packs, count * table.shape[1])
        states = self._lanes.join(y0[:used].reshape(packs, count, y0.shape[1]))
        packed_rows = self._batch.run(joined, self._lanes.places(places).ravel(), states)
        rows = np.empty((total, *self._shape))
        rows[:used] = self._lanes.rows_of(packed_rows.rows).reshape(used, *self._shape)
        done = np.zeros(total, dtype=bool)
        done[:used] = np.repeat(packed_rows.done, count)
        return BatchRows(done, rows, y0, y0, np.zeros((total, packed_rows.diagnostics.shape[1])))


def packed(model: Model, count: int) -> Model:
    """A model of ``count`` copies: their bodies, joints, forces, functions one after another."""

    def tiled(values: NDArray[Any]) -> NDArray[Any]:
        return np.tile(values, (count, *(1,) * (values.ndim - 1)))

    def names(values: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(f"{name} [{lane + 1}]" for lane in range(count) for name in values)

    arrays = ("mass", "Jp", "r", "p", "v", "w", "joint_rows", "position_row")
    changed: dict[str, Any] = {name: tiled(getattr(model, name)) for name in arrays}
    for name in ("joints", "forces", "functions", "friction"):
        changed[name] = tuple(_copies(group, model, count) for group in getattr(model, name))
    return attrs.evolve(
        model,
        body_names=names(model.body_names),
        joint_names=names(model.joint_names),
        force_names=names(model.force_names),
        function_names=names(model.function_names),
        joint_start=np.concatenate([[0], np.cumsum(np.tile(model.joint_rows, count))]),
        joint_slots=tuple(
            tuple(b + lane * model.body_count if b else 0 for b in slots)
            for lane in range(count)
            for slots in model.joint_slots
        ),
        function_count=count * model.function_count,
        input_rows=(model.input_rows + model.function_count * np.arange(count)[:, None]).ravel(),
        input_values=tiled(model.input_values),
        point_names=(),
        point_body=model.point_body[:0],
        point_local=model.point_local[:0],
        notes=(),
        motions=None,
        joint_angles=None,
        **changed,
    )


def _copies(group: Group, model: Model, count: int) -> Group:
    """A group with the instances of all copies, those of one after another."""
    kind, n, m = group.type_info.type.kind, model.body_count, group.count
    sizes = {
        "joint": len(model.joint_names),
        "force": len(model.force_names),
        "function": model.function_count,
    }
    lanes = np.arange(count)[:, None]
    joints = group.joints  # of friction
    members = group.members + sizes[kind if joints is None else "force"] * lanes
    shift = np.full(group.functions.shape[1], n)
    shift[: len(group.type_info.layout.functions)] = model.function_count
    bodies, functions = group.bodies[None], group.functions[None]
    return attrs.evolve(
        group,
        members=members.ravel(),
        joints=None if joints is None else (joints + sizes["joint"] * lanes).ravel(),
        bodies=np.concatenate(np.where(bodies > 0, bodies + n * lanes[..., None], 0)),
        functions=np.concatenate(np.where(functions > 0, functions + shift * lanes[..., None], 0)),
        numbers=np.tile(group.numbers, (count, 1)),
        read=tuple(_copies(read, model, count) for read in group.read),
        tables=tuple(
            (k + lane * m, offset, rows)
            for lane in range(count)
            for k, offset, rows in group.tables
        ),
    )


class LaneLayout:
    """Indices of the numbers and of the state of each copy in an evaluator of many."""

    def __init__(self, one: Evaluator, many: Evaluator, count: int) -> None:
        """Args: an evaluator of the model, one of ``packed(model, count)``, number of copies."""
        self.count = count
        self._n = one.model.body_count
        self._row, self._row_of_many = one.model.row_layout, many.model.row_layout
        self._n_states = one.model.state_count
        widths = [g.count * g.type_info.layout.state_width for g in one.model.acting]
        self._states = [width for width in widths if width]
        own = [g.count * len(g.type_info.layout.angles) for g in one.model.acting]
        self._angles = [*own, one.model.joint_angle_count]
        self._par = np.full((count, one.system.par.size), -1, dtype=np.int64)
        for q, (_, group) in enumerate(one.loop_groups):
            first, first_of_many = (int(m.system.groups[q, 1]) for m in (one, many))
            size = group.numbers.size
            lanes = size * np.arange(count)[:, None]
            self._par[:, first : first + size] = first_of_many + np.arange(size) + lanes
        for column, width in ((STATE, STATE_WIDTH), (CONSTANTS, CONSTANT_WIDTH)):
            size = width * len(one.system.turns)
            if size:
                first, first_of_many = (int(m.system.turns[0, column]) for m in (one, many))
                lanes = size * np.arange(count)[:, None]
                self._par[:, first : first + size] = first_of_many + np.arange(size) + lanes
        self._sizes = (one.system.par.size, one.system.body.size)
        self._first = (many.system.par.size, many.system.par.size + many.system.body.size)

    def places(self, places: Integers) -> Integers:
        """(count, w) indices in the evaluator of many of indices (w,) in that of one.

        Both are in par, body and metric, concatenated.
        """
        par, body = self._sizes
        lanes = np.arange(self.count)[:, None] * self._n
        in_par = self._par[:, np.minimum(places, par - 1)] if par else -1
        in_body = self._first[0] + places - par + lanes * BODY_WIDTH
        in_metric = self._first[1] + places - par - body + lanes * METRIC_WIDTH
        return np.where(places < par, in_par, np.where(places < par + body, in_body, in_metric))

    def join(self, states: Floats) -> Floats:
        """(k, ...) one integrated state of all, of (k, count, ...) of the single copies."""
        k, bodies = len(states), bodies_of(states, self._n_states)
        parts = [coordinates_of(bodies), velocities_of(bodies)]
        first = bodies.shape[-1]
        for width in self._states:
            parts.append(states[..., first : first + width])
            first += width
        work = np.zeros((k, 1))
        return np.hstack([*(part.reshape(k, self.count * part.shape[-1]) for part in parts), work])

    def rows_of(self, rows: Floats) -> Floats:
        """(k, count, nt, width) rows of the single copies, of (k, nt, width of many).

        Work, potential energy and residuals, which all share, are NaN.
        """
        k, nt, _ = rows.shape
        count, one, many = self.count, self._row, self._row_of_many
        out = np.full((k, count, nt, one["inputs"].start), np.nan)
        out[..., one["t"]] = rows[:, None, :, many["t"]]
        for name in ("coordinates", "velocities", "v_dot", "Lam"):
            part = rows[..., many[name]].reshape(k, nt, count, one.length(name))
            out[..., one[name]] = part.transpose(0, 2, 1, 3)
        for name, widths in (("angles", self._angles), ("states", self._states)):
            source, target = many[name].start, one[name].start
            for width in widths:
                part = rows[:, :, source : source + width * count].reshape(k, nt, count, width)
                out[..., target : target + width] = part.transpose(0, 2, 1, 3)
                source, target = source + width * count, target + width
        return out
