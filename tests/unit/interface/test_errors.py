"""A lack of memory is seen through the exceptions that arose from it."""

import errno

import pytest

from dap3d_core.interface.errors import is_out_of_memory


@pytest.mark.parametrize(
    ("cause", "is_lack"),
    [(MemoryError(), True), (OSError(errno.ENOMEM, "no"), True), (KeyError("x"), False),
     (None, False)],
)  # fmt: skip
def test_the_cause_of_an_exception_counts(cause, is_lack):
    """One that was raised from itself has an end."""
    error = ValueError("something else")
    error.__cause__ = cause or error
    assert is_out_of_memory(error) == is_lack
