"""CONTRIBUTING.md: the files and folders that it names exist, and unit tests lie as it says."""

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
        for name in re.findall(r"`([\w/]+)`(?!:)", part)
    }
    found = {p.parent.relative_to(CORE).as_posix() for p in CORE.rglob("__init__.py")} - {"."}
    assert packages | folders == found


#: Unit tests of more than a source file: of the documents, of the compiler as a whole, of imports.
OF_SEVERAL = {
    "docs/test_complete.py", "docs/test_contributing.py", "kernels/compiler/test_bits.py",
    "kernels/compiler/test_complex.py", "kernels/compiler/test_core.py",
    "kernels/compiler/test_refusals.py", "native/source/test_fmi.py",
    "simulation/test_only_what_is_needed.py",
    "testing/checks/test_functions.py",
}  # fmt: skip


def test_unit_tests_mirror_the_sources():
    """PACKAGE/FOLDER/test_FILE.py is of PACKAGE/FOLDER/FILE.py, or of the folder of that name."""
    unit, astray = REPOSITORY / "tests/unit", set()
    for path in unit.rglob("test_*.py"):
        place, name = CORE / path.parent.relative_to(unit), path.stem.removeprefix("test_")
        if not ((place / f"{name}.py").is_file() or (place / name).is_dir() or place.name == name):
            astray.add(path.relative_to(unit).as_posix())
    assert astray == OF_SEVERAL
