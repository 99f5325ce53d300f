"""Places of a sweep in its file."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dap3d_core.study.sweep.schema import NOTE, boxes, note_letters


@given(st.lists(st.integers(1, 4), min_size=1, max_size=4).map(tuple), st.data())
def test_boxes_cover_a_run_of_places_once_and_in_order(shape, data):
    """Whatever the grid and the run: against the places themselves."""
    whole = np.arange(math.prod(shape))
    first = data.draw(st.integers(0, len(whole)))
    last = data.draw(st.integers(first, len(whole)))
    found = []
    for index, count in boxes(shape, first, last):
        block = whole.reshape(shape)[index]
        assert block.size == count > 0
        found += block.ravel().tolist()
    assert found == list(range(first, last))
    assert len(list(boxes(shape, first, last))) <= 2 * len(shape) - 1


def test_notes_are_cut_between_letters():
    short, long = note_letters(np.array(["short", "ü" * NOTE], dtype=object))
    assert short.tobytes().rstrip(b"\0") == b"short"
    assert len(long) == NOTE
    assert long.tobytes().rstrip(b"\0").decode().endswith("ü ...")
