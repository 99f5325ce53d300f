"""What is asked of dap3d against the best of the others: ratios of times to reach an error."""

import math

import levels

#: A level time: more than this is behind.
LEVEL = 1.1
#: Chains in joint coordinates.
THIRD = 1.0 / 3.0


def goal(scene, level):
    """[(programs, most that our time may be of their best)]; empty where nothing is asked."""
    name, size = scene.rsplit("-", 1)
    loose = level == 1e-3
    if name in ("revolute-chain", "spherical-chain") and int(size) in (1, 8, 64, 1024):
        return [(levels.PEERS, 0.4 if loose and scene == "revolute-chain-8" else THIRD)]
    if name in ("free-body", "heavy-top"):
        return [(levels.PEERS, {1e-3: 1.5, 1e-6: LEVEL, 1e-9: 1.0}[level])]
    if name == "spherical-chain":
        tight = 0.5 if int(size) >= 8 else 1.5
        return [(levels.PEERS, 1.5 if loose else tight)]
    if name == "four-bar":
        return [(("pinocchio",), 0.5), (("exudyn", "mujoco", "drake"), 0.1)]
    if name == "four-bars":
        half = int(size) >= 40 and not loose
        return [(levels.PEERS, 1.0)] + ([(("pinocchio",), 0.5)] if half else [])
    return []


def table(cells, scenes):
    """One row for each scene, level and goal."""
    rows = []
    for scene in scenes:
        if scene.startswith("ball"):
            continue
        for level in levels.LEVELS:
            ours, method = levels.best(cells, scene, levels.OURS, level)
            for programs, most in goal(scene, level) or [(levels.PEERS, None)]:
                found = [(levels.best(cells, scene, p, level)[0], p) for p in programs]
                theirs, who = min(found)
                ratio = ours / theirs if math.isfinite(theirs) and math.isfinite(ours) else None
                met = None
                if most is not None:
                    met = math.isfinite(ours) and (not math.isfinite(theirs) or ratio <= most)
                rows.append({"scene": scene, "level": level, "ours_ms": _ms(ours), "by": method,
                             "best_peer_ms": _ms(theirs), "peer": who if _ms(theirs) else "none",
                             "ratio": ratio, "goal": most, "met": met})  # fmt: skip
    return rows


def _ms(seconds):
    return 1e3 * seconds if math.isfinite(seconds) else None
