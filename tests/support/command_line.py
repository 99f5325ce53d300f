"""Commands that run in this process."""

from click.testing import CliRunner

from dap3d_core.cli.app import dap3d


def output_of(*words, columns=80):
    """What a command prints, at some width; it ends well."""
    done = CliRunner().invoke(dap3d, [*map(str, words)], env={"COLUMNS": str(columns)})
    assert done.exit_code == 0, done.output
    return done.output


def lines_of(*words):
    """The lines that a command prints, which fit into 60 columns; it ends well."""
    done = CliRunner().invoke(dap3d, [*map(str, words)], env={"COLUMNS": "60"})
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert max(map(len, lines)) <= 60
    return lines
