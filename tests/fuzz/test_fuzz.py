"""Random and damaged inputs are dealt with as they should be: what they end in, and what is said.
The same inputs each time; ``make fuzz`` tries others. Each check says what must be true."""

import importlib.util

import pytest

from fuzz.contacts import check_contacts
from fuzz.gradients import check_gradients
from fuzz.guided import GUIDED
from fuzz.instants import check_instants
from fuzz.targets import TARGETS

#: How many inputs, quick and slow. A scene takes some 50 ms, what is refused some 5 ms.
COUNTS = {
    "scenes": (2, 10),
    "damaged": (5, 40),
    "matlab": (10, 60),
    "models": (10, 200),
    "results": (3, 15),
    "numbers": (2, 10),
    "quantities": (5, 75),
    "expressions": (20, 250),
    "commands": (3, 15),
    "programs": (3, 20),
    "contacts": (1, 10),
    "gradients": (1, 2),
    "instants": (1, 10),
}


def long(*values):
    """A case that takes ten seconds and more."""
    return pytest.param(*values, marks=[pytest.mark.slow, pytest.mark.long])


def test_every_target_is_tried():
    assert COUNTS.keys() == TARGETS.keys()


@pytest.mark.every(4)
@pytest.mark.parametrize("name", COUNTS)
def test_some_inputs(name):
    TARGETS[name].run(0, COUNTS[name][0], derandomize=True)


@pytest.mark.slow
@pytest.mark.parametrize("name", COUNTS)
def test_more_inputs(name):
    TARGETS[name].run(1, COUNTS[name][1])


@pytest.mark.every(100)
@pytest.mark.parametrize("number", [1_926_433, 1_000_014, 1357, 1477, 1_642_375, 2184, 1_000_076,
                                    6_569_051, 9_141_203, 5_192_180, 16_279_023,
                                    1_048_577, 1_159_636, 2021,
                                    1_650_876, 14_923_612, 10_445_297, 11_594_543, 18_897_519,
                                    8_897_954, 13_400_462, 21_657_220, 25_366_246, 8_355_428,
                                    25_901_617, 28_577_788, 13_822_892,
                                    26_078_414, 27_019_585, long(25_987_196), 21_456_175,
                                    8_003_505, 17_694_781, 3_738_232,
                                    6_188_153, 4_609_733, 27_250_592, 9_754_102,
                                    4_607_735, 25_774_717, 3_059_079, 342_429,
                                    14_803_168, 2_361_476, 6_831_601, 10_598_367, 2_523_873,
                                    1_016_830, 5_239_751, 2_606_997, 29_006_966,
                                    18_881_700, 18_734_821, 17_809_760, 1_812_101,
                                    27_336_446, 20_140_458, 24_196_660])  # fmt: skip
def test_contacts_that_once_ended_falsely(number):
    """As "ever faster", by steps as short as rounding, with a force that pulls, or overlapping.

    Or by bounces without an end on what stands, or a tangent that stayed no number, or lacked a
    part; or with rounding that grew, an overlap that no switch saw, a velocity that jumped where
    joints hold it, or in a contact of no force that could not leave those that share; by rates of
    what gets out of reach beyond a short step, in a report within the first step of radau, where
    forces of sliding feet are no longer decided, or with forces beside which what begins to slip
    would go back; and with radau by a share that its short steps lose.
    """
    assert check_contacts(str(number).encode()) == "done"


@pytest.mark.every(3)
@pytest.mark.parametrize("number", [47, 20, 58])
def test_accelerations_that_once_were_wrong(number):
    """By method lsq, where a body weighs little or turns easily: by 1e-5, 1e-9 and a seventh."""
    assert check_instants(str(number).encode()) == "same"


@pytest.mark.slow
@pytest.mark.parametrize(("number", "ending"), [long(19_565_458, "done"), (16_291_320, "refused")])
def test_derivatives_that_once_were_wrong(number, ending):
    """A ball that slides over the edge of a box, and a capsule that slides from rest."""
    assert check_gradients(str(number).encode()) == ending


@pytest.mark.every(4)
@pytest.mark.parametrize("number", [1_925_281, 1_000_006, 1_066_419, long(1_635_495), 18_895_309,
                                    17_600_526])  # fmt: skip
def test_contacts_that_jam_are_named(number):
    """Again and again behind impulses that set them free, or with no forces where they begin.

    Or with no impulse that Newton's law of impact asks for.
    """
    assert check_contacts(str(number).encode()) == "jams"


@pytest.mark.parametrize("name", GUIDED)
def test_what_guided_fuzzing_begins_with_is_read(name):
    """Its seeds are good: mutations of them reach more than the first refusal."""
    target = GUIDED[name]
    if name == "matlab-bytes":
        pytest.importorskip("tree_sitter_matlab")
    found = [target.check(data) for data in target.seeds()]
    assert found.count("read") >= len(found) / 4


@pytest.mark.slow
@pytest.mark.skipif(not importlib.util.find_spec("atheris"), reason="needs atheris")
def test_guided_fuzzing_runs(tmp_path, monkeypatch):
    """A target of atheris works for its time and reports no find."""
    from fuzz import run

    monkeypatch.setattr(run, "FINDS", tmp_path)
    worker = run.Worker("scene-bytes", 1, 8.0)
    worker.go()
    assert not worker.places
    assert worker.counts["refused"] > 0
