"""The registry: installed types are found by keyword, and a broken plugin only breaks itself.
Plugins here are real distributions on sys.path: a module, and a dist-info with entry points."""

import json
import os
import shutil
import sys
import textwrap
import time
from pathlib import Path

import pytest

import dap3d_core as dap
from dap3d_core.interface import PluginError
from dap3d_core.registry import UnknownTypeError

GOOD = """
    from dap3d_core.interface import Body, Force, body, hookimpl, number
    from dap3d_core.kernels import scale

    interface_version = 1

    class Push(Force):
        \"\"\"A constant push along x.\"\"\"

        keyword = "push"
        body_i: Body = body()
        k: float = number(default=1.0)

        def wrench(k):
            return (((k, 0.0, 0.0), (0.0, 0.0, 0.0)),)

    @hookimpl
    def dap3d_forces():
        return [Push]
"""


def message(kind="force", keyword="push", registry=None):
    """What ``get`` says against a type."""
    registry = registry or dap.load_registry()
    with pytest.raises(PluginError) as caught:
        registry.get(kind, keyword)
    with pytest.raises(PluginError) as again:
        registry.get(kind, keyword)
    assert str(again.value) == str(caught.value), "the second answer is the same"
    return str(caught.value)


def test_a_type_is_imported_when_asked_for_and_not_before(install):
    module = install("dap3d-push", GOOD)
    registry = dap.load_registry()
    assert "push" in registry.keywords("force")
    assert "push" not in registry.keywords("joint")
    assert module not in sys.modules
    type_info = registry.get("force", "push")
    assert module in sys.modules
    assert type_info.type.__name__ == "Push"
    assert type_info.type.__doc__ == "A constant push along x."
    assert type_info.layout.slots == ("i",)
    assert registry.get("force", "push") is type_info, "type_info once"


def test_listing_says_ok_with_distribution_and_version(install):
    module = install("dap3d-push", GOOD)
    (info,) = [i for i in dap.load_registry().listing() if i.keyword == "push"]
    assert (info.kind, info.distribution, info.version) == ("force", "dap3d-push", "1.2")
    assert (info.module, info.state, info.reason) == (module, "ok", "")


def test_two_registries_share_nothing(install):
    before = dap.load_registry()
    install("dap3d-push", GOOD)
    assert "push" not in before.keywords("force")
    assert "push" in dap.load_registry().keywords("force")
    assert dap.load_registry(groups=()).listing() == []
    assert "push" not in dap.load_registry(groups=["dap3d.joints"]).keywords("force")


