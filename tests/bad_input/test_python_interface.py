"""The Python interface used wrongly: refused in a sentence, or right bit for bit.
Arrays of any make, objects shared by scenes, threads and processes, callbacks that raise or run the
model again. Runs are compared with ``array_equal``: no tolerance, for nothing may differ."""

import copy
import multiprocessing
import pickle
import re
import sys

import numpy as np
import pytest
from support.plain import jit_is_on
from support.process import together

import dap3d_core as dap

compiling = pytest.mark.skipif(not jit_is_on(), reason="plain Python takes long for this")


def spelt(value):
    """A value as part of a test's name, which is the same in every process."""
    return re.sub(r" at 0x[0-9a-f]+", "", repr(value))


def pendulum(length=0.5, **bob):
    """A hinged rod with a spring whose numbers an event may change; its angle counts turns."""
    scene = dap.Scene(name="pendulum")
    scene.add_body("bob", **({"mass": 1.0, "Jp": (0.01, 0.01, 0.01), "r": (length, 0, 0)} | bob))
    scene.add_point("end", "bob", (-length, 0.0, 0.0))
    scene.add_joint("rev", "hinge", P_i="end", P_j="ground.O", a_i="bob.y", a_j="ground.y")
    scene.add_force("weight", "gravity")
    scene.add_point("hook", "ground", (0.0, 0.0, -1.0))
    scene.add_force("ptp", "spring", P_i="bob.O", P_j="hook", k=5.0, l0=0.4)
    return scene


@pytest.fixture(scope="module")
def compiled():
    return dap.compile(pendulum())


@pytest.fixture(scope="module")
def fresh(compiled):
    """A run of the compiled model, with which others are compared."""
    return dap.simulate(compiled, t_end=0.5, dt=0.1)


def assert_same_run(one, other):
    for name in ("t", "u", "v_dot", "Lam", "work"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


# ------------------------------------------------------------------ arrays

GOOD_STATES = {
    "single precision": lambda u: u.astype(np.float32).astype(float).astype(np.float32),
    "long double": lambda u: u.astype(np.longdouble),
    "big-endian": lambda u: u.astype(">f8"),
    "not contiguous": lambda u: np.repeat(u, 3)[::3],
    "backwards": lambda u: u[::-1].copy()[::-1],
    "a list": lambda u: u.tolist(),
    "a masked array without masked entries": np.ma.masked_array,
}
BAD_STATES = {
    "objects": (lambda u: u.astype(object), "not object"),
    "text": (lambda u: [str(x) for x in u], "not <U"),
    "complex": (lambda u: u + 0j, "not complex128"),
    "truth values": (lambda u: u > 0.0, "not bool"),
    "dates": (lambda u: u.astype("M8[s]"), "not datetime64"),
    "masked": (lambda u: np.ma.masked_array(u, mask=[False, True] + [False] * 11), "entry 1 is ma"),
    "nan": (lambda u: np.where(np.arange(13) == 2, np.nan, u), "entry 2 is nan"),
    "infinite": (lambda u: np.where(np.arange(13) == 12, np.inf, u), "entry 12 is inf"),
    "short": (lambda u: u[:5], r"its shape is \(5,\)"),
    "long": (lambda u: np.append(u, 0.0), r"its shape is \(14,\)"),
    "a row": (lambda u: u[None], r"its shape is \(1, 13\)"),
    "a number": (lambda u: 1.0, r"its shape is \(\)"),
    "ragged": (lambda u: [[1.0], [1.0, 2.0]], "13 finite numbers"),
    "a generator": (lambda u: (x for x in u), "not object"),
    "no turn": (lambda u: np.zeros(13), "Euler parameters of body bob in u are all zero"),
    "whole numbers, no turn": (lambda u: np.zeros(13, dtype=int), "are all zero"),
}


@pytest.mark.parametrize("make", GOOD_STATES.values(), ids=GOOD_STATES)
def test_states_of_any_make_give_the_same_rates(compiled, make):
    u = compiled.model.u0.astype(np.float32).astype(float)
    state = make(u)
    before = np.array(state, dtype=float)
    assert np.array_equal(compiled.rhs(0.0, state), compiled.rhs(0.0, u))
    assert compiled.redundancy(state).rank.rank == 5
    assert np.array_equal(np.array(state, dtype=float), before), "the caller's array is left alone"


@pytest.mark.parametrize(("make", "words"), BAD_STATES.values(), ids=BAD_STATES)
def test_what_is_no_state_is_refused_in_a_sentence(compiled, make, words):
    for use in (lambda u: compiled.rhs(0.0, u), compiled.redundancy):
        with pytest.raises(ValueError, match=words):
            use(make(compiled.model.u0))


@pytest.mark.parametrize("t", [np.nan, np.inf, "0", None, 1j, True, np.zeros(1), np.zeros(2)])
def test_what_is_no_time_is_refused(compiled, t):
    with pytest.raises(ValueError, match="t must be a finite number"):
        compiled.rhs(t, compiled.model.u0)


def test_rates_that_are_not_finite_are_an_error_that_names_the_culprit(compiled):
    """The bob's centre on the hook: the spring between them has no direction."""
    u = compiled.model.u0.copy()
    u[:3] = 0.0, 0.0, -1.0
    with pytest.raises(dap.SimulationError, match="force spring"):
        compiled.rhs(0.0, u)


# ------------------------------------------------------------------ arguments


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (None, "finite number, not None"),
        (np.nan, "finite number, not nan"),
        ("1", "finite number, not '1'"),
        (1j, "finite number, not 1j"),
        (True, "a number that changes its sign"),
        (np.zeros(2), "one number"),
    ],
    ids=spelt,
)
def test_an_event_whose_function_gives_no_number_ends_the_run(compiled, answer, words):
    """A NaN would never pass a level: the event would be missed without a word."""
    with pytest.raises(ValueError, match=words):
        dap.simulate(compiled, t_end=0.5, events=[dap.Event(lambda t, state: answer, name="odd")])


