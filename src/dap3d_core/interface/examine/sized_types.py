"""Types with lists of a length that the scene gives, and the type of one length.

A type of ``points: tuple = points("n")`` is completed by a scene: for each length, and each way in
which the entries share bodies, it has one class, an ordinary type. There the entries are fields of
their own, ``points_0_i``, ``points_1_j``, and the kernels are given tuples of what these offer; the
size is a constant, so that loops over it unroll.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import attrs

from dap3d_core.interface.codegen.instance_layout import body_slots
from dap3d_core.interface.codegen.kernel_arguments import KernelArgument, parameters
from dap3d_core.interface.codegen.specialise import bound_kernel
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.errors import PluginError, where_is
from dap3d_core.interface.fields import SLOTS, FieldSpec, field_of, sized_fields, specs_of
from dap3d_core.interface.types import TypeBase

#: Kinds of lists that lie on bodies -> the kind of an entry.
ENTRIES = {"points": "point", "vectors": "vector", "bodies": "body"}
#: Names that a list offers, by kind of its entries: pattern of a name -> pattern of an entry's, of
#: its field {0} and of its slot {1}.
OFFERED = {
    "points": {
        "r_{}": "r_{0}", "s_{}": "s_{0}", "v_{}": "v_{0}", "s_{}_dot": "s_{0}_dot", "w_{}": "w_{1}"
    },
    "vectors": {"{}": "{0}", "{}_dot": "{0}_dot", "w_{}": "w_{1}"},
    "bodies": {f"{q}_{{}}": f"{q}_{{1}}" for q in ("r", "A", "p", "v", "w", "mass", "Jp")},
}  # fmt: skip
#: Lists of the sample of a type: entries on different bodies, and two on one body.
SAMPLES = ((0, 1, 2), (0, 1, 1, 2))


@attrs.frozen
class Shape:
    """Lengths of lists, and the bodies of their entries.

    Attributes:
        sizes: (name of a size, number of entries).
        on: (field of a list, slots of its entries).
        constants: (field of a list, its numbers).
    """

    sizes: tuple[tuple[str, int], ...]
    on: tuple[tuple[str, tuple[str, ...]], ...]
    constants: tuple[tuple[str, tuple[float, ...]], ...] = ()

    def __str__(self) -> str:
        sizes = [f"{name} = {count}" for name, count in self.sizes]
        return f"[{', '.join([*sizes, *(' '.join(slots) for _, slots in self.on)])}]"


def shared_slots(
    fixed: Sequence[int], lists: Mapping[str, Sequence[int]]
) -> tuple[list[int], dict[str, tuple[str, ...]]]:
    """The bodies of an element, each once, and the slots of the entries of its lists.

    Args:
        fixed: bodies of the slots that other fields give.
        lists: field of a list -> bodies of its entries.

    Raises:
        ValueError: more bodies than slots.
    """
    bodies = list(dict.fromkeys([*fixed, *(b for entries in lists.values() for b in entries)]))
    if len(bodies) > len(SLOTS):
        raise ValueError(f"acts on {len(bodies)} bodies; an element acts on {len(SLOTS)} at most")
    return bodies, {f: tuple(SLOTS[bodies.index(b)] for b in on) for f, on in lists.items()}


def examine_sized(type_: Any, examine: Callable[..., TypeInfo], seed: int) -> TypeInfo:
    """Check a type by samples; the result describes it, and ``sized`` completes it."""
    own_variants = type_.variants if "variants" in vars(type_) else ()
    variants = tuple((conditions, examine(class_, seed)) for conditions, class_ in own_variants)
    sample = examine(sample_classes(type_)[0], seed)
    slots = body_slots(type_)
    layout = attrs.evolve(sample.layout, slots=slots)
    names = {**sample.names, **described(sample)}
    return attrs.evolve(sample, type=type_, layout=layout, names=names, variants=variants, given="")


def sample_classes(type_: Any) -> list[Any]:
    """Classes of a type of some lengths, for checks; of a type without lists itself."""
    lists = sized_fields(type_)
    if not lists or hasattr(type_, "shape_of_lists"):
        return [type_]
    fixed, least = range(len(body_slots(type_))), max(spec.least for spec in lists.values())
    on_bodies = any(spec.kind in ENTRIES for spec in lists.values())
    classes = [_declared_sample(type_, lists, fixed, sample) for sample in type_.samples]
    if classes:
        return classes
    apart = any(spec.apart for spec in lists.values())
    for entries in SAMPLES if on_bodies and not apart else SAMPLES[:1]:
        bodies = [*entries, *range(max(entries) + 1, max(entries) + 1 + least - len(entries))]
        on = {name: bodies for name, spec in lists.items() if spec.kind in ENTRIES}
        slots = shared_slots(fixed, on)[1]
        sizes = {spec.size: len(bodies) for spec in lists.values()}
        classes.append(sized_class(type_, Shape(tuple(sizes.items()), tuple(slots.items()))))
    return classes


def _declared_sample(
    type_: Any, lists: Mapping[str, FieldSpec], fixed: Sequence[int], sample: Mapping[str, Any]
) -> Any:
    given = {name: sample.get(name, ()) for name, s in lists.items() if s.kind in ENTRIES}
    sizes = {lists[name].size: len(entries) for name, entries in given.items()}
    constants = tuple(
        (name, tuple(sample.get(name) or (float(spec.default),) * sizes[spec.size]))
        for name, spec in lists.items() if spec.constant
    )  # fmt: skip
    slots = shared_slots(fixed, given)[1]
    return sized_class(type_, Shape(tuple(sizes.items()), tuple(slots.items()), constants))


@cache
def sized(type_: Any, shape: Shape, examine: Callable[..., TypeInfo]) -> TypeInfo:
    """The type for one shape of its lists; examine: of examine.py, which makes use of this file."""
    return attrs.evolve(examine(sized_class(type_, shape)), given=str(shape))


@cache
def sized_class(type_: Any, shape: Shape) -> Any:
    """The class of a type for one shape of its lists."""
    sizes, on = dict(shape.sizes), dict(shape.on)
    members: dict[str, Any] = {"shape_of_lists": shape, "__doc__": type_.__doc__}
    for name, spec in sized_fields(type_).items():
        if spec.kind in ENTRIES:
            for entry in entry_fields(name, on[name]):
                one = attrs.evolve(spec, kind=ENTRIES[spec.kind], size="")
                members[entry] = field_of(one)
        elif spec.constant or not sizes[spec.size]:  # a word with one choice
            value = dict(shape.constants).get(name, ())
            one = attrs.evolve(spec, kind="choice", choices=(value,), default=value, size="")
            members[name] = field_of(one)
        else:
            members[name] = field_of(of_length(spec, sizes[spec.size]))
    members["__annotations__"] = {n: Any for n in members if n[0] != "_" and n != "shape_of_lists"}
    members["__module__"], members["__qualname__"] = type_.__module__, type_.__qualname__
    if isinstance(getattr(type_, "rows", 0), str):
        members["rows"] = rows_of(type_, sizes)
        if type_.unilateral is True:
            members["unilateral"] = tuple(range(members["rows"]))
    if type_.states:
        members["states"] = {n: sizes.get(k, k) for n, k in type_.state_lengths().items()}
    known = _known_names(type_, shape)
    for name, kernel in type_.kernels().items():
        given = {n: known[n] for n in parameters(kernel) if n in known}
        if given:
            further = [n for names, _ in given.values() for n in names]
            written = {n: text for n, (_, text) in given.items()}
            members[name] = bound_kernel(kernel, written, further, {})
    if type_.prepare not in (base.__dict__.get("prepare") for base in TypeBase.__subclasses__()):
        members["prepare"] = _prepare(type_, on)
    return type(type_.__name__, (type_,), members)


def rows_of(type_: Any, sizes: Mapping[str, int]) -> int:
    """Rows of a joint for sizes of its lists, by ``rows = "n"`` or ``"n - 1"``."""
    name, _, less = type_.rows.partition("-")
    try:
        return sizes[name.strip()] - int(less or 0)
    except (KeyError, ValueError):
        known = ", ".join(sizes)
        raise PluginError(
            f"{where_is(type_)} declares rows = {type_.rows!r}; write the size of a list "
            f'({known}), or one less a whole number, as "n - 1"'
        ) from None


def entry_fields(name: str, slots: Sequence[str]) -> list[str]:
    """The fields of the entries of a list."""
    return [f"{name}_{k}_{slot}" for k, slot in enumerate(slots)]


def of_length(spec: FieldSpec, count: int) -> FieldSpec:
    """The field of numbers for one length; a default is repeated."""
    default = spec.default if spec.required else (float(spec.default),) * count
    return attrs.evolve(spec, columns=count, size="", default=default)


def _known_names(type_: Any, shape: Shape) -> dict[str, tuple[list[str], str]]:
    """Names of lists and sizes -> names of the entries that they are made of, and expression."""
    known: dict[str, tuple[list[str], str]] = {n: ([], str(k)) for n, k in shape.sizes}
    specs = specs_of(type_)
    slots = list(body_slots(type_))
    slots += sorted({s for _, on in shape.on for s in on} - set(slots), key=SLOTS.index)
    empty = [n for n, spec in sized_fields(type_).items() if not dict(shape.sizes)[spec.size]]
    known |= {name: ([], "()") for name in empty}
    known |= {name: ([], repr(numbers)) for name, numbers in shape.constants}
    known["body_count"] = [], str(len(slots))
    for field, on in shape.on:
        known[f"on_{field}"] = [], f"({''.join(f'{slots.index(s)}, ' for s in on)})"
        entries = list(zip(entry_fields(field, on), on, strict=True))
        for name, pattern in OFFERED[specs[field].kind].items():
            names = [pattern.format(*entry) for entry in entries]
            known[name.format(field)] = names, f"({''.join(f'{n}, ' for n in names)})"
    return known


def _prepare(type_: Any, on: Mapping[str, Sequence[str]]) -> Callable[..., Any]:
    """``prepare`` of a class of one shape: it sees lists, and the poses of their bodies."""

    def prepare(self: Any, bodies: Mapping[str, Any]) -> Any:
        for name, slots in on.items():
            setattr(self, name, tuple(getattr(self, e) for e in entry_fields(name, slots)))
        poses = {name: tuple(bodies[s] for s in slots) for name, slots in on.items()}
        return type_.prepare(self, {**bodies, **poses})

    return prepare


def described(sample: TypeInfo) -> dict[str, KernelArgument]:
    """What lists offer, for descriptions of a type."""
    shape: Shape = sample.type.shape_of_lists  # type: ignore[attr-defined]
    described = {}
    for name, (entries, _) in _known_names(sample.type, shape).items():
        first = sample.names[entries[0]] if entries else None
        own = () if first is None else first.shape
        doc = "whole number" if first is None else f"of each entry: {first.doc}"
        velocity = first is not None and first.velocity
        described[name] = KernelArgument(name, (len(entries), *own), velocity, "", doc=doc)
    return described
