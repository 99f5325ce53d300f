"""Large scenes in two halves: the same numbers as whole, and the same bits with a second thread."""

import threading
import time

import numpy as np
import pytest
from support.graphs import chain as chain_graph
from support.graphs import free_star, ring, star, tree
from support.nets import fourbars, ladder, plate_net, rod_net

import dap3d_core as dap
from dap3d_core import formulations
from dap3d_core.formulations.evaluator import Machine
from dap3d_core.formulations.two_threads.worker_thread import SecondThread, threads_allowed
from dap3d_core.kernels.runtime.cache import jit_is_on
from dap3d_core.linear.ldlt.plan import make_plan
from dap3d_core.linear.ordering.bisection import FIRST, SECOND, TOP
from dap3d_core.simulation import CompiledModel

EPS = np.finfo(float).eps
compiled_code = pytest.mark.skipif(not jit_is_on(), reason="only compiled code has threads")


def rods(name, pairs, count):
    """Rods of 1 m along x on spherical joints: (rod, end, other rod or None, other end)."""
    scene = dap.Scene(name=name)
    for k in range(count):
        scene.add_body(f"b{k}", mass=1.0 + k % 3, Jp=(0.02, 0.1, 0.12), r=(k + 0.5, 0.0, 0.0))
        for end, x in (("in", -0.5), ("out", 0.5)):
            scene.add_point(f"{end}{k}", f"b{k}", (x, 0.0, 0.0))
    for n, (i, j) in enumerate(pairs):
        scene.add_joint("sph", f"J{n}", P_i=f"in{i}", P_j="ground.O" if j is None else f"out{j}")
    scene.add_force("weight", "gravity")
    return scene


def chain(count):
    return rods("chain", [(0, None), *((k, k - 1) for k in range(1, count))], count)


def hub(count):
    return rods("star", [(0, None), *((k, 0) for k in range(1, count))], count)


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


def net(size):
    """Rods between size x size knots, those of a knot joined one to the next."""
    count, joints = rod_net(size)
    rng = np.random.default_rng(size)
    scene = dap.Scene(name="net")
    for b in range(1, count + 1):
        scene.add_body(f"b{b}", mass=1.0, Jp=(0.02, 0.1, 0.1), r=rng.uniform(-1, 1, 3))
    for n, ((i, j), _) in enumerate(joints):
        P_i = scene.add_point(f"P{n}", f"b{i}", rng.uniform(-1, 1, 3))
        P_j = scene.add_point(f"Q{n}", f"b{j}" if j else "ground", rng.uniform(-1, 1, 3))
        scene.add_joint("sph", f"J{n}", P_i=P_i, P_j=P_j)
    return scene


def with_everything(scene, first, last, joint):
    """Springs within a half, across and to ground, a free body, friction, a driver."""
    bodies = list(scene.bodies)
    scene.add_body("loose", mass=2.0, Jp=(1.0, 1.1, 1.2), r=(0.0, 0.0, 3.0), w=(0.1, 0.2, 0.3))
    for n, (i, j) in enumerate([(first, bodies[0]), (first, last), (last, "ground"),
                                ("loose", last), ("loose", "ground")]):  # fmt: skip
        scene.add_force("ptp", f"spring{n}", P_i=f"{i}.O", P_j=f"{j}.O", k=20.0 + n, l0=0.3, c=0.5)
    scene.add_force("friction", "rub", joint=joint, mu=0.2, radius=0.05)
    scene.add_function("a", "turn", coeff=(0.0, 0.3, 0.1))
    scene.add_joint("rel-rot", "motor", body_i=first, a_j="ground.z", function="turn")
    return scene


def with_light_rods(scene):
    """Each third rod weighs a ten-millionth of the others."""
    for rod in list(scene.bodies.values())[2::3]:
        rod.mass, rod.Jp = 1e-7, (2e-9, 1e-8, 1.2e-8)
    return scene


SCENES = {
    "light rods": lambda: with_light_rods(chain(14)),
    "chain": lambda: chain(14),
    "star": lambda: hub(15),
    "net": lambda: net(5 if jit_is_on() else 4),
    "four-bars": lambda: row_of_four_bars(12),
    "everything": lambda: with_everything(row_of_four_bars(9), "crank1", "rod8", "R5"),
}
GRAPHS = {
    "chain": chain_graph(40),
    "star": star(40),
    "free star": free_star(12),
    "tree": tree(60, np.random.default_rng(3)),
    "ring": ring(30),
    "ladder": ladder(20),
    "four-bars": fourbars(30),
    "net": rod_net(7),
    "net with panels": rod_net(14),
    "plates": plate_net(9),
}


