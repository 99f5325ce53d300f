"""The nearest right spelling: of few words and of many, where no comparison of all ends in time."""

import pytest

from dap3d_core.registry.suggestions import LONGEST, nearest, some

MANY = [f"left_rear_suspension_{k:05d}" for k in range(50_000)]


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("left_raer_suspension_31234", "left_rear_suspension_31234"),
        ("lfet_rear_suspension_31234", "left_rear_suspension_31234"),
        ("left_rear_suspensoin_31234", "left_rear_suspension_31234"),
        ("LEFT_rear_suspension_31234", "left_rear_suspension_31234"),
        ("left_rear_suspension_31234x", "left_rear_suspension_31234"),
        ("wheel", ""),
    ],
)
def test_one_slip_among_many_words_is_found(word, meant):
    assert nearest(word, MANY) == meant


def test_an_abbreviation_among_many_words_is_found():
    assert nearest("crank", [*MANY, "crankshaft"]) == "crankshaft"


@pytest.mark.parametrize(
    ("word", "allowed", "meant"),
    [
        ("inertia", ["Jp", "mass", "r"], "Jp"),
        ("Quaternion", ["p", "r"], "p"),
        ("title", ["bodies", "scene"], "scene"),
        ("title", ["name", "schema"], "name"),
        ("velocity", ["velocity_x", "r_dot"], "r_dot"),
        ("inertia", ["mass"], ""),
    ],
)
def test_what_other_programs_call_a_name_is_known(word, allowed, meant):
    assert nearest(word, allowed) == meant


def test_two_words_of_other_case_are_the_first():
    assert nearest("ROD", ["Rod", "rod"]) == "Rod"


def test_many_slips_among_many_words_come_to_an_end():
    """Each compared with all took minutes for some hundreds: no scene may hang without a word."""
    slips = [name.replace("rear", "raer") for name in MANY[-60:]]
    assert [nearest(slip, MANY) for slip in slips] == MANY[-60:]


def test_nothing_is_similar_to_a_very_long_word():
    assert nearest("a" * (LONGEST + 1), ["a" * LONGEST]) == ""


def test_of_many_names_the_first_are_listed():
    assert some("abc", 2) == "a, b and 1 more"
