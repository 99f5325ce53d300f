"""A scene pays for nothing that it does not use: imports and compilations in fresh processes."""

from functools import cache

import pytest
from support.plain import in_another_process
from support.process import REPOSITORY, run

pytestmark = in_another_process

MODULES = "import sys; print(' '.join(m for m in sys.modules))"
HEAVY = {"numpy", "scipy", "llvmlite", "matplotlib", "netCDF4", "xarray"}


#: A run that needs nothing but a joint and a weight.
PLAIN_RUN = "import dap3d_core as dap\ndap.simulate('pen1', t_end=0.04, dt=0.02)"


@cache
def imported(script):
    return set(run(f"{script}\n{MODULES}").splitlines()[-1].split())


def test_importing_the_package_imports_nothing_heavy():
    """``import dap3d_core`` brings in neither numerics nor plugins nor drawing."""
    found = imported("import dap3d_core")
    assert not found & (HEAVY | {"rich", "click", "pluggy"})
    assert not any(m.startswith(("dap3d_joints", "dap3d_forces", "dap3d_functions")) for m in found)


def test_the_command_help_imports_nothing_heavy():
    """``dap3d --help`` answers without numpy, scipy, llvmlite and matplotlib."""
    script = (
        "from dap3d_core.cli import main\ntry:\n    main(['--help'])\nexcept SystemExit:\n    pass"
    )
    assert not imported(script) & HEAVY


def test_requirements_are_read_where_a_scene_has_them():
    """The check of another scene brings in no comparison of versions."""
    names = {"packaging", "dap3d_core.scene.requirements"}
    script = "import dap3d_core as dap\nscene = dap.load('pen1')\n{}\n"
    script += "from dap3d_core.scene import check\ncheck(scene, dap.load_registry())"
    assert not imported(script.format("")) & names
    assert names <= imported(script.format("scene.add_requirement('dap3d')"))


def test_joint_coordinates_are_imported_where_a_scene_takes_them():
    """Method standard brings in nothing of them."""
    names = {"dap3d_core.formulations.joint"}
    assert not imported(PLAIN_RUN) & names
    found = imported(PLAIN_RUN.replace("dt=", "method='joint', dt="))
    assert names <= found
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
        f"assert not {names} & set(sys.modules)\n"
        "compiled_batch.BEFORE_LANES = 1\n"
        "sweep('standard')\n"
    )
    assert names <= imported(script)


def test_a_scene_without_states_has_nothing_of_them():
    """No module, no loop, no number; a scene with a force that has one has these."""
    script = (
        "import dap3d_core as dap\n"
        "scene = dap.load('bodies2')\n"
        "{}\n"
        "compiled = dap.compile(scene)\n"
        "result = dap.simulate(compiled, t_end=0.04, dt=0.02)\n"
        "assert len(result.quantity('upper.r').values)\n"
        "arrays = compiled.evaluator.system\n"
        "print('numbers', arrays.states.size, arrays.rates.size, compiled.model.state_count)"
    )
    added = "scene.add_force('maxwell', 'late', P_i='upper.O', P_j='ground.O', k=1.0, c=1.0)"
    names = {"dap3d_core.model.element_states", "dap3d_core.interface.examine.check_states"}
    for words, numbers, has in (("", "numbers 0 0 0", False), (added, "numbers 1 1 1", True)):
        lines = run(f"{script.format(words)}\n{MODULES}").splitlines()
        assert lines[-2] == numbers
        found = set(lines[-1].split())
        assert names <= found if has else not names & found
        assert not any("state_derivatives" in m or "states_at_rest" in m for m in found)


def test_formats_are_imported_by_their_commands_alone():
    """A run needs neither importers nor what they are made with; an import needs one of them."""
    found = imported(PLAIN_RUN)
    ours = ("dap3d_formats", "dap3d_core.formats", "dap3d_core.interface.formats", "xml", "pyexpat")
    assert not [m for m in found if m.startswith(ours)]
    file = REPOSITORY / "tests" / "data" / "formats" / "arm.urdf"
    found = imported(f"import dap3d_core as dap\ndap.import_model({str(file)!r})")
    assert "dap3d_formats.urdf" in found
    assert not found & {"trimesh", "xacrodoc", "lxml", "mujoco", "llvmlite"}


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
    assert "dap3d_formats.urdf.xacro" not in found


