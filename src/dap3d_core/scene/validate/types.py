"""The types that a scene names, from the registry; the model's own file only where it is needed."""

from pathlib import Path

from dap3d_core.interface import PluginError
from dap3d_core.interface.codegen.examined import Examined
from dap3d_core.registry import Registry, UnknownTypeError
from dap3d_core.registry.declared_types import declares
from dap3d_core.scene.errors import MISSING
from dap3d_core.scene.files.read_toml import PLUGIN_FILE
from dap3d_core.scene.validate.coerce_values import Fault, text_of
from dap3d_core.scene.validate.mistake_collector import Collector

#: Tables of elements, and the kind of type each holds.
KINDS = {"joints": "joint", "forces": "force", "functions": "function"}


class Types:
    """The types of a scene, each loaded once.

    Args:
        report: takes mistakes and notes; its scene is read.
        registry: the installed types.
        allow_code: whether the model's own file may be run.

    Attributes:
        registry: the one in use; with the types of the model's own file once that was loaded.
    """

    def __init__(self, report: Collector, registry: Registry, *, allow_code: bool) -> None:
        self.report, self.registry, self.allow_code = report, registry, allow_code
        folder = report.scene.folder
        file = folder / PLUGIN_FILE if folder is not None else None
        self.file: Path | None = file if file is not None and file.is_file() else None
        self._refused = ""  # why the model's own file gave no types
        self._installed: list[tuple[str, str]] = []  # types that were taken from packages

    def of(self, table: str) -> dict[str, Examined]:
        """The types of a table's elements by keyword; what cannot be had is reported."""
        named: dict[str, list[str]] = {}
        for name, element in getattr(self.report.scene, table).items():
            word = text_of(element.type) if element.type is not None else None
            if isinstance(word, str):
                named.setdefault(word, []).append(name)
                continue
            known = ", ".join(self.registry.keywords(KINDS[table]))
            what = f"is required: the keyword of a type, one of {known}"
            what = what if word is None else word.what
            value = MISSING if word is None else element.type
            self.report.add((table, name, "type"), value, what)
        found = {word: self._get(table, word, names) for word, names in named.items()}
        return {word: examined for word, examined in found.items() if examined is not None}

    def note_unused_file(self) -> None:
        """Say that the model's own file was not needed, where it stands there unused."""
        if self.file is not None and not self._is_loaded() and not self._refused:
            self.report.note(f"{self.file} was not loaded: every type of the scene is installed")

    def _is_loaded(self) -> bool:
        return any(s.module == str(self.file) for f in self.registry.sources.values() for s in f)

    def _get(self, table: str, word: str, names: list[str]) -> Examined | None:
        key = (table, names[0], "type")
        count = len(names) - 1
        more = f" ({count} more elements of this type)" if count else ""
        try:
            return self._ask(KINDS[table], word)
        except _NotAllowedError as error:
            fault = Fault(str(error), "allow it with --allow-code (allow_code=True in Python)")
        except UnknownTypeError as error:
            words = str(error) + (f"; {self._refused}" if self._refused else "")
            fault = Fault(words)
        except PluginError as error:
            fault = Fault(str(error))
        self.report.add(key, word, fault.what + more, "", fault.remedy)
        return None

    def _ask(self, kind: str, word: str) -> Examined:
        """The type; one that the model's own file has as well is refused, whichever comes first."""
        try:
            examined = self.registry.get(kind, word)
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
            return examined
        try:
            self.registry = self.registry.with_file(self.file)
        except PluginError as error:
            self._refused = str(error)
            raise
        for other in self._installed:  # the text of the file may not have told its keywords
            self.registry.get(*other)
        return self.registry.get(kind, word)


class _NotAllowedError(Exception):
    """The model's own file would be needed, and may not be run."""
