"""Scenes that only the hard cases need; the others are shipped models and scenes of the tests."""

import attrs
import numpy as np
from support import problems

import dap3d_core as dap


def stiff_rod(k=1e9):
    """A01 with a spring of k N/m in place of the rod."""
    scene = dap.Scene(name="A01 on a stiff spring")
    scene.add_body("bob", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(-1.0, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="bob.O", P_j="ground.O", k=k, l0=1.0)
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    return scene


def stiff_bounce(k=1e9):
    """The shipped ball, its ground k N/m stiff and without damping."""
    scene = dap.load("ball1")
    scene.forces["contact"].fields.update(k=k, c=0.0)
    return scene


def damper(k, restitution):
    """The damper, N s/m, with which 1 kg leaves a spring k at ``restitution`` of its speed."""
    decrement = -np.log(restitution) / np.pi  # decay over frequency of the damped sine
    return 2.0 * np.sqrt(k) * decrement / np.sqrt(1.0 + decrement**2)


def bounces(k=1e9, restitution=0.8):
    """The shipped ball on stiffer ground, with a damper that leaves it a part of its speed."""
    scene = stiff_bounce(k)
    scene.forces["contact"].fields.update(c=damper(k, restitution))
    return scene


def stiff_beside_slow(k=1e9):
    """A01, and beside it 1 kg on a spring of k N/m with a damper; the two do not touch."""
    scene = problems.pendulum()
    scene.add_body("weight", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(2.0, 0.0, 0.0))
    scene.add_point("above", "ground", (2.0, 1.0, 0.0))
    scene.add_force("ptp", "spring", P_i="weight.O", P_j="above", k=k, l0=1.0, c=np.sqrt(k))
    return scene


def flat_disk(lean, radius=0.5):
    """A thin disk of 2 kg that leans by ``lean`` from lying, in steady rolling about its centre."""
    scene = dap.Scene(name=f"a disk {lean:g} rad from lying")
    s, c = np.sin(lean), np.cos(lean)
    rate = np.sqrt(4.0 * 9.81 / (radius * s))
    # from the ground axes to (t, eta, n): turned about z and x, the axis eta in the x-z plane
    half = 0.25 * np.pi - 0.5 * lean
    turned = np.array([np.sqrt(0.5), 0.0, 0.0, -np.sqrt(0.5)])
    lying = np.array([np.cos(half), np.sin(half), 0.0, 0.0])
    p = (turned[0] * lying[0], turned[0] * lying[1], turned[3] * lying[1], turned[3] * lying[0])
    scene.add_body(
        "coin", mass=2.0, Jp=(0.5 * radius**2, radius**2, 0.5 * radius**2),
        r=(0.0, 0.0, radius * s), p=p, w=(-rate * c * s, 0.0, rate * s * s),
    )  # fmt: skip
    scene.add_joint("disk", "ground contact", body_i="coin", radius=radius, lying=0.1 * lean)
    scene.add_force("weight")
    return scene


def heavy_bob(ratio=1e9):
    """A rod of 1 m and 1 kg from ground, a body of ``ratio`` kg on its end; from rest at level."""
    scene = dap.Scene(name=f"{ratio:g} kg on a rod of 1 kg")
    scene.add_body("rod", mass=1.0, Jp=problems.ROD, r=(-0.5, 0.0, 0.0))
    scene.add_body("bob", mass=ratio, Jp=(0.1 * ratio,) * 3, r=(-1.0, 0.0, 0.0))
    scene.add_point("near", "rod", (0.5, 0.0, 0.0))
    scene.add_point("far", "rod", (-0.5, 0.0, 0.0))
    scene.add_joint("sph", "pivot", P_i="near", P_j="ground.O")
    scene.add_joint("sph", "hook", P_i="bob.O", P_j="far")
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    return scene


def heavy_cart(ratio=1e9):
    """A pendulum of 1 kg and 1 m on a cart of ``ratio`` kg that slides along x; rest, at level."""
    scene = dap.Scene(name=f"1 kg on a cart of {ratio:g} kg")
    scene.add_body("cart", mass=ratio, Jp=(ratio,) * 3)
    scene.add_body("bob", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(-1.0, 0.0, 0.0))
    for axis in "yz":
        scene.add_joint("rP", f"rail {axis}", P_i="cart.O", a_j=f"ground.{axis}", length=0.0)
    scene.add_joint("sph-sph", "rod", P_i="bob.O", P_j="cart.O", length=1.0)
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    return scene


#: Powers of (length, mass, time) in the unit of a field of the elements that are rescaled here.
UNITS = {"k": (0, 1, -2), "l0": (1, 0, 0), "n": (2, 1, -2), "gravity": (1, 0, -2)}


def in_units(scene, length, mass, time):
    """The same scene in other units: so many of the new ones are 1 m, 1 kg and 1 s.

    Bodies, points, and the fields of UNITS are rewritten.
    """

    def scaled(value, powers):
        factor = length ** powers[0] * mass ** powers[1] * time ** powers[2]
        return tuple(x * factor for x in value) if isinstance(value, tuple) else value * factor

    for body in scene.bodies.values():
        body.mass = scaled(body.mass, (0, 1, 0))
        body.Jp = scaled(body.Jp, (2, 1, 0))
        body.r, body.r_dot = scaled(body.r, (1, 0, 0)), scaled(body.r_dot, (1, 0, -1))
        body.w = scaled(body.w, (0, 0, -1))
    for point in scene.points.values():
        point.sPp = scaled(point.sPp, (1, 0, 0))
    for element in scene.forces.values():
        element.fields = {
            name: scaled(value, UNITS[name]) if name in UNITS else value
            for name, value in element.fields.items()
        }
    scene.simulation = attrs.evolve(scene.simulation, t_end=None, dt=None)
    return scene


def squeezer_in_mm():
    """A03 in mm, g and ms."""
    return in_units(dap.load("A03"), 1e3, 1e3, 1e3)