@pytest.mark.parametrize("name", [None, 3, ["bob.r"]])
def test_quantities_are_named_by_text(fresh, name):
    with pytest.raises(TypeError, match="named by text"):
        fresh.quantity(name)


# ------------------------------------------------------------------ what is shared and changed


def test_a_scene_that_changes_after_compiling_changes_nothing():
    scene = pendulum()
    compiled = dap.compile(scene)
    text, before = scene.to_toml(), dap.simulate(compiled, t_end=0.5, dt=0.1)
    scene.bodies["bob"].mass = 100.0
    scene.bodies["bob"].r = (9.0, 9.0, 9.0)
    scene.points["end"].sPp = (7.0, 0.0, 0.0)
    scene.forces["spring"].fields["k"] = 1e9
    scene.simulation.rtol, scene.simulation.correct = 0.5, False
    scene.add_body("another")
    del scene.joints["hinge"]
    after = dap.simulate(compiled, t_end=0.5, dt=0.1)
    assert_same_run(before, after)
    assert after.scene_text == before.scene_text == text
    assert after.settings == before.settings


def test_parts_of_a_scene_may_be_used_in_another():
    """A body object put into two scenes: each is compiled as it stands, and keeps that."""
    one, other = pendulum(), pendulum()
    other.bodies["bob"] = one.bodies["bob"]
    both = [dap.compile(scene) for scene in (one, other)]
    one.bodies["bob"].mass = 50.0
    first, second = (dap.simulate(c, t_end=0.3) for c in both)
    assert_same_run(first, second)


def test_arrays_of_models_and_results_are_read_only(compiled, fresh):
    names = ("t", "u", "r", "p", "rd", "w", "wp", "rdd", "wd", "wpd", "rP", "rPd", "rPdd", "v_dot",
             "Lam", "Jac", "work")  # fmt: skip
    arrays = {name: getattr(fresh, name) for name in names}
    reaction = fresh.reaction("hinge")["i"]
    arrays |= {name: getattr(reaction, name) for name in ("force", "moment", "local", "p")}
    arrays |= {name: getattr(compiled, name) for name in ("irc", "iru", "irv")}
    arrays |= {name: getattr(compiled.model, name) for name in ("u0", "mass", "Jp", "r", "p")}
    arrays["tension"] = fresh.force("spring").on["i"].force
    writable = [name for name, array in arrays.items() if array.flags.writeable]
    assert writable == []


