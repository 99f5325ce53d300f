"""The nearest right spelling: of few words and of many, where no comparison of all ends in time."""

import pytest

from dap3d_core.registry.suggestions import LONGEST, nearest, some

MANY = [f"left_rear_suspension_{k:05d}" for k in range(50_000)]


@pytest.mark.parametrize(
    ("word", "allowed", "meant"),
    [
        # a slip among many words
        ("left_raer_suspension_31234", MANY, "left_rear_suspension_31234"),
        ("lfet_rear_suspension_31234", MANY, "left_rear_suspension_31234"),
        ("left_rear_suspensoin_31234", MANY, "left_rear_suspension_31234"),
        ("LEFT_rear_suspension_31234", MANY, "left_rear_suspension_31234"),
        ("left_rear_suspension_31234x", MANY, "left_rear_suspension_31234"),
        ("wheel", MANY, ""),
        ("crank", [*MANY, "crankshaft"], "crankshaft"),  # an abbreviation
        # what other programs call a name
        ("inertia", ["Jp", "mass", "r"], "Jp"),
        ("Quaternion", ["p", "r"], "p"),
        ("title", ["bodies", "scene"], "scene"),
        ("title", ["name", "schema"], "name"),
        ("velocity", ["velocity_x", "r_dot"], "r_dot"),
        ("inertia", ["mass"], ""),
        ("z_i", ["P_i", "a_i", "teeth_i"], "teeth_i"),
        ("q_i", ["P_i", "a_i", "teeth_i"], ""),  # no more alike than the letter of a body
        ("axis_i", ["P_i", "a_i", "a_j"], "a_i"),
        ("a_k", ["P_i", "a_i"], "a_i"),
        ("ROD", ["Rod", "rod"], "Rod"),  # two of other case: the first
        ("a" * (LONGEST + 1), ["a" * LONGEST], ""),  # nothing is similar to a very long word
    ],
    ids=lambda value: value[:32] if isinstance(value, str) else "",
)
def test_the_nearest_word(word, allowed, meant):
    assert nearest(word, allowed) == meant


def test_many_slips_among_many_words_come_to_an_end():
    """Each compared with all took minutes for some hundreds: no scene may hang without a word."""
    slips = [name.replace("rear", "raer") for name in MANY[-60:]]
    assert [nearest(slip, MANY) for slip in slips] == MANY[-60:]


def test_of_many_names_the_first_are_listed():
    assert some("abc", 2) == "a, b and 1 more"
