"""Runs by a program of the scene's own: the same bits, and general code where it does not fit."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.internals import change_over, scene_program
from support.plain import jit_is_on

import dap3d_core as dap
from dap3d_core.formulations import PROJECT, REPORT, RHS, WATCH
from dap3d_core.integrators import EXPLICIT
from dap3d_core.kernels.compiler.trace import TraceError

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")
SETTINGS = {"t_end": 0.3, "rtol": 1e-9, "atol": 1e-11}


@pytest.fixture
def records(monkeypatch):
    """Records of scenes, none of which is known yet."""
    for name in ("_records", "_spent", "_lost", "_reported"):
        monkeypatch.setattr(change_over, name, {})
    return change_over._records


@pytest.fixture
def at_once(monkeypatch, records):
    """Programs are made at the first call, in this process, for scenes that nobody knows yet."""
    monkeypatch.setattr(change_over, "LOAD_AFTER", 0.0)
    monkeypatch.setattr(change_over, "MAKE_AFTER", 0.0)
    monkeypatch.setattr(change_over, "BESIDE", False)
    monkeypatch.setattr(scene_program, "is_optimised", lambda evaluator: True)
    return records


def general(scene, **settings):
    """A run by general code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(change_over, "LOAD_AFTER", np.inf)
        return dap.simulate(scene, **SETTINGS, **settings)


def assert_same(one, other):
    """All numbers of two results are equal."""
    for name in ("r", "p", "rd", "w", "rdd", "Lam"):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True), name


def programs(records):
    """The programs made last."""
    return list(records.values())[-1].programs


@pytest.mark.every(5)
@pytest.mark.parametrize(("model", "method"), [("pen1", "standard"), ("pen1", "joint"),
                         ("fourbar3", "joint"), ("fourbar2", "lsq"),
                         ("bodies2", "unconstrained")])  # fmt: skip
def test_bits_are_those_of_general_code(model, method, at_once):
    """And guards hold, at the latest where projections made anew take all ways."""
    for _ in range(2):
        result = dap.simulate(model, method=method, **SETTINGS)
        assert_same(result, general(model, method=method))
    found = programs(at_once)
    assert found[RHS].failures() == 0
    assert set(found) - {REPORT} in ({RHS}, {RHS, PROJECT, scene_program.BEHIND})


@pytest.mark.parametrize("method", ["standard", "lsq"])
def test_steps_of_a_fixed_length_project_by_a_program_alone(method, at_once):
    """They project what they end at before they evaluate it."""
    settings = {"method": method, "integrator": "rk4", "step": 1e-3}
    for _ in range(2):
        assert_same(dap.simulate("pen1", **SETTINGS, **settings), general("pen1", **settings))
    (name,) = at_once
    assert name.endswith(scene_program.ALONE)
    assert programs(at_once)[PROJECT].address != programs(at_once)[scene_program.BEHIND].address
    assert programs(at_once)[PROJECT].failures() < 3


@pytest.mark.every(2)
@pytest.mark.parametrize(("model", "method"), [("pen1", "joint"), ("fourbar3", "standard"),
                         ("bodies2", "unconstrained")])  # fmt: skip
def test_many_reports_have_a_program(model, method, at_once):
    """Of the bits of general code; few of them have none."""
    for dt, has_program in ((1e-3, True), (0.3, False)):
        expected = general(model, method=method, dt=dt)
        assert_same(dap.simulate(model, method=method, dt=dt, **SETTINGS), expected)
        found = programs(at_once)
        assert (REPORT in found) == has_program
        assert not has_program or found[REPORT].failures() == 0


def test_switches_have_programs(at_once):
    """A tricycle watches whether its disks lie."""
    assert_same(dap.simulate("tri", **SETTINGS), general("tri"))
    assert set(programs(at_once)) == {RHS, PROJECT, scene_program.BEHIND, WATCH}


