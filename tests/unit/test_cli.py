"""The parts of the command line that need no process of their own."""

import contextlib
import importlib
import json
import signal

import attrs
import click
import pytest
from click.testing import CliRunner

from dap3d_core.cli import main
from dap3d_core.cli.app import dap3d
from dap3d_core.cli.console.console import clean, count, plain, seconds, size
from dap3d_core.cli.framework.error_messages import report_error
from dap3d_core.cli.framework.options import SETTINGS
from dap3d_core.cli.process import exit_codes
from dap3d_core.cli.process.signals import SignalHandler
from dap3d_core.scene import INTEGRATORS, METHODS, Mistake, SceneError, Simulation

COMMANDS = ("run", "resume", "rerun", "sweep", "check", "models", "plugins", "describe",
            "new-plugin", "check-plugin", "info", "post", "export", "plot", "animate", "view",
            "report", "import-matlab")  # fmt: skip


def test_every_command_is_there_and_has_help():
    assert tuple(dap3d.commands) == COMMANDS
    for name in COMMANDS:
        done = CliRunner().invoke(dap3d, [name, "--help"])
        assert done.exit_code == 0
        assert "--debug" in done.output


def test_main_takes_the_words_and_returns_the_exit_code(capsys):
    assert main(["--version"]) == exit_codes.DONE
    assert capsys.readouterr().out.startswith("dap3d, version")
    assert main(["nothing"]) == exit_codes.REFUSED
    assert "there is no command 'nothing'" in capsys.readouterr().err


def test_help_names_every_method_and_integrator():
    text = CliRunner().invoke(dap3d, ["run", "--help"]).output
    for word in (*METHODS, *INTEGRATORS):
        assert word in text


def test_options_of_run_are_settings_of_a_scene():
    known = {field.name for field in attrs.fields(Simulation)}
    options = {option for p in dap3d.commands["run"].params for option in p.opts}
    assert SETTINGS.keys() <= known
    assert set(SETTINGS.values()) <= options


# ---------------------------------------------------------------------------- failures


def told(error, **options):
    """Exit code and object that ``report`` makes of an error, and what is on stderr."""

    @click.command()
    def command():
        click.get_current_context().exit(
            report_error(error, **{"debug": False, "as_json": True} | options)
        )

    done = CliRunner().invoke(command)
    return done.exit_code, json.loads(done.stdout) if done.stdout else None, done.stderr


def test_what_nobody_expects_is_one_line_and_a_hint():
    code, found, err = told(RuntimeError("two\nlines"))
    assert (code, found["exit_code"]) == (1, 1)
    assert found["error"] == "unexpected RuntimeError: two lines"
    assert "--debug" in err
    assert "Traceback" not in err


def test_debug_shows_the_traceback():
    code, _, err = told(RuntimeError("here"), debug=True)
    assert code == 1
    assert "RuntimeError: here" in err


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (KeyboardInterrupt(), 130),
        (exit_codes.Terminated("ended by SIGTERM"), 1),
        (exit_codes.Refused("no"), 2),
        (MemoryError(), 1),
        (OSError("disk full"), 1),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else str(value),
)
def test_errors_have_their_exit_codes(error, code):
    found, data, err = told(error)
    assert found == data["exit_code"] == code
    assert len(err.splitlines()) == 1


def test_mistakes_are_told_and_listed():
    mistakes = [
        Mistake("a.b", float("nan"), "wrong", "ab", "do", "f.toml", 3),
        Mistake("c", 1, "x"),
    ]
    code, found, err = told(SceneError(mistakes))
    assert code == 2
    assert found["mistakes"][0] == {
        "file": "f.toml", "line": 3, "key": "a.b", "value": None, "what": "wrong",
        "nearest": "ab", "remedy": "do",
    }  # fmt: skip
    assert err.splitlines()[:2] == ["2 mistakes:", "f.toml:3: a.b = nan: wrong; did you mean 'ab'?"]


# ---------------------------------------------------------------------------- signals


def test_a_signal_before_the_run_raises_at_once():
    with pytest.raises(KeyboardInterrupt), SignalHandler():
        signal.raise_signal(signal.SIGINT)
    with pytest.raises(exit_codes.Terminated, match="SIGTERM"), SignalHandler():
        signal.raise_signal(signal.SIGTERM)


def test_during_a_run_it_waits_for_the_end_of_the_chunk_once():
    with SignalHandler() as stopping:
        stopping.raise_pending()
        signal.raise_signal(signal.SIGTERM)
        with pytest.raises(exit_codes.Terminated):
            stopping.raise_pending()
        stopping.raise_pending()  # told once
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_an_interrupt_that_a_package_swallowed_is_not_forgotten():
    def stumble():
        with contextlib.suppress(BaseException):
            signal.raise_signal(signal.SIGINT)
        raise AttributeError("half imported")

    with pytest.raises(KeyboardInterrupt), SignalHandler():
        stumble()


def test_handlers_are_put_back():
    before = signal.getsignal(signal.SIGTERM)
    with SignalHandler():
        assert signal.getsignal(signal.SIGTERM) != before
    assert signal.getsignal(signal.SIGTERM) == before


# ---------------------------------------------------------------------------- rendering


def test_control_characters_do_not_reach_the_terminal():
    assert clean("a\x1b[31mb\tc\r\nd") == "a\\x1b[31mb c \nd"


def test_json_holds_nothing_that_is_no_json():
    numpy = importlib.import_module("numpy")
    data = {"a": numpy.array([1.0, numpy.nan]), 2: (float("inf"), numpy.int64(3)), "p": {1}}
    assert plain(data) == {"a": [1.0, None], "2": [None, 3], "p": [1]}
    assert plain({"digits that Python refuses to write": 16**5000 - 1}) == {
        "digits that Python refuses to write": "0x" + "f" * 5000
    }


def test_numbers_for_people():
    assert [seconds(s) for s in (0.0123, 1.234, 119.0, 125.0, 7300.0)] == [
        "12.3 ms", "1.23 s", "119 s", "2 min 5 s", "2 h 1 min",
    ]  # fmt: skip
    assert [size(n) for n in (999, 1500, 2_345_000, 5e9)] == [
        "999 bytes",
        "1.5 kB",
        "2.35 MB",
        "5 GB",
    ]
    assert [count(n, "body", "bodies") for n in (0, 1, 2000)] == [
        "no bodies",
        "1 body",
        "2,000 bodies",
    ]
