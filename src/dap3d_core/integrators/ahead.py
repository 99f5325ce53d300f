"""The explicit integrator compiled ahead, in a process beside one that compiles a formulation.

It needs nothing of the formulation (kernels/beside.py). ``python -m dap3d_core.integrators.ahead``.
"""

from dap3d_core.assembly.system import STEP_TYPE, System
from dap3d_core.integrators import METHODS
from dap3d_core.integrators.runge_kutta import advance
from dap3d_core.integrators.work import Work
from dap3d_core.kernels.beside import compile_beside
from dap3d_core.kernels.cache import driver_is_cached
from dap3d_core.kernels.lists import INTEGER, LOOP_LIST, list_type


def start(integrator: str) -> None:
    """Let another process compile what a run with this integrator needs, if nobody did so far.

    ``Integration.compile`` waits for it.
    """
    if integrator in (*METHODS, "auto") and not driver_is_cached("integrators"):
        compile_beside("dap3d_core.integrators.ahead")


def main() -> None:
    """Compile ``advance``, for the types with which ``Integration`` calls it."""
    functions, system = list_type(STEP_TYPE), System.type_of()
    advance.compile((Work.type_of(), functions, system, LOOP_LIST, INTEGER))


if __name__ == "__main__":
    main()
