"""Fields of MATLAB structures and their fields in the scene, for each type of the manual."""

import attrs


@attrs.frozen
class Rule:
    """A field of a type.

    Attributes:
        field: in the MATLAB structure.
        scene: in the scene.
        how: number, vec3, table, matrix, word; or the array that an index refers to.
        needed: 0 (no member of the array), or no value, is a mistake.
        default: the default, for the report; "" where it is not reported.
    """

    field: str
    scene: str
    how: str
    needed: bool = False
    default: str = ""


def _numbers(**fields: str) -> tuple[Rule, ...]:
    """Numbers with a reported default: MATLAB field = "scene field: default"."""
    return tuple(
        Rule(field, scene, "number", default=default)
        for field, (scene, _, default) in ((f, w.partition(":")) for f, w in fields.items())
    )


P_I, P_J = Rule("iPindex", "P_i", "Points", True), Rule("jPindex", "P_j", "Points", True)
A_I, A_J = Rule("iVindex_a", "a_i", "Vectors1", True), Rule("jVindex_a", "a_j", "Vectors1", True)
N_J = Rule("jVindex_n", "n_j", "Vectors1", True)
#: Or two points, ``iPindex`` and ``jPindex``.
D = Rule("V2index", "d", "Vectors2", True)
BODY_I = Rule("iBindex", "body_i", "Bodies", True)
BODY_J = Rule("jBindex", "body_j", "Bodies", default="jBindex = 0, the ground")
#: A point in place of the body.
AT = Rule("iPindex", "P_i", "Points")
FUNCTION = Rule("iFunct", "function", "Functs")
LOCK = Rule("iFunct", "function", "Functs", default="iFunct = 0, no motion: a lock")
LENGTH = Rule("el", "length", "number", True)
LEVEL = Rule("el", "length", "number", default="el = 0")
A_C = Rule("Ac", "A_c", "matrix", default="Ac = eye(3)")
SLIP = Rule("disk", "slip", "word", default="disk = 'xyz'")
RADIUS = Rule("R", "radius", "number", default="R = 1")

JOINTS: dict[str, tuple[Rule, ...]] = {
    "sph": (P_I, P_J),
    "rev": (P_I, P_J, A_I, A_J),
    "sph-sph": (D, LENGTH),
    "cyl": (A_I, A_J, D),
    "tran": (A_J, D, A_C),
    "univ": (P_I, P_J, A_I, N_J),
    "rel-rot": (BODY_I, BODY_J, A_J, LOCK),
    "rel-tran": (BODY_I, BODY_J, A_J, LOCK),
    "rP": (BODY_I, AT, A_J, LEVEL, FUNCTION),
    "fix": (BODY_I,),
    "disk": (BODY_I, SLIP, RADIUS),
}
FORCES: dict[str, tuple[Rule, ...]] = {
    "weight": (
        Rule("gravity", "gravity", "number", default="gravity = 9.81"),
        Rule("wgt", "wgt", "vec3", default="wgt = [0;0;-1]"),
    ),
    "ptp": (
        D,
        *_numbers(k="k:k = 0", c="c:c = 0", el_0="l0:el_0 = 0", f_a="f_a:f_a = 0"),
        FUNCTION,
    ),
    "rot_sda": (
        Rule("iVindex", "v_i", "Vectors1", True),
        Rule("jVindex", "v_j", "Vectors1", True),
        Rule("kVindex", "axis", "Vectors1", True),
        *_numbers(k="k:k = 0", c="c:c = 0", theta_0="theta_0:theta_0 = 0", n_a="n_a:n_a = 0"),
        FUNCTION,
    ),
    "fp": (BODY_I, AT, Rule("fp", "fp", "vec3", default="fp = [0;0;0]")),
    "np": (BODY_I, Rule("np", "np", "vec3", default="np = [0;0;0]")),
    "f": (BODY_I, AT, Rule("f", "f", "vec3", default="f = [0;0;0]")),
    "n": (BODY_I, Rule("n", "n", "vec3", default="n = [0;0;0]")),
    "friction": (
        Rule("joint", "joint", "Joints", True, default="joint = 1"),
        Rule("mu", "mu", "number", default="mu = 0.5"),
        Rule("v_tol", "v_tol", "number"),
        Rule("radius", "radius", "number"),
    ),
    "user": (),
}
_SPAN = _numbers(
    x_start="x_start:x_start = 0", x_end="x_end:x_end = 1", f_start="f_start:f_start = 0"
)
_END = _numbers(f_end="f_end:f_end = 1")
FUNCTIONS: dict[str, tuple[Rule, ...]] = {
    "a": (Rule("coeff", "coeff", "vec3", True),),
    "b": (*_SPAN, *_END),
    "c": (
        *_SPAN,
        *_END,
        Rule("x_max", "x_max", "number", default="x_max = 0"),
        Rule("f_max", "f_max", "number", default="f_max = 0"),
    ),
    "d": (*_SPAN, Rule("fp_end", "fp_end", "number", default="fp_end = 0")),
}

#: Joints with a law of friction: with the radius of a pin, and without.
PIN_FRICTION, OTHER_FRICTION = ("rev", "sph", "cyl"), ("tran", "disk")
#: Two spellings of the manual.
DISK_ALIASES = {"zn": "nz", "zt": "tz"}
