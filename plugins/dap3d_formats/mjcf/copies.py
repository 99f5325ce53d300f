"""Copies of MJCF: replicas of elements, and other models that are attached."""

from collections.abc import Callable, Iterator
from pathlib import Path

import attrs
import numpy as np

from dap3d_core.interface.formats import WORLD, FormatError, Source, XmlElement, quaternion
from dap3d_formats.element_table import note_elements
from dap3d_formats.mjcf.document import Document
from dap3d_formats.mjcf.elements import CONTACTS, MJCF, further
from dap3d_formats.mjcf.keyframes import keys_of_part

#: Elements of all copies of a file beyond which it is refused.
MOST_COPIES = 100_000
#: Sections whose elements are copied with what they name, those first that others name.
NAMING = ("tendon", "equality", "actuator", "contact")
#: What these name, and what else elements name.
PARTS, ASSETS = {"body", "joint", "geom", "site", "tendon"}, {"mesh", "hfield", "material"}

#: True for a kind and a name that are to be renamed.
Refers = Callable[[str, str], bool]


def read_document(source: Source) -> Document:
    """The document of a file, with remarks on it; replicas and attached models are in place.

    Replica k is turned by k times the Euler angles of the element, and its offset from the one
    before is in the axes of that; names end in the separator and k, with zeros before it so that
    all are of one length. Tendons, equalities,
    actuators and pairs that name one of these are copied with it.

    Of an attached model what its world holds, or one body with all below it, is put in a frame in
    the place of <attach>; names get its prefix, and classes and settings of the compiler remain
    those of its file. Its assets follow the own ones, as do tendons, equalities, actuators, pairs
    and exclusions that name nothing else, and keyframes with the numbers of what is attached.

    Raises:
        FormatError: it cannot be read.
    """
    document = _read(source, source.xml(), source.path.parent, {})
    _require_names(document.root)
    return document


def _read(source: Source, root: XmlElement, folder: Path, models: dict[Path, Document]) -> Document:
    """A document; models: those that have been read, by file."""
    document = Document.of(source, root, folder)
    note_elements(root, CONTACTS if source.contacts else MJCF, source.remarks, further)
    copier = _Copier(document, models)
    for world in root.all("worldbody"):
        copier.attach(world)
    copier.expand(root)
    return document


def _require_names(root: XmlElement) -> None:
    """Refuse two elements of a kind and name."""
    known: set[tuple[str, str]] = set()
    for kind, element in _elements_named(root):
        key = kind, element.attributes["name"]
        if key in known:
            what = f"there are two of <{kind}> {key[1]!r}"
            raise FormatError(what, element.place, "give one of them another name")
        known.add(key)


@attrs.define
class _Copier:
    document: Document
    models: dict[Path, Document]
    made: int = 0

    def attach(self, holder: XmlElement) -> None:
        for k, child in enumerate(holder):
            if child.name == "attach":
                holder.children[k] = self._attached(child)
            else:
                self.attach(child)

    def _attached(self, element: XmlElement) -> XmlElement:
        """The frame of an attached model; what it has beside bodies is put in the root."""
        prefix, settings = element.get("prefix"), self.document.settings
        if prefix is None:
            raise FormatError('<attach> has no prefix; it is required, and may be ""',
                              element.place)  # fmt: skip
        model, scope = self._model(element), f"{len(settings)}/"
        contents, sections = _part(model, element)
        frame = XmlElement("frame", {"childclass": "main"}, element.place, contents)
        whole = XmlElement("", {}, element.place, [frame, *sections])
        self._count(_size(whole), element)
        whole = _renamed(whole, prefix.__add__, _is_reference, scope)
        known = set(_named(self.document.root))
        for kind, name in (one for one in _named(whole) if one in known):
            what = f"prefix = {prefix!r} of <attach>: there are two of <{kind}> {name!r} with it"
            raise FormatError(what, element.place, "give it a prefix that no other has")
        for inner, given in model.settings.items():
            defaults = {
                name: {tag: _words(values, prefix.__add__, _is_reference)
                       for tag, values in tags.items()}
                for name, tags in given.defaults.items()
            }  # fmt: skip
            settings[scope + inner] = attrs.evolve(given, defaults=defaults)
        for option in model.root.all("option"):
            text = "<option> of an attached model: that of the file that attaches it holds"
            model.source.remarks.leave_out(option.place, text)
        frame, *sections = whole
        self.document.root.children += sections
        return frame

    def _model(self, element: XmlElement) -> Document:
        """The model that an element attaches."""
        source, folder = self.document.source, self.document.settings[""].folder
        name, models = element.require("model"), {}
        for model in self.document.section("asset", "model"):
            file, place = model.require("file"), model.place
            own = model.get("name") or source.include(file, place, folder).get("model") or ""
            models[own] = (file, place)
        if name not in models:
            known = f"; models: {', '.join(models)}" if models else ""
            what = f"model of <attach>: there is no model {name!r} in <asset>{known}"
            raise FormatError(what, element.place, f'add <model name="{name}" file="..."/> to it')
        file, place = models[name]
        path = folder / file
        if path not in self.models:  # files that attach others twice are read once
            root = source.include(file, place, folder)
            with source.including(file, folder):
                self.models[path] = _read(source, root, path.parent, self.models)
        return self.models[path]

    def expand(self, element: XmlElement) -> None:
        children: list[XmlElement] = []
        for child in element:
            self.expand(child)
            children += self._copies(child) if child.name == "replicate" else [child]
        element.children = children

    def _copies(self, element: XmlElement) -> list[XmlElement]:
        number = element.number("count")
        if not number.is_integer() or number < 1.0:
            raise FormatError(f"count = {number:g} should be an integer above 0", element.place)
        count = int(number)
        self._count(count * _size(element), element)
        offset = np.array(element.numbers("offset", 3, (0.0, 0.0, 0.0)))
        copies, place, digits = [], np.zeros(3), len(str(count))
        suffixes = [f"{element.get('sep', '')}{k:0{digits}d}" for k in range(count)]
        self._copy_naming(set(_named(element)), suffixes)
        for k, suffix in enumerate(suffixes):
            turn = np.array(self.document.euler(element, k))
            words = {
                "pos": " ".join(map(repr, place.tolist())),
                "quat": " ".join(map(repr, quaternion(turn))),
            }
            frame = XmlElement("frame", words, element.place, element.children)
            copies.append(_suffixed(frame, suffix, set()))
            place = place + turn @ offset
        return copies

    def _count(self, copies: int, element: XmlElement) -> None:
        self.made += copies
        if self.made > MOST_COPIES:
            what = f"replicates and attached models make more than {MOST_COPIES} elements"
            raise FormatError(what, element.place)

    def _copy_naming(self, names: set[tuple[str, str]], suffixes: list[str]) -> None:
        """Copy elements outside of bodies that name one of those that are copied."""
        for section in (one for tag in NAMING for one in self.document.root.all(tag)):
            children: list[XmlElement] = []
            for child in section:
                if names.isdisjoint(_references(child)):
                    children.append(child)
                else:
                    self._count(len(suffixes) * _size(child), child)
                    children += [_suffixed(child, suffix, names) for suffix in suffixes]
                    names |= {(section.name, child.get("name") or "")} - {(section.name, "")}
            section.children = children


