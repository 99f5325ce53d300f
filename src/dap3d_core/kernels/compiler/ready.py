"""Ready-made objects: code that comes with the package, made when its wheel was built.

There is one file for each target, a kind of processor under a system. It begins with an index;
behind it stand what object files of the cache hold, compressed and each with its checksum, and only
what a scene needs is read. Names in it are digests of the sources and of this compiler: where a
source has changed nothing is found, and code is made here, as it is where there is no file at all.
"""

import json
import lzma
import os
import warnings
from functools import cache
from pathlib import Path
from typing import Any

from dap3d_core.kernels.compiler.objects import Processor, host_features, joined, parts, processor
from dap3d_core.kernels.runtime.sealed_files import sealed, unsealed

#: Where the files stand in an installed package.
FOLDER = Path(__file__).parents[2] / "ready_objects"
#: What objects are made for, by the names of their files.
TARGETS = {
    f"{system}-{level}": Processor(f"{architecture}-{rest}", name, "")
    for system, rest in (
        ("linux", "unknown-linux-gnu"),
        ("macos", "apple-macosx11.0.0"),
        ("windows", "pc-windows-msvc"),
    )
    for level, architecture, name in (
        ("x86-64", "x86_64", "x86-64"),
        ("x86-64-v3", "x86_64", "x86-64-v3"),
        ("arm64", "arm64" if system == "macos" else "aarch64", "generic"),
    )
}
_FILTERS = [{"id": lzma.FILTER_LZMA2, "preset": 9, "dict_size": 1 << 20}]
#: What a processor of the level x86-64-v3 has and one of x86-64 may not have.
V3 = frozenset(("avx", "avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt",
                "sahf", "sse4.2", "ssse3"))  # fmt: skip
#: What the triple of this process has in it, by the name of the system.
_SYSTEMS = {"linux": "-linux", "macos": "-apple-", "windows": "-windows-msvc"}
_ARCHITECTURES = {"x86_64": "x86-64", "aarch64": "arm64", "arm64": "arm64"}


def target_of(triple: str, features: frozenset[str]) -> str | None:
    """The name of the target that suits a machine; None where there is none."""
    level = _ARCHITECTURES.get(triple.partition("-")[0])
    systems = [name for name, part in _SYSTEMS.items() if part in triple]
    if level is None or not systems:
        return None
    return f"{systems[0]}-{level}{'-v3' if level == 'x86-64' and features >= V3 else ''}"


def packed(units: dict[str, tuple[Any, bytes]]) -> bytes:
    """The content of a file.

    Args:
        units: by name, what is told of the code and the code.
    """
    index, blobs, at = {}, [], 0
    for name, (about, code) in sorted(units.items()):
        blobs.append(sealed(lzma.compress(joined(about, code), lzma.FORMAT_RAW, filters=_FILTERS)))
        index[name] = at, len(blobs[-1])
        at += len(blobs[-1])
    head = sealed(json.dumps(index).encode())
    return b"%d\n" % len(head) + head + b"".join(blobs)


class Pack:
    """A file of ready-made objects.

    A damaged file, or a damaged object in it, is noted, and as if it were not there.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._index: dict[str, tuple[int, int]] = {}
        self._start = 0
        try:
            with path.open("rb") as file:
                first = file.readline(20)
                head = unsealed(file.read(int(first) if first.strip().isdigit() else 0))
                self._start = file.tell()
        except OSError:  # not every package has one
            return
        if head is None:
            self._note_damage()
        else:
            self._index = json.loads(head)

    def read(self, name: str) -> tuple[Any, bytes] | None:
        """What is told of the code of a unit, and the code; None where there is none."""
        if name not in self._index:
            return None
        at, size = self._index[name]
        try:
            with self.path.open("rb") as file:
                file.seek(self._start + at)
                content = unsealed(file.read(size))
        except OSError:
            content = None
        if content is None:
            self._note_damage()
            return None
        return parts(lzma.decompress(content, lzma.FORMAT_RAW, filters=_FILTERS))

    def _note_damage(self) -> None:
        warnings.warn(
            f"ready-made code was damaged and is made here: {self.path}; installing dap3d again "
            "repairs it", RuntimeWarning, stacklevel=1,
        )  # fmt: skip


@cache
def _pack() -> Pack | None:
    """The file for this machine; none where another processor was named."""
    if os.environ.get("DAP3D_CPU"):
        return None
    target = target_of(processor().triple, host_features())
    return None if target is None else Pack(FOLDER / f"{target}.pack")


def read(name: str) -> tuple[Any, bytes] | None:
    """A ready-made object: what is told of its code, and the code; None where there is none."""
    pack = _pack() if name else None
    return None if pack is None else pack.read(name)
