"""Parts of the core that many tests stand on besides their own subject, named in one place."""

from dap3d_core.assembly.evaluate import call_kinds
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.pivots import store_reference_pivots
from dap3d_core.integrators.stepping.integration import off_constraints
from dap3d_core.interface.examine.sized_types import sample_classes
from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.types import pose
from dap3d_core.kernels.compiler.functions import Program
from dap3d_core.kernels.compiler.types import FLOAT, INT, Array, CompileError, Signature
from dap3d_core.kernels.compiler.units import Entry
from dap3d_core.kernels.runtime.array_struct import INTEGERS, MATRIX, Arrays, pointer
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.runtime.function_lists import LoopArrays, call_loop, loop_list
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH
from dap3d_core.linear.ldlt.plan import make_plan
from dap3d_core.model.rigid_motion import Pose, compose, relative
from dap3d_core.model.state_layout import join, split, u_from_y, y_from_u
from dap3d_core.result.quantities.csv_table import columns_of, write_csv
from dap3d_core.simulation.checkpoint.save import Checkpoint, read_checkpoint, write_checkpoint
from dap3d_core.simulation.initial.assemble import correct_initial

__all__ = [
    "BODY_WIDTH", "FLOAT", "INT", "INTEGERS", "MATRIX", "Array", "Arrays", "Checkpoint",
    "CompileError", "Entry", "Evaluator", "LoopArrays", "Pose", "Program", "Signature",
    "call_kinds", "call_loop", "columns_of", "compiled", "compose", "correct_initial", "join",
    "loop_list", "make_plan", "off_constraints", "pointer", "pose", "read_checkpoint", "relative",
    "sample_classes", "specs_of", "split", "store_reference_pivots", "u_from_y",
    "write_checkpoint", "write_csv", "y_from_u",
]  # fmt: skip
