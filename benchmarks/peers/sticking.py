"""Contacts with a closed form beside MuJoCo and Drake: creep, a place of rest, rolling, a cradle.

``OMP_NUM_THREADS=1 build/peers-venv/bin/python benchmarks/peers/sticking.py`` prints a row of the
table in docs/reference/hard-cases.md for each scene, with all programs that are there; after
``make bench-peers`` these are all but dartpy. Each runs at the finest of its steps here.

dap3d goes by events. MuJoCo: Newton's method to its end, elliptic cones, contacts as stiff as the
step allows, with passes against slip ("noslip") and without. Drake: SAP, 1e10 N/m.
"""

import time
from dataclasses import replace

import numpy as np
from touching import INSTANTS, Body, G, Scene, ball, drake, error, mujoco

STEP = 5e-4


def slope(part):
    """A box on a slope, at a part of its cone: what counts is how far it creeps in a minute."""
    box = Body([0.3, 0.3, 0.2], 2.0, [0.0, 0.0, 0.1])
    angle = np.arctan(0.5 * part)
    return Scene([box], 0.5, 60.0, (STEP,), lambda t: [[0.0, 0.0, np.nan]], angle=angle)


def cradle():
    """Three balls in a row that touch, and one that strikes them: the last alone goes on."""
    R, v = 0.05, 2.0
    x = [-0.1 - 2.0 * R, 0.0, 2.0 * R, 4.0 * R]
    balls = [Body(R, 1.0, [at, 0.0, R], (0.0 if k else v, 0.0, 0.0)) for k, at in enumerate(x)]

    def exact(t):
        left = min(t, 0.1 / v)
        moved = [v * left, 0.0, 0.0, v * (t - left)]
        return [[at + d, 0.0, np.nan] for at, d in zip(x, moved, strict=True)]

    return Scene(balls, 0.0, 0.2, (STEP,), exact, e=1.0)


SCENES = {
    "creep in 60 s, slope at 0.95 of the cone": (lambda: slope(0.95), "m"),
    "creep in 60 s, slope at 0.999": (lambda: slope(0.999), "m"),
    "ball that slides, then rolls": (ball, "m"),
    "cradle of four, three touch": (cradle, "m"),
}


def of_dap3d():
    """Errors by events."""
    import dap3d_core as dap

    def run(scene):
        given = dap.Scene(name="beside others")
        given.add_force("weight", "gravity", gravity=G, wgt=scene.down.tolist())
        for k, body in enumerate(scene.bodies):
            given.add_body(f"b{k}", mass=body.mass, Jp=body.J.tolist(), r=body.x, r_dot=body.v)
            kind, size = ("ball", "radius") if body.sphere else ("box", "size")
            fields = {size: body.size, "mu": scene.mu, "e": 0.0}
            given.add_contact(f"{kind}_plane", P_i=f"b{k}.O", **fields)
            if k:
                ends = {"P_i": f"b{k - 1}.O", "P_j": f"b{k}.O"}
                radii = {"radius_i": body.size, "radius_j": body.size}
                given.add_contact("ball_ball", **ends, **radii, e=scene.e)
        dt = scene.t_end / INSTANTS
        return dap.simulate(given, t_end=scene.t_end, dt=dt, rtol=1e-10, atol=1e-12).r[1:]

    def spring(x):
        given = dap.Scene(name="block on a spring")
        given.add_body("block", mass=1.0, Jp=[0.01] * 3, r=[x, 0.0, 0.05])
        given.add_force("weight", "g", gravity=G)
        given.add_point("A", "ground", [-1.0, 0.0, 0.05])
        given.add_force("ptp", "spring", P_i="block.O", P_j="A", k=K, l0=1.0)
        given.add_contact("box_plane", "floor", P_i="block.O", size=[0.1, 0.1, 0.1], mu=MU)
        return dap.simulate(given, t_end=T, dt=T, rtol=1e-10, atol=1e-12).r[-1, 0, 0]

    def ladder(angle, half):
        given = dap.Scene(name="ladder")
        p = [np.cos(angle / 2.0), 0.0, np.sin(angle / 2.0), 0.0]
        given.add_body("ladder", mass=3.0, Jp=[0.01, 1.0, 1.0], p=p,
                       r=[half * np.cos(angle), 0.0, half * np.sin(angle)])  # fmt: skip
        for name, x in (("foot", half), ("top", -half)):
            given.add_point(name, "ladder", [x, 0.0, 0.0])
        given.add_force("weight", "g", gravity=G)
        given.add_contact("ball_plane", "floor", P_i="foot")
        given.add_contact("ball_plane", "wall", P_i="top", a_j="ground.x")
        result = dap.simulate(given, t_end=0.7, dt=0.05, rtol=1e-10, atol=1e-12)
        return next(e for e in result.events if e.kind == "lift").u[2] / half

    return {"dap3d": (lambda scene: error(scene, run(scene)), spring, ladder)}


