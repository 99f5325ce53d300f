"""One plugin, loaded in a guard of its own: what goes wrong in it is a ``PluginError``."""

import contextlib
import hashlib
import importlib
import inspect
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator
from importlib.util import spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import pluggy

from dap3d_core.interface import INTERFACE_VERSION, PluginError, hooks
from dap3d_core.interface.codegen.examined import Examined
from dap3d_core.interface.errors import where_is
from dap3d_core.interface.examine.examine import examine
from dap3d_core.interface.hooks import GROUPS
from dap3d_core.interface.types import KINDS, TypeBase
from dap3d_core.registry.discovery import BLOCK_VARIABLE, Source
from dap3d_core.registry.regular_files import read_regular
from dap3d_core.registry.suggestions import nearest
from dap3d_core.registry.time_limit import OverdueError, within

#: Plugins are loaded one at a time: the guard holds things that belong to the whole process.
_one_at_a_time = threading.RLock()


def load(
    source: Source, notes: list[str], limit_s: float | None = None, given_up: str = ""
) -> Examined:
    """Import a plugin and examine the type that its entry point names.

    Args:
        source: where the type comes from.
        notes: what the plugin changed in the process, and was put back, is told here.
        limit_s: how long that may take; None for as long as it takes.
        given_up: after how long another plugin of its package was given up; it is not waited for
            again.

    Raises:
        PluginError: names distribution, module or file, reason and remedy.
    """
    if limit_s is not None:
        importlib.import_module("dap3d_core.kernels")  # what all of them import is not their time
    with _guard(source, notes), within(limit_s):
        if source.fault:
            raise PluginError(source.fault)
        if given_up and limit_s is not None:
            raise PluginError(f"its package was not loaded after {given_up}")
        type_ = source.type
        if type_ is None:
            module = importlib.import_module(source.module)
            types = types_of(module, (source.kind,))[source.kind]
            type_ = _with_keyword(source, types)
        return examine(type_)


def compile_kernels(source: Source, examined: Examined, notes: list[str]) -> None:
    """Compile all kernels of a type that was loaded, as a run would those that its scene needs.

    Raises:
        PluginError: one cannot be compiled; names distribution, module, reason and remedy.
    """
    # here, for finding types by keyword does not need the compiler
    from dap3d_core.interface.codegen.compile_loops import compile_all

    with _guard(source, notes):
        compile_all(examined)


def load_file(path: Path, notes: list[str]) -> list[Source]:
    """Import a model's own Python file and return the types it brings, one source each.

    The file is imported under a name made from its path and contents, so that two models never
    share one, and nothing is written beside it.

    Raises:
        PluginError: names file, reason and remedy.
    """
    with _guard(Source("", "", str(path)), notes):
        module = _module_of(path)
        types = types_of(module, tuple(GROUPS))
        found = [(kind, type_) for kind in GROUPS for type_ in types[kind]]
        if not found:
            raise PluginError("it brings no type; return at least one class from a hook")
        return [Source(kind, type_.keyword, str(path), type=type_) for kind, type_ in found]


def types_of(module: ModuleType, kinds: tuple[str, ...]) -> dict[str, list[type[TypeBase]]]:
    """The types that a plugin module returns from its hooks.

    Args:
        module: the plugin.
        kinds: joint, force, function: which hooks to call. Where one is asked for, it must exist.

    Raises:
        PluginError: wrong interface version, hook missing, unknown or of wrong signature, or it
            returns something else than a list of classes.
    """
    _check_version(module)
    manager = pluggy.PluginManager(hooks.PROJECT)
    manager.add_hookspecs(hooks)
    manager.register(module)
    manager.check_pending()
    return {kind: _call_hook(manager, kind, must_exist=len(kinds) == 1) for kind in kinds}


def _check_version(module: ModuleType) -> None:
    version = getattr(module, "interface_version", None)
    if type(version) is not int:
        said = "says no interface_version" if version is None else f"says {version!r}"
        raise PluginError(
            f"it {said}; write the line interface_version = {INTERFACE_VERSION} (an integer) in it"
        )
    if version > INTERFACE_VERSION:
        raise PluginError(
            f"it is written for interface version {version}, this dap3d has {INTERFACE_VERSION}; "
            "install a newer dap3d"
        )
    if version < INTERFACE_VERSION:
        raise PluginError(
            f"it is written for interface version {version}, this dap3d has {INTERFACE_VERSION}; "
            "install a newer version of the plugin"
        )


def _call_hook(
    manager: pluggy.PluginManager, kind: str, *, must_exist: bool
) -> list[type[TypeBase]]:
    base, hook = KINDS[kind], GROUPS[kind][1]
    caller = getattr(manager.hook, hook)
    if not caller.get_hookimpls():
        if must_exist:
            raise PluginError(
                f"it has no hook for a {kind}; write @hookimpl above def {hook}(), "
                "which returns a list of classes"
            )
        return []
    found: list[type[TypeBase]] = []
    answers = caller()
    for answer in answers or [None]:
        if not isinstance(answer, (list, tuple)):
            raise PluginError(f"{hook}() should return a list of classes; it returned {answer!r}")
        for type_ in answer:
            if not (inspect.isclass(type_) and issubclass(type_, base)):
                raise PluginError(
                    f"{hook}() should return subclasses of {base.__name__}; "
                    f"it returned {type_!r} among them"
                )
            if not isinstance(type_.keyword, str) or not type_.keyword:
                raise PluginError(
                    f'{where_is(type_)} has no keyword; add keyword = "...", without a type '
                    "behind the name"
                )
            found.append(type_)
    return found


