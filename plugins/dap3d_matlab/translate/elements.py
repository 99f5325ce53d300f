"""Translates joints, forces and functions."""

from typing import Any

import attrs

from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene import Scene
from dap3d_core.scene.tables import Element
from dap3d_matlab.files.report import remark
from dap3d_matlab.language.structures import DISKS
from dap3d_matlab.language.values import GivenValue, Struct
from dap3d_matlab.translate.fields import GROUND, Fields, name_of

#: Fields of bodies, implied by points and vectors of a type.
_BODY_FIELDS = {"iBindex": "i", "jBindex": "j"}
#: Field of a disk -> field of its joint.
_OF_DISK = {"iBindex": "iBindex", "type": "disk", "R": "R", "mu": "mu"}


@attrs.frozen
class _Rule:
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


def _numbers(**fields: str) -> tuple[_Rule, ...]:
    """Numbers with a reported default: MATLAB field = "scene field: default"."""
    return tuple(
        _Rule(field, scene, "number", default=default)
        for field, (scene, _, default) in ((f, w.partition(":")) for f, w in fields.items())
    )


_P_I, _P_J = _Rule("iPindex", "P_i", "Points", True), _Rule("jPindex", "P_j", "Points", True)
_A_I, _A_J = (
    _Rule("iVindex_a", "a_i", "Vectors1", True),
    _Rule("jVindex_a", "a_j", "Vectors1", True),
)
_N_J = _Rule("jVindex_n", "n_j", "Vectors1", True)
#: Or two points, ``iPindex`` and ``jPindex``.
_D = _Rule("V2index", "d", "Vectors2", True)
_BODY_I = _Rule("iBindex", "body_i", "Bodies", True)
_BODY_J = _Rule("jBindex", "body_j", "Bodies", default="jBindex = 0, the ground")
#: A point in place of the body.
_AT = _Rule("iPindex", "P_i", "Points")
_FUNCTION = _Rule("iFunct", "function", "Functs")
_LOCK = _Rule("iFunct", "function", "Functs", default="iFunct = 0, no motion: a lock")
_LENGTH = _Rule("el", "length", "number", True)
_LEVEL = _Rule("el", "length", "number", default="el = 0")
_A_C = _Rule("Ac", "A_c", "matrix", default="Ac = eye(3)")
_SLIP = _Rule("disk", "slip", "word", default="disk = 'xyz'")
_RADIUS = _Rule("R", "radius", "number", default="R = 1")

_JOINTS: dict[str, tuple[_Rule, ...]] = {
    "sph": (_P_I, _P_J),
    "rev": (_P_I, _P_J, _A_I, _A_J),
    "sph-sph": (_D, _LENGTH),
    "cyl": (_A_I, _A_J, _D),
    "tran": (_A_J, _D, _A_C),
    "univ": (_P_I, _P_J, _A_I, _N_J),
    "rel-rot": (_BODY_I, _BODY_J, _A_J, _LOCK),
    "rel-tran": (_BODY_I, _BODY_J, _A_J, _LOCK),
    "rP": (_BODY_I, _AT, _A_J, _LEVEL, _FUNCTION),
    "fix": (_BODY_I,),
    "disk": (_BODY_I, _SLIP, _RADIUS),
}
_FORCES: dict[str, tuple[_Rule, ...]] = {
    "weight": (
        _Rule("gravity", "gravity", "number", default="gravity = 9.81"),
        _Rule("wgt", "wgt", "vec3", default="wgt = [0;0;-1]"),
    ),
    "ptp": (
        _D,
        *_numbers(k="k:k = 0", c="c:c = 0", el_0="l0:el_0 = 0", f_a="f_a:f_a = 0"),
        _FUNCTION,
    ),
    "rot_sda": (
        _Rule("iVindex", "v_i", "Vectors1", True),
        _Rule("jVindex", "v_j", "Vectors1", True),
        _Rule("kVindex", "axis", "Vectors1", True),
        *_numbers(k="k:k = 0", c="c:c = 0", theta_0="theta_0:theta_0 = 0", n_a="n_a:n_a = 0"),
        _FUNCTION,
    ),
    "fp": (_BODY_I, _AT, _Rule("fp", "fp", "vec3", default="fp = [0;0;0]")),
    "np": (_BODY_I, _Rule("np", "np", "vec3", default="np = [0;0;0]")),
    "f": (_BODY_I, _AT, _Rule("f", "f", "vec3", default="f = [0;0;0]")),
    "n": (_BODY_I, _Rule("n", "n", "vec3", default="n = [0;0;0]")),
    "friction": (
        _Rule("joint", "joint", "Joints", True, default="joint = 1"),
        _Rule("mu", "mu", "number", default="mu = 0.5"),
        _Rule("v_tol", "v_tol", "number"),
        _Rule("radius", "radius", "number"),
    ),
    "user": (),
}
_SPAN = _numbers(
    x_start="x_start:x_start = 0",
    x_end="x_end:x_end = 1",
    f_start="f_start:f_start = 0",
)
_END = _numbers(f_end="f_end:f_end = 1")
_FUNCTIONS: dict[str, tuple[_Rule, ...]] = {
    "a": (_Rule("coeff", "coeff", "vec3", True),),
    "b": (*_SPAN, *_END),
    "c": (
        *_SPAN,
        *_END,
        _Rule("x_max", "x_max", "number", default="x_max = 0"),
        _Rule("f_max", "f_max", "number", default="f_max = 0"),
    ),
    "d": (*_SPAN, _Rule("fp_end", "fp_end", "number", default="fp_end = 0")),
}

