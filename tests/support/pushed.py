"""A block that an input pushes along x, and its zero-order hold in closed form."""

import numpy as np

import dap3d_core as dap

MASS = 2.0


def pushed_block(value=0.0, **fields):
    """2 kg on no support, a force of 1 N times the input ``push``."""
    scene = dap.Scene(name="pushed")
    scene.add_body("block", mass=MASS, Jp=(1.0, 1.0, 1.0), **fields)
    scene.add_input("push", value)
    scene.add_force("f", "force", body_i="block", f=(1.0, 0.0, 0.0), input="push")
    return scene


def law(x, v):
    """A spring to x = 1 with a damper."""
    return -3.0 * (x - 1.0) - v


def feedback(t, state):
    """The law as a controller."""
    return {"push": law(state["block.r.x"], state["block.rd.x"])}


def held(every, count, keep=1, x=0.0, v=0.0):
    """(k, 3) x, v and the input that acts from there on, at every ``keep``-th sample."""
    rows, u = [], 0.0
    for k in range(count + 1):
        u = law(x, v) if k < count else u
        if k % keep == 0:
            rows.append((x, v, u))
        x, v = x + every * (v + 0.5 * every * u / MASS), v + every * u / MASS
    return np.array(rows)
