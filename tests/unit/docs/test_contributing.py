"""CONTRIBUTING.md: the files and folders that it names exist."""

import re

from support.process import REPOSITORY

TEXT = (REPOSITORY / "CONTRIBUTING.md").read_text(encoding="utf-8")
CORE = REPOSITORY / "src/dap3d_core"


def test_the_files_of_the_walks_exist():
    """And there are four walks."""
    walks = TEXT[TEXT.index("Four walks") : TEXT.index("A new formulation")]
    files = re.findall(r"`([a-z0-9_/]+\.py)`", walks)
    assert walks.count("- **") == 4
    assert len(files) > 20
    assert [name for name in files if not (CORE / name).is_file()] == []


def test_the_map_has_every_folder_of_the_core():
    rows = TEXT[TEXT.index("| package | holds") : TEXT.index("Four walks")].splitlines()[2:]
    cells = [[part.strip() for part in row.split("|")[1:4]] for row in rows if row]
    packages = {name for first, _, _ in cells for name in re.findall(r"`(\w+)`", first)}
    folders = {
        (re.match(r"`(\w+)`:", part) or re.match(r"`(\w+)`", first))[1] + "/" + name
        for first, _, last in cells
        for part in map(str.strip, last.split(";"))
        for name in re.findall(r"`(\w+)`(?!:)", part)
    }
    found = {p.parent.relative_to(CORE).as_posix() for p in CORE.rglob("__init__.py")} - {"."}
    assert packages | folders == found