def _with_keyword(source: Source, types: list[type[TypeBase]]) -> type[TypeBase]:
    matching = [t for t in types if t.keyword == source.keyword]
    if len(matching) == 1:
        return matching[0]
    if matching:
        names = " and ".join(t.__name__ for t in matching)
        raise PluginError(f"its classes {names} have the same keyword {source.keyword!r}")
    words = [t.keyword for t in types]
    near = nearest(source.keyword, words)
    raise PluginError(
        f"it has no class with the keyword {source.keyword!r} that its entry point names"
        + (f"; did you mean {near!r}?" if near else f"; its keywords: {', '.join(words) or '-'}")
    )


def _module_of(path: Path) -> ModuleType:
    """Run a file as a module whose source ``inspect`` finds; one module for a path and contents."""
    try:
        text = read_regular(path)
    except OSError as error:
        raise PluginError(f"it cannot be read: {error.strerror}") from error
    path = path.resolve()
    seal = hashlib.sha256(os.fsencode(path) + b"\0" + text).hexdigest()[:16]
    name = f"dap3d_model_{seal}"
    if name in sys.modules:
        return sys.modules[name]
    module = ModuleType(name)
    module.__file__ = str(path)
    module.__spec__ = spec_from_file_location(name, path)
    sys.modules[name] = module
    try:
        # The user asked for this file by --allow-code; no bytecode is left beside it.
        exec(compile(text, str(path), "exec", dont_inherit=True), vars(module))
    except BaseException:
        del sys.modules[name]
        raise
    return module


@contextlib.contextmanager
def _guard(source: Source, notes: list[str]) -> Iterator[None]:
    """Turn every failure of a plugin into a PluginError that names it, with a remedy.

    Ctrl-C stays what it is, and says what it interrupted.
    """
    folder = os.getcwd()  # that it may be gone is no failure of the plugin's
    try:
        with _one_at_a_time, _kept_in_place(source, folder, notes):
            yield
    except KeyboardInterrupt as error:
        raise KeyboardInterrupt(f"while {_title(source)} was loaded") from error
    except OverdueError as error:
        reason = f"it is not loaded after {error}{_line_of(error)}"
        raise PluginError(f"{_title(source)}: {reason}. {_remedy(source)}") from error
    except PluginError as error:
        raise PluginError(f"{_title(source)}: {error}. {_remedy(source)}") from error
    except pluggy.PluginValidationError as error:
        raise PluginError(
            f"{_title(source)}: wrong hook: {' '.join(str(error).split())}. {_remedy(source)}"
        ) from error
    except BaseException as error:  # SystemExit too: a plugin does not end the program
        raise PluginError(f"{_title(source)}: {_reason(error)}. {_remedy(source)}") from error


@contextlib.contextmanager
def _kept_in_place(source: Source, folder: str, notes: list[str]) -> Iterator[None]:
    """Put back what a plugin must not change: stdout, the current folder, Ctrl-C, numpy's errors.

    Where modules are looked for is left as the plugin wants it, and told. A copy of the process
    that it forked and left running ends here: both would go on with the command.
    """
    process, places = os.getpid(), list(sys.path)
    interrupt = signal.getsignal(signal.SIGINT)
    numpy: Any = sys.modules.get("numpy")
    state: dict[str, Any] = numpy.geterr() if numpy else {}
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        if os.getpid() != process:
            print(
                f"{source}: forked while it was loaded; the copy ends", file=sys.stderr, flush=True
            )
            os._exit(1)
        first = threading.current_thread() is threading.main_thread()  # the others may not
        if first and interrupt and signal.getsignal(signal.SIGINT) is not interrupt:
            signal.signal(signal.SIGINT, interrupt)
            notes.append(f"{source}: changed what Ctrl-C does while it was loaded; put back")
        if sys.path != places:
            notes.append(f"{source}: changed sys.path while it was loaded; it was left so")
        if os.getcwd() != folder:
            os.chdir(folder)
            notes.append(f"{source}: changed the working folder while it was loaded; put back")
        if numpy and numpy.geterr() != state:
            numpy.seterr(**state)
            notes.append(f"{source}: changed numpy's error state while it was loaded; put back")


def _title(source: Source) -> str:
    if not source.distribution:
        return f"the model's own file {source.module}"
    return f"{source.kind} type {source.keyword!r} of {source}"


def _remedy(source: Source) -> str:
    if not source.distribution:
        return "Repair the file"
    name = source.distribution
    leaving = f"{BLOCK_VARIABLE}={name}:{source.keyword}"
    return f"Repair, update or uninstall {name}, or leave this type out with {leaving}"


def _reason(error: BaseException) -> str:
    """An exception in one line: type, words, and the line of the plugin where it arose."""
    words = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    if isinstance(error, SyntaxError):
        return f"{words} [{error.filename}:{error.lineno}]"
    return words + _line_of(error)


def _line_of(error: BaseException) -> str:
    """The line of the plugin where an exception arose, in brackets."""
    here = [Path(__file__).parent, Path(contextlib.__file__).parent]
    frames = traceback.extract_tb(error.__traceback__)
    outside = [f for f in frames if not any(Path(f.filename).is_relative_to(h) for h in here)]
    outside = [f for f in outside if not f.filename.startswith("<frozen")]
    return f" [{outside[-1].filename}:{outside[-1].lineno}]" if outside else ""
