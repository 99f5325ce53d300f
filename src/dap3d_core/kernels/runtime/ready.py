"""Ready-made objects: code that comes with the package, compiled when its wheel was built.

There is one file for each target, a kind of processor under a system: an index, object files, each
compressed for itself as a scene needs few of them, and a checksum. Names in the index are digests
of the sources and of this compiler: the code of a source that has changed is not found, and
compiled here, as where there is no file.
"""

import lzma
import os
import warnings
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from dap3d_core.kernels.compiler import objects
from dap3d_core.kernels.runtime.sealed_files import sealed, unsealed

#: The folder of the files in an installed package.
FOLDER = Path(__file__).parents[2] / "ready_objects"
#: End of the triple that objects are compiled for, and part of that of a process, by system.
_SYSTEMS = {
    "linux": ("unknown-linux-gnu", "-linux"),
    "macos": ("apple-macosx11.0.0", "-apple-"),
    "windows": ("pc-windows-msvc", "-windows-msvc"),
}
_ARCHITECTURES = {"x86_64": "x86-64", "aarch64": "arm64", "arm64": "arm64"}
#: Processors that objects are compiled for, by the names of their files.
TARGETS = {
    f"{system}-{level}": objects.Processor(f"{architecture}-{rest}", name, "")
    for system, (rest, _) in _SYSTEMS.items()
    for level, architecture, name in (
        ("x86-64", "x86_64", "x86-64"),
        ("x86-64-v3", "x86_64", "x86-64-v3"),
        ("arm64", "arm64" if system == "macos" else "aarch64", "generic"),
    )
}
#: Features of a processor of the level x86-64-v3 that one of x86-64 may lack.
V3 = frozenset(("avx", "avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt",
                "sahf", "sse4.2", "ssse3"))  # fmt: skip
_COMPRESSION = {
    "format": lzma.FORMAT_RAW,
    "filters": [{"id": lzma.FILTER_LZMA2, "preset": 9, "dict_size": 1 << 20}],
}


def target_of(triple: str, features: frozenset[str]) -> str | None:
    """The name of the target that suits a machine; None where there is none."""
    level = _ARCHITECTURES.get(triple.partition("-")[0])
    systems = [name for name, (_, part) in _SYSTEMS.items() if part in triple]
    if level is None or not systems:
        return None
    return f"{systems[0]}-{level}{'-v3' if level == 'x86-64' and features >= V3 else ''}"


def packed(units: dict[str, tuple[list[Any], bytes]]) -> bytes:
    """The content of a file from results and code of units, by name."""
    index, blobs = {}, b""
    for name, unit in sorted(units.items()):
        blob = lzma.compress(objects.encoded(*unit), **_COMPRESSION)
        index[name] = len(blobs), len(blobs) + len(blob)
        blobs += blob
    return sealed(objects.encoded(index, blobs))


class Pack(NamedTuple):
    """A file of ready-made objects: first and last byte of each unit by name, and all units."""

    index: dict[str, tuple[int, int]]
    units: bytes

    @classmethod
    def of(cls, path: Path) -> "Pack":
        """The content of a file; nothing, with a warning, where it is damaged."""
        try:
            content = unsealed(path.read_bytes())
        except OSError:  # not every package has one
            return cls({}, b"")
        if content is not None:
            return cls(*objects.decoded(content))
        warnings.warn(
            f"ready-made code was damaged and is made here: {path}; installing dap3d again "
            "repairs it", RuntimeWarning, stacklevel=1,
        )  # fmt: skip
        return cls({}, b"")

    def read(self, name: str) -> tuple[list[Any], bytes] | None:
        """Results and code of a unit; None where there is none."""
        if name not in self.index:
            return None
        first, last = self.index[name]
        return objects.decoded(lzma.decompress(self.units[first:last], **_COMPRESSION))


@cache
def _pack(target: str) -> Pack:
    """The file for a target."""
    return Pack.of(FOLDER / f"{target}.pack")


def read(name: str, target: str | None = None) -> tuple[list[Any], bytes] | None:
    """Results and code of a ready-made unit; None where there is none.

    Args:
        name: among ready-made objects; "" where it has none.
        target: by default that of this machine, unless ``DAP3D_CPU`` names another processor.
    """
    if target is None and not os.environ.get("DAP3D_CPU"):
        target = target_of(objects.processor().triple, objects.host_features())
    return _pack(target).read(name) if name and target else None
