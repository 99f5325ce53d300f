"""Reads text files of models: regular files of limited size, in UTF-8."""

import stat
from pathlib import Path

from dap3d_core.registry.regular_files import read_regular
from dap3d_core.scene.errors import file_error

#: The first bytes of HDF5 files, and so of results.
HDF5 = b"\x89HDF"


def read_text(path: Path, largest: int, remedy: str = "save it as UTF-8") -> str:
    """The text of a file of at most ``largest`` bytes, without a byte order mark.

    Raises:
        SceneError: it is too large, no regular file or no text; ``remedy`` is for other encodings.
    """
    try:
        info = path.stat()
        if not stat.S_ISREG(info.st_mode):
            raise file_error(path, "is not a regular file")
        if info.st_size > largest:
            size, most = info.st_size / 2**20, largest >> 20
            what = f"has {size:.{0 if most > 1 else 1}f} MiB; at most {most} MiB are read"
            raise file_error(path, what, remedy="build a scene of this size with a script")
        data = read_regular(path, largest)
    except OSError as error:
        raise unreadable(path, error) from None
    if b"\0" in data:
        hint = "it may be a result: dap3d info describes it" if data.startswith(HDF5) else ""
        raise file_error(path, "is not a text file: it holds NUL bytes", remedy=hint)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        what = f"is not UTF-8 text: byte {error.object[error.start]:#04x} cannot be read"
        raise file_error(path, what, line=line, remedy=remedy) from None


def unreadable(path: Path, error: Exception) -> Exception:
    """The error for a file or folder that the system does not read."""
    reason = getattr(error, "strerror", None) or error
    return file_error(path, f"cannot be read: {reason}")
