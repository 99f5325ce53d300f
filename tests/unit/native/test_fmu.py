"""FMUs: valid, and run by FMPy with the numbers of runs in Python."""

import ctypes
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
from support.bouncing import bouncing
from tests.unit.native.test_export import SPRING, _written, braced, falling_ball, pushed

import dap3d_core as dap
from dap3d_core.native.fmu import _in_base_units

fmpy = pytest.importorskip("fmpy")
VERSIONS = pytest.mark.parametrize("fmi", [3, 2])


def written(scene, folder, **options):
    return dap.export_model(scene, folder / f"{scene.name}.fmu", force=True, **options)


@VERSIONS
def test_it_is_valid_and_a_co_simulation_has_the_bits_of_simulate(tmp_path, fmi):
    from fmpy.validation import validate_fmu

    scene = dap.load("crane")
    names = [f"{body}.r" for body in scene.bodies]
    made = written(scene, tmp_path, fmi=fmi, outputs=[*names, "sway"])
    assert validate_fmu(str(made.path)) == []
    result = dap.simulate(scene, t_end=2.0, dt=0.05)
    rows = fmpy.simulate_fmu(str(made.path), stop_time=2.0, output_interval=0.05,
                             fmi_type="CoSimulation", output=made.outputs)  # fmt: skip
    assert rows["time"].tolist() == result.t.tolist()
    expected = np.hstack([result.quantity(name).values for name in names])
    assert np.array([[*row][1:-1] for row in rows]).tolist() == expected.tolist()
    np.testing.assert_allclose(rows["sway"], result.quantity("sway").values, rtol=0, atol=1e-15)


@VERSIONS
def test_model_exchange_by_cvode_gives_the_motion(tmp_path, fmi):
    scene = dap.load("fourbar3")
    made = written(scene, tmp_path, fmi=fmi, outputs=["coupler.r"])
    result = dap.simulate(scene, t_end=0.5, dt=0.05)
    rows = fmpy.simulate_fmu(str(made.path), stop_time=0.5, output_interval=0.05, solver="CVode",
                             fmi_type="ModelExchange", relative_tolerance=1e-8)  # fmt: skip
    for t, r in zip(result.t, result.quantity("coupler.r").values, strict=True):
        found = [np.interp(t, rows["time"], rows[f"coupler.r.{axis}"]) for axis in "xyz"]
        # CVode to 1e-8 a step, times of rows to the last digits
        np.testing.assert_allclose(found, r, rtol=0, atol=1e-6)


@VERSIONS
def test_times_of_model_exchange_may_round_beyond_the_end(tmp_path, fmi):
    made = written(dap.load("pen1"), tmp_path, fmi=fmi, outputs=["cone.r"])
    fmu, at = begun(made, tmp_path, fmi, kind="ModelExchange")
    fmu.setTime(np.nextafter(5.0, 6.0))
    fmu.completedIntegratorStep()
    for t in (np.nan, np.inf, -1.0):
        with pytest.raises(fmpy.fmi1.FMICallException):
            fmu.setTime(t)
    fmu.setContinuousStates((ctypes.c_double * 14)(*[np.nan] * 14), 14)
    for name in ("cone.r.x", "der(state.cone.r.x)"):  # what an integrator tries has no values
        with pytest.raises(fmpy.fmi1.FMICallException):
            (fmu.getReal if fmi == 2 else fmu.getFloat64)([at[name]])
    fmu.setTime(5.1)
    with pytest.raises(fmpy.fmi1.FMICallException):
        fmu.completedIntegratorStep()
    fmu.freeInstance()


def touching():
    """A ball that bounces by a contact which events follow."""
    scene = bouncing()
    del scene.forces["floor"]
    scene.add_contact("ball_plane", "floor", P_i="ball.O", e=0.8)
    return scene


