"""Reference problems with closed forms or published digits, made through the public API."""

import dap3d_core as dap

ROD = (1e-3, 1 / 12, 1 / 12)  # uniform rod of 1 m and 1 kg along x, made thin but not infinitely so


def pendulum():
    """IFToMM A01: 1 kg on a massless rod of 1 m, released at rest at (-1, 0), gravity along -y."""
    scene = dap.Scene(name="A01")
    scene.add_body("bob", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(-1.0, 0.0, 0.0))
    scene.add_joint("sph-sph", "rod", P_i="bob.O", P_j="ground.O", length=1.0)
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    return scene


def four_bar():
    """IFToMM A02 with N = 1, made free of redundancy.
    The cranks turn on revolutes, the coupler hangs on two spherical joints."""
    scene = dap.Scene(name="A02")
    for k in range(2):
        crank, low, pivot = f"crank{k}", f"low{k}", f"pivot{k}"
        scene.add_body(crank, mass=1.0, Jp=(1 / 12, 1e-3, 1 / 12), r=(k, 0.5, 0.0),
                       r_dot=(0.5, 0.0, 0.0), w=(0.0, 0.0, -1.0))  # fmt: skip
        scene.add_point(low, crank, (0.0, -0.5, 0.0))
        scene.add_point(f"high{k}", crank, (0.0, 0.5, 0.0))
        scene.add_point(pivot, "ground", (float(k), 0.0, 0.0))
        scene.add_joint("rev", f"A{k}", P_i=low, P_j=pivot, a_i=f"{crank}.z", a_j="ground.z")
    scene.add_body("coupler", mass=1.0, Jp=ROD, r=(0.5, 1.0, 0.0), r_dot=(1.0, 0.0, 0.0))
    for k in range(2):
        scene.add_point(f"end{k}", "coupler", (k - 0.5, 0.0, 0.0))
        scene.add_joint("sph", f"B{k}", P_i=f"end{k}", P_j=f"high{k}")
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    return scene


def free_body(Jp, w, **more):
    """One body with principal inertias Jp, body components w of omega, p = identity, no forces."""
    scene = dap.Scene(name="free body")
    scene.add_body("top", mass=1.0, Jp=Jp, w=w, **more)
    return scene


def heavy_top(theta, spin, precession):
    """G4: symmetric heavy top in steady precession.
    The mass centre is 0.1 m from the pivot; A = 0.02 about the pivot, C = 0.005."""
    import numpy as np

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


def chain(n):
    """n uniform rods of 1 m and 1 kg, planar, from rest along +x, on ground, gravity along -y."""
    scene = dap.Scene(name=f"chain of {n}")
    outer = "ground.O"
    for k in range(n):
        scene.add_body(f"b{k}", mass=1.0, Jp=ROD, r=(k + 0.5, 0.0, 0.0))
        scene.add_point(f"in{k}", f"b{k}", (-0.5, 0.0, 0.0))
        scene.add_joint("sph", f"J{k}", P_i=f"in{k}", P_j=outer)
        outer = scene.add_point(f"out{k}", f"b{k}", (0.5, 0.0, 0.0))
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    return scene


def row_of_four_bars(count):
    """Cranks on revolutes to ground, neighbours joined by couplers on spherical joints."""
    scene = dap.Scene(name="four-bars")
    for k in range(count + 1):
        scene.add_body(f"crank{k}", mass=1.0, Jp=(0.1, 0.02, 0.1), r=(float(k), 0.5, 0.0))
        scene.add_point(f"A{k}", f"crank{k}", (0.0, -0.5, 0.0))
        scene.add_point(f"B{k}", f"crank{k}", (0.0, 0.5, 0.0))
        scene.add_point(f"O{k}", "ground", (float(k), 0.0, 0.0))
        scene.add_joint("rev", f"R{k}", P_i=f"A{k}", P_j=f"O{k}", a_i=f"crank{k}.z", a_j="ground.z")
    for k in range(count):
        scene.add_body(f"rod{k}", mass=1.0, Jp=(0.02, 0.1, 0.1), r=(k + 0.5, 1.0, 0.0))
        for side, x in ((0, -0.5), (1, 0.5)):
            scene.add_point(f"C{k}_{side}", f"rod{k}", (x, 0.0, 0.0))
            scene.add_joint("sph", f"S{k}_{side}", P_i=f"C{k}_{side}", P_j=f"B{k + side}")
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    return scene


def everything():
    """A row of four-bars with springs, a free body, friction, a driver."""
    scene, first, last, joint = row_of_four_bars(9), "crank1", "rod8", "R5"
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
