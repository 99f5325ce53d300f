"""Texts are parsed by several threads at once."""

import ast
import gc
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor

import pytest

from dap3d_core.kernels.syntax import parse


class Finalised:
    """Garbage in a cycle; what its end runs lets other threads run, while a text is parsed."""

    def __init__(self):
        self.itself = self

    def __del__(self):
        for _ in range(20):
            pass


@pytest.mark.slow
def test_threads_parse_at_once():
    """Sweeps build scenes anew in threads; Python 3.11 itself fails in an eighth of such calls."""
    text = "+".join(f"(a{k} * (b - (c / (d + {k}))))" for k in range(100))
    interval, threshold = sys.getswitchinterval(), gc.get_threshold()
    sys.setswitchinterval(1e-6)
    gc.set_threshold(50, 2, 2)
    try:
        with ThreadPoolExecutor(4) as pool:
            trees = list(pool.map(lambda _: (Finalised(), parse(text, "eval"))[1], range(60)))
    finally:
        sys.setswitchinterval(interval)
        gc.set_threshold(*threshold)
    assert {ast.dump(tree) for tree in trees} == {ast.dump(ast.parse(text, mode="eval"))}


def test_warnings_of_the_parser_are_left_out():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert parse("1if 1else 2", "eval").body.test.value == 1