@VERSIONS
@pytest.mark.parametrize("make", [bouncing, touching])
def test_velocities_jump_at_events_of_model_exchange(tmp_path, fmi, make):
    """A ball from 1 m: at rest on top of the next flight, e^2 = 0.64 m, after V (1 + e)/g."""
    made = written(make(), tmp_path, fmi=fmi, outputs=["ball.r"])
    t = np.sqrt(2.0 / 9.81) * 1.8
    rows = fmpy.simulate_fmu(str(made.path), stop_time=t, output_interval=0.01, solver="CVode",
                             fmi_type="ModelExchange", relative_tolerance=1e-8)  # fmt: skip
    assert rows["ball.r.z"][-1] == pytest.approx(0.64, abs=1e-4)  # FMPy ends steps behind events


@VERSIONS
def test_inputs_and_parameters_are_set(tmp_path, fmi):
    from fmpy.validation import validate_fmu

    scene = _written(SPRING, tmp_path)
    made = written(scene, tmp_path, fmi=fmi, parameters=["forces.spring.k"], outputs=["cart.r.x"])
    assert validate_fmu(str(made.path)) == []
    times = np.arange(0.0, 2.0, 0.1)
    signal = np.array(list(zip(times, np.round(np.sin(times), 3), strict=True)),
                      dtype=[("time", float), ("push", float)])  # fmt: skip
    rows = fmpy.simulate_fmu(str(made.path), stop_time=2.0, output_interval=0.1, input=signal,
                             start_values={"forces.spring.k": 30.0}, fmi_type="CoSimulation",
                             output=["cart.r.x", "push"])  # fmt: skip
    scene.forces["spring"].fields["k"] = 30.0
    run = dap.start(scene, t_end=2.0)
    for k in range(19):
        push = float(np.interp(run.t, times, signal["push"]))
        run.step(float(rows["time"][k + 1] - run.t), inputs={"push": push})
    # FMPy interpolates inputs in another order
    assert rows["cart.r.x"][19] == pytest.approx(run.state["cart.r.x"], rel=1e-12)


@VERSIONS
def test_a_state_is_kept_and_serialised(tmp_path, fmi):
    scene = dap.load("pen1")
    made = written(scene, tmp_path, fmi=fmi)
    fmu, at = begun(made, tmp_path, fmi)
    reference = at["cone.r.z"]
    get = fmu.getReal if fmi == 2 else fmu.getFloat64
    keep, put = (fmu.getFMUstate, fmu.setFMUstate) if fmi == 2 else (
        fmu.getFMUState, fmu.setFMUState)  # fmt: skip
    fmu.doStep(0.0, 0.3)
    state = keep()
    serialise = fmu.serializeFMUstate if fmi == 2 else fmu.serializeFMUState
    restore = fmu.deSerializeFMUstate if fmi == 2 else fmu.deserializeFMUState
    data = serialise(state)
    fmu.doStep(0.3, 0.4)
    later = get([reference])
    put(restore(data) if fmi == 2 else state)
    fmu.doStep(0.3, 0.4)
    assert get([reference]) == later
    fmu.reset()
    assert get([reference])[0] == pytest.approx(dap.compile(scene).model.r[0, 2], abs=1e-9)
    fmu.terminate()
    fmu.freeInstance()


@VERSIONS
def test_stepped_contacts_are_of_co_simulation_alone(tmp_path, fmi):
    """Rates of the state would be those of bodies that fall through each other."""
    from fmpy.validation import validate_fmu

    made = written(falling_ball(), tmp_path, fmi=fmi, outputs=["ball.r"])
    assert validate_fmu(str(made.path)) == []
    assert fmpy.read_model_description(str(made.path)).modelExchange is None
    rows = fmpy.simulate_fmu(str(made.path), stop_time=0.3, output_interval=0.1)
    expected = dap.simulate(falling_ball(), t_end=0.3, dt=0.1).r[:, 0, 2]
    assert rows["ball.r.z"].tolist() == expected.tolist()
    with pytest.raises(Exception, match="Failed to instantiate"):
        begun(made, tmp_path, fmi, kind="ModelExchange")


