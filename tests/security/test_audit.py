"""The audit of what dap3d depends on finds what it should."""

import importlib.util
from email.message import Message
from types import SimpleNamespace

import pytest
from support.process import REPOSITORY


@pytest.fixture(scope="module")
def audit():
    pytest.importorskip("packaging")
    file = REPOSITORY / "tools" / "audit.py"
    spec = importlib.util.spec_from_file_location("audit_tool", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def package(**about):
    found = Message()
    for name, value in about.items():
        found[name.replace("_", "-")] = value
    return SimpleNamespace(metadata=found)


def test_without_dap3d_there_is_nothing_to_audit(audit, monkeypatch, capsys):
    monkeypatch.setattr(audit, "ROOT", "dap3d-that-is-not-there")
    monkeypatch.setattr(audit, "known_holes", lambda packages: ([], "not asked for"))
    assert audit.main() == 1
    assert "dap3d-that-is-not-there is not installed here" in capsys.readouterr().out


def test_all_that_is_installed_may_be_passed_on(audit):
    packages = audit.needed(audit.ROOT, audit.EXTRAS)
    assert {"attrs", "numpy", "llvmlite", "sympy", "trimesh"} <= set(packages)
    assert "pytest" not in packages
    assert list(audit.licence_faults(packages)) == []


@pytest.mark.parametrize(
    ("about", "good"),
    [
        ({"License_Expression": "MIT"}, True),
        ({"License_Expression": "Apache-2.0 OR GPL-3.0-only"}, True),
        ({"License_Expression": "MIT AND GPL-3.0-only"}, False),
        ({"License_Expression": "GPL-3.0-or-later"}, False),
        ({"License_Expression": "(MIT OR GPL-3.0-only) AND X"}, False),
        ({"Classifier": "License :: OSI Approved :: BSD License"}, True),
        ({"Classifier": "License :: OSI Approved :: GNU General Public License (GPL)"}, False),
        ({"License": "MIT License"}, True),
        ({"License": "ask us"}, False),
        ({"License": "MIT\nbut not on Sundays"}, False),
        ({}, False),
    ],
)
def test_licences(audit, about, good):
    assert (list(audit.licence_faults({"x": package(**about)})) == []) is good


HOLE = '{"dependencies": [{"name": "numpy", "version": "1", "vulns": [{"id": "CVE-1", ' \
       '"fix_versions": ["2"]}]}]}'  # fmt: skip


@pytest.mark.parametrize(
    ("stdout", "stderr", "code", "words"),
    [
        ("", "error: no network\n", 0,
         "skipped: known holes were not asked for: error: no network"),
        (HOLE, "", 1, "CVE-1"),
    ],
    ids=["no network", "a hole"],
)  # fmt: skip
def test_known_holes_are_faults_where_there_is_a_network(
    audit, monkeypatch, capsys, stdout, stderr, code, words
):
    done = SimpleNamespace(stdout=stdout, stderr=stderr, returncode=1)
    monkeypatch.setattr(audit.subprocess, "run", lambda *_, **__: done)
    assert audit.main() == code
    assert words in capsys.readouterr().out
