"""A moving scene as a binary glTF 2.0 file (.glb), which Blender, browsers and viewers play.

A body is a node whose translation and rotation are cubic splines through the reported positions
and velocities; what is drawn of it are nodes below. A container is a header and two chunks, JSON
and numbers, so that it is written here (docs/decisions/0025-results-for-other-programs.md).
"""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from dap3d_core.interface.formats import Exporter, ResultExporter, hookimpl
from dap3d_core.model.groups import Floats, Integers
from dap3d_core.model.rotations import euler_rates
from dap3d_core.result import ResultError
from dap3d_core.result.file.atomic_write import cannot
from dap3d_core.view.scene3d.primitives import Triangles, turned_to
from dap3d_core.view.scene3d.shapes import Line, Part
from dap3d_results.moving_solids import MovingScene, Stretched, rgb

Progress = Callable[[int, int], None]

#: Kinds of numbers, of buffers and of primitives, as the format counts them.
FLOAT, UINT = 5126, 5125
VERTICES, INDICES = 34962, 34963
LINE_STRIP = 3
TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
#: A file says its own length in 32 bits.
LARGEST = 2**32 - 1
#: Layers that are translucent, as in pages.
OPACITY = {"inertia": 0.32}

interface_version = 1


class GltfExporter(ResultExporter):
    """The moving scene for Blender, browsers and viewers."""

    keyword, title, suffix = "gltf", "glTF", ".glb"

    def write_result(
        self, result: Any, path: Path, *, model: Any, progress: Progress | None
    ) -> list[str]:
        """Write a file; returns notes."""
        moving = MovingScene.of(result, model)
        write_gltf(moving, path, progress)
        return moving.notes


def write_gltf(scene: MovingScene, path: Path, progress: Progress | None = None) -> None:
    """Write a file; ``progress`` is called with the bodies that are written and all.

    Raises:
        ResultError: the file cannot be written, or would be too large for the format.
    """
    made = _Document(scene, progress or (lambda done, total: None))
    text = json.dumps(made.tree, separators=(",", ":"), allow_nan=False).encode()
    chunks = [(b"JSON", _padded(text, b" ")), (b"BIN\0", _padded(bytes(made.data), b"\0"))]
    length = 12 + sum(8 + len(chunk) for _, chunk in chunks)
    if length > LARGEST:
        raise ResultError(
            f"the scene takes {length / 1e9:.1f} GB, a .glb file holds 4.3 GB: a smaller fps "
            "leaves instants out"
        )
    try:
        with path.open("wb") as file:
            file.write(struct.pack("<4sII", b"glTF", 2, length))
            for kind, chunk in chunks:
                file.write(struct.pack("<I4s", len(chunk), kind))
                file.write(chunk)
    except OSError as error:
        raise cannot("write", path, error) from error


def _padded(data: bytes, filler: bytes) -> bytes:
    return data + filler * (-len(data) % 4)


