"""Drivers that have no joint to drive."""

from collections import Counter

from dap3d_core.result import information
from dap3d_core.scene import Instance, ValidatedScene


def notes_on_drivers(checked: ValidatedScene) -> list[str]:
    """Drivers between bodies that nothing else connects: allowed, and perhaps a joint is missing.

    Bodies are connected by a chain of joints, ground among them, or by another driver.
    """
    drivers = [joint for joint in checked.joints if _drives(joint)]
    if not drivers:
        return []
    names = ("ground", *checked.body_names)
    part = list(range(len(names)))

    def top(body: int) -> int:
        while part[body] != body:
            part[body] = body = part[part[body]]
        return body

    for joint in checked.joints:
        if not _drives(joint):
            for body in joint.bodies[1:]:
                part[top(body)] = top(joint.bodies[0])
    ends = [tuple(sorted({top(body) for body in driver.bodies})) for driver in drivers]
    count = Counter(ends)
    return [
        information(
            f"joints.{driver.name}: no other joint connects "
            f"{' and '.join(names[body] for body in driver.bodies)}; a driver prescribes one "
            "freedom and leaves the others as they are"
        )
        for driver, parts in zip(drivers, ends, strict=True)
        if len(parts) > 1 and count[parts] == 1
    ]


def _drives(joint: Instance) -> bool:
    return bool(getattr(joint.type_info.type, "drives", False))
