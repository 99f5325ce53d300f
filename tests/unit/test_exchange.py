"""Files for other programs hold the motion of the result, as readers of others find it."""

import json
import struct

import attrs
import numpy as np
import pytest
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

import dap3d_core as dap
from dap3d_core.result import ResultError
from dap3d_results.gltf import write_gltf
from dap3d_results.moving_solids import MovingScene

#: A pyramid that no symmetry maps to itself: its vertices tell its pose.
PYRAMID = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], dtype=float)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A model of two bodies that turn and fly, tied by a spring, with a mesh, a box and a line."""
    folder = tmp_path_factory.mktemp("kite")
    (folder / "pyramid.obj").write_text(PYRAMID)
    scene = dap.Scene(name="kite")
    scene.add_body("a", mass=1.0, Jp=[1.0, 2.0, 3.0], r=[0.1, 0.2, 0.3], w=[0.3, 5.0, 0.1])
    scene.add_body("b", mass=2.0, Jp=[2.0, 1.0, 2.5], r=[0.0, 3.0, 1.0], r_dot=[1.0, 0.0, 0.0])
    scene.add_point("A", "a", [0.0, 0.0, 0.5])
    scene.add_force("ptp", "tie", P_i="A", P_j="b.O", k=20.0, l0=1.0)
    scene.add_force("weight")
    scene.add_shape("mesh", "kite", body="a", file="pyramid.obj", color="tab:red")
    scene.add_shape("box", "brick", body="b", size=[0.2, 0.4, 0.6], color="#0000ff")
    scene.add_shape("line", "tail", body="b", points=[[0.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    scene.save(folder / "scene.toml")
    return folder


@pytest.fixture(scope="module")
def result(folder):
    return dap.simulate(folder / "scene.toml", t_end=1.0, dt=0.05)


def places(result, body, local):
    """(nt, k, 3) places of points (k, 3) of a body, as scipy turns them."""
    p = result.p[:, body]
    turns = Rotation.from_quat(np.roll(p, -1, axis=1))
    return result.r[:, body, None] + np.stack([turn.apply(local) for turn in turns])


def box_corners():
    return np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.3, 0.3)])


def nearest(points, wanted):
    """Largest distance of wanted points from the nearest of the points."""
    return np.linalg.norm(wanted[:, None] - points[None], axis=2).min(axis=1).max()


def test_vtk_shows_the_scene_where_the_result_has_it(result, folder, tmp_path):
    """VTK's own reader finds every instant, and the bodies in each fifth one."""
    hdf = pytest.importorskip("vtkmodules.vtkIOHDF", reason="pip install -e '.[test]'")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline

    made = dap.export(result, tmp_path / "kite.vtkhdf", model=folder)
    assert (made.format, made.instants, made.notes) == ("vtk", len(result.t), ())
    reader = hdf.vtkHDFReader()
    reader.SetFileName(str(made.path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(Pipeline.TIME_STEPS())
    assert times == tuple(result.t)
    kite, brick = places(result, 0, CORNERS), places(result, 1, box_corners())
    tail = places(result, 1, np.array([[0.0, 0.0, 0.0], [0.0, -1.0, 0.0]]))
    ends = places(result, 0, np.array([[0.0, 0.0, 0.5]]))[:, 0], result.r[:, 1]
    for k, t in list(enumerate(times))[::5]:
        reader.UpdateTimeStep(t)
        shown = reader.GetOutput()
        points = vtk_to_numpy(shown.GetPoints().GetData())
        body = vtk_to_numpy(shown.GetCellData().GetArray("body"))
        color = vtk_to_numpy(shown.GetCellData().GetArray("color"))
        lines, faces = shown.GetNumberOfLines(), shown.GetNumberOfPolys()
        assert (lines, len(body)) == (1, lines + faces)
        corners = vtk_to_numpy(shown.GetPolys().GetConnectivityArray()).reshape(-1, 3)
        of = {b: points[np.unique(corners[body[lines:] == b])] for b in (1, 2)}
        assert nearest(of[1], kite[k]) < 1e-12  # rounding at some metres
        assert nearest(of[2], brick[k]) < 1e-12
        strip = vtk_to_numpy(shown.GetLines().GetConnectivityArray())
        np.testing.assert_allclose(points[strip], tail[k], atol=1e-12)
        spring_points = points[np.unique(corners[body[lines:] == -1])]
        for end in ends:  # the wire's own radius from its end
            assert np.linalg.norm(spring_points - end[k], axis=1).min() < 0.05
        assert {tuple(c) for c in color[body == 2].tolist()} >= {(0, 0, 255)}


def test_a_vtk_file_holds_its_cells_once(result, folder, tmp_path):
    """Of an instant more there are its points and its time, nothing else."""
    import netCDF4

    sizes = []
    for fps in (2.0, 20.0):
        made = dap.export(result, tmp_path / f"{fps:g}.vtkhdf", model=folder, fps=fps)
        with netCDF4.Dataset(made.path) as file:
            root = file["VTKHDF"]
            sizes.append(root["Polygons/Connectivity"].size)
            assert len(root["Points"]) == made.instants * root["NumberOfPoints"][0]
            assert root["Steps"].NSteps == made.instants
    assert sizes[0] == sizes[1]


class Document:
    """A .glb file, taken to pieces as the format's text says."""

    def __init__(self, path):
        data = path.read_bytes()
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        self.tree = json.loads(data[20 : 20 + size])
        rest, kind = struct.unpack_from("<I4s", data, 20 + size)
        assert (kind, 28 + size + rest) == (b"BIN\0", len(data))
        self.binary = data[28 + size :]

    def numbers(self, accessor):
        about = self.tree["accessors"][accessor]
        view = self.tree["bufferViews"][about["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[about["type"]]
        kind = {5126: "<f4", 5125: "<u4"}[about["componentType"]]
        found = np.frombuffer(self.binary, kind, about["count"] * width, view["byteOffset"])
        return found.reshape(-1, width).astype(float)

    def course(self, name, path):
        """Times, in-tangents, values, out-tangents of a node."""
        node = next(k for k, n in enumerate(self.tree["nodes"]) if n["name"] == name)  # the body's
        (animation,) = self.tree["animations"]
        (channel,) = [
            c for c in animation["channels"] if c["target"] == {"node": node, "path": path}
        ]
        sampler = animation["samplers"][channel["sampler"]]
        assert sampler["interpolation"] == "CUBICSPLINE"
        values = self.numbers(sampler["output"])
        return self.numbers(sampler["input"])[:, 0], *values.reshape(
            -1, 3, values.shape[1]
        ).swapaxes(0, 1)


def test_a_gltf_film_is_the_motion_of_the_result(result, folder, tmp_path):
    made = dap.export(result, tmp_path / "kite.glb", model=folder)
    found = Document(made.path)
    single = 1e-6  # three units of the last place of single precision at some metres
    for k, name in enumerate(("a", "b")):
        t, before, r, after = found.course(name, "translation")
        np.testing.assert_allclose(t, result.t, atol=1e-7)
        np.testing.assert_allclose(r, result.r[:, k], atol=single)
        np.testing.assert_allclose(before, result.rd[:, k], rtol=1e-6, atol=3 * single)
        np.testing.assert_array_equal(before, after)
        _, _, q, q_dot = found.course(name, "rotation")
        np.testing.assert_allclose(np.roll(q, 1, axis=1), result.p[:, k], atol=single)
        turning = Rotation.from_quat(q[1:]) * Rotation.from_quat(q[:-1]).inv()
        middle = 0.5 * (result.w[1:, k] + result.w[:-1, k])
        h = result.t[1]  # to second order in h: |w_ddot| h^2 is below 0.3 rad/s here
        np.testing.assert_allclose(turning.as_rotvec() / h, middle, atol=0.1)
        assert abs(np.sum(q * q_dot, axis=1)).max() < 3e-6  # |q| stays 1


def test_a_viewer_finds_the_scene_of_the_first_instant(result, folder, tmp_path):
    """trimesh reads what stands still; y is up in glTF, z was."""
    trimesh = pytest.importorskip("trimesh")
    made = dap.export(result, tmp_path / "kite.glb", model=folder)
    scene = trimesh.load_scene(made.path)
    upright = Rotation.from_euler("x", -90, degrees=True)
    points = np.vstack([g.vertices for g in scene.dump() if hasattr(g, "faces")])
    assert nearest(points, upright.apply(places(result, 0, CORNERS)[0])) < 1e-6
    assert nearest(points, upright.apply(places(result, 1, box_corners())[0])) < 1e-6


def test_an_instant_that_is_reported_twice_has_a_rate_before_and_after(result, tmp_path):
    """The format takes an instant once; a blow is a corner of the curve, not a bend."""
    arrays = result.arrays.at(np.array([0, 1, 1, 2]))
    u = arrays.u.copy()
    u[2, 14:17] *= -1.0  # the velocity of the first body
    struck = dap.Result(
        result.summary, attrs.evolve(arrays, u=u), result.record, lambda: result._origin
    )
    made = dap.export(struck, tmp_path / "a.glb")
    t, before, r, after = Document(made.path).course("a", "translation")
    np.testing.assert_allclose(t, result.t[:3], atol=1e-7)
    np.testing.assert_allclose(r, result.r[:3, 0], atol=1e-6)
    np.testing.assert_array_equal(before[1], -after[1])
    np.testing.assert_array_equal(before[[0, 2]], after[[0, 2]])


def test_a_motion_beyond_single_precision_is_refused(tmp_path):
    scene = dap.Scene(name="far")
    scene.add_body("a", r=[1e60, 0.0, 0.0])
    result = dap.simulate(scene, t_end=0.1, dt=0.1)
    with pytest.raises(ResultError, match="single precision"):
        write_gltf(MovingScene.of(result, None), tmp_path / "a.glb")


def test_matlab_finds_every_array_with_its_unit(result, tmp_path):
    dap.export(result, tmp_path / "kite.mat")
    found = loadmat(tmp_path / "kite.mat", simplify_cells=True)
    for name in ("r", "p", "rd", "w", "wp", "rdd", "wd", "wpd", "rP", "rPd", "rPdd", "u"):
        np.testing.assert_array_equal(found[name], getattr(result, name).squeeze(), err_msg=name)
    np.testing.assert_array_equal(found["t"], result.t)
    np.testing.assert_array_equal(found["total_energy"], result.energy.total)
    assert list(found["body"]) == ["a", "b"]
    assert (found["units"]["rdd"], found["units"]["t"]) == ("m/s^2", "s")
    assert found["about"]["scene"] == result.scene_text


def test_a_table_is_that_of_the_post_processor(result, tmp_path):
    from support.internals import columns_of, write_csv

    dap.export(result, tmp_path / "a.csv")
    write_csv(result, tmp_path / "b.csv", columns_of(result))
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("a.txt", {}, "vtkhdf"),
        ("a.glb", {"format": "mat"}, "its name says gltf"),
        ("a.out", {"format": "stl"}, "no format"),
        ("a.glb", {"fps": 0.0}, "fps"),
        ("a.csv", {"fps": float("nan")}, "fps"),
    ],
)
def test_what_cannot_be_is_refused(result, tmp_path, name, options, words):
    with pytest.raises(ValueError, match=words):
        dap.export(result, tmp_path / name, **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a.vtkhdf", "a.glb", "a.mat", "a.csv"])
def test_an_existing_file_is_kept_and_an_interrupted_one_vanishes(result, tmp_path, name):
    (tmp_path / name).write_text("mine")
    with pytest.raises(ResultError, match="exists"):
        dap.export(result, tmp_path / name)
    assert (tmp_path / name).read_text() == "mine"

    def stop(done, total):
        raise KeyboardInterrupt

    if name in ("a.vtkhdf", "a.glb"):
        with pytest.raises(KeyboardInterrupt):
            dap.export(result, tmp_path / name, progress=stop, force=True)
        assert [file.name for file in tmp_path.iterdir()] == [name]
        assert (tmp_path / name).read_text() == "mine"


def test_meshes_that_are_not_at_hand_are_noted(result, tmp_path):
    made = dap.export(result, tmp_path / "a.glb")
    assert ["kite" in note and "--model" in note for note in made.notes] == [True]


def test_a_package_brings_a_format_of_results(install, result, tmp_path):
    """Found by its keyword or by the suffix; it is no format of models."""
    text = (
        "from dap3d_core.interface.formats import ResultExporter, hookimpl\n"
        "interface_version = 1\n"
        "class Instants(ResultExporter):\n"
        "    keyword, title, suffix = 'instants', 'Instants', '.txt'\n"
        "    def write_result(self, result, path, *, model, progress):\n"
        "        path.write_text(' '.join(map(str, result.t)))\n"
        "        return ['bodies are left out']\n"
        "@hookimpl\n"
        "def dap3d_exporters():\n"
        "    return [Instants]\n"
    )
    install("parts", text, "instants", "dap3d.exporters")
    made = dap.export(result, tmp_path / "a.txt")
    assert (made.format, made.notes) == ("instants", ("bodies are left out",))
    assert [float(one) for one in made.path.read_text().split()] == result.t.tolist()
    with pytest.raises(dap.PluginError, match=r"instants is a format of results"):
        dap.export_model("pen1", format="instants")


def test_a_format_that_two_packages_bring_says_so(install, result, tmp_path):
    text = (
        "from dap3d_core.interface.formats import hookimpl\n"
        "interface_version = 1\n"
        "@hookimpl\n"
        "def dap3d_exporters():\n"
        "    return []\n"
    )
    install("parts", text, "vtk", "dap3d.exporters")
    with pytest.raises(dap.PluginError, match="vtk"):
        dap.export(result, tmp_path / "a.vtkhdf", format="vtk")
    assert dap.export(result, tmp_path / "a.csv").format == "csv"
