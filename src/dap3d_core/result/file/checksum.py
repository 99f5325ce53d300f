"""A seal behind the end of a result file: checksums, compared before a library reads it.

HDF5 reads damaged files as it can: it may crash on them, or never end. Bytes behind the end that
its own header names it passes over, so that other programs read a sealed file as any other; one
that changes the file cuts them off.
"""

import struct
import zlib
from pathlib import Path
from typing import BinaryIO, NamedTuple

from dap3d_core.result.errors import ResultError
from dap3d_core.result.file.atomic_write import beginning, cannot

#: Of files with more bytes the rows are not compared, only what describes them.
WHOLE = 2**30

#: HDF5's header in the form that the NetCDF library writes: its size, and where it names the end of
#: the file. It has a checksum of its own, and changes when a growing file is closed.
_HEADER, _END = 48, slice(28, 36)
_FORMS = (2, 3)
_PIECE = 2**20


class Seal(NamedTuple):
    """What a seal says.

    Attributes:
        magic: the word by which it is known.
        is_whole: whether ``whole`` is known; it is not while the file grows.
        head: checksum of what describes the file, from HDF5's header to the rows.
        rows: where the rows begin, bytes.
        size: of the file without the seal, bytes.
        whole: checksum of all of it.
        own: checksum of the seal up to here.
    """

    magic: bytes
    is_whole: int
    head: int
    rows: int
    size: int
    whole: int
    own: int


_MAGIC = b"dap3dsum"
_LAYOUT = struct.Struct("<8sIIQQII")


def write_seal(file: Path, rows: int, *, is_whole: bool) -> None:
    """Seal a file.

    Args:
        file: one that is complete, or one that grows and whose rows have their places.
        rows: where they begin, bytes: of a file beyond ``WHOLE`` what lies before is compared.
        is_whole: whether it is complete.

    Raises:
        OSError: the system refuses.
    """
    with file.open("rb+") as stream:
        size = stream.seek(0, 2)
        rows = min(rows, size)
        head = _checksum(stream, _HEADER, rows)
        whole = _checksum(stream, 0, size) if is_whole else 0
        said = _LAYOUT.pack(_MAGIC, is_whole, head, rows, size, whole, 0)[:-4]
        stream.seek(size)
        stream.write(said + struct.pack("<I", zlib.crc32(said)))


def check_seal(file: Path) -> None:
    """Whether a file is as it was sealed. One without a seal, of an older program, passes.

    Args:
        file: has the signature of HDF5.

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
                fault = _broken(stream, end, size - len(end))
            else:
                fault = _unsealed(begin, size)
    except OSError as error:
        raise cannot("read", file, error) from error
    if fault:
        raise ResultError(f"cannot read {file}: {fault}; take another copy of it, or run again")


def _broken(stream: BinaryIO, end: bytes, size: int) -> str:
    """What is wrong with a sealed file, in words."""
    seal = Seal._make(_LAYOUT.unpack(end))
    same = zlib.crc32(end[:-4]) == seal.own and seal.size == size
    if same and seal.is_whole and size <= WHOLE:
        same = _checksum(stream, 0, size) == seal.whole
    elif same:
        same = _checksum(stream, _HEADER, seal.rows) == seal.head
    return "" if same else "it is damaged: its checksum is not the one it was written with"


def _unsealed(begin: bytes, size: int) -> str:
    """What is wrong with the size of a file that ends without a seal, in words."""
    if len(begin) < _HEADER:
        return f"it is cut off: only {size} bytes are there"
    if begin[8] not in _FORMS:
        return ""  # another program wrote it, or HDF5 will say that its header is damaged
    named = int.from_bytes(begin[_END], "little")
    if size == named:
        return ""
    if size < named + _LAYOUT.size:
        return f"it is cut off, or damaged: {size} of {named + _LAYOUT.size} bytes are there"
    return f"it is damaged: the {size - named} bytes behind its end are not those that dap3d writes"


def _checksum(stream: BinaryIO, first: int, last: int) -> int:
    """The checksum (CRC-32) of some bytes of a file, as many as there are of them."""
    stream.seek(first)
    found, left = 0, last - first
    while left > 0 and (piece := stream.read(min(left, _PIECE))):
        found = zlib.crc32(piece, found)
        left -= len(piece)
    return found