#: What stands in a module -> what is said of it.
BROKEN = {
    "import error": (
        "import no_such_package_here\n",
        ["ModuleNotFoundError", "no_such_package_here", "_module.py:1"],
    ),
    "syntax error": ("def f(:\n", ["SyntaxError", "_module.py:1"]),
    "exit": ("import sys\nsys.exit(3)\n", ["SystemExit", "_module.py:2"]),
    "generator exit": ("raise GeneratorExit\n", ["GeneratorExit"]),
    "stop iteration": ("raise StopIteration('x')\n", ["StopIteration"]),
}
#: What is replaced in the good one, by what, and what is said of it.
SPOILT = {
    "no version": ("interface_version = 1", "", ["no interface_version", "interface_version = 1"]),
    "newer version": ("interface_version = 1", "interface_version = 99",
                      ["interface version 99", "newer dap3d"]),
    "older version": ("interface_version = 1", "interface_version = 0",
                      ["interface version 0", "newer version of the plugin"]),
    "version is true": ("interface_version = 1", "interface_version = True",
                        ["says True", "an integer"]),
    "version is text": ("interface_version = 1", "interface_version = '1'",
                        ["says '1'", "an integer"]),
    "hook takes an argument": ("def dap3d_forces():", "def dap3d_forces(scene):",
                               ["dap3d_forces() takes no arguments", "remove scene"]),
    "hook of an unknown name": ("def dap3d_forces():", "def dap3d_force():",
                                ["no hook dap3d_force()", "did you mean 'dap3d_forces'"]),
    "no hookimpl": ("@hookimpl\n", "\n", ["dap3d_forces() is not marked", "write @hookimpl"]),
    "hook of another kind": ("def dap3d_forces():", "def dap3d_joints():",
                             ["no hook for a force", "dap3d_forces"]),
    "hook returns None": ("return [Push]", "return None", ["list of classes"]),
    "hook returns a class": ("return [Push]", "return Push", ["list of classes"]),
    "hook returns an instance": ("return [Push]", "return [Push(body_i='a')]",
                                 ["subclasses of Force"]),
    "hook raises": ("return [Push]", "raise RuntimeError('nothing here')",
                    ["RuntimeError", "nothing here"]),
    "other keyword": ('keyword = "push"', 'keyword = "pusher"',
                      ["no class with the keyword 'push'", "did you mean 'pusher'"]),
    "no keyword": ('keyword = "push"', "", ["no keyword"]),
    "keyword as a field": ('keyword = "push"', 'keyword: str = "push"',
                           ["no keyword", "without an annotation"]),
    "keyword twice": ("return [Push]", "return [Push, Push]", ["the same keyword 'push'"]),
    "kernel asks for an unknown name": ("def wrench(k):", "def wrench(k, w_1):",
                                        ["Push.wrench asks for w_1", "did you mean w_i"]),
    "kernel of wrong shape": ("(0.0, 0.0, 0.0)),)", "(0.0, 0.0)),)",
                              ["Push.wrench", "differ in length"]),
    "kernel raises": ("return (((k,", "return ((({}['k'],", ["Push.wrench", "KeyError"]),
}  # fmt: skip
BROKEN |= {case: (GOOD.replace(old, new), words) for case, (old, new, words) in SPOILT.items()}


@pytest.mark.parametrize(("text", "words"), BROKEN.values(), ids=BROKEN)
def test_a_broken_plugin_is_named_with_reason_and_remedy(install, text, words):
    module = install("dap3d-push", text)
    said = message()
    for word in [*words, "'push'", "dap3d-push 1.2", module, "DAP3D_BLOCK=dap3d-push"]:
        assert word in said
    assert "\n" not in said


@pytest.mark.parametrize("case", ["import error", "exit", "kernel raises"])
def test_a_broken_plugin_breaks_no_other_and_is_listed(install, case):
    text, words = BROKEN[case]
    install("dap3d-push", text)
    install("dap3d-pull", GOOD.replace('"push"', '"pull"'), "pull")
    registry = dap.load_registry()
    listing = {i.keyword: i for i in registry.listing()}
    assert listing["push"].state == "broken"
    assert words[0] in listing["push"].reason
    assert listing["pull"].state == "ok"
    assert registry.get("force", "pull").type.keyword == "pull"


def test_ctrl_c_at_import_is_not_swallowed(install):
    """And says which plugin was being loaded: it may be the one that takes so long."""
    install("dap3d-push", "raise KeyboardInterrupt\n")
    with pytest.raises(KeyboardInterrupt, match=r"while force type 'push' of .*dap3d-push"):
        dap.load_registry().get("force", "push")


@pytest.mark.parametrize(
    "loop",
    [
        "import time\ntime.sleep(1e6)\n",
        "while True:\n    try:\n        f()\n    except Exception:\n        pass\n",
    ],
    ids=["asleep", "catches everything"],
)
def test_a_plugin_that_never_ends_loading_is_named_and_stops_no_other(install, loop):
    """With its line, once for all of its types; an alarm that was set before is set again."""
    import signal

    both = "[dap3d.forces]\npush = dap3d_push_module\nshove = dap3d_push_module\n"
    module = install("dap3d-push", loop, entry_points=both)
    install("dap3d-pull", GOOD.replace('"push"', '"pull"'), "pull")
    signal.setitimer(signal.ITIMER_REAL, 1000.0)
    try:
        listing = {i.keyword: i for i in dap.load_registry().listing(limit_s=0.3)}
        assert 0.0 < signal.getitimer(signal.ITIMER_REAL)[0] < 1000.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    assert listing["push"].state == "broken"
    for words in ["not loaded after 0.3 s", f"{module}.py:", "DAP3D_BLOCK=dap3d-push:push"]:
        assert words in listing["push"].reason
    assert "its package was not loaded after 0.3 s; " in listing["shove"].reason
    assert listing["pull"].state == listing["weight"].state == "ok"


