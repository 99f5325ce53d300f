"""Problems with redundant rows and singular poses, made through the public API, with references."""

import numpy as np

import dap3d_core as dap
from support import mechanisms

G = 9.81


def four_bars(count):
    """IFToMM A02: ``count`` parallelograms in a row, every joint a spatial revolute.
    2 count + 1 rods of 1 m and 1 kg; cranks upright at the start, couplers level, vx(B0) = 1
    m/s."""
    scene = mechanisms.four_bar_row(count)
    for name, rod in scene.bodies.items():
        is_crank = name.startswith("crank")
        rod.r_dot = (0.5 if is_crank else 1.0, 0.0, 0.0)
        rod.w = (0.0, 0.0, -1.0 if is_crank else 0.0)
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    return scene


def bricard():
    """IFToMM A04: five rods on six revolutes, one freedom, 30 rows of which 29 are independent."""
    scene = mechanisms.bricard()
    for k, rod in enumerate(scene.bodies.values()):
        along = np.abs(scene.points[f"end{k}"].sPp) > 0.25
        rod.Jp = tuple(np.where(along, 1 / 600, 0.25 / 3 + 0.01 / 12))
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    return scene


def bennett(turn=1.1):
    """Three links of lengths 1, 2, 1 m on four revolutes, the fourth link is ground: one freedom.
    By Bennett's condition: sin(twist) over length is the same for all; opposite links are equal.
    Its closure gives the second angle: tan(turn / 2) tan(second / 2) is a number of the twists."""
    twists, lengths = (np.pi / 6, np.pi / 2), (1.0, 2.0)
    ratio = np.sin(0.5 * sum(twists)) / np.sin(0.5 * (twists[1] - twists[0]))
    second = 2.0 * np.arctan(ratio / np.tan(0.5 * turn))
    scene = dap.Scene(name="Bennett")
    place, frame = np.zeros(3), np.eye(3)
    for k, angle in enumerate((turn, second, -turn)):
        axis, twist, length = frame[:, 2], twists[k % 2], lengths[k % 2]
        frame = frame @ rotation(angle, "z")
        along, frame = frame[:, 0] * length, frame @ rotation(twist, "x")
        scene.add_body(f"link{k}", mass=1.0, Jp=(0.5, 0.5, 0.5), r=place + 0.5 * along)
        scene.add_point(f"start{k}", f"link{k}", -0.5 * along)
        scene.add_point(f"end{k}", f"link{k}", 0.5 * along)
        scene.add_vector(f"first{k}", f"link{k}", axis)
        scene.add_vector(f"second{k}", f"link{k}", frame[:, 2])
        place = place + along
    scene.add_point("last", "ground", place)
    scene.add_vector("last_axis", "ground", frame[:, 2])
    inner = [("ground.O", "ground.z"), ("end0", "second0"), ("end1", "second1")]
    outer = [(f"start{k}", f"first{k}") for k in range(3)]
    ends = zip([*outer, ("end2", "second2")], [*inner, ("last", "last_axis")], strict=True)
    for k, (i, j) in enumerate(ends):
        scene.add_joint("rev", f"J{k}", P_i=i[0], P_j=j[0], a_i=i[1], a_j=j[1])
    scene.add_force("weight", "gravity", wgt=(0.3, -1.0, 0.2))
    return scene


def rotation(angle, axis):
    """The matrix of a turn about x or z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]] if axis == "x" else
                    [[c, -s, 0], [s, c, 0], [0, 0, 1]])  # fmt: skip


def hinged_door(hinges=2):
    """A door on coaxial hinges (5 rows each, rank 5), its axis level, let go from level rest."""
    scene = dap.Scene(name=f"door on {hinges} hinges")
    scene.add_body("door", mass=12.0, Jp=(4.0, 1.0, 5.0), r=(0.0, -0.5, 0.0))
    for k, x in enumerate(np.linspace(-0.9, 0.9, hinges)):
        scene.add_point(f"hinge{k}", "door", (x, 0.5, 0.0))
        scene.add_point(f"post{k}", "ground", (x, 0.0, 0.0))
        scene.add_joint("rev", f"H{k}", P_i=f"hinge{k}", P_j=f"post{k}",
                        a_i="door.x", a_j="ground.x")  # fmt: skip
    scene.add_force("weight", "gravity", wgt=(0.0, 0.0, -1.0))
    return scene


def swing(rate, times, start):
    """phi(t), phi_dot(t) of phi'' = rate sin phi from ``start``, to some 1e-12 (scipy, DOP853)."""
    from scipy.integrate import solve_ivp

    found = solve_ivp(
        lambda t, y: (y[1], rate * np.sin(y[0])), (0.0, times[-1]), start, method="DOP853",
        t_eval=times, rtol=3e-14, atol=1e-14,
    )  # fmt: skip
    return found.y


def four_bars_tip(count, times):
    """(nt, 4) x, y, vx, vy of B0 (benchmarks.md, A02), from the closed equation of the cranks."""
    phi, rate = swing(1.5 * G * (3 * count + 1) / (4 * count + 1), times, (0.0, 1.0))
    s, c = np.sin(phi), np.cos(phi)
    return np.column_stack([s, c, c * rate, -s * rate])


def error_of(found, reference):
    """The error e of benchmarks.md, section 0, with y_thr = 1e-3; both (nt, components)."""
    size = np.maximum(np.abs(reference), 1e-3)
    return float(np.sqrt(np.mean(((found - reference) / size) ** 2)))


def driven_four_bar():
    """One parallelogram of A02 without its freedom: the first crank is turned at 1 rad/s."""
    scene = four_bars(1)
    scene.add_function("a", "turn", coeff=(0.0, 1.0, 0.0))
    scene.add_joint("drive-rot", "motor", body_i="crank0", body_j="ground", a_j="ground.z",
                    function="turn")  # fmt: skip
    return scene


def dead_centre_angle(t):
    """Angle of the crank of ``singular.dead_centre``, which goes through."""
    x = 3.0 - 0.5 * (1.0 - t) ** 2
    return np.sign(1.0 - t) * np.arccos(np.clip((x**2 - 3.0) / (2.0 * x), -1.0, 1.0))
