"""Objects and libraries of an exported model, for this and other platforms."""

import importlib.util
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import attrs

from dap3d_core.kernels.compiler import objects
from dap3d_core.kernels.compiler.objects import OPTIMISED, Processor
from dap3d_core.kernels.runtime import ready
from dap3d_core.kernels.runtime.cache import cache_folder
from dap3d_core.kernels.runtime.source_digest import source_digest
from dap3d_core.native.beside import Module, compile_modules
from dap3d_core.native.c_source import CalledUnit, symbols_of
from dap3d_core.native.run.prepared import refusal

#: Compiler options; nothing is contracted, for the bits of plain arithmetic. Without -g0 zig adds
#: symbols for a debugger, with the path of a temporary folder: each build would differ.
OPTIONS = ("-std=c11", "-O2", "-g0", "-ffp-contract=off", "-fvisibility=hidden")
#: Attributes of functions in LLVM IR that are compiled for size; without loss of bits.
SMALL = " nounwind minsize optsize"
#: Lines of LLVM IR from which on a unit, which is the steps of contacts, is optimised at a lower
#: level: this takes half the time, a tenth of the size, and makes steps 2 to 4 % slower.
LONG, QUICK = 40_000, 1
#: The compiler for every platform.
COMPILER = "pip install ziglang"


@attrs.frozen
class Platform:
    """A system and a processor that libraries are made for.

    Attributes:
        name: as a user gives it, such as "linux-x86-64".
        processor: for LLVM.
        zig: target of ``zig cc``.
        library: suffix of a shared library.
        fmi2, fmi3: its folder among the binaries of an FMU.
    """

    name: str
    processor: Processor
    zig: str
    library: str
    fmi2: str
    fmi3: str

    @property
    def is_own(self) -> bool:
        """True if it is that of this machine."""
        return self.name == own_platform()


#: Oldest C library of Linux that libraries need.
_GLIBC = "2.17"
PLATFORMS = {
    one.name: one
    for one in (
        Platform("linux-x86-64", Processor("x86_64-unknown-linux-gnu", "x86-64", ""),
                 f"x86_64-linux-gnu.{_GLIBC}", ".so", "linux64", "x86_64-linux"),
        Platform("linux-arm64", Processor("aarch64-unknown-linux-gnu", "generic", ""),
                 f"aarch64-linux-gnu.{_GLIBC}", ".so", "aarch64-linux", "aarch64-linux"),
        Platform("windows-x86-64", Processor("x86_64-pc-windows-gnu", "x86-64", ""),
                 "x86_64-windows-gnu", ".dll", "win64", "x86_64-windows"),
        Platform("macos-x86-64", Processor("x86_64-apple-macosx11.0.0", "x86-64", ""),
                 "x86_64-macos.11.0", ".dylib", "darwin64", "x86_64-darwin"),
        Platform("macos-arm64", Processor("arm64-apple-macosx11.0.0", "generic", ""),
                 "aarch64-macos.11.0", ".dylib", "aarch64-darwin", "aarch64-darwin"),
    )
}  # fmt: skip
#: What a system alone stands for.
SYSTEMS = {
    "linux": ("linux-x86-64", "linux-arm64"),
    "windows": ("windows-x86-64",),
    "macos": ("macos-x86-64", "macos-arm64"),
}


def own_platform() -> str:
    """The name of the platform of this machine."""
    system = {"darwin": "macos", "win32": "windows"}.get(sys.platform, sys.platform)
    is_arm = platform.machine().lower() in ("arm64", "aarch64")
    return f"{system}-{'arm64' if is_arm else 'x86-64'}"


def platforms_named(names: Sequence[str]) -> list[Platform]:
    """Platforms by their names or systems; that of this machine where there are none.

    Raises:
        SceneError: an unknown name; no compiler for it.
    """
    found: dict[str, Platform] = {}
    for name in names or (own_platform(),):
        keys = SYSTEMS.get(name, (name,))
        if not set(keys) <= set(PLATFORMS):
            known = ", ".join([*SYSTEMS, *PLATFORMS])
            raise refusal(f"there is no platform {name!r}", f"platforms: {known}")
        found |= {key: PLATFORMS[key] for key in keys}
    for one in found.values():
        _compiler(one)
    return list(found.values())