def machines(monkeypatch, scene):
    """The same model whole and in halves; a state near the start, moving."""
    name = formulations.IN_HALVES["standard"][0]
    model = CompiledModel(scene).model
    found = []
    for least in (10**9, 1):
        monkeypatch.setitem(formulations.IN_HALVES, "standard", (name, least))
        found.append(Machine(model, "standard"))
    whole, halved = found
    assert halved.halved
    assert not whole.halved
    rng = np.random.default_rng(5)
    return whole, halved, model.u0 + 0.02 * rng.normal(size=model.u0.size)


@pytest.mark.parametrize("name", GRAPHS)
def test_halves_share_nothing_but_the_top(name):
    """No number of K and no row of one half is written by the other, or read by its columns; each
    half writes to a top of its own. The order has the fill and the work that it had."""
    n, joints = GRAPHS[name]
    arguments = n, [slots for slots, _ in joints], [rows for _, rows in joints]
    plan, cut = make_plan(*arguments), make_plan(*arguments, halved=True)
    halves = cut.halves
    assert halves is not None
    assert cut.ordering.work <= 1.1 * plan.ordering.work
    assert sorted(cut.ordering.order) == list(range(len(cut.ordering.order)))
    places = cut.nodes[halves.nodes, 2]
    copy = places[3], places[3] + halves.matrix[1]
    own = {FIRST: [(places[0], places[1]), (places[2], places[3])],
           SECOND: [(places[1], places[2]), copy], TOP: [(places[2], places[3])]}  # fmt: skip
    end = halves.rows[3]
    rows = {FIRST: [(0, halves.rows[1]), (halves.rows[2], end)],
            SECOND: [(halves.rows[1], halves.rows[2]), (end, cut.row_size)],
            TOP: [(halves.rows[2], end)]}  # fmt: skip
    for part in (FIRST, SECOND, TOP):
        nodes = slice(halves.nodes[part], halves.nodes[part + 1])
        first, last = cut.nodes[nodes.start, 4:], cut.nodes[nodes.stop, 4:]
        read, written = halves.updates[first[1] : last[1], :2], halves.updates[first[1] : last[1]]
        assert within(read.ravel(), own[part][:1])
        assert within(written[:, 2], own[part])
        below = halves.columns[first[0] : last[0]]
        assert within(below[:, 1], rows[part])
        assert within(below[:, 1] + below[:, 2] - 1, rows[part])
        targets = cut.targets[halves.targets[part] : halves.targets[part + 1]]
        assert within(targets[:, 0], own[part][:1] if part != FIRST else own[FIRST][:1])
    for node, part in zip(cut.ordering.nodes, halves.node_part, strict=True):
        if part != TOP:
            assert {halves.body_part[b] for b in node.bodies} <= {part, TOP}


def within(values, ranges):
    return all(any(a <= v < b for a, b in ranges) for v in values)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_halves_give_what_the_whole_gives(monkeypatch, name):
    """Accelerations and multipliers, to rounding: sums of the top alone have another order.

    The condition of the rows is some 1e4 at most; where masses differ, a second solution takes away
    what a single one leaves of the rows, 1e6 roundings of both.
    """
    whole, halved, u = machines(monkeypatch, SCENES[name]())
    for method in ("rhs", "report"):
        expected, found = getattr(whole, method)(0.3, u), getattr(halved, method)(0.3, u)
        size = np.max(np.abs(expected))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e4 * EPS * size)


@compiled_code
@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_a_second_thread_changes_no_bit(monkeypatch, name):
    """dy/dt with and without a second thread, which did take part."""
    _, machine, u = machines(monkeypatch, SCENES[name]())
    y = machine.integrated(u)
    alone, together = np.zeros_like(y), np.zeros_like(y)
    machine.functions[0](0.3, y, alone, machine.system, machine.loops)
    second = SecondThread(machine.system, machine.loops)
    helped, until = False, time.monotonic() + 20.0
    while not helped and time.monotonic() < until:
        with second:
            for _ in range(2000):
                together[:] = np.nan
                machine.functions[0](0.3, y, together, machine.system, machine.loops)
                np.testing.assert_array_equal(together, alone)
            helped = second.tickets > 0
    assert helped


