"""Lines of keys are found in every form that TOML allows."""

import tomllib

from support.internals import lines_of

TEXT = '''\
# a comment with [bodies.x] and "quotes
title = "a # no comment" # but this is
long = """
[not.a.table] \\"""
key = 3
""" # after
raw = \'\'\'
[neither]\'\'\'
odd = """five quotes: """""

[ bodies . "crank \\u00e9" ] # header
mass = 1.0
'r' = [
  0.0, # ]
  1.0,
  2.0,
]
inline = { a = 1, "b c" = [1, 2], d = { e = "}" } }
x.y.z = 1979-05-27T07:32:00Z
nested = [[1, 2], [{ u = 1 }, { v = 2 }], "]"]

[[things]]
n = 1
[[things]]
n = 2
[things.sub]
m = 3
[[things.more]]
k = 4
[last]'''


def test_lines_of_all_forms():
    tomllib.loads(TEXT)  # it is TOML
    crank = "crank é"
    expected = {
        ("title",): 2,
        ("long",): 3,
        ("raw",): 7,
        ("odd",): 9,
        ("bodies",): 11,
        ("bodies", crank): 11,
        ("bodies", crank, "mass"): 12,
        ("bodies", crank, "r"): 13,
        ("bodies", crank, "inline"): 18,
        ("bodies", crank, "inline", "a"): 18,
        ("bodies", crank, "inline", "b c"): 18,
        ("bodies", crank, "inline", "d"): 18,
        ("bodies", crank, "inline", "d", "e"): 18,
        ("bodies", crank, "x"): 19,
        ("bodies", crank, "x", "y"): 19,
        ("bodies", crank, "x", "y", "z"): 19,
        ("bodies", crank, "nested"): 20,
        ("bodies", crank, "nested", 1, 0): 20,
        ("bodies", crank, "nested", 1, 0, "u"): 20,
        ("bodies", crank, "nested", 1, 1): 20,
        ("bodies", crank, "nested", 1, 1, "v"): 20,
        ("things",): 22,
        ("things", 0): 22,
        ("things", 0, "n"): 23,
        ("things", 1): 24,
        ("things", 1, "n"): 25,
        ("things", 1, "sub"): 26,
        ("things", 1, "sub", "m"): 27,
        ("things", 1, "more"): 28,
        ("things", 1, "more", 0): 28,
        ("things", 1, "more", 0, "k"): 29,
        ("last",): 30,
    }
    assert lines_of(TEXT) == expected
    assert lines_of(TEXT.replace("\n", "\r\n")) == expected


def test_a_text_that_is_no_toml_gives_what_was_found():
    assert lines_of("a = 1\nb = [[[") == {("a",): 1, ("b",): 2}
    assert lines_of("a = 1\n= 3\n") == {("a",): 1}
    assert lines_of("[a\n") == {("a",): 1}
    assert lines_of("") == {}
