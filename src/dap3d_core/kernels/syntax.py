"""Python's parser, one thread at a time."""

import ast
import threading
import warnings
from typing import Any

#: Held while a text is parsed: Python 3.11 and 3.12 count the depth of all threads in one number,
#: and two of them at once may end with a SystemError (python/cpython#106905).
_parsing = threading.RLock()


def parse(source: str | bytes, mode: str = "exec") -> Any:
    """The syntax tree of a text as of ``ast.parse``, without its warnings, such as for "1if"."""
    with _parsing, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return ast.parse(source, mode=mode)
