"""Check that a folder is the user's alone: compiled code in it is loaded and run unchecked."""

import os
import stat
from pathlib import Path

#: The bits of a mode that let others write.
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def distrust(folder: Path) -> str:
    """Reason why others could put code into a folder; "" if only this user can.

    A trusted folder belongs to this user, nobody else may write to it, and no folder above it lets
    everybody rename its content. Where files have no owners (Windows), every folder is trusted.

    Raises:
        OSError: the folder cannot be examined.
    """
    if not hasattr(os, "geteuid"):
        return ""
    user = os.geteuid()
    for status in (folder.lstat(), folder.stat()):  # a link, and where it leads
        if status.st_uid != user:
            return f"it belongs to another user (uid {status.st_uid})"
    mode = stat.S_IMODE(folder.stat().st_mode)
    if mode & OTHERS_WRITE:
        return f"others may write to it (mode {mode:o}); chmod go-w makes it yours alone"
    for above in folder.resolve().parents:
        mode = above.stat().st_mode
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            return f"everybody may rename what is in {above}"
    return ""
