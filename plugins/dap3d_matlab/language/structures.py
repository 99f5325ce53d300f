"""Structures of a MATLAB model (tables 3 to 16 of the manual): fields, defaults, files."""

import math

import attrs

#: A default: a number, a word, or a matrix by rows.
Default = float | str | tuple[tuple[float, ...], ...]

COLUMN3 = ((0.0,), (0.0,), (0.0,))
EYE3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
EMPTY: tuple[tuple[float, ...], ...] = ()


def _column(*numbers: float) -> tuple[tuple[float, ...], ...]:
    return tuple((x,) for x in numbers)


@attrs.frozen
class Structure:
    """A structure of the manual.

    Attributes:
        kind: its name without ``_struct``.
        fields: fields of a model, with the manual's defaults.
        computed: fields that the MATLAB program computes itself, whatever a model gives.
        ours: additional fields of this reader, with defaults; NaN: left to the type.
        slips: usual mistakes in names, and the correct field.
    """

    kind: str
    fields: dict[str, Default]
    computed: tuple[str, ...] = ()
    ours: dict[str, Default] = attrs.field(factory=dict)
    slips: dict[str, str] = attrs.field(factory=dict)

    @property
    def known(self) -> tuple[str, ...]:
        """All fields."""
        return (*self.fields, *self.ours, *self.computed)

    def default(self, field: str) -> Default:
        """The default of a field; empty for computed fields."""
        return self.fields.get(field, self.ours.get(field, EMPTY))


_BODY = Structure(
    "Body",
    {
        "mass": 1.0,
        "Jp": EYE3,
        "r": COLUMN3,
        "p": _column(1.0, 0.0, 0.0, 0.0),
        "A": EYE3,
        "r_dot": COLUMN3,
        "w": COLUMN3,
        "p_dot": _column(0.0, 0.0, 0.0, 0.0),
        "color": "k",
    },
    (
        *("r_dot2", "w_dot", "irc", "iru", "irv", "m_inv", "M", "M_inv", "J", "Jp_inv", "J_inv"),
        *("f", "n", "wp", "wp_dot", "pts"),
    ),
    slips={"m": "mass", "omega": "w", "I": "Jp", "inertia": "Jp", "v": "r_dot"},
)
_POINT = Structure(
    "Point",
    {"Bindex": 0.0, "sPp": COLUMN3},
    ("sP", "rP", "sP_dot", "rP_dot", "rP_dot2"),
    slips={"iBindex": "Bindex", "body": "Bindex", "sp": "sPp"},
)
_VECTOR1 = Structure(
    "Vector1",
    {"Bindex": 0.0, "sp": COLUMN3},
    ("s", "s_dot"),
    slips={"iBindex": "Bindex", "body": "Bindex", "sPp": "sp"},
)
_VECTOR2 = Structure(
    "Vector2", {"iPindex": 0.0, "jPindex": 0.0}, ("iBindex", "jBindex", "d", "d_dot")
)
_JOINT = Structure(
    "Joint",
    {
        "type": "sph",
        **dict.fromkeys(("iPindex", "jPindex", "iVindex_a", "iVindex_n", "jVindex_a"), 0.0),
        **dict.fromkeys(("jVindex_n", "jVindex_m", "V2index", "iBindex", "jBindex"), 0.0),
        "iFunct": 0.0,
        "disk": "xyz",
        "iDisk": 0.0,
        "el": 0.0,
        "R": 1.0,
        "Ac": EYE3,
        "mu": 0.0,
        "iQindex": 0.0,
    },
    ("nbody", "mrows", "rows", "rowe", "colis", "colie", "coljs", "colje", "lagrange"),
    slips={"iVindex": "iVindex_a", "jVindex": "jVindex_a", "radius": "R", "length": "el"},
)
_DISK = Structure(
    "Disk",
    {"iBindex": 1.0, "type": "xyz", "R": 1.0, "mu": 0.0},
    ("mrows", "sine", "eta", "t", "n", "s", "s_dot", "t_dot", "n_dot", "d_dot"),
    slips={"disk": "type", "Bindex": "iBindex", "radius": "R"},
)
_FORCE = Structure(
    "Force",
    {
        "type": "ptp",
        **dict.fromkeys(("iPindex", "jPindex", "iBindex", "jBindex"), 0.0),
        **dict.fromkeys(("iVindex", "jVindex", "kVindex", "V2index"), 0.0),
        "joint": 1.0,
        "mu": 0.5,
        **dict.fromkeys(("k", "el_0", "theta_0", "c", "f_a", "n_a"), 0.0),
        "gravity": 9.81,
        "wgt": _column(0.0, 0.0, -1.0),
        **dict.fromkeys(("fp", "np", "f", "n"), COLUMN3),
    },
    ours={"iFunct": 0.0, "v_tol": math.nan, "radius": math.nan},
    slips={"el": "el_0", "l0": "el_0", "g": "gravity", "Bindex": "iBindex"},
)
_FUNCT = Structure(
    "Funct",
    {
        "type": "a",
        "x_start": 0.0,
        "f_start": 0.0,
        "x_end": 1.0,
        "f_end": 1.0,
        "x_max": 0.0,
        "f_max": 0.0,
        "coeff": EMPTY,
        "fp_end": 0.0,
    },
    ("ncoeff",),
)

STRUCTURES = {s.kind: s for s in (_BODY, _POINT, _VECTOR1, _VECTOR2, _JOINT, _DISK, _FORCE, _FUNCT)}

#: Functions that make a structure: ``Body_struct``, and ``Body``, as the manual writes for disks.
MAKERS = {f"{kind}_struct": kind for kind in STRUCTURES} | {kind: kind for kind in STRUCTURES}


@attrs.frozen
class ModelFile:
    """A file of a model folder, and its array.

    Attributes:
        name: of the file.
        kind: of the structures in its array.
        arrays: names of the array; the manual writes two for the vectors of type 1.
        noun: a member of the array, for messages.
    """

    name: str
    kind: str
    arrays: tuple[str, ...]
    noun: str


FILES = (
    ModelFile("inBodies.m", "Body", ("Bodies",), "body"),
    ModelFile("inPoints.m", "Point", ("Points",), "point"),
    ModelFile("inVectors1.m", "Vector1", ("Vectors1", "Vectors"), "vector"),
    ModelFile("inVectors2.m", "Vector2", ("Vectors2",), "vector of type 2"),
    ModelFile("inJoints.m", "Joint", ("Joints",), "joint"),
    ModelFile("inForces.m", "Force", ("Forces",), "force"),
    ModelFile("inFuncts.m", "Funct", ("Functs",), "function"),
    ModelFile("inAnimate.m", "Point", ("Points_anim",), "animation point"),
)
#: The file that every model needs.
REQUIRED_FILE = "inBodies.m"
USER_FORCE_FILE = "user_force.m"
#: Array of disks, in the file of the joints, which name them by ``iDisk``.
DISKS = "Disks"
#: Limits of the drawing, in the file of the animation.
LIMITS = (("xmin", "xmax"), ("ymin", "ymax"), ("zmin", "zmax"))
