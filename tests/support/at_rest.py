"""Scenes whose equilibria have closed forms, or equations of one unknown."""

import math

import dap3d_core as dap

G = 9.81


def pendulum(angle, name="pendulum"):
    """A rod of 2 kg whose mass centre is 1 m from its hinge, turned about -y from hanging down."""
    scene = dap.Scene(name=name)
    scene.add_body(
        "rod",
        mass=2.0,
        Jp=(0.1, 0.1, 0.1),
        r=(math.sin(angle), 0.0, -math.cos(angle)),
        p=(math.cos(angle / 2), 0.0, -math.sin(angle / 2), 0.0),
    )
    scene.add_point("A", "rod", (0.0, 0.0, 1.0))
    scene.add_joint("rev", "J1", P_i="A", P_j="ground.O", a_i="rod.y", a_j="ground.y")
    scene.add_force("weight")
    return scene


def catenary(n, span):
    """n rods of 1 kg and 1 m, hinged to each other and at both ends, as a V that spans a part."""
    scene, angle = dap.Scene(name="catenary"), math.acos(span)
    before, axis = "ground.O", "ground.y"
    for k in range(n):
        turn = angle if k < n // 2 else -angle
        scene.add_body(
            f"rod{k}",
            mass=1.0,
            Jp=(0.01, 0.1, 0.1),
            r=((k + 0.5) * span, 0.0, -min(k + 0.5, n - k - 0.5) * math.sin(angle)),
            p=(math.cos(turn / 2), 0.0, math.sin(turn / 2), 0.0),
        )
        a = scene.add_point(f"a{k}", f"rod{k}", (-0.5, 0.0, 0.0))
        b = scene.add_point(f"b{k}", f"rod{k}", (0.5, 0.0, 0.0))
        scene.add_joint("rev", f"J{k}", P_i=a, P_j=before, a_i=f"rod{k}.y", a_j=axis)
        before, axis = b, f"rod{k}.y"
    scene.add_point("end", "ground", (n * span, 0.0, 0.0))
    scene.add_joint("sph", f"J{n}", P_i=before, P_j="end")
    scene.add_force("weight")
    return scene


def toggle(angle, *, weight=True, k=200.0, reach=1.2):
    """Two rods of 1 m and 1 kg, hinged, that move a slider along x against a spring: it snaps.
    The crank is at an angle to x; the spring, 200 N/m, is unstretched with the slider at x = 1.2
    m."""
    scene = dap.Scene(name="toggle")
    c, s = math.cos(angle), math.sin(angle)
    half = math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0
    up = (half[0], 0.0, -half[2], 0.0)
    scene.add_body("crank", mass=1.0, Jp=(0.01, 0.1, 0.1), r=(c / 2, 0, s / 2), p=up)
    scene.add_body("rod", mass=1.0, Jp=(0.01, 0.1, 0.1), r=(1.5 * c, 0, s / 2), p=half)
    scene.add_body("slider", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(2 * c, 0, 0))
    for body in ("crank", "rod"):
        scene.add_point(f"{body}_a", body, (-0.5, 0, 0))
        scene.add_point(f"{body}_b", body, (0.5, 0, 0))
    scene.add_joint("rev", "J1", P_i="crank_a", P_j="ground.O", a_i="crank.y", a_j="ground.y")
    scene.add_joint("rev", "J2", P_i="crank_b", P_j="rod_a", a_i="crank.y", a_j="rod.y")
    scene.add_joint("rev", "J3", P_i="rod_b", P_j="slider.O", a_i="rod.y", a_j="slider.y")
    scene.add_joint("tran", "J4", P_i="slider.O", P_j="ground.O", a_j="ground.x")
    scene.add_point("wall", "ground", (4.0, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="slider.O", P_j="wall", k=k, l0=4.0 - reach)
    if weight:
        scene.add_force("weight")
    return scene


def toggle_moment(angle, k=200.0, reach=1.2):
    """dV/d(angle) of ``toggle``, from its one coordinate."""
    return -2 * k * (2 * math.cos(angle) - reach) * math.sin(angle) + G * math.cos(angle)


def ball(r=(0.0, 0.0, 0.0), *, weight=True):
    """A free body of 1 kg, under its weight."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=1.0, Jp=(0.1, 0.1, 0.1), r=r)
    if weight:
        scene.add_force("weight")
    return scene


def two_springs(r, l0, *, k=100.0):
    """A ball without weight between two springs along x, fastened at x = -2 and 2 m."""
    scene = ball(r, weight=False)
    for k_, x in enumerate((-2.0, 2.0)):
        scene.add_point(f"wall{k_}", "ground", (x, 0.0, 0.0))
        scene.add_force("ptp", P_i="ball.O", P_j=f"wall{k_}", k=k, l0=l0)
    return scene


def door():
    """A door of 20 kg on three hinges, turned by 2 N m against a spring of 5 N m/rad."""
    scene = dap.Scene(name="door")
    scene.add_body("door", mass=20.0, Jp=(1.0, 1.0, 1.0), r=(0.5, 0.0, 1.0))
    for k, z in enumerate((-0.8, 0.0, 0.8)):
        scene.add_point(f"door{k}", "door", (-0.5, 0.0, z))
        scene.add_point(f"frame{k}", "ground", (0.0, 0.0, 1.0 + z))
        scene.add_joint(
            "rev", f"H{k}", P_i=f"door{k}", P_j=f"frame{k}", a_i="door.z", a_j="ground.z"
        )
    scene.add_force("weight")
    scene.add_force("n", body_i="door", n=(0.0, 0.0, 2.0))
    scene.add_force("rot_sda", v_i="door.x", v_j="ground.x", axis="ground.z", k=5.0)
    return scene


def spiral(*, turns=True):
    """A wheel that 50 N m turn against a spiral spring of 1 N m/rad: about eight turns."""
    scene = dap.Scene(name="spiral")
    scene.add_body("wheel", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_joint("rev", "J1", P_i="wheel.O", P_j="ground.O", a_i="wheel.z", a_j="ground.z")
    scene.add_force("n", body_i="wheel", n=(0.0, 0.0, 50.0))
    scene.add_force(
        "rot_sda", "spring", v_i="wheel.x", v_j="ground.x", axis="ground.z", k=1.0, turns=turns
    )
    return scene


def ziegler(load, c=0.0):
    """Ziegler's column: two rods of 1 kg and 1 m, hinged by 10 N m/rad, under a following load."""
    scene = dap.Scene(name="ziegler")
    before, axis, v = "ground.O", "ground.y", "ground.x"
    for k in range(2):
        body = scene.add_body(f"rod{k}", mass=1.0, Jp=(0.1, 0.1, 0.01), r=(0.0, 0.0, 0.5 + k))
        scene.add_point(f"a{k}", body, (0.0, 0.0, -0.5))
        scene.add_point(f"b{k}", body, (0.0, 0.0, 0.5))
        scene.add_joint("rev", P_i=f"a{k}", P_j=before, a_i=f"{body}.y", a_j=axis)
        scene.add_force("rot_sda", v_i=f"{body}.x", v_j=v, axis=axis, k=10.0, c=c)
        before, axis, v = f"b{k}", f"{body}.y", f"{body}.x"
    scene.add_force("fp", P_i="b1", fp=(0.0, 0.0, -load))
    return scene