def test_inputs_and_what_sets_them_are_imported_where_a_scene_has_some():
    """A run without them brings in nothing of them; a loop of a script does."""
    names = {
        "dap3d_core.simulation.control",
        "dap3d_core.simulation.stepwise",
        "dap3d_core.integrators.stepping.hold",
        "dap3d_core.scene.signals",
        "dap3d_core.interface.codegen.terms",
    }
    assert not imported(PLAIN_RUN) & names
    found = imported("import dap3d_core as dap\ndap.start('pen1').step(0.01)")
    assert names & found == names - {
        "dap3d_core.scene.signals",
        "dap3d_core.interface.codegen.terms",
    }


@pytest.mark.parametrize("keyword", ["f", "fp", "n", "np", "ptp", "rot_sda"])
def test_a_force_without_a_factor_has_the_loop_of_one_that_knows_of_none(keyword):
    """Its instances have the integers of its bodies alone, and its loop reads no function."""
    from dap3d_core.interface.codegen.compile_loops import write
    from dap3d_core.interface.codegen.loop_source import stride
    from dap3d_core.registry import load_registry

    type_info = load_registry().get("force", keyword)
    assert type_info.layout.functions == ()
    assert stride(type_info) == len(type_info.layout.slots) + len(type_info.layout.others)
    assert "F[" not in "\n".join(write(type_info, "wrench").lines)


@pytest.mark.parametrize(
    ("model", "present", "absent"),
    [
        ("bodies2", {"dap3d_forces.point_to_point"}, {"dap3d_joints", "dap3d_functions"}),
        (
            "pen1",
            {"dap3d_joints.spherical"},
            {"dap3d_joints.revolute", "dap3d_forces.point_to_point", "dap3d_functions"},
        ),
    ],
)
def test_a_model_loads_only_its_own_types(model, present, absent):
    """Types that the scene does not name are not imported; without joints no joint loop is made."""
    script = (
        "import dap3d_core as dap\n"
        f"compiled = dap.compile(dap.load({model!r}))\n"
        "print('loops', ' '.join(kind for kind, group in compiled.evaluator.loop_groups))\n"
    )
    lines = run(f"{script}\n{MODULES}").splitlines()
    found = set(lines[-1].split())
    assert present <= found
    assert not {m for m in found if m.startswith(tuple(absent))}
    assert not found & {"matplotlib", "netCDF4", "xarray", "rich"}
    if model == "bodies2":
        assert not {"acceleration", "position"} & set(lines[-2].split())
        assert "dap3d_core.formulations.standard" not in found


def test_a_run_needs_no_analysis_and_no_other_start(tmp_path):
    """``dap3d run`` imports no other analysis, nothing that these need, no starts from results."""
    found = imported(
        "from dap3d_core.cli import main\n"
        f"main(['run', 'pen1', '--t-end', '0.1', '-o', {str(tmp_path / 'r.nc')!r}, '-q'])"
    )
    assert "dap3d_core.simulation.run" in found
    floors = ("equilibrium", "kinematics", "linearization", "initial.start_state")
    core = (*(f"simulation.{name}" for name in floors), "kernels.compiler.derivatives",
            "interface.codegen.loop_derivatives")  # fmt: skip
    others = (*(f"dap3d_core.{name}" for name in core), "scipy.sparse.linalg", "control")
    assert not {m for m in found if m.startswith(others)}


def test_a_run_without_contacts_knows_nothing_of_them():
    """No module of theirs, no other function of the formulation; with one they are there."""
    script = (
        "import dap3d_core as dap\nscene = dap.load('bodies2')\n{}dap.simulate(scene, t_end=0.1)\n"
    )
    floor = "scene.add_contact('ball_plane', P_i='upper.O', P_j='ground.O', a_j='ground.z')\n"
    for more, has_contacts in (("", False), (floor, True)):
        found = set(run(f"{script.format(more)}\n{MODULES}").splitlines()[-1].split())
        own = {m for m in found if m.startswith("dap3d_core.formulations.contacts")}
        assert bool(own) == has_contacts
        assert ("dap3d_core.simulation.events.contact_jumps" in found) == has_contacts
        assert ("dap3d_core.interface.contacts.rows" in found) == has_contacts


