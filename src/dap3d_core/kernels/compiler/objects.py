"""From LLVM IR to object code, kept in files, and into memory.

An object file begins with a line that tells what is in it, and is sealed by a checksum: a damaged
one is never run. It is written under another name and renamed, for processes may race; the oldest
are removed when there are many.
"""

import contextlib
import hashlib
import json
import os
import threading
import uuid
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from dap3d_core.kernels.sealed_files import sealed, sealed_content

#: Bytes of object files in a folder at most; those not used for longest go first.
MOST_BYTES = 200_000_000
#: How well code is made: as it stands, or as well as can be.
QUICK, GOOD = 0, 3
_lock = threading.RLock()
#: Engines of what is loaded; code stays for the life of the process.
_loaded: list[Any] = []


class Processor(NamedTuple):
    """What code is made for."""

    triple: str
    name: str
    features: str


@cache
def processor() -> Processor:
    """This one, or what ``DAP3D_CPU`` names (``x86-64-v2``, say)."""
    llvm = _llvm()
    name = os.environ.get("DAP3D_CPU", "")
    features = "" if name else llvm.get_host_cpu_features().flatten()
    return Processor(llvm.get_process_triple(), name or llvm.get_host_cpu_name(), features)


@cache
def _llvm() -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm


@cache
def identity() -> str:
    """What besides sources decides the code: this compiler, LLVM, the processor."""
    import llvmlite

    files = sorted(Path(__file__).parent.glob("*.py"))
    seal = hashlib.sha256(b"".join(file.read_bytes() for file in files))
    return f"{llvmlite.__version__} {_llvm().llvm_version_info} {processor()} {seal.hexdigest()}"


def machine(level: int, target: Processor | None = None) -> Any:
    """LLVM's target machine."""
    target = target or processor()
    return _llvm().Target.from_triple(target.triple).create_target_machine(
        cpu=target.name, features=target.features, opt=level, reloc="static",
        codemodel="jitdefault", jit=True,
    )  # fmt: skip


def object_of(text: str, level: int, target: Processor | None = None) -> bytes:
    """Object code of a module of LLVM IR."""
    llvm, to = _llvm(), machine(level, target)
    module = llvm.parse_assembly(text)
    module.triple = (target or processor()).triple
    module.data_layout = str(to.target_data)
    module.verify()
    options = llvm.create_pipeline_tuning_options(speed_level=level)
    options.loop_vectorization, options.slp_vectorization = level > QUICK, False
    builder = llvm.create_pass_builder(to, options)
    builder.getModulePassManager().run(module, builder)
    found: bytes = to.emit_object(module)
    return found


def load(code: bytes, symbols: list[str]) -> list[int]:
    """Put object code into memory; the addresses of its symbols."""
    llvm = _llvm()
    with _lock:
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine(QUICK))
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        _loaded.append(engine)
        return [engine.get_function_address(symbol) for symbol in symbols]


def read(path: Path) -> tuple[Any, bytes] | None:
    """What an object file tells of its code, and the code; None where there is none to be used."""
    content = sealed_content(path)
    if content is None:
        return None
    head, _, code = content.partition(b"\n")
    return json.loads(head), code


def keep(path: Path, about: Any, code: bytes) -> None:
    """Write an object file; where that cannot be, code is kept in memory alone."""
    write(path, sealed(json.dumps(about).encode() + b"\n" + code))
    with contextlib.suppress(OSError):
        _bound(path.parent)


def write(path: Path, data: bytes) -> None:
    """Write a file whole or not at all."""
    aside = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    try:
        aside.write_bytes(data)
        os.replace(aside, path)
    except OSError:
        with contextlib.suppress(OSError):
            aside.unlink()


def _bound(folder: Path) -> None:
    files = [(f.stat().st_mtime, f.stat().st_size, f) for f in folder.glob("*.o")]
    left = sum(size for _, size, _ in files) - MOST_BYTES
    for _, size, file in sorted(files):
        if left <= 0:
            break
        file.unlink()
        left -= size
