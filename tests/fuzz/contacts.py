"""Random scenes of balls and boxes that touch with friction go on, or end with one clear error.

An input is the number of a scene. Energy is never gained, nothing sinks in, all numbers are finite.
"""

import time

import numpy as np
from hypothesis import strategies as st
from support.ended import EndedError

import dap3d_core as dap

#: s simulated; s after which a run hangs; settings.
SPAN, HANG = 1.0, 60.0
SETTINGS = {"t_end": SPAN, "dt": SPAN / 60, "rtol": 1e-10, "atol": 1e-12, "integrator": "dop853"}
#: Gains of energy, and depths, as parts of energy and length of the scene. Where a run reports
#: between events a gap is as good as the state.
GAIN, DEPTH = 1e-9, 1e-9
#: Words of the errors that a run may end with.
ENDINGS = ("jams", "ever faster", "asks for steps as short")


def numbers():
    """Numbers of scenes."""
    return st.integers(0, 10**6).map(lambda n: str(n).encode())


def scene_of(number):
    """1 to 4 contacts: balls and boxes that fall on a floor, balls on each other."""
    rng = np.random.default_rng(number)
    scene = dap.Scene(name=f"contacts {number}")
    scene.add_force("weight", "g")

    def law():
        mu = float(rng.choice([0.0, 0.1, 0.4, 1.0]))
        e = float(rng.choice([0.0, 0.3, 0.8, 1.0]))
        return {"mu": mu, "mu_s": mu * float(rng.choice([1.0, 1.3])), "e": e}

    balls, contacts = [], int(rng.integers(1, 5))
    for k in range(contacts):
        v, w = rng.normal(size=3), 5.0 * rng.normal(size=3)
        x = 0.5 * k
        if balls and rng.random() < 0.3:
            below = balls.pop()
            scene.add_contact(
                "ball_ball", f"c{k}", P_i=f"b{k}.O", P_j=f"{below[0]}.O", radius_i=0.1,
                radius_j=0.1, **law(),
            )  # fmt: skip
            r = [below[1] + 0.1 * rng.random(), 0.0, 0.35 + 0.1 * rng.random()]
            scene.add_body(f"b{k}", mass=1.0, Jp=[0.004] * 3, r=r, r_dot=0.3 * v, w=w)
        elif rng.random() < 0.5:
            r = [x, 0.0, 0.1 + float(rng.choice([0.0, 0.05]))]
            scene.add_body(f"b{k}", mass=1.0, Jp=[0.004] * 3, r=r, r_dot=v, w=w)
            scene.add_contact("ball_plane", f"c{k}", P_i=f"b{k}.O", radius=0.1, **law())
            balls.append((f"b{k}", x))
        else:
            flat = rng.random() < 0.4
            p = np.array([1.0, 0.0, 0.0, 0.0]) if flat else rng.normal(size=4)
            r, size = [x, 0.0, 0.05 if flat else 0.3], [0.4, 0.3, 0.1]
            spin = [0.0, 0.0, w[2]] if flat else w
            slide = [v[0], v[1], 0.0] if flat else v
            scene.add_body(f"b{k}", mass=1.0, Jp=[0.01, 0.015, 0.02], r=r,
                           p=p / np.linalg.norm(p), r_dot=slide, w=spin)  # fmt: skip
            scene.add_contact("box_plane", f"c{k}", P_i=f"b{k}.O", size=size, **law())
    return scene


def check_contacts(data: bytes) -> str:
    """How the run of a scene ended, in words."""
    scene, began = scene_of(int(data)), time.monotonic()

    def watch(_):
        if time.monotonic() - began > HANG:
            raise EndedError

    said = ""
    try:
        result = dap.simulate(scene, watch=watch, **SETTINGS)
    except dap.SimulationError as error:
        said, result = str(error), error.result
    assert result is not None, said
    words = next((w for w in ENDINGS if w in said), "")
    assert not said or (words and any(name in said for name in scene.contacts)), said
    assert np.isfinite(result.u).all()
    energy = result.energy.total
    size = np.max(np.abs(result.energy.kinetic)) + 9.81 * len(scene.bodies)
    assert np.max(np.diff(energy), initial=0.0) <= GAIN * size
    for name in scene.contacts:
        contact = result.contact(name)
        assert np.min(contact.gap) >= -DEPTH, name
        assert np.min(contact.normal_force) >= -1e-6, name
    return words or "done"
