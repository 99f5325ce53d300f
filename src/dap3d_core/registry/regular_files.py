"""Reads regular files only, without waiting for a pipe or a device."""

import errno
import os
import stat

#: Names of special files, for messages.
_KINDS = {
    stat.S_IFIFO: "a pipe (FIFO)",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
#: Opens without waiting: files of the system, such as /proc/kmsg, may have nothing to give yet.
_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


def kind_of(mode: int) -> str:
    """The name of a special file by its mode of ``stat``: "a pipe (FIFO)"."""
    return _KINDS.get(stat.S_IFMT(mode), "something else")


def read_regular(path: str | os.PathLike[str], most: int | None = None) -> bytes:
    """The bytes of a regular file, at most ``most``, and at most its size when it is opened.

    Raises:
        OSError: it cannot be read, or is no regular file; ``strerror`` gives the reason.
    """
    status = os.stat(path)
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(status.st_mode):
        reason = f"it is no regular file but {kind_of(status.st_mode)}"
        raise OSError(errno.EINVAL, reason, str(path))
    size = status.st_size if most is None else min(most, status.st_size)
    with open(path, "rb", opener=lambda name, _: os.open(name, _FLAGS)) as file:
        return file.read(size)
