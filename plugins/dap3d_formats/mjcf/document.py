"""An MJCF document: included files, settings of the compiler, default classes.

A class has one law of its actuators, that of its last element of them. An element has the law of
the nearest class that has one of its own name or of <general>; <general> that of its class,
whatever it is named. Laws are kept in the words of <general>.
"""

from collections.abc import Iterator, Mapping
from math import pi
from pathlib import Path
from typing import Any

import attrs

from dap3d_core.interface.formats import (
    UNBOUNDED,
    FormatError,
    Frame,
    Source,
    XmlElement,
    axis_angle,
    euler_angles,
)
from dap3d_formats.axes import along, cross, turn, unit

#: Elements that share the defaults of actuators.
ACTUATORS = (
    "general", "motor", "position", "velocity", "intvelocity", "damper", "cylinder", "muscle",
    "adhesion", "dcmotor", "orientation", "pid", "plugin",
)  # fmt: skip
#: Lists whose first numbers alone may be given: the others are those of the class.
LISTS = {"size", "friction", "gear", "stiffness", "damping", "gainprm", "biasprm", "dynprm"}
#: How an element is turned; one is given.
TURNS = {"quat", "axisangle", "euler", "xyaxes", "zaxis"}
#: Attribute -> the words that it may be, as of the compiler that reads no others.
WORDS = {
    **dict.fromkeys(("limited", "ctrllimited", "forcelimited", "actlimited", "actuatorfrclimited",
                     "inertiafromgeom"), ("auto", "true", "false")),
    **dict.fromkeys(("active", "autolimits", "balanceinertia", "mocap", "shellinertia",
                     "strippath"), ("true", "false")),
    "angle": ("radian", "degree"),
}  # fmt: skip
#: Words of a law.
LAW = ("gaintype", "gainprm", "biastype", "biasprm", "dyntype", "dynprm")
#: Numbers of a muscle as MJCF has them in gainprm, with their defaults.
MUSCLE = {"range": (0.75, 1.05), "force": (-1.0,), "scale": (200.0,), "lmin": (0.5,),
          "lmax": (1.6,), "vmax": (1.5,), "fpmax": (1.3,), "fvmax": (1.2,)}  # fmt: skip

Words = Mapping[str, str]
Parts = Iterator[tuple[str, tuple[object, ...]]]


@attrs.define(eq=False)
class Settings:
    """How a file says that its elements are read.

    Attributes:
        compiler: the <compiler>, of several with the attributes of the last.
        folder: where the names of its files start.
        defaults: class -> element -> attributes.
    """

    compiler: XmlElement
    folder: Path
    defaults: dict[str, dict[str, dict[str, str]]] = attrs.Factory(lambda: {"main": {}})

    @classmethod
    def of(cls, root: XmlElement, folder: Path) -> "Settings":
        """The settings of a file, with those of the files that it includes."""
        given: dict[str, str] = {}
        place = root.place
        for element in root.all("compiler"):
            given, place = given | element.attributes, element.place
        if given.get("coordinate", "local") != "local":
            raise FormatError('coordinate="global" is no longer a part of MJCF', place)
        settings = cls(XmlElement("compiler", given, place), folder)
        for element in root.all("default"):
            settings._read_defaults(element, "main", {})
        settings._name_main(root.all("default"))
        return settings

    def _name_main(self, outermost: list[XmlElement]) -> None:
        """Know the class of all elements by the name that it has in files for MuJoCo 2, too."""
        named = {element.get("class") or "main": element for element in outermost}
        named.pop("main", None)
        for name, element in named.items():
            if len(named) > 1:
                what = f"the outermost default classes {', '.join(named)} are one, main"
                raise FormatError(what, element.place, "put them into a <default>")
            self.defaults.setdefault(name, self.defaults["main"])

    def _read_defaults(
        self, element: XmlElement, name: str, inherited: dict[str, dict[str, str]]
    ) -> None:
        """Read a class and those below, which have its attributes too."""
        own = {tag: dict(values) for tag, values in inherited.items()}
        for tag, values in self.defaults.get(name, {}).items():
            own.setdefault(tag, {}).update(values)
        for child in element:
            if child.name != "default":
                _add_to_class(own, inherited, child)
        self.defaults[name] = own
        for child in element.all("default"):
            self._read_defaults(child, child.require("class"), own)


