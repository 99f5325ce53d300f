"""A scene pays for nothing that it does not use: imports and compilations in fresh processes."""

from functools import cache

import pytest
from support.plain import in_another_process
from support.process import REPOSITORY, run

pytestmark = in_another_process

MODULES = "import sys; print(' '.join(m for m in sys.modules))"
HEAVY = {"numpy", "scipy", "llvmlite", "matplotlib", "netCDF4", "xarray"}


#: A run that needs nothing but a joint and a weight.
PLAIN_RUN = "import dap3d_core as dap\nresult = dap.simulate('pen1', t_end=0.04, dt=0.02)"
QUANTITIES = """result.quantity("cone.r.z")
try:
    result.quantity("cone")
except KeyError:
    pass"""
STEPPED_RUN = "dap.start('pen1').step(0.01)"
#: Runs of a model to which something may be added; tells its loops and sizes of arrays.
SCENE = """
import dap3d_core as dap
scene = dap.load({model!r})
{added}
compiled = dap.compile(scene, method={method!r})
dap.simulate(compiled, t_end=0.1, dt=0.02)
system, evaluator = compiled.evaluator.system, compiled.evaluator
print(*{{kind for kind, _ in evaluator.loop_groups}})
print(system.states.size, system.rates.size, compiled.model.state_count, system.friction.size,
      evaluator.has_unknowns)
"""
#: What a scene has to have for each of these modules, and for the kinds of loops behind them.
NEEDED = {
    "scene.add_requirement('dap3d')": ({"packaging", "dap3d_core.scene.requirements"}, ()),
    "scene.add_force('maxwell', 'late', P_i='upper.O', P_j='ground.O', k=1.0, c=1.0)": (
        {"dap3d_core.model.element_states", "dap3d_core.interface.examine.check_states"}, ()),
    "scene.add_contact('ball_plane', P_i='upper.O', P_j='ground.O', a_j='ground.z')": (
        {"dap3d_core.formulations.contacts", "dap3d_core.simulation.events.contact_jumps",
         "dap3d_core.interface.contacts.rows"}, ()),
    "scene.add_force('plane_stop', P_i='upper.O', a_j='ground.z', k=1e4)": (
        {"dap3d_core.formulations.jumps.law", "dap3d_core.simulation.events.jumps"}, ("impulse",)),
    "scene.add_shape('toothed-wheel', 's', body='upper', radius=0.1, width=0.1, teeth=9)": (
        {"dap3d_example.toothed_wheel", "dap3d_core.registry.extensions"}, ()),
}  # fmt: skip
#: What sets the inputs of a stepped run.
SETTING_INPUTS = ("dap3d_core.simulation.control", "dap3d_core.simulation.stepwise",
                  "dap3d_core.integrators.stepping.hold")  # fmt: skip
#: Modules that neither model below needs, and parts of the core.
NOWHERE = ("matplotlib", "netCDF4", "xarray", "rich", "dap3d_core.formulations.joint",
           "dap3d_functions.grid", "scipy.optimize", *SETTING_INPUTS,
           "dap3d_core.model.reaction_groups", "dap3d_core.interface.codegen.unknowns",
           "dap3d_core.kernels.eliminate_unknowns", "dap3d_core.scene.signals",
           "dap3d_core.interface.codegen.terms")  # fmt: skip


@cache
def imported(script):
    return set(run(f"{script}\n{MODULES}").splitlines()[-1].split())


#: Who does not choose radau neither imports nor compiles it.
RADAU = tuple(f"dap3d_core.{name}" for name in (
    "formulations.stabilized_index2.jacobian", "formulations.stabilized_index2.stage_equations",
    "integrators.radau.integration", "integrators.radau.step", "linear.lu"))  # fmt: skip
#: All but those that are put together of others, whose places are products of rotations.
LOADED = """import dap3d_core as dap
for name in dap.shipped_models():
    if name not in ("sphere_box", "walker"):
        dap.load(name).to_toml()"""
