"""Reads materials: what surfaces do where they touch, each alone and in pairs."""

from collections.abc import Mapping
from typing import Any

from dap3d_core.interface.contacts.contact import LAWS
from dap3d_core.scene.contacts.tables import OF_PAIRS, Material, Materials
from dap3d_core.scene.errors import Key
from dap3d_core.scene.validate.coerce_values import Fault, bounded, number_of, word_of
from dap3d_core.scene.validate.geometry import missing_words
from dap3d_core.scene.validate.mistake_collector import Collector

#: Coefficients of materials, and the largest value of each.
LARGEST: Mapping[str, float | None] = {
    "mu": None, "mu_s": None, "mu_roll": None, "mu_spin": None, "e": 1.0,
}  # fmt: skip


def read_materials(report: Collector) -> Materials:
    """All materials of a scene, used or not; mistakes are reported."""
    materials = report.scene.materials
    by_name = {name: _material(report, material) for name, material in materials.items()}
    pairs: dict[tuple[str, ...], dict[str, float]] = {}
    for name, material in materials.items():
        key, tables = ("materials", name, "with"), material.with_ or {}
        if not isinstance(tables, Mapping):
            report.add(key, tables, "should be tables by name of the other material")
            continue
        for other, table in tables.items():
            pair = pairs.setdefault(tuple(sorted((name, other))), {})
            _read_pair(report, (*key, other), table, pair)
    return Materials(by_name, pairs)


def _material(report: Collector, material: Material) -> Material:
    """A material with numbers and words."""
    key: Key = ("materials", material.name)
    given = {name: getattr(material, name) for name in LARGEST}
    found: dict[str, Any] = {n: _coefficient(report, (*key, n), x) for n, x in given.items()}
    mu, mu_s = found["mu"] or 0.0, found["mu_s"]
    if mu_s is not None and mu_s < mu:
        what = f"is less than mu = {mu:g}; what slides would stick more than rest"
        report.add((*key, "mu_s"), mu_s, what)
        found["mu_s"] = None
    if material.law is not None:
        law = report.read((*key, "law"), material.law, lambda word: word_of(word, LAWS))
        found["law"] = None if isinstance(law, Fault) else law
    return Material(material.name, **found)


def _read_pair(report: Collector, key: Key, table: Any, pair: dict[str, float]) -> None:
    """Add a table [materials.NAME.with.OTHER] to what the pair has, as one or the other gave it."""
    name, other = str(key[1]), str(key[3])
    if other not in report.scene.materials:
        report.add(key, table, *missing_words(report, "material", other, report.scene.materials))
    if not isinstance(table, Mapping):
        report.add(key, table, "should be a table of the pair, such as {mu = 0.3}")
        return
    report.add_unknown_keys(key, dict(table), OF_PAIRS)
    for word in OF_PAIRS:
        value = _coefficient(report, (*key, word), table.get(word))
        if value is not None and pair.setdefault(word, value) != value:
            what = f"is {pair[word]:g} in [materials.{other}.with.{name}]: a pair has one of each"
            report.add((*key, word), value, what, remedy="take one of the two out")


def _coefficient(report: Collector, key: Key, value: Any) -> float | None:
    """A coefficient; None where it is not given, or a mistake is reported."""
    if value is None:
        return None
    most = LARGEST[str(key[-1])]
    read = report.read(key, value, lambda x: bounded(number_of(x), minimum=0.0, maximum=most))
    return None if isinstance(read, Fault) else read
