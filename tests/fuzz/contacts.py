"""Random scenes that touch with friction go on, or end with one clear error.
An input is the number of a scene. Of balls and boxes, half of them with a linkage as well, that has
limits, stops and friction; from ``LEGS`` on a body stands on 2 to 4 legs that share it; from
``RESISTING`` on balls resist rolling and spinning; from ``VARIED`` on the scenes are those of
varied_contacts.py, by several integrators and methods, with drivers and springs.
Energy is never gained, nothing sinks in, all numbers are finite, and forces obey Newton's and
Coulomb's laws, of which the scene alone says the numbers. Some are run in another way as well."""

import collections
import time

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.ended import EndedError

import dap3d_core as dap
from dap3d_core.formulations.programs import change_over
from fuzz.varied_contacts import settings_of, varied_scene

#: s simulated, and of varied scenes; s of CPU time after which a run hangs.
SPAN, SHORT, HANG = 1.0, 0.3, 20.0
SETTINGS = {"rtol": 1e-10, "atol": 1e-12, "integrator": "dop853", "contact": "events"}
#: Gains of energy, and depths, as parts of energy and length of the scene. Where a run reports
#: between events a gap is as good as the state: so many times its relative tolerance.
GAIN, DEPTH, EXACT = 1e-9, 1e-9, 1e-10
#: Words of the errors that a run may end with.
ENDINGS = ("jams", "rattle", "asks for steps as short")
#: Number of the first scene of legs.
LEGS = 10**6
#: And of those that resist rolling; no legs or boxes, whose contacts may take turns then: ``auto``
#: steps. And of those that touch early.
RESISTING, VARIED = 2 * LEGS, 3 * LEGS
#: Forces, N, and slips, m/s, that are rounding of such scenes: forces are some 1e2, of slips of 1.
FORCE, SLIP = 1e-6, 1e-8
#: One scene of so many runs by programs of its own, each of which takes seconds to make, and one
#: is run in another way.
WITH_PROGRAMS, COMPARED = 50, 10
#: A prime that spreads the small numbers that are drawn most often.
SPREAD = 2_654_435_761
#: Part of the state by which two ways may differ behind an impact and some slip.
SAME = 1e-5


def numbers():
    """Numbers of scenes, spread evenly: nine of ten are varied, the others take longer."""
    return st.integers(0, 2**32).map(lambda n: str(n * SPREAD % (10 * VARIED)).encode())


def scene_of(number):
    """The scene of a number."""
    if number >= VARIED:
        return varied_scene(number)
    if number < RESISTING:
        return scene_on_legs(number) if number >= LEGS else scene_that_falls(number)
    scene = scene_that_falls(number - RESISTING)
    add_resistance(scene, np.random.default_rng([number, 2]))
    return scene


def scene_that_falls(number):
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


def add_resistance(scene, rng):
    """What resists rolling and spinning at some of the balls."""
    for contact in scene.contacts.values():
        if contact.type == "box_plane":
            continue
        lengths = rng.choice([0.0, 0.001, 0.02], size=2)
        contact.fields.update(mu_roll=float(lengths[0]), mu_spin=float(lengths[1]))


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


