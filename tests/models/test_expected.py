"""Every shipped model gives the numbers of its expected.toml, each within the tolerance there.
The form of these files: models/README.md."""

import tomllib
from functools import cache

import numpy as np
import pytest

import dap3d_core as dap

EXPECTED = {
    name: tomllib.loads((folder / "expected.toml").read_text())
    for name, folder in dap.shipped_models().items()
    if (folder / "expected.toml").exists()
}
#: Of forty loops, stiff, and of hundreds of steps with contacts.
LONG = {"A02-40", "A05", "domino_row", "marble_run"}
LONGEST = {"walker", "sphere_box", "humanoid"}  # thousands of steps; 500 balls to 1e-7
COUNTS = ("rows", "rank", "dof")


def marks_of(name):
    """The markers of a model."""
    long = [pytest.mark.long] if name in LONGEST else []
    return [pytest.mark.slow, *long] if name in LONG | LONGEST else []


@cache
def compiled(name):
    return dap.compile(dap.load(name), allow_code=True)


@cache
def run_to(name, t):
    """The result whose last instant is t, reached by a step and not by dense output."""
    settings, dt = EXPECTED[name]["run"], max(t, 1.0) if t == 0.0 else t
    if any(check.get("quantity", "").startswith("mean_load") for check in EXPECTED[name]["check"]):
        dt = settings["contact_step"]
    return dap.simulate(compiled(name), t_end=t, dt=dt, **settings)


@pytest.mark.parametrize("name", [pytest.param(n, marks=marks_of(n)) for n in EXPECTED])
def test_expected(name):
    """Each quantity agrees with its independent value."""
    checks = EXPECTED[name]["check"]
    assert checks
    off = [(check, error) for check in checks if not (error := error_of(name, check)) <= 1.0]
    assert not off


def error_of(name, check):
    """The largest error of a quantity, in tolerances."""
    value = np.array(check["value"], dtype=float)
    if "crossing" in check:
        found = np.array([time_of(name, check["crossing"])])
    elif check["quantity"] in COUNTS:
        found = np.array([count(name, check["quantity"])])
    else:
        found = at_end(run_to(name, check["t"]), check["quantity"])
    if check["quantity"].startswith("p."):
        found = found * np.sign(found @ value)  # p and -p are one pose
    error = np.max(np.abs(found - value))
    return error / check["tolerance"] if error > 0.0 else 0.0


def count(name, what):
    result = run_to(name, 0.0)
    rank = compiled(name).redundancy(result.u[0]).rank
    return {"rows": rank.rows, "rank": rank.rank, "dof": rank.dof}[what]


def at_end(result, quantity):
    """A quantity of models/README.md at the last instant."""
    head, *rest = quantity.split(".")
    if head == "v_dot":
        return result.v_dot[-1]
    if head == "v":
        return result.u[-1, 7 * len(result.model.body_names) :]
    if head == "energy":
        return np.atleast_1d(getattr(result.energy, rest[0])[-1])
    if head == "lambda":
        joint = result.model.joint_names.index(rest[0])
        return result.Lam[-1, result.model.joint_start[joint] : result.model.joint_start[joint + 1]]
    if head == "reaction":
        joint, side, what = rest
        return getattr(result.reaction(joint)[side], what)[-1]
    if head == "load":
        return result.contacts.of(rest[0]).at(result.t[-1:]).force.sum(axis=0)
    if head == "mean_load":
        last = result.t[result.t > result.t[-1] - 1.0 + 1e-9]
        return result.contacts.of(rest[0]).at(last).force.sum(axis=0) / len(last)
    names = result.model.point_names if head in ("rP", "rPd") else result.model.body_names
    return getattr(result, head)[-1, names.index(rest[0])]


def time_of(name, crossing):
    """The instant of a crossing, by bisection on runs that end there."""
    horizon = max(check["t"] for check in EXPECTED[name]["check"] if "t" in check)
    dt = 1e-3
    result = dap.simulate(compiled(name), t_end=horizon, dt=dt, **EXPECTED[name]["run"])
    body = result.model.body_names.index(crossing["of"].split(".")[1])
    kind = crossing["of"].split(".")[0]
    sign = 1.0 if crossing["direction"] == "up" else -1.0
    series = sign * (getattr(result, kind)[:, body, crossing["component"]] - crossing["level"])
    at = np.flatnonzero((series[:-1] < 0.0) & (series[1:] >= 0.0))[crossing["number"] - 1]
    low, high = result.t[at], result.t[at + 1]
    for _ in range(40):
        middle = 0.5 * (low + high)
        end = dap.simulate(compiled(name), t_end=middle, dt=middle, **EXPECTED[name]["run"])
        value = sign * (getattr(end, kind)[-1, body, crossing["component"]] - crossing["level"])
        low, high = (middle, high) if value < 0.0 else (low, middle)
    return 0.5 * (low + high)


@pytest.mark.slow
def test_the_walker_sets_out():
    """A period of it, of which both halves are alike but for half a turn: it stays in place."""
    result = dap.simulate("walker", t_end=0.5, dt=0.1)
    for name in ("trunk.r.x", "trunk.r.y"):
        assert np.ptp(result.quantity(name).values) < 1e-9
    assert all(entry.ok for entry in result.ledger.values())


@pytest.mark.slow
def test_the_humanoid_leans_to_neither_side():
    """Half a second of it: both of its sides are alike, and its feet stay where they stand."""
    result = dap.simulate("humanoid", t_end=0.5, dt=0.1)
    assert np.ptp(result.quantity("trunk.r.y").values) < 1e-12
    assert all(result.ledger[name].ok for name in ("residual", "overlap", "position"))
    left, right = (result.quantity(f"{side}_foot.r").values for side in ("left", "right"))
    assert left * [1, -1, 1] == pytest.approx(right, abs=1e-12)
