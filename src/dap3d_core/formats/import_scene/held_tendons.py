"""Equalities of tendons: links between two points, sums of coordinates that stay."""

from collections.abc import Mapping
from typing import Any

from dap3d_core.formats.import_scene.actuators import line_of
from dap3d_core.formats.import_scene.joints import add_wheel, light
from dap3d_core.formats.import_scene.scene_builder import SceneBuilder
from dap3d_core.formats.import_scene.start import AGREE
from dap3d_core.interface.formats.articulation import Articulation, Tendon


def add_held(builder: SceneBuilder, model: Articulation) -> None:
    """Add links between two points, and sums of coordinates that stay as they are."""
    for tendon in model.held:
        keyword, fields = line_of(builder, model, tendon) or ("", {})
        if keyword == "ptp":
            name = builder.names.free("joints", tendon.name)
            ends = dict(zip(("P_i", "P_j"), fields["points"], strict=True))
            builder.scene.add_joint("sph-sph", name, **ends, length=tendon.rest)
        elif keyword == "tendon":
            name = builder.names.free("joints", tendon.name)
            builder.scene.add_joint("tendon", name, **fields, length=tendon.rest)
        elif keyword and len(fields["movers"]) > 1:
            _hold_sum(builder, model, tendon, fields)
        else:
            text = "an equality of a tendon that moves with one joint at most"
            builder.remarks.leave_out(tendon.place, text, motion=True)


def _hold_sum(
    builder: SceneBuilder, model: Articulation, tendon: Tendon, fields: Mapping[str, Any]
) -> None:
    """Hold a sum: wheels turn by a term, or by the sum up to there, and ground by the whole."""
    joints = [model.joints[name] for name, _ in tendon.terms if model.joints[name].kind != "fixed"]
    at_start = sum(c * (*model.joints[name].position, 0.0)[0] for name, c in tendon.terms)
    if abs(at_start - (tendon.rest or 0.0)) > AGREE:
        text = "an equality of a tendon holds the length that it has where the scene starts"
        builder.remarks.translate(tendon.place, text, motion=True)
    text = "sums of joints are held by wheels on ground, with a millionth of the inertia"
    builder.remarks.translate(tendon.place, text)
    size, names = light(builder, *joints), builder.names
    scale = max(abs(c) for c in fields["coefs"])
    columns = [fields[key] for key in ("movers", "axes", "coefs", "slides")]
    total, count = "ground", len(fields["movers"])
    for k, (mover, axis, coef, slides) in enumerate(zip(*columns, strict=True), 1):
        wheel = names.free("bodies", f"{tendon.name}_term{k}")
        add_wheel(builder, wheel, *size)
        builder.scene.add_joint(
            "follow", names.free("joints", f"{wheel}_follows"), body_i=mover, a_j=axis,
            a_k=f"{wheel}.z", ratio=scale / coef, along=True if slides else None,
        )  # fmt: skip
        if k == 1:
            total = wheel
            continue
        before, total = total, "ground"
        if k < count:
            total = names.free("bodies", f"{tendon.name}_sum{k}")
            add_wheel(builder, total, *size)
        builder.scene.add_joint(
            "follow", names.free("joints", f"{tendon.name}_sum{k}"), body_i=total,
            a_j=f"{before}.z", a_k=f"{wheel}.z",
        )  # fmt: skip