def scene_on_legs(number):
    """A body on 2 to 4 legs on a slope: at rest, sliding, falling, pulled, or with a pendulum."""
    rng = np.random.default_rng(number)
    scene = dap.Scene(name=f"legs {number}")
    scene.add_force("weight", "g")
    count, h = int(rng.integers(2, 5)), float(rng.uniform(0.1, 0.5))
    angle = float(rng.choice([0.0, 0.2, 0.5]))
    c, s = np.cos(angle), np.sin(angle)
    R, p = (
        np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]),
        [np.cos(angle / 2), 0, -np.sin(angle / 2), 0],
    )
    scene.add_vector("n", "ground", R[:, 2])
    v, w = rng.choice([0.0, 1.0]) * R @ [*rng.normal(size=2), 0], R @ [0, 0, 3 * rng.normal()]
    w, centre = w * rng.choice([0.0, 1.0]), h + float(rng.choice([0.0, 0.03]))
    scene.add_body("b", mass=float(rng.uniform(0.5, 5)), Jp=0.05 * rng.uniform(1, 1.9, size=3), p=p,
                   r=R @ [0, 0, centre], r_dot=v, w=w)  # fmt: skip
    alike, law = rng.random() < 0.5, {}
    for k in range(count):
        if not (alike and law):
            mu = float(rng.choice([0.0, 0.2, 0.5, 1.0]))
            law = {"mu": mu, "mu_s": mu * float(rng.choice([1.0, 1.3])),
                   "e": float(rng.choice([0.0, 0.4]))}  # fmt: skip
        a, reach = 2 * np.pi * k / count + 0.3 * rng.normal(), rng.uniform(0.2, 0.4)
        scene.add_point(f"f{k}", "b", [reach * np.cos(a), reach * np.sin(a), -h])
        scene.add_contact("ball_plane", f"c{k}", P_i=f"f{k}", a_j="n", **law)
    kind = rng.integers(3)
    if kind == 1:
        scene.add_point("A", "ground", R @ [rng.uniform(0.5, 1.5), 0.5 * rng.normal(), h])
        scene.add_force("ptp", "spring", P_i="b.O", P_j="A", k=float(rng.uniform(2, 60)), l0=0.5)
    elif kind == 2:
        at = R @ [0.3, 0, 0.2]
        scene.add_body("arm", mass=1.0, Jp=[0.001, 0.02, 0.02], p=p, r=R @ [0, 0, centre] + at,
                       r_dot=v + np.cross(w, at), w=w)  # fmt: skip
        scene.add_point("pin", "arm", [-0.3, 0, 0])
        scene.add_point("eye", "b", [0, 0, 0.2])
        scene.add_joint("rev", "hinge", P_i="pin", P_j="eye", a_i="arm.y", a_j="b.y")
    return scene


def check_laws(scene, contact, name, depth):
    """Complementarity and Coulomb's law of a contact of the scene, at all reported instants.

    Of what resists rolling or spinning the same of moments.
    """
    contact_name, _, how = name.partition("#")[0].partition("_")
    fields = scene.contacts[contact_name].fields
    fields = {"mu": fields[f"mu_{how}"]} if how else fields
    mu, N, T = fields["mu"], contact.normal_force, contact.friction
    size, slip = np.linalg.norm(T, axis=-1), np.linalg.norm(contact.slip, axis=-1)
    rest = FORCE * (1.0 + N)
    open_, slides, sticks = (contact.mode == k for k in range(3))
    assert np.all(N >= -FORCE), name
    assert np.all(size[open_] + np.abs(N[open_]) == 0.0), name
    assert np.all(np.abs(contact.gap[~open_]) <= depth), name
    assert np.all(size[sticks] <= (fields.get("mu_s", mu) * N + rest)[sticks]), name
    assert np.all(slip[sticks] <= SLIP), name
    fast = slides & (slip > 1e3 * SLIP)
    against = T + mu * (N / np.where(fast, slip, 1.0))[..., None] * contact.slip
    assert np.all(np.linalg.norm(against, axis=-1)[fast] <= rest[fast]), name
    assert np.all(np.abs(size - mu * N)[slides] <= rest[slides]), name


def check_newton(scene, result):
    """Newton's and Euler's laws of bodies that contacts and weight alone act on."""
    held = {str(given).partition(".")[0] for one in (*scene.joints.values(), *scene.forces.values())
            for given in one.fields.values()}  # fmt: skip
    held |= {point.body for name, point in scene.points.items() if name in held}
    if any("roll" in name or "spin" in name for name in result.contact_names):
        return
    table, place = result.contacts, {t: k for k, t in enumerate(result.t)}
    for b, (name, body) in enumerate(scene.bodies.items()):
        if name in held:
            continue
        rows = table.of(name)
        force, moment = np.zeros((2, len(result.t), 3))
        at = np.array([place[t] for t in rows.t], dtype=int)
        np.add.at(force, at, rows.force)
        np.add.at(moment, at, np.cross(rows.point - result.r[at, b], rows.force))
        left = body.mass * (result.rdd[:, b] + [0.0, 0.0, 9.81]) - force
        assert np.max(np.abs(left)) <= FORCE * (1.0 + np.max(np.abs(force))), name
        A = Rotation.from_quat(np.roll(result.p[:, b], -1, axis=-1)).as_matrix()
        J = A * np.asarray(body.Jp) @ A.swapaxes(1, 2)
        spin = np.einsum("tij,tj->ti", J, result.w[:, b])
        left = np.einsum("tij,tj->ti", J, result.wd[:, b]) + np.cross(result.w[:, b], spin) - moment
        assert np.max(np.abs(left)) <= FORCE * (1.0 + np.max(np.abs(force))), name