#: Joints with a law of friction: with the radius of a pin, and without.
_PIN_FRICTION, _OTHER_FRICTION = ("rev", "sph", "cyl"), ("tran", "disk")
#: Two spellings of the manual.
_DISK_ALIASES = {"zn": "nz", "zt": "tz"}


def add_functions(scene: Scene, fields: Fields) -> None:
    """Add the functions, in the order of their array."""
    for k, struct in enumerate(fields.model.arrays["Functs"] or [], 1):
        _add(scene.functions, "Functs", k, struct, _FUNCTIONS, fields)


def add_joints(scene: Scene, fields: Fields) -> None:
    """Add the joints, in the order of their array; their friction becomes forces."""
    for k, struct in enumerate(fields.model.arrays["Joints"] or [], 1):
        joint = _with_disk(struct, fields)
        element = _add(scene.joints, "Joints", k, joint, _JOINTS, fields)
        if element is not None:
            _add_friction(scene, joint, element, fields)


def add_forces(scene: Scene, fields: Fields) -> None:
    """Add the forces, in the order of their array, before those of the friction of joints."""
    frictions = scene.forces
    scene.forces = {}
    for k, struct in enumerate(fields.model.arrays["Forces"] or [], 1):
        element = _add(scene.forces, "Forces", k, struct, _FORCES, fields)
        if element is None or element.type != "friction":
            continue
        joint = str(element.fields.get("joint", ""))
        if f"friction_{joint}" in frictions:
            what = "the joint has a mu of its own; friction is given once"
            fields.refuse(struct, "joint", what, "leave out one of the two")
        if "radius" not in element.fields:
            _take_radius(scene, element, joint, struct, fields)
    scene.forces.update(frictions)


def _add(
    table: dict[str, Element],
    array: str,
    number: int,
    struct: Struct,
    types: dict[str, tuple[_Rule, ...]],
    fields: Fields,
) -> Element | None:
    """Add the element of a structure; None where its type is unknown, which is reported."""
    word = fields.word(struct, "type")
    if word is None or word not in types:
        if word is not None:
            what = f"should be one of {', '.join(types)}"
            fields.refuse(struct, "type", what, nearest=nearest(word, types))
        return None
    name = name_of(array, number)
    where = {"Joints": "joints", "Forces": "forces", "Functs": "functions"}[array]
    values = _Values(struct, f"{where}.{name}", fields)
    for rule in types[word]:
        values.read(rule)
    values.report(word)
    fields.placed(f"{where}.{name}", struct)
    fields.placed(f"{where}.{name}.type", struct, "type")
    table[name] = Element(name, word, values.values)
    return table[name]


