"""Parts of the core that many tests stand on besides their own subject, named in one place."""

from dap3d_core.assembly.arrays import (
    ANGLE,
    ENERGY,
    FRICTION,
    TOLERANCE_C,
    TOLERANCE_V,
    VALUE,
    WRENCH,
    System,
    step_functions,
)
from dap3d_core.assembly.collisions import placed_shapes
from dap3d_core.assembly.evaluate import call_kinds, place_bodies
from dap3d_core.assembly.metric import METRIC_CONSTANTS, gyroscopic_moment, orient_by_state
from dap3d_core.assembly.motion.classify import classify
from dap3d_core.cli.process.exit_codes import Refused, Terminated
from dap3d_core.formats.import_scene import source_files
from dap3d_core.formulations.contacts.contact_table import ContactTable
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.pivots import near_singular_rows, store_reference_pivots
from dap3d_core.formulations.programs import change_over, scene_program
from dap3d_core.integrators import adams
from dap3d_core.integrators.radau.state import RadauState
from dap3d_core.integrators.radau.tableau import COEFFICIENTS, MOST_STAGES, STAGES, radau_method
from dap3d_core.integrators.stepping.integration import Refusals, off_constraints
from dap3d_core.integrators.stepping.integration_state import (
    KIND,
    LOGGED,
    MEASURES,
    NOISE,
    IntegrationState,
    Y,
)
from dap3d_core.interface import hooks
from dap3d_core.interface.codegen.compile_loops import compile_all, write
from dap3d_core.interface.codegen.loop_source import LOOP_KINDS, stride
from dap3d_core.interface.examine.sized_types import (
    Shape,
    described,
    entry_fields,
    sample_classes,
    shared_slots,
    sized,
)
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
from dap3d_core.interface.types import SYMBOLS, BodyPose, pose
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.compiler import background, objects, units
from dap3d_core.kernels.compiler.derivatives import differentiate
from dap3d_core.kernels.compiler.functions import Program
from dap3d_core.kernels.compiler.straight_line import Item, StraightLine
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
from dap3d_core.kernels.runtime import ready, source_digest
from dap3d_core.kernels.runtime.array_struct import (
    VECTOR,
    Arrays,
    Matrix,
    Scalar,
    pointer,
)
from dap3d_core.kernels.runtime.cache import Compiled, compiled, distrust, jit_is_on
from dap3d_core.kernels.runtime.function_lists import LOOP, LoopArrays, call_loop, loop_list
from dap3d_core.kernels.runtime.lanes import (
    DifferentiatedArrays,
    Differentiation,
    WideArrays,
    differentiated,
    wide_function,
)
from dap3d_core.kernels.runtime.loop_modules import (
    Loop,
    array_members,
    build,
    source_of,
    unit_names,
)
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, JP, MASS, A, P, unwound
from dap3d_core.linear import rank
from dap3d_core.linear.ldlt.factor import add_product, assemble, factor, scale_blocks, solve_saddle
from dap3d_core.linear.ldlt.plan import make_plan
from dap3d_core.model.rigid_motion import (
    Pose,
    adjoint,
    compose,
    cross,
    exponential,
    inverse,
    matrices,
    relative,
    rotation_vector,
    skew,
    turned,
)
from dap3d_core.model.rotations import (
    euler_rates,
    roll_pitch_yaw,
    roll_pitch_yaw_rates,
    rotation,
    to_body,
    to_global,
)
from dap3d_core.model.state_layout import join, split, u_from_y, y_from_u
from dap3d_core.registry import discovery
from dap3d_core.registry.extensions import extension_listing, extensions
from dap3d_core.result.arrays import COLUMNS, arrays_of
from dap3d_core.result.file import checksum
from dap3d_core.result.post.smooth_parts import smooth_parts
from dap3d_core.result.quantities.catalogue import QUANTITIES, SYSTEM
from dap3d_core.result.quantities.csv_table import columns_of, jacobian_columns, selected, write_csv
from dap3d_core.result.quantities.lookup import COORDINATE
from dap3d_core.result.quantities.netcdf_export import dataset_to_write, selection_of, write_netcdf
from dap3d_core.scene.expressions.expression import (
    DEEPEST,
    LONGEST,
    OPERATORS,
    WORDS,
    ExpressionError,
    parse_expression,
)
from dap3d_core.scene.files.read_toml import LARGEST_FILE, group_of, scene_of
from dap3d_core.scene.tables import HEADER_KEYS, NAMED, TABLES, Animation, Element, fault_of_name
from dap3d_core.scene.validate.mistake_collector import Collector, lines_of
from dap3d_core.settings import FIXED_STEP, INTEGRATORS, METHODS
from dap3d_core.simulation.checkpoint.save import (
    FORMAT,
    Checkpoint,
    path_of,
    read_checkpoint,
    write_checkpoint,
)
from dap3d_core.simulation.equilibrium.search import held_solution, trust_region_step
from dap3d_core.simulation.events import contact_jumps
from dap3d_core.simulation.initial.assemble import correct_initial
from dap3d_core.simulation.output import free_space
from dap3d_core.simulation.settings import integration_options
from dap3d_core.study.sweep.dataset import evenly, is_sweep
from dap3d_core.testing import packages
from dap3d_core.testing.samples.sampled_type import own_values, sampled_types, with_functions
