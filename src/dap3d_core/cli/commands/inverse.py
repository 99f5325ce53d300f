"""``dap3d inverse``: the forces of actuators that produce a motion."""

from typing import Any

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command


@command(
    "Find the forces that produce a motion.",
    options.MODEL,
    click.argument("motion", type=click.Path()),
    click.option("--actuators", metavar="NAME,...",
                 help="Drivers, and force elements such as ptp, whose forces are found; all "
                      "drivers by default."),
    options.output("Result file; MODEL-inverse.nc in the current folder by default."),
    options.STRICT, options.FORCE, options.ALLOW_CODE, options.JSON, options.QUIET,
    saves=True,
)  # fmt: skip
@click.pass_context
def inverse(
    ctx: click.Context,
    /,
    model: str,
    motion: str,
    *,
    actuators: str | None,
    output: str | None,
    strict: bool,
    force: bool,
    allow_code: bool,
) -> int:
    """Find the forces of actuators that produce a MOTION of a MODEL, and write them as a result.

    \b
    dap3d inverse hexapod motion.csv --actuators leg1,leg2,leg3,leg4,leg5,leg6
    dap3d inverse fourbar2 run.nc

    MOTION is a result file, or a CSV file with a header: a column t in s, and columns of positions
    under the names of their quantities, such as platform.r.x or tip.r.z. What is found for each
    actuator is its quantity actuation: dap3d plot RESULT leg1.actuation.
    """
    import dap3d_core as dap
    from dap3d_core.cli.framework.execute import execute_scene, progress_of
    from dap3d_core.cli.framework.paths import result_target

    scene = dap.load(model)
    target = result_target(model, output, scene.path, force=force, tail="-inverse")
    given: Any = dap.open(motion) if motion.endswith(".nc") else motion
    names = None if actuators is None else [n.strip() for n in actuators.split(",") if n.strip()]
    return execute_scene(
        ctx, scene, model, target,
        lambda compiled, announce, watch: dap.inverse(
            compiled, given, names, progress=progress_of(watch), output=target, force=force
        ),
        {"actuators": "--actuators", "motion": "MOTION"}, strict=strict, allow_code=allow_code,
    )  # fmt: skip
