"""The contacts of a result."""

from functools import cached_property
from typing import Any

from dap3d_core.registry.arguments import checked
from dap3d_core.result.contact_table import ContactTable
from dap3d_core.result.errors import unknown
from dap3d_core.result.post.contact_output import (
    ContactOutput,
    contact_names,
    contact_outputs,
    contact_table,
    together,
)
from dap3d_core.scene.coerce import canonical


class ResultContacts:
    """What a result says of contacts."""

    @cached_property
    def _points(self) -> dict[str, list[str]]:
        """Names of the points of each contact."""
        result: Any = self
        return contact_names(result.summary.state_names)

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Names of the declared contacts, in the order of the scene."""
        return tuple(self._points)

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
        if not self._points:
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
            ``.force`` (nt, 3) N on body i, global axes; of k points (nt, k) and (nt, k, 3).

        Raises:
            UnknownNameError: there is no such contact; names the nearest.
            ResultError: as ``model``.
        """
        name, every = canonical(name), self._points.values()
        points = self._points.get(name) or [p for of in every for p in of if p == name]
        if not points:
            raise unknown("contact", name, self.contact_names)
        return together([self._contact_outputs[point] for point in points])

    @cached_property
    def _contact_outputs(self) -> dict[str, ContactOutput]:
        result: Any = self
        return contact_outputs(result.evaluator, result.arrays)
