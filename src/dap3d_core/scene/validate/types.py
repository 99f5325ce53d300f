"""Types that a scene names, from the registry; the model's own file only where needed."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.errors import PluginError
from dap3d_core.registry import Registry, UnknownTypeError
from dap3d_core.registry.discovery import declares
from dap3d_core.scene.tables import PLUGIN_FILE, Element
from dap3d_core.scene.validate.coerce_values import Fault, text_of
from dap3d_core.scene.validate.mistake_collector import Collector

#: Tables of elements, and the kind of type each holds.
KINDS = {"joints": "joint", "forces": "force", "functions": "function", "contacts": "contact"}


class Types:
    """The types of a scene, each loaded once.

    Args:
        report: takes mistakes and notes; its scene is read.
        registry: the installed types.
        allow_code: whether the model's own file may be run.
        to_install: the command that installs distributions which the scene requires; "" if none
            lacks.

    Attributes:
        registry: the one in use; with the types of the model's own file once that was loaded.
    """

    def __init__(
        self, report: Collector, registry: Registry, *, allow_code: bool, to_install: str = ""
    ) -> None:
        self.report, self.registry, self.allow_code = report, registry, allow_code
        self.to_install = to_install
        folder = report.scene.folder
        file = folder / PLUGIN_FILE if folder is not None else None
        self.file: Path | None = file if file is not None and file.is_file() else None
        self._refused = ""  # the reason why the model's own file gave no types
        self._installed: list[tuple[str, str]] = []  # types taken from packages

    def of(self, table: str, elements: Mapping[str, Element]) -> dict[str, TypeInfo]:
        """The types of elements of a table by keyword; unusable ones are reported."""
        named: dict[str, list[str]] = {}
        for name, element in elements.items():
            if element.type is None:
                known = ", ".join(self.registry.keywords(KINDS[table]))
                what = f"is required: the keyword of a type, one of {known}"
                self.report.add_missing_type((table, name), element.fields, what)
                continue
            keyword = self.report.read((table, name, "type"), element.type, text_of)
            if not isinstance(keyword, Fault):
                named.setdefault(keyword, []).append(name)
        types = {keyword: self._get(table, keyword, names) for keyword, names in named.items()}
        return {keyword: type_ for keyword, type_ in types.items() if type_ is not None}

    def known(self, kind: str, keyword: Any) -> TypeInfo | None:
        """The type of a keyword; None where it cannot be had, for whatever reason."""
        try:
            return self.registry.get(kind, keyword)
        except (UnknownTypeError, PluginError, TypeError):
            return None

    def note_unused_file(self) -> None:
        """Note that the model's own file was not needed."""
        if self.file is not None and not self._is_loaded() and not self._refused:
            self.report.note(f"{self.file} was not loaded: every type of the scene is installed")

    def _is_loaded(self) -> bool:
        return any(s.module == str(self.file) for f in self.registry.sources.values() for s in f)

    def _get(self, table: str, keyword: str, names: list[str]) -> TypeInfo | None:
        """The type, or None where a mistake is reported, at the first element that names it."""
        count, remedy = len(names) - 1, ""
        try:
            return self._load(KINDS[table], keyword)
        except _NotAllowedError as error:
            what, remedy = str(error), "allow it with --allow-code (allow_code=True in Python)"
        except UnknownTypeError as error:
            what = str(error) + (f"; {self._refused}" if self._refused else "")
            if self.to_install:
                remedy = f"the scene requires packages that are missing: {self.to_install}"
        except PluginError as error:
            what = str(error)
        what += f" ({count} more elements of this type)" if count else ""
        self.report.add((table, names[0], "type"), keyword, what, remedy=remedy)
        return None

    def _load(self, kind: str, word: str) -> TypeInfo:
        """The type; one that the model's own file has as well is refused."""
        try:
            type_info = self.registry.get(kind, word)
        except UnknownTypeError as error:
            if self.file is None or self._is_loaded() or self._refused:
                raise
            if not self.allow_code:
                raise _NotAllowedError(
                    f"{error}; it may be a type of the model's own file {self.file}, "
                    "which is not run unless it is allowed"
                ) from None
        else:
            if self.file is not None and self.allow_code and not self._is_loaded():
                if declares(self.file, kind, word):
                    raise PluginError(self.registry.clash(kind, word, self.file))
                self._installed.append((kind, word))
            return type_info
        try:
            self.registry = self.registry.with_file(self.file)
        except PluginError as error:
            self._refused = str(error)
            raise
        for other in self._installed:  # the text of the file may not show all its keywords
            self.registry.get(*other)
        return self.registry.get(kind, word)


class _NotAllowedError(Exception):
    """The model's own file would be needed, and may not be run."""


def completed_type(
    type_info: TypeInfo, shape: Any, refuse: Callable[[str], None]
) -> TypeInfo | None:
    """The type for one shape of its lists; None, refused, if prepare takes no numbers with it."""
    from dap3d_core.interface.examine.examine import examine
    from dap3d_core.interface.examine.sized_types import sized

    type_: Any = type_info.type
    try:
        return sized(type_, shape, examine)
    except PluginError as error:
        if not isinstance(error.__cause__, ValueError):
            raise
        refuse(str(error.__cause__))
        return None
