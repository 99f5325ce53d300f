"""What makes a controller."""

import pytest

import dap3d_core as dap


@pytest.mark.parametrize("every", [0.0, -1.0, float("inf"), float("nan"), True, "1"])
def test_every_is_a_positive_time(every):
    """Anything else is refused where it is made."""
    with pytest.raises(ValueError, match=r"every is .*; it should be a positive number of seconds"):
        dap.Controller(every=every, update=lambda t, state: {})


def test_update_is_a_function():
    """A dict, say, is not."""
    with pytest.raises(TypeError, match=r"update is .*; it should be a function of t"):
        dap.Controller(every=0.1, update={"push": 1.0})


def test_title_is_the_name_or_that_of_the_function():
    """A callable object has that of its class."""

    class Pid:
        def __call__(self, t, state):
            return {}

    def law(t, state):
        return {}

    assert dap.Controller(every=1.0, update=law).title == "law"
    assert dap.Controller(every=1.0, update=Pid()).title == "Pid"
    assert dap.Controller(every=1.0, update=law, name="height").title == "height"
