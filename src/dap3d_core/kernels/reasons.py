"""Why numba did not compile a kernel, in one line: its own words go over a hundred."""

import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from dap3d_core.kernels.cache import reached

#: Lines that say where numba was, not what is wrong.
_ABOUT_ITSELF = re.compile(
    r"(\w+: )?Failed in |>>> |There are |- Of which|Overload |With argument|Rejected as|"
    r"raised from|During|File |No match|<source|\^|def "
)
_ERROR = re.compile(r"\w+(?:Error|Exception): (?!Failed in )(?P<words>.+)")
_FUNCTION = re.compile(r"Function\(<(?:built-in )?(?:function|method|class) '?([\w.]+)[^>]*>\)")


def why_not_compiled(error: BaseException, kernels: Iterable[Callable[..., Any]]) -> str:
    """Numba's reason, with the line of the author's file where it has one.

    Args:
        error: what numba raised.
        kernels: what was to be compiled. That one of them, or of the author's functions that they
            call, cannot be called is no reason: why not is said elsewhere.
    """
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    functions = reached(*kernels)[0]
    own = {f.__name__ for f in functions}
    files = dict.fromkeys(f.__code__.co_filename for f in functions)

    def is_about(line: str) -> bool:
        called = _FUNCTION.search(line)
        return not _ABOUT_ITSELF.match(line) and not (called and called[1].split(".")[-1] in own)

    found = [m["words"] for line in lines if (m := _ERROR.match(line))]
    found += [line for line in lines if is_about(line)]
    words = _FUNCTION.sub(r"\1", found[0]) if found else type(error).__name__
    words = words.removesuffix("Raised from None").removesuffix("found for signature:")
    return f"{words.strip(' .:')}{_place(str(error), files)}"


def _place(text: str, files: Iterable[str]) -> str:
    """The line of the author's that numba names."""
    for file in files:
        name = re.escape(Path(file).name)
        for pattern in (rf"{name} \((\d+)\)", rf'{name}", line (\d+)', rf"\b{name}:(\d+)"):
            if found := re.findall(pattern, text):
                return f" [{file}:{found[0]}]"
    return ""
