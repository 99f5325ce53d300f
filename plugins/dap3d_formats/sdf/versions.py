"""Older versions of SDF, as the conversions of the format's own library make newer ones of them."""

from collections.abc import Iterator

from dap3d_core.interface.formats import WORLD, FormatError, Remarks, XmlElement

#: The first version whose poses and numbers are elements, as they are in all later ones.
FIRST = (1, 2)
#: The flag of an axis that is given in the frame of the model.
IN_MODEL = "use_parent_model_frame"


def update(root: XmlElement, remarks: Remarks) -> None:
    """Bring the tree of an older version to what version 1.7 and later ones say.

    Axes are in the frame of the model before 1.5, gravity is in <physics> before 1.6, and before
    1.7 a pose has frame for relative_to, and a joint may have the name of a link.

    Raises:
        FormatError: the version is no numbers, or older than FIRST.
    """
    version = version_of(root)
    if version < FIRST:
        raise FormatError(f"version {root.get('version')} has poses and numbers in attributes",
                          root.place, "convert it with gz sdf --print")  # fmt: skip
    for element in _below(root) if version < (1, 7) else ():
        if element.name == "pose" and "frame" in element.attributes:
            element.attributes.setdefault("relative_to", element.attributes.pop("frame"))
        elif element.name == "world" and version < (1, 6):
            physics = element.first("physics")
            element.children += [] if physics is None else physics.all("gravity")
        elif element.name in ("axis", "axis2") and version < (1, 5):
            if element.first(IN_MODEL) is None:
                element.children.append(XmlElement(IN_MODEL, {}, element.place, text="true"))
        elif element.name == "model":
            _rename_joints(element, remarks)


def version_of(element: XmlElement) -> tuple[int, ...]:
    """The version that an element names, by default 1.7.

    Raises:
        FormatError: it is no numbers.
    """
    given = element.get("version") or "1.7"
    parts = given.split(".")
    if not all(part.isdecimal() for part in parts):
        raise FormatError(f"version {given!r} is no version", element.place)
    return tuple(map(int, parts))


def _below(root: XmlElement) -> Iterator[XmlElement]:
    """The elements of a tree, each before those in it."""
    stack = [root]
    while stack:
        element = stack.pop()
        yield element
        stack += reversed(element.children)


def _rename_joints(model: XmlElement, remarks: Remarks) -> None:
    """Give joints that have the name of a link another one: each is the name of a frame."""
    links = {WORLD, *(link.get("name") for link in model.all("link"))}
    for joint in model.all("joint"):
        name = joint.get("name", "")
        if name in links:
            joint.attributes["name"] = f"{name}_joint"
            text = f"joint {name} has the name of a link: it is called {name}_joint"
            remarks.translate(joint.place, text)