def test_what_was_declared_since_an_editable_install_says_to_install_again(install, tmp_path):
    """The entry points of such an install are those of the day it was made."""
    install("dap3d-push", GOOD)
    source = tmp_path / "source of push"
    source.mkdir()
    (source / "pyproject.toml").write_text(
        '[project.entry-points."dap3d.forces"]\npush = "push"\nshove = "shove"\n'
    )
    origin = {"url": source.as_uri(), "dir_info": {"editable": True}}
    (tmp_path / "dap3d_push-1.2.dist-info" / "direct_url.json").write_text(json.dumps(origin))
    with pytest.raises(UnknownTypeError) as caught:
        dap.load_registry().get("force", "shove")
    assert f"run pip install -e '{source}' again" in str(caught.value)
    with pytest.raises(UnknownTypeError) as caught:
        dap.load_registry().get("force", "drag")
    assert "pip install" not in str(caught.value)


def test_two_distributions_with_one_keyword_are_both_named(install, monkeypatch):
    install("dap3d-push", GOOD)
    install("Other.Push", GOOD)
    said = message()
    for word in ["dap3d-push 1.2", "Other.Push 1.2", "uninstall one", "DAP3D_BLOCK=Other.Push"]:
        assert word in said
    states = [i for i in dap.load_registry().listing() if i.keyword == "push"]
    assert [i.state for i in states] == ["duplicate", "duplicate"]
    assert all("Other.Push" in i.reason and "dap3d-push" in i.reason for i in states)

    monkeypatch.setenv("DAP3D_BLOCK", "something, other_push")
    registry = dap.load_registry()
    assert registry.get("force", "push").type.__module__ == "dap3d_push_module"
    states = {i.distribution: i.state for i in registry.listing() if i.keyword == "push"}
    assert states == {"dap3d-push": "ok", "Other.Push": "blocked"}


def test_a_keyword_with_its_package_names_one_of_two(install):
    """Either of two types that share a keyword; another package is refused with who brings it."""
    install("dap3d-push", GOOD)
    install("Other-Push", GOOD)
    assert 'type = "Other-Push:push" or "dap3d-push:push"' in message()
    registry = dap.load_registry()
    words = ("dap3d-push:push", "other_push:push", "Other-Push:push")
    modules = [registry.get("force", word).type.__module__ for word in words]
    assert modules == ["dap3d_push_module", "Other_Push_module", "Other_Push_module"]
    assert registry.get("force", words[1]) is registry.get("force", words[2]), "loaded once"
    with pytest.raises(UnknownTypeError, match="'dap3d-pushes' brings no force type") as caught:
        registry.get("force", "dap3d-pushes:push")
    assert caught.value.nearest == "dap3d-push:push"
    with pytest.raises(UnknownTypeError, match="there is no force type"):
        registry.get("force", "dap3d-push:shove")


@pytest.mark.parametrize("left_out", ["dap3d", "DAP3D_mine"])
def test_the_advice_on_a_collision_works_and_costs_no_other_type(install, monkeypatch, left_out):
    """Either of the two types may be left out; all others of its distribution stay."""
    install("dap3d-mine", GOOD.replace('"push"', '"weight"'), "weight")
    before = set(dap.load_registry().keywords("force"))
    monkeypatch.setenv("DAP3D_BLOCK", f"{left_out}:weight")
    registry = dap.load_registry()
    assert set(registry.keywords("force")) == before
    assert registry.get("force", "ptp").type.keyword == "ptp"
    distribution = {"dap3d": "dap3d-mine", "DAP3D_mine": "dap3d"}[left_out]
    listing = [i for i in registry.listing() if i.keyword == "weight"]
    assert {i.distribution: i.state for i in listing if i.state == "ok"} == {distribution: "ok"}