@attrs.define(eq=False)
class Document:
    """A file with its included and attached files, and their settings.

    Attributes:
        root: the root.
        settings: scope of elements -> the settings of their file; "" is this file.
    """

    source: Source
    root: XmlElement
    settings: dict[str, Settings]

    @classmethod
    def of(cls, source: Source, root: XmlElement, folder: Path) -> "Document":
        """The document of the root of a file in a folder.

        Raises:
            FormatError: it cannot be read.
        """
        if root.name not in ("mujoco", "mujocoinclude"):
            raise FormatError(f"an MJCF file is a <mujoco>, not a <{root.name}>", root.place)
        _include(source, root, folder)
        _require_words(root)
        for asset in (one for holder in root.all("asset") for one in holder):
            if "file" in asset.attributes and asset.name in ("mesh", "hfield"):
                asset.attributes.setdefault("name", Path(asset.attributes["file"]).stem)
        return cls(source, root, {"": Settings.of(root, folder)})

    def section(self, tag: str, name: str = "") -> list[XmlElement]:
        """The elements of all sections of a tag, or those of one name alone."""
        return [one for holder in self.root.all(tag) for one in holder if name in ("", one.name)]

    def settled(self, element: XmlElement, childclass: str) -> XmlElement:
        """An element with the attributes of its class.

        Args:
            element: the element.
            childclass: class of elements that name none.

        Raises:
            FormatError: there is no such class.
        """
        name, defaults = element.get("class") or childclass, self.settings[element.scope].defaults
        if name not in defaults:
            known = ", ".join(defaults)
            raise FormatError(f"there is no default class {name!r}; classes: {known}",
                              element.place)  # fmt: skip
        kind, values = _kind(element.name), defaults[name]
        given = _under(values.get(kind, {}), element.attributes)
        if kind == "actuator":
            given |= {"gaintype": "fixed", "biastype": "none", "dyntype": "none"}
            given |= _law_of(values, element)
        return attrs.evolve(element, attributes=given)

    def settled_equality(self, element: XmlElement) -> XmlElement:
        """An equality with the attributes of its class, which all equalities share."""
        name = element.get("class") or "main"
        values = self.settings[element.scope].defaults.get(name, {}).get("equality", {})
        return attrs.evolve(element, attributes=values | element.attributes)

    def compiler(self, element: XmlElement) -> XmlElement:
        """The settings of the compiler that an element is read by."""
        return self.settings[element.scope].compiler

    def angle(self, value: float, element: XmlElement) -> float:
        """An angle of an element in rad, as its compiler reads it."""
        radian = self.compiler(element).get("angle", "degree") == "radian"
        return value if radian else value * pi / 180.0

    def locate(self, asset: XmlElement, *, required: bool = False) -> Path | None:
        """The path of the file of an asset; None, with a remark, where there is none."""
        settings, name = self.settings[asset.scope], asset.require("file")
        if settings.compiler.get("strippath") == "true":
            name = Path(name.replace("\\", "/")).name
        below = settings.compiler.get("meshdir") or settings.compiler.get("assetdir") or ""
        if below and not name.startswith("/"):
            name = f"{below}/{name}"
        return self.source.locate(name, asset.place, settings.folder, required=required)

    def disables(self, *names: str) -> bool:
        """True if a flag of one of these names is off."""
        flags = self.section("option", "flag")
        return any(flag.get(name) == "disable" for flag in flags for name in names)

    def bounds(self, element: XmlElement, key: str, limited: str) -> tuple[float, float]:
        """Two bounds, infinite where they do not hold: attributes such as range and limited."""
        holds = element.get(limited, "auto")
        if holds == "auto" and key in element.attributes:
            holds = self.compiler(element).get("autolimits", "true")
        if holds == "true":
            low, high = element.numbers(key, 2, unbounded=True)
            if low > high:
                what = f"{key} of <{element.name}>: lower = {low:g} lies above upper = {high:g}"
                raise FormatError(what, element.place)
            return low, high
        return UNBOUNDED

    def frame(self, element: XmlElement) -> Frame:
        """The frame of an element: pos, with quat, axisangle, euler, xyaxes or zaxis.

        Raises:
            FormatError: numbers are missing, or the axes are no frame.
        """
        return Frame(element.numbers("pos", 3, (0.0, 0.0, 0.0)), self.rotation(element))

    def rotation(self, element: XmlElement) -> Any:
        """The rotation of an element."""
        given = element.attributes
        if "quat" in given:
            return turn(element.numbers("quat", 4), element)
        if "axisangle" in given:
            x, y, z, angle = element.numbers("axisangle", 4)
            return axis_angle(unit((x, y, z), element), self.angle(angle, element))
        if "euler" in given:
            return self.euler(element)
        if "xyaxes" in given:
            return _xyaxes(element)
        if "zaxis" in given:
            return along(unit(element.numbers("zaxis", 3), element))
        return Frame().A

    def euler(self, element: XmlElement, times: int = 1) -> Any:
        """The rotation by the Euler angles of an element, times a number."""
        angles = element.numbers("euler", 3, (0.0, 0.0, 0.0))
        sequence = self.compiler(element).attributes.get("eulerseq", "xyz")
        if len(sequence) != 3 or set(sequence) - set("xyzXYZ"):
            what = f"eulerseq = {sequence!r} should be three of x, y, z, X, Y, Z"
            raise FormatError(what, element.place)
        return euler_angles([times * self.angle(a, element) for a in angles], sequence)


