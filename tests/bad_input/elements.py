"""Joints, drivers, functions and forces."""

from bad_input.case import DISK, PAIR, PENDULUM, Case, changed, driven, joined, pushed, refused

R = "r = [1.0, 0.0, 0.0]"
AT_ORIGIN = (R, "r = [0.0, 0.0, 0.0]")
LINK = 'type = "sph-sph"\nP_i = "a.O"\nP_j = "b.O"'
SPRING = 'type = "ptp"\nP_i = "a.O"\nP_j = "b.O"\nl0 = 0.5'
TORSION = 'type = "rot_sda"\nv_i = "{}"\nv_j = "ground.x"\naxis = "ground.y"\nk = 1.0'
RUB = 'type = "friction"\njoint = "hinge"\nradius = 0.01'
SLIDER = 'type = "tran"\nP_i = "a.O"\nP_j = "b.O"\na_j = "b.x"'
CROSS = 'type = "univ"\nP_i = "a.O"\nP_j = "b.O"\na_i = "a.x"\nn_j = "b.x"'
HINGE = 'type = "rev"\nP_i = "{}"\nP_j = "{}"\na_i = "axis"\na_j = "ground.y"'
TURN = 'type = "rel-rot"\nbody_i = "a"\nbody_j = "b"\na_j = "b.y"'
RATE = 'type = "a"\ncoeff = [0.0, 1.0, 0.0]'
ABOUT_X = 'type = "rel-rot"\na_j = "ground.x"'
FLAT = "r = [0, 0, 0.5]\np = [0.7071067811865476, 0.7071067811865476, 0, 0]"


def second(name, text, points=""):
    """The pendulum with one joint more."""
    return changed(PENDULUM, add=f"{points}[joints.{name}]\n{text}\n")


def point(name, place, body="ground"):
    return f'[points.{name}]\nbody = "{body}"\nsPp = {place}\n'


def step(words, type_="step"):
    return f'type = "{type_}"\n{words}'


