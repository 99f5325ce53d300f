"""FMUs: modelDescription.xml, binaries, documentation, in one file."""

import datetime
import hashlib
import re
import zipfile
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from dap3d_core.native.build import Platform
from dap3d_core.native.c_source import Variable, c_text
from dap3d_core.native.library import Exported
from dap3d_core.result.metadata import current_versions
from dap3d_core.scene.expressions.units import Number, Unit, constant, unit_of

#: Base units that the standard knows.
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
#: Causality, variability, initial of each kind of variable.
ROLES = {
    "time": ("independent", "continuous", ""),
    "input": ("input", "continuous", ""),
    "parameter": ("parameter", "tunable", "exact"),
    "fixed": ("parameter", "fixed", "exact"),
    "output": ("output", "continuous", "calculated"),
    "state": ("local", "continuous", "exact"),
    "derivative": ("local", "continuous", "calculated"),
    "indicator": ("local", "continuous", "calculated"),
}
#: Earliest time that the file format knows: files are equal where the model is.
STAMP = (1980, 1, 1, 0, 0, 0)


def write_fmu(
    model: Exported, platforms: Sequence[Platform], target: Path, fmi: int, sources: Path
) -> int:
    """Write an FMU of version 2 or 3; bytes of its largest library.

    sources: folder with the C sources and data.h.
    """
    digest = hashlib.sha256((sources / "data.h").read_bytes()).hexdigest()
    token = f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"
    (sources / "token.h").write_text(f"#define FMI_TOKEN {c_text(token)}\n")
    files: dict[str, bytes] = {}
    size = 0
    for one in platforms:
        library = sources / "binaries" / one.name / f"{model.name}{one.library}"
        size = max(size, model.link(sources / f"fmi{fmi}.c", one, library, None))
        folder = one.fmi2 if fmi == 2 else one.fmi3
        files[f"binaries/{folder}/{library.name}"] = library.read_bytes()
    description = description_of(model, token, fmi)
    files = {"modelDescription.xml": description, "documentation/index.html": _page(model)} | files
    partial = target.with_name(f".{target.name}.part")
    try:
        with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in files.items():
                entry = zipfile.ZipInfo(name, STAMP)
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = (0o755 if name.startswith("binaries") else 0o644) << 16
                archive.writestr(entry, content)
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)
    return size


def description_of(model: Exported, token: str, fmi: int) -> bytes:
    """The text of modelDescription.xml."""
    prepared, scene = model.prepared, model.prepared.compiled.scene
    count = sum(v.kind == "indicator" for v in model.variables)
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": f"{fmi}.0",
            "modelName": model.name,
            "guid" if fmi == 2 else "instantiationToken": token,
            "description": _legal(scene.description),
            "generationTool": f"dap3d {current_versions()['dap3d']}",
            "generationDateAndTime": now,
            "variableNamingConvention": "flat",
            **({"numberOfEventIndicators": str(count)} if fmi == 2 else {}),
        },
    )
    _capabilities(root, model, fmi)
    _units(SubElement(root, "UnitDefinitions"), (v.unit for v in model.variables))
    categories = SubElement(root, "LogCategories")
    for name in ("logStatusWarning", "logStatusError"):
        SubElement(categories, "Category", {"name": name})
    rtol = float(prepared.run.settings.rtol)
    SubElement(root, "DefaultExperiment", {"startTime": "0", "stopTime": repr(prepared.t_end),
                                           "tolerance": repr(rtol)})  # fmt: skip
    variables = SubElement(root, "ModelVariables")
    first = {kind: k for k, v in reversed(list(enumerate(model.variables))) for kind in [v.kind]}
    for k, v in enumerate(model.variables):
        _variable(variables, k, v, first, fmi)
    _structure(SubElement(root, "ModelStructure"), model.variables, fmi)
    indent(root)
    text: bytes = tostring(root, encoding="UTF-8", xml_declaration=True)
    return text


def _legal(text: str | None) -> str:
    """A text without characters that XML does not have; names hold none."""
    return re.sub("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", " ", text or "")


def _capabilities(root: Element, model: Exported, fmi: int) -> None:
    state = "canGetAndSetFMUState" if fmi == 3 else "canGetAndSetFMUstate"
    serial = "canSerializeFMUState" if fmi == 3 else "canSerializeFMUstate"
    common = {"modelIdentifier": model.name, state: "true", serial: "true"}
    if model.directions is not None:
        common[f"providesDirectionalDerivative{'s' if fmi == 3 else ''}"] = "true"
    steps = "needsCompletedIntegratorStep" if fmi == 3 else "completedIntegratorStepNotNeeded"
    if not model.prepared.steps_contacts:
        SubElement(root, "ModelExchange", common | {steps: "true" if fmi == 3 else "false"})
    able = ["canHandleVariableCommunicationStepSize"]
    if fmi == 3:
        able += ["hasEventMode", "mightReturnEarlyFromDoStep", "providesIntermediateUpdate",
                 "canReturnEarlyAfterIntermediateUpdate"]  # fmt: skip
    SubElement(root, "CoSimulation", common | dict.fromkeys(able, "true"))