def test_what_a_result_tells_of_itself_cannot_be_changed(fresh):
    for told in (fresh.settings, fresh.versions):
        told.clear()
    fresh.notes.clear()
    assert fresh.settings["rtol"] == 1e-8
    assert fresh.versions
    assert fresh.notes


def test_a_compiled_model_is_a_value(compiled):
    """Copies are itself, for nothing of it changes; another process cannot have it."""
    assert copy.copy(compiled) is compiled
    assert copy.deepcopy({"model": compiled})["model"] is compiled
    with pytest.raises(TypeError, match="send the scene to the other process"):
        pickle.dumps(compiled)


# ------------------------------------------------------------------ callbacks


class Enough(Exception):
    """What a callback raises."""


def _raise(*_):
    raise Enough("enough")


def _after(seconds):
    """Raises when it is called at or after a time; for ``of`` and ``action`` of events."""

    def watch(t, state=None):
        if t >= seconds:
            raise Enough("enough")
        return 1.0

    return watch


CALLBACKS = {
    "progress": {"progress": _raise},
    "watch": {"watch": _raise},
    "of": {"events": [dap.Event(_after(0.3), name="late")]},
    "action": {"events": [dap.Event("t", above=0.3, action=_raise)]},
}


def _changing(state):
    state.set("spring", k=40.0)


@pytest.mark.parametrize("given", CALLBACKS.values(), ids=CALLBACKS)
@pytest.mark.parametrize("changes", [False, True])
def test_what_a_callback_raises_comes_out_and_leaves_no_trace(
    compiled, fresh, given, changes, tmp_path
):
    """Its own exception, with what was computed; the file is whole, the numbers that an event
    changed are those of the scene again, and the next run is bit for bit a fresh one."""
    events = list(given.get("events", []))
    if changes:
        events.insert(0, dap.Event("t", above=0.15, action=_changing, name="change"))
    output = tmp_path / "run.nc"
    settings = given | {"events": events, "output": output}
    with pytest.raises(Enough) as caught:
        dap.simulate(compiled, t_end=0.5, dt=0.1, **settings)
    kept = caught.value.result
    if kept is None:  # it was raised before the first row was taken
        assert not output.exists()
    else:
        assert kept.status == "stopped"
        same = kept.t <= (0.1 if changes else 0.5)  # steps end at events: rtol 1e-8, not the bits
        assert np.allclose(kept.u[same], fresh.u[: len(kept.t)][same], rtol=0.0, atol=1e-7)
        read = dap.open(output)
        assert np.array_equal(read.u, kept.u)
        assert read.status == "stopped"
    assert [p.name for p in tmp_path.iterdir()] in ([], ["run.nc"])
    assert_same_run(dap.simulate(compiled, t_end=0.5, dt=0.1), fresh)


@pytest.mark.every(3)
@pytest.mark.parametrize(
    "integrator", ["dop853", "dopri5", pytest.param("radau", marks=pytest.mark.slow)]
)
def test_a_callback_may_evaluate_and_run_the_model(compiled, integrator):
    """Rates, rank, reactions and whole runs of the same model in the middle of a run: neither the
    run nor what is asked for beside it differs from the same alone."""
    settings = {"t_end": 0.4, "dt": 0.1, "integrator": integrator}
    # Numbers of events need dense output, whose stages may change last digits of a projection.
    settings["events"] = [dap.Event(lambda t, s: 1.0)]
    alone = dap.simulate(compiled, **settings)
    u = alone.u[-1]
    rates, force = compiled.rhs(0.3, u), alone.reaction("hinge")["i"].force
    seen = []

    def meddle(t, state):
        if len(seen) < 5:
            inner = dap.simulate(compiled, **settings)
            assert_same_run(inner, alone)
            assert np.array_equal(inner.reaction("hinge")["i"].force, force)
            assert np.array_equal(compiled.rhs(0.3, u), rates)
            assert compiled.redundancy(u).rank.rank == 5
            seen.append(state["spring.tension"])
        return 1.0

    assert_same_run(dap.simulate(compiled, **settings | {"events": [dap.Event(meddle)]}), alone)
    assert len(seen) == 5
    assert_same_run(dap.simulate(compiled, **settings), alone)


