"""States of their own of joints and forces: their places among all, initial values and names."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dap3d_core.interface.codegen.instance_layout import size
from dap3d_core.interface.element_states import INITIAL, TOLERANCE
from dap3d_core.model.groups import Floats, Group, Integers


class ElementState(NamedTuple):
    """A state of an element: "force" or "joint", its name, the state's, first entry and length."""

    kind: str
    element: str
    name: str
    first: int
    length: int

    @property
    def labels(self) -> tuple[str, ...]:
        """Name of each of its numbers: forces.spring.z, or forces.spring.z.1."""
        name = f"{self.kind}s.{self.path}"
        if self.length == 1:
            return (name,)
        return tuple(f"{name}.{k + 1}" for k in range(self.length))

    @property
    def path(self) -> str:
        """The names of element and state: spring.z."""
        return f"{self.element}.{self.name}"

    @property
    def places(self) -> slice:
        """Its numbers among those of all states."""
        return slice(self.first, self.first + self.length)


def paths_where(states: Sequence[ElementState], chosen: NDArray[np.bool_]) -> list[str]:
    """Paths of the states of which a number at least is chosen."""
    return [state.path for state in states if np.any(chosen[state.places])]


def width_of(group: Group) -> int:
    """Numbers of the states of an instance of a group."""
    return group.type_info.layout.state_width


def states_of(
    groups: Sequence[Group], names: Mapping[str, Sequence[str]]
) -> tuple[ElementState, ...]:
    """The states of all groups in their order; names: of the elements of each kind."""
    found: list[ElementState] = []
    start = 0
    for group in groups:
        found += _states_of(group, start, names[group.type_info.type.kind])
        start += width_of(group) * group.count
    return tuple(found)


def _states_of(group: Group, start: int, names: Sequence[str]) -> list[ElementState]:
    """The states of a group whose first number is at ``start`` among all."""
    layout, kind = group.type_info.layout, group.type_info.type.kind
    return [
        ElementState(
            kind, names[int(member)], name, start + k * layout.state_width + at, size(shape)
        )
        for k, member in enumerate(group.members)
        for name, (at, shape) in layout.states.items()
    ]


def field_values(group: Group, suffix: str) -> Floats:
    """(instances, state_width) of the fields ``NAME_0`` or ``NAME_atol``, one for each number."""
    layout = group.type_info.layout
    found = np.zeros((group.count, layout.state_width))
    for name, (at, shape) in layout.states.items():
        offset, given = layout.numbers[f"{name}{suffix}"]
        found[:, at : at + size(shape)] = group.numbers[:, offset : offset + size(given)]
    return found


def initial_values(groups: Sequence[Group]) -> Floats:
    """(states,) the initial values of all, as the fields give them."""
    return _joined(groups, INITIAL)


def tolerances(groups: Sequence[Group]) -> Floats:
    """(states,) absolute tolerances of all; 0 for that of the run."""
    return _joined(groups, TOLERANCE)


def _joined(groups: Sequence[Group], suffix: str) -> Floats:
    parts = [field_values(g, suffix).ravel() for g in groups if g.type_info.layout.states]
    return np.concatenate([np.zeros(0), *parts])


def first_states(groups: Sequence[Group], group: Group) -> Integers:
    """(instances,) index of the first state of each instance of a group.

    The friction of joints has those of the joints.
    """
    starts: dict[int, int] = {}
    start = 0
    for other in groups:
        width = width_of(other)
        places = start + width * np.arange(other.count, dtype=np.int64)
        start += width * other.count
        if other is group:
            return places
        if group.joints is not None and other.type_info.type is group.type_info.type:
            starts |= zip(other.members.tolist(), places.tolist(), strict=True)
    assert group.joints is not None
    return np.array([starts[k] for k in group.joints.tolist()], dtype=np.int64)
