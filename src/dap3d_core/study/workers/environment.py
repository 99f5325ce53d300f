"""Compares environments of processes: versions of dap3d, its plugins, the model's own types."""

import os
from typing import Any

import attrs

from dap3d_core.interface import PluginError
from dap3d_core.interface.hooks import GROUPS
from dap3d_core.kernels.runtime.source_digest import driver_digest
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
    """The environment of this process, for a study."""
    environment = bare_environment()
    registry = load_registry()
    digests: dict[str, str] = {}
    try:
        checked = check(study.scene, registry, allow_code=study.allow_code)
        registry, digests = checked.registry, digests_of(checked)
    except (SceneError, PluginError) as error:
        environment["fault"] = str(error)
    types = environment["types"] = {}
    for kind in GROUPS:
        elements = getattr(study.scene, f"{kind}s").values()
        for keyword in sorted({e.type for e in elements if isinstance(e.type, str)}):
            if registry.sources_of(kind, keyword):
                types[f"{kind} {keyword}"] = _origin(registry, kind, keyword, digests)
    return environment


def bare_environment() -> Environment:
    """The environment as far as it is known without a study."""
    sources = driver_digest("study")
    return {"versions": current_versions(), "sources": sources, "types": None, "fault": ""}


def differences(here: Environment, there: Environment) -> list[str]:
    """Reasons why another process cannot run the study as this one does, each with a remedy."""
    if other := version_differences(here["versions"], there["versions"]):
        return other
    if there["types"] is None:
        return [there["fault"]]
    compared = (
        _type_difference(name, expected, there["types"].get(name))
        for name, expected in here["types"].items()
    )
    of_types = [message for message in compared if message]
    if not of_types and here["sources"] != there["sources"]:
        of_types = [f"its dap3d {there['versions']['dap3d']} has other sources; install the same"]
    return of_types or ([there["fault"]] if there["fault"] else [])


def version_differences(here: dict[str, str], there: dict[str, str]) -> list[str]:
    """Differences of versions that keep processes apart, each with the remedy."""
    messages = []
    if here["python"].split(".")[:2] != there["python"].split(".")[:2]:
        messages.append(f"it has Python {there['python']}, here is {here['python']}; take the same")
    if here["dap3d"] != there["dap3d"]:
        version = here["dap3d"]
        messages.append(
            f"it has dap3d {there['dap3d']}, here is {version}; install {version} there, as here"
        )
    return messages


def with_absolute_path(study: Study) -> Study:
    """The study with the absolute path of its scene: other processes have other folders."""
    path = study.scene.path
    if path is None or path.is_absolute():
        return study
    scene = study.scene.copy()
    scene.path = path.absolute()
    return attrs.evolve(study, scene=scene)


def _origin(registry: Registry, kind: str, keyword: str, digests: dict[str, str]) -> dict[str, str]:
    source = registry.sources_of(kind, keyword)[0]
    return {
        "package": source.distribution,
        "version": source.version,
        "module": source.module,
        "digest": digests.get(f"{kind} {keyword}", ""),
    }


def _type_difference(name: str, here: dict[str, str], there: dict[str, str] | None) -> str:
    """The fault of one type in another process; "" where there is none."""
    kind, _, keyword = name.partition(" ")
    package, version = here["package"], here["version"]
    if not there:
        if not package:
            return (
                f"the {kind} type {keyword!r} is in {here['module']}, which it does not see; "
                f"let it see the folder {os.path.dirname(here['module'])} under this very path"
            )
        return (
            f"it lacks the {kind} type {keyword!r} of {package} {version}; "
            f"pip install {package}=={version} there"
        )
    if (there["package"], there["version"]) != (package, version):
        return (
            f"its {kind} type {keyword!r} is of {there['package'] or there['module']} "
            f"{there['version']}, here of {package or here['module']} {version}; install the same"
        )
    if there["digest"] and there["digest"] != here["digest"]:
        return f"the file of its {kind} type {keyword!r} is not the one here; install the same"
    return ""