@attrs.define
class _Values:
    """The fields of one element, read rule by rule."""

    struct: Struct
    key: str
    fields: Fields
    values: dict[str, Any] = attrs.field(factory=dict)
    used: set[str] = attrs.field(factory=lambda: {"type"})
    bodies: dict[str, tuple[str, str]] = attrs.field(factory=dict)  # slot -> body, field
    defaults: list[str] = attrs.field(factory=list)

    def read(self, rule: _Rule) -> None:
        """Read one field."""
        if rule is _D:
            self._ends()
            return
        if rule is _BODY_I and self._has_point():
            return
        if rule is _N_J and not self.fields.differs(self.struct, _N_J.field):
            rule = attrs.evolve(rule, field="jVindex_a")  # the manual gives the arm there
        value = self._value(rule)
        if value is None:
            return
        self.values[rule.scene] = value
        self.fields.placed(f"{self.key}.{rule.scene}", self.struct, rule.field)
        self._note_body(rule, value)

    def _value(self, rule: _Rule) -> Any:
        struct, fields = self.struct, self.fields
        self.used.add(rule.field)
        is_given = rule.field in struct.given
        if rule.default and not is_given:
            self.defaults.append(rule.default)
        if rule.how == "Bodies" and not rule.needed:
            return fields.body(struct, rule.field)
        if rule.how in ("Points", "Vectors1", "Vectors2", "Functs", "Joints", "Bodies"):
            return fields.reference(struct, rule.field, rule.how, needed=rule.needed)
        if rule.needed and not is_given:
            fields.refuse(struct, rule.field, f"is required by the type {struct.value('type')}")
            return None
        if not is_given and rule.field in struct.structure.ours:
            return None  # left to the type
        if rule.how == "word":
            word = fields.word(struct, rule.field)
            if word in _DISK_ALIASES:
                fields.changed(struct, rule.field, f"= {word} is {_DISK_ALIASES[word]}")
            return _DISK_ALIASES.get(word or "", word)
        if rule.how == "matrix":
            return fields.matrix(struct, rule.field)
        if rule.how == "vec3":
            return fields.vector(struct, rule.field)
        return fields.number(struct, rule.field)

    def _has_point(self) -> bool:
        """True if a point is given in place of the body."""
        struct = self.struct
        types = {**_JOINTS, **_FORCES}[str(struct.value("type"))]
        return _AT in types and self.fields.differs(struct, _AT.field)

    def _ends(self) -> None:
        """A vector of type 2, or the two points between which it runs."""
        struct, fields = self.struct, self.fields
        self.used |= {_D.field, _P_I.field, _P_J.field}
        both = [r for r in (_P_I, _P_J) if fields.differs(struct, r.field)]
        if fields.differs(struct, _D.field) or len(both) < 2:
            name = fields.reference(struct, _D.field, _D.how, needed=True)
            if name is None:
                return
            self.values[_D.scene] = name
            fields.placed(f"{self.key}.{_D.scene}", struct, _D.field)
            vectors = fields.model.arrays["Vectors2"]
            if vectors is None:
                return
            vector = vectors[int(name[1:]) - 1]
            for rule in (_P_I, _P_J):
                point = fields.reference(vector, rule.field, rule.how, needed=False)
                self._note_body(rule, point)
                if rule in both and fields.reference(struct, rule.field, rule.how, needed=True) != (
                    point
                ):
                    what = f"is another point than that of vector {name[1:]}, {_D.field}"
                    fields.refuse(struct, rule.field, what, "leave it out")
            return
        for rule in both:
            self.read(rule)

    # ---------------------------------------------------------------- bodies, unused fields

    def _note_body(self, rule: _Rule, value: Any) -> None:
        """Record the body of a slot, as a point or a vector gives it."""
        slot = rule.scene[-1]
        array = self.fields.model.arrays.get(rule.how)
        if rule.how not in ("Points", "Vectors1") or slot not in "ij" or not array or not value:
            return
        member = array[int(str(value)[1:]) - 1]
        number = member.value("Bindex")
        if getattr(number, "size", 0) == 1:
            self.bodies.setdefault(slot, (f"{number[0, 0]:g}", rule.field))

    def report(self, word: str) -> None:
        """Say what was defaulted, and what the structure gives that its type does not take."""
        struct, fields = self.struct, self.fields
        if "type" not in struct.given:
            self.defaults.insert(0, f"type = '{word}'")
        if self.defaults:
            fields.defaulted(struct, ", ".join(self.defaults))
        for field in struct.given:
            if field in self.used or field in ("mu", "iDisk"):
                continue
            if field in struct.structure.computed:
                fields.left_out(struct, field, "is worked out by the program: not read")
            elif field in _BODY_FIELDS:
                self._same_body(field)
            elif fields.differs(struct, field) and not (field == "R" and word in _PIN_FRICTION):
                fields.left_out(struct, field, f"has no meaning for the type {word}: not read")

    def _same_body(self, field: str) -> None:
        """A body that is given although points or vectors say which it is: they must agree."""
        struct, fields = self.struct, self.fields
        number = fields.index(struct, field, "Bodies")
        told = self.bodies.get(_BODY_FIELDS[field])
        if number is None or told is None or not fields.differs(struct, field):
            return
        if told[0] != str(number):
            body = GROUND if told[0] == "0" else f"body {told[0]}"
            fields.refuse(struct, field, f"is another body than that of {told[1]}, {body}")


