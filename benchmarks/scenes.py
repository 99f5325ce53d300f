"""Scenes of any size for the benchmarks, made through the public API."""

import dap3d_core as dap


def chain(n, joint="sph"):
    """n rods of 1 m and 1 kg, horizontal along +x from ground, joined end to end."""
    scene = dap.Scene(name=f"chain of {n} {joint}")
    add_body, add_point, add_joint = scene.add_body, scene.add_point, scene.add_joint
    w = (0.1, 0.0, 0.0) if joint == "sph" else (0.0, 0.0, 0.0)
    outer = "ground.O"
    for k in range(n):
        name = f"b{k}"
        add_body(name, mass=1.0, Jp=(0.001, 1 / 12, 1 / 12), r=(k + 0.5, 0.0, 0.0), w=w)
        inner = add_point(f"in{k}", name, (-0.5, 0.0, 0.0))
        if joint == "sph":
            add_joint("sph", f"J{k}", P_i=inner, P_j=outer)
        else:
            axis = f"b{k - 1}.y" if k else "ground.y"
            add_joint("rev", f"J{k}", P_i=inner, P_j=outer, a_i=f"{name}.y", a_j=axis)
        outer = add_point(f"out{k}", name, (0.5, 0.0, 0.0))
    scene.add_force("weight", "gravity")
    return scene


def star(arms):
    """One hub on ground with arms of one rod each, all on spherical joints."""
    scene = dap.Scene(name=f"star of {arms} arms")
    scene.add_body("hub", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(0.5, 0.0, 0.0))
    scene.add_point("in", "hub", (-0.5, 0.0, 0.0))
    scene.add_point("out", "hub", (0.5, 0.0, 0.0))
    scene.add_joint("sph", "J", P_i="in", P_j="ground.O")
    for k in range(arms):
        name = f"arm{k}"
        scene.add_body(name, mass=1.0, Jp=(0.001, 1 / 12, 1 / 12), r=(1.5, 0.0, 0.0))
        inner = scene.add_point(f"in{k}", name, (-0.5, 0.0, 0.0))
        scene.add_joint("sph", f"J{k}", P_i=inner, P_j="out")
    scene.add_force("weight", "gravity")
    return scene


def free(n):
    """n bodies that spin freely, without any force."""
    scene = dap.Scene(name=f"{n} free bodies")
    for k in range(n):
        scene.add_body(f"b{k}", mass=1.0, Jp=(1.0, 2.0, 3.0), w=(1.0, 2.0, 0.5))
    return scene


def planar_chain(n):
    """n uniform rods, 1 m and 1 kg, planar, from rest along +x, gravity along -y.

    These are the chains with known digits.
    """
    scene = dap.Scene(name=f"planar chain of {n}")
    outer = "ground.O"
    for k in range(n):
        name = f"b{k}"
        scene.add_body(name, mass=1.0, Jp=(0.001, 1 / 12, 1 / 12), r=(k + 0.5, 0.0, 0.0))
        inner = scene.add_point(f"in{k}", name, (-0.5, 0.0, 0.0))
        scene.add_joint("sph", f"J{k}", P_i=inner, P_j=outer)
        outer = scene.add_point(f"out{k}", name, (0.5, 0.0, 0.0))
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    return scene
