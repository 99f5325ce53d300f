"""Contacts: what closed forms, creep and impacts are off by, and what contacts cost.

Scenes of closed forms are those of tests/verification/test_contacts.py. CPU time of this thread.
"""

import time

import numpy as np
from right_hand_side import repeat
from timing import wait_for_good_code
from verification.test_contacts import TIGHT, G, ball, slope, spring_block, times

import dap3d_core as dap
from dap3d_core.formulations import RHS
from dap3d_core.formulations.contacts.contact_table import ContactTable
from dap3d_core.formulations.programs.scene_program import load_programs, write_programs
from dap3d_core.kernels.compiler.objects import optimised
from dap3d_core.simulation import CompiledModel
from dap3d_core.simulation.events.contact_jumps import ContactJumps

LONG = 1000.0
ROUNDS = 15


def measure():
    """Rows of the table: what, figure, unit."""
    rows = [*closed_forms(), *creep(), *impacts(), *costs(), *changes()]
    return [dict(zip(("measure", "found", "unit"), row, strict=True)) for row in rows]


def closed_forms():
    """Largest errors at rtol 1e-12, by integrator."""
    for integrator in ("dop853", "adams", "radau"):
        given = TIGHT | {"integrator": integrator}
        e, first = 0.8, np.sqrt(2.0 / G)
        result = dap.simulate(ball(height=1.0, e=e), t_end=6.0, dt=0.5, **given)
        yield (
            f"bouncing to rest, {integrator}",
            abs(times(result, "rest")[0] - first * (1.0 + e) / (1.0 - e)),
            "s",
        )
        result = dap.simulate(ball(v=3.0, mu=0.3), t_end=2.0, dt=0.5, **given)
        off = times(result, "stick")[0] - 2.0 / 7.0 * 3.0 / (0.3 * G)
        yield f"sliding to rolling, {integrator}", abs(off), "s"
        result = dap.simulate(spring_block(0.1, 0.2, 100.0), t_end=3.0, dt=0.5, **given)
        limit = 0.2 * G / 100.0
        swings = int(np.ceil((0.1 / limit - 1.0) / 2.0))
        rest = (-1.0) ** swings * (0.1 - 2.0 * limit * swings)
        yield f"Coulomb oscillator, {integrator}", abs(result.r[-1, 0, 0] - rest), "m"


def pinched_capsule():
    """A capsule that a force presses against a wall, which holds it against its weight."""
    scene = dap.Scene(name="capsule")
    scene.add_body("capsule", mass=1.0, Jp=[0.01, 0.01, 0.001], r=[0.1, 0.0, 1.0])
    scene.add_point("low", "capsule", [0.0, 0.0, -0.2])
    scene.add_point("high", "capsule", [0.0, 0.0, 0.2])
    scene.add_force("weight", "g")
    scene.add_force("f", "press", body_i="capsule", f=[-G / 0.5 / 0.99, 0.0, 0.0])
    fields = {"radius": 0.1, "a_j": "ground.x", "mu": 0.5}
    scene.add_contact("capsule_plane", "wall", P_i="low", Q_i="high", **fields)
    return scene


def creep():
    """Largest change of a position in 1000 s, of what sticks."""
    scenes = {
        "box on a slope, 0.95": slope(0.95),
        "box on a slope, 0.999": slope(0.999),
        "capsule at a wall, 0.99": pinched_capsule(),
        "block on a spring, 0.99": spring_block(0.99 * 0.4 * G / 100.0, 0.4, 100.0),
    }
    for name, scene in scenes.items():
        result = dap.simulate(scene, t_end=LONG, dt=LONG / 10)
        moved = np.max(np.abs(result.r - result.r[0]))
        yield f"creep in 1000 s: {name}", float(moved), "m"


def impacts():
    """What Newton's cradle is off by, and what energy impacts with friction gain."""
    for gap in (0.0, 0.01):
        scene, radius = dap.Scene(name="cradle"), 0.05
        for k in range(4):
            x = k * (2.0 * radius + gap) - (0.0 if k else 0.1)
            v = [0.0 if k else 2.0, 0.0, 0.0]
            scene.add_body(f"b{k}", mass=1.0, Jp=[0.001] * 3, r=[x, 0.0, 0.0], r_dot=v)
        for k in range(3):
            ends = {"P_i": f"b{k}.O", "P_j": f"b{k + 1}.O"}
            scene.add_contact("ball_ball", f"c{k}", **ends, radius_i=radius, radius_j=radius, e=1.0)
        result = dap.simulate(scene, t_end=0.2, dt=0.05, **TIGHT)
        off = np.max(np.abs(result.rd[-1, :, 0] - [0.0, 0.0, 0.0, 2.0]))
        yield f"Newton's cradle, gaps of {gap:g} m", float(off), "m/s"
    result = dap.simulate(tumbling(), t_end=1.0, dt=1 / 60, rtol=1e-10, atol=1e-12)
    gained = max(event.work for event in result.events if event.kind == "impact")
    yield "three boxes that tumble: energy gained by an impact", max(0.0, gained), "J"
    yield "the same: the ledger's energy", result.ledger["energy"].value, "1"


