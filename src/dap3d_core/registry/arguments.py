"""Checks arguments of public functions against the annotations of their parameters."""

import inspect
import os
import reprlib
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence, Set, Sized
from contextlib import suppress
from functools import wraps
from numbers import Integral, Real
from pathlib import Path
from types import ModuleType, NoneType, UnionType
from typing import Any, TypeVar, Union, Unpack, get_args, get_origin, get_type_hints

from dap3d_core.registry.suggestions import did_you_mean
from dap3d_core.settings import RunSettings

Function = TypeVar("Function", bound=Callable[..., Any])

#: Nouns of annotations in messages.
_NOUNS: dict[Any, str] = {
    bool: "True or False",
    int: "a whole number",
    float: "a number",
    str: "text",
    bytes: "bytes",
    NoneType: "None",
    os.PathLike: "a path",
    Path: "a path",
    Callable: "a function",
}
#: Settings of a run, whose values are checked with those of the scene.
SETTINGS = frozenset(get_type_hints(RunSettings)) | {"start"}
#: Functions that make an object of a class from a name or a path.
_READERS = {"Result": "dap.open", "Scene": "dap.load", "CompiledModel": "dap.compile"}


def make_callable(module: str, function: Callable[..., Any]) -> None:
    """Let a module be called as the function of its name: ``dap3d_core`` has one name for both."""

    def call(_: ModuleType, *arguments: Any, **options: Any) -> Any:
        return function(*arguments, **options)

    sys.modules[module].__class__ = type("CallableModule", (ModuleType,), {"__call__": call})


def checked(function: Function) -> Function:
    """Decorator of a public function: refuses arguments of kinds that its annotations exclude.

    Numbers of numpy become Python's; text and truth values are no numbers, and text is no list. In
    place of several names one list of them may be given.
    ``SETTINGS`` are left to the function, and annotations that are known to type checkers alone.
    """
    signature = _with_settings(inspect.signature(function))
    kinds: dict[str, Any] = dict.fromkeys(SETTINGS, Any)

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        bound = None
        with suppress(TypeError):
            bound = signature.bind(*args, **kwargs)
        if bound is None:
            _refuse_unknown(function, signature, kwargs)
            return function(*args, **kwargs)  # Python's own message names the function
        given = bound.arguments
        for name in given:
            parameter = signature.parameters[name]
            if parameter.kind is parameter.VAR_POSITIONAL:
                given[name] = _several(name, parameter.annotation, given[name])
                continue
            value = given[name] = _python_number(given[name])
            if value is parameter.default:
                continue
            if name not in kinds:
                kinds[name] = _annotation(function, parameter)
            if not _fits(kinds[name], value):
                raise TypeError(_fault(name, kinds[name], value))
        return function(*bound.args, **bound.kwargs)

    call.__signature__ = signature  # type: ignore[attr-defined]
    return call  # type: ignore[return-value]


def _with_settings(signature: inspect.Signature) -> inspect.Signature:
    """A signature with the settings that ``**settings: Unpack[...]`` stands for, one by one."""
    given = list(signature.parameters.values())
    last = given[-1:]
    if not last or get_origin(last[0].annotation) is not Unpack:
        return signature
    hints = get_type_hints(get_args(last[0].annotation)[0])
    keyword = inspect.Parameter.KEYWORD_ONLY
    settings = [inspect.Parameter(n, keyword, default=None, annotation=h) for n, h in hints.items()]
    return signature.replace(parameters=given[:-1] + settings)


def _refuse_unknown(
    function: Callable[..., Any], signature: inspect.Signature, given: Mapping[str, Any]
) -> None:
    """Refuse an argument that there is none of, as Python words it: with the nearest, or all."""
    for name in given.keys() - signature.parameters.keys():
        words = f"{function.__name__}() got an unexpected keyword argument {name!r}"
        known = f"it takes {', '.join(signature.parameters)}"
        raise TypeError(f"{words}; {did_you_mean(name, signature.parameters, otherwise=known)}")


def require(name: str, kind: Any, value: Any) -> None:
    """Refuse an argument that is of no kind, where the annotation says less than is known.

    Raises:
        TypeError: as of ``checked``.
    """
    if not _fits(kind, value):
        raise TypeError(_fault(name, kind, value))


def _several(name: str, kind: Any, values: tuple[Any, ...]) -> tuple[Any, ...]:
    """Names one by one, or as one list of them."""
    if kind not in (str, "str"):
        return values
    if len(values) == 1 and _is_list(values[0]):
        values = tuple(values[0])
    for value in values:
        if not isinstance(value, str):
            raise TypeError(f"the argument {name} should be names, not {_shown(value)}")
    return values


def _annotation(function: Callable[..., Any], parameter: inspect.Parameter) -> Any:
    """The kinds of a parameter; ``Any`` where they are unknown at run time."""
    kind = parameter.annotation
    if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
        return Any
    if isinstance(kind, str):
        try:
            kind = eval(kind, function.__globals__, _PublicNames())  # of our own sources
        except (NameError, TypeError):
            return Any
    return Any if kind is parameter.empty else kind