def test_numbers_changed_in_a_run_do_not_reach_a_run_inside_it(compiled, fresh):
    inner = []

    def change_and_run(state):
        state.set("spring", k=500.0)
        inner.append(dap.simulate(compiled, t_end=0.5, dt=0.1))

    event = dap.Event("t", above=0.25, action=change_and_run)
    outer = dap.simulate(compiled, t_end=0.5, dt=0.1, events=[event])
    assert_same_run(inner[0], fresh)
    assert np.allclose(outer.u[:3], fresh.u[:3], rtol=0.0, atol=1e-7)  # other steps: rtol 1e-8
    assert abs(outer.u[3:] - fresh.u[3:]).max() > 1e-3


# ------------------------------------------------------------------ threads and processes


def test_threads_may_run_one_compiled_model(compiled, fresh):
    """Two threads that run it, one that evaluates it and a result of it: all bit for bit as alone.
    The switch interval is short, so that threads meet within a step."""
    u, rates = fresh.u[-1], compiled.rhs(0.2, fresh.u[-1])
    force = fresh.reaction("hinge")["i"].force

    def runs():
        for _ in range(6):
            found = dap.simulate(compiled, t_end=0.5, dt=0.1)
            assert_same_run(found, fresh)
            assert np.array_equal(found.reaction("hinge")["i"].force, force)

    def evaluations():
        for _ in range(60):
            assert np.array_equal(compiled.rhs(0.2, u), rates)
            fresh._reactions.clear()
            assert np.array_equal(fresh.reaction("hinge")["i"].force, force)

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    try:
        together(runs, runs, evaluations)
    finally:
        sys.setswitchinterval(before)


@pytest.mark.slow
def test_an_event_in_one_thread_changes_no_run_in_another(compiled, fresh):
    """The numbers of a force are changed in half of the runs."""

    def changed():
        event = dap.Event("t", above=0.0001, action=_changing)
        return [dap.simulate(compiled, t_end=0.5, dt=0.1, events=[event]) for _ in range(4)]

    def plain():
        return [dap.simulate(compiled, t_end=0.5, dt=0.1) for _ in range(8)]

    one, other = together(changed, plain)
    for result in other:
        assert_same_run(result, fresh)
    for result in one:
        assert_same_run(result, one[0])
    assert abs(one[0].u - fresh.u).max() > 1e-3


def test_threads_may_compile_at_once():
    """Scenes with different types, and the same scene twice."""
    scenes = [pendulum(0.5), pendulum(0.5), pendulum(0.25), "pen1"]
    found = together(*(lambda s=s: dap.simulate(s, t_end=0.2) for s in scenes))
    for scene, result in zip(scenes, found, strict=True):
        assert_same_run(result, dap.simulate(scene, t_end=0.2))


def _in_child(scene, queue):
    result = dap.simulate(scene, t_end=0.5, dt=0.1)
    queue.put((result, result.reaction("hinge")["i"].force))


def _in_forked_child(compiled, queue):
    result = dap.simulate(compiled, t_end=0.5, dt=0.1)
    queue.put((result, result.reaction("hinge")["i"].force))


@pytest.mark.slow
@compiling
@pytest.mark.filterwarnings("ignore:This process.*is multi-threaded:DeprecationWarning")
@pytest.mark.parametrize(
    ("method", "work", "what"),
    [("spawn", _in_child, "scene"), ("fork", _in_forked_child, "compiled")],
)
def test_processes_give_the_same_bits(compiled, fresh, method, work, what):
    """A scene goes to a process of its own; a forked process has the compiled model already."""
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip("no such processes here")
    context = multiprocessing.get_context(method)
    queue = context.SimpleQueue()
    given = pendulum() if what == "scene" else compiled
    process = context.Process(target=work, args=(given, queue))
    process.start()
    result, force = queue.get()
    process.join(60)
    assert process.exitcode == 0
    assert_same_run(result, fresh)
    assert np.array_equal(force, fresh.reaction("hinge")["i"].force)
