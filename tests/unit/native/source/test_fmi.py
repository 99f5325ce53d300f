"""FMUs where states and outputs are touched before they are initialised, called by ctypes."""

import ctypes
import zipfile
from ctypes import byref, c_bool, c_double, c_size_t, c_uint32, c_void_p
from xml.etree import ElementTree

import pytest
from support.bouncing import bouncing

import dap3d_core as dap


class Instance:
    """A co-simulation of an FMU 3.0."""

    def __init__(self, path, folder):
        """Args: the FMU; a folder for its files."""
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
        description = ElementTree.parse(folder / "modelDescription.xml").getroot()
        variables = description.find("ModelVariables")
        self.references = {v.get("name"): int(v.get("valueReference")) for v in variables}
        self.starts = {v.get("name"): float(v.get("start")) for v in variables if v.get("start")}
        (library,) = (*folder.rglob("*.so"), *folder.rglob("*.dylib"), *folder.rglob("*.dll"))
        self.library = ctypes.CDLL(str(library))
        instantiate = self.library.fmi3InstantiateCoSimulation
        instantiate.restype = c_void_p
        token = description.get("instantiationToken").encode()
        self.instance = c_void_p(
            instantiate(b"one", token, b"", False, False, False, False, None, c_size_t(0), None,
                        None, None)
        )  # fmt: skip

    def get(self, name):
        value, reference = c_double(), c_uint32(self.references[name])
        assert not self.library.fmi3GetFloat64(
            self.instance, byref(reference), c_size_t(1), byref(value), c_size_t(1)
        )
        return value.value

    def set(self, name, value):
        number, reference = c_double(value), c_uint32(self.references[name])
        assert not self.library.fmi3SetFloat64(
            self.instance, byref(reference), c_size_t(1), byref(number), c_size_t(1)
        )

    def initialise(self):
        call, end = self.library, c_double(1.0)
        assert not call.fmi3EnterInitializationMode(
            self.instance, False, c_double(), c_double(), True, end
        )
        return call.fmi3ExitInitializationMode(self.instance)

    def step(self, h):
        flags, last = [c_bool() for _ in range(3)], c_double()
        assert not self.library.fmi3DoStep(
            self.instance, c_double(0.0), c_double(h), True, *map(byref, flags), byref(last)
        )

    def free(self):
        self.library.fmi3FreeInstance(self.instance)


@pytest.fixture
def begun(tmp_path):
    made = []

    def begin(scene, **options):
        path = tmp_path / f"{scene.name}.fmu"
        if not path.exists():
            dap.export_model(scene, path, **options)
        made.append(Instance(path, tmp_path / str(len(made))))
        return made[-1]

    yield begin
    for one in made:
        one.free()


def lying():
    """A ball at rest on the ground, by a contact that events follow."""
    scene = dap.Scene(name="lying")
    scene.add_body("ball", mass=2.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 0.0))
    scene.add_force("weight", "gravity", gravity=9.81)
    scene.add_contact("ball_plane", "floor", P_i="ball.O", e=0.0)
    return scene


@pytest.mark.slow
def test_a_run_begins_at_the_states_that_are_set(begun):
    options = {"outputs": ["ball.r.z"]}
    one = begun(lying(), **options)
    one.set("state.ball.r.z", 1.0)
    assert one.initialise() == 0
    one.step(0.2)
    # z = 1 - g t^2/2, not held by what it touched in its scene
    assert one.get("ball.r.z") == pytest.approx(1.0 - 9.81 * 0.02, rel=1e-12)
    one = begun(lying(), **options)
    for name, value in one.starts.items():  # as importers do
        one.set(name, value)
    assert one.initialise() == 0
    assert one.get("state.joints.floor.mode") > 0.5
    one.step(0.2)
    assert abs(one.get("ball.r.z")) < 1e-12
    one = begun(lying(), **options)
    one.set("state.ball.r.z", -0.1)
    assert one.initialise() != 0  # its bodies overlap


@pytest.mark.slow
def test_what_is_read_before_changes_no_bit(begun):
    """Two balls that strike the ground, one at the start, the other 1 us later."""
    scene = bouncing()
    scene.bodies["ball"].r, scene.bodies["ball"].r_dot = (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)
    body = {"mass": 2.0, "Jp": (0.1, 0.1, 0.1), "r": (1.0, 0.0, 1e-6), "r_dot": (0.0, 0.0, -1.0)}
    scene.add_body("other", **body)
    scene.add_force("plane_stop", "below", P_i="other.O", e=0.8, k=1e4)
    found = []
    for reads in (False, True):
        one = begun(scene, outputs=["ball.r.z", "other.r.z"])
        if reads:
            one.get("ball.r.z")
        one.initialise()
        one.step(0.1)
        found.append([one.get("ball.r.z"), one.get("other.r.z")])
    assert found[0] == found[1]
