"""What `make unit-nojit` leaves out, where kernels run as plain Python."""

import pytest

from support.internals import jit_is_on

#: A long run, a hundred times as long in plain Python; shorter tests run the same lines.
long_in_plain_python = pytest.mark.skipif(
    not jit_is_on(), reason="long in plain Python; shorter tests run the same lines"
)
#: What is tested happens in another process: the same test, whatever this process does.
in_another_process = pytest.mark.skipif(
    not jit_is_on(), reason="what happens in another process is seen by `make test`"
)
