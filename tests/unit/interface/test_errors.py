"""A lack of memory is seen through the exceptions that arose from it."""

import errno

import pytest

from dap3d_core.interface.errors import is_out_of_memory


@pytest.mark.parametrize(
    ("cause", "is_lack"),
    [(MemoryError(), True), (OSError(errno.ENOMEM, "no"), True), (KeyError("x"), False)],
)
def test_the_cause_of_an_exception_counts(cause, is_lack):
    error = ValueError("something else")
    error.__cause__ = cause
    assert is_out_of_memory(error) == is_lack


def test_an_exception_that_was_raised_from_itself_has_an_end():
    error = ValueError("round")
    error.__cause__ = error
    assert not is_out_of_memory(error)
