"""Parts of the core that many tests stand on besides their own subject, named in one place."""

from dap3d_core.assembly.evaluate import call_kinds, place_bodies
from dap3d_core.cli.process.exit_codes import Refused, Terminated
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.pivots import near_singular_rows, store_reference_pivots
from dap3d_core.integrators.radau.state import RadauState
from dap3d_core.integrators.stepping.integration import Refusals, off_constraints
from dap3d_core.interface.examine.sized_types import sample_classes
from dap3d_core.interface.fields import sized_fields, slot_of, specs_of
from dap3d_core.interface.formats import (
    FormatError,
    Frame,
    Inertial,
    Remarks,
    inertia_of_mesh,
    inertia_of_solid,
    parse_xml,
    total_inertia,
)
from dap3d_core.interface.types import SYMBOLS, pose
from dap3d_core.kernels.compiler.functions import Program
from dap3d_core.kernels.compiler.trace import Symbol, TraceError, trace
from dap3d_core.kernels.compiler.types import (
    COMPLEX,
    DTYPES,
    FLOAT,
    INT,
    NOTHING,
    Array,
    CompileError,
    Known,
    Signature,
    Struct,
    Table,
    Tuple,
)
from dap3d_core.kernels.compiler.units import Entry, Functions, Unit, address_of, type_of
from dap3d_core.kernels.runtime.array_struct import INTEGERS, MATRIX, VECTOR, Arrays, pointer
from dap3d_core.kernels.runtime.cache import Compiled, compiled, distrust, jit_is_on
from dap3d_core.kernels.runtime.function_lists import LOOP, LoopArrays, call_loop, loop_list
from dap3d_core.kernels.runtime.loop_modules import (
    Loop,
    array_members,
    build,
    source_of,
    unit_names,
)
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, JP, MASS, unwound
from dap3d_core.linear.ldlt.plan import make_plan
from dap3d_core.model.rigid_motion import (
    Pose,
    compose,
    inverse,
    matrices,
    relative,
    rotation_vector,
)
from dap3d_core.model.state_layout import join, split, u_from_y, y_from_u
from dap3d_core.result.arrays import COLUMNS, arrays_of
from dap3d_core.result.quantities.csv_table import columns_of, selected, write_csv
from dap3d_core.result.quantities.netcdf_export import dataset_to_write
from dap3d_core.scene.expressions.expression import (
    OPERATORS,
    WORDS,
    ExpressionError,
    parse_expression,
)
from dap3d_core.scene.files.line_numbers import lines_of
from dap3d_core.scene.files.read_toml import LARGEST_FILE, scene_of
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.simulation.checkpoint.save import (
    FORMAT,
    Checkpoint,
    path_of,
    read_checkpoint,
    write_checkpoint,
)
from dap3d_core.simulation.initial.assemble import correct_initial

__all__ = [
    "BODY_WIDTH", "COLUMNS", "COMPLEX", "DTYPES", "FLOAT", "FORMAT", "INT", "INTEGERS", "JP",
    "LARGEST_FILE", "LOOP", "MASS", "MATRIX", "NOTHING", "OPERATORS", "SYMBOLS", "VECTOR", "WORDS",
    "Array", "Arrays", "Checkpoint", "Collector", "CompileError", "Compiled", "Entry", "Evaluator",
    "ExpressionError", "FormatError", "Frame", "Functions", "Inertial", "Known", "Loop",
    "LoopArrays", "Pose", "Program", "RadauState", "Refusals", "Refused", "Remarks", "Signature",
    "Struct", "Symbol", "Table", "Terminated", "TraceError", "Tuple", "Unit", "address_of",
    "array_members", "arrays_of", "build", "call_kinds", "call_loop", "columns_of", "compiled",
    "compose", "correct_initial", "dataset_to_write", "distrust", "inertia_of_mesh",
    "inertia_of_solid", "inverse", "jit_is_on", "join", "lines_of", "loop_list", "make_plan",
    "matrices", "near_singular_rows", "off_constraints", "parse_expression", "parse_xml", "path_of",
    "place_bodies", "pointer", "pose", "read_checkpoint", "relative", "rotation_vector",
    "sample_classes", "scene_of", "selected", "sized_fields", "slot_of", "source_of", "specs_of",
    "split", "store_reference_pivots", "total_inertia", "trace", "type_of", "u_from_y",
    "unit_names", "unwound", "write_checkpoint", "write_csv", "y_from_u",
]  # fmt: skip
