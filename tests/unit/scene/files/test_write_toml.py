"""Writing a scene loses nothing: what is read back is equal, every float to the last bit."""

import math
import struct

import attrs
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.internals import Element, fault_of_name, lines_of, scene_of

import dap3d_core as dap
from dap3d_core.scene import check

import tomllib  # isort: skip

REGISTRY = dap.load_registry()

names = st.text(min_size=1, max_size=8).filter(lambda s: not fault_of_name(s))
floats = st.floats(allow_nan=False, allow_infinity=False)
positive = st.floats(min_value=1e-3, max_value=1e3)
numbers = st.one_of(floats, st.integers(min_value=-(2**63), max_value=2**63 - 1))
values = st.recursive(
    st.one_of(numbers, st.booleans(), st.text(max_size=6)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4).map(tuple),
        st.dictionaries(st.text(max_size=4), inner, max_size=3),
    ),
    max_leaves=6,
)


@st.composite
def scenes(draw, good=True):
    """A scene that may be checked (good), or with any values at all."""
    scene = dap.Scene(name=draw(st.text(max_size=5)), description=draw(st.text(max_size=20)))
    number, vector = (positive, st.tuples(positive, positive, positive)) if good else (values,) * 2
    bodies = draw(st.lists(names, min_size=1, max_size=4, unique=True))
    for name in bodies:
        fields = draw(
            st.fixed_dictionaries(
                {"mass": number}, optional={"r": vector, "w": vector, "r_dot": vector}
            )
        )
        scene.add_body(name, Jp=(1.0, 1.0, draw(st.floats(0.5, 1.5))), **fields)
    points = [f"{b}.O" for b in bodies]
    for name in draw(st.lists(names, max_size=4, unique=True)):
        scene.add_point(name, draw(st.sampled_from(bodies)), draw(vector))
        points.append(name)
    for name in draw(st.lists(names, max_size=3, unique=True)):
        scene.add_vector(name, draw(st.sampled_from(["ground", *bodies])), draw(vector))
    for name in draw(st.lists(names, max_size=4, unique=True)):
        fields = {"P_i": draw(st.sampled_from(points)), "P_j": "ground.O"}
        scene.add_joint("sph-sph", name, **fields, length=draw(number))
    scene.add_force("weight", gravity=draw(number))
    if draw(st.booleans()):
        scene.add_animation_point(bodies[0], draw(vector))
    scene.simulation.t_end = draw(positive)
    scene.simulation.rtol = draw(st.floats(1e-13, 0.1))
    scene.simulation.project = draw(st.booleans())
    scene.simulation.hold = (bodies[-1],)
    return scene


def bits(value):
    """A value in a form that is equal only for equal bits of every float."""
    if isinstance(value, float):
        return struct.pack("<d", value)
    if isinstance(value, tuple):
        return tuple(bits(v) for v in value)
    if isinstance(value, dict):
        return [(k, bits(v)) for k, v in value.items()]
    if attrs.has(type(value)):
        return [(a.name, bits(getattr(value, a.name))) for a in attrs.fields(type(value)) if a.eq]
    return [bits(v) for v in value] if isinstance(value, list) else value


@pytest.mark.slow
@settings(deadline=None)
@given(scenes(good=False))
def test_even_a_scene_of_nonsense_is_written_without_loss(scene):
    again = scene_of(tomllib.loads(scene.to_toml()))
    assert bits(again) == bits(scene)


@pytest.mark.slow
@settings(deadline=None, max_examples=50)
@given(scenes())
def test_a_scene_that_was_written_is_read_back_bit_for_bit_and_checked_alike(scene):
    again = scene_of(tomllib.loads(scene.to_toml()))
    assert again == scene
    assert bits(again) == bits(scene), "order of the tables and bits of the floats"
    assert again.to_toml() == scene.to_toml()

    def answer(s):
        try:
            return [], check(s, REGISTRY).notes
        except dap.SceneError as error:
            return [m.key for m in error.mistakes], []

    assert answer(scene) == answer(again)


