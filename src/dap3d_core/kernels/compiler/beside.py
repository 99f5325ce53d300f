"""The process that makes code well while another one runs it as it was made quickly.

It reads lines from its input: a file of LLVM IR, a tab, the object file to be made from it.
``python -m dap3d_core.kernels.compiler.beside``.
"""

import contextlib
import json
import os
import sys
from pathlib import Path

from dap3d_core.kernels.compiler.objects import GOOD, keep, object_of


def main() -> None:
    """Until the input ends."""
    if hasattr(os, "nice"):
        os.nice(5)
    for line in sys.stdin:
        path, target = map(Path, line.rstrip("\n").split("\t"))
        with contextlib.suppress(OSError, ValueError, RuntimeError):
            head, _, text = path.read_text(encoding="utf-8").partition("\n")
            if not target.exists():
                keep(target, json.loads(head), object_of(text, GOOD))
        with contextlib.suppress(OSError):
            path.unlink()


if __name__ == "__main__":
    main()