@VERSIONS
def test_wrong_use_is_an_error_and_changes_nothing(tmp_path, fmi):
    made = written(dap.load("pen1"), tmp_path, fmi=fmi, outputs=["cone.r"])
    fmu, at = begun(made, tmp_path, fmi)
    get, put = (fmu.getReal, fmu.setReal) if fmi == 2 else (fmu.getFloat64, fmu.setFloat64)
    fmu.doStep(0.0, 0.5)
    before = get([at["cone.r.z"]])
    for call in (
        lambda: fmu.doStep(0.2, 0.1),
        lambda: fmu.doStep(0.5, -0.1),
        lambda: fmu.doStep(0.5, np.inf),
        lambda: get([2**32 - 1]),
        lambda: put([len(at)], [1.0]),
        lambda: put([at["cone.r.z"]], [1.0]),
        lambda: put([at["state.cone.r.x"]], [np.nan]),
    ):
        with pytest.raises(fmpy.fmi1.FMICallException):
            call()
        assert get([at["cone.r.z"]]) == before
    fmu.terminate()
    with pytest.raises(fmpy.fmi1.FMICallException):
        fmu.doStep(0.5, 0.1)
    fmu.reset()
    with pytest.raises(fmpy.fmi1.FMICallException):  # before it is initialised
        fmu.doStep(0.0, 0.1)
    if fmi == 2:
        fmu.setupExperiment(startTime=0.0, stopTime=np.inf)  # as of a run whose end is not known
        fmu.enterInitializationMode()
    else:
        fmu.enterInitializationMode(startTime=0.0, stopTime=np.inf)
    fmu.exitInitializationMode()
    fmu.doStep(0.0, 0.5)
    assert get([at["cone.r.z"]]) == pytest.approx(before, rel=1e-12)
    fmu.freeInstance()


@VERSIONS
def test_limits_of_parameters_are_described_and_kept(tmp_path, fmi):
    from fmpy.validation import validate_fmu

    scene = braced(tmp_path)
    name, inertias = "forces.brace.l0", ["bodies.cart.Jp.x", "bodies.cart.Jp.y"]
    made = written(scene, tmp_path, fmi=fmi, parameters=[name, *inertias])
    assert validate_fmu(str(made.path)) == []
    variables = fmpy.read_model_description(str(made.path)).modelVariables
    described = {v.name: (v.min, v.max) for v in variables if v.causality == "parameter"}
    assert described == {name: ("0.0", None)} | dict.fromkeys(inertias, (None, None))
    fmu, at = begun(made, tmp_path, fmi)
    with pytest.raises(fmpy.fmi1.FMICallException):
        (fmu.setReal if fmi == 2 else fmu.setFloat64)([at[name]], [-8.0])
    fmu.freeInstance()
    with pytest.raises(fmpy.fmi1.FMICallException):  # where initialisation ends
        fmpy.simulate_fmu(str(made.path), stop_time=0.1, start_values={inertias[0]: 4.0})


def begun(made, folder, fmi, kind="CoSimulation", **options):
    """An instance of an FMU, and the references of its variables."""
    description = fmpy.read_model_description(str(made.path))
    unzipped = fmpy.extract(str(made.path), str(folder / "unzipped"))
    arguments = {"unzipDirectory": unzipped, "guid": description.guid, "instanceName": "one",
                 "modelIdentifier": description.coSimulation.modelIdentifier}  # fmt: skip
    module = __import__(f"fmpy.fmi{fmi}", fromlist=["x"])
    name = {"CoSimulation": "Slave", "ModelExchange": "Model"}[kind]
    fmu = getattr(module, f"FMU{fmi}{name}")(**arguments)
    fmu.instantiate(**options)
    if fmi == 2:
        fmu.setupExperiment(startTime=0.0, stopTime=5.0)
        fmu.enterInitializationMode()
    else:
        fmu.enterInitializationMode(startTime=0.0, stopTime=5.0)
    fmu.exitInitializationMode()
    return fmu, {v.name: v.valueReference for v in description.modelVariables}


@VERSIONS
def test_directional_derivatives(tmp_path, fmi):
    """m r'' = f - k r - c v with m = 2 kg, k = 40 N/m, c = 0.3 N s/m."""
    made = written(_written(SPRING, tmp_path), tmp_path, fmi=fmi, outputs=["cart.rdd.x"])
    fmu, at = begun(made, tmp_path, fmi)
    unknowns = [at["der(state.cart.rd.x)"], at["cart.rdd.x"]]
    knowns = [at["state.cart.r.x"], at["state.cart.rd.x"], at["push"]]
    for seed, expected in (([1.0, 0.0, 0.0], -20.0), ([0.0, 1.0, 2.0], -0.15 + 1.0)):
        found = fmu.getDirectionalDerivative(unknowns, knowns, seed)
        assert list(found) == pytest.approx([expected] * 2, rel=1e-13)
    fmu.terminate()
    fmu.freeInstance()


