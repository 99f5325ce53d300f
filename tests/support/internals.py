"""Parts of the core that many tests stand on besides their own subject, named in one place."""

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.interface.fields import specs_of
from dap3d_core.kernels.compiler.functions import Program
from dap3d_core.kernels.compiler.types import FLOAT, INT, Array, CompileError, Signature
from dap3d_core.kernels.runtime.array_struct import INTEGERS, MATRIX, Arrays, pointer
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.kernels.runtime.function_lists import LoopArrays, call_loop, loop_list
from dap3d_core.model.state_layout import join, split, u_from_y, y_from_u

__all__ = [
    "FLOAT", "INT", "INTEGERS", "MATRIX", "Array", "Arrays", "CompileError", "Evaluator",
    "LoopArrays", "Program", "Signature", "call_loop", "compiled", "join",
    "loop_list", "pointer", "specs_of", "split", "u_from_y", "y_from_u",
]  # fmt: skip