@pytest.fixture(scope="module")
def large():
    """A scene above the threshold, made once."""
    return CompiledModel(chain(formulations.IN_HALVES["standard"][1]))


def always(monkeypatch, compiled):
    """A second thread whether there is a second core or not, in every call."""
    second = SecondThread(compiled.machine.system, compiled.machine.loops)
    monkeypatch.setattr(second, "_faster", lambda: True)
    monkeypatch.setitem(compiled.machine.__dict__, "second_thread", second)
    return second


@compiled_code
@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["dop853", "adams"])
def test_a_run_with_a_second_thread_is_the_same_run(monkeypatch, large, integrator):
    """All reported numbers, bit for bit."""
    monkeypatch.setitem(large.machine.__dict__, "second_thread", None)
    options = {"t_end": 0.05, "dt": 0.01, "integrator": integrator}
    alone = dap.simulate(large, **options)
    always(monkeypatch, large)
    together = dap.simulate(large, **options)
    assert together.stats.rhs == alone.stats.rhs
    for name in ("u", "v_dot", "Lam"):
        np.testing.assert_array_equal(getattr(together, name), getattr(alone, name))


@compiled_code
@pytest.mark.slow
def test_an_interrupted_run_leaves_no_thread(monkeypatch, large):
    """Ctrl-C between two chunks: the second thread is gone, and the model runs again."""
    always(monkeypatch, large)

    def interrupt(t, t_end):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        dap.simulate(large, t_end=0.05, dt=0.01, progress=interrupt)
    assert not [thread for thread in threading.enumerate() if thread.name == "dap3d"]
    assert dap.simulate(large, t_end=0.01, dt=0.01).t[-1] == 0.01


@compiled_code
@pytest.mark.slow
def test_what_the_second_thread_raises_comes_out(large):
    """An exception in it ends the call with that exception; nobody waits for ever."""
    machine = large.machine
    y = machine.integrated(machine.model.u0)
    second = SecondThread(machine.system, machine.loops)
    second._arguments = (None, machine.loops)  # which compiled code does not take
    with pytest.raises((TypeError, AttributeError)):
        second.call(
            lambda: [machine.functions[0](0.0, y, y.copy(), machine.system, machine.loops)
                     for _ in range(1000)],
            lambda: 1,
        )  # fmt: skip
    assert not [thread for thread in threading.enumerate() if thread.name == "dap3d"]


@compiled_code
def test_one_thread_can_be_asked_for(monkeypatch):
    """DAP3D_THREADS=1, and one core alone."""
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1}, raising=False)
    for asked, threads in (("1", 1), (" 1 ", 1), ("2", 2), ("16", 2), ("", 2)):
        monkeypatch.setenv("DAP3D_THREADS", asked)
        assert threads_allowed() == threads
    monkeypatch.delenv("DAP3D_THREADS")
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0}, raising=False)
    assert threads_allowed() == 1


@pytest.mark.parametrize("asked", ["two", "0", "-3", "2.5", "1,2", "²"])
def test_what_is_no_number_of_threads_is_refused(monkeypatch, asked):
    """Where a scene may have a second thread: what was said, and what is allowed."""
    monkeypatch.setattr(Machine, "halved", True)
    monkeypatch.setenv("DAP3D_THREADS", asked)
    words = f"DAP3D_THREADS is '{asked}'; it must be a whole number from 1"
    with pytest.raises(dap.SimulationError, match=words):
        dap.compile(chain(2), method="standard")


@pytest.mark.slow
def test_the_faster_way_is_taken(monkeypatch):
    """Both ways are measured; where a second thread makes calls slower, one thread goes on."""
    _, machine, _ = machines(monkeypatch, chain(4))
    second = SecondThread(machine.system, machine.loops)
    helped, count = [], [0]

    def advance():
        helped.append(second._thread is not None)
        time.sleep(0.005 if helped[-1] else 0.001)
        count[0] += 10

    if jit_is_on():
        for _ in range(10):
            second.call(advance, lambda: count[0])
        assert helped == [True] + 9 * [False]