def test_a_run_without_jumps_knows_nothing_of_them():
    """Neither modules nor loops, nor functions of the formulation; with jumps they are there."""
    script = (
        "import dap3d_core as dap\n"
        "scene = dap.load('bodies2')\n"
        "{}"
        "compiled = dap.compile(scene)\n"
        "dap.simulate(compiled, t_end=0.1)\n"
        "print('loops', ' '.join(kind for kind, group in compiled.evaluator.loop_groups))\n"
    )
    names = {"dap3d_core.formulations.jumps.law", "dap3d_core.simulation.events.jumps"}
    stop = "scene.add_force('plane_stop', P_i='upper.O', a_j='ground.z', k=1e4)\n"
    for more, has_jumps in (("", False), (stop, True)):
        lines = run(f"{script.format(more)}\n{MODULES}").splitlines()
        assert ("impulse" in lines[-2].split()) == has_jumps
        assert (set(lines[-1].split()) & names == names) == has_jumps
        assert bool(set(lines[-1].split()) & names) == has_jumps
        assert "scipy.optimize" not in lines[-1].split()


def test_a_page_needs_neither_matplotlib_nor_a_reader_of_meshes():
    """``dap.view`` of a scene without meshes imports nothing for plots in files, or for meshes."""
    script = (
        "import dap3d_core as dap\n"
        "result = dap.simulate('bodies2', t_end=0.04, dt=0.02)\n"
        "assert dap.view(result).html\n"
    )
    assert not imported(script) & {"matplotlib", "trimesh", "netCDF4", "xarray", "rich", "click"}


def test_a_run_knows_nothing_of_studies():
    """``dap.simulate`` imports nothing of sweeps, fits, clusters."""
    found = imported(PLAIN_RUN)
    others = ("dap3d_core.study", "dap3d_core.simulation.kinematics", "scipy.integrate")
    assert not any(name.startswith(others) for name in found)
    assert "dap3d_core.simulation.redundancy.freedoms" not in found


@pytest.mark.slow
def test_a_grid_in_memory_needs_no_samples_no_cluster_and_no_packs_of_its_own():
    """What draws samples, fits, speaks to a cluster or draws pictures is left alone by a grid."""
    script = (
        "import dap3d_core as dap\n"
        "asked = {'forces.spring1.k': [10.0, 20.0]}\n"
        "dap.sweep('bodies2', asked, outputs='upper.r.x', t_end=0.04, threads=1)\n"
    )
    found = imported(script)
    heavy = {"distributed", "scipy.stats", "scipy.optimize", "matplotlib"}
    assert not found & heavy
    ours = {name.rpartition(".")[2] for name in found if name.startswith("dap3d_core.study.")}
    assert not ours & {"dask_cluster", "environment", "fit", "identifiability"}
    assert "dap3d_core.result.quantities.measured_data" not in found


def test_reactions_and_unknowns_cost_other_scenes_nothing():
    """No module of theirs, no loop, no array where no type has them."""
    script = (
        "import dap3d_core as dap\n"
        "compiled = dap.compile(dap.load('fourbar3'))\n"
        "dap.simulate(compiled, t_end=0.02, dt=0.02)\n"
        "evaluator = compiled.evaluator\n"
        "print('loops', *(kind for kind, group in evaluator.loop_groups))\n"
        "print(evaluator.system.friction.size, evaluator.has_unknowns)\n"
    )
    *_, loops, arrays, modules = run(f"{script}\n{MODULES}").splitlines()
    theirs = {"dap3d_core.model.reaction_groups", "dap3d_core.interface.codegen.unknowns",
              "dap3d_core.kernels.eliminate_unknowns"}  # fmt: skip
    assert not theirs & set(modules.split())
    assert not {"bound", "friction", "angle", "rate"} & set(loops.split())
    assert arrays == "0 False"


def test_shapes_and_maps_are_imported_where_a_scene_has_them():
    """A kind of shape of a package by a scene that names it; others look for none."""
    ours = {"dap3d_core.registry.extensions", "dap3d_core.interface.shapes", "dap3d_functions.grid"}
    script = "import dap3d_core as dap\nscene = dap.load('bodies2')\n{}\n"
    script += "dap.simulate(scene, t_end=0.02, dt=0.02)"
    sphere = "scene.add_shape('sphere', 's', body='upper', radius=0.1)"
    assert not imported(script.format(sphere)) & ours
    wheel = "scene.add_shape('toothed-wheel', 's', body='upper', radius=0.1, width=0.1, teeth=9)"
    found = imported(script.format(wheel))
    assert {"dap3d_example.toothed_wheel", "dap3d_core.registry.extensions"} <= found
    assert "dap3d_functions.grid" not in found
