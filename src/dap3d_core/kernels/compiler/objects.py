"""Object code: compiled from LLVM IR, stored in files, loaded into memory.

An object file starts with a line of JSON, the results of its functions, and ends with a checksum: a
damaged file is never loaded.
"""

import contextlib
import hashlib
import json
import mmap
import os
import subprocess
import sys
import threading
import time
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from dap3d_core.kernels.runtime.sealed_files import sealed, sealed_content, write_file

#: Maximum size of the object files of a folder; the oldest are removed first.
MAX_BYTES = 200_000_000
#: Age in seconds from which a file that a killed process left behind is removed.
STRAY_AGE = 3600.0
#: A folder is cleaned at the first of so many objects that a process writes: it is read whole.
CLEAN_EVERY = 50
#: Bytes that LLVM takes besides the text or the code.
ROOM = 32 * 2**20
#: Optimisation levels; that of code generation for modules with a block of so many instructions. At
#: higher ones it asks of each two accesses to memory whether they overlap, which takes a time that
#: grows with the square of the block, and makes programs of scenes no faster.
UNOPTIMISED, OPTIMISED = 0, 3
OF_LONG_BLOCKS, LONG_BLOCK = 1, 1000
#: Of code that is loaded into this process, and that is linked: relocation and code model.
RELOCATION, CODE_MODEL = ("static", "pic"), ("jitdefault", "small")
_lock = threading.RLock()
#: Execution engines; loaded code stays for the life of the process.
_engines: list[Any] = []
_written = count()


class Processor(NamedTuple):
    """The processor that code is compiled for."""

    triple: str
    name: str
    features: str


@cache
def processor() -> Processor:
    """This processor, or the one that ``DAP3D_CPU`` names (for example ``x86-64-v2``).

    Raises:
        OSError: LLVM knows no such processor for this machine.
    """
    llvm = _llvm()
    name = os.environ.get("DAP3D_CPU", "")
    if name and not _is_known(name):
        raise OSError(
            f"the environment variable DAP3D_CPU is {name!r}, which is no processor of "
            f"{llvm.get_process_triple()} that LLVM knows; name one, such as "
            f"{llvm.get_host_cpu_name()}, or unset it for the processor of this machine"
        )
    features = "" if name else llvm.get_host_cpu_features().flatten()
    return Processor(llvm.get_process_triple(), name or llvm.get_host_cpu_name(), features)


#: Compiles a function for the processor that it is given.
_TRIAL = """
import sys
import llvmlite.binding as llvm
llvm.initialize_native_target()
llvm.initialize_native_asmprinter()
machine = llvm.Target.from_default_triple().create_target_machine(cpu=sys.argv[1])
machine.emit_object(llvm.parse_assembly("define double @f(double %x) { ret double %x }"))
"""


