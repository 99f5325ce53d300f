"""Parses MATLAB files with the grammar of tree-sitter-matlab."""

import os
import re
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs

from dap3d_core.interface.formats import Place
from dap3d_core.scene import MISSING, Mistake, SceneError
from dap3d_core.scene.errors import file_error
from dap3d_core.scene.files.read_toml import read_text, unreadable

if TYPE_CHECKING:
    from tree_sitter import Node

#: Maximal size of a file, bytes: recovering from errors takes time.
LARGEST_FILE = 2**20
#: Files of fewer bytes are parsed in a second; time limit of others, s.
QUICK, PARSING = 8192, 10.0
#: Maximal number of names joined by dots: the parser takes memory with the square of it.
CHAIN = 100
_LONG_CHAIN = re.compile(rf"(?<!\w)(?:[^\W\d]\w*+\s*+\.\s*+){{{CHAIN}}}")
#: Additional memory that the parser may take, bytes.
MEMORY = 2**29
#: Maximal number of comments of many lines, %{ to %}.
BLOCKS = 500
#: Maximal number of reported syntax errors of a file: the first ones explain the others.
SYNTAX_ERRORS = 5

#: Characters of text processors and PDF files in place of those of MATLAB.
_TYPOGRAPHIC = frozenset("‘’“”–−")


@attrs.frozen
class SourceFile:
    """A MATLAB file.

    Attributes:
        path: of the file.
        text: its text, lines ended by line feeds.
    """

    path: Path
    text: str

    def line(self, node: "Node") -> int:
        """The line of a node, from 1."""
        return int(node.start_point[0]) + 1

    def place(self, node: "Node") -> Place:
        """The place of a node."""
        return Place(str(self.path), self.line(node))

    def mistake(
        self, node: "Node", what: str, remedy: str = "", nearest: str = "", key: str = ""
    ) -> Mistake:
        """A mistake at a node; without a key the message begins with its text."""
        text = what if key else f"{excerpt(node)}: {what}"
        return Mistake(
            key, MISSING, text, nearest, remedy, file=str(self.path), line=self.line(node)
        )


def text_of(node: "Node") -> str:
    """The text of a node."""
    return (node.text or b"").decode("utf-8", "replace")


def excerpt(node: "Node", width: int = 60) -> str:
    """The text of a node in one line, shortened where it is long."""
    words = " ".join(text_of(node)[: 4 * width].split())
    return words if len(words) <= width else f"{words[: width - 4]} ..."


def read_source(path: Path) -> SourceFile:
    """The text of a MATLAB file, which is UTF-8 and of reasonable size.

    A link out of its folder is refused: a model from others must not put the user's files into a
    scene.

    Raises:
        SceneError: the file cannot be read, or is no text.
    """
    try:
        if path.is_file() and not path.resolve().is_relative_to(path.parent.resolve()):
            raise file_error(path, "is a link out of the folder", remedy="copy the file there")
    except OSError as error:
        raise unreadable(path, error) from None
    text = read_text(path, LARGEST_FILE, "save it as UTF-8 (in MATLAB: Save As, encoding UTF-8)")
    return SourceFile(path, text.replace("\r\n", "\n").replace("\r", "\n"))


class Grammar:
    """The parser, one for all files of a folder.

    Raises:
        SceneError: tree-sitter or its MATLAB grammar is not installed, or too old.
    """

    def __init__(self) -> None:
        remedy = "pip install tree-sitter tree-sitter-matlab"
        needed = "reading MATLAB files needs the packages tree-sitter and tree-sitter-matlab"
        try:
            import tree_sitter
            import tree_sitter_matlab
        except ImportError as error:
            what = f"{needed}, which cannot be imported ({error})"
            raise SceneError([Mistake("", MISSING, what, remedy=remedy)]) from None
        try:
            language = tree_sitter.Language(tree_sitter_matlab.language())
            self._parser: Any = tree_sitter.Parser(language)
        except (TypeError, ValueError) as error:  # incompatible versions
            what = f"{needed} in versions that fit each other: {error}"
            raise SceneError([Mistake("", MISSING, what, remedy=remedy)]) from None

    def tree(self, source: SourceFile) -> "Node":
        """The root of the tree of a file, which may have syntax errors.

        Raises:
            SceneError: parsing takes too long.
        """
        text = source.text if source.text.endswith("\n") else f"{source.text}\n"
        data = text.encode("utf-8")
        if data.count(b"%{") > BLOCKS:  # nested ones are searched repeatedly
            raise file_error(source.path, f"holds more than {BLOCKS} comments of many lines")
        if _LONG_CHAIN.search(text):
            raise file_error(source.path, f"joins more than {CHAIN} names by dots")
        if len(data) > QUICK:
            self._try(data, source.path)
        return self._parser.parse(data).root_node

    def _try(self, data: bytes, path: Path) -> None:
        """Parse in pieces, within limits of time and memory."""
        end, most = time.process_time() + PARSING, _peak() + MEMORY
        try:
            self._parser.parse(
                lambda at, _: data[at : at + QUICK],
                progress_callback=lambda *_: time.process_time() > end or _peak() > most,
            )
        except ValueError:
            self._parser.reset()
            limit = f"{PARSING:g} s" if _peak() <= most else f"{MEMORY >> 20} MiB"
            what = f"is no model: finding its statements takes more than {limit}"
            raise file_error(path, what) from None


def _peak() -> int:
    """Peak memory of this process, bytes; 0 where the system does not report it."""
    try:
        import resource
    except ImportError:  # no POSIX
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def syntax_mistakes(source: SourceFile, root: "Node") -> list[Mistake]:
    """The first syntax errors of a file, one for each line."""
    mistakes: dict[int, Mistake] = {}
    lines = source.text.split("\n")
    pending = [root] if root.has_error else []
    while pending and len(mistakes) < SYNTAX_ERRORS:
        node = pending.pop()
        if not (node.is_error or node.is_missing):
            pending += [n for n in reversed(node.children) if n.has_error or n.is_missing]
            continue
        line = source.line(node)
        text = lines[line - 1].strip() if line <= len(lines) else ""
        what = f"not valid MATLAB: {text[:60]}"
        if node.is_missing:
            what = f"not valid MATLAB, {node.type} is missing: {text[:60]}"
        remedy = ""
        if _TYPOGRAPHIC & set(text):
            remedy = "quotes and minus signs of typography are no MATLAB: write ' and -"
        mistakes.setdefault(
            line, Mistake("", MISSING, what, "", remedy, file=str(source.path), line=line)
        )
    return [mistakes[line] for line in sorted(mistakes)]


def m_files(folder: Path) -> list[str]:
    """The names of the MATLAB files in a folder, sorted.

    Raises:
        SceneError: there is no such folder, or it cannot be read.
    """
    try:
        if not folder.is_dir():
            if folder.exists():
                remedy = f"give the folder that holds it: {folder.parent}"
                raise file_error(folder, "is a file; a MATLAB model is a folder", remedy=remedy)
            raise file_error(folder, "there is no such folder")
        with os.scandir(folder) as entries:
            return sorted(e.name for e in entries if e.name.lower().endswith(".m"))
    except (OSError, ValueError) as error:  # ValueError: NUL in the path
        raise unreadable(folder, error) from None
