"""Checksums at the end of a file, compared before a library reads it.

HDF5 may crash or never end on damaged files. It ignores bytes behind the end that its own header
states, so that other programs read such a file as any other; one that changes it cuts them off.
"""

import struct
import zlib
from pathlib import Path
from typing import BinaryIO

from dap3d_core.result.errors import ResultError
from dap3d_core.result.file.atomic_write import beginning, cannot, check_utf8

#: Of files with more bytes only the description is compared, not the rows.
WHOLE = 2**30

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: HDF5's header in the form that the NetCDF library writes: its size, and the bytes that state the
#: end of the file. It has a checksum of its own, and changes when a growing file is closed.
_HEADER, _END = 48, slice(28, 36)
_FORMS = (2, 3)
_PIECE = 2**20

#: The trailer, the last bytes of a file: this keyword; 1 if the checksum of all is known, 0 while
#: the file grows; checksum of the description, from HDF5's header to the rows; offset of the rows;
#: bytes of the file without the trailer; checksum of all of it; checksum of the trailer up to here.
_MAGIC = b"dap3dsum"
_LAYOUT = struct.Struct("<8sIIQQII")


def check_signature(file: Path, kind: str = "result") -> None:
    """Refuses a file without the signature of HDF5.

    kind: what was expected, for the error.

    Raises:
        ResultError: there is no such file, it cannot be read, or is of another format.
    """
    check_utf8("read", file)
    begin = beginning(file, len(_SIGNATURE))
    if begin != _SIGNATURE:
        fault = "it is not a NetCDF-4 file" if begin else "the file is empty"
        remedies = {
            ".checkpoint": f"; to continue the run of a checkpoint: dap3d resume {file}",
            ".toml": f"; to simulate a scene: dap3d run {file}",
        }
        hint = remedies.get(file.suffix, "")
        raise ResultError(f"cannot read {file}: {fault}, so no {kind} of dap3d{hint}")


def write_checksums(file: Path, rows: int, *, is_whole: bool) -> None:
    """Appends the trailer to a file.

    Args:
        file: complete, or growing with all its rows allocated.
        rows: their offset, bytes: of a file beyond ``WHOLE`` what lies before is compared.
        is_whole: True if it is complete.

    Raises:
        OSError: the system refuses.
    """
    with file.open("rb+") as stream:
        size = stream.seek(0, 2)
        rows = min(rows, size)
        head = _checksum(stream, _HEADER, rows)
        whole = _checksum(stream, 0, size) if is_whole else 0
        trailer = _LAYOUT.pack(_MAGIC, is_whole, head, rows, size, whole, 0)[:-4]
        stream.seek(size)
        stream.write(trailer + struct.pack("<I", zlib.crc32(trailer)))


def check_checksums(file: Path) -> None:
    """Refuses a file that differs from its checksums. Older files without a trailer pass.

    Raises:
        ResultError: it is cut off or damaged, or the system refuses.
    """
    begin = beginning(file, _HEADER)
    try:
        with file.open("rb") as stream:
            size = stream.seek(0, 2)
            stream.seek(max(0, size - _LAYOUT.size))
            end = stream.read()
            if end.startswith(_MAGIC):
                fault = _mismatch(stream, end, size - len(end))
            else:
                fault = _wrong_size(begin, size)
    except OSError as error:
        raise cannot("read", file, error) from error
    if fault:
        raise ResultError(f"cannot read {file}: {fault}; take another copy of it, or run again")


def _mismatch(stream: BinaryIO, end: bytes, size: int) -> str:
    """The fault of a file with a trailer, or ""."""
    _, is_whole, head, rows, stated, whole, own = _LAYOUT.unpack(end)
    same = bool(zlib.crc32(end[:-4]) == own and stated == size)
    if same and is_whole and size <= WHOLE:
        same = _checksum(stream, 0, size) == whole
    elif same:
        same = _checksum(stream, _HEADER, rows) == head
    return "" if same else "it is damaged: its checksum is not the one it was written with"


def _wrong_size(begin: bytes, size: int) -> str:
    """The fault of a file without a trailer, or ""."""
    if len(begin) < _HEADER:
        return f"it is cut off: only {size} bytes are there"
    if begin[8] not in _FORMS:
        return ""  # another program wrote it, or HDF5 reports a damaged header
    stated = int.from_bytes(begin[_END], "little")
    if size == stated:
        return ""
    if size < stated + _LAYOUT.size:
        return f"it is cut off, or damaged: {size} of {stated + _LAYOUT.size} bytes are there"
    return f"it is damaged: the {size - stated} bytes behind its end are not those of dap3d"


def _checksum(stream: BinaryIO, first: int, last: int) -> int:
    """CRC-32 of bytes ``first`` to ``last`` of a file, as far as they exist."""
    stream.seek(first)
    value, left = 0, last - first
    while left > 0 and (piece := stream.read(min(left, _PIECE))):
        value = zlib.crc32(piece, value)
        left -= len(piece)
    return value
