"""LLVM IR of a program to that of the program and its derivatives, by forward differentiation.

Every float has a value, with the bits of the program alone, which decides branches, indices and
iterations, and its derivatives by some directions, here called slopes. Slopes follow the chain rule
one instruction at a time, so nothing need be known of what is computed: kernels of third parties,
factorisation, projection and step control alike. Where a function has no derivative, slopes are
zero where they would be infinite, and else those of the side that is computed.

Code may say what differentiation by instructions does not know (``with_slopes``,
``is_differentiated``, ``values_alone`` of intrinsics.py): these are lines with a remark.

One, three, seven and fifteen slopes fill a vector with the value; others are a vector of their own,
beside it (writers.py). Slopes are neither contracted nor reassociated: their bits depend on no
optimisation, and programs of a scene have those of general code.

The text is that of this compiler (writer.py, functions.py, trace.py), one instruction a line.
Source: A. Griewank, A. Walther, Evaluating Derivatives, 2nd ed., SIAM 2008, chapter 3.
"""

import re
from collections.abc import Iterator

from dap3d_core.kernels.compiler.derivatives.instructions import FILLING, PURE
from dap3d_core.kernels.compiler.derivatives.writers import BesideWriter, WithinWriter
from dap3d_core.kernels.compiler.lanes import rewritten

_DEFINED = re.compile(r"^(define .*\))([^()]*{)$", re.MULTILINE)


def differentiate(text: str, count: int) -> str:
    """A module of LLVM IR whose floats have ``count`` - 1 derivatives, in memory behind them.

    Args:
        text: of the module.
        count: numbers for each float.

    Raises:
        CompileError: it calls a function without a derivative.
    """
    declared = set(re.findall(r"^declare double @(\w[\w.]*)\(", text, re.MULTILINE))
    if count in FILLING:
        lines = list(rewritten(text, lambda external: WithinWriter(count, external)))
    else:
        lines = list(_beside(text, count - 1, declared))
    called = set(re.findall(r"call double @(\w[\w.]*)\(", "\n".join(lines)))
    for function in sorted(called - declared):
        takes = "double, double" if function == "pow" else "double"
        kind = "" if function.startswith("llvm.") else PURE
        lines.append(f"declare double @{function}({takes}){kind}")
    # only where there is a frame pointer does LLVM align vectors that it keeps on the stack
    return _DEFINED.sub(r'\1 "frame-pointer"="all"\2', "\n".join([*lines, ""]))


def _beside(text: str, lanes: int, external: set[str]) -> Iterator[str]:
    """The lines of a module with slopes beside values; external: as of ``Instructions``."""
    for part in re.split(r"^(?=define )", text, flags=re.MULTILINE):
        lines = part.splitlines()
        writer = BesideWriter(lanes, external, lines)
        for line in lines:
            yield from writer.lines(line)
