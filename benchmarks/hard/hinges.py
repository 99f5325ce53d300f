"""A door on hinges whose axes do not quite agree: from where on it binds.

``tilt``: all hinges but the first point another way by so many rad; ``offset``: they stand beside
the line by so many metres. Each in a direction of its own. ``fitted`` doors have their leaf made to
fit the posts as they stand at the start, others are made for posts in line.
"""

import numpy as np
from support import redundant

import dap3d_core as dap
from dap3d_core.scene import SceneError
from dap3d_core.simulation import SimulationError
from hard import references

SIZES = (0.0, *(10.0**k for k in range(-16, -1)))
T_END = 1.0
KINDS = ("tilt, fitted", "tilt", "offset, fitted", "offset")
#: What may become of it, from the best on.
RUNS, OPEN, REFUSED, STANDS = "swings", "swings, said to be open", "refused", "stands still"


def door(kind, size, hinges=2):
    """A door as ``redundant.hinged_door``, its hinges off by ``size`` in one of KINDS."""
    scene = dap.Scene(name=f"door, {kind} {size:g}")
    scene.add_body("door", mass=12.0, Jp=(4.0, 1.0, 5.0), r=(0.0, -0.5, 0.0))
    fitted, rng = kind.endswith("fitted"), np.random.default_rng(1)
    for k, x in enumerate(np.linspace(-0.9, 0.9, hinges)):
        way = 2.0 * np.pi * rng.random() if k else 0.0
        off = (size if k else 0.0) * np.array([0.0, np.cos(way), np.sin(way)])
        place, axis = np.array([x, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
        if kind.startswith("tilt"):
            post, along = place, axis + off
        else:
            post, along = place + off, axis
        leaf, own = (post, along) if fitted else (place, axis)
        scene.add_point(f"post{k}", "ground", tuple(post))
        scene.add_point(f"hinge{k}", "door", tuple(leaf + np.array((0.0, 0.5, 0.0))))
        scene.add_vector(f"post_axis{k}", "ground", tuple(along))
        scene.add_vector(f"leaf_axis{k}", "door", tuple(own))
        scene.add_joint("rev", f"H{k}", P_i=f"hinge{k}", P_j=f"post{k}",
                        a_i=f"leaf_axis{k}", a_j=f"post_axis{k}")  # fmt: skip
    scene.add_force("weight", "gravity", wgt=(0.0, 0.0, -1.0))
    return scene


def swing(t):
    """(nt, 2) y and z of the mass centre of the door whose hinges agree."""
    phi = references.swing(12.0 * redundant.G * 0.5 / 7.0, (np.pi / 2, 0.0), t)[:, 0]
    return 0.5 * np.column_stack([-np.sin(phi), np.cos(phi)])


def outcome(kind, size, hinges=2):
    """What becomes of a door, as a row of the table."""
    row = {"case": "misaligned door", "run": f"{hinges} hinges, {kind}", "size": size}
    try:
        compiled = dap.compile(door(kind, size, hinges))
        result = dap.simulate(compiled, t_end=T_END, dt=0.05)
    except (SceneError, SimulationError) as error:
        return row | {"outcome": REFUSED, "said": str(error)}
    y_z = result.r[:, 0, 1:]
    reactions = [result.reaction(f"H{k}")["i"] for k in range(hinges)]
    beyond = [name for name, entry in result.ledger.items() if entry.ok is False]
    moved = float(np.max(np.linalg.norm(y_z - y_z[0], axis=1)))
    return row | {
        "outcome": STANDS if moved < 1e-6 else OPEN if beyond else RUNS,
        "rank": compiled.redundancy(result.u[0]).rank.rank,
        "off": float(np.max(np.linalg.norm(y_z - swing(result.t), axis=1))),
        "force": float(max(np.max(np.linalg.norm(r.force, axis=1)) for r in reactions)),
        "moment": float(max(np.max(np.linalg.norm(r.moment, axis=1)) for r in reactions)),
        "C": result.ledger["position"].value,
        "beyond": ", ".join(beyond),
        "steps": result.stats.steps,
    }


def measure():
    """A row for each kind, number of hinges and size."""
    return [outcome(kind, size, hinges) for hinges in (2, 5) for kind in KINDS for size in SIZES]


def draw(rows, path):
    """Draw what becomes of each door, and how far its motion is from that of hinges in line."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(7.5, 3.2), layout="constrained")
    colors = {RUNS: "tab:green", OPEN: "gold", REFUSED: "tab:red", STANDS: "tab:blue"}
    runs = list(dict.fromkeys(row["run"] for row in rows))
    for row in rows:
        if row["size"] > 0.0:
            axes[0].scatter(row["size"], runs.index(row["run"]), color=colors[row["outcome"]],
                            marker="s", s=55)  # fmt: skip
    for name, color in colors.items():
        axes[0].scatter([], [], color=color, marker="s", s=30, label=name)
    axes[0].set_yticks(range(len(runs)), runs, fontsize=7)
    axes[0].set_xscale("log")
    axes[0].set_ylim(len(runs) + 1.2, -0.7)
    axes[0].legend(fontsize=6.5, loc="lower center", ncols=2)
    for k, run in enumerate(runs):
        swung = [row for row in rows if row["run"] == run and row["outcome"] in (RUNS, OPEN)]
        swung = [row for row in swung if row["size"] > 0.0]
        axes[1].loglog([row["size"] for row in swung], [max(row["off"], 1e-17) for row in swung],
                       ".-", lw=0.8, ms=4, color=f"C{k}", label=run)  # fmt: skip
    axes[1].set_ylabel("off the motion of hinges in line, m", fontsize=8)
    axes[1].legend(fontsize=6, loc="upper left")
    for axis in axes:
        axis.set_xlabel("tilt, rad, or offset, m", fontsize=8)
        axis.set_xlim(3e-17, 3e-2)
        axis.tick_params(axis="x", labelsize=7)
    axes[1].tick_params(axis="y", labelsize=7)
    axes[1].set_ylim(1e-10, 1e-5)
    figure.savefig(path, dpi=110)
    plt.close(figure)
