"""Directions that elements need and that the start of a run leaves undefined."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from dap3d_core.interface.fields import FieldSpec, slot_of, specs_of
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Group, Model
from dap3d_core.model.rotations import rotation
from dap3d_core.model.state_layout import split
from dap3d_core.scene import Mistake, Scene, mistake_at

#: Points nearer to each other than this, in m, or as a part of the model's size, coincide: what is
#: left of their distance is rounding.
COINCIDENT = 1e-12
#: Sine of the angle below which two unit vectors are parallel.
PARALLEL = 1e-9


def undefined_directions(scene: Scene, model: Model, u: Floats, size: float) -> list[Mistake]:
    """A mistake for each element whose points coincide, or whose vectors are parallel.

    Only fields that ask for it are looked at (``direction``, ``across`` in interface/fields.py).

    Args:
        scene: for the places of the mistakes.
        u: (13 n,) a state, such as the start of a run.
        size: a length of the model, m.
    """
    found = []
    r, A = _frames(u, model.body_count)
    for group, fields in _asking(model):
        table, names = "joints", model.joint_names
        if group.type_info.type.kind == "force":
            table, names = "forces", model.force_names
        for name, spec in fields.items():
            measure, least = _measured(group, name, spec, group.numbers, r, A, size)
            for k in np.flatnonzero(measure < least):
                words, remedy = _words(name, spec, float(measure[k]))
                owner = names[int(group.members[k])]
                found.append(mistake_at(scene, (table, owner), words, remedy))
    return found


def are_undefined(
    model: Model, u: Floats, numbers_of: Callable[[Group], Floats], size: float
) -> NDArray[np.bool_]:
    """At which of k states u (k, 13 n) a direction is undefined.

    Args:
        model, size: as above.
        numbers_of: (k, m, par_width) the numbers of a group at each of them.
    """
    undefined = np.zeros(len(u), dtype=bool)
    r, A = _frames(u, model.body_count)
    for group, fields in _asking(model):
        numbers = numbers_of(group)
        for name, spec in fields.items():
            measure, least = _measured(group, name, spec, numbers, r, A, size)
            undefined |= np.any(measure < least, axis=-1)
    return undefined


def _asking(model: Model) -> Iterator[tuple[Group, dict[str, FieldSpec]]]:
    """Groups with the fields that ask for a direction."""
    for group in (*model.joints, *model.forces):
        asking = {
            name: spec
            for name, spec in specs_of(group.type_info.type).items()
            if spec.kind in ("vector", "vector2") and (spec.direction or spec.across)
        }
        if asking:
            yield group, asking


def _frames(u: Floats, n: int) -> tuple[Floats, Floats]:
    """R (..., n + 1, 3) and A (..., n + 1, 3, 3) of states (..., 13 n), ground first."""
    r, p, _, _ = split(u)
    ground = np.zeros((*r.shape[:-2], 1, 3))
    axes = np.broadcast_to(np.eye(3), (*r.shape[:-2], 1, 3, 3))
    return np.concatenate([ground, r], axis=-2), np.concatenate([axes, rotation(p)], axis=-3)


def _measured(
    group: Group, name: str, spec: FieldSpec, numbers: Floats, r: Floats, A: Floats, size: float
) -> tuple[Floats, float]:
    """Distance of two points, or sine between two vectors, (..., m), and the least that will do."""
    if spec.kind == "vector2":
        start, end = (
            _turned(group, end, numbers, A) + r[..., _bodies(group, end), :]
            for end in ("P_i", "P_j")
        )
        distance = np.linalg.norm(end - start, axis=-1)
        needed = _is_needed(group, spec, numbers)
        return np.where(needed, distance, np.inf), COINCIDENT * max(size, 1.0)
    one, other = (_turned(group, vector, numbers, A) for vector in (name, spec.across))
    return np.linalg.norm(np.cross(one, other), axis=-1), PARALLEL


def _is_needed(group: Group, spec: FieldSpec, numbers: Floats) -> NDArray[np.bool_]:
    """(..., m) where the direction of a vector between points matters."""
    layout = group.type_info.layout
    fields = spec.direction if isinstance(spec.direction, tuple) else ()
    functions = group.type_info.argument_functions if group.type_info.given else ()
    always = not fields or any(name in functions for name in fields)
    needed = np.full(numbers.shape[:-1], always)
    for name in fields:
        if name in layout.numbers:
            needed |= numbers[..., layout.numbers[name][0]] != 0.0
    return needed


def _words(name: str, spec: FieldSpec, measure: float) -> tuple[str, str]:
    """Message with fault and remedy."""
    if spec.kind == "vector2":
        return (
            f"its points P_i and P_j coincide at the start (distance {measure:.2g} m), "
            "so the direction it acts along is undefined",
            "give one of the points, or of the bodies, another place" + _zeros(spec),
        )
    return (
        f"{name} and {spec.across} are parallel at the start, so the angle about "
        f"{spec.across} is undefined",
        f"take a vector across {spec.across} for {name}",
    )


def _zeros(spec: FieldSpec) -> str:
    """Remedy of an element that needs no direction without some of its fields."""
    if not isinstance(spec.direction, tuple):
        return ""
    return f"; without {', '.join(spec.direction)} none is needed"


def _turned(group: Group, name: str, numbers: Floats, A: Floats) -> Floats:
    """(..., m, 3) a point or vector of the instances of a group, in global axes."""
    offset, _ = group.type_info.layout.numbers[name]
    local = numbers[..., offset : offset + 3]
    return np.einsum("...mrc,...mc->...mr", A[..., _bodies(group, name), :, :], local)


def _bodies(group: Group, name: str) -> NDArray[np.int64]:
    """(m,) the bodies of a point or vector of the instances of a group."""
    layout = group.type_info.layout
    slot = slot_of(name)
    if slot in layout.slots:
        found: NDArray[np.int64] = group.bodies[:, layout.slots.index(slot)]
    else:
        found = group.functions[:, len(layout.functions) + layout.others.index(name)]
    return found