CASES = [
    Case("axis not unit", changed(PENDULUM, ("sp = [0.0, 1.0, 0.0]", "sp = [0, 3, 0]")), "noted",
         ("vectors.axis.sp", "length 3", "normalised")),
    refused("spherical-spherical of no length", joined(LINK, AT_ORIGIN), "joints.J", "coincide",
            "other points", line="[joints.J]"),
    refused("spherical-spherical of no length", joined(LINK, (R, "r = [1e-14, 0, 0]")), "joints.J",
            "coincide at the start", "1e-14", "another place", line="[joints.J]"),
    Case("spherical-spherical of no length", joined(f"{LINK}\nlength = 1.0", AT_ORIGIN), "failed",
         ("cannot be assembled", "row 1 of J", "points coincide", "joints.J")),
    Case("translational with d = 0", joined(SLIDER, AT_ORIGIN), "allowed"),
    Case("universal with parallel axes", joined(CROSS, AT_ORIGIN), "failed",
         ("cannot be assembled", "row 4 of J", "axes are", "joints.J")),
    Case("redundant loop", second("two", HINGE.format("B", "C"),
         point("B", [-0.5, 1, 0], "rod") + point("C", [0, 1, 0])), "noted",
         ("5 of 10 constraint rows are redundant", "hinge, two")),
    Case("contradictory constraints", second("two", 'type = "sph"\nP_i = "A"\nP_j = "C"',
         point("C", [0, 0, 1])), "failed",
         ("cannot be assembled", "contradictory", "hinge", "two", "0.5", "joints.two")),
    Case("contradictory constraints", joined(f"{LINK}\nlength = 1000.0"), "failed",
         ("cannot be assembled", "nearer to an assembled pose")),
    Case("driver on a fixed coordinate", driven(RATE, ABOUT_X), "failed",
         ("hinge, driver contradict each other", "velocities disagree by 0.707")),
    Case("two drivers on one coordinate", changed(driven(RATE), add="[joints.stop]\n"
         'type = "drive-rot"\nbody_i = "rod"\na_j = "ground.y"\n'), "failed",
         ("driver, stop contradict each other", "disagree by 0.707")),
    Case("driver with no matching joint", joined(f'{TURN}\nfunction = "f"',
         add=f"[functions.f]\n{RATE}\n"), "told",
         ("joints.J: no other joint connects a and b",)),
    Case("driver value jumps at t = 0", driven('type = "a"\ncoeff = [0, 9, 0]').replace(
         "mass = 1.0", "mass = 1.0\nw = [0, 3, 0]"), "noted",
         ("initial velocities corrected",)),
    refused("x_end = x_start", driven(step("x_start = 1.0\nx_end = 1.0")), "functions.f",
            "x_end = 1 must lie beyond x_start = 1", line="[functions.f]"),
    refused("x_end = x_start", driven(step("x_start = 1.0\nx_end = 1.0", "b")), "functions.f",
            "beyond", line="[functions.f]"),
    refused("x_end = x_start", driven(step("x_start = 1.0\nx_end = 1.0", "d")), "functions.f",
            "beyond", line="[functions.f]"),
    refused("x_end = x_start", driven(step("x_end = 0.0\nx_max = 0.0\nf_max = 1", "c")),
            "functions.f", "between", line="[functions.f]"),
    refused("x_max outside", driven(step("x_max = 1.5\nf_max = 2.0", "c")), "functions.f",
            "x_max = 1.5", "between", line="[functions.f]"),
    refused("x_max outside", driven(step("x_max = 0.999999\nf_max = 2.0", "c")), "functions.f",
            "so near to an end", "nearer to the middle", line="[functions.f]"),
    Case("f_max inconsistent", driven(step("x_max = 0.2\nf_max = 0.5", "c")), "noted",
         ("function f (c)", "outside the range")),
    Case("discontinuous function", driven(step("x_start = 0.1\nx_end = 0.15")), "allowed"),
    Case("function aliases the step", driven('type = "harmonic"\nfrequency = 1e4\namplitude = 0.01',
         integrator='"rk4"', step=0.01), "noted",
         ("functions.f", "less than 4 steps of 0.01 s", "give a step")),
    Case("function aliases the step",
         driven('type = "harmonic"\nfrequency = 400\namplitude = 0.01'), "told",
         ("functions.f", "0.02 s apart", "aliasing")),
    Case("disk lying flat", changed(DISK, ("r = [0.0, 0.0, 0.5]", FLAT.replace("0.5]", "0]"))),
         "failed", ("joint contact (disk)", "lies down", "t = 0 s")),
    Case("disk whose axis is not eta", changed(DISK, ("Jp = [0.05, 0.1, 0.05]",
         "Jp = [0.05, 0.05, 0.1]")), "noted", ("joint contact (disk)", "y axis", "inertia")),
    Case("angle beyond 2 pi", driven('type = "a"\ncoeff = [100.0, 10.0, 0.0]',
         'type = "drive-rot"\na_j = "ground.y"'), "told", ("initial velocities corrected",)),
    Case("gimbal pose", changed(PENDULUM, ("p = [1.0, 0.0, 0.0, 0.0]",
         "p = [0.7071067811865476, 0.0, 0.7071067811865476, 0.0]"),
         ("r = [0.5, 0.0, 0.0]", "r = [0.0, 0.0, -0.5]")), "allowed"),
    Case("gimbal pose", changed(PENDULUM, ("t_end = 0.2", "t_end = 0.6"),
         add='[joints.driver]\ntype = "drive-rot"\nbody_i = "rod"\na_j = "ground.z"\n'), "failed",
         ("the run stopped at t = 0.49", "a row of joint driver has grown to")),
    # forces
    refused("spring of zero length at start", pushed(f"{SPRING}\nk = 9", AT_ORIGIN, base=PAIR),
            "forces.F", "coincide at the start", "direction", line="[forces.F]"),
    refused("spring of zero length at start", pushed(f"{SPRING}\nc = 9", (R, "r = [1e-14, 0, 0]"),
            base=PAIR), "forces.F", "coincide", "1e-14", line="[forces.F]"),
    Case("k or c negative", pushed(f"{SPRING}\nk = -9", base=PAIR), "noted",
         ("forces.F.k = -9", "less than 0")),
    Case("k or c negative", pushed(f"{SPRING}\nc = -0.5", base=PAIR), "noted",
         ("forces.F.c = -0.5", "less than 0")),
    Case("k or c negative", pushed(TORSION.format("rod.x").replace("1.0", "-1.0")), "noted",
         ("forces.F.k = -1.0", "less than 0")),
    Case("k of 1e18", pushed(f"{SPRING.replace('0.5', '1.0')}\nk = 1e18", base=PAIR), "allowed"),
    refused("angle along its axis", pushed(TORSION.format("axis")), "forces.F",
            "v_i and axis are parallel at the start", "take a vector across axis",
            line="[forces.F]"),
    Case("direction of weight", changed(PENDULUM, ('type = "weight"',
         'type = "weight"\nwgt = [0, 0, -2]')), "noted", ("forces.g.wgt", "length 2, not 1")),
    Case("direction of weight", changed(PENDULUM, ('type = "weight"',
         'type = "weight"\nwgt = [0, 0, 0]')), "noted", ("forces.g.wgt", "no effect")),
    Case("direction of weight", changed(PENDULUM, ('type = "weight"',
         'type = "weight"\ngravity = -9.81')), "noted", ("forces.g.gravity", "less than 0")),
    Case("friction mu < 0 or > 10", pushed(f"{RUB}\nmu = 11"), "noted",
         ("forces.F.mu = 11", "more than 10")),
]  # fmt: skip
