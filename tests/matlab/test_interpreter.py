"""The part of MATLAB that is read: values, order of precedence, and what is refused."""

import math

import numpy as np
import pytest
from support.matlab import variables_of

from dap3d_matlab.language.structures import STRUCTURES
from dap3d_matlab.language.values import Broken, Struct


def value_of(expression, before=""):
    variables, mistakes = variables_of(f"{before}\nx = {expression};")
    assert mistakes == [], expression
    return variables["x"]


def refused(text):
    """The only mistake of a text."""
    _, mistakes = variables_of(text)
    assert len(mistakes) == 1, mistakes
    return mistakes[0]


# Each value from MATLAB's rules by hand: power and transpose bind before signs, signs before
# products, and all from left to right.
NUMBERS = {
    "1.5": 1.5,
    ".5": 0.5,
    "2.": 2.0,
    "1e-3": 1e-3,
    "1.5d2": 150.0,
    "-2^2": -4.0,
    "2^-1": 0.5,
    "2^3^2": 64.0,
    "-2.^2": -4.0,
    "3 - -2^2": 7.0,
    "2*3^2": 18.0,
    "8/4/2": 1.0,
    "8/4*2": 4.0,
    "1 - 2 - 3": -4.0,
    "2 + 3*4": 14.0,
    "(2 + 3)*4": 20.0,
    "-(1 + 2)": -3.0,
    "- - 2": 2.0,
    "2^(-1)^2": 0.25,
    "pi/8": math.pi / 8,
    "cos(pi/3)": math.cos(math.pi / 3),
    "sqrt(2)/2": math.sqrt(2) / 2,
    "atan2(1, -1)": 3 * math.pi / 4,
    "deg2rad(180)": math.pi,
    "norm([3; 4])": 5.0,
    "abs(-3)": 3.0,
    "[1 2 3]*[4; 5; 6]": 32.0,
}


@pytest.mark.every(1)
@pytest.mark.parametrize("expression", NUMBERS)
def test_numbers(expression):
    found = value_of(expression)
    assert found.shape == (1, 1)
    assert found[0, 0] == pytest.approx(NUMBERS[expression], rel=1e-15)


MATRICES = {
    "[1 2 3]": [[1, 2, 3]],
    "[1, 2, 3]": [[1, 2, 3]],
    "[1; 2; 3]": [[1], [2], [3]],
    "[1 -2]": [[1, -2]],
    "[1 - 2]": [[-1]],
    "[1 -2^2]": [[1, -4]],
    "[1 2\n 3 4]": [[1, 2], [3, 4]],
    "[1 2 ... and so on\n 3 4]": [[1, 2, 3, 4]],
    "[1 2]'": [[1], [2]],
    "[1 2].'": [[1], [2]],
    "[1 2].^2'": [[1], [4]],  # power and transpose bind alike, from left to right
    "[1 2].*[3 4]": [[3, 8]],
    "[4 6]./[2 3]": [[2, 2]],
    "[1 2] + 1": [[2, 3]],
    "2*[1; 2]": [[2], [4]],
    "[2 4]/2": [[1, 2]],
    "-[1 2]": [[-1, -2]],
    "[[1 2]; [3 4]]": [[1, 2], [3, 4]],
    "eye(2)": [[1, 0], [0, 1]],
    "zeros(2, 1)": [[0], [0]],
    "ones(1, 2)": [[1, 1]],
    "diag([1 2])": [[1, 0], [0, 2]],
    "[cos(0) sin(0)]": [[1, 0]],
}


@pytest.mark.parametrize("expression", MATRICES)
def test_matrices(expression):
    np.testing.assert_array_equal(value_of(expression), np.array(MATRICES[expression], float))


def test_variables_elements_and_text():
    before = "a = [1 2; 3 4]; a(2, 1) = 7; b = a(3); c = a(end); s = 'it''s'; t = \"a\"\"b\";"
    variables, mistakes = variables_of(before)
    assert mistakes == []
    assert variables["a"].tolist() == [[1, 2], [7, 4]]
    assert (variables["b"].item(), variables["c"].item()) == (2, 4), "down the columns"
    assert (variables["s"], variables["t"]) == ("it's", 'a"b')


def test_structures_are_copied_and_their_fields_set():
    variables, mistakes = variables_of(
        "function inBodies\ninclude_global\nglobal Bodies\n"
        "B1 = Body_struct, B1.mass = 2; B1.r = [1; 2; 3]; % a comment\n"
        "%{\nB1.mass = 100;\n%}\n"
        "B2 = B1; B2.mass = B1.mass + 1; B2.r(3) = -B1.r(1); B1.mass = 5\n"
        "Bodies = [B1; B2]; Bodies(2).w = [0 0 1]; Bodies(end+1) = Body_struct;\n"
        "Bodies(3).mass = 9;\nend\n"
    )
    assert mistakes == []
    first, second, third = variables["Bodies"]
    assert [s.value("mass").item() for s in (first, second, third)] == [5, 3, 9]
    assert second.value("r").ravel().tolist() == [1, 2, -1]
    assert second.value("w").tolist() == [[0, 0, 1]]
    assert variables["B2"].value("w").tolist() == [[0], [0], [0]], "the array holds a copy"
    assert (second.variable, second.place_of("r").line) == ("B2", 8)
    assert third.variable == "Bodies(3)"


def test_fields_that_were_not_given_have_the_defaults_of_the_manual():
    text = "B1 = Body_struct; x = B1.p'; y = B1.color; z = B1.pts; C1 = Funct_struct; c = C1.coeff;"
    variables, mistakes = variables_of(text)
    assert mistakes == []
    assert variables["x"].tolist() == [[1, 0, 0, 0]]
    assert variables["y"] == "k"
    assert variables["z"].shape == variables["c"].shape == (0, 0)