def tumbling():
    """Three boxes thrown onto a floor, with friction."""
    scene, rng = dap.Scene(name="boxes"), np.random.default_rng(3)
    scene.add_force("weight", "g")
    for k in range(3):
        p = rng.normal(size=4)
        motion = {"r_dot": rng.normal(size=3), "w": 5.0 * rng.normal(size=3)}
        scene.add_body(f"b{k}", mass=1.0, Jp=[0.01, 0.015, 0.02], r=[0.6 * k, 0.0, 0.35],
                       p=p / np.linalg.norm(p), **motion)  # fmt: skip
        fields = {"size": [0.4, 0.3, 0.1], "mu": 0.3, "e": 0.4}
        scene.add_contact("box_plane", f"c{k}", P_i=f"b{k}.O", **fields)
    return scene


def costs():
    """A right-hand side in each mode, and whole runs for each that they take."""
    free = dap.Scene(name="free")
    free.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=[0.0, 0.0, 0.1], r_dot=[1.0, 0.2, 0.0])
    free.add_force("weight", "g")
    rolling = ball(v=1.0, mu=0.3)
    rolling.bodies["ball"].w = [0.0, 10.0, 0.0]
    resisting = rolling.copy()
    resisting.contacts["floor"].fields.update(mu_roll=1e-3, mu_spin=1e-3)
    cases = {"no contact": (free, None), "open": (rolling, 0), "slides": (rolling, 1),
             "sticks": (rolling, 2), "rests and resists": (resisting, 2),
             "rolls and spins against resistance": (resisting, [2, 1, 1]),
             "slides and resists": (resisting, 1)}  # fmt: skip
    corners = {"open": 0, "slides on four corners": 1, "sticks on four": 2}
    cases = {f"a ball, {name}": case for name, case in cases.items()}
    cases |= {f"a box, {name}": (slope(0.9), mode) for name, mode in corners.items()}
    for name, case in cases.items():
        general, program = right_hand_sides(*case)
        yield f"right-hand side of {name}", 1e6 * general, "us"
        yield f"right-hand side of {name}, by a program", 1e6 * program, "us"
    runs = {"no contact": free, "rolls": rolling, "slides": ball(v=300.0, mu=0.3)}
    given = {"t_end": 10.0, "dt": 2.5, "step": 1e-4, "integrator": "rk4"}
    found = {name: [] for name in runs}
    for _ in range(ROUNDS):  # by programs, from the second or third round on
        for name, scene in runs.items():
            seconds, result = least(lambda s=scene: dap.simulate(s, **given), 1)
            found[name].append(seconds / result.stats.rhs)
    for name, seconds in found.items():
        yield f"run of a ball, {name}, a right-hand side by programs", 1e6 * min(seconds), "us"
        ratio = float(np.median(np.divide(seconds, found["no contact"])[ROUNDS // 2 :]))
        yield f"run of a ball, {name}, to no contact", ratio, "1"
    scene = ball(v=3.0, mu=0.3)
    given = {"t_end": 2.0, "dt": 0.5, "rtol": 1e-10, "atol": 1e-12}
    seconds, result = least(lambda: dap.simulate(scene, **given), 5)
    v = result.rd[-1, 0, 0] - 15.0 / 7.0
    yield "ball that slides and rolls to 1e-9: CPU a simulated second", seconds / 2.0, "s"
    yield "the same: error of its speed", abs(v), "m/s"


def right_hand_sides(scene, mode):
    """Seconds of one, by general code and a program, contacts in a mode; of a box four of eight.

    The corners of the box share its weight, as in a run.
    """
    evaluator = CompiledModel(scene, joint=False).evaluator
    states = evaluator.model.initial_states.copy()
    if mode is not None:
        table = ContactTable(evaluator)
        shares = table.count == 8
        closed = slice(None, None, 2 if shares else 1)
        states[table.mode[closed]] = mode
        states[table.way[closed, 0]] = np.equal(mode, 1)
        if shares and mode:
            states[table.near[closed]] = 0.25 * G * np.array([0.0, 0.0, 1.0])
    evaluator.states = states
    y = evaluator.integrated(evaluator.model.u0)
    functions = evaluator.functions
    arguments = y, np.zeros_like(y), evaluator.system, evaluator.loops
    repeat(functions, 10, *arguments)
    wait_for_good_code()
    seconds = [least(lambda: repeat(functions, 3000, *arguments), ROUNDS)[0]]
    name = f"contact-{time.monotonic_ns()}"
    text, written = write_programs(evaluator, name, 0.0, y)
    programs = load_programs(evaluator, name, written, optimised(text, written, None))
    functions.addresses[RHS] = programs[RHS].address
    seconds.append(least(lambda: repeat(functions, 3000, *arguments), ROUNDS)[0])
    return [whole / 3000 for whole in seconds]


def least(function, rounds):
    """The least CPU time of several calls, and what the last one returned."""
    best, found = np.inf, None
    for _ in range(rounds):
        begun = time.thread_time()
        found = function()
        best = min(best, time.thread_time() - begun)
    return best, found


def changes():
    """CPU time of changes of modes, medians."""
    seconds, change = [], ContactJumps._resolve

    def timed(*arguments):
        begun = time.thread_time()
        change(*arguments)
        seconds.append(time.thread_time() - begun)

    ContactJumps._resolve = timed
    try:
        for name, scene, t_end in (("ball", ball(height=1.0, e=0.8), 6.0),
                                   ("three boxes", tumbling(), 1.0)):  # fmt: skip
            seconds.clear()
            dap.simulate(scene, t_end=t_end, dt=t_end, rtol=1e-10, atol=1e-12)
            yield f"change of a mode, {name}", 1e3 * float(np.median(seconds)), "ms"
    finally:
        ContactJumps._resolve = change