def check_energy(scene, result, exact):
    """No contact gives energy, nor does what is between them.

    Drivers do, and Newton's law of impacts beside friction (Kane and Levinson, Dynamics, 1985), and
    beside other laws or e, of which a note tells.
    """
    energy, given = result.energy.total, result.energy.potential
    size = np.max(np.abs(result.energy.kinetic)) + np.ptp(given) + 9.81 * len(scene.bodies)
    driven = any(joint.type.startswith("drive") for joint in scene.joints.values())
    laws = [contact.fields for contact in scene.contacts.values()]
    words, sizes = ({law.get(key) for law in laws} for key in ("law", "e"))
    mixes = len(words) > 1 or len(sizes) > 1 or any(law["mu"] > 0.0 for law in laws)
    gains = "newton" in words and mixes
    if not driven and not gains:
        assert np.max(np.diff(energy), initial=0.0) <= GAIN * exact * size
        work = collections.Counter()
        for event in result.events:
            work[event.t] += event.work
        assert max(work.values(), default=0.0) <= GAIN * exact * size
    assert result.ledger["energy"].ok


def check_other_way(scene, result, given):
    """As far as the second impact the same motion by another integrator, or method."""
    impacts = [event.t for event in result.events if event.kind == "impact"][1:]
    end = min(impacts, default=result.t[-1])
    last = int(np.searchsorted(result.t, end, side="right")) - 1
    if last < 1:
        return
    if given.get("method") != "joint" and not scene.joints:
        other = {"method": "joint", "integrator": "dop853"}
    else:
        integrator = "radau" if given["integrator"] == "dop853" else "dop853"
        other = {"method": "lsq", "integrator": integrator}
    again = dap.simulate(scene, **(given | other | {"t_end": float(result.t[last])}))
    size = 1.0 + np.max(np.abs(result.u[: last + 1]))
    assert np.max(np.abs(again.u - result.u[: last + 1])) <= SAME * size


def check_contacts(data: bytes) -> str:
    """How the run of a scene ended, in words."""
    number, began = int(data), time.process_time()
    scene, given, span = scene_of(number), SETTINGS, SPAN
    if number >= VARIED:
        given, span = SETTINGS | settings_of(number), SHORT
    given, exact = given | {"t_end": span, "dt": span / 30}, given["rtol"] / EXACT

    def watch(_):
        if time.process_time() - began > HANG:
            raise EndedError

    said, most = "", change_over.MOST_BODIES
    change_over.MOST_BODIES = 0 if number % WITH_PROGRAMS else most
    try:
        result = dap.simulate(scene, watch=watch, **given)
    except dap.SimulationError as error:
        said, result = str(error), error.result
    finally:
        change_over.MOST_BODIES = most
    names = result.contact_names if result else scene.contacts
    words = next((w for w in ENDINGS if w in said), "")
    assert not said or (words and any(name in said for name in names)), said
    if result is None:  # it jams where it begins
        return words
    assert np.isfinite(result.u).all()
    check_energy(scene, result, exact)
    for name in names:
        contact = result.contact(name)
        assert np.min(contact.gap) >= -DEPTH * exact, name
        if name.partition("#")[0].partition("_")[0] in scene.contacts:
            check_laws(scene, contact, name, DEPTH * exact)
    check_newton(scene, result)
    if number % COMPARED == 0:
        check_other_way(scene, result, given)
    return words or "done"