def _include(source: Source, element: XmlElement, folder: Path) -> None:
    """Put what included files hold in their places, all over a tree."""
    children: list[XmlElement] = []
    for child in element:
        if child.name != "include":
            _include(source, child, folder)
            children.append(child)
            continue
        name = child.require("file")
        root = source.include(name, child.place, folder)
        with source.including(name, folder):
            _include(source, root, folder)
        children += root.children
    element.children = children


def _require_words(element: XmlElement) -> None:
    """Refuse words of attributes that mean nothing, all over a tree."""
    for key, word in element.attributes.items():
        allowed = ("enable", "disable") if element.name == "flag" else WORDS.get(key, (word,))
        if word not in allowed:
            what = f"{key} of <{element.name}> = {word!r} should be {' or '.join(allowed)}"
            raise FormatError(what, element.place)
    for child in element:
        _require_words(child)


def _xyaxes(element: XmlElement) -> Any:
    numbers = element.numbers("xyaxes", 6)
    x = unit(numbers[:3], element)
    dot = sum(a * b for a, b in zip(x, numbers[3:], strict=True))
    y = unit(tuple(b - dot * a for a, b in zip(x, numbers[3:], strict=True)), element)
    z = cross(x, y)
    return [[x[k], y[k], z[k]] for k in range(3)]


def _kind(tag: str) -> str:
    """The word by which a class knows an element."""
    return "actuator" if tag in ACTUATORS else tag


def _under(values: Words, own: Words) -> dict[str, str]:
    """Attributes of a class under those of an element, of which lists may be shorter."""
    turned = TURNS if TURNS & own.keys() else set()
    merged = {key: word for key, word in values.items() if key not in turned} | dict(own)
    for key in LISTS & values.keys() & own.keys():
        given = own[key].split()
        merged[key] = " ".join(given + values[key].split()[len(given) :])
    return merged


def _add_to_class(own: dict[str, dict[str, str]], outer: Mapping[str, Words], element: XmlElement
                 ) -> None:  # fmt: skip
    """Add an element of a default class to its attributes by kind.

    Args:
        own: attributes of the class so far, with those that it inherits.
        outer: those of the class around it.
        element: the element.
    """
    name, kind = element.name, _kind(element.name)
    given = {key: word for key, word in element.attributes.items() if key not in LAW}
    own[kind] = _under(own.get(kind, {}), given)
    if kind != "actuator":
        return
    law = _law_of(own, element)
    for tag in [tag for tag in own if tag.startswith("law ")]:
        del own[tag]
    if name == "general":
        own |= {"law general": law, "law ": law}
    else:
        own |= {tag: dict(words) for tag, words in outer.items() if tag.startswith("law ")}
        own |= {"law general": law, f"law {name}": law}


