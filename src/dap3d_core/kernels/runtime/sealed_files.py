"""Files of the cache folder with a checksum at their end: a damaged file is made anew.

A damaged file of compiled code (power loss, a bad disk) would fail in every process that loads it,
crash it, or compute other numbers.
"""

import hashlib
import os
import warnings
from contextlib import suppress
from pathlib import Path

#: The last line of a file: a comment in Python.
_SEAL = b"\n# sha256 %s\n"
_SEAL_SIZE = len(_SEAL % b"") + 64


def sealed(content: bytes) -> bytes:
    """Content followed by a line with its checksum."""
    return content + _SEAL % hashlib.sha256(content).hexdigest().encode()


def unsealed(data: bytes) -> bytes | None:
    """The content of sealed data; None where it is damaged."""
    content = data[:-_SEAL_SIZE]
    return content if sealed(content) == data else None


def sealed_content(path: str | os.PathLike[str]) -> bytes | None:
    """The content of a sealed file; None where there is none that can be used.

    A damaged file is removed with a warning.
    """
    try:
        data = Path(path).read_bytes()
    except OSError:
        return None
    content = unsealed(data)
    if content is None:
        with suppress(OSError):
            os.unlink(path)
        warnings.warn(
            f"compiled code was damaged and is made anew: {path}", RuntimeWarning, stacklevel=1
        )
    return content


def replace_file(path: Path, data: bytes) -> None:
    """Write a complete file, or none: under another name, then renamed, as processes may race.

    A link is replaced, never followed. No name is longer than a file system takes: of that of the
    file 40 characters are kept, the last ones.

    Raises:
        OSError: the system refuses.
    """
    temporary = path.with_name(f".{path.name[-40:]}.{os.urandom(16).hex()}")
    try:
        with temporary.open("xb") as file:
            file.write(data)
        os.replace(temporary, path)
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_file(path: Path, data: bytes) -> bool:
    """As ``replace_file``; False where the system refuses."""
    try:
        replace_file(path, data)
    except OSError:
        return False
    return True