VIEWED = "assert dap.view(dap.simulate('bodies2', t_end=0.04)).html"
GRID = """varied = {"forces.spring1.k": [10.0, 20.0]}
dap.sweep("bodies2", varied, outputs="upper.r.x", t_end=0.04, threads=1)"""
COMMAND = """from dap3d_core.cli import main
assert main(["run", "pen1", "--t-end", "0.1", "-o", "run.nc", "-q"]) == 0"""
#: Scripts, one after another in one process, and what they leave alone, by beginnings of names of
#: modules: the package, its registry, scenes, results, runs, a page, a grid in memory, a command.
LEFT_ALONE = {
    "import dap3d_core": (*HEAVY, "rich", "click", "pluggy", "dap3d_joints", "dap3d_forces",
                          "dap3d_functions"),
    "from dap3d_core.registry import load_registry; load_registry().keywords('joint')": (
        "numpy", "scipy", "llvmlite", "matplotlib", "rich", "click", "dap3d_joints"),
    LOADED: ("numpy", "scipy", "llvmlite", "matplotlib", "tomlkit"),
    "import dap3d_core.result": (*HEAVY - {"numpy"}, "pandas"),
    # neither importers nor what they are made with; nothing of sweeps, fits, clusters
    PLAIN_RUN: ("dap3d_formats", "dap3d_core.formats", "dap3d_core.interface.formats", "xml",
                "pyexpat", "dap3d_core.study", "dap3d_core.simulation.kinematics",
                "scipy.integrate", "dap3d_core.simulation.redundancy.freedoms",
                "numpy.ma.", "uuid", *RADAU, *SETTING_INPUTS),
    QUANTITIES: ("dap3d_core.scene.expressions", "graphlib"),
    STEPPED_RUN: ("dap3d_core.scene.signals", "dap3d_core.interface.codegen.terms"),
    # a page of a scene without meshes: nothing for plots in files, or for meshes
    VIEWED: ("matplotlib", "trimesh", "netCDF4", "xarray", "rich", "click"),
    # nothing that draws samples, fits, speaks to a cluster or reads measured data
    GRID: ("distributed", "scipy.stats", "scipy.optimize", "matplotlib", "dap3d_core.study.fit",
           "dap3d_core.study.workers.dask_cluster",
           "dap3d_core.result.quantities.measured_data"),
    # no other analysis, nothing that these need, no starts from results
    COMMAND: (*(f"dap3d_core.simulation.{name}" for name in (
                  "equilibrium", "kinematics", "linearization", "initial.start_state")),
              "dap3d_core.kernels.compiler.derivatives",
              "dap3d_core.interface.codegen.loop_derivatives", "scipy.sparse.linalg", "control"),
}  # fmt: skip


def test_a_script_leaves_alone_what_it_does_not_need(tmp_path):
    """And a stepped run loads what sets its inputs."""
    scripts = "\n".join(f"{script}\n{MODULES}" for script in LEFT_ALONE)
    said = run(scripts, cwd=tmp_path).splitlines()
    found = dict(zip(LEFT_ALONE, (set(line.split()) for line in said), strict=True))
    for script, others in LEFT_ALONE.items():
        assert not [m for m in found[script] if m.startswith(tuple(others))], script
    assert found[STEPPED_RUN] >= set(SETTING_INPUTS)


def told(model, added="", method="auto"):
    """Kinds of loops, sizes and modules of a run."""
    script = SCENE.format(model=model, added=added, method=method)
    *_, loops, sizes, modules = run(f"{script}\n{MODULES}").splitlines()
    return set(loops.split()), sizes, set(modules.split())


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("model", "own", "others"),
    [
        ("bodies2", "dap3d_forces.point_to_point", ("dap3d_joints", "dap3d_functions")),
        ("pen1", "dap3d_joints.spherical",
         ("dap3d_joints.revolute", "dap3d_forces.point_to_point", "dap3d_functions")),
    ],
)  # fmt: skip
def test_a_scene_has_only_what_it_needs(model, own, others):
    """No module, no loop, no number of types and parts that it does not name."""
    loops, sizes, found = told(model)
    assert own in found
    assert not {m for m in found if m.startswith((*others, *NOWHERE))}
    assert not found & set().union(*(modules for modules, _ in NEEDED.values()))
    assert sizes == "0 0 0 0 False"
    assert not loops & {"impulse", "bound", "friction", "angle", "rate"}
    if model == "bodies2":  # without joints no joint loop is made
        assert not {"acceleration", "position"} & loops
        assert "dap3d_core.formulations.standard" not in found