@pytest.mark.slow
@settings(deadline=None)
@given(scenes(good=False))
def test_every_key_of_a_written_scene_has_its_line(scene):
    text = scene.to_toml()
    lines = lines_of(text)
    expected = set()

    def walk(key, value):
        if key:
            expected.add(key)
        if isinstance(value, dict):
            for k, v in value.items():
                walk((*key, k), v)
        elif isinstance(value, list):
            for n, v in enumerate(value):
                if isinstance(v, dict):
                    walk((*key, n), v)
                elif isinstance(v, list):
                    for found in _tables(v, (*key, n)):
                        walk(*found)

    walk((), tomllib.loads(text))
    assert set(lines) == expected
    for key, line in lines.items():
        if len(key) == 2 and key[0] == "bodies":
            assert text.split("\n")[line - 1].startswith("[bodies.")


def _tables(value, key):
    for n, v in enumerate(value):
        if isinstance(v, dict):
            yield (*key, n), v
        elif isinstance(v, list):
            yield from _tables(v, (*key, n))


@pytest.mark.parametrize("name", dap.shipped_models())
def test_shipped_models_survive_writing(tmp_path, name):
    scene = dap.load(name)
    file = scene.save(tmp_path / "again.toml")
    assert file == tmp_path / "again.toml"
    again = dap.load(file)
    assert bits(again) == bits(scene)
    assert list(tmp_path.iterdir()) == [file], "nothing is left beside it"


def test_infinity_and_nan_survive_until_the_check():
    scene = dap.Scene()
    scene.add_body("a", mass=math.inf, r=[math.nan, -math.inf, 0.0])
    again = scene_of(tomllib.loads(scene.to_toml()))
    assert bits(again) == bits(scene)


def test_the_layout_is_that_of_a_scene_file():
    scene = dap.Scene(name="demo")
    scene.add_body("crank", mass=1.0, Jp=[0.5, 0.5, 0.1], color="tab:blue")
    scene.add_point("A 1", "crank", [0.0, 0.0, -1.0])
    scene.add_joint("sph", "J1", P_i="A 1", P_j="ground.O")
    scene.simulation.t_end = 2
    assert scene.to_toml() == (
        '[scene]\nname = "demo"\nschema = 1\n\n'
        '[bodies.crank]\nmass = 1.0\nJp = [0.5, 0.5, 0.1]\ncolor = "tab:blue"\n\n'
        '[points."A 1"]\nbody = "crank"\nsPp = [0.0, 0.0, -1.0]\n\n'
        '[joints.J1]\ntype = "sph"\nP_i = "A 1"\nP_j = "ground.O"\n\n'
        "[simulation]\nt_end = 2\n"
    )


def test_a_folder_gets_a_scene_file_and_another_replaces_it_whole_if_forced(tmp_path):
    first, second = dap.Scene(name="x", description="longer"), dap.Scene(name="y")
    assert first.save(tmp_path) == tmp_path / "scene.toml"
    with pytest.raises(dap.SceneError, match="exists; force=True overwrites it"):
        second.save(tmp_path)
    assert dap.load(tmp_path) == first
    second.save(tmp_path, force=True)
    assert dap.load(tmp_path) == second


def test_what_a_file_cannot_hold_is_refused_and_nothing_is_written(tmp_path):
    scene = dap.Scene()
    scene.add_body("a", mass=1.0)
    scene.joints["J"] = Element("J", "sph", {"P_i": object()})
    with pytest.raises(dap.SceneError, match=r"joints.J.P_i.*cannot hold object"):
        scene.save(tmp_path / "scene.toml")
    scene = dap.Scene(name="\ud800")
    with pytest.raises(dap.SceneError, match="UTF-8"):
        scene.save(tmp_path / "scene.toml")
    assert list(tmp_path.iterdir()) == []


def test_a_scene_with_unknown_keys_is_not_written_without_them(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text("[bodies.a]\nmas = 1.0\n")
    with pytest.raises(dap.SceneError, match="mas"):
        dap.load(file).save(tmp_path / "again.toml")


@pytest.mark.parametrize(
    "where", ["no/such/folder/scene.toml", "file/scene.toml", "a\0b", "x" * 300]
)
def test_a_file_that_cannot_be_written_is_an_error(tmp_path, where):
    (tmp_path / "file").write_text("")
    with pytest.raises(dap.SceneError, match="cannot be written"):
        dap.Scene().save(str(tmp_path / where))
