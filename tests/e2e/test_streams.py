"""Streams that are closed, full or left by their reader."""

import shlex
import subprocess

import pytest
from tests.e2e.conftest import COMMAND, environment


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
