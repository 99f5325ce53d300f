"""Macros of xacro, expanded by the library xacrodoc where the user allows it."""

import re
from typing import Any

from dap3d_core.interface.formats import FormatError, Source, XmlElement, parse_xml


def expanded(source: Source, root: XmlElement) -> XmlElement:
    """The root of the file without macros.

    Raises:
        FormatError: it is not allowed, the library is not installed, or the macros are wrong.
    """
    if not source.allow_code:
        what = "is a xacro file, whose expressions are code in Python; it is not evaluated"
        raise FormatError(what, root.place, "--allow-code evaluates it, if you trust its author")
    try:
        from xacrodoc import XacroDoc, packages
    except ImportError:
        what = "xacro files are read with xacrodoc: pip install xacrodoc"
        raise FormatError(what, root.place) from None
    try:
        packages.update_package_cache({k: str(v) for k, v in source.packages.items()})
        names = _Names(source.arguments)
        options = {"subargs": names, "resolve_packages": False}
        with_defaults = _with_defaults(source, root)
        if with_defaults:
            packages.walk_up_from(source.path)
            document = XacroDoc.from_string(with_defaults, rootdir=source.path.parent, **options)
        else:
            document = XacroDoc.from_file(str(source.path), **options)
        text = document.to_urdf_string()
        source.unused.difference_update(names.asked)
    except FormatError:
        raise
    except BaseException as error:  # code of the file: it may raise anything
        if isinstance(error, KeyboardInterrupt):
            raise
        what = f"xacro cannot expand it: {type(error).__name__}: {error}"
        missing = re.search(r"Undefined substitution argument (\S+)", str(error))
        remedy = f"give it a value: --arg {missing[1]}:=VALUE" if missing else ""
        raise FormatError(what, root.place, remedy) from None
    if source.unused:
        what = f"has no argument {min(source.unused)!r}; it has {', '.join(sorted(names.asked))}"
        raise FormatError(what if names.asked else "has no arguments", root.place)
    return parse_xml(text, f"{source.path.name} (expanded)")


def _with_defaults(source: Source, root: XmlElement) -> str:
    """The text of the file with defaults for arguments without one; "" where there are none.

    xacrodoc wants a default of each argument, ROS's launch files do not.
    """
    bare = [one for one in root.all("xacro:arg") if one.get("default") is None]
    for element in bare:
        name = element.require("name")
        if name not in source.arguments:
            what = f"the argument {name} has no default"
            raise FormatError(what, element.place, f"give it a value: --arg {name}:=VALUE")
    if not bare:
        return ""
    from xml.dom import minidom

    document = minidom.parse(str(source.path))
    for one in document.getElementsByTagName("xacro:arg"):
        if not one.hasAttribute("default"):
            one.setAttribute("default", "")
    return str(document.toxml())


class _Names(dict[str, str]):
    """Arguments by name, and the names that the file asks for: those that it declares or uses."""

    def __init__(self, given: Any) -> None:
        super().__init__(given)
        self.asked: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.asked.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.asked.add(name)
        return super().__getitem__(name)
