"""Detection of stiffness: small steps because of motions that have died away.

Two stages at the end of a step, f(g) and f(y1), give h |lambda| = h |f(y1) - f(g)| / |y1 - g| of
the component that dominates their difference (Hairer, Wanner, Solving Ordinary Differential
Equations II, IV.2, and their codes DOPRI5 and DOP853, which count steps like this, too). Their
measure alone, h |lambda| at the boundary of the region of stability, takes fast spins at loose
tolerances for stiff, and misses stiff scenes at tight ones. Here a step looks stiff where the
component decays, f(y1) - f(g) pointing against y1 - g, by more than half in a step: such a motion
is over after a few steps. Where it is still there after many, errors alone make it, and its error,
not that of the motion that is seen, limits the steps. Of an undamped oscillation rates dwarf
positions, so that the two are always nearly parallel, but it grows as often as it decays: a step in
which the component grows clears the scene.
"""

from dap3d_core.integrators.runge_kutta.state import RungeKuttaState
from dap3d_core.integrators.runge_kutta.sums import combine
from dap3d_core.integrators.stepping.integration_state import OTHER, TRIAL, Y
from dap3d_core.kernels.runtime.cache import compiled

#: Steps between two looks; every step once one looked stiff. A prime: friction whose sign changes
#: in each step falls into cycles of a few steps, of which some do not look stiff.
EVERY = 19
#: Steps that look stiff until the scene is called so, and steps in a row that clear it of it.
STIFF, CLEARED = 15, 6
#: h |lambda| from which a component that decays looks stiff; squared cosine from which it decays.
LEAST, PARALLEL = 0.5, 0.96


@compiled
def detect_stiffness(work: RungeKuttaState, h: float) -> None:
    """Set ``t_stiff`` when the scene has become stiff; f at the trial state is in ``k``.

    The trial state is that of the method, not yet projected.
    """
    late = work.stiffness_stage
    if late == 0 or work.t_stiff < work.t:
        return
    if work.stiff_steps == 0 and work.step_count % EVERY != 0:
        return
    other, trial = work.state[OTHER], work.state[TRIAL]
    combine(other, 1.0, work.state[Y], h, work.table, late, work.k)
    upper = lower = along = 0.0
    for i in range(work.error_size):
        change = h * (work.k[work.stage_count, i] - work.k[late, i])
        apart = trial[i] - other[i]
        upper += change * change
        lower += apart * apart
        along += change * apart
    marked = along * along > PARALLEL * upper * lower and upper > LEAST * LEAST * lower
    if marked and along > 0.0:
        work.stiff_steps = work.nonstiff_steps = 0
    elif marked:
        work.stiff_steps += 1
        work.nonstiff_steps = 0
        if work.stiff_steps >= STIFF:
            work.t_stiff = work.t
    elif work.stiff_steps > 0:
        work.nonstiff_steps += 1
        if work.nonstiff_steps >= CLEARED:
            work.stiff_steps = work.nonstiff_steps = 0