def test_keywords_of_another_kind_unknown_kinds_and_blocked_types(install, monkeypatch):
    install("dap3d-push", GOOD)
    with pytest.raises(LookupError, match="'push' is a force type and belongs under forces"):
        dap.load_registry().get("joint", "push")
    with pytest.raises(ValueError, match="joint, force, function"):
        dap.load_registry().get("joints", "sph")
    monkeypatch.setenv("DAP3D_BLOCK", "dap3d-push, dap3d")
    registry = dap.load_registry()
    assert "push" not in registry.keywords("force")
    with pytest.raises(UnknownTypeError, match="DAP3D_BLOCK leaves dap3d-push out"):
        registry.get("force", "push")
    with pytest.raises(UnknownTypeError) as caught:  # another name of a blocked type
        registry.get("joint", "hinge")
    assert caught.value.nearest is None


def test_an_unknown_keyword_names_the_nearest_and_all(install):
    install("dap3d-push", GOOD)
    registry = dap.load_registry()
    with pytest.raises(LookupError) as caught:
        registry.get("force", "pusch")
    assert isinstance(caught.value, PluginError)
    assert caught.value.nearest == "push"
    assert "did you mean 'push'" in str(caught.value)
    for word in registry.keywords("force"):
        assert word in str(caught.value)
    with pytest.raises(LookupError, match="did you mean 'push'"):
        registry.get("force", "PUSH")


def test_an_entry_point_that_names_no_module_is_broken(install):
    install("dap3d-push", GOOD, entry_points="[dap3d.forces]\npush = dap3d_push_module:Push\n")
    assert "should name a module" in message()


def test_a_damaged_entry_point_file_stops_nobody_else(install):
    install("dap3d-broken", "", entry_points="[dap3d.forces]\nthis is not an entry point\n")
    install("dap3d-push", GOOD)
    registry = dap.load_registry()
    assert registry.get("force", "push").type.keyword == "push"
    broken = [i for i in registry.listing() if i.distribution == "dap3d-broken"]
    assert [i.state for i in broken] == ["broken"]
    assert "entry_points.txt" in broken[0].reason


def test_what_is_installed_meanwhile_is_found_and_what_is_removed_is_not(install, tmp_path):
    before = dap.load_registry().keywords("force")
    for _ in range(2):
        time.sleep(0.02)  # Python's own list of a folder is as old as a tick of the file system
        install("dap3d-push", GOOD)
        assert set(dap.load_registry().keywords("force")) == {*before, "push"}
        shutil.rmtree(tmp_path / "dap3d_push-1.2.dist-info")
        assert dap.load_registry().keywords("force") == before


def test_of_two_distributions_of_one_name_the_one_that_is_imported_counts(
    install, tmp_path, monkeypatch
):
    """Whether or not it declares types."""
    install("dap3d-push", GOOD)
    first = tmp_path / "first"
    first.mkdir()
    monkeypatch.syspath_prepend(str(first))
    shutil.copytree(tmp_path / "dap3d_push-1.2.dist-info", first / "dap3d_push-1.3.dist-info")
    info = first / "dap3d_push-1.3.dist-info"
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: dap3d_push\nVersion: 1.3\n")
    (found,) = [t for t in dap.load_registry().listing() if t.keyword == "push"]
    assert (found.version, found.state) == ("1.3", "ok")
    shutil.rmtree(info)
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: dap3d_push\nVersion: 1.3\n")
    assert "push" not in dap.load_registry().keywords("force")


def test_to_know_what_is_installed_costs_once(monkeypatch):
    """Not once for each of many runs: nothing is looked for where no folder has changed."""
    monkeypatch.setattr("dap3d_core.registry.discovery.SETTLED", 0)
    before, asked = dap.load_registry(), []
    monkeypatch.setattr(
        "dap3d_core.registry.discovery.distributions", lambda **names: asked.append(names) or []
    )
    assert dap.load_registry().sources == before.sources
    assert asked == []


def test_what_a_plugin_changes_in_the_process_is_put_back(install, tmp_path, capsys):
    import numpy as np

    changes = """
    import os
    import numpy
    print("hello from the plugin")
    os.chdir("/")
    numpy.seterr(all="raise")
    """
    install("dap3d-push", textwrap.dedent(changes) + textwrap.dedent(GOOD))
    before, state = os.getcwd(), np.geterr()
    registry = dap.load_registry()
    registry.get("force", "push")
    assert os.getcwd() == before
    assert np.geterr() == state
    assert any("working folder" in note for note in registry.notes)
    assert any("numpy" in note for note in registry.notes)
    assert capsys.readouterr().out == "", "what it prints does not mix with results"


