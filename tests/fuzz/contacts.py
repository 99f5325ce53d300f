"""Random scenes that touch with friction go on, or end with one clear error.
Of balls and boxes, half of them with a linkage as well, that has limits, stops and friction.
An input is the number of a scene. Energy is never gained, nothing sinks in, all numbers are
finite."""

import time

import numpy as np
from hypothesis import strategies as st
from support.ended import EndedError

import dap3d_core as dap

#: s simulated; s of CPU time after which a run hangs; settings.
SPAN, HANG = 1.0, 60.0
SETTINGS = {"t_end": SPAN, "dt": SPAN / 60, "rtol": 1e-10, "atol": 1e-12, "integrator": "dop853",
            "contact": "events"}  # fmt: skip
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
    if number % 2:
        add_linkage(scene, np.random.default_rng([number, 1]))
    return scene


def add_linkage(scene, rng):
    """A pendulum between limits on a slider that rubs; its tip may meet the floor or a rope."""
    height = float(rng.uniform(0.4, 0.7))
    scene.add_body("cart", mass=1.0, Jp=[0.01] * 3, r=[-2.0, 0.0, height],
                   r_dot=[float(rng.normal()), 0.0, 0.0])  # fmt: skip
    rate = 4.0 * float(rng.normal())
    v = [scene.bodies["cart"].r_dot[0], 0.0, -0.25 * rate]
    scene.add_body("arm", mass=0.5, Jp=[0.001, 0.01, 0.01], r=[-1.75, 0.0, height], r_dot=v,
                   w=[0.0, rate, 0.0])  # fmt: skip
    scene.add_point("pin", "arm", [-0.25, 0.0, 0.0])
    scene.add_point("tip", "arm", [0.25, 0.0, 0.0])

    def some(low, high):
        return {"e": float(rng.choice([0.0, 0.4, 1.0]))} | {
            side: sign * float(rng.uniform(low, high))
            for side, sign in (("lower", -1.0), ("upper", 1.0)) if rng.random() < 0.7
        }  # fmt: skip

    ends = {"way": some(0.1, 0.5), "hinge": some(0.3, 2.0)}
    ends = {name: limits if len(limits) > 1 else {} for name, limits in ends.items()}
    scene.add_point("rail", "ground", [-2.0, 0.0, height])
    scene.add_joint("tran", "way", P_i="cart.O", P_j="rail", a_j="ground.x", **ends["way"])
    scene.add_joint("rev", "hinge", P_i="pin", P_j="cart.O", a_i="arm.y", a_j="cart.y",
                    **ends["hinge"])  # fmt: skip
    for force, joint, size in (("tran_friction", "way", "f"), ("rot_friction", "hinge", "n")):
        if rng.random() < 0.7:
            sliding = float(rng.choice([0.02, 0.5, 5.0]))
            sticking = sliding * float(rng.choice([1.0, 1.5]))
            scene.add_force(force, f"rub_{joint}", joint=joint,
                            **{f"{size}_c": sliding, f"{size}_s": sticking})  # fmt: skip
    if rng.random() < 0.5:
        scene.add_contact("ball_plane", "tip_floor", P_i="tip", mu=0.3, e=0.3)
    if rng.random() < 0.3:
        scene.add_force("ptp_stop", "rope", P_i="tip", P_j="rail", l_stop=0.6, side="max", e=0.2)


def check_contacts(data: bytes) -> str:
    """How the run of a scene ended, in words."""
    scene, began = scene_of(int(data)), time.process_time()

    def watch(_):
        if time.process_time() - began > HANG:
            raise EndedError

    said = ""
    try:
        result = dap.simulate(scene, watch=watch, **SETTINGS)
    except dap.SimulationError as error:
        said, result = str(error), error.result
    assert result is not None, said
    names = result.contact_names
    words = next((w for w in ENDINGS if w in said), "")
    assert not said or (words and any(name in said for name in names)), said
    assert np.isfinite(result.u).all()
    energy = result.energy.total
    size = np.max(np.abs(result.energy.kinetic)) + 9.81 * len(scene.bodies)
    assert np.max(np.diff(energy), initial=0.0) <= GAIN * size
    for name in names:
        contact = result.contact(name)
        assert np.min(contact.gap) >= -DEPTH, name
        assert np.min(contact.normal_force) >= -1e-6, name
    return words or "done"
