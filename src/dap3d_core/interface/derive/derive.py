"""Derives missing formulas of a type from the given ones.

A joint that defines ``C`` (and ``C_dot`` for the rows of the velocity level) gets ``J``, ``gamma``
and ``nu``, a force that defines ``energy`` its ``wrench``, one whose ``impulse`` names ``Jv`` its
``J`` of ``switch``, a function that returns f alone its derivatives. Formulas written by hand are
used unchanged. The derived kernels are a module in the cache folder, named by a digest of the
type's sources: sympy is needed for the first use only.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from dap3d_core.interface.codegen.instance_layout import InstanceLayout
from dap3d_core.interface.codegen.kernel_arguments import KernelArgument, parameters
from dap3d_core.interface.types import Joint, TypeBase

Kernel = Callable[..., Any]

#: Kernels from which others are derived.
GIVEN = {"joint": ("C", "C_dot"), "force": ("energy", "switch"), "function": ("value",)}


class CannotDeriveError(ValueError):
    """A formula is missing and cannot be derived; gives reason and remedy."""


def missing(type_: type[TypeBase], gives_one_number: bool = False) -> tuple[str, ...]:
    """The kernels to be derived.

    Args:
        type_: the type.
        gives_one_number: the ``value`` of a function returns f alone.
    """
    defined = type_.kernels()
    if issubclass(type_, Joint):
        by_unknowns = ("G",) if type_.unknowns and "G" not in defined and "C" in defined else ()
        if {"J", "gamma"} <= set(defined) or not {"C", "C_dot"} & set(defined):
            return by_unknowns
        return (*by_unknowns, *(n for n in ("J", "gamma", "nu") if n not in defined))
    if type_.kind == "force":
        wanted = ("wrench",) if "energy" in defined and "wrench" not in defined else ()
        has_rates = "Jv" in parameters(defined["impulse"]) if "impulse" in defined else False
        return (*wanted, "J") if has_rates and "J" not in defined else wanted
    return ("value",) if gives_one_number else ()


def derive(
    type_: type[TypeBase],
    layout: InstanceLayout,
    names: Mapping[str, KernelArgument],
    wanted: tuple[str, ...],
) -> dict[str, Kernel]:
    """The wanted kernels (``missing``), by name; ``nu`` only where it is not zero.

    Raises:
        CannotDeriveError: gives reason and remedy.
    """
    # imported here: finding types by keyword does not need the compiler
    from dap3d_core.kernels.runtime import generated_modules
    from dap3d_core.kernels.runtime.source_digest import digest, identities, sources

    given = {n: k for n, k in type_.kernels().items() if n in _given_of(type_.kind, wanted)}
    offered, here = [repr(q) for q in names.values()], Path(__file__)
    how = [path.read_bytes() for path in sorted(here.parent.glob("*.py"))]
    kernels = given.values()
    key = digest(*wanted, *offered, *how, *identities(*kernels), *sources(*kernels))
    name = f"derived-{key}"
    text = generated_modules.kept(name)
    if text is None:
        text = _text(type_, given, layout, names, wanted)
    path = generated_modules.write(name, text)
    namespace = generated_modules.load(path, name, text)
    return {n: namespace[n] for n in wanted if n in namespace}


def _text(
    type_: type[TypeBase],
    given: Mapping[str, Kernel],
    layout: InstanceLayout,
    names: Mapping[str, KernelArgument],
    wanted: tuple[str, ...],
) -> str:
    """The source of the module of derived kernels."""
    try:
        from dap3d_core.interface.derive import kernel_printer, symbolic
    except ImportError as error:
        raise CannotDeriveError(
            f"it leaves {', '.join(wanted)} to be derived from {', '.join(given)}, which needs "
            "sympy; install it with: pip install sympy"
        ) from error
    symbols = symbolic.Symbols(names, layout.slots)
    try:
        if issubclass(type_, Joint):
            C, C_dot = given.get("C"), given.get("C_dot")
            found, steps = symbolic.derive_joint(
                C, C_dot, type_.position_rows(), type_.rows, symbols, layout.unknowns
            )
        elif type_.kind == "force":
            found, steps = _of_force(symbolic, given, wanted, symbols)
        else:
            count = type_.arguments  # type: ignore[attr-defined]
            found, steps = symbolic.derive_value(given["value"], symbols, count)
        if all(x == 0 for x in symbolic.flat(found.get("nu", 0))):
            found.pop("nu", None)
        parts = [kernel_printer.kernel_source(n, found[n], steps, symbols, names)
                 for n in wanted if n in found]  # fmt: skip
    except symbolic.DerivationError as error:
        raise CannotDeriveError(str(error)) from error
    words = sorted(set().union(*(used for _, used in parts)))
    title = f'"""{", ".join(wanted)} of {type_.keyword}, derived from {", ".join(given)}."""\n'
    imports = f"\nfrom dap3d_core.kernels import {', '.join(words)}\n" if words else ""
    return title + imports + "".join(f"\n\n{source}" for source, _ in parts)


def _given_of(kind: str, wanted: tuple[str, ...]) -> tuple[str, ...]:
    """The kernels from which these are derived."""
    if kind != "force":
        return GIVEN[kind]
    return tuple(given for given, name in zip(GIVEN[kind], ("wrench", "J"), strict=True)
                 if name in wanted)  # fmt: skip


def _of_force(
    symbolic: Any, given: Mapping[str, Kernel], wanted: tuple[str, ...], symbols: Any
) -> tuple[dict[str, Any], Any]:
    """Wrench and rows of a force, as far as wanted, with their steps."""
    found: dict[str, Any] = {}
    steps: dict[Any, Any] = {}
    if "wrench" in wanted:
        found, steps = symbolic.derive_wrench(given["energy"], symbols)
    if "J" in wanted:
        if "switch" not in given:
            raise symbolic.DerivationError(
                "impulse names Jv, and there is neither J nor a switch to derive it from; define "
                "switch, a number that changes its sign where velocities jump"
            )
        rows, more = symbolic.derive_rows(given["switch"], symbols)
        found, steps = found | rows, steps | more
    return found, steps