def sliding_rod():
    """It lies on a floor, slides along itself and turns until it rests."""
    scene = dap.Scene(name="rod")
    scene.add_body("rod", mass=1.0, Jp=[0.01, 0.1, 0.1], r=[0.0, 0.0, 0.05], r_dot=[0.2, 0.1, 0.0])
    scene.add_force("weight", "g")
    ends = {"P_i": "foot", "Q_i": "tip"}
    scene.add_point("foot", "rod", [-0.5, 0.0, 0.0])
    scene.add_point("tip", "rod", [0.5, 0.0, 0.0])
    scene.add_contact("capsule_plane", "floor", **ends, radius=0.05, mu=0.3)
    return scene


@pytest.mark.slow
@pytest.mark.every(2)
@pytest.mark.parametrize("method", ["lsq", "joint"])
def test_contacts_run_by_programs_of_their_modes(method, at_once):
    """One for each set of modes; where switches have just been read rates are known.

    What rests may have none by the method joint: how often its multipliers, zero to rounding beside
    the shares that contacts take, are refined depends on rounding.
    """
    for _ in range(2):
        result = dap.simulate(sliding_rod(), method=method, **SETTINGS)
        assert_same(result, general(sliding_rod(), method=method))
    assert {"stick"} <= {event.kind for event in result.events}
    reasons = {record.reason for record in at_once.values()} - {""}
    assert all(method == "joint" and "guards fail" in reason for reason in reasons)
    made = [set(record.programs) for record in at_once.values() if record.programs]
    assert len(made) > 1
    assert any({RHS, WATCH} <= found for found in made)


@pytest.mark.slow
@pytest.mark.every(2)
@pytest.mark.parametrize("method", ["standard", "joint"])
def test_derivatives_run_by_programs(method, at_once, monkeypatch):
    """Numbers by which there are some are no constants; projections remain general ones.

    Two beside the value in a vector, and eight in one of their own.
    """
    by = ["bodies.cone.mass", "forces.gravity.gravity"]
    if method == "joint":
        by += [f"bodies.cone.{name}.{axis}" for name in ("Jp", "w") for axis in "xyz"]

    def slopes():
        return dap.sensitivities("pen1", by, method=method, **SETTINGS).of("cone.rdd")

    first, second = slopes(), slopes()
    found = programs(at_once)
    assert set(found) == ({RHS, PROJECT} if method == "standard" else {RHS})
    assert found[RHS].failures() == 0
    monkeypatch.setattr(change_over, "LOAD_AFTER", np.inf)
    expected = slopes()
    assert np.array_equal(first, expected)
    assert np.array_equal(second, expected)
    assert np.all(np.abs(expected).max(axis=(0, 1)) > 1e-3)


def test_controllers_run_by_programs(at_once):
    """They change inputs alone, which programs load."""
    scene = dap.load("pen1")
    scene.add_input("push", value=0.0)
    scene.add_force("np", "pushed", body_i="cone", np=(1.0, 0.0, 0.0), input="push")

    def controllers():
        return [dap.Controller(every=0.02, update=lambda t, state: {"push": np.sin(9.0 * t)})]

    result = dap.simulate(scene, controllers=controllers(), **SETTINGS)
    [record] = at_once.values()  # short steps may need no projection: then they are made anew
    assert record.programs or record.anew is not None
    assert_same(result, general(scene, controllers=controllers()))
    assert np.max(np.abs(result.r - general(scene).r)) > 1e-6


@pytest.mark.parametrize("record", [None, change_over.Record()])
def test_a_call_that_needs_programs_is_not_made_without_them(record, monkeypatch):
    """Also where another thread has just given them up."""
    monkeypatch.setattr(change_over.ChangeOver, "_record_of", lambda self, modes, start: record)
    calls, addresses = [], np.zeros(2, dtype=np.int64)
    call = change_over.ChangeOver(dap.compile("pen1").evaluator).call
    given = addresses, lambda: (0.0, np.zeros(0)), lambda: (0, 0, 0)
    call(lambda: calls.append("needed"), *given, needs_programs=True)
    call(lambda: calls.append("not needed"), *given)
    assert calls == ["not needed"]


