"""Options and their types."""

import attrs
import click
import pytest
from support.command_line import dap3d

from dap3d_core.cli.framework.options import SETTINGS, Seconds, Tolerance
from dap3d_core.scene import Simulation


def test_options_of_run_are_settings_of_a_scene():
    known = {field.name for field in attrs.fields(Simulation)}
    names = {option for p in dap3d.commands["run"].params for option in p.opts}
    assert SETTINGS.keys() <= known
    assert set(SETTINGS.values()) <= names


def test_durations_have_units():
    seconds = [Seconds().convert(text, None, None) for text in ("90", "90s", "5min", "2h", "0.5h")]
    assert seconds == [90.0, 90.0, 300.0, 7200.0, 1800.0]


def test_tolerances_are_numbers_by_quantity():
    assert Tolerance().convert("1e-9", None, None) == 1e-9
    assert Tolerance().convert("r=1e-12, v=1e-9", None, None) == {"r": 1e-12, "v": 1e-9}
    with pytest.raises(click.BadParameter, match="neither a number nor"):
        Tolerance().convert("r=small", None, None)