def _law_of(values: Mapping[str, Words], element: XmlElement) -> dict[str, str]:
    """The law of an actuator of a class, in the words of <general>.

    Raises:
        FormatError: numbers are missing, or two contradict each other.
    """
    base = values.get(f"law {element.name}", values.get("law ", {}))
    if element.name != "general" and base.get("gaintype", "fixed") not in ("fixed", element.name):
        base = {}  # of a class of <general> over a muscle
    above = XmlElement(element.name, dict(base), element.place)
    if element.name in ("general", "plugin"):
        return _under(base, {key: word for key, word in element.attributes.items() if key in LAW})
    if element.name not in _LAWS:
        return {"gaintype": element.name}
    return {key: " ".join(map(str, word)) for key, word in _LAWS[element.name](element, above)}


def _motor(element: XmlElement, base: XmlElement) -> Parts:
    yield "gainprm", (1.0,)


def _servo(element: XmlElement, base: XmlElement) -> Parts:
    """Gain kp, bias -kp q - kv q_dot; a positive third number is a damping ratio."""
    if {"kv", "dampratio"} <= element.attributes.keys():
        raise FormatError(f"<{element.name}> takes kv or dampratio, not both", element.place)
    kp = element.number("kp", base.numbers("gainprm", None, (1.0,))[0])
    rate = (*base.numbers("biasprm", None, (0.0,)), 0.0, 0.0)[2]
    if "kv" in element.attributes:
        rate = -element.number("kv")
    ratio = element.number("dampratio", 0.0)  # above 0, as the compiler stores it
    yield "gainprm", (kp,)
    yield "biastype", ("affine",)
    yield "biasprm", (0.0, -kp, ratio if ratio > 0.0 else rate)
    if element.name == "intvelocity":
        yield "dyntype", ("integrator",)
        return
    lag = base.numbers("dynprm", None, (1.0,))[0] if base.get("dyntype") == "filterexact" else 0.0
    lag = element.number("timeconst", lag)
    if lag > 0.0:
        yield "dyntype", ("filterexact",)
        yield "dynprm", (lag,)


def _velocity(element: XmlElement, base: XmlElement) -> Parts:
    kv = element.number("kv", base.numbers("gainprm", None, (1.0,))[0])
    yield "gainprm", (kv,)
    yield "biastype", ("affine",)
    yield "biasprm", (0.0, 0.0, -kv)


def _cylinder(element: XmlElement, base: XmlElement) -> Parts:
    area = element.number("area", base.numbers("gainprm", None, (1.0,))[0])
    if "diameter" in element.attributes:
        area = pi / 4.0 * element.number("diameter") ** 2
    yield "gainprm", (area,)
    yield "biastype", ("affine",)
    bias = (*base.numbers("biasprm", None, (0.0,)), 0.0, 0.0)[:3]
    yield "biasprm", element.numbers("bias", 3, bias)
    yield "dyntype", ("filter",)
    lag = base.numbers("dynprm", None, (1.0,))[0]
    yield "dynprm", (element.number("timeconst", lag),)


def _muscle(element: XmlElement, base: XmlElement) -> Parts:
    numbers = [x for usual in MUSCLE.values() for x in usual]
    times: tuple[float, ...] = (0.01, 0.04, 0.0)
    if base.get("gaintype") == "muscle":
        numbers = list(base.numbers("gainprm", None, tuple(numbers)))
        times = (*base.numbers("dynprm", None, times), 0.0, 0.0)[:3]
    at = 0
    for key, usual in MUSCLE.items():
        end = at + len(usual)
        numbers[at:end] = element.numbers(key, len(usual), tuple(numbers[at:end]))
        at = end
    yield "gainprm", tuple(numbers)
    yield "dynprm", (*element.numbers("timeconst", 2, times[:2]),
                     element.number("tausmooth", times[2]))  # fmt: skip
    yield from ((key, ("muscle",)) for key in ("gaintype", "biastype", "dyntype"))


_LAWS = {"motor": _motor, "position": _servo, "intvelocity": _servo, "velocity": _velocity,
         "cylinder": _cylinder, "muscle": _muscle}  # fmt: skip