def _units(parent: Element, names: Iterable[str]) -> None:
    for name in dict.fromkeys(names):
        if name in ("", "1", "SI"):
            continue
        element = SubElement(parent, "Unit", {"name": name})
        factor, powers = _in_base_units(name)
        if set(powers) <= set(BASE_UNITS) and all(p.denominator == 1 for p in powers.values()):
            given = {base: str(p) for base, p in powers.items() if p}
            SubElement(element, "BaseUnit", given | ({} if factor == 1.0 else
                                                     {"factor": repr(factor)}))  # fmt: skip


def _in_base_units(name: str) -> tuple[float, dict[str, Fraction]]:
    """The size of a unit, and its powers of base units; of itself where it is not known."""
    factor, powers = 1.0, Counter[str]()
    for symbol, power in (unit_of(name).powers or {}).items():
        number = Number(1.0, Unit({symbol: Fraction(1)}))
        if symbol not in BASE_UNITS:
            with suppress(KeyError, ValueError):
                number = constant(symbol)
        factor *= float(number) ** float(power)
        for base, count in (number.unit.powers or {}).items():
            powers[base] += count * power  # type: ignore[assignment]
    return factor, dict(powers)  # type: ignore[arg-type]


def _variable(parent: Element, k: int, v: Variable, first: dict[str, int], fmi: int) -> None:
    causality, variability, initial = ROLES[v.kind]
    common = {"name": v.name, "valueReference": str(k), "description": v.label,
              "causality": causality, "variability": variability}  # fmt: skip
    if initial:
        common["initial"] = initial
    own = {} if v.unit in ("", "1", "SI") else {"unit": v.unit}
    if v.kind in ("input", "parameter", "fixed", "state"):
        own["start"] = repr(float(v.start))
    ends = zip(("min", "max"), v.limits.ends, strict=True)  # of an open one the number there
    own |= {key: repr(at) for key, (_, at, _) in ends if at is not None}
    if v.kind == "derivative":
        own["derivative"] = str(first["state"] + v.first + (1 if fmi == 2 else 0))
    if fmi == 3:
        SubElement(parent, "Float64", common | own)
    else:
        SubElement(SubElement(parent, "ScalarVariable", common), "Real", own)


def _structure(parent: Element, variables: Sequence[Variable], fmi: int) -> None:
    parts = {"Output": ("output",), "ContinuousStateDerivative": ("derivative",),
             "InitialUnknown": ("output", "derivative"),
             "EventIndicator": ("indicator",)} if fmi == 3 else {
             "Outputs": ("output",), "Derivatives": ("derivative",),
             "InitialUnknowns": ("output", "derivative")}  # fmt: skip
    references = {v.name: k + (1 if fmi == 2 else 0) for k, v in enumerate(variables)}
    for name, kinds in parts.items():
        found = [v for v in variables if v.kind in kinds]
        part = SubElement(parent, name) if fmi == 2 and found else parent
        for v in found:
            key, tag = ("valueReference", name) if fmi == 3 else ("index", "Unknown")
            place = {key: str(references[v.name])}
            SubElement(part, tag, place | _dependencies(v, references))


def _dependencies(v: Variable, references: dict[str, int]) -> dict[str, str]:
    """Of rates of positions and orientations; others depend on all, which is said by no word."""
    state = v.name.removeprefix("der(").removesuffix(")")
    body, _, component = state.rpartition(".")
    owner, _, quantity = body.rpartition(".")
    names: list[str] = []
    if v.kind == "derivative" and quantity == "r":
        names = [f"{owner}.rd.{component}"]
    elif v.kind == "derivative" and quantity == "p":
        names = [*(f"{owner}.p.e{k}" for k in range(4)), *(f"{owner}.wp.{a}" for a in "xyz")]
    if not names or not set(names) <= set(references):
        return {}
    kind = "constant" if quantity == "r" else "dependent"
    return {
        "dependencies": " ".join(str(references[name]) for name in names),
        "dependenciesKind": " ".join([kind] * len(names)),
    }


def _page(model: Exported) -> bytes:
    """The documentation page: what the model is and how it was made."""
    prepared = model.prepared
    settings, scene = prepared.run.settings, prepared.compiled.scene
    root = Element("html")
    body = SubElement(root, "body")
    SubElement(body, "h1").text = model.name
    SubElement(body, "p").text = _legal(scene.description)
    SubElement(body, "p").text = (
        f"A model of dap3d {current_versions()['dap3d']}: method {prepared.compiled.method}, "
        f"integrator {settings.integrator}, rtol {settings.rtol}, atol {settings.atol}."
    )
    table = SubElement(body, "table")
    for v in model.variables:
        row = SubElement(table, "tr")
        for text in (v.name, v.kind, v.unit, v.label):
            SubElement(row, "td").text = text
    page: bytes = tostring(root, encoding="UTF-8", method="html")
    return page
