"""A scene for any registered type, its fields filled at random by what they declare."""

import numpy as np

from dap3d_core.interface.fields import slot_of, specs_of
from dap3d_core.model.kinematics import rotation
from dap3d_core.scene import Scene


def scene_for(examined, rng, *, ground=None):
    """A scene of three bodies with one element of a type; slot ``ground`` is put on ground.

    Args:
        examined: the type.
        rng: numpy generator.
        ground: "j" to tie slot j to ground, or None.
    """
    scene = Scene(name="contract")
    owner = {"i": "b1", "j": "b2", "k": "b3"}
    for name in owner.values():
        L = rng.uniform(-0.3, 0.3, (3, 3))
        J = L @ L.T + 0.5 * np.eye(3)
        p = rng.normal(size=4)
        p = p / (p @ p) ** 0.5
        scene.add_body(name, mass=rng.uniform(0.5, 2.0), Jp=J, r=rng.uniform(-1, 1, 3), p=p)
    if ground:
        owner[ground] = "ground"
    fields = {}
    for name, spec in specs_of(examined.type).items():
        value = _field(scene, name, spec, owner, rng)
        if value is not None:
            fields[name] = value
    for name, spec in specs_of(examined.type).items():
        if spec.kind == "vector2":
            del fields[name]
            for end in ("P_i", "P_j"):
                fields[end] = scene.add_point(end, owner[end[-1]], rng.uniform(-1, 1, 3))
    getattr(scene, f"add_{examined.type.kind}")(examined.type.keyword, "element", **fields)
    return scene


def _field(scene, name, spec, owner, rng):
    body = owner.get(slot_of(name) or "", "b1")
    if spec.kind == "point":
        return scene.add_point(name, body, rng.uniform(-1, 1, 3))
    if spec.kind == "vector":
        return scene.add_vector(name, body, rng.normal(size=3))
    if spec.kind == "body":
        return body
    if spec.kind == "number":
        low = max(spec.minimum if spec.minimum is not None else 0.0, 0.0)
        value = low + rng.uniform(0.5, 1.5)
        return min(value, spec.maximum) if spec.maximum is not None else value
    if spec.kind == "vec3":
        return rng.uniform(-1, 1, 3)
    if spec.kind == "matrix":
        return rotation(rng.normal(size=4))
    if spec.kind == "function":
        return scene.add_function("a", f"{name}_of_time", coeff=rng.uniform(-1, 1, 3))
    if spec.kind == "choice":
        return spec.choices[0]
    return "vector2"