def _part(model: Document, element: XmlElement) -> tuple[list[XmlElement], list[XmlElement]]:
    """What is attached of a model: elements of bodies, and sections."""
    root, tags = model.root, [tag for tag in ("body", "frame") if tag in element.attributes]
    worlds, place = root.all("worldbody"), element.place
    assets = [
        attrs.evolve(one, children=[child for child in one if child.name != "model"])
        for one in root.all("asset")
    ]
    if len(tags) == 2:
        raise FormatError("<attach> takes body or frame, not both", place)
    if not tags:
        sections = [one for one in root if one.name in (*NAMING, "keyframe")]
        return model.section("worldbody"), [*assets, *sections]
    (tag,), name = tags, element.get(tags[0])
    found = {one.get("name"): one for world in worlds for one in _below(world, tag, "main")}
    if name not in found:
        known = ", ".join(one for one in found if one)
        what = f"{tag} of <attach>: there is no {tag} {name!r} in model {element.get('model')!r}"
        remedy = f"without {tag} all of the model is attached"
        raise FormatError(f"{what}; it has {known or 'none'}", place, remedy)
    sections, names = [], set(_named(XmlElement("", {}, place, [found[name]])))
    for section in (one for tag in NAMING for one in root.all(tag)):
        kept = [child for child in section if names.issuperset(_references(child))]
        names |= {(section.name, child.get("name") or "") for child in kept}
        sections.append(attrs.evolve(section, children=kept))
    kept = [one for section in sections if section.name == "actuator" for one in section]
    keys = keys_of_part(model, found[name], kept)
    return [found[name]], [*assets, *sections, *keys]


def _below(holder: XmlElement, tag: str, childclass: str) -> Iterator[XmlElement]:
    """All bodies, or frames, below an element, with the class that they pass on."""
    for child in holder:
        inner = child.get("childclass") or childclass
        if child.name == tag:
            yield attrs.evolve(child, attributes=child.attributes | {"childclass": inner})
        yield from _below(child, tag, inner)


def _kind(key: str) -> str:
    """What an attribute names: sidesite a site, body1 a body, joint a joint."""
    return "site" if key.endswith("site") else key.removesuffix("inparent").rstrip("12")


def _is_reference(kind: str, name: str) -> bool:
    """True where an attribute of a kind names another element than the world."""
    return kind in PARTS | ASSETS and (kind, name) != ("body", WORLD)


def _references(element: XmlElement) -> set[tuple[str, str]]:
    """The kinds and names of parts that an element, or one in it, names."""
    words = [word for part in (element, *element) for word in part.attributes.items()]
    return {
        (_kind(key), word) for key, word in words
        if _kind(key) in PARTS and _is_reference(_kind(key), word)
    }  # fmt: skip


def _named(element: XmlElement) -> Iterator[tuple[str, str]]:
    """The kinds and names of all elements below one."""
    return ((kind, one.attributes["name"]) for kind, one in _elements_named(element))


def _elements_named(element: XmlElement) -> Iterator[tuple[str, XmlElement]]:
    """The kinds of all elements with a name below one, and these elements."""
    for child in element:
        if "name" in child.attributes:
            kind = element.name if element.name in NAMING else child.name.removeprefix("free")
            yield kind, child
        yield from _elements_named(child)


def _size(element: XmlElement) -> int:
    return 1 + sum(_size(child) for child in element)


def _suffixed(element: XmlElement, suffix: str, names: set[tuple[str, str]]) -> XmlElement:
    return _renamed(element, lambda word: word + suffix, lambda *word: word in names)


def _renamed(
    element: XmlElement, rename: Callable[[str], str], refers: Refers, scope: str = ""
) -> XmlElement:
    """A copy of an element and all below, in a scope, with new names and references."""
    return attrs.evolve(
        element,
        attributes=_words(element.attributes, rename, refers),
        children=[_renamed(child, rename, refers, scope) for child in element],
        scope=scope + element.scope,
    )


def _words(
    attributes: dict[str, str], rename: Callable[[str], str], refers: Refers
) -> dict[str, str]:
    """Attributes with new names and references."""
    return {
        key: rename(word) if key == "name" or refers(_kind(key), word) else word
        for key, word in attributes.items()
    }