# ---------------------------------------------------------------------------- a model's own file


def write(folder: Path, text: str = GOOD) -> Path:
    file = folder / "plugin.py"
    file.write_text(textwrap.dedent(text))
    return file


def test_a_model_file_adds_its_types_to_a_new_registry(tmp_path):
    import inspect

    registry = dap.load_registry()
    more = registry.with_file(write(tmp_path))
    type_info = more.get("force", "push")
    assert type_info.type.__doc__ == "A constant push along x."
    assert "def wrench(k)" in inspect.getsource(type_info.type), "its source can be found"
    assert inspect.getsourcefile(type_info.type) == str(tmp_path / "plugin.py")
    assert "push" not in registry.keywords("force"), "the first registry is as before"
    assert not (tmp_path / "__pycache__").exists()
    (info,) = [i for i in more.listing() if i.keyword == "push"]
    assert (info.state, info.distribution) == ("ok", "")
    assert info.module == str(tmp_path / "plugin.py")


def test_a_model_file_that_changed_is_another_module(tmp_path):
    first = dap.load_registry().with_file(write(tmp_path)).get("force", "push").type
    again = dap.load_registry().with_file(write(tmp_path)).get("force", "push").type
    assert again is first
    changed = GOOD.replace("default=1.0", "default=2.0")
    other = dap.load_registry().with_file(write(tmp_path, changed)).get("force", "push").type
    assert other.__module__ != first.__module__
    assert other(body_i="a").k == 2.0


@pytest.mark.parametrize("case", ["import error", "exit", "no version", "hook takes an argument"])
def test_a_broken_model_file_is_named(tmp_path, case):
    text, words = BROKEN[case]
    file = write(tmp_path, text)
    with pytest.raises(PluginError) as caught:
        dap.load_registry().with_file(file)
    for word in [str(file), *words]:
        assert word.replace("_module.py", "plugin.py") in str(caught.value)


def test_a_model_file_without_types_or_missing_is_refused(tmp_path):
    with pytest.raises(PluginError, match="brings no type"):
        dap.load_registry().with_file(write(tmp_path, "interface_version = 1\n"))
    with pytest.raises(PluginError, match="cannot be read"):
        dap.load_registry().with_file(tmp_path / "nothing.py")


def test_hooks_are_called_once_for_each_module(install):
    """In all registries of a process; a module that took the place of another brings its own."""
    text = GOOD.replace("return [Push]", "calls.append(1)\n        return [Push]")
    module = install(
        "dap3d-push", text.replace("interface_version", "calls = []\n    interface_version")
    )
    types = [dap.load_registry().get("force", "push") for _ in range(3)]
    assert types[0] is types[1] is types[2]
    assert len(sys.modules[module].calls) == 1
    del sys.modules[module]
    again = dap.load_registry().get("force", "push")
    assert again is not types[0]
    assert again.type is sys.modules[module].Push


@pytest.mark.parametrize(
    ("kind", "word", "keyword"),
    [
        ("joint", "hinge", "rev"),  # and not bushing, which is spelt alike
        ("joint", "Prismatic", "tran"),
        ("joint", "ball", "sph"),
        ("force", "gravity", "weight"),
        ("force", "spring", "ptp"),
        ("function", "sine", "harmonic"),
    ],
)
def test_other_names_of_a_type_lead_to_its_keyword(kind, word, keyword):
    with pytest.raises(UnknownTypeError, match=f"did you mean '{keyword}'") as caught:
        dap.load_registry().get(kind, word)
    assert caught.value.nearest == keyword


def test_no_two_types_of_a_kind_share_another_name():
    registry = dap.load_registry()
    for kind in ("joint", "force", "function"):
        own = [registry.get(kind, k).type for k in registry.keywords(kind)]
        words = [word for type_ in own for word in (*type_.synonyms, type_.keyword)]
        assert len(set(words)) == len(words), kind
