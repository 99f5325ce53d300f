"""``dap3d kinematics``: the motion that drivers prescribe, and the forces that it takes."""

from typing import Any

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command


@command(
    "Find the motion that drivers prescribe.",
    options.MODEL,
    options.output("Result file; MODEL-kinematics.nc in the current folder by default."),
    options.SETTING_OPTIONS["t_end"], options.SETTING_OPTIONS["dt"],
    click.option("--over", metavar="DRIVER.q=FROM:TO:COUNT",
                 help="A driver's coordinate in place of time: motor.q=0:6.28:200, in rad or m "
                      "from the poses as given; t of the result is the coordinate."),
    options.STRICT, options.FORCE, options.ALLOW_CODE, options.JSON, options.QUIET,
    saves=True,
)  # fmt: skip
@click.pass_context
def kinematics(
    ctx: click.Context,
    /,
    model: str,
    *,
    output: str | None,
    strict: bool,
    force: bool,
    allow_code: bool,
    **given: Any,
) -> int:
    """Find the motion of a MODEL whose drivers fix every freedom, and write it as a result.

    \b
    dap3d kinematics fourbar2 --t-end 1 --dt 0.01
    dap3d kinematics crank-press --over motor.q=0:6.283185:361

    Positions come from the constraints, without an error of integration; with them come
    velocities, accelerations, reactions and the forces of the drivers. Dead points and branch
    points are located; what was found before a dead point is saved.
    """
    import dap3d_core as dap
    from dap3d_core.cli.framework.execute import execute_scene, progress_of
    from dap3d_core.cli.framework.paths import result_target

    scene = dap.load(model)
    target = result_target(model, output, scene.path, force=force, tail="-kinematics")
    options.check_settings(scene, dict.fromkeys(options.SETTINGS) | given)
    return execute_scene(
        ctx, scene, model, target,
        lambda compiled, announce, watch: dap.kinematics(
            compiled, progress=progress_of(watch), allow_code=allow_code, announce=announce,
            output=target, force=force, **given,
        ),
        {"over": "--over", "t_end": "--t-end", "dt": "--dt"}, strict=strict, allow_code=allow_code,
    )  # fmt: skip
