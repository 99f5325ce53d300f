"""Files of the cache folder with a checksum at their end: what is damaged is made anew.

Compiled code runs without a look. A damaged file (power loss, a bad disk) would fail in every
process that loads it, crash it, or compute other numbers.
"""

import hashlib
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache, IndexDataCacheFile

#: The last line of a file: a comment in Python, and what ``pickle`` no longer reads.
_SEAL = b"\n# sha256 %s\n"
_SEAL_SIZE = len(_SEAL % b"") + 64


def sealed(content: bytes) -> bytes:
    """Content with the line that holds its checksum."""
    return content + _SEAL % hashlib.sha256(content).hexdigest().encode()


def sealed_content(path: str | os.PathLike[str]) -> bytes | None:
    """The content of a sealed file; None where there is none that can be used.

    A damaged file is removed, and a warning says so.
    """
    try:
        data = Path(path).read_bytes()
    except OSError:
        return None
    content = data[:-_SEAL_SIZE]
    if sealed(content) == data:
        return content
    with suppress(OSError):
        os.unlink(path)
    warnings.warn(
        f"compiled code was damaged and is made anew: {path}", RuntimeWarning, stacklevel=1
    )
    return None


class SealedCache(FunctionCache):
    """numba's cache of a function, in sealed files; what cannot be written is not kept."""

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        locator = self._impl.locator
        self._cache_file = _SealedFiles(
            self._cache_path, self._impl.filename_base, locator.get_source_stamp()
        )

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep compiled code; on a full disk it serves this process alone."""
        with suppress(OSError):
            super().save_overload(signature, data)


class _SealedFiles(IndexDataCacheFile):
    def _load_index(self) -> dict[Any, str]:
        there = sealed_content(self._index_path) is not None
        return super()._load_index() if there else {}

    def _load_data(self, name: str) -> Any:
        if sealed_content(self._data_path(name)) is None:
            raise FileNotFoundError(name)  # as numba expects of a file that was removed
        return super()._load_data(name)

    @contextmanager
    def _open_for_write(self, path: str) -> Iterator[BytesIO]:
        content = BytesIO()
        yield content
        with super()._open_for_write(path) as file:
            file.write(sealed(content.getvalue()))
