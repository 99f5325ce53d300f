"""The group of commands, its exit codes, and what a start imports."""

import subprocess
import sys

import pytest
from click.testing import CliRunner
from support.internals import INTEGRATORS, METHODS

from dap3d_core.cli import main
from dap3d_core.cli.app import COMMANDS, SYNONYMS, dap3d


def test_every_command_has_help_and_the_common_options():
    assert list(dap3d.commands) == list(COMMANDS)
    for name, command in dap3d.commands.items():
        assert command.name == name
        done = CliRunner().invoke(dap3d, [name, "--help"])
        assert done.exit_code == 0
        assert "--debug" in done.output
        assert "--no-color" in done.output


def test_main_takes_the_words_and_returns_the_exit_code(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("dap3d, version")
    assert main(["nothing"]) == 2
    assert "there is no command 'nothing'" in capsys.readouterr().err


@pytest.mark.parametrize(("word", "command"), list(SYNONYMS.items()))
def test_a_command_by_another_name_is_suggested(word, command, capsys):
    """Where the nearest spelling is another command: linearize is no inverse."""
    assert command in {*COMMANDS, "--help"}
    assert main([word]) == 2
    assert f"did you mean '{command}'?" in capsys.readouterr().err


def test_help_names_every_method_and_integrator():
    text = CliRunner().invoke(dap3d, ["run", "--help"]).output
    for word in (*METHODS, *INTEGRATORS):
        assert word in text


def test_help_is_quick_to_import():
    """Help loads none of the heavy packages, and the module of no other command, which the list
    of commands does."""
    script = (
        "import sys; from dap3d_core.cli import main; code = main(['run', '--help']);"
        "heavy = {'numpy', 'scipy', 'llvmlite', 'matplotlib', 'netCDF4', 'xarray', 'rich'};"
        "found = {'dap3d_core.cli.commands.plot'} & sys.modules.keys(); main(['--help']);"
        "print(sorted(found | heavy & sys.modules.keys()), code, file=sys.stderr)"
    )
    run = [sys.executable, "-c", script]
    assert subprocess.run(run, capture_output=True, text=True).stderr.strip() == "[] 0"
