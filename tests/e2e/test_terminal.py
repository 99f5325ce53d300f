"""What terminals and streams show: nothing too wide, colours only where wanted, closed streams."""

import fcntl
import os
import pty
import re
import select
import shlex
import struct
import subprocess
import sys
import termios
import time

import pytest
from tests.e2e.conftest import COMMAND, environment

import dap3d_core as dap

#: Makes the terminal the one that Ctrl-C is typed in, then becomes the command.
IN_SESSION = (
    "import fcntl, os, sys, termios;"
    "fcntl.ioctl(0, termios.TIOCSCTTY, 0);"
    "os.execv(sys.argv[1], sys.argv[1:])"
)
CONTROL = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")


def in_terminal(dap3d, width, *arguments, answers="", **variables):
    """Run a command in a terminal of some width; exit code and all that it shows."""
    main, child = pty.openpty()
    fcntl.ioctl(child, termios.TIOCSWINSZ, struct.pack("HHHH", 40, width, 0, 0))
    process = subprocess.Popen(
        [sys.executable, "-c", IN_SESSION, *COMMAND, *arguments],
        cwd=dap3d.folder,
        env=environment(TERM="xterm-256color", **variables),
        stdin=child,
        stdout=child,
        stderr=child,
        start_new_session=True,
    )
    os.close(child)
    shown, waiting = b"", answers.encode().splitlines(keepends=True)
    end = time.monotonic() + 120
    while time.monotonic() < end:
        ready, _, _ = select.select([main], [], [], 0.2)
        if not ready:
            if waiting and shown:  # it has asked
                os.write(main, waiting.pop(0))
            continue
        try:
            block = os.read(main, 65536)
        except OSError:  # the other end is closed
            break
        if not block:
            break
        shown += block
    os.close(main)
    return process.wait(timeout=60), shown.decode()


def lines(shown):
    """Lines as they stand on the screen, without what moves cursors and colours."""
    return [line for line in re.split(r"[\r\n]+", CONTROL.sub("", shown)) if line]


@pytest.mark.slow
def test_a_run_fits_a_narrow_terminal(dap3d):
    code, shown = in_terminal(dap3d, 60, "run", "fourbar3", "--t-end", "1")
    assert code == 0, shown
    assert max(map(len, lines(shown))) <= 60
    assert "fourbar3.nc written" in shown
    assert "\x1b[" in shown


@pytest.mark.slow
def test_no_color_is_respected(dap3d):
    _, shown = in_terminal(dap3d, 80, "run", "pen1", "--t-end", "0.1", NO_COLOR="1")
    assert not re.search(r"\x1b\[[0-9;]*(3[0-7]|38;)", shown)


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ("--help",),
        ("plugins",),
        ("describe", "rev", "--names"),
        ("check", "fourbar3"),
        ("check", "no_such_model_of_any_name_that_is_as_long_as_this_one_here_is"),
        ("run", "pen1", "--t_end", "1"),
    ],
    ids=" ".join,
)
def test_no_line_is_wider_than_60_columns(dap3d, arguments):
    done = dap3d(*arguments, COLUMNS=60)
    said = (done.stdout + done.stderr).splitlines()
    assert said
    assert [line for line in said if len(line) > 60] == []


@pytest.mark.slow
def test_without_a_model_it_asks_the_questions_of_the_manual(dap3d):
    answers = "no such\npen1\n\nsoon\n0.1\n0.05\ns\n"
    code, shown = in_terminal(dap3d, 80, "run", answers=answers)
    assert code == 0, shown
    for question in ("Which model", "correct the initial conditions", "Final time",
                     "Reporting time-step", "method"):  # fmt: skip
        assert question in shown
    assert "'soon' is not a valid" in shown
    result = dap.open(dap3d.folder / "pen1.nc")
    assert result.t.tolist() == [0.0, 0.05, 0.1]
    assert result.settings["correct"] is False  # the scene's value is the default


def test_questions_can_be_left(dap3d):
    code, shown = in_terminal(dap3d, 80, "run", answers="\x03\n")
    assert code == 130
    assert "Traceback" not in shown


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("models > /dev/full", 1),
        ("--help > /dev/full", 1),
        ("models >&-", 0),
        ("check no_such 2>&-", 2),
        ("run <&-", 2),
        ("models | true", 0),
    ],
)
def test_streams_that_take_nothing(tmp_path, line, code):
    script = f"set -o pipefail; {shlex.join(COMMAND)} {line}"
    done = subprocess.run(
        ["bash", "-c", script], cwd=tmp_path, env=environment(), capture_output=True, text=True
    )
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr
    assert len(done.stderr.splitlines()) <= 4


@pytest.mark.slow
def test_text_is_plain_where_the_encoding_is_ascii(tmp_path):
    (tmp_path / "stein.toml").write_text('[scene]\nname = "fällt"\n', encoding="utf-8")
    ascii_only = environment(LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0", COLUMNS="60")
    done = subprocess.run(
        [*COMMAND, "describe", "rev"], cwd=tmp_path, env=ascii_only, capture_output=True, check=True
    )
    assert done.stdout.isascii()
    refused = subprocess.run(
        [*COMMAND, "check", "stein.toml"], cwd=tmp_path, env=ascii_only, capture_output=True
    )
    assert refused.returncode == 2
    assert b"Traceback" not in refused.stderr
