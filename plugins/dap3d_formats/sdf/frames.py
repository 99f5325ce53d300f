"""Frames of SDF, each given in another one, and the links that they are fixed to."""

from collections.abc import Collection

import attrs

from dap3d_core.interface.formats import WORLD, FormatError, Frame, Place


@attrs.define(eq=False)
class FrameGraph:
    """Frames by their full names.

    Attributes:
        poses: frame -> the frame that it is given in, and its pose there.
        attached: frame -> the frame that it is attached to: of a <frame>, a joint, a nested model,
            a model with a canonical link.
    """

    poses: dict[str, tuple[str, Frame, Place]] = attrs.Factory(dict)
    attached: dict[str, str] = attrs.Factory(dict)
    _placements: dict[str, str] = attrs.Factory(dict)
    _known: dict[str, Frame] = attrs.Factory(dict)

    def add(
        self, name: str, relative_to: str, pose: Frame, place: Place, *, placement: str = ""
    ) -> None:
        """Add a frame; of a model, ``placement`` is the inner frame whose pose is given.

        Raises:
            FormatError: there is one of this name.
        """
        if name == WORLD and self.poses:
            raise FormatError("the name world is that of what does not move", place)
        if name in self.poses:
            raise FormatError(f"there are two frames {name}", place)
        self.poses[name] = (relative_to, pose, place)
        if placement:
            self._placements[name] = placement

    def in_world(self, name: str, place: Place) -> Frame:
        """The pose of a frame in the world.

        Raises:
            FormatError: there is no such frame, or frames are given in a circle.
        """
        path: list[str] = []
        frame = name
        while frame not in self._known and frame != WORLD:
            if frame not in self.poses:
                raise FormatError(f"there is no frame {frame}", place)
            if frame in path:
                raise FormatError(f"frame {frame} is given in itself: {' -> '.join(path)}", place)
            path.append(frame)
            frame = self.poses[frame][0]
        self._known.setdefault(WORLD, Frame())
        for one in reversed(path):
            relative_to, pose, _ = self.poses[one]
            known = self._known[relative_to] @ pose
            if one in self._placements:
                known = known @ self._within(one, self._placements[one], place).inverse()
            self._known[one] = known
        return self._known[name]

    def _within(self, model: str, frame: str, place: Place) -> Frame:
        """The pose of a frame of a model in the frame of the model."""
        pose, count = Frame(), 0
        while frame != model:
            if frame not in self.poses or count > len(self.poses):
                raise FormatError(f"there is no frame {frame} in {model}", place)
            relative_to, here, _ = self.poses[frame]
            pose, frame, count = here @ pose, relative_to, count + 1
        return pose

    def link_of(self, name: str, links: Collection[str], place: Place) -> str:
        """The link that a frame is fixed to, or WORLD.

        Raises:
            FormatError: there is no such frame, or none of it is a link.
        """
        path = [name]
        while name not in links and name != WORLD:
            if name.endswith("__model__") and name not in self.attached:
                scope = name.removesuffix("__model__")
                inner = (link for link in links if link.startswith(scope))
                name = next(inner, WORLD)
                break
            name = self.attached.get(name, "")
            if not name or name in path:
                raise FormatError(f"there is no link or frame {path[0]}", place)
            path.append(name)
        return name
