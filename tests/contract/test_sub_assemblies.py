"""Elements of every registered type follow a sub-assembly to its place, or are refused there."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.internals import Evaluator, join, slot_of, specs_of, split
from support.motions import Motion
from support.scenes import case_names, cases, scene_for

import dap3d_core as dap
from dap3d_core.model import build_model
from dap3d_core.scene import check as checked

REGISTRY = dap.load_registry()
CASES = [(kind, case) for kind in ("joint", "force", "contact") for case in cases(REGISTRY, kind)]
R_0, RPY = (0.7, -0.4, 1.1), (0.3, -0.7, 1.1)
TURN = Rotation.from_euler("xyz", RPY)
#: The types that do not follow, and the slots of ground of which that is so; "" of any.
MEASURED_FROM_GROUND = {"disk": "", "rP": "", "tyre": ""}
LAID_BY_AXES = {
    "oncurve": "j", "point-on-surface": "j", "bushing": "i", "sph_sd": "ij", "sph_stop": "ij",
    "ball_box": "j", "ball_surface": "j", "box_box": "ij", "box_plane": "i", "cylinder_plane": "i",
    "disk_plane": "i", "point_curve": "j",
}  # fmt: skip
#: Their rows, off the constraint, go by a point of ground, or by axes that prepare chooses: they
#: are compared as the scene starts, at rest.
AT_START = {
    "weld", "couple", "drive-rot", "motor", "screw", "actuator", "angle_force", "position-servo",
    "joint_limit",
}  # fmt: skip


def element_of(scene):
    """The element of a scene that is tried."""
    return next(t["element"] for t in (scene.joints, scene.forces, scene.contacts)
                if "element" in t)  # fmt: skip


def loaded_scene(kind, keyword, values, ground, *, left_out):
    """A scene with one element and loads on its bodies; without what its type has by default."""
    type_info = REGISTRY.get(kind, keyword)
    scene = scene_for(type_info, np.random.default_rng(0), ground=ground, values=values)
    fields = element_of(scene).fields
    fields.pop("mu_s" if kind == "contact" else "", None)
    if left_out:
        for name, spec in specs_of(type_info.type).items():
            if spec.kind in ("point", "vector", "body") and not spec.required:
                fields.pop(name if slot_of(name) == ground else "", None)
    scene.add_force("f", body_i="b2", f=[0.3, 0.2, -0.5])
    for body, n in (("b1", [0.3, 0.2, -0.5]), ("b3", [0.3, -0.2, 0.5])):
        scene.add_force("n", body_i=body, n=n)
    return scene


def evaluated(scene, u):
    """Accelerations (6, 3), and what does not depend on axes: switches, rates of states."""
    evaluator = Evaluator(build_model(checked(scene, REGISTRY)), "standard")
    v_dot = evaluator.rhs(0.1, u)[-18:].reshape(-1, 3)
    switches = evaluator.switch_values(0.1, evaluator.integrated(u)) if evaluator.switches else []
    return v_dot, switches, evaluator.state_rates(0.1, u) if len(evaluator.states) else []


@pytest.mark.every(11)
@pytest.mark.parametrize(
    ("kind", "case"), CASES, ids=[f"{k}-{n}" for k, c in CASES for n in case_names([c])]
)
def test_an_element_follows_its_sub_assembly(kind, case):
    """Its bodies are accelerated as in its own scene, seen in axes that are turned with it.
    Both differ by rounding, magnified by the condition of at most six rows."""
    keyword, values = case
    layout = REGISTRY.get(kind, keyword).layout
    compared = 0
    for ground, left_out in product((*layout.slots, None), (False, True)):
        part = loaded_scene(kind, keyword, values, ground, left_out=left_out)
        try:
            model = build_model(checked(part, REGISTRY))
        except Exception:  # no scene by itself: its only body is ground, functions go together
            continue
        u = Motion(3, np.random.default_rng(5)).u(0.1)
        if keyword in AT_START:
            u = join(*split(model.u0)[:2], *np.zeros((2, 3, 3)))
        alone = evaluated(part, u)
        for turn in (TURN, Rotation.identity()):
            scene, is_turned = dap.Scene(), turn is TURN
            at = {"r": R_0, "rpy": RPY} if is_turned else {"r": R_0}
            refused = keyword in MEASURED_FROM_GROUND
            refused |= is_turned and (ground or "-") in LAID_BY_AXES.get(keyword, "")
            if refused:
                with pytest.raises(dap.SceneError, match=r"(of|the) ground"):
                    dap.include(scene, "a", part, at)
                compared += 1
                continue
            dap.include(scene, "a", part, at)
            if keyword == "follow" and ground == "i" and values["along"]:
                continue  # from where ground slides, seen from a body that turns: no sense
            r, p, v, w = split(u)
            q = (turn * Rotation.from_quat(p, scalar_first=True)).as_quat(scalar_first=True)
            state = join(turn.apply(r) + R_0, q, turn.apply(v), turn.apply(w))
            if kind == "force" and "a/element" not in scene.forces:
                assert "left out" in scene.notes[0]
                continue
            there = evaluated(scene, state)
            np.testing.assert_allclose(there[0], turn.apply(alone[0]), rtol=0, atol=1e-8)
            for mine, its in zip(alone[1:], there[1:], strict=True):
                np.testing.assert_allclose(its, mine, rtol=1e-9, atol=1e-9)
            compared += 1
    assert compared or keyword in ("weight", "friction", "gear_separation", "point_curve")
