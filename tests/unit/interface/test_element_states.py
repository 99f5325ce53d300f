"""Fields that states bring, and words that no state may have."""

import pytest
from support.internals import COORDINATE, QUANTITIES, specs_of
from support.state_types import Lag, Steered

from dap3d_core.interface import Body, Force, PluginError, body, examine, number


def test_states_bring_the_fields_of_their_initial_values_and_tolerances():
    """z_0 and z_atol, zero by default, with the shape of the state; names or a table."""
    specs = specs_of(Steered)
    assert (specs["z_0"].kind, specs["z_0"].default) == ("number", 0.0)
    assert (specs["z_atol"].kind, specs["z_atol"].default, specs["z_atol"].minimum) == (
        "number", 0.0, 0.0)  # fmt: skip
    assert (specs_of(Lag)["held_0"].kind, specs_of(Lag)["held_0"].default) == ("vec3", (0.0,) * 3)
    assert Lag.state_lengths() == {"held": 3, "clock": 1}
    assert Steered.state_lengths() == {"z": 1}


def test_a_type_may_declare_these_fields_itself():
    """Its own maker, with a unit and a default, is kept; variants inherit it."""

    class Own(Force):
        keyword, states = "own", ("z", "y")
        body_i: Body = body()
        z_0: float = number(2.5, unit="m", doc="initial bristle")

    class Variant(Own):
        pass

    for type_ in (Own, Variant):
        spec = specs_of(type_)["z_0"]
        assert (spec.default, spec.unit, spec.doc) == (2.5, "m", "initial bristle")
        assert specs_of(type_)["y_0"].default == 0.0
        assert list(specs_of(type_)).count("z_0") == 1


def test_the_reserved_names_are_the_quantities_of_results():
    """No quantity of forces and joints is missing among the names that no state may have."""
    wanted = {*QUANTITIES["force"], *QUANTITIES["joint"]}
    coordinates = {"angle", "length", "angle_rate", "length_rate"}
    assert all(COORDINATE.fullmatch(n) for n in coordinates)
    for name in wanted | coordinates:
        with pytest.raises(PluginError, match=f"{name} would hide|{name}' in states is no name"):
            examine(type("Own", (Lag,), {"keyword": "own", "states": (name,)}))
