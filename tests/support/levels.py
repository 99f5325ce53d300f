"""Which of the values of a parameter the quick tests take."""

import pytest


def quickly(values, count=1):
    """All values, of which `make test` takes the first ones and `make verify` the others."""
    rest = (pytest.param(value, marks=pytest.mark.slow) for value in values[count:])
    return [*values[:count], *rest]