@pytest.mark.slow
@pytest.mark.parametrize("with_jumps", [False, True])
def test_what_a_scene_names_is_there(with_jumps):
    """Each of what the scenes above do without; contacts and other jumps exclude one another."""
    added = [line for line in NEEDED if ("add_contact" in line) != with_jumps]
    loops, sizes, found = told("bodies2", "\n".join(added))
    for modules, kinds in map(NEEDED.get, added):
        assert modules <= found
        assert set(kinds) <= loops
    assert sizes == "1 1 1 0 False" or not with_jumps
    assert not any("state_derivatives" in m or "states_at_rest" in m for m in found)


@pytest.mark.slow
def test_joint_coordinates_are_imported_where_a_scene_takes_them():
    _, _, found = told("pen1", method="joint")
    assert "dap3d_core.formulations.joint" in found
    assert "dap3d_core.formulations.joint_loops" not in found  # a tree keeps no rows


@pytest.mark.slow
def test_lanes_are_imported_by_long_studies():
    """Short ones bring in nothing of them."""
    names = {f"dap3d_core.{part}.lanes" for part in ("kernels.compiler", "study.batch")}
    script = (
        "import sys, numpy as np, dap3d_core as dap\n"
        "from dap3d_core.study.batch import compiled_batch\n"
        "def sweep(method):\n"
        "    points = {'bodies.cone.mass': np.linspace(1.0, 2.0, 40)}\n"
        "    dap.sweep('pen1', points, outputs='cone.r', t_end=0.02, method=method)\n"
    )
    script += (
        "sweep('joint')\n"
        "sweep('standard')\n"
        "assert 'dap3d_core.study.batch.lanes' not in sys.modules\n"  # derivatives bring the other
        "compiled_batch.BEFORE_LANES = 1\n"
        "sweep('standard')\n"
    )
    assert names <= imported(script)


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("file", "needed"),
    [("arm.urdf", "urdf"), ("parallelogram.sdf", "sdf"), ("parallelogram.xml", "mjcf")],
)
def test_an_import_loads_one_format(file, needed):
    """The importer of the file, without what other formats, exports and macros need."""
    path = REPOSITORY / "tests" / "data" / "formats" / file
    found = imported(f"import dap3d_core as dap\ndap.import_model({str(path)!r})")
    others = {"urdf", "sdf", "mjcf"} - {needed}
    assert f"dap3d_formats.{needed}.reader" in found
    assert not [m for m in found if m.startswith(tuple(f"dap3d_formats.{one}" for one in others))]
    assert not [m for m in found if "export" in m and m.startswith("dap3d")]
    assert not found & {"dap3d_formats.urdf.xacro", "trimesh", "xacrodoc", "lxml", "mujoco",
                        "llvmlite"}  # fmt: skip


@pytest.mark.parametrize("keyword", ["f", "fp", "n", "np", "ptp", "rot_sda"])
def test_a_force_without_a_factor_has_the_loop_of_one_that_knows_of_none(keyword):
    """Its instances have the integers of its bodies alone, and its loop reads no function."""
    from support.internals import stride, write

    from dap3d_core.registry import load_registry

    type_info = load_registry().get("force", keyword)
    assert type_info.layout.functions == ()
    assert stride(type_info) == len(type_info.layout.slots) + len(type_info.layout.others)
    assert "F[" not in "\n".join(write(type_info, "wrench").lines)
