"""Summary of a model: names and constants of bodies, joints and points."""

from functools import cached_property

import attrs
import numpy as np

from dap3d_core.model import Model
from dap3d_core.model.groups import Floats, Integers

#: Separates the name of a contact from the number of one of its points.
POINT = "#"


@attrs.frozen(eq=False)
class ModelSummary:
    """The part of a model that a result and its file hold.

    Attributes:
        body_names, joint_names, point_names: in file order; ground is not among the bodies,
            animation points come last, and points of contacts, which have rows, behind the joints.
        mass: (n,) kg.
        Jp: (n, 3, 3) inertia matrices in body axes, kg m^2.
        joint_rows: (joints,) constraint rows of each joint.
        point_body: (points,) body of each point: 1 to n, 0 for ground.
        point_local: (points, 3) coordinates on that body, m.
        has_potential: True if every force has a potential (which a damper in it may not).
        is_isolated: True if momentum is conserved: no force, and no joint with ground or with a
            single body.
        angle_count: number of angles with counted turns.
        angle_names: of these, as in ``Model.angle_names``; none in files of older programs.
        state_names: (states,) of each number of the elements' states: forces.spring.z, or
            forces.spring.z.1 where there are several.
        input_names: of the inputs, in file order.
    """

    body_names: tuple[str, ...]
    mass: Floats
    Jp: Floats
    joint_names: tuple[str, ...]
    joint_rows: Integers
    point_names: tuple[str, ...]
    point_body: Integers
    point_local: Floats
    has_potential: bool
    is_isolated: bool
    angle_count: int = 0
    angle_names: tuple[str, ...] = ()
    state_names: tuple[str, ...] = ()
    input_names: tuple[str, ...] = ()

    @property
    def body_count(self) -> int:
        """Number of bodies n, ground not counted."""
        return len(self.body_names)

    @property
    def row_count(self) -> int:
        """Number of constraint rows m."""
        return int(self.joint_rows.sum())

    @cached_property
    def joint_start(self) -> Integers:
        """(joints + 1,) first row of each joint."""
        return np.concatenate([[0], np.cumsum(self.joint_rows)]).astype(np.int64)

    @cached_property
    def body_index(self) -> dict[str, int]:
        """Name of a body -> its index."""
        return _index(self.body_names)

    @cached_property
    def point_index(self) -> dict[str, int]:
        """Name of a point -> its index."""
        return _index(self.point_names)

    @cached_property
    def joint_index(self) -> dict[str, int]:
        """Name of a joint -> its index; of joints that are no points of contacts."""
        count = len(self.joint_names) - sum(map(len, self.contacts.values()))
        return _index(self.joint_names[:count])

    @cached_property
    def contacts(self) -> dict[str, list[str]]:
        """Declared contacts, each with the names of its points, in the order of the scene."""
        found: dict[str, list[str]] = {}
        known = set(self.state_names)
        for label in self.state_names:
            kind, name, *state = label.split(".")
            if kind == "joints" and state == ["mode"] and f"joints.{name}.near.1" in known:
                found.setdefault(name.partition(POINT)[0], []).append(name)
        return found

    @property
    def contact_points(self) -> list[str]:
        """Names of the points of all contacts."""
        return [point for points in self.contacts.values() for point in points]


def _index(names: tuple[str, ...]) -> dict[str, int]:
    return {name: k for k, name in enumerate(names)}


def is_summary_of(summary: ModelSummary, model: Model) -> bool:
    """True if arrays of a summary have the layout of a model's bodies and rows."""
    return (
        tuple(model.body_names) == tuple(summary.body_names)
        and tuple(model.joint_names) == tuple(summary.joint_names)
        and np.array_equal(model.joint_rows, summary.joint_rows)
    )


def summary_of(model: Model) -> ModelSummary:
    """The summary of a model."""
    return ModelSummary(
        body_names=model.body_names,
        mass=model.mass,
        Jp=model.Jp,
        joint_names=model.joint_names,
        joint_rows=model.joint_rows,
        point_names=model.point_names,
        point_body=model.point_body,
        point_local=model.point_local,
        has_potential=all("energy" in g.type_info.type.kernels() for g in model.forces),
        is_isolated=not model.forces
        and all(len(slots) > 1 and 0 not in slots for slots in model.joint_slots),
        angle_count=model.angle_count,
        angle_names=model.angle_names,
        state_names=tuple(name for state in model.element_states for name in state.labels),
        input_names=model.input_names,
    )
