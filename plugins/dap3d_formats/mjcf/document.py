"""An MJCF document: included files, settings of the compiler, default classes."""

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
    from_quaternion,
)
from dap3d_formats.axes import along, unit

#: Elements that share the defaults of actuators.
ACTUATORS = (
    "general", "motor", "position", "velocity", "intvelocity", "damper", "cylinder", "muscle",
    "adhesion", "dcmotor", "orientation", "pid", "plugin",
)  # fmt: skip


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
        return settings

    def _read_defaults(
        self, element: XmlElement, name: str, inherited: dict[str, dict[str, str]]
    ) -> None:
        """Read a class and those below, which have its attributes too."""
        own = {tag: dict(values) for tag, values in inherited.items()}
        for tag, values in self.defaults.get(name, {}).items():
            own.setdefault(tag, {}).update(values)
        for child in element:
            if child.name != "default":
                tag = _kind(child.name)
                own[tag] = _under(own.get(tag, {}), child.attributes)
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
        for asset in (one for holder in root.all("asset") for one in holder):
            if "file" in asset.attributes and asset.name in ("mesh", "hfield"):
                asset.attributes.setdefault("name", Path(asset.attributes["file"]).stem)
        return cls(source, root, {"": Settings.of(root, folder)})

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
        values = defaults[name].get(_kind(element.name), {})
        return attrs.evolve(element, attributes=_under(values, element.attributes))

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
        flags = [flag for option in self.root.all("option") for flag in option.all("flag")]
        return any(flag.get(name) == "disable" for flag in flags for name in names)

    def bounds(self, element: XmlElement, key: str, limited: str) -> tuple[float, float]:
        """Two bounds, infinite where they do not hold: attributes such as range and limited."""
        holds = element.get(limited, "auto")
        if holds == "auto" and key in element.attributes:
            holds = self.compiler(element).get("autolimits", "true")
        if holds == "true":
            low, high = element.numbers(key, 2, unbounded=True)
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
            try:
                return from_quaternion(element.numbers("quat", 4))
            except ValueError as error:
                raise FormatError(str(error), element.place) from None
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


def _kind(tag: str) -> str:
    return "actuator" if tag in ACTUATORS else tag


def _under(values: dict[str, str], own: dict[str, str]) -> dict[str, str]:
    """Attributes of a class under those below it; `kv` and `dampratio` replace each other."""
    replaced = {"kv": "dampratio", "dampratio": "kv"}
    return {key: text for key, text in values.items() if replaced.get(key) not in own} | own


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


def _xyaxes(element: XmlElement) -> Any:
    numbers = element.numbers("xyaxes", 6)
    x = unit(numbers[:3], element)
    dot = sum(a * b for a, b in zip(x, numbers[3:], strict=True))
    y = unit(tuple(b - dot * a for a, b in zip(x, numbers[3:], strict=True)), element)
    z = cross(x, y)
    return [[x[k], y[k], z[k]] for k in range(3)]


def cross(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, float, float]:
    """The cross product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
