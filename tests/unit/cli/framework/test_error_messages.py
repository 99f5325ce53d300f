"""Errors as messages, JSON and exit codes."""

import json

import click
import pytest
from click.testing import CliRunner
from support.internals import Refused, Terminated

from dap3d_core.cli.framework import error_messages


def reported(error, debug=False):
    """Exit code, JSON object and text on stderr of an error."""

    @click.command()
    def command():
        click.get_current_context().exit(
            error_messages.report_error(error, debug=debug, as_json=True)
        )

    done = CliRunner().invoke(command)
    return done.exit_code, json.loads(done.stdout), done.stderr


def test_an_unexpected_error_is_one_line_and_a_hint_but_for_debug():
    code, data, err = reported(RuntimeError("two\nlines"))
    assert (code, data["exit_code"]) == (1, 1)
    assert data["error"] == "unexpected RuntimeError: two lines"
    assert "--debug" in err
    assert "Traceback" not in err
    code, _, err = reported(RuntimeError("here"), debug=True)
    assert code == 1
    assert "RuntimeError: here" in err


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (KeyboardInterrupt(), 130),
        (Terminated("ended by SIGTERM"), 1),
        (Refused("no"), 2),
        (MemoryError(), 1),
        (OSError("disk full"), 1),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else str(value),
)
def test_errors_have_their_exit_codes(error, code):
    found, data, err = reported(error)
    assert found == data["exit_code"] == code
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("error", [Refused("cannot write a.nc: HDF error"), KeyError()])
def test_errors_of_libraries_without_memory_are_a_lack_of_it(monkeypatch, capsys, error):
    """They fail in words of their own where the limit on memory leaves nothing."""
    monkeypatch.setattr(error_messages, "is_used_up", lambda: True)
    monkeypatch.setattr(error_messages, "address_space", lambda: 400_000 * 1024)
    assert error_messages.report_error(error, debug=False, as_json=False) == 1
    assert capsys.readouterr().err.startswith("there is not enough memory for this")
