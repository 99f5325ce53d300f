"""Numbers and bodies."""

from bad_input.case import PENDULUM, ROD, Case, changed, pushed, refused

MASS, JP, P = "mass = 1.0", "Jp = [0.1, 0.1, 0.05]", "p = [1.0, 0.0, 0.0, 0.0]"
W = "r = [0.5, 0.0, 0.0]"


def rod(old, new):
    return changed(ROD, (old, new))


HUGE = changed(
    PENDULUM, (MASS, "mass = 1e99"), ('type = "weight"', 'type = "weight"\ngravity = 1e9')
)
LIGHT = 'type = "f"\nbody_i = "rod"\nf = [1e90, 0, 0]'

CASES = [
    refused("nan", rod(W, "w = [nan, 0, 0]"), "bodies.rod.w", "entry 1", "finite", line="w ="),
    refused("inf", rod(W, "r = [0, -inf, 0]"), "bodies.rod.r", "entry 2", "-inf", line="r ="),
    refused("1e999", rod(JP, "Jp = [1e999, 1, 1]"), "bodies.rod.Jp", "finite", line="1e999"),
    refused("1e308 mass", rod(JP, "Jp = [1e300, 1e300, 1e300]"), "bodies.rod.Jp", "1e+100",
            "overflow", line="1e300"),
    refused("1e-320 denormal", rod(JP, "Jp = [1e-320, 1e-320, 1e-320]"), "bodies.rod.Jp", "1e-100",
            line="1e-320"),
    refused("1e-320 denormal", rod(MASS, "mass = 5e-324"), "bodies.rod.mass", "at least 1e-100",
            line="5e-324"),
    refused("text for a number", rod(W, 'w = ["0", 0, 0]'), "bodies.rod.w", "not text",
            "write 0 without quotes", line="w ="),
    refused("text for a number", rod(MASS, "mass = 1,5"), "", "not valid TOML", "decimal point",
            line="1,5"),
    refused("text for a number", rod(MASS, "mass = .5"), "", "digits on both sides", line=".5"),
    refused("text for a number", rod(MASS, "mass = NaN"), "", "finite numbers", line="NaN"),
    refused("text for a number", rod(MASS, "mass = heavy"), "", "in quotes", line="heavy"),
    refused("list of wrong length", rod(JP, "Jp = [0.1, 0.1, 0.1, 0, 0, 0]"), "bodies.rod.Jp",
            "3 numbers", "3x3", "it has 6", line="Jp"),
    refused("list of wrong length", rod(JP, "Jp = [[0.1, 0], [0, 0.1]]"), "bodies.rod.Jp",
            "three rows", "2 entries", line="Jp"),
    refused("ragged matrix", rod(JP, "Jp = [[1, 0, 0], [0, 1], [0, 0, 1]]"), "bodies.rod.Jp",
            "row 2", "it has 2", line="Jp"),
    refused("nested one level too deep", rod(JP, "Jp = [[[1], [0], [0]], [[0], [1], [0]], "
            "[[0], [0], [1]]]"), "bodies.rod.Jp", "row 1", "entry 1", "a list of 1", line="Jp"),
    refused("nested one level too deep", rod(P, "p = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]"),
            "bodies.rod.p", "4 numbers", "one row only", line="p ="),
    Case("degrees given as radians",
         pushed('type = "rot_sda"\nv_i = "rod.x"\nv_j = "ground.x"\naxis = "ground.y"\n'
                "k = 1.0\ntheta_0 = 90"), "noted",
         ("forces.F.theta_0 = 90", "more than a full turn", "rad")),
    # numbers that are good each
    Case("product overflows", HUGE, "failed",
         ("force g (type weight)", "beyond 1e+100", "t = 0 s")),
    Case("product overflows", pushed(LIGHT, (MASS, "mass = 1e-90"), base=ROD), "failed",
         ("acceleration of body rod", "beyond 1e+100", "t = 0 s")),
    Case("product overflows", rod(W, "w = [1e80, 1e80, 1e79]"), "failed",
         ("acceleration of body rod", "beyond 1e+100")),
    Case("product overflows", rod(W, "w = [1e99, 0, 0]"), "failed", ("body rod runs away",)),
    # bodies
    refused("mass 0, negative, nan", rod(MASS, "mass = -0.0"), "bodies.rod.mass", "greater than 0",
            "small mass", line="mass"),
    refused("inertia not symmetric", rod(JP, "Jp = [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]"),
            "bodies.rod.Jp", "symmetric", "(1, 2) is 0.1", line="Jp"),
    refused("inertia not positive", rod(JP, "Jp = [[1, 2, 0], [2, 1, 0], [0, 0, 1]]"),
            "bodies.rod.Jp", "positive definite", "-1", line="Jp"),
    refused("inertia breaks the triangle rule", rod(JP, "Jp = [0.1, 0.2, 0.3001]"),
            "bodies.rod.Jp", "sum of the other two", line="Jp"),
    Case("inertia breaks the triangle rule", rod(JP, "Jp = [0.1, 0.2, 0.30000000001]"), "allowed"),
    refused("inertia zero on one axis", rod(JP, "Jp = [0.1, 0.1, 0.0]"), "bodies.rod.Jp",
            "principal inertia is zero", "thin rod", "1e-6 of the largest", line="Jp"),
    refused("inertia zero on one axis", rod(JP, "Jp = [0.1, 0.1, 1e-15]"), "bodies.rod.Jp",
            "principal inertia is zero", line="Jp"),
    Case("inertia zero on one axis", rod(JP, "Jp = [0.1, 0.1, 1e-7]"), "allowed"),
    refused("inertia flat 9-list", rod(JP, "Jp = [1, 0, 0, 0, 1, 0, 0, 0, 1]"), "bodies.rod.Jp",
            "write three rows", line="Jp"),
    refused("quaternion zero", rod(P, "p = [1e-200, 0, 0, 0]"), "bodies.rod.p", "zero length",
            "not turned", line="p ="),
    refused("quaternion not unit", rod(P, "p = [1.00001, 0, 0, 0]"), "bodies.rod.p", "1.00001",
            "unit length", "write [1, 0, 0, 0]", line="p ="),
    Case("quaternion not unit", rod(P, "p = [1.0000001, 0, 0, 0]"), "noted",
         ("bodies.rod.p", "normalised")),
    refused("quaternion of 3 or 5 numbers", rod(P, "p = [90, 0, 0]"), "bodies.rod.p", "4 numbers",
            "it has 3", line="p ="),
    refused("two bodies with one name", f"{ROD}[bodies.rod]\nmass = 2.0\n", "", "not valid TOML",
            "twice", line="[bodies.rod]"),
    refused("reserved word as a name", changed(ROD, ("[bodies.rod]", "[bodies.Ground]\nmass = 1.0\n"
            "[bodies.rod]")), "bodies.Ground", "always there", "another name", line="Ground"),
    refused("reserved word as a name", changed(ROD, ("[bodies.rod]", '[bodies."ground "]\n'
            "[bodies.rod]")), 'bodies.ground ', "always there", line="ground "),
    refused("reserved word as a name", changed(ROD, ("[bodies.rod]", '[bodies."a "]\n'
            "[bodies.rod]")), 'bodies.a ', "ends with a space", line='"a "'),
    Case("body without joints or forces", changed(ROD, ('[forces.g]\ntype = "weight"\n', "")),
         "noted", ("bodies.rod: no joint and no force acts on it",)),
    refused("no bodies", "# nothing\n[simulation]\nt_end = 1.0\n", "bodies", "no bodies", line=""),
]  # fmt: skip