def _is_known(name: str) -> bool:
    """True if LLVM compiles for a processor; in a process of its own, which LLVM may abort."""
    trial = [sys.executable, "-P", "-c", _TRIAL, name]  # -P: no package of the current folder
    done = subprocess.run(trial, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    return done.returncode == 0 and not done.stderr


@cache
def host_features() -> frozenset[str]:
    """Features of this processor, by LLVM's names."""
    return frozenset(name for name, has in _llvm().get_host_cpu_features().items() if has)


@cache
def _llvm() -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm


def initialise_all_targets() -> None:
    """Let ``compile_ir`` compile for every target that LLVM knows."""
    llvm = _llvm()
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()


@cache
def compiler() -> str:
    """Digest of this compiler's sources."""
    files = sorted(Path(__file__).parent.rglob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


@cache
def identity() -> str:
    """All that decides the code besides the sources: compiler, LLVM and processor."""
    import llvmlite

    return f"{llvmlite.__version__} {_llvm().llvm_version_info} {processor()} {compiler()}"


def _target_machine(level: int, target: Processor, *, is_linked: bool = False) -> Any:
    return _llvm().Target.from_triple(target.triple).create_target_machine(
        cpu=target.name, features=target.features, opt=level, reloc=RELOCATION[is_linked],
        codemodel=CODE_MODEL[is_linked], jit=not is_linked,
    )  # fmt: skip


def compile_ir(
    text: str, level: int, target: Processor | None = None, *, is_linked: bool = False
) -> bytes:
    """Object code of a module of LLVM IR; ``is_linked``: for the linker of a shared library.

    Raises:
        MemoryError: there is too little left.
    """
    _check_room(4 * len(text))
    llvm, target = _llvm(), target or processor()
    has_long_block = max(block.count("\n") for block in text.split(":\n")) > LONG_BLOCK
    generation = min(level, OF_LONG_BLOCKS) if has_long_block else level
    machine = _target_machine(generation, target, is_linked=is_linked)
    if level > UNOPTIMISED and "%slope." in text:  # LLVM finds functions of several times the size
        text = text.replace(" inlinehint", " alwaysinline")  # too long, and passes slopes in memory
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = target.triple, str(machine.target_data)
    module.verify()
    options = llvm.create_pipeline_tuning_options(speed_level=level)
    options.loop_vectorization, options.slp_vectorization = level > 0, False
    options.loop_interleaving = False
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return machine.emit_object(module)


def _check_room(size: int) -> None:
    """Refuse what there is no room for, with what LLVM takes besides: it would end the process."""
    try:
        mmap.mmap(-1, size + ROOM).close()
    except OSError:
        raise MemoryError from None


def load(code: bytes, symbols: list[str]) -> list[int]:
    """Load object code into memory; returns the addresses of its symbols.

    Raises:
        MemoryError: there is too little left.
    """
    llvm = _llvm()
    _check_room(len(code))
    with _lock:
        machine = _target_machine(UNOPTIMISED, processor())
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        _engines.append(engine)
        return [engine.get_function_address(symbol) for symbol in symbols]


def name_address(symbol: str, address: int) -> None:
    """Let code that is loaded from here on find an address by a symbol."""
    _llvm().add_symbol(symbol, address)


def encoded(results: Any, code: bytes) -> bytes:
    """JSON values, the results of functions, and code as the content of a file."""
    return json.dumps(results).encode() + b"\n" + code


def decoded(content: bytes) -> tuple[Any, bytes]:
    """Results and code of the content of a file."""
    head, _, code = content.partition(b"\n")
    return json.loads(head), code


def read_object(path: Path) -> tuple[list[Any], bytes] | None:
    """Results and code of an object file; None where there is no usable file."""
    content = sealed_content(path)
    return None if content is None else decoded(content)


def write_object(path: Path, results: list[Any], code: bytes) -> None:
    """Write an object file; where that fails, the code stays in memory only."""
    write_file(path, sealed(encoded(results, code)))
    if next(_written) % CLEAN_EVERY == 0:
        with contextlib.suppress(OSError):
            _clean(path.parent)


def optimised(text: str, results: Any, path: Path | None) -> bytes:
    """Optimised object code of LLVM IR, kept in a file where there is a path."""
    code = compile_ir(text, OPTIMISED)
    if path is not None:
        write_object(path, results, code)
    return code


def _clean(folder: Path) -> None:
    """Bound the size of a folder; remove what killed processes left behind."""
    now = time.time()
    for stray in (*folder.glob("*.ll"), *folder.glob(".*.o.*"), *folder.glob(".*.ll.*")):
        if now - stray.stat().st_mtime > STRAY_AGE:
            stray.unlink(missing_ok=True)
    files = [(f.stat().st_mtime, f.stat().st_size, f) for f in folder.glob("*.o")]
    excess = sum(size for _, size, _ in files) - MAX_BYTES
    for _, size, file in sorted(files):
        if excess <= 0:
            break
        file.unlink()
        excess -= size
