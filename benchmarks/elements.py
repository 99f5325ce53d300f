"""What a right-hand side costs with an element of each type, beside one of a like type.

Scenes are the examples that ``dap3d describe`` shows, many times over: two bodies, or one and
ground, and the element between them. A like type is older, has as many rows between as many bodies,
or does the same; where none does, several are taken together.
"""

import tempfile
import time
from pathlib import Path

from right_hand_side import repeat
from timing import wait_for_good_code

import dap3d_core as dap
from dap3d_core.cli.commands.describe_example import example_of
from dap3d_core.simulation import CompiledModel

#: Elements of a scene; right-hand sides of a timing; timings of each.
COUNT, CALLS, REPEATS = 64, 300, 25
#: Kind, type -> older types that it is compared with. The example of ``gear`` is without a pressure
#: angle; the force that this brings is ``gear_separation``, which reads a multiplier as friction.
LIKE = {
    ("joint", "gear"): ("follow",),
    ("joint", "rack"): ("follow",),
    ("joint", "couple"): ("follow",),
    ("joint", "belt"): ("follow",),
    ("joint", "cable"): ("sph-sph",),
    ("joint", "motor"): ("drive-tran",),
    ("joint", "screw"): ("rev",),
    ("joint", "planar"): ("sph",),
    ("joint", "parallel"): ("univ",),
    ("joint", "inline"): ("sph",),
    ("joint", "inplane"): ("drive-tran",),
    ("joint", "cv"): ("univ",),
    ("force", "bushing"): ("ptp", "sph_sd"),
    ("force", "gear"): ("ptp", "rot_sda"),
    ("force", "motor"): ("rot_sda",),
    ("force", "cable"): ("ptp",),
    ("force", "belt"): ("maxwell", "maxwell"),
    ("force", "gear_separation"): ("friction",),
}


def scene_of(registry, kind, keywords):
    """Many copies of the example of a type, or of several together, beside one another."""
    part = None
    for k, keyword in enumerate(keywords):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "example.toml")
            file.write_text(example_of(registry.get(kind, keyword), registry))
            example = dap.load(file)
        for joint in example.joints.values():
            if "pressure_angle" in joint.fields:
                joint.fields["pressure_angle"] = 0.0
        if part is None:
            part = example
            continue
        part.points |= example.points
        for element in example.forces.values():
            part.add_force(element.type, f"{element.name}_{k}", **element.fields)
    scene = dap.Scene(name=" ".join(keywords))
    for k in range(COUNT):
        dap.include(scene, f"n{k}", part, at={"r": (10.0 * k, 0.0, 0.0)})
    return scene


def right_hand_sides(registry, kind, keywords):
    """A function that evaluates the right-hand side of such a scene some times."""
    evaluator = CompiledModel(scene_of(registry, kind, keywords), joint=False).evaluator
    y = evaluator.integrated(evaluator.model.u0)
    out, functions = 0.0 * y, evaluator.functions
    return lambda: repeat(functions, CALLS, y, out, evaluator.system, evaluator.loops)


def least_seconds(functions):
    """Least CPU time of each function, called in turn: other programs weigh less on it."""
    found = [float("inf")] * len(functions)
    for function in functions:
        function()
    wait_for_good_code()
    for _ in range(REPEATS):
        for k, function in enumerate(functions):
            start = time.thread_time()
            function()
            found[k] = min(found[k], time.thread_time() - start)
    return found


def measure():
    """Rows of the table: microseconds an element, and the ratio to those of the like types."""
    registry, rows = dap.load_registry(), []
    for (kind, keyword), like in LIKE.items():
        runs = [right_hand_sides(registry, kind, words) for words in ((keyword,), like)]
        own, other = least_seconds(runs)
        row = {"kind": kind, "type": keyword, "us": 1e6 * own / CALLS / COUNT}
        rows.append(row | {"like": " and ".join(like), "ratio": own / other})
    return rows
