"""[materials.NAME]: all are checked, used or not, each mistake once and in its place."""

import pytest

import dap3d_core as dap
from dap3d_core.scene import check, parse

BODY = "[bodies.ball]\nmass = 1.0\nJp = [1.0, 1.0, 1.0]\n"
CONTACT = '[contacts.c]\ntype = "ball_plane"\nP_i = "ball.O"\nradius = 0.1\nmaterial = "m"\n'
SHAPES = (
    '[shapes.ball]\ntype = "sphere"\nbody = "ball"\nradius = 0.1\ncollides = true\n'
    'material = "m"\n[shapes.floor]\ntype = "plane"\nbody = "ground"\ncollides = true\n'
    'material = "n"\n'
)


def mistakes(text):
    with pytest.raises(dap.SceneError) as caught:
        check(parse(BODY + text), dap.load_registry())
    return [(m.key, m.what) for m in caught.value.mistakes]


@pytest.mark.parametrize("use", ["", CONTACT, SHAPES], ids=["unused", "contact", "shapes"])
@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("[materials.m]\nmu = -1.0\n", "materials.m.mu", "at least 0"),
        ("[materials.m]\ne = 1.5\n", "materials.m.e", "at most 1"),
        ('[materials.m]\nmu_s = "x"\n', "materials.m.mu_s", "a number, not text"),
        ("[materials.m]\nmu = 0.5\nmu_s = 0.1\n", "materials.m.mu_s", "less than mu = 0.5"),
        ('[materials.m]\nlaw = "hertz"\n', "materials.m.law", '"poisson", "newton"'),
        ("[materials.m.with.m]\nmuu = 0.1\n", "materials.m.with.m.muu", "unknown key"),
        ("[materials.m.with.n]\nmu = -0.1\n", "materials.m.with.n.mu", "at least 0"),
        ("[materials.m.with]\nn = 0.1\n", "materials.m.with.n", "a table of the pair"),
        ("[materials.m]\nwith = 0.1\n", "materials.m.with", "tables by name"),
        ("[materials.m.with.steel]\nmu = 0.1\n", "materials.m.with.steel", "no material 'steel'"),
        ("[materials.m.with.n]\nmu = 0.1\n[materials.n.with.m]\nmu = 0.2\n",
         "materials.n.with.m.mu", "is 0.1 in [materials.m.with.n]"),
    ],
)  # fmt: skip
def test_mistakes(text, key, words, use):
    text = text if "[materials.n" in text else f"{text}[materials.n]\n"
    ((found, what),) = mistakes(text + use)
    assert found == key
    assert words in what


def test_both_tables_of_a_pair_may_stand_where_they_agree():
    """What one leaves out the other may say; expressions of parameters are numbers."""
    text = (
        '[parameters]\nsmooth = 0.1\n[materials.m]\nmu = "= 4 * smooth"\n[materials.n]\n'
        '[materials.m.with.n]\nmu = "= smooth"\n[materials.n.with.m]\nmu = 0.1\ne = 0.5\n'
    )
    found = check(parse(BODY + text + SHAPES), dap.load_registry()).collisions
    assert found.mu.tolist() == [[0.4, 0.1], [0.1, 0.0]]
    assert found.e.tolist() == [[0.0, 0.5], [0.5, 0.0]]


def test_sticking_friction_of_shapes_is_noted():
    """Shapes that collide stick by mu; a declared contact of the material takes its mu_s."""
    text = "[materials.m]\nmu = 0.2\nmu_s = 0.3\n[materials.n]\nmu = 0.2\n"
    valid = check(parse(BODY + text + SHAPES + CONTACT), dap.load_registry())
    (note,) = [note for note in valid.notes if "mu_s" in note]
    assert note.startswith("materials.m.mu_s is of declared contacts alone")
    assert valid.contacts[0].values["mu_s"] == 0.3
    assert not any("no joint and no force" in note for note in valid.notes)