class _PublicNames(dict[str, Any]):
    """Public names of dap3d, which some modules import for type checkers alone."""

    def __missing__(self, name: str) -> Any:
        package = sys.modules["dap3d_core"]
        if name not in package.__all__:
            raise KeyError(name)
        return getattr(package, name)


def _members(kind: Any) -> Iterator[Any]:
    """The members of a union; the kind itself where it is none."""
    if get_origin(kind) in (Union, UnionType):
        yield from get_args(kind)
    else:
        yield NoneType if kind is None else kind


def _fits(kind: Any, value: Any) -> bool:
    return any(_is_a(one, value) for one in _members(kind))


def _is_a(kind: Any, value: Any) -> bool:
    if kind in (bool, int, float):
        return _is_number(kind, value)
    origin, arguments = get_origin(kind) or kind, get_args(kind)
    if origin is Callable:
        return callable(value)
    if origin is Mapping:
        # Values are judged by the function, which names their keys.
        return isinstance(value, Mapping) and all(_fits(arguments[0], key) for key in value)
    if origin is tuple and Ellipsis not in arguments:
        return (
            _is_list(value) and len(value) == len(arguments) and all(map(_fits, arguments, value))
        )
    if origin in (Sequence, Collection, tuple):
        is_list = _is_list(value) or (origin is Collection and isinstance(value, (set, frozenset)))
        return is_list and all(_fits(arguments[0], one) for one in value)
    if not isinstance(origin, type):
        return True
    try:
        return isinstance(value, origin)
    except TypeError:  # a protocol
        return True


def _is_list(value: Any) -> bool:
    """True for several values in an order: lists, tuples, arrays, keys of a dictionary."""
    if isinstance(value, (str, bytes, Mapping, set, frozenset)) or not isinstance(value, Sized):
        return False
    return isinstance(value, (Sequence, Set)) or bool(getattr(value, "shape", ()))


def _python_number(value: Any) -> Any:
    """A number or truth value of numpy, also as an array without dimensions, as Python's."""
    dtype = getattr(value, "dtype", None)
    is_number = getattr(dtype, "kind", "") in tuple("biuf") and value.shape == ()
    return value.item() if is_number and not getattr(value, "mask", False) else value


def _is_number(kind: type, value: Any) -> bool:
    """True for a Python number; truth values are none but of their own kind."""
    if kind is bool or isinstance(value, bool):
        return kind is bool and isinstance(value, bool)
    return isinstance(value, Integral if kind is int else Real)


def _fault(name: str, kind: Any, value: Any) -> str:
    """The message: the allowed kinds, what was given, and the remedy where one is known."""
    members = list(_members(kind))
    nouns = list(dict.fromkeys(_noun(one) for one in members))
    allowed = " or ".join(filter(None, [", ".join(nouns[:-1]), nouns[-1]]))
    words = f"the argument {name} should be {allowed}, not {_shown(value)}"
    lists = [one for one in members if get_origin(one) in (Sequence, Collection)]
    if lists and _fits(get_args(lists[0])[0], value):
        return f"{words}; write [{_example(value)}] for a single one"
    if isinstance(value, (str, os.PathLike)):
        for one in members:
            if reader := _READERS.get(getattr(one, "__name__", "")):
                return f"{words}; {reader}({_shown(value)}) makes one"
    return words


def _noun(kind: Any) -> str:
    origin, arguments = get_origin(kind) or kind, get_args(kind)
    if noun := _NOUNS.get(origin):
        return noun
    if origin in (Sequence, Collection, tuple):
        plural = {str: "names", float: "numbers", int: "whole numbers"}
        count = f"{len(arguments)} " if origin is tuple else ""
        return f"a list of {count}{plural.get(arguments[0]) or _noun(arguments[0])}"
    if origin is Mapping:
        return "a dictionary"
    name = getattr(origin, "__name__", str(origin))
    return f"dap.{name}" if name in _PUBLIC else _with_article(name)


#: Classes that users make by this name.
_PUBLIC = ("Event", "Controller", "Scene", "Parameter")


def _example(value: Any) -> str:
    return repr(value) if isinstance(value, (str, Real)) else type(value).__name__.lower()


def _shown(value: Any) -> str:
    """A value in a message: numbers and text as written, objects by their class."""
    if value is None or isinstance(value, (str, bytes, Real)):
        return reprlib.repr(value)
    if isinstance(value, type):
        return f"the class {value.__name__}"
    if isinstance(value, (list, tuple, dict, set, os.PathLike)):
        return reprlib.repr(value)
    return _with_article(type(value).__name__)


def _with_article(name: str) -> str:
    return f"{'an' if name[:1] in 'AEIOUaeiou' else 'a'} {name}"
