"""Contacts evaluated at reported states: gap, forces, slip and mode."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.model.groups import Floats, Integers
from dap3d_core.registry.arguments import checked
from dap3d_core.result.contact_table import WIDTH, ContactTable
from dap3d_core.result.errors import unknown
from dap3d_core.scene.coerce import canonical

if TYPE_CHECKING:
    from dap3d_core.formulations.evaluator import Evaluator
    from dap3d_core.model import Model
    from dap3d_core.result.arrays import Arrays


@attrs.frozen(eq=False)
class ContactOutput:
    """Output of a contact at nt instants; of k points, with an axis (nt, k) before components.

    What turns, as the limit of an angle or the friction of a hinge, has rad for m and N m for N:
    ``units`` says which. Its ``at`` and ``force`` are zero.

    Attributes:
        gap: (nt,) m, distance of the bodies, zero where they touch.
        normal_force: (nt,) N, not negative; of friction of a joint its load.
        friction: (nt, 3) N, on body i, global axes.
        slip: (nt, 3) m/s, velocity of body i less that of body j at the point of contact, across
            the normal, global axes.
        mode: (nt,) 0 open, 1 slides, 2 sticks.
        at: (nt, 3) m, the point of contact, global axes.
        force: (nt, 3) N, on body i, normal force and friction together, global axes.
        units: of each of these, by its name; "SI" where points of a contact differ.
    """

    gap: Floats
    normal_force: Floats
    friction: Floats
    slip: Floats
    mode: Integers
    at: Floats
    force: Floats
    units: Mapping[str, str]


def units_of(*, turns: bool, alone: bool) -> dict[str, str]:
    """Units of a ``ContactOutput``.

    Args:
        turns: its gap, or its slip, is an angle, or an angular velocity.
        alone: it is friction without a gap, whose normal force is the load of a joint.
    """
    units = {"gap": "m", "normal_force": "N", "friction": "N", "slip": "m/s"}
    if turns:
        units = {"gap": "rad", "normal_force": "N" if alone else "N m", "friction": "N m",
                 "slip": "rad/s"}  # fmt: skip
    return units | {"mode": "1", "at": "m", "force": "N"}


def contact_outputs(evaluator: "Evaluator", arrays: "Arrays") -> dict[str, ContactOutput]:
    """Outputs of all points of contacts of a model, by their names."""
    from dap3d_core.formulations.contacts import contact_table as rows

    table = rows.ContactTable(evaluator)
    t, u, states = arrays.t, arrays.u, arrays.states
    values = np.zeros((len(t), table.count, rows.WIDTH))
    with evaluator.held_inputs():
        before = evaluator.states
        for k, time in enumerate(t):
            evaluator.states = states[k]
            evaluator.set_inputs(arrays.inputs[k])
            if evaluator.has_own_angles:
                evaluator.begin_turns(float(time), u[k], arrays.angles[k])
            values[k] = table.outputs(float(time), u[k], arrays.Lam[k])
        evaluator.states = before
    modes: Any = states[:, table.mode]
    unknown = ~np.isfinite(modes)  # at an instant of which the state of bodies is known alone
    for first, end in ((rows.NORMAL, rows.SLIP), (rows.FORCE, rows.WIDTH)):
        values[unknown, first:end] = np.nan
    modes = modes if unknown.any() else modes.astype(np.int64)

    def part(k: int, first: int) -> Floats:
        return values[:, k, first : first + 3]

    return {
        name: ContactOutput(
            gap=values[:, k, rows.GAP], normal_force=values[:, k, rows.NORMAL],
            friction=part(k, rows.FRICTION), slip=part(k, rows.SLIP),
            mode=modes[:, k], at=part(k, rows.PLACE), force=part(k, rows.FORCE),
            units=units_of(turns=bool(table.turns[k]), alone=bool(table.alone[k])),
        )
        for k, name in enumerate(table.names)
    }  # fmt: skip


def contact_table(model: "Model", t: Floats, outputs: Mapping[str, ContactOutput]) -> ContactTable:
    """The table of declared contacts that push at a point, with bodies in place of shapes.

    Args:
        model: of the result.
        t: (nt,) the reported instants.
        outputs: of all points of contacts, as of ``contact_outputs``.
    """
    rows = [np.zeros((0, WIDTH))]
    for group in model.contacts:
        type_: Any = group.type_info.type
        for k in group.members if type_.at is not None and type_.along is None else ():
            one = outputs[model.joint_names[k]]
            pushes = (np.nan_to_num(one.mode) > 0) & (one.normal_force > 0.0)
            N = one.normal_force[pushes, None]
            pair = (*model.joint_slots[k], 0)[:2]  # what names one body touches ground
            normal = (one.force - one.friction)[pushes] / N
            rows.append(np.column_stack([
                t[pushes], np.tile(pair, (len(N), 1)), one.mode[pushes], one.gap[pushes],
                one.at[pushes], normal, one.force[pushes],
            ]))  # fmt: skip
    found = np.concatenate(rows)
    order = np.argsort(found[:, 0], kind="stable")
    return ContactTable.of_rows(("ground", *model.body_names), found[order])


def together(outputs: Sequence[ContactOutput]) -> ContactOutput:
    """The output of a contact with several points; of one that of the point."""
    if len(outputs) == 1:
        return outputs[0]
    units = [one.units for one in outputs]
    shared = {n: u if all(each[n] == u for each in units) else "SI" for n, u in units[0].items()}
    columns = {n: np.stack([getattr(one, n) for one in outputs], axis=1) for n in shared}
    return ContactOutput(**columns, units=shared)


class ResultContacts:
    """What a result says of contacts."""

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Names of the declared contacts, in the order of the scene."""
        result: Any = self
        return tuple(result.summary.contacts)

    @cached_property
    def contacts(self) -> ContactTable:
        """Points at which bodies push on each other, at the reported instants.

        Of shapes that collide at those after the start; of declared contacts, with bodies in place
        of shapes.

        Raises:
            ResultError: as ``model``, where there are declared contacts.
        """
        result: Any = self
        table: ContactTable = result.record.contacts.at(result.t)
        if not self.contact_names:
            return table
        return table.joined(contact_table(result.model, result.t, self._contact_outputs))

    @checked
    def contact(self, name: str) -> ContactOutput:
        """A contact, evaluated at the reported states.

        Args:
            name: of a contact; of one with several points, ``NAME#1`` is the first alone.

        Returns:
            ``.gap`` (nt,) m, ``.normal_force`` (nt,) N, ``.friction`` (nt, 3) N on body i,
            ``.slip`` (nt, 3) m/s, ``.mode`` (nt,) 0 open, 1 slides, 2 sticks, ``.at`` (nt, 3) m,
            ``.force`` (nt, 3) N on body i, global axes; of k points (nt, k) and (nt, k, 3). Of what
            turns gap, slip and moments are in rad, rad/s and N m: ``.units`` has the unit of each.

        Raises:
            UnknownNameError: there is no such contact; names the nearest.
            ResultError: as ``model``.
        """
        result: Any = self
        summary, name = result.summary, canonical(name)
        points = summary.contacts.get(name) or [p for p in summary.contact_points if p == name]
        if not points:
            raise unknown("contact", name, self.contact_names)
        return together([self._contact_outputs[point] for point in points])

    @cached_property
    def _contact_outputs(self) -> dict[str, ContactOutput]:
        result: Any = self
        return contact_outputs(result.evaluator, result.arrays)
