"""Operations of programs: those that stay when LLVM takes out what no result needs."""

import re

import llvmlite.binding as llvm
import pytest
from support.internals import off_constraints, scene_program
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.cli.commands.describe_model import operations

pytestmark = long_in_plain_python


def without_dead_code(text):
    """The instructions of a program that LLVM keeps when it removes dead ones alone."""
    module = llvm.parse_assembly(text)
    machine = llvm.Target.from_default_triple().create_target_machine()
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options())
    manager = llvm.create_new_module_pass_manager()
    manager.add_dead_code_elimination_pass()
    manager.run(module, builder)
    return str(module).partition("program:")[2].partition("general:")[0]


@pytest.mark.parametrize("name", ["pen1", "fourbar3"])
def test_they_are_those_that_results_need(name):
    evaluator = dap.compile(name).new_evaluator()
    state = off_constraints(evaluator.coordinates.start(evaluator.model.u0))
    evaluator.start(0.0, evaluator.model.u0)
    for k, program in enumerate(operations(evaluator, 0.0, state)):
        names = {"name": "one", "counter": "two", "general": "three"}
        text, needs = scene_program.write_program(evaluator, k, 0.0, state, names)
        arguments = "double, ptr, i64, ptr, i64, ptr, ptr"
        declared = [*needs.values(), f"declare void @three({arguments})"]
        left = without_dead_code("\n".join([*declared, text, "!0 = !{}", "!1 = !{}"]))
        for kind, pattern in {
            "loads": r" = load double", "sums and products": r" = (?:fadd|fsub|fmul|fneg)\b",
            "quotients and roots": r" = fdiv\b| = call double @llvm\.sqrt",
        }.items():  # fmt: skip
            assert program["total"][kind] == len(re.findall(pattern, left)), kind
        assert program["guards"] > 0


def test_parts_are_named_by_functions_and_types():
    """A free body has place, forces and rates, and no rows."""
    scene = dap.Scene(name="stone")
    scene.add_body("stone", mass=1.0, Jp=(1.0, 2.0, 3.0), w=(1.0, 2.0, 3.0))
    scene.add_force("ptp", P_i="stone.O", P_j="ground.O", k=1.0, l0=1.0)
    scene.bodies["stone"].r = (1.0, 0.0, 0.0)
    evaluator = dap.compile(scene).new_evaluator()
    (program,) = operations(evaluator, 0.0, evaluator.coordinates.start(evaluator.model.u0))
    assert {"evaluate.place_bodies", "evaluate.rates", "ptp: wrench"} <= program["parts"].keys()
    assert not any("factor" in part for part in program["parts"])
