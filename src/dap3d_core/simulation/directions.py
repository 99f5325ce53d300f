"""Directions that elements need and that the start of a run leaves undefined."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dap3d_core.interface.fields import FieldSpec, slot_of, specs_of
from dap3d_core.model import Group, Model
from dap3d_core.model.kinematics import rotation, split
from dap3d_core.scene import Mistake, Scene, mistake_at

Floats = NDArray[np.float64]

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
        model: the model.
        u: (13 n,) a state, such as the start of a run.
        size: a length of the model, m.
    """
    found = []
    for table, names, groups in (
        ("joints", model.joint_names, model.joints),
        ("forces", model.force_names, model.forces),
    ):
        for group in groups:
            asking = {
                name: spec
                for name, spec in specs_of(group.examined.type).items()
                if spec.kind in ("vector", "vector2") and (spec.direction or spec.across)
            }
            if not asking:
                continue
            for k, words, remedy in _undefined(asking, group, model, u, size):
                name = names[int(group.members[k])]
                found.append(mistake_at(scene, (table, name), words, remedy))
    return found


def asks_for_directions(model: Model) -> bool:
    """Whether any element needs a direction that a start may leave undefined."""
    specs = (s for g in (*model.joints, *model.forces) for s in specs_of(g.examined.type).values())
    return any(s.kind in ("vector", "vector2") and (s.direction or s.across) for s in specs)


def _undefined(
    asking: dict[str, FieldSpec], group: Group, model: Model, u: Floats, size: float
) -> Iterator[tuple[int, str, str]]:
    """Instances of a group with what is wrong and what to do."""
    r, p, _, _ = split(u, model.body_count)
    r = np.vstack([np.zeros(3), r])
    A = np.concatenate([np.eye(3)[None], rotation(p)])
    for name, spec in asking.items():
        if spec.kind == "vector2":
            ends = [_turned(group, end, A) + r[_bodies(group, end)] for end in ("P_i", "P_j")]
            distance = np.linalg.norm(ends[1] - ends[0], axis=1)
            for k in np.flatnonzero(distance < COINCIDENT * max(size, 1.0)):
                words = (
                    f"its points P_i and P_j coincide at the start (distance {distance[k]:.2g} m), "
                    "so the direction it acts along is undefined"
                )
                yield int(k), words, "give one of the points, or of the bodies, another place"
        else:
            normal = np.cross(_turned(group, name, A), _turned(group, spec.across, A))
            sine = np.linalg.norm(normal, axis=1)
            for k in np.flatnonzero(sine < PARALLEL):
                words = (
                    f"{name} and {spec.across} are parallel at the start, so the angle about "
                    f"{spec.across} is undefined"
                )
                yield int(k), words, f"take a vector across {spec.across} for {name}"


def _turned(group: Group, name: str, A: Floats) -> Floats:
    """(m, 3) global components of a point's arm or a vector."""
    offset, _ = group.examined.layout.numbers[name]
    local = group.numbers[:, offset : offset + 3]
    turned: Floats = np.einsum("mrc,mc->mr", A[_bodies(group, name)], local)
    return turned


def _bodies(group: Group, name: str) -> NDArray[np.int64]:
    """(m,) the bodies that a point or vector of the instances of a group stands on."""
    layout = group.examined.layout
    slot = slot_of(name)
    if slot in layout.slots:
        found: NDArray[np.int64] = group.bodies[:, layout.slots.index(slot)]
    else:
        found = group.functions[:, len(layout.functions) + layout.others.index(name)]
    return found
