"""Contacts by time stepping beside MuJoCo, Drake and DART: error and overlap against time a step.

``OMP_NUM_THREADS=1 build/peers-venv/bin/python benchmarks/peers/touching.py``, some minutes, after
``make bench-peers`` has made that environment, to which dartpy is to be added. ``--scenes`` and
``--programs`` choose; other rows stay. Then ``document.py`` renews docs/reference/peers.md.

Programs that are not there are named and left out. Each scene is given once, neutrally; errors are
those of mass centres, overlaps are computed from them, not asked of the programs, both at ten
instants. CPU time of the process, one thread, without what is made before the first step.
"""

import argparse
import importlib.metadata
import json
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

RESULTS = Path(__file__).with_name("touching.json")
G, INSTANTS = 9.81, 10


@dataclass
class Body:
    """A sphere (``size``: radius) or a box (``size``: edges) that rests upright at the start."""

    size: float | list
    mass: float
    x: list
    v: tuple = (0.0, 0.0, 0.0)

    @property
    def sphere(self):
        return isinstance(self.size, float)

    @property
    def J(self):
        """Principal inertias, kg m^2."""
        if self.sphere:
            return np.full(3, 0.4 * self.mass * self.size**2)
        squares = np.array(self.size) ** 2
        return self.mass / 12.0 * (squares.sum() - squares)


@dataclass
class Scene:
    """Bodies over the floor z = 0, within walls if there are any; gravity may be aslant."""

    bodies: list
    mu: float
    t_end: float
    steps: tuple
    exact: object = None  # of t: positions of all bodies that are known, else NaN
    e: float = 0.0
    angle: float = 0.0
    side: float = 0.0  # of the square that walls stand round

    @property
    def down(self):
        """Direction of gravity."""
        return np.array([np.sin(self.angle), 0.0, -np.cos(self.angle)])

    @property
    def planes(self):
        """(point, normal) of the floor and walls."""
        floor = [([0, 0, 0], [0, 0, 1])]
        if not self.side:
            return floor
        far = self.side
        return [*floor, ([0, 0, 0], [1, 0, 0]), ([0, 0, 0], [0, 1, 0]),
                ([far, 0, 0], [-1, 0, 0]), ([0, far, 0], [0, -1, 0])]  # fmt: skip


def slope():
    """A box on a slope of 0.35 rad within its cone; what counts is how far it creeps."""
    box = Body([0.3, 0.3, 0.2], 2.0, [0.0, 0.0, 0.1])
    return Scene([box], 0.5, 60.0, (5e-3, 1e-3), lambda t: [[0.0, 0.0, np.nan]], angle=0.35)


def tower():
    """Twenty boxes, the top one 1000 times as heavy; all of it stands."""
    boxes = [Body([0.1] * 3, m, [0.0, 0.0, 0.05 + 0.1 * k])
             for k, m in enumerate([1.0] * 19 + [1000.0])]  # fmt: skip
    return Scene(boxes, 0.5, 10.0, (5e-3, 1e-3), lambda t: [b.x for b in boxes])


def ball():
    """A ball that slides, then rolls."""
    v, mu = 3.0, 0.3
    end = 2.0 / 7.0 * v / (mu * G)

    def exact(t):
        s = min(t, end)
        return [[v * s - 0.5 * mu * G * s**2 + 5.0 / 7.0 * v * (t - s), 0.0, np.nan]]

    steps = (1e-2, 2e-3, 5e-4, 1e-4, 2e-5, 4e-6)
    return Scene([Body(0.1, 2.0, [0, 0, 0.1], (v, 0.0, 0.0))], mu, 1.0, steps, exact)


def bounce():
    """A box that falls flat from 0.2 s of fall and bounces by e = 0.5."""
    fall, e = 0.2, 0.5

    def exact(t):
        if t <= fall:
            return [[0.0, 0.0, 0.1 + 0.5 * G * (fall**2 - t**2)]]
        at, v = fall, e * G * fall
        while t > at + 2.0 * v / G:
            at, v = at + 2.0 * v / G, e * v
        return [[0.0, 0.0, 0.1 + v * (t - at) - 0.5 * G * (t - at) ** 2]]

    box = Body([0.4, 0.4, 0.2], 2.0, [0.0, 0.0, 0.1 + 0.5 * G * fall**2])
    return Scene([box], 0.0, 0.5, (1e-2, 2e-3, 5e-4, 1e-4, 2e-5), exact, e)


