"""Files of the cache folder with a checksum at their end: what is damaged is made anew.

Compiled code runs without a look. A damaged file (power loss, a bad disk) would fail in every
process that loads it, crash it, or compute other numbers.
"""

import hashlib
import os
import warnings
from contextlib import suppress
from pathlib import Path

#: The last line of a file: a comment in Python, and what ``pickle`` no longer reads.
_SEAL = b"\n# sha256 %s\n"
_SEAL_SIZE = len(_SEAL % b"") + 64


def sealed(content: bytes) -> bytes:
    """Content with the line that holds its checksum."""
    return content + _SEAL % hashlib.sha256(content).hexdigest().encode()


def unsealed(data: bytes) -> bytes | None:
    """The content of what ``sealed`` gave; None where it is damaged."""
    content = data[:-_SEAL_SIZE]
    return content if sealed(content) == data else None


def sealed_content(path: str | os.PathLike[str]) -> bytes | None:
    """The content of a sealed file; None where there is none that can be used.

    A damaged file is removed, and a warning says so.
    """
    try:
        data = Path(path).read_bytes()
    except OSError:
        return None
    content = unsealed(data)
    if content is not None:
        return content
    with suppress(OSError):
        os.unlink(path)
    warnings.warn(
        f"compiled code was damaged and is made anew: {path}", RuntimeWarning, stacklevel=1
    )
    return None