def test_another_mass_is_another_program(at_once):
    """Numbers of the scene are constants of its program."""
    scene = dap.load("pen1")
    scene.bodies["cone"].mass = 2.0
    assert_same(dap.simulate(scene, **SETTINGS), general(scene))
    assert_same(dap.simulate("pen1", **SETTINGS), general("pen1"))
    assert len(at_once) == 2


def test_numbers_that_change_in_a_run_stop_the_program(at_once):
    """A call after an event has set a number is one of general code."""
    evaluator, seen = dap.compile("pen1").evaluator, []
    y0 = evaluator.coordinates.start(evaluator.model.u0)
    integration = EXPLICIT.make(
        evaluator, y0, np.array([0.0, 1.0]), report_size=evaluator.report_size
    )
    addresses = evaluator.functions.addresses
    before, advance = addresses.copy(), integration.advance

    def advanced(budget):
        seen.append(np.array_equal(addresses, before))
        return advance(budget)

    integration.advance = advanced
    programs = change_over.ChangeOver(evaluator)
    programs.during(integration, lambda: integration.advance(1))
    assert np.array_equal(addresses, before)
    evaluator.system.par[0] += 1e-3
    programs.during(integration, lambda: integration.advance(1))
    assert seen == [False, True]


def test_a_program_whose_guards_fail_is_given_up(at_once, monkeypatch):
    """General code runs from there on, with the same bits."""
    most = dict.fromkeys((WATCH, PROJECT, REPORT, RHS), -2.0)
    monkeypatch.setattr(change_over, "MOST_FAILURES", most)
    for _ in range(4):  # the first time they are made anew
        assert_same(dap.simulate("pen1", **SETTINGS), general("pen1"))
    record = list(at_once.values())[-1]
    assert record.anew is not None
    assert "guards" in record.reason
    assert not record.programs


def test_two_threads_give_up_one_projection_once():
    """What reads the right-hand side's factors never stands behind a program of that."""
    rhs, project, behind = ("rhs",), ("project",), ("behind",)
    programs = {RHS: rhs, PROJECT: project, scene_program.BEHIND: behind}
    record = change_over.Record(programs, anew=(0.0, np.zeros(1)))
    for _ in range(2):
        change_over._give_up(record, project, PROJECT, record.anew)
    assert record.programs == {RHS: rhs, PROJECT: behind}


def test_a_scene_without_program_runs(at_once, monkeypatch):
    """Where it would be too long, say; the reason is kept."""
    monkeypatch.setattr(scene_program, "MOST_INSTRUCTIONS", 10)
    monkeypatch.setattr(scene_program, "path_of", lambda name: None)
    assert_same(dap.simulate("pen1", **SETTINGS), general("pen1"))
    [record] = at_once.values()
    assert "more than 10 instructions" in record.reason


def test_modes_of_a_scene_without_program_try_no_more_than_they_take(at_once, monkeypatch):
    """Boxes on boxes lost six seconds for each set of modes, which general code had run by then."""
    clock, tried = [0.0], []

    def fail(*given):
        tried.append(given)
        clock[0] += 6.0
        raise TraceError("takes more than 22000 instructions")

    monkeypatch.setattr(scene_program, "write_programs", fail)
    monkeypatch.setattr(scene_program, "path_of", lambda name: None)
    monkeypatch.setattr(change_over, "time", SimpleNamespace(perf_counter=lambda: clock[0]))
    result = dap.simulate(sliding_rod(), **SETTINGS)
    assert {"stick"} <= {event.kind for event in result.events}
    assert len(tried) == 1


def test_short_runs_make_none(records):
    """Nothing is even looked for before general code has taken a while."""
    dap.simulate("pen1", t_end=0.1)
    assert records == {}