def _compiler(target: Platform) -> list[str]:
    """The command of a compiler for a platform."""
    if importlib.util.find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc", "-target", target.zig]
    own = next((c for c in ("cc", "gcc", "clang") if shutil.which(c)), None)
    if own is None:
        raise refusal("there is no C compiler", f"{COMPILER} brings one")
    if not target.is_own:
        raise refusal(
            f"the compiler of this machine makes no libraries for {target.name}",
            f"{COMPILER} brings one that does",
        )
    return [own]


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        words = (done.stderr or done.stdout).strip().splitlines()
        raise refusal(f"the compiler failed: {' | '.join(words[-6:])} [{' '.join(command[:6])}]")


def build_objects(
    units: Sequence[CalledUnit],
    texts: Sequence[tuple[str, str]],
    target: Platform,
    folder: Path,
) -> list[Path]:
    """Object files of units and of further functions (LLVM IR, symbol), in a folder.

    Units are taken from the cache folder or from ready-made objects where they are there.
    """
    files = [folder / f"unit{k}.o" for k in range(len(units) + len(texts))]
    paths, modules = [_path_of(unit, target) for unit in units], []
    for unit, path, file in zip(units, paths, files, strict=False):
        stored = None if path is None else objects.read_object(path)
        stored = stored or ready.read(ready_name(unit), target.name)
        if stored is None:
            modules.append(module_of(unit, file))
        else:
            file.write_bytes(stored[1])
    missing = [module.file for module in modules]
    for (text, symbol), file in zip(texts, files[len(units) :], strict=True):
        modules.append(Module(_linked(text, symbol, "hidden"), OPTIMISED, file))
    compile_modules(modules, target.processor)
    for path, file in zip(paths, files, strict=False):
        if path is not None and file in missing:
            objects.write_object(path, [], file.read_bytes())
    return files


def _path_of(called: CalledUnit, target: Platform) -> Path | None:
    """The file of a unit in the cache folder, for the linker of a platform."""
    folder, name = cache_folder(), f"{called.unit.name}.{target.name}{_kind_of(called)}.o"
    return None if folder is None else folder / name


def ready_name(called: CalledUnit) -> str:
    """The name of a unit for a linker among ready-made objects; "" where it has none."""
    name = called.unit.ready_name
    return f"{name}{_kind_of(called)}" if name else ""


def _kind_of(called: CalledUnit) -> str:
    """What a unit for a linker differs in from others: functions, size, what is written here."""
    is_whole = len(called.kept) == len(called.unit.symbols)
    kind = "" if is_whole else "".join(f".{k}" for k in sorted(called.kept))
    return f"{kind}{'' if called.is_hot else '.small'}.{_own_digest()}"


@cache
def _own_digest() -> str:
    return source_digest(Path(__file__).read_bytes())


def module_of(called: CalledUnit, file: Path) -> Module:
    """A unit for a linker.

    Its functions are seen within the library alone. Units that steps do not call, such as the
    events of contacts, are made small; no code is made of what nothing calls.
    """
    symbols = symbols_of(called.unit)
    text = called.unit.fresh_text(symbols)
    if not called.is_hot:
        text = text.replace(" nounwind", SMALL)
    for k, symbol in enumerate(symbols):
        text = _linked(text, symbol, "hidden" if k in called.kept else "internal")
    return Module(text, min(QUICK if text.count("\n") > LONG else OPTIMISED, OPTIMISED), file)


def _linked(text: str, symbol: str, linkage: str) -> str:
    """LLVM IR in which a function has a linkage."""
    return re.sub(rf"define (\w+ @{symbol}\()", rf"define {linkage} \1", text)


def link(
    source: Path, files: Sequence[Path], target: Platform, library: Path, archive: Path | None
) -> None:
    """Compile a C file and link it with objects to a shared library and a static one."""
    compiler, made = _compiler(target), files[0].parent / f"{source.stem}.o"
    pic = [] if target.library == ".dll" else ["-fPIC"]
    _run([*compiler, *OPTIONS, *pic, "-c", str(source), "-o", str(made)])
    math = [] if target.library == ".dll" else ["-lm"]
    strip = [] if target.library == ".dylib" else ["-s"]
    extra = {".dylib": ["-install_name", f"@rpath/{library.name}"]}.get(target.library, [])
    everything = [str(made), *map(str, files)]
    _run([*compiler, "-shared", *strip, *extra, *everything, *math, "-o", str(library)])
    for imports in library.parent.glob(f"{source.stem}.lib"):  # as zig calls it
        imports.replace(library.with_suffix(".lib"))
    if archive is not None:
        archive.unlink(missing_ok=True)
        ar = ["ar"] if len(compiler) == 1 else [sys.executable, "-m", "ziglang", "ar"]
        _run([*ar, "rcs", str(archive), *everything])