class _Document:
    """The two chunks of a file: a tree for JSON, and numbers."""

    def __init__(self, scene: MovingScene, progress: Progress) -> None:
        self.data = bytearray()
        self._shared: dict[Any, int] = {}
        record = scene.result.record
        self.tree: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": f"dap3d {record.versions.get('dap3d', '')}"},
            "scene": 0,
            "scenes": [{"name": record.title or "scene", "nodes": [0]}],
        }
        instants = scene.result.t.astype(np.float32) - np.float32(0.0)
        self._times, self._first = np.unique(instants, return_index=True)
        self._last = len(instants) - 1 - np.unique(instants[::-1], return_index=True)[1]
        self._clock = self._accessor(self._times - self._times[0], bounds=True)
        self._animation: dict[str, Any] = {"name": "motion", "samplers": [], "channels": []}
        root = self._add("nodes", {"name": "ground", "rotation": _upright(scene.up)})
        self._bodies(scene, root, progress)
        if self._animation["channels"] and len(self._times) > 1:
            self.tree["animations"] = [self._animation]
        self.tree["buffers"] = [{"byteLength": len(self.data) + -len(self.data) % 4}]

    def _bodies(self, scene: MovingScene, root: int, progress: Progress) -> None:
        names = scene.result.summary.body_names
        nodes = [root, *(self._body(scene, k, name) for k, name in enumerate(names))]
        children: list[list[int]] = [[] for _ in nodes]
        children[0] += nodes[1:]
        pieces: list[Part | Line] = [*scene.parts, *scene.lines]
        for done, one in enumerate(pieces, 1):
            children[one.body].append(self._piece(one))
            progress(done, len(pieces))
        children[0] += [self._span(one) for one in scene.stretched]
        for node, below in zip(nodes, children, strict=True):
            if below:
                self.tree["nodes"][node]["children"] = below

    def _body(self, scene: MovingScene, k: int, name: str) -> int:
        """The node of a body: its first pose, and its motion."""
        r, p = scene.result.r[:, k], scene.result.p[:, k]
        p_dot = euler_rates(p, scene.result.w[:, k])
        node = self._add("nodes", {"name": name})
        self._move(node, "translation", r, scene.result.rd[:, k])
        self._move(node, "rotation", _xyzw(p), _xyzw(p_dot))
        return node

    def _piece(self, one: Part | Line) -> int:
        node: dict[str, Any] = {"name": one.owner, "mesh": self._mesh(one)}
        if isinstance(one, Part):
            node |= {"translation": list(one.at), "rotation": _xyzw(np.array([one.q]))[0].tolist(),
                     "scale": list(one.size)}  # fmt: skip
        return self._add("nodes", node)

    def _span(self, one: Stretched) -> int:
        node = self._add("nodes", {"name": one.owner, "mesh": self._mesh(one)})
        self._move(node, "translation", one.at)
        self._move(node, "rotation", _xyzw(one.q))
        self._move(node, "scale", one.size)
        return node

    def _move(self, node: int, path: str, values: Floats, rates: Floats | None = None) -> None:
        """First value and motion of a node: cubic where its rate is known, else linear.

        An instant that an event reports twice has a rate before it and one after it.
        """
        self.tree["nodes"][node][path] = values[0].tolist()
        course, kind = values[self._last], "LINEAR"
        if rates is not None:
            course = np.stack([rates[self._first], course, rates[self._last]], axis=1)
            course, kind = course.reshape(-1, values.shape[1]), "CUBICSPLINE"
        samplers, channels = self._animation["samplers"], self._animation["channels"]
        channels.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
        samplers.append(
            {"input": self._clock, "output": self._accessor(course), "interpolation": kind}
        )

    def _mesh(self, one: Part | Line | Stretched) -> int:
        """The mesh of a piece; parts that look alike share it."""
        color = rgb(one.color)
        form_key = one.key if isinstance(one, Part) else id(one)
        key = ("mesh", form_key, color, one.layer)
        if key not in self._shared:
            if isinstance(one, Line):
                corners = self._accessor(one.vertices, VERTICES, bounds=True)
                primitive: dict[str, Any] = {"attributes": {"POSITION": corners}}
                primitive["mode"] = LINE_STRIP
            else:
                primitive = self._primitive(form_key, one.form)
            primitive["material"] = self._material(color, OPACITY.get(one.layer, 1.0))
            self._shared[key] = self._add("meshes", {"primitives": [primitive]})
        return self._shared[key]

    def _primitive(self, key: object, form: Triangles) -> dict[str, Any]:
        if ("form", key) not in self._shared:
            positions = self._accessor(form.vertices, VERTICES, bounds=True)
            self._accessor(form.normals, VERTICES)
            self._accessor(form.triangles.reshape(-1), INDICES)
            self._shared["form", key] = positions
        first = self._shared["form", key]
        return {"attributes": {"POSITION": first, "NORMAL": first + 1}, "indices": first + 2}

    def _material(self, color: tuple[int, ...], opacity: float) -> int:
        key = ("material", color, opacity)
        if key not in self._shared:
            rough = {"metallicFactor": 0.04, "roughnessFactor": 0.62,
                     "baseColorFactor": [*map(_linear, color), opacity]}  # fmt: skip
            look: dict[str, Any] = {"pbrMetallicRoughness": rough, "doubleSided": True}
            look |= {"alphaMode": "BLEND"} if opacity < 1.0 else {}
            self._shared[key] = self._add("materials", look)
        return self._shared[key]

    def _accessor(self, values: Floats | Integers, target: int = 0, *, bounds: bool = False) -> int:
        """Numbers (n,) or (n, width) as single-precision floats, indices as integers."""
        whole = np.issubdtype(values.dtype, np.integer)
        with np.errstate(over="ignore"):
            data = np.ascontiguousarray(values, dtype="<u4" if whole else "<f4")
        if not np.all(np.isfinite(data)):
            raise ResultError(
                "the motion reaches points that the single precision of glTF does not hold: export "
                "it as vtk, or its arrays as mat or csv"
            )
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self.data)}
        view |= {"byteLength": data.nbytes} | ({"target": target} if target else {})
        self.data += data.tobytes()
        width = data.shape[1] if data.ndim > 1 else 1
        about: dict[str, Any] = {
            "bufferView": self._add("bufferViews", view),
            "componentType": UINT if whole else FLOAT,
            "count": len(data),
            "type": TYPES[width],
        }
        if bounds:
            columns = data.reshape(-1, width)
            about |= {"min": columns.min(axis=0).tolist(), "max": columns.max(axis=0).tolist()}
        return self._add("accessors", about)

    def _add(self, kind: str, one: dict[str, Any]) -> int:
        every = self.tree.setdefault(kind, [])
        every.append(one)
        return len(every) - 1


def _xyzw(p: Floats) -> Floats:
    """Euler parameters (n, 4) in the order of the format."""
    return np.roll(p, -1, axis=1)


def _upright(up: tuple[float, ...]) -> list[float]:
    """The rotation (x, y, z, w) that turns ``up`` to y, which is up in the format."""
    to_z = np.array(turned_to(up)) * (1.0, -1.0, -1.0, -1.0)
    half = np.sqrt(0.5)
    w, x, y, z = to_z  # then z to y: a quarter turn about -x
    return list(map(float, half * np.array([x - w, y + z, z - y, w + x])))


def _linear(level: int) -> float:
    """A part of an sRGB colour, 0 to 255, as linear intensity."""
    c = level / 255.0
    return c / 12.92 if c <= 0.04045 else float(((c + 0.055) / 1.055) ** 2.4)


@hookimpl
def dap3d_exporters() -> list[type[Exporter]]:
    """The exporters of this module."""
    return [GltfExporter]
