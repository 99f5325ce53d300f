"""A result that is drawn; no figure stays open."""

import matplotlib
import pytest
from support.results import circling

matplotlib.use("Agg")


@pytest.fixture(scope="module")
def result():
    return circling()[0]


@pytest.fixture(autouse=True)
def closed():
    yield
    from matplotlib import pyplot

    pyplot.close("all")