def spheres(count=200):
    """Spheres that settle in a box; there is no closed form: overlap and time."""
    R, per = 0.05, 5
    rng, bodies = np.random.default_rng(0), []
    for k in range(count):
        place = np.array([k % per, k // per % per, k // per**2]) + 0.5
        x = 2.2 * R * place + 0.1 * R * rng.uniform(-1.0, 1.0, 3)
        bodies.append(Body(R, 1.0, x.tolist()))
    return Scene(bodies, 0.5, 1.0, (4e-3,), side=2.2 * R * per)


SCENES = {f.__name__: f for f in (slope, tower, ball, bounce, spheres)}


# Programs: each gives {method: maker}; a maker gets scene and h, gives what moves on by n steps and
# returns all mass centres. None: there is no such run.


def dap3d():
    """Stepping on shapes, and events on declared contacts where there are few."""
    import dap3d_core as dap

    def made(scene, declared):
        given = dap.Scene(name="touching")
        given.add_force("weight", "gravity", gravity=G, wgt=scene.down.tolist())
        material = {"mu": scene.mu, "e": scene.e}
        for k, body in enumerate(scene.bodies):
            given.add_body(f"b{k}", mass=body.mass, Jp=body.J.tolist(), r=body.x, r_dot=body.v)
            shape = {"radius": body.size} if body.sphere else {"size": body.size}
            kind = "sphere" if body.sphere else "box"
            if declared:
                kind = "ball" if body.sphere else "box"
                given.add_contact(f"{kind}_plane", P_i=f"b{k}.O", **shape, **material)
            else:
                given.add_shape(kind, body=f"b{k}", collides=True, **shape)
        if not declared:
            for at, normal in scene.planes:
                given.add_shape("plane", body="ground", at=at, normal=normal, collides=True)
            given.add_material("surface", **material)
            given.add_collisions(material="surface")
        return dap.compile(given)

    def whole(scene, h, declared, **settings):
        compiled, t_end = made(scene, declared), scene.t_end
        dap.simulate(compiled, t_end=2.0 * (h or 5e-3), **settings)  # compiles
        before = time.process_time()
        result = dap.simulate(compiled, t_end=t_end, dt=t_end / INSTANTS, **settings)
        return result.r[1:], time.process_time() - before

    def stepping(scene, h):
        if h is None:
            return None
        rtol = {} if scene.exact else {"rtol": 1e-4}
        return whole(scene, h, False, contact="stepping", contact_step=h, **rtol)

    def events(scene, h):
        if len(scene.bodies) > 1 or h is not None:
            return None
        return whole(scene, h, True, contact="events", rtol=1e-10)

    return importlib.metadata.version("dap3d"), {"stepping": stepping, "events": events}


def timed(scene, h, move):
    """Positions at the instants and CPU seconds of ``move``, which does so many steps."""
    places, seconds = [], 0.0
    count = round(scene.t_end / INSTANTS / h) if h else 0
    for _ in range(INSTANTS):
        before = time.process_time()
        x = move(count)
        seconds += time.process_time() - before
        places.append(x)
    return np.array(places), seconds


def damping(e):
    """Damping ratio of a spring that a body leaves without force at e times its speed."""
    from scipy.optimize import brentq

    def left(z):
        w = np.sqrt(1.0 - z * z)
        return np.exp(-z / w * (np.pi - np.arctan2(2.0 * z * w, w * w - z * z))) - e

    return brentq(left, 1e-6, 0.9)


def mujoco():
    """As hard as its step lets it: stiffness, impedance and weight of friction; all iterations."""
    import mujoco as mj

    def model_of(scene, h, solver, noslip, slow, soft):
        spec = mj.MjSpec()
        option = spec.option
        option.timestep, option.gravity, option.solver = h, (G * scene.down).tolist(), solver
        option.integrator = mj.mjtIntegrator.mjINT_IMPLICITFAST
        spec.memory = 500_000_000
        material = {"condim": 3, "friction": [scene.mu, 0.0, 0.0]}
        if scene.mu == 0.0:
            material = {"condim": 1}
        if not soft:
            option.cone, option.impratio = mj.mjtCone.mjCONE_ELLIPTIC, 100.0
            option.iterations, option.tolerance = 500, 1e-15
            option.noslip_iterations, option.noslip_tolerance = noslip, 0.0
            material["solref"] = [slow or 2.0 * h, 1.0]
            material["solimp"] = [0.9999, 0.9999, 1e-3, 0.5, 2.0]
            if scene.e:
                w, z = np.pi / np.sqrt(0.1 * h), damping(scene.e)  # longer than steps, yet brief
                material["solref"] = [-(w**2), -2.0 * z * w]
        for at, normal in scene.planes:
            up = np.zeros(4)
            mj.mju_quatZ2Vec(up, np.array(normal, dtype=float))
            spec.worldbody.add_geom(type=mj.mjtGeom.mjGEOM_PLANE, size=[5, 5, 1], pos=at,
                                    quat=up, **material)  # fmt: skip
        for body in scene.bodies:
            one = spec.worldbody.add_body(pos=body.x, mass=body.mass, inertia=body.J,
                                          ipos=[0, 0, 0], explicitinertial=True)  # fmt: skip
            one.add_freejoint()
            kind = mj.mjtGeom.mjGEOM_SPHERE if body.sphere else mj.mjtGeom.mjGEOM_BOX
            size = [body.size, 0, 0] if body.sphere else [0.5 * s for s in body.size]
            one.add_geom(type=kind, size=size, **material)
        return spec.compile()

    def maker(solver, noslip=0, slow=None, soft=False):
        def run(scene, h):
            if h is None or (slow and scene.e):  # a bounce has a spring of its own
                return None
            model = model_of(scene, h, solver, noslip, slow, soft)
            data = mj.MjData(model)
            data.qvel.reshape(-1, 6)[:, :3] = [body.v for body in scene.bodies]

            def move(count):
                mj.mj_step(model, data, nstep=count)
                return data.qpos.reshape(-1, 7)[:, :3].copy()

            return timed(scene, h, move)

        return run

    newton, cg = mj.mjtSolver.mjSOL_NEWTON, mj.mjtSolver.mjSOL_CG
    return mj.__version__, {
        "as it comes": maker(newton, soft=True),
        "Newton": maker(newton),
        "Newton, 20 ms": maker(newton, slow=0.02),
        "CG": maker(cg),
        "Newton, noslip": maker(newton, 200),
        "CG, noslip": maker(cg, 200),
    }


def drake():
    """Point contacts, boxes on small balls at their corners; SAP near rigid, CENIC by accuracy."""
    from pydrake.geometry import AddContactMaterial, HalfSpace, ProximityProperties, Sphere
    from pydrake.math import RigidTransform
    from pydrake.multibody.math import SpatialVelocity
    from pydrake.multibody.plant import (
        AddMultibodyPlantSceneGraph,
        CoulombFriction,
        DiscreteContactApproximation,
    )
    from pydrake.multibody.tree import SpatialInertia, UnitInertia
    from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
    from pydrake.systems.framework import DiagramBuilder

    corner = 1e-3  # m, radius of a ball in a corner

    def plant_of(scene, h, stiffness):
        builder = DiagramBuilder()
        plant, _ = AddMultibodyPlantSceneGraph(builder, h)
        if h:
            plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        plant.set_stiction_tolerance(1e-7)
        plant.mutable_gravity_field().set_gravity_vector(G * scene.down)
        surface = ProximityProperties()
        AddContactMaterial(dissipation=None, point_stiffness=stiffness, properties=surface,
                           friction=CoulombFriction(scene.mu, scene.mu))  # fmt: skip
        surface.AddProperty("material", "relaxation_time", 1e-3)
        for k, (at, normal) in enumerate(scene.planes):
            pose = HalfSpace.MakePose(np.array(normal, float), np.array(at, float))
            plant.RegisterCollisionGeometry(plant.world_body(), pose, HalfSpace(), f"p{k}", surface)
        for k, body in enumerate(scene.bodies):
            unit = UnitInertia(*(body.J / body.mass))
            one = plant.AddRigidBody(f"b{k}", SpatialInertia(body.mass, np.zeros(3), unit))
            places, radius = [np.zeros(3)], body.size
            if not body.sphere:
                radius, half = corner, 0.5 * np.array(body.size) - corner
                places = [half * [x, y, -1] for x in (-1, 1) for y in (-1, 1)]
            for j, place in enumerate(places):
                plant.RegisterCollisionGeometry(one, RigidTransform(place), Sphere(radius),
                                                f"b{k}c{j}", surface)  # fmt: skip
        plant.Finalize()
        return builder.Build(), plant

    def started(scene, h, stiffness):
        diagram, plant = plant_of(scene, h, stiffness)
        context = diagram.CreateDefaultContext()
        mine = plant.GetMyMutableContextFromRoot(context)
        bodies = [plant.GetBodyByName(f"b{k}") for k in range(len(scene.bodies))]
        for one, body in zip(bodies, scene.bodies, strict=True):
            plant.SetFreeBodyPose(mine, one, RigidTransform(np.array(body.x, float)))
            speed = SpatialVelocity(np.zeros(3), np.array(body.v, float))
            plant.SetFreeBodySpatialVelocity(context=mine, body=one, V_JpJc=speed)
        simulator = Simulator(diagram, context)

        def places():
            return np.array([plant.EvalBodyPoseInWorld(mine, b).translation() for b in bodies])

        return simulator, context, places

    def run(scene, h, accuracy=None, stiffness=1e10):
        boxes = len(scene.bodies) > 1 and not scene.bodies[0].sphere
        if scene.e or boxes or (h is None) != bool(accuracy):
            return None  # it has no coefficient of restitution; boxes on boxes need other contacts
        simulator, context, places = started(scene, h or 0.0, stiffness)
        if accuracy:
            ApplySimulatorConfig(SimulatorConfig(integration_scheme="cenic", accuracy=accuracy,
                                                 max_step_size=0.1), simulator)  # fmt: skip
        simulator.Initialize()

        def move(_):
            simulator.AdvanceTo(context.get_time() + scene.t_end / INSTANTS)
            return places()

        return timed(scene, h, move)

    methods = {"SAP, 1e6 N/m": lambda s, h: run(s, h, stiffness=1e6), "SAP, 1e10 N/m": run}
    for accuracy in (1e-3, 1e-6, 1e-9):
        methods[f"CENIC, accuracy {accuracy:.0e}"] = lambda s, h, a=accuracy: run(s, h, a)
    return importlib.metadata.version("drake"), methods


def dart():
    """Complementarity by Dantzig's method, as ODE's; contacts by FCL, its default, or by Bullet."""
    import dartpy

    def run(scene, h, detector):
        if h is None:
            return None
        world = dartpy.simulation.World()
        world.setCollisionDetector(detector())
        world.setTimeStep(h)
        world.setGravity(G * scene.down)
        dynamics = dartpy.dynamics

        def surface(node, shape):
            held = node.createShapeNode(shape)
            held.createCollisionAspect()
            held.createDynamicsAspect()
            held.getDynamicsAspect().setFrictionCoeff(scene.mu)
            held.getDynamicsAspect().setRestitutionCoeff(np.sqrt(scene.e))
            return held

        for at, normal in scene.planes:
            skeleton = dynamics.Skeleton("")
            _, node = skeleton.createWeldJointAndBodyNodePair()
            n = np.array(normal, float)
            surface(node, dynamics.PlaneShape(n, float(n @ at)))
            world.addSkeleton(skeleton)
        nodes = []
        for k, body in enumerate(scene.bodies):
            skeleton = dynamics.Skeleton(f"b{k}")
            _, node = skeleton.createFreeJointAndBodyNodePair()
            surface(node, dynamics.SphereShape(body.size) if body.sphere
                    else dynamics.BoxShape(np.array(body.size)))  # fmt: skip
            node.setInertia(dynamics.Inertia(body.mass, np.zeros(3), np.diag(body.J)))
            skeleton.setPositions([0.0, 0.0, 0.0, *body.x])
            skeleton.setVelocities([0.0, 0.0, 0.0, *body.v])
            world.addSkeleton(skeleton)
            nodes.append(node)

        def move(count):
            for _ in range(count):
                world.step()
            return np.array([node.getTransform().translation() for node in nodes])

        return timed(scene, h, move)

    shapes = dartpy.collision
    return dartpy.__version__, {
        "Dantzig, FCL": lambda s, h: run(s, h, shapes.FCLCollisionDetector),
        "Dantzig, Bullet": lambda s, h: run(s, h, shapes.BulletCollisionDetector),
    }


PROGRAMS = {f.__name__: f for f in (dap3d, mujoco, drake, dart)}


def error(scene, places):
    """Largest error of a mass centre over the instants, m; None without a closed form."""
    if scene.exact is None:
        return None
    times = scene.t_end / INSTANTS * np.arange(1, INSTANTS + 1)
    return float(np.nanmax(np.abs(places - np.array([scene.exact(t) for t in times]))))


def overlap(scene, places):
    """Largest overlap over the instants, m; boxes stand upright one over the other."""
    half = np.array([b.size if b.sphere else 0.5 * b.size[2] for b in scene.bodies])
    least = 0.0
    for x in places:
        for at, normal in scene.planes:
            least = min(least, ((x - at) @ normal - half).min())
        if len(half) > 1 and scene.bodies[0].sphere:
            i, j = np.triu_indices(len(half), 1)
            least = min(least, (np.linalg.norm(x[i] - x[j], axis=1) - half[i] - half[j]).min())
        elif len(half) > 1:
            least = min(least, (np.diff(x[:, 2]) - half[1:] - half[:-1]).min())
    return float(abs(least))


#: Seconds after which no finer step of a method is tried.
CAP = 8.0


def climb(scene, run):
    """Rows of one method from coarse to fine."""
    for h in (None, *scene.steps):  # None: it finds its own steps
        found = run(scene, h)
        if found is None:
            continue
        places, seconds = found
        if not np.isfinite(places).all():
            yield {"step": h, "error": None, "overlap": None, "seconds": seconds}
            continue
        yield {"step": h, "error": error(scene, places), "overlap": overlap(scene, places),
               "seconds": float(f"{seconds:.4g}")}  # fmt: skip
        if seconds > CAP:
            return


def ladders(rows):
    """Rows by (scene, program, method)."""
    found = {}
    for row in rows:
        found.setdefault((row["scene"], row["program"], row["method"]), []).append(row)
    return found


def seconds_a_step(row):
    """CPU time of one step."""
    return row["seconds"] * row["step"] / SCENES[row["scene"]]().t_end


def main():
    """Measure, print, store."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--programs", default=",".join(PROGRAMS))
    parser.add_argument("-o", "--output", type=Path, default=RESULTS)
    given = parser.parse_args()
    chosen, programs = given.scenes.split(","), given.programs.split(",")
    if wrong := {*chosen} - {*SCENES} | {*programs} - {*PROGRAMS}:
        parser.error(f"unknown: {', '.join(sorted(wrong))}; there are {', '.join(SCENES)}; "
                     f"{', '.join(PROGRAMS)}")  # fmt: skip
    kept = json.loads(given.output.read_text()) if given.output.exists() else {}
    versions, rows, there = kept.get("versions", {}), [], {}
    for name in programs:
        try:
            versions[name], there[name] = PROGRAMS[name]()
        except ImportError as missing:
            print(f"{name} was skipped: {missing}")
    for key in chosen:
        scene = SCENES[key]()
        for program, methods in there.items():
            for method, run in methods.items():
                for row in climb(scene, run):
                    row = {"scene": key, "program": program, "method": method, **row}
                    rows.append(row)
                    print(json.dumps(row), flush=True)
    rows += [row for row in kept.get("rows", [])
             if row["scene"] not in chosen or row["program"] not in there]  # fmt: skip
    rows.sort(key=lambda row: list(SCENES).index(row["scene"]))
    lines = ",\n".join(json.dumps(row) for row in rows)
    given.output.write_text(f'{{"versions": {json.dumps(versions)}, "rows": [\n{lines}\n]}}\n')
    print(f"written to {given.output}")


if __name__ == "__main__":
    main()
