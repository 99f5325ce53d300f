"""Whether another process has what a study needs: dap3d, its plugins, the model's own types."""

import os
from typing import Any

import attrs

from dap3d_core.interface import PluginError
from dap3d_core.interface.hooks import GROUPS
from dap3d_core.kernels.runtime.cache import driver_digest
from dap3d_core.registry import Registry, load_registry
from dap3d_core.result import current_versions
from dap3d_core.scene import SceneError, check
from dap3d_core.simulation.output.type_sources import digests_of
from dap3d_core.study.study import Study

#: What a process has of what a study needs, as plain data, which any version of dap3d can read:
#: ``versions``; ``sources``, a digest of the core; ``types``, for each "joint rev" of the scene
#: ``package``, ``version``, ``module``, ``digest``, or None where nothing is known of the scene;
#: ``fault``, why it cannot be used.
Environment = dict[str, Any]


def environment_of(study: Study) -> Environment:
    """What this process has of what a study needs."""
    found = bare_environment()
    registry = load_registry()
    digests: dict[str, str] = {}
    try:
        checked = check(study.scene, registry, allow_code=study.allow_code)
        registry, digests = checked.registry, digests_of(checked)
    except (SceneError, PluginError) as error:
        found["fault"] = str(error)
    found["types"] = {
        f"{kind} {word}": _origin(registry, kind, word, digests)
        for kind in GROUPS
        for word in _words(study, kind)
        if any(not s.blocked for s in registry.sources.get((kind, word), ()))
    }
    return found


def bare_environment() -> Environment:
    """What can be said without a study."""
    sources = driver_digest("study")
    return {"versions": current_versions(), "sources": sources, "types": None, "fault": ""}


def differences(here: Environment, there: Environment) -> list[str]:
    """What keeps another process from running the study as this one does, each with a remedy."""
    other = other_versions(here["versions"], there["versions"])
    if other:
        return other
    if there["types"] is None:
        return [there["fault"]]
    found = [
        words
        for name, wanted in here["types"].items()
        if (words := _difference(name, wanted, there["types"].get(name)))
    ]
    if not found and here["sources"] != there["sources"]:
        found = [f"its dap3d {there['versions']['dap3d']} has other sources; install the same"]
    return found or ([there["fault"]] if there["fault"] else [])


def other_versions(here: dict[str, str], there: dict[str, str]) -> list[str]:
    """What keeps processes of such versions apart, each with the remedy."""
    found = []
    if here["python"].split(".")[:2] != there["python"].split(".")[:2]:
        found.append(f"it has Python {there['python']}, here is {here['python']}; take the same")
    if here["dap3d"] != there["dap3d"]:
        version = here["dap3d"]
        found.append(
            f"it has dap3d {there['dap3d']}, here is {version}; "
            f'pip install "dap3d[cluster]=={version}" there'
        )
    return found


def with_whole_path(study: Study) -> Study:
    """The study with the path of its scene from the root: other processes stand elsewhere."""
    path = study.scene.path
    if path is None or path.is_absolute():
        return study
    scene = study.scene.copy()
    scene.path = path.absolute()
    return attrs.evolve(study, scene=scene)


def _words(study: Study, kind: str) -> list[str]:
    """The keywords of a kind that the scene names."""
    elements = getattr(study.scene, f"{kind}s").values()
    return sorted({e.type for e in elements if isinstance(e.type, str)})


def _origin(registry: Registry, kind: str, word: str, digests: dict[str, str]) -> dict[str, str]:
    source = next(s for s in registry.sources[kind, word] if not s.blocked)
    return {
        "package": source.distribution,
        "version": source.version,
        "module": source.module,
        "digest": digests.get(f"{kind} {word}", ""),
    }


def _difference(name: str, wanted: dict[str, str], got: dict[str, str] | None) -> str:
    """What is wrong with one type in another process; "" where nothing is."""
    kind, _, word = name.partition(" ")
    package, version = wanted["package"], wanted["version"]
    if not got:
        if not package:
            return (
                f"the {kind} type {word!r} stands in {wanted['module']}, which it does not see; "
                f"let it see the folder {os.path.dirname(wanted['module'])} under this very path"
            )
        return (
            f"it lacks the {kind} type {word!r} of {package} {version}; "
            f"pip install {package}=={version} there"
        )
    if (got["package"], got["version"]) != (package, version):
        return (
            f"its {kind} type {word!r} is of {got['package'] or got['module']} {got['version']}, "
            f"here of {package or wanted['module']} {version}; install the same"
        )
    if got["digest"] and got["digest"] != wanted["digest"]:
        return f"the file of its {kind} type {word!r} is not the one here; install the same"
    return ""
