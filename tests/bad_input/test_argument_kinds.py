"""Every public function given arguments of wrong kinds: refused in a sentence that names them.
The kinds are those of the annotations. A wrong kind is one that no value of the parameter has, so
the refusals need no numbers."""

import inspect
import re
from fractions import Fraction
from pathlib import Path

import attrs
import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.registry.arguments import SETTINGS, checked
from dap3d_core.scene import Simulation


def public(name):
    """The function of a public name; modules of the same name hold it."""
    found = getattr(dap, name)
    return getattr(found, name) if inspect.ismodule(found) else found


FUNCTIONS = [n for n in dap.__all__ if n != "shipped_models" and inspect.isfunction(public(n))]


class Odd:
    """An object of no kind that an argument has."""


VARIADIC = inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD
#: No parameter of a public function takes one of these.
WRONG = [Odd(), b"x", {1, 2}, 1j, int, [Odd()], {"a": Odd()}]


@pytest.fixture(scope="module")
def result():
    return dap.simulate("pen1", t_end=0.1, dt=0.05)


def good_arguments(function, result):
    """Arguments for the parameters that must be given; nothing is read or run with them."""
    known = {
        "result": result, "motion": result, "path": "none.nc", "folder": "none", "format": "csv",
        "parameters": {}, "vary": {}, "measured": {}, "outputs": [], "names": [],
    }  # fmt: skip
    parameters = inspect.signature(function).parameters.values()
    needed = [p for p in parameters if p.default is p.empty and p.kind not in VARIADIC]
    scenes = {p.name: dap.Scene() for p in needed if p.annotation is dap.Scene}
    return {p.name: known.get(p.name, "pen1") for p in needed} | scenes


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_public_function_checks_its_arguments(name):
    assert hasattr(public(name), "__wrapped__"), "decorate it with `checked`"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_wrong_kinds_are_refused_by_the_name_of_the_argument(name, result, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    function = public(name)
    given = good_arguments(function, result)
    for argument, parameter in inspect.signature(function).parameters.items():
        if parameter.kind in VARIADIC or "Any" in str(parameter.annotation) or argument in SETTINGS:
            continue
        for wrong in WRONG:
            if isinstance(wrong, bytes) and name == "load":
                continue  # names of files may be bytes
            if inspect.isclass(wrong) and "Callable" in str(parameter.annotation):
                continue  # a class can be called
            if isinstance(wrong, dict) and re.search(
                "Mapping|Collection", str(parameter.annotation)
            ):
                continue  # values are judged later; a dictionary is a collection of its keys
            with pytest.raises((TypeError, dap.SceneError)) as caught:
                function(**given | {argument: wrong})
            assert argument in str(caught.value), (argument, wrong, caught.value)
    assert not list(tmp_path.iterdir())


def test_settings_that_are_left_to_the_scene_are_settings_of_scenes():
    assert {field.name for field in attrs.fields(Simulation)} >= SETTINGS


MESSAGES = {
    "text for a result": (
        lambda: dap.export("run.nc", "run.csv"),
        r"argument result should be a Result, not 'run.nc'; dap.open\('run.nc'\) makes one",
    ),
    "text for a result that is shown": (
        lambda: dap.view("run.nc"),
        r"argument result should be a Result, not 'run.nc'; dap.open\('run.nc'\) makes one",
    ),
    "text for a result that is drawn": (
        lambda: dap.plot("run.nc", "t"),
        r"argument result should be a Result, .*, not 'run.nc'; dap.open\('run.nc'\) reads one",
    ),
    "a dictionary of no results": (lambda: dap.plot({"a": 3}, "t"), "should be a Result, a dict"),
    "a name for a list of names": (
        lambda: dap.linearize("pen1", outputs="cone.r.z"),
        r"outputs should be a list of names, not 'cone.r.z'; write \['cone.r.z'\] for a single one",
    ),
    "a set of names": (
        lambda: dap.linearize("pen1", outputs={"cone.r.z"}),
        "outputs should be a list of names",
    ),
    "text for a truth value": (
        lambda: dap.compile("pen1", allow_code="no"),
        "allow_code should be True or False, not 'no'",
    ),
    "nothing for a path": (lambda: dap.open(None), "path should be text or a path, not None"),
    "a list for a name": (
        lambda: dap.export_model("pen1", format=["urdf"]),
        r"format should be text or None, not \['urdf'\]",
    ),
    "a truth value for a number": (
        lambda: dap.linearize("pen1", t=True),
        "t should be a number, not True",
    ),
    "one controller": (
        lambda: dap.simulate("pen1", controllers=dap.Controller(every=1.0, update=print)),
        r"controllers should be a list of dap.Controller, .*; write \[controller\]",
    ),
    "numbers for controllers": (
        lambda: dap.simulate("pen1", controllers=np.zeros(2)),
        "controllers should be a list of dap.Controller, not a ndarray",
    ),
    "one event": (
        lambda: dap.simulate("pen1", events=dap.Event("t", above=0.2)),
        r"write \[event\] for a single one",
    ),
    "a name for an event": (lambda: dap.simulate("pen1", events=["t"]), "a list of dap.Event, not"),
    "a part for a whole": (
        lambda: dap.linearize("pen1", modes=2.5),
        "modes should be a whole number or None, not 2.5",
    ),
    "a size of one number": (
        lambda: dap.animate(dap.simulate("pen1", t_end=0.0), "a.gif", size=(640,)),
        "size should be a list of 2 whole numbers",
    ),
}


@pytest.mark.parametrize(("call", "words"), MESSAGES.values(), ids=MESSAGES)
def test_messages_name_the_kind_and_the_remedy(call, words):
    with pytest.raises(TypeError, match=words):
        call()


@pytest.mark.parametrize("value", [[], {}, ["dop853"], np.zeros(2), Odd(), 3])
@pytest.mark.parametrize("setting", ["method", "integrator", "correct_metric"])
@pytest.mark.parametrize("function", [dap.simulate, dap.start])
def test_settings_that_cannot_be_looked_up_are_mistakes_of_the_setting(function, setting, value):
    with pytest.raises(dap.SceneError, match=f"{setting} = .*should be one of"):
        function("pen1", t_end=0.1, **{setting: value})


@pytest.mark.parametrize("joint", [["J1"], {}, None, 3, np.zeros(1)])
def test_names_of_parts_are_text(result, joint):
    for method in (result.reaction, result.coordinates, result.force):
        with pytest.raises(TypeError, match="should be text"):
            method(joint)


@checked
def taking(
    x: float = 0.0, n: int = 0, yes: bool = False, path: str | Path = "", of: "str | None" = None
):
    """A function of each kind of number."""
    return x, n, yes, path, of


@pytest.mark.parametrize(
    "given",
    [
        {"x": 1}, {"x": np.float32(1.5)}, {"x": np.int64(2)}, {"x": np.array(1.5)},
        {"x": Fraction(1, 2)}, {"x": float("nan")}, {"n": np.int8(3)}, {"n": np.array(3)},
        {"yes": np.True_}, {"yes": np.array(True)}, {"path": Path("a")}, {"path": np.str_("a")},
    ],
    ids=str,
)  # fmt: skip
def test_numbers_of_numpy_become_numbers_of_python(given):
    (value,) = [
        v for v, default in zip(taking(**given), (0.0, 0, False, ""), strict=False) if v != default
    ]
    assert value == next(iter(given.values())) or value != value
    assert not hasattr(value, "dtype") or isinstance(value, (str, float))


@pytest.mark.slow
def test_controllers_and_studies_take_numbers_of_numpy():
    controller = dap.Controller(every=np.float32(0.5), update=lambda t, state: {})
    assert type(controller.every) is float
    varied, n = {"bodies.cone.mass": [1.0, 2.0]}, np.int64(1)
    common = {"outputs": ["cone.r.z:max"], "t_end": np.float32(0.125)}
    found = dap.sweep("pen1", varied, threads=n, seed=n, **common)
    alone = dap.sweep("pen1", varied, threads=1, seed=1, outputs=["cone.r.z:max"], t_end=0.125)
    assert np.array_equal(found["cone.r.z:max"], alone["cone.r.z:max"])


@pytest.mark.parametrize(
    "given",
    [
        {"x": True}, {"x": np.True_}, {"x": "1"}, {"x": np.zeros(1)}, {"x": 1j}, {"n": 1.0},
        {"n": np.float64(1.0)}, {"n": True}, {"yes": 1}, {"yes": np.int64(1)}, {"yes": "no"},
        {"path": b"a"}, {"path": 3}, {"of": 3}, {"x": np.ma.masked},
    ],
    ids=str,
)  # fmt: skip
def test_what_is_no_such_number_is_refused(given):
    with pytest.raises(TypeError, match=f"argument {next(iter(given))} should be"):
        taking(**given)


def test_a_state_is_read_by_one_name_and_unknown_arguments_have_the_words_of_python():
    state = dap.start("pen1").state
    with pytest.raises(TypeError, match=r"a quantity is named by text such as 'crank.r.z', not by"):
        state[["cone.r", "cone.w"]]
    with pytest.raises(TypeError, match=r"taking\(\) got an unexpected .* 'y'; it takes ") as found:
        taking(y=1)
    assert found.value.__context__ is None  # one traceback, not two


@pytest.fixture(scope="module")
def run():
    return dap.simulate("pen1", t_end=0.1, dt=0.05)


def test_names_are_given_one_by_one_or_in_a_list(run):
    """Of figures, pages and paths."""
    names = ["cone.r.z", "cone.w"]
    assert dap.view(run, names).data["asked"] == names == dap.view(run, *names).data["asked"]
    figures = [dap.plot(run, *given).figure for given in ((names,), names)]
    lines = [[line.get_ydata() for ax in one.axes for line in ax.lines] for one in figures]
    assert len(lines[0]) == len(lines[1]) == 4
    assert all(np.array_equal(a, b) for a, b in zip(*lines, strict=True))


@pytest.mark.parametrize("names", [(["cone.r.z"], "cone.w"), (3,), ([["cone.r.z"]],), (None,)])
@pytest.mark.parametrize("draw", [dap.plot, dap.view])
def test_what_is_no_name_of_a_quantity_is_refused(run, draw, names):
    with pytest.raises(TypeError, match="the argument quantities should be names, not"):
        draw(run, *names)


@pytest.mark.parametrize("format", ["fmuu", "csvv", "urd"])
def test_a_format_of_models_that_there_is_not_has_those_that_there_are(format):
    near = {"fmuu": "; did you mean 'fmu'[?]", "urd": "; did you mean 'urdf'[?]"}.get(format, "")
    known = rf"there is no format '{format}' of models{near} \(there are: c, fmu, mjcf, urdf\)"
    with pytest.raises(dap.PluginError, match=known):
        dap.export_model("pen1", "a", format=format)
