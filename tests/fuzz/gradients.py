"""Derivatives of random scenes that touch are those of differences of whole runs.
An input is the number of a scene of varied_contacts.py, which says by which of its numbers. Where
runs with values nearby have other events, or a corner lies between, nothing is compared."""

import time

import numpy as np
from hypothesis import strategies as st
from support.ended import EndedError

import dap3d_core as dap
from dap3d_core.formulations.programs import change_over
from fuzz.contacts import SETTINGS, SHORT, SPREAD, VARIED, scene_of, settings_of

#: Numbers of a scene by which is differentiated; s of CPU time after which a run hangs.
MOST, HANG = 2, 20.0
EXACT = {"rtol": 1e-11, "atol": 1e-13, "t_end": SHORT, "dt": SHORT / 10}
#: Difference of a parameter, as a part of it.
STEP = 2e-4
#: Error of a derivative, as a part of the largest. Edges that are passed leave some 1e-4
#: (docs/concepts/sensitivities.md): what is looked for is wrong by its own size.
WRONG = 3e-3
#: Words of the errors that a run with derivatives may end with.
REFUSED = ("there is no derivative", "derivatives end where")


def numbers():
    """Numbers of scenes, spread evenly."""
    return st.integers(0, 2**32).map(lambda n: str(VARIED + n * SPREAD % (9 * VARIED)).encode())


def parameters_of(scene, rng):
    """Names of some numbers of a scene, none of which moves what touches apart."""
    names = ["forces.g.gravity", *(f"bodies.{b}.mass" for b in scene.bodies)]
    if not scene.joints:
        names += [f"bodies.{b}.w.z" for b in scene.bodies]
    for name, contact in scene.contacts.items():
        e, mu = contact.fields["e"], contact.fields["mu"]
        names += [f"contacts.{name}.e"] if 0.0 < e < 1.0 else []
        names += [f"contacts.{name}.mu"] if 0.0 < 1.1 * mu < contact.fields["mu_s"] else []
    names += [f"forces.{name}.k" for name, force in scene.forces.items() if force.type == "ptp"]
    return [str(name) for name in rng.choice(names, size=min(MOST, len(names)), replace=False)]


def value_of(scene, name):
    """The value of a number of a scene."""
    table, owner, key = name.split(".")[:3]
    element = getattr(scene, table)[owner]
    if table != "bodies":
        return element.fields.get(key, 9.81)
    return element.mass if key == "mass" else element.w[2]


def with_value(scene, name, value):
    """A scene with another value of a number."""
    scene = scene.copy()
    table, owner, key = name.split(".")[:3]
    element = getattr(scene, table)[owner]
    if table != "bodies":
        element.fields[key] = value
    elif key == "mass":
        element.mass = value
    else:
        element.w = [*element.w[:2], value]
    return scene


def by_differences(scene, name, given, kinds):
    """(n,) derivative of the last state, of sixth order, and how unsure it is; None: of none."""
    x, found = value_of(scene, name), {}
    h = STEP * (abs(x) or 1.0)
    for k in (-3, -2, -1, 1, 2, 3):
        try:
            result = dap.simulate(with_value(scene, name, x + k * h), **given)
        except dap.SimulationError:
            return None
        if [(event.kind, event.name) for event in result.events] != kinds:
            return None
        found[k] = result.u[-1]
    one, two, three = (found[k] - found[-k] for k in (1, 2, 3))
    sixth = (45.0 * one - 9.0 * two + three) / (60.0 * h)
    return sixth, np.max(np.abs((8.0 * one - two) / (12.0 * h) - sixth))


def check_gradients(data: bytes) -> str:
    """How the run of a scene with derivatives ended, in words."""
    number, began = int(data), time.process_time()
    scene, given = scene_of(number), SETTINGS | settings_of(number) | EXACT
    if given["integrator"] == "auto":
        given["integrator"] = "dop853"
    names = parameters_of(scene, np.random.default_rng([number, 9]))

    def watch(_):
        if time.process_time() - began > HANG:
            raise EndedError

    most, change_over.MOST_BODIES = change_over.MOST_BODIES, 0
    try:
        alone = dap.simulate(scene, watch=watch, **given)
        found = dap.sensitivities(scene, names, **given)
        assert np.array_equal(found.result.u, alone.u)
        kinds = [(event.kind, event.name) for event in alone.events]
        exact = found.derivative(lambda result: result.u[-1])
        for k, name in enumerate(names):
            if (other := by_differences(scene, name, given, kinds)) is None:
                continue
            differs, unsure = other
            size = np.max(np.abs(differs)) + 0.01 * np.max(np.abs(alone.u[-1]))
            off = np.max(np.abs(exact[:, k] - differs))
            assert off <= WRONG * size + 10.0 * unsure, (name, off, unsure, size)
    except dap.SimulationError as error:
        said = str(error)
        assert "the run stopped" in said or any(word in said for word in REFUSED), said
        return "refused"
    except EndedError:
        return "slow"
    finally:
        change_over.MOST_BODIES = most
    return "done"
