"""Kernels that numba does not take: one line with its reason, where it stands, and what to do."""

import pytest
from support.own_types import registry_of

from dap3d_core.interface import Body, Force, PluginError, body, number
from dap3d_core.interface.checks import examine
from dap3d_core.interface.compiling import compile_all, compiled_loop
from dap3d_core.kernels.cache import jit_is_on
from dap3d_core.registry import load_registry

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="numba is off")

ZERO = (0.0, 0.0, 0.0)


class Pushing(Force):
    """What the types here have in common."""

    keyword = "pushing"
    body_i: Body = body()
    k: float = number(default=1.0)


class OfText(Pushing):
    def wrench(k):
        return (((float("{}".format(k)), 0.0, 0.0), ZERO),)  # noqa: UP032


class OfGenerator(Pushing):
    def wrench(r_i, k):
        return ((tuple(x * k for x in r_i), ZERO),)


class OfOpenFile(Pushing):
    def wrench(k):
        with open("/dev/null") as file:
            k = k if file else 0.0
        return (((k, 0.0, 0.0), ZERO),)


def of_a_helper(k):
    return k * len("{}".format(k))  # noqa: UP032


class OfHelper(Pushing):
    def wrench(k):
        return (((of_a_helper(k), 0.0, 0.0), ZERO),)


CASES = [(OfText, "format"), (OfGenerator, "yield"), (OfOpenFile, "with"), (OfHelper, "format")]


@pytest.mark.parametrize(("type_", "word"), CASES, ids=lambda x: getattr(x, "__name__", x))
def test_the_reason_is_one_line(type_, word):
    with pytest.raises(PluginError) as caught:
        compile_all(examine(type_))
    said = str(caught.value)
    assert "\n" not in said
    for words in (f"{type_.__name__}: numba cannot compile its kernels (pushing: wrench)", word,
                  "A kernel is plain"):  # fmt: skip
        assert words in said
    assert "Failed in nopython" not in said
    assert "test_compiling.py" in said
    assert len(said) < 500


@pytest.mark.parametrize("type_", [OfText, OfGenerator, OfHelper])
def test_it_says_in_which_line(type_):
    line = type_.wrench.__code__.co_firstlineno
    with pytest.raises(PluginError) as caught:
        compile_all(examine(type_))
    place = str(caught.value).partition(f"[{__file__}:")[2].partition("]")[0]
    inside = range(line, line + 3)
    helper = range(of_a_helper.__code__.co_firstlineno, of_a_helper.__code__.co_firstlineno + 2)
    assert int(place) in {*inside, *helper}


def test_the_list_of_types_says_it_where_it_compiles():
    registry = registry_of(OfText)
    quick = {t.keyword: t for t in registry.listing()}
    assert quick["pushing"].state == "ok"
    found = {t.keyword: t for t in registry.listing(compiling=True)}
    assert found["pushing"].state == "broken"
    assert "numba cannot compile" in found["pushing"].reason
    assert found["sph"].state == "ok"


def test_a_joint_compiles_with_its_friction_and_its_variants():
    examined = load_registry().get("joint", "disk")
    compile_all(examined)
    compile_all(load_registry().get("force", "ptp"))  # one of its variants calls a function
    assert compiled_loop(examined, "energy") is None
