"""Each compiled function of the core: plain Python and machine code give the same bits.
Calls are recorded in plain Python and repeated (tests/support/recorded_calls.py)."""

import json

import pytest
from support.internals import FLOAT, INT, Known, Struct
from support.plain import jit_is_on
from support.problems import short_runs
from support.process import REPOSITORY, run

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")

#: Repeats the calls of some runs; prints what differs and which functions were not called.
SCRIPT = """
import json, sys, warnings
sys.path[:0] = [{tests!r}, {tests!r} + "/unit"]
from support.recorded_calls import Recorder, Translated, differences
import numpy as np
import dap3d_core as dap
warnings.simplefilter("ignore")
recorder = Recorder()
{scenarios}
few = list(recorder.calls)
{more}
calls, translated = recorder.calls, Translated()
print(json.dumps([[len(few), differences(few, {few}, translated)],
                  [len(calls), {all} and differences(calls, {all}, translated)],
                  recorder.missing()]))
"""
QUICK = [("bodies2", {"t_end": 0.002, "dt": 0.001})]
RUNS = [*QUICK, *short_runs(0.001)]
#: Friction, singular poses, points, dense supernodes, radau with states of elements: each of these
#: calls a function that no other one calls.
MORE = """
from support.problems import everything
from support.on_axles import wheel
from support import loops, singular, trees
from unit.study.batch.test_batch import ensemble, pendulum
from unit.study.batch.test_lanes import CASES

def points(make, vary, output, t_end=0.02, **settings):
    study = ensemble(make(), vary, [output], t_end=t_end, dt=0.01, **settings)
    low, high = np.array(list(vary.values())).T
    study.run(low + np.random.default_rng(1).random((4, len(vary))) * (high - low))

recorder.record(dap.simulate, wheel(), t_end=0.2, dt=0.1, integrator="radau")
from unit.formulations.joint.test_equations import hinged_spring
for scene in (trees.random_tree(8, 5, free=0.2), hinged_spring()):
    recorder.record(dap.simulate, scene, t_end=0.01, dt=0.01, method="joint")
rubbing = loops.spatial_four_bar()
rubbing.add_force("friction", joint="J2", mu=0.2, radius=0.05, v_tol=0.1)
for scene in (rubbing, "A04", "fourbar3"):
    recorder.record(dap.simulate, scene, t_end=0.01, dt=0.005, method="joint")
recorder.record(dap.simulate, singular.dead_centre(), t_end=1.2, dt=1.2, rtol=1e-6)
for name in ("starts that are corrected", "springs in free flight"):
    recorder.record(points, *CASES[name])
recorder.record(points, pendulum, {"bodies.bob.mass": (1.0, 3.0)}, "bob.w", method="penalty")
in_joint_coordinates = ensemble(pendulum(), ["bodies.bob.mass"], ["bob.w"], method="joint")
recorder.record(in_joint_coordinates.run, [[1.0], [3.0]])
from dap3d_core.linear.ordering import elimination_order, ordering
from support.graphs import Case, check_solution
from support.nets import plate_net
usual = elimination_order.WIDE, elimination_order.LEAF, ordering.ZEROS
elimination_order.WIDE, elimination_order.LEAF, ordering.ZEROS = 0, 4, 0.3
recorder.record(lambda: check_solution(Case(plate_net(8), np.random.default_rng(1))))
elimination_order.WIDE, elimination_order.LEAF, ordering.ZEROS = usual
from support.state_types import REGISTRY, stated, steered
recorder.record(dap.simulate, dap.compile(steered(), registry=REGISTRY), t_end=0.1, dt=0.1,
                integrator="radau")
for settings in ({"integrator": "radau"}, {"integrator": "radau", "method": "joint"}):
    recorder.record(dap.simulate, stated(), t_end=0.2, dt=0.1, **settings)
struck = pendulum()
struck.add_force("plane_stop", "stop", P_i="bob.O", P_j="ground.O", a_j="ground.z", k=1e4, e=0.5)
for method in ("standard", "lsq"):
    recorder.record(dap.simulate, struck, t_end=0.02, dt=0.02, method=method)
from support.redundant import hinged_door
door = hinged_door()
door.bodies["door"].Jp = (4.0, 1e-9, 4.0)
recorder.record(dap.simulate, door, t_end=1e-4, dt=1e-4, method="lsq")
"""
#: For a release: the same functions with other numbers.
OTHERS = """
for settings in ({"integrator": "dop853"}, {"integrator": "adams"}, {"method": "joint"}):
    recorder.record(dap.simulate, wheel(), t_end=0.2, dt=0.1, **settings)
recorder.record(dap.simulate, trees.mixed_chain(2), t_end=0.01, dt=0.01, method="joint")
recorder.record(dap.simulate, "bicycle", t_end=0.01, dt=0.005, method="joint")
recorder.record(dap.simulate, singular.flat_parallelogram(), t_end=0.5, dt=0.5, rtol=1e-6)
for case in CASES.values():
    recorder.record(points, *case)
recorder.record(points, *CASES["functions and their breaks"], t_end=0.6)
recorder.record(dap.simulate, "pen1", t_end=0.1, dt=0.1, rtol=1e-13, atol=1e-15)
recorder.record(dap.simulate, stated(), t_end=0.2, dt=0.1, method="joint")
recorder.record(dap.simulate, everything(), t_end=1e-4, dt=1e-4, integrator="radau")
"""
#: Functions that these runs do not call, of rare events of a run.
NOT_CALLED = {
    f"dap3d_core.{module}.{name}"
    for module, names in {
        "formulations.common.constraints": "linearise_evenly",
        "formulations.standard": "settle_rows",
        "integrators.adams": "reject",
        "integrators.stepping.vector_ops": "scaled_beyond",
        "integrators.runge_kutta.sums": "combine_by_table error_beyond_rounding",
        "integrators.stepping.singular_poses": "predict_measures is_approaching "
        "least_time_to_singularity",
        "integrators.radau.step": "reject_iteration stage_is_across blame",
        "integrators.radau.newton": "find_slopes",  # of differentiated code, as the next one is
        "integrators.radau.convergence": "change_of_slopes",
        "integrators.stepping.rounding": "measure_noise",
        "assembly.turns": "measure_all follow_poses",
        "formulations.regularised": "least_multipliers take_seen",
        "formulations.stabilized_index2.jacobian": "bridge_bends move sizes_of",
        "integrators.stepping.output": "report_end",
        "integrators.runge_kutta.step": "is_rounding",
        "integrators.stepping.event_location": "cut_step is_sample_across put_rates_before",
        "integrators.stepping.switch_values": "first_across has_jumped correct_rates",
        "linear.rank": "solve_each",
        "linear.ldlt.factor": "weigh_alike square_of_corner",  # of contacts
        "study.batch.initial_state": "put_back",  # of differentiated code
        # of jumps with closed forms: unit/formulations/jumps, unit/simulation/events
        "formulations.jumps.multipliers": "rotate seek_active",
        "formulations.jumps.rounds": "kick has_crossed stop",
        "formulations.jumps.held_joints": "place_alone solve_free",
        # of runs with derivatives: study/sensitivities compares their values with those without
        "integrators.stepping.integration": "project_here",
    }.items()
    for name in names.split()
}
#: Modules that these runs do not need. Lanes are compiled alone: study/batch/test_lanes.py compares
#: their bits with those of single runs. Contacts have closed forms, verification/test_contacts.py;
#: of shapes that collide unit/assembly/collisions, verification/test_stepping.py.
NOT_NEEDED = tuple(
    f"dap3d_core.{module}."
    for module in (
        "formulations.programs.wide_program", "integrators.runge_kutta.lanes", "study.batch.lanes",
        "assembly.collisions", "integrators.moreau", "formulations.contacts",
        "formulations.joint_loops.contacts", "linear.least_squares",
    )
)  # fmt: skip