# ---------------------------------------------------------------- disks and friction


def _with_disk(struct: Struct, fields: Fields) -> Struct:
    """A joint with the fields of the disk that it names by ``iDisk``; other joints unchanged."""
    if not fields.differs(struct, "iDisk"):
        return struct
    if struct.value("type") != "disk":
        fields.refuse(struct, "iDisk", "only a joint of type disk names a disk")
        return struct
    number = fields.index(struct, "iDisk", DISKS)
    disks = fields.model.arrays.get(DISKS, [])
    if not number or not disks:
        return struct
    disk, joint = disks[number - 1], struct.copy()
    for field, meant in _OF_DISK.items():
        if meant in struct.given and field in disk.given:
            if repr(struct.value(meant)) != repr(disk.value(field)):
                what = f"is another value than that of disk {number}"
                fields.refuse(struct, meant, what, "leave it out")
        elif meant not in struct.given:
            joint.given[meant] = GivenValue(disk.value(field), disk.place_of(field))
            if field not in disk.given and field != "mu":
                default = {"iBindex": "1", "type": "'xyz'", "R": "1"}[field]
                fields.defaulted(disk, f"{field} = {default}")
    fields.changed(struct, "iDisk", f"names {disk.variable}: its fields became the joint's")
    return joint


def _add_friction(scene: Scene, struct: Struct, element: Element, fields: Fields) -> None:
    """Add the friction of a joint as a force."""
    mu = fields.number(struct, "mu") if "mu" in struct.given else 0.0
    if not mu:
        return
    if element.type not in (*_PIN_FRICTION, *_OTHER_FRICTION):
        what = f"there is no law of friction for a joint of type {element.type}"
        fields.refuse(struct, "mu", what, "leave it out; the MATLAB program does not use it")
        return
    name = f"friction_{element.name}"
    force = Element(name, "friction", {"joint": element.name, "mu": mu})
    if element.type in _PIN_FRICTION:
        force.fields["radius"] = fields.number(struct, "R")
        if "R" not in struct.given:
            fields.defaulted(struct, "R = 1, the radius of its friction")
    scene.forces[name] = force
    fields.placed(f"forces.{name}", struct, "mu")
    words = f"became the force {name}: the manual lists the field, the law is that of dap3d"
    fields.changed(struct, "mu", words)


def _take_radius(
    scene: Scene, element: Element, joint: str, struct: Struct, fields: Fields
) -> None:
    """Give a friction force without a radius that of its joint."""
    joints = fields.model.arrays["Joints"]
    if joint not in scene.joints or not joints or scene.joints[joint].type not in _PIN_FRICTION:
        return
    source = joints[int(joint[1:]) - 1]
    element.fields["radius"] = fields.number(source, "R")
    default = "" if "R" in source.given else ", which is the default"
    text = f"{struct.variable}: radius = R of {joint}{default}"
    fields.report.defaulted.append(remark(struct.place, text))
