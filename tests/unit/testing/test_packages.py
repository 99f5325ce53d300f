"""Tests of installed packages: those that a distribution brings are run, one without is said so."""

import json
import textwrap

import pytest
from support.internals import packages
from support.plain import in_another_process

import dap3d_core as dap

pytestmark = in_another_process

TYPE = """
    from dap3d_core.interface import Body, Force, body, hookimpl, number

    interface_version = 1

    class Push(Force):
        \"\"\"A spring to the origin along x.\"\"\"

        keyword = "push"
        body_i: Body = body()
        k: float = number(default=1.0)

        def wrench(r_i, k):
            return (((-k * r_i[0], 0.0, 0.0), (0.0, 0.0, 0.0)),)

        def energy(r_i, k):
            return {energy} * k * r_i[0] ** 2

    @hookimpl
    def dap3d_forces():
        return [Push]
"""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Put a distribution with the type ``push`` and files on sys.path."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delenv("DAP3D_BLOCK", raising=False)

    def put(name, files, *, energy="0.5", url=None):
        module = f"{name.replace('-', '_')}_module"
        files = {f"{module}.py": textwrap.dedent(TYPE.format(energy=energy)), **files}
        info = f"{name.replace('-', '_')}-1.2.dist-info"
        files |= {
            f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n",
            f"{info}/entry_points.txt": f"[dap3d.forces]\npush = {module}\n",
            f"{info}/RECORD": "".join(f"{file},,\n" for file in files),
        }
        if url:
            origin = {"url": url, "dir_info": {"editable": True}}
            files[f"{info}/direct_url.json"] = json.dumps(origin)
        for file, text in files.items():
            (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / file).write_text(text)

    return put


@pytest.mark.slow
def test_tests_that_are_installed_are_run(install):
    """In files test_*.py and *_test.py; the outcome of one that fails has its last lines."""
    fails = "def test_it():\n    assert 6 * 7 == 41, 'no answer'\n"
    install("one", {"one_module/test_a.py": fails, "one_module/b_test.py": "def test_b(): pass\n"})
    tests = packages.run_tests("one")
    assert (tests.state, tests.words.split(" in ")[0]) == ("failed", "1 failed, 1 passed")
    assert "no answer" in tests.output


@pytest.mark.slow
def test_tests_of_an_editable_install_are_those_of_its_sources(install, tmp_path):
    """In its folder ``tests``, with the settings of its folder."""
    (tmp_path / "src" / "tests").mkdir(parents=True)
    (tmp_path / "src" / "tests" / "odd_name.py").write_text("def test_it(): pass\n")
    (tmp_path / "src" / "pytest.ini").write_text("[pytest]\npython_files = odd*.py\n")
    install("two", {}, url=(tmp_path / "src").as_uri())
    tests = packages.run_tests("two")
    assert (tests.state, tests.words.split(" in ")[0]) == ("passed", "1 passed")


@pytest.mark.slow
def test_packages_without_tests_and_without_pytest(install, monkeypatch):
    """Nothing is wrong with the former; of the latter nothing is known."""
    install("three", {})
    assert packages.run_tests("three") == packages.PackageTests("none", "it brings no tests")
    install("four", {"test_nothing.py": "x = 1\n"})
    assert packages.run_tests("four").words == "pytest finds no tests in its files"
    monkeypatch.setattr(packages, "find_spec", lambda name: None)
    tests = packages.run_tests("four")
    assert (tests.state, tests.words) == ("not run", "pytest is not installed: pip install pytest")


def test_two_packages_that_share_a_keyword_are_both_checked(install, monkeypatch):
    """Their formulas, by package; progress says what is next."""
    monkeypatch.setattr(packages, "OWN", "no own package")
    monkeypatch.setenv("DAP3D_BLOCK", "dap3d,dap3d-example")
    install("right", {})
    install("wrong", {}, energy="0.25")
    said = []
    right, wrong = packages.check_packages(dap.load_registry(), said.append)
    assert (right.name, right.ok, right.types[0].keyword) == ("right", True, "push")
    assert not wrong.ok
    assert wrong.tests.state == "none"
    assert "energy" in {finding.check for finding in wrong.types[0].findings}
    assert said == ["right: checking push", "right: running its tests",
                    "wrong: checking push", "wrong: running its tests"]  # fmt: skip