#: Of the block on a spring: stiffness, friction, end of the run.
K, MU, T = 100.0, 0.4, 20.0
PLANES = """<mujoco><option timestep="{h}" gravity="0 0 -{g}" integrator="implicitfast"
  cone="elliptic" solver="Newton" iterations="500" tolerance="1e-15" impratio="100"
  noslip_iterations="{noslip}" noslip_tolerance="0"/>
  <default><geom solref="{soft} 1" solimp="0.9999 0.9999 0.001 0.5 2" friction="{mu} 0 0"
  condim="{condim}"/></default>
  <worldbody><geom type="plane" size="9 9 1"/>{more}</worldbody>{spring}</mujoco>"""
BLOCK = """<site name="A" pos="-1 0 0.05"/><body pos="{x} 0 0.05"><freejoint/>
  <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/><site name="B"/>
  <geom type="box" size="0.05 0.05 0.05"/></body>"""
SPRING = """<tendon><spatial stiffness="{k}" springlength="1"><site site="A"/><site site="B"/>
  </spatial></tendon>"""
LADDER = """<geom type="plane" size="9 9 1" zaxis="1 0 0"/>
  <body pos="{x} 0 {z}" euler="0 {a} 0"><freejoint/>
  <inertial pos="0 0 0" mass="3" diaginertia="0.01 1 1"/>
  <geom type="sphere" size="{r}" pos="{s} 0 0"/>
  <geom type="sphere" size="{r}" pos="-{s} 0 0"/></body>"""


def of_mujoco():
    """Errors, with passes against slip and without."""
    import mujoco as mj

    methods = mujoco()[1]

    def made(noslip, condim=3, h=STEP, spring="", **more):
        text = PLANES.format(h=h, g=G, noslip=noslip, soft=2.0 * h, mu=MU, condim=condim,
                             spring=spring, **more)  # fmt: skip
        model = mj.MjModel.from_xml_string(text)
        return model, mj.MjData(model)

    def spring(x, noslip):
        model, data = made(noslip, more=BLOCK.format(x=x), spring=SPRING.format(k=K))
        mj.mj_step(model, data, nstep=round(T / STEP))
        return data.qpos[0]

    def ladder(angle, half, noslip):
        r, h = 1e-3, 1e-4
        place = {"x": half * np.cos(angle) + r, "z": half * np.sin(angle) + r, "r": r, "s": half,
                 "a": np.degrees(angle)}  # fmt: skip
        model, data = made(noslip, condim=1, h=h, more=LADDER.format(**place))
        last, force = np.nan, np.zeros(6)
        for _ in range(round(0.7 / h)):
            mj.mj_step(model, data)
            for k in range(data.ncon):
                mj.mj_contactForce(model, data, k, force)
                if abs(data.contact[k].frame[0]) > 0.5 and force[0] > 0.0:
                    last = (data.qpos[2] - r) / half
        return last

    def runner(name, noslip):
        run = methods[name]

        def of_scene(scene):
            damped = replace(scene, e=min(scene.e, 0.99999))  # by a spring that has to be damped
            return error(scene, run(damped, STEP)[0])

        return (of_scene, lambda x: spring(x, noslip),
                lambda angle, half: ladder(angle, half, noslip))  # fmt: skip

    return {"MuJoCo, noslip": runner("Newton, noslip", 200), "MuJoCo": runner("Newton", 0)}


def of_drake():
    """Errors of what balls and boxes alone do."""
    run = drake()[1]["SAP, 1e10 N/m"]

    def of_scene(scene):
        found = run(scene, STEP)
        return None if found is None else error(scene, found[0])

    return {"Drake": (of_scene, None, None)}


def main():
    """Print the rows."""
    programs = {}
    for find in (of_dap3d, of_mujoco, of_drake):
        try:
            programs |= find()
        except ImportError as problem:
            print(f"left out: {problem}")
    limit = MU * G / K
    angle, half = 1.0, 1.0
    rows = {name: [run(make()) for run, _, _ in programs.values()]
            for name, (make, _) in SCENES.items()}  # fmt: skip
    rows["block on a spring, at rest at 0.99 of its limit"] = [
        abs(spring(2.99 * limit) + 0.99 * limit) if spring else None
        for _, spring, _ in programs.values()
    ]
    rows["ladder that leaves its wall, sin(angle)"] = [
        abs(fall(angle, half) - 2.0 / 3.0 * np.sin(angle)) if fall else None
        for _, _, fall in programs.values()
    ]
    print("| scene |", " | ".join(programs), "|")
    for name, values in rows.items():
        print(f"| {name} |", " | ".join("-" if v is None else f"{v:.1e}" for v in values), "|")


if __name__ == "__main__":
    began = time.process_time()
    main()
    print(f"{time.process_time() - began:.0f} s")
