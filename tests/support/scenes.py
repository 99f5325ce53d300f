"""A scene for any registered type, its fields filled at random by what they declare."""

import numpy as np

import dap3d_core as dap
from support.internals import own_values, slot_of, specs_of
from support.rotations import rotation


def cases(registry, kind):
    """(keyword, values of fields) for each type of a kind as it is, and for each of its variants.
    A type whose variants leave no place for itself is there by its variants alone."""
    found = []
    for row in registry.listing():
        if row.kind == kind and row.state == "ok":
            type_info = registry.get(kind, row.keyword)
            own = own_values(type_info)
            found += [] if own is None else [(row.keyword, own)]
            found += [(row.keyword, dict(conditions)) for conditions, _ in type_info.variants]
    return found


def case_names(found):
    """Names of cases for reports: ``disk[slip=nz]``."""
    return [f"{k}{[f'{n}={v}' for n, v in values.items()] or ''}" for k, values in found]


def scene_for(type_info, rng, *, ground=None, values=None):
    """A scene of three bodies with one element of a type; slot ``ground`` is put on ground.

    Args:
        examined: the type.
        rng: numpy generator.
        ground: "j" to tie slot j to ground, or None.
        values: of choices, and whether functions are given, for a variant of the type.
    """
    values = values or {}
    scene = dap.Scene(name="contract")
    owner = {"i": "b1", "j": "b2", "k": "b3"}
    for name in owner.values():
        L = rng.uniform(-0.3, 0.3, (3, 3))
        J = L @ L.T + 0.5 * np.eye(3)
        p = rng.normal(size=4)
        p = p / (p @ p) ** 0.5
        scene.add_body(name, mass=rng.uniform(0.5, 2.0), Jp=J, r=rng.uniform(-1, 1, 3), p=p)
    if ground:
        owner[ground] = "ground"
    fields, sample = {}, next(iter(type_info.type.samples), {})
    specs = specs_of(type_info.type)
    chosen = [n for n, s in specs.items() if s.instead_of and values.get(n)]
    replaced = {other for n in chosen for other in specs[n].instead_of}
    replaced |= {n for n, s in specs.items() if s.by_name and s.instead_of and n not in chosen}
    for name, spec in specs.items():
        if name in replaced:
            continue
        value = _field(scene, name, spec, owner, rng, values.get(name), sample)
        if value is not None:
            fields[name] = value
    for low in [name for name in fields if name.endswith("_min")]:
        ends = [end for end in (low, f"{low[:-3]}max") if end in fields]
        fields |= zip(ends, sorted(fields[end] for end in ends), strict=True)
    for name, spec in specs_of(type_info.type).items():
        if spec.kind == "vector2":
            del fields[name]
            for end in ("P_i", "P_j"):
                fields[end] = scene.add_point(end, owner[end[-1]], rng.uniform(-1, 1, 3))
    if type_info.layout.unknowns:  # off a bent curve the rows that remain turn: no rates of C
        for function in scene.functions.values():
            function.fields["coeff"] = [*function.fields["coeff"][:2], 0.0]
    kind = "contact" if type_info.type.is_contact else type_info.type.kind
    getattr(scene, f"add_{kind}")(type_info.type.keyword, "element", **fields)
    return scene


def _list(scene, name, spec, owner, rng, sample):
    """Three entries on different bodies; small numbers, such as radii; or those of a sample."""
    on = list(owner.values())
    if sample and spec.kind == "numbers":
        return list(sample[name]) if name in sample else None
    if sample:
        on = [on[k] for k in sample.get(name, ())]
    if spec.kind == "points":
        return [scene.add_point(f"{name}_{k}", b, rng.uniform(-1, 1, 3)) for k, b in enumerate(on)]
    if spec.kind == "vectors":
        return [scene.add_vector(f"{name}_{b}", b, rng.normal(size=3)) for b in on]
    if spec.kind == "bodies":
        return on
    return rng.uniform(0.05, 0.1, len(on)) if spec.required else None


def _field(scene, name, spec, owner, rng, wanted, sample):
    if not spec.given or spec.kind == "joint_fields":
        return None
    if spec.size:
        return _list(scene, name, spec, owner, rng, sample)
    body = owner.get(slot_of(name) or "", "b1")
    if spec.kind == "point":
        return scene.add_point(name, body, rng.uniform(-1, 1, 3))
    if spec.kind == "vector" and spec.ground:
        return scene.add_vector(name, "ground", rng.normal(size=3))
    if spec.kind == "vector":
        return scene.add_vector(name, body, rng.normal(size=3))
    if spec.kind == "body":
        return body
    if spec.kind == "number":
        low = max(spec.minimum if spec.minimum is not None else 0.0, 0.0)
        value = low + rng.uniform(0.5, 1.5)
        value = min(value, spec.maximum) if spec.maximum is not None else value
        return float(np.ceil(value)) if spec.whole else value
    if spec.kind == "vec3":
        return rng.uniform(-1, 1, 3)
    if spec.kind == "numbers":
        return rng.uniform(-1, 1, spec.columns)
    if spec.kind == "square":
        return rng.uniform(0.5, 1.5, spec.columns)
    if spec.kind == "matrix":
        return rotation(rng.normal(size=4))
    if spec.by_rows:
        return np.pad(rng.uniform(-1, 1, (7, 7)), (0, 1), mode="wrap")
    if spec.kind == "table":  # increasing: a table of arguments is one
        return np.cumsum(rng.uniform(0.1, 0.5, 8))
    if spec.kind == "function" and (
        wanted is False or (spec.argument and not wanted and not spec.required)
    ):
        return None
    if spec.kind == "functions":
        return [
            scene.add_function("a", f"{name}{k}", coeff=rng.uniform(-1, 1, 3)) for k in range(3)
        ]
    if spec.kind == "input":
        return scene.add_input(name, rng.uniform(-1, 1)) if wanted or spec.required else None
    if spec.kind == "function" and spec.arguments > 1:
        places, values = [-1.0, 0.0, 1.0], rng.uniform(-1, 1, (3, 3))
        return scene.add_function("grid", f"{name}_of_two", x=places, y=places, z=values)
    if spec.kind == "function":
        return scene.add_function("a", f"{name}_of_time", coeff=rng.uniform(-1, 1, 3))
    if spec.kind == "choice" and wanted is None and not spec.required and spec.default is None:
        return None
    if spec.kind == "choice":
        return spec.choices[0] if wanted is None else wanted
    return "vector2"
