"""The numbers of models/**/expected.toml are those of the reference simulators, and these agree
with a second derivation where they have one. No test here runs dap3d."""

import andrews
import bricard
import check_expected
import fourbar2
import fourbar3
import fourbar4
import governor
import numpy as np
import pen1
import pen2
import pytest
import rolling_disk

pytestmark = pytest.mark.slow

#: Nothing of dap3d is in them: they change with these scripts and with models/**/expected.toml.
LONG = {"pen2", "bicycle", "bodies2", "quarter_car", "A02-40", "A04"}
MODELS = [
    pytest.param(name, marks=pytest.mark.long) if name in LONG else name
    for name in check_expected.ALL
]


@pytest.mark.parametrize("model", MODELS)
def test_expected_numbers_agree_with_the_reference(model):
    wrong = [str(c) for c in check_expected.comparisons(model) if not c.ok]
    assert not wrong, "\n".join(wrong)


FOURBAR = {"r": 1e-10, "p": 1e-10, "v": 1e-10, "v_dot": 1e-9, "reaction": 1e-8, "energy": 1e-8}
PENDULUM = {"r": 1e-10, "v": 1e-10, "v_dot": 1e-9}


@pytest.mark.long
@pytest.mark.parametrize(
    ("model", "t", "tolerances"),
    [
        # forces of 1e2 N from accelerations of 1e5 m/s^2
        (andrews, 0.01, {"p": 1e-12, "v": 1e-10, "v_dot": 1e-6, "reaction": 1e-8, "energy": 1e-12}),
        *((bricard, t, {"r": 1e-11, "p": 1e-11, "v": 1e-11, "v_dot": 1e-10}) for t in (0.5, 2.0)),
        *((model, t, FOURBAR) for model in (fourbar2, fourbar3, fourbar4) for t in (0.25, 2.0)),
        (governor, 0.01, {"r": 1e-13, "p": 1e-13, "v": 1e-12, "v_dot": 1e-8, "reaction": 1e-8}),
        *((model, t, PENDULUM) for model in (pen1, pen2) for t in (0.5, 2.0)),
        (rolling_disk, rolling_disk.PERIOD, {"r": 1e-10, "p": 1e-10, "v": 1e-9, "lambda": 1e-10}),
    ],
)
def test_a_reference_agrees_with_a_second_derivation(model, t, tolerances):
    """Of the generic simulator, without symmetry, or of that in closed form; quantity by quantity
    that starts as a key says."""
    first = model.quantities(t)
    second = model.simulated(t) if hasattr(model, "simulated") else model.closed_form(t)
    compared = 0
    for start, atol in tolerances.items():
        for name in first.keys() & second.keys():
            if name == start or name.startswith(f"{start}."):
                np.testing.assert_allclose(
                    first[name], second[name], rtol=0, atol=atol, err_msg=name
                )
                compared += 1
    assert compared >= len(tolerances)