def repeated(runs, few, more="", every=()):
    """Of the calls of runs at levels, of these and more at others: number, those that differ.
    And the functions that were not called."""
    lines = [
        f"recorder.record(dap.simulate, {model!r}, **{settings!r})" for model, settings in runs
    ]
    script = SCRIPT.format(tests=str(REPOSITORY / "tests"), scenarios="\n".join(lines), more=more,
                           few=few, all=list(every))  # fmt: skip
    return json.loads(run(script, timeout=1200).splitlines()[-1])


@pytest.fixture(scope="module", params=["O0", pytest.param("O3", marks=pytest.mark.long)])
def found(request):
    """Recorded once: to record takes as long as to compile. To optimise takes longest."""
    more = MORE + OTHERS if request.param == "O3" else MORE
    return repeated(RUNS, ["differentiated"], more, [request.param])


@pytest.mark.parametrize(
    "level", ["O0", pytest.param("O3", marks=[pytest.mark.slow, pytest.mark.long])]
)
def test_calls_of_a_short_run_have_the_bits_of_plain_python(level):
    (count, different), *_ = repeated(QUICK, [level])
    assert count > 100
    assert different == []


@pytest.mark.slow
def test_each_compiled_function_of_the_core_has_the_bits_of_plain_python(found):
    """Functions not called are listed. Optimised for releases, those of a short run always.
    Without FMA: `make no-fma`."""
    _, (count, different), missing = found
    assert count > 4000
    assert different == []
    assert {name for name in missing if not name.startswith(NOT_NEEDED)} == NOT_CALLED


@pytest.mark.slow
def test_calls_have_the_same_bits_where_their_numbers_carry_derivatives(found):
    """Functions of all formulations and integrators; complex numbers of radau as well.
    Where a switch crosses, Newton steps for derivatives leave other numbers in rows of scratch; so
    do passes for derivatives of stages in their residuals."""
    (count, different), *_ = found
    assert count > 2000
    integrators = "dap3d_core.integrators."
    assert {name.split()[0].removeprefix(integrators) for name in different} <= {
        "stepping.event_location.bisect_crossing",
        "stepping.event_location.differentiated_crossing",
        "radau.newton.find_stages",
        "radau.joint_integration.find_rate_stages",
    }


def test_types_of_one_shape_are_different_types():
    """Code for a struct, or for a constant, is never taken for that of another one."""
    members = (("x", FLOAT), ("n", INT))
    assert Struct("A", members) != Struct("B", members[::-1])
    assert len({Known(0), Known(0.0), Known(-0.0), Known(False)}) == 4
    assert Known(2.0) == Known(2.0)
