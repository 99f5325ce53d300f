"""Reference problems with closed forms or published digits, made through the public API."""

import numpy as np

import dap3d_core as dap

ROD = (1e-3, 1 / 12, 1 / 12)  # uniform rod of 1 m and 1 kg along x, made thin but not infinitely so


def pendulum():
    """IFToMM A01: 1 kg on a massless rod of 1 m, released at rest at (-1, 0), gravity along -y."""
    scene = dap.Scene(name="A01")
    scene.add_body("bob", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(-1.0, 0.0, 0.0))
    scene.add_joint("sph-sph", "rod", P_i="bob.O", P_j="ground.O", length=1.0)
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    return scene


def four_bars(count, angle=0.0, tips="rev"):
    """IFToMM A02: ``count`` parallelograms in a row; cranks at an angle turn at 1 rad/s.
    2 count + 1 rods of 1 m and 1 kg. Of spatial revolutes three rows of each loop are redundant; of
    couplers whose ends (``tips``) are on spherical joints none is."""
    scene = dap.Scene(name=f"A02 of {count}")
    up = np.array([-np.sin(angle), np.cos(angle), 0.0])
    across = np.array([np.cos(angle), np.sin(angle), 0.0])
    p = (np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2))
    for k in range(count + 1):
        crank, foot = f"crank{k}", np.array([float(k), 0.0, 0.0])
        scene.add_body(crank, mass=1.0, Jp=(1 / 12, 1e-3, 1 / 12), r=foot + up / 2, p=p,
                       r_dot=across / 2, w=(0.0, 0.0, -1.0))  # fmt: skip
        scene.add_point(f"A{k}", crank, (0.0, -0.5, 0.0))
        scene.add_point(f"B{k}", crank, (0.0, 0.5, 0.0))
        scene.add_point(f"post{k}", "ground", foot)
        axes = {"a_i": f"{crank}.z", "a_j": "ground.z"}
        scene.add_joint("rev", f"A{k}", P_i=f"A{k}", P_j=f"post{k}", **axes)
    for k in range(1, count + 1):
        coupler, middle = f"coupler{k}", np.array([k - 0.5, 0.0, 0.0])
        scene.add_body(coupler, mass=1.0, Jp=ROD, r=middle + up, r_dot=across)
        for side, near, x in (("L", k - 1, -0.5), ("R", k, 0.5)):
            end = scene.add_point(f"{side}{k}", coupler, (x, 0.0, 0.0))
            axes = {"a_i": f"{coupler}.z", "a_j": f"crank{near}.z"} if tips == "rev" else {}
            scene.add_joint(tips, end, P_i=end, P_j=f"B{near}", **axes)
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    return scene


def four_bar():
    """IFToMM A02 with N = 1, made free of redundancy."""
    return four_bars(1, tips="sph")


def free_body(Jp, w, **more):
    """One body with principal inertias Jp, body components w of omega, p = identity, no forces."""
    scene = dap.Scene(name="free body")
    scene.add_body("top", mass=1.0, Jp=Jp, w=w, **more)
    return scene


def heavy_top(theta, spin, precession):
    """G4: symmetric heavy top in steady precession.
    The mass centre is 0.1 m from the pivot; A = 0.02 about the pivot, C = 0.005."""
    c, s = np.cos(theta), np.sin(theta)
    axis = np.array([0.0, s, c])
    scene = dap.Scene(name="heavy top")
    # axial omega is the whole component along the axis; the rest comes from the precession about z
    w = spin * axis + precession * (np.array([0.0, 0.0, 1.0]) - c * axis)
    r = 0.1 * axis
    p = (np.cos(theta / 2), -np.sin(theta / 2), 0.0, 0.0)
    Jp = (0.02 - 0.01, 0.02 - 0.01, 0.005)
    scene.add_body("top", mass=1.0, Jp=Jp, r=r, p=p, r_dot=np.cross(w, r), w=w)
    scene.add_point("tip", "top", (0.0, 0.0, -0.1))
    scene.add_joint("sph", "pivot", P_i="tip", P_j="ground.O")
    scene.add_force("weight", "gravity")
    return scene


def chain(n, joints=("sph",), wgt=(0.0, -1.0, 0.0)):
    """n uniform rods of 1 m and 1 kg, from rest along +x, on ground; types of joints in turn.
    Of spherical ones, or of those and revolutes about y under a weight along -z, it is planar."""
    scene = dap.Scene(name=f"chain of {n}")
    outer = "ground.O"
    for k in range(n):
        body, keyword = f"b{k}", joints[k % len(joints)]
        scene.add_body(body, mass=1.0, Jp=ROD, r=(k + 0.5, 0.0, 0.0))
        inner = scene.add_point(f"in{k}", body, (-0.5, 0.0, 0.0))
        axes = {}
        if keyword == "rev":
            axes = {"a_i": f"{body}.y", "a_j": f"b{k - 1}.y" if k else "ground.y"}
        scene.add_joint(keyword, f"J{k}", P_i=inner, P_j=outer, **axes)
        outer = scene.add_point(f"out{k}", body, (0.5, 0.0, 0.0))
    scene.add_force("weight", "gravity", wgt=wgt)
    return scene


def everything():
    """A row of four-bars with springs, a free body, friction, a driver."""
    scene, first, last, joint = four_bars(9, tips="sph"), "crank1", "coupler9", "A5"
    bodies = list(scene.bodies)
    scene.add_body("loose", mass=2.0, Jp=(1.0, 1.1, 1.2), r=(0.0, 0.0, 3.0), w=(0.1, 0.2, 0.3))
    for n, (i, j) in enumerate([(first, bodies[0]), (first, last), (last, "ground"),
                                ("loose", last), ("loose", "ground")]):  # fmt: skip
        scene.add_force("ptp", f"spring{n}", P_i=f"{i}.O", P_j=f"{j}.O", k=20.0 + n, l0=0.3, c=0.5)
    scene.add_force("friction", "rub", joint=joint, mu=0.2, radius=0.05, v_tol=1e-3)
    scene.add_function("a", "turn", coeff=(0.0, 0.3, 0.1))
    scene.add_joint("rel-rot", "motor", body_i=first, a_j="ground.z", function="turn")
    return scene


def short_runs(dt):
    """Models and settings of runs of two instants dt, with every method and integrator."""
    short = {"t_end": 2.0 * dt, "dt": dt}
    return [
        ("fourbar3", short),
        ("fourbar3", short | {"method": "penalty"}),
        ("fourbar3", short | {"method": "lsq"}),
        ("pen2", short | {"integrator": "adams"}),
        ("pen2", short | {"method": "joint"}),
        ("pen2", short | {"integrator": "radau"}),
        ("fourbar2", short | {"integrator": "dopri5"}),
        ("pen1", short | {"integrator": "rk4", "step": 0.5 * dt}),
        ("bodies2", short),
        ("ball1", {"t_end": 0.5, "dt": 0.1, "allow_code": True}),
        ("tri", short),
    ]
