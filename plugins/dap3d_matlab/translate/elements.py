"""Translates joints, forces and functions."""

from typing import Any

import attrs

from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene import Scene
from dap3d_core.scene.tables import Element
from dap3d_matlab.files.report import remark
from dap3d_matlab.language.structures import DISKS
from dap3d_matlab.language.values import GivenValue, Struct
from dap3d_matlab.translate.field_rules import (
    AT,
    BODY_I,
    DISK_ALIASES,
    FORCES,
    FUNCTIONS,
    JOINTS,
    N_J,
    OTHER_FRICTION,
    P_I,
    P_J,
    PIN_FRICTION,
    D,
    Rule,
)
from dap3d_matlab.translate.fields import GROUND, Fields, name_of

#: Fields of bodies, implied by points and vectors of a type.
_BODY_FIELDS = {"iBindex": "i", "jBindex": "j"}
#: Field of a disk -> field of its joint.
_OF_DISK = {"iBindex": "iBindex", "type": "disk", "R": "R", "mu": "mu"}


def add_functions(scene: Scene, fields: Fields) -> None:
    """Add the functions, in the order of their array."""
    for k, struct in enumerate(fields.model.arrays["Functs"] or [], 1):
        _add(scene.functions, "Functs", k, struct, FUNCTIONS, fields)


def add_joints(scene: Scene, fields: Fields) -> None:
    """Add the joints, in the order of their array; their friction becomes forces."""
    for k, struct in enumerate(fields.model.arrays["Joints"] or [], 1):
        joint = _with_disk(struct, fields)
        element = _add(scene.joints, "Joints", k, joint, JOINTS, fields)
        if element is not None:
            _add_friction(scene, joint, element, fields)


def add_forces(scene: Scene, fields: Fields) -> None:
    """Add the forces, in the order of their array, before those of the friction of joints."""
    frictions = scene.forces
    scene.forces = {}
    for k, struct in enumerate(fields.model.arrays["Forces"] or [], 1):
        element = _add(scene.forces, "Forces", k, struct, FORCES, fields)
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
    types: dict[str, tuple[Rule, ...]],
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

    def read(self, rule: Rule) -> None:
        """Read one field."""
        if rule is D:
            self._ends()
            return
        if rule is BODY_I and self._has_point():
            return
        if rule is N_J and not self.fields.differs(self.struct, N_J.field):
            rule = attrs.evolve(rule, field="jVindex_a")  # the manual gives the arm there
        value = self._value(rule)
        if value is None:
            return
        self.values[rule.scene] = value
        self.fields.placed(f"{self.key}.{rule.scene}", self.struct, rule.field)
        self._note_body(rule, value)

    def _value(self, rule: Rule) -> Any:
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
            if word in DISK_ALIASES:
                fields.changed(struct, rule.field, f"= {word} is {DISK_ALIASES[word]}")
            return DISK_ALIASES.get(word or "", word)
        if rule.how == "matrix":
            return fields.matrix(struct, rule.field)
        if rule.how == "vec3":
            return fields.vector(struct, rule.field)
        return fields.number(struct, rule.field)

    def _has_point(self) -> bool:
        """True if a point is given in place of the body."""
        struct = self.struct
        types = {**JOINTS, **FORCES}[str(struct.value("type"))]
        return AT in types and self.fields.differs(struct, AT.field)

    def _ends(self) -> None:
        """A vector of type 2, or the two points between which it runs."""
        struct, fields = self.struct, self.fields
        self.used |= {D.field, P_I.field, P_J.field}
        both = [r for r in (P_I, P_J) if fields.differs(struct, r.field)]
        if fields.differs(struct, D.field) or len(both) < 2:
            name = fields.reference(struct, D.field, D.how, needed=True)
            if name is None:
                return
            self.values[D.scene] = name
            fields.placed(f"{self.key}.{D.scene}", struct, D.field)
            vectors = fields.model.arrays["Vectors2"]
            if vectors is None:
                return
            vector = vectors[int(name[1:]) - 1]
            for rule in (P_I, P_J):
                point = fields.reference(vector, rule.field, rule.how, needed=False)
                self._note_body(rule, point)
                if rule in both and fields.reference(struct, rule.field, rule.how, needed=True) != (
                    point
                ):
                    what = f"is another point than that of vector {name[1:]}, {D.field}"
                    fields.refuse(struct, rule.field, what, "leave it out")
            return
        for rule in both:
            self.read(rule)

    # ---------------------------------------------------------------- bodies, unused fields

    def _note_body(self, rule: Rule, value: Any) -> None:
        """Record the body of a slot, as a point or a vector gives it."""
        slot = rule.scene[-1]
        array = self.fields.model.arrays.get(rule.how)
        if rule.how not in ("Points", "Vectors1") or slot not in "ij" or not array or not value:
            return
        number = array[int(str(value)[1:]) - 1].value("Bindex")
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
            elif fields.differs(struct, field) and not (field == "R" and word in PIN_FRICTION):
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
    if element.type not in (*PIN_FRICTION, *OTHER_FRICTION):
        what = f"there is no law of friction for a joint of type {element.type}"
        fields.refuse(struct, "mu", what, "leave it out; the MATLAB program does not use it")
        return
    name = f"friction_{element.name}"
    force = Element(name, "friction", {"joint": element.name, "mu": mu})
    if element.type in PIN_FRICTION:
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
    if joint not in scene.joints or not joints or scene.joints[joint].type not in PIN_FRICTION:
        return
    source = joints[int(joint[1:]) - 1]
    element.fields["radius"] = fields.number(source, "R")
    default = "" if "R" in source.given else ", which is the default"
    text = f"{struct.variable}: radius = R of {joint}{default}"
    fields.report.defaulted.append(remark(struct.place, text))