def test_event_mode_and_early_return(tmp_path):
    """A function that takes another form at 0.4 s and 0.7 s: a step to 1 s ends there."""
    made = written(pushed(tmp_path), tmp_path, outputs=["cart.r.x"])
    fmu, _ = begun(made, tmp_path, 3, eventModeUsed=True, earlyReturnAllowed=True)
    needs, *_, next_event = fmu.updateDiscreteStates()
    assert (needs, next_event) == (False, 0.4)
    fmu.enterStepMode()
    assert fmu.doStep(0.0, 0.3) == (False, False, False, 0.3)
    assert fmu.doStep(0.3, 0.7) == (True, False, True, 0.4)
    fmu.enterEventMode()
    fmu.updateDiscreteStates()
    fmu.enterStepMode()
    assert fmu.doStep(0.4, 0.6) == (True, False, True, 0.7)
    fmu.terminate()
    fmu.freeInstance()


def test_a_bounce_is_an_event_of_co_simulation(tmp_path):
    made = written(bouncing(), tmp_path, outputs=["ball.r.z"])
    fmu, _ = begun(made, tmp_path, 3, eventModeUsed=True)
    fmu.enterStepMode()
    assert [fmu.doStep(0.2 * k, 0.2)[0] for k in range(4)] == [False, False, True, False]
    fmu.terminate()
    fmu.freeInstance()


def test_intermediate_updates_change_no_bit_and_may_end_a_step(tmp_path):
    scene = dap.load("pen1")
    made = written(scene, tmp_path, outputs=["cone.r"])
    seen, ends = [], []

    def update(_environment, t, _set, may_get, finished, can_return, early, when):
        seen.append((t, may_get, finished, fmu.getFloat64([at["cone.r.x"]])[0]))
        if ends and can_return:
            early[0], when[0] = True, ends[0]

    fmu, at = begun(made, tmp_path, 3, earlyReturnAllowed=True, intermediateUpdate=update)
    assert fmu.doStep(0.0, 0.5)[3] == 0.5
    times = [t for t, *_ in seen]
    assert len(times) > 3
    assert times == sorted(times)
    assert times[-1] < 0.5
    expected = dap.simulate(scene, t_end=5.0, dt=0.5).quantity("cone.r.x").values[1]
    assert fmu.getFloat64([at["cone.r.x"]])[0] == expected
    ends.append(0.75)
    _, _, early, last = fmu.doStep(0.5, 0.5)
    assert (early, last) == (True, 0.75)
    fmu.terminate()
    fmu.freeInstance()


def test_units_are_products_of_base_units():
    assert _in_base_units("N m") == (1.0, {"kg": 1, "m": 2, "s": -2})
    assert _in_base_units("rad/s") == (1.0, {"rad": 1, "s": -1})
    factor, powers = _in_base_units("deg")
    assert (factor, powers) == (pytest.approx(np.pi / 180.0), {"rad": 1})
    assert _in_base_units("parsnip") == (1.0, {"parsnip": 1})


def test_a_wrong_token_is_refused(tmp_path):
    made = written(dap.load("pen1"), tmp_path)
    with zipfile.ZipFile(made.path) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        name = next(n for n in archive.namelist() if n.startswith("binaries"))
        archive.extract(name, tmp_path)
    assert root.get("fmiVersion") == "3.0"
    create = ctypes.CDLL(str(tmp_path / name)).fmi3InstantiateCoSimulation
    create.restype = ctypes.c_void_p
    create.argtypes = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_char_p, *[ctypes.c_bool] * 4,
                       ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_void_p] * 3]  # fmt: skip
    rest = None, False, False, False, False, None, 0, None, None, None
    assert create(b"a", b"{other}", *rest) is None
    assert create(b"a", root.get("instantiationToken").encode(), *rest)
