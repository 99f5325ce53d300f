"""The order of a Radau step, by the convergence of its iteration and by its failures.

Source: Hairer, Wanner, Stiff differential equations solved by Radau methods (J. Comp. Appl. Math.
111, 1999). Where the iteration converges fast it is the error that keeps steps short, and more
stages allow for longer ones; where it hardly converges, or the motion is rough, fewer stages serve.
"""

from dap3d_core.integrators.radau.newton import method_index
from dap3d_core.integrators.radau.state import ATOL, LIMIT, RTOL, RadauState
from dap3d_core.integrators.radau.tableau import FEWEST
from dap3d_core.integrators.stepping.integration_state import ABSOLUTE
from dap3d_core.kernels.runtime.cache import compiled

#: The order rises where the iteration converges faster than this, after so many steps of an order;
#: after twice as many each time that it had to fall, up to MOST_PATIENT.
FAST, SETTLED, MOST_PATIENT = 0.03, 5, 40


@compiled
def set_tolerances(work: RadauState) -> None:
    """Make the tolerances of the present order those of the error estimate."""
    row = work.tolerances[method_index(work.stages)]
    work.rtol, work.newton_limit = row[RTOL], row[LIMIT]
    for k in range(work.tolerance.shape[1]):
        work.tolerance[ABSOLUTE, k] = row[ATOL + k]


@compiled
def change_order(work: RadauState, stages: int) -> None:
    """Take so many stages from here on."""
    if work.stages != stages:
        work.stages = stages
        work.factored_step = 0.0
        set_tolerances(work)
    work.steps_at_order = 0


@compiled
def raise_order(work: RadauState) -> None:
    """Take more stages after an accepted step where they pay."""
    work.steps_at_order += 1
    is_highest = method_index(work.stages) + 1 == work.tolerances.shape[0]
    if is_highest or work.steps_at_order < max(SETTLED, work.patience):
        return
    if work.convergence_rate <= FAST and work.last_rejected == 0:
        change_order(work, work.stages + 2)


@compiled
def lower_order(work: RadauState, again: int) -> bool:
    """Take fewer stages after a step that failed again, or soon after the order had risen."""
    if work.stages == FEWEST or (again == 0 and work.steps_at_order >= SETTLED):
        return False
    work.patience = min(2 * max(SETTLED, work.patience), MOST_PATIENT)
    change_order(work, work.stages - 2)
    return True