def test_every_structure_of_the_manual_has_a_maker():
    for kind in STRUCTURES:
        variables, mistakes = variables_of(f"a = {kind}_struct; b = {kind}_struct(); c = {kind};")
        assert mistakes == []
        for value in variables.values():
            assert isinstance(value, Struct)
            assert value.structure.kind == kind


REFUSED = {
    "system('ls')": "the function system is outside the language",
    "eval('x = 1')": "the function eval is outside the language",
    "system ls": "the command system is outside the language",
    "!ls": "is outside the language that is read; nothing is run",
    "x = fopen('a')": "the function fopen is outside the language",
    "for k = 1:3\n y = k;\nend": "a loop is outside the language",
    "while 1\nend": "a loop is outside the language",
    "if 1\n y = 2;\nend": "a condition is outside the language",
    "switch 1\ncase 1\nend": "a condition is outside the language",
    "try\n y = 2;\ncatch\nend": "a block try is outside the language",
    "x = @sin": "a function handle is outside the language",
    "x = @(t) t": "a function handle is outside the language",
    "x = {1, 2}": "a cell array is outside the language",
    "x = 1:3": "a range is outside the language",
    "x = 1 == 2": "a comparison is outside the language",
    "x = ~1": "a logical expression is outside the language",
    "[a, b] = size(1)": "cannot be assigned to",
    "x = y": "y is not defined",
    "x = sine(1)": "did you mean 'sin'?",
    "x = sin": "the function sin needs arguments",
    "x = sin(1, 2)": "takes one argument",
    "x = 1/0": "not a finite real number",
    "x = sqrt(-1)": "not a finite real number",
    "x = 1e999": "not a finite real number",
    "x = 2i": "not a decimal number",
    "x = [1 2; 3]": "rows and columns do not fit together (sizes 1x1 1x1; 1x1)",
    "x = [1 2] + [1 2 3]": "sizes 1x2 and 1x3 do not fit",
    "x = [1; 2] + [1 2]": "sizes 2x1 and 1x2 do not fit",
    "x = [1 2]*[3 4]": "matrices of 1x2 and 1x2 cannot be multiplied",
    "x = 1/[1 2]": "division by a matrix of 1x2 is not read",
    "x = [1 2]^2": "powers of matrices are not read",
    "x = 2^-1^2": "read differently by different programs",
    "x = 2 \\ 1": "the operator \\ is not read",
    "x = 'a' + 1": "a number is needed here, not text",
    "x = ['a' 'b']": "text in brackets is not read",
    "x = [Body_struct; 1]": "structures and a number in one array",
    "x = [Body_struct; Point_struct]": "Body_struct and Point_struct in one array",
    "x = zeros(1000, 1000)": "no part of a model",
    "x = ones(5000, 1)*ones(1, 5000)": "no part of a model",
    "B1.mass = 2": "B1 is not defined yet",
    "B1 = Body_struct; B1.m = 2": "has no field m; did you mean 'mass'?",
    "B1 = Body_struct; B1.masss = 2": "did you mean 'mass'?",
    "B1 = Body_struct; B1.r(4) = 2": "index 4 is outside; there are 3 elements",
    "B1 = Body_struct; B1.r(1.5) = 2": "an index is one whole number",
    "B1 = Body_struct; B1.r.x = 2": "fields of fields are not read",
    "B1 = Body_struct; B1.('r') = 2": "a field is named by a word",
    "B1 . mass = 3": "reads this as a command",
    "x += 1": "reads this as a command",
    "function f\nx = 1;\nend\nfunction g\nend": "a second function",
    "x = 0; x(1:2) = 1": "a range is outside the language",
    f"x = {'(' * 60}1{')' * 60}": "more than 50 brackets",
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_outside_is_refused_with_line_and_text(text):
    words = refused(f"% first line\n{text};\n")
    assert words.startswith("file.m:"), words
    assert REFUSED[text] in words
    line = 5 if "second function" in words else 2
    assert words.startswith(f"file.m:{line}: ")


@pytest.mark.parametrize(
    "text",
    [
        "x = ;",
        "B = [1 2",
        "x = (1",
        "x = 1 2",
        "S.type = ‘ptp’;",
        "x = 'open",
        "x = )",
        "x = 3 −2;",
    ],
)
def test_errors_of_syntax_have_a_line(text):
    _, mistakes = variables_of(f"y = 1;\n{text}\n")
    assert mistakes
    assert mistakes[0].startswith("file.m:2: not valid MATLAB"), mistakes
    if not text.isascii():
        assert "typography" in mistakes[0]


def test_one_mistake_is_not_reported_many_times():
    """What depends on a broken value is broken too, without a word."""
    variables, mistakes = variables_of(
        "a = unknown; b = a + 1; B1 = Body_struct; B1.r = [a; 0; 0]; c = B1.r(2);\n"
        "for k = 1:3\n d = k;\nend\ne = d;\nBodies = [B1];\nf = [a; B1];\n"
    )
    assert len(mistakes) == 2, mistakes
    for name in "abcdef":
        assert isinstance(variables[name], Broken), name
    assert isinstance(variables["Bodies"][0].value("r"), Broken)


def test_what_follows_a_return_is_not_reached():
    variables, mistakes = variables_of("function f\nx = 1;\nreturn\nx = 2;\nsystem('ls');\n")
    assert mistakes == []
    assert variables["x"].item() == 1


def test_a_long_sum_is_no_deep_tree():
    assert value_of("1" + "+1" * 3000).item() == 3001
