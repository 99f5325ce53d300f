"""Lengths of tendons at poses of links, and their rates."""

from collections.abc import Callable
from typing import Any

from dap3d_core.interface.formats.articulation import Tendon
from dap3d_core.interface.formats.frames import Frame
from dap3d_core.interface.formats.remarks import FormatError
from dap3d_core.kernels.wrapping import INSIDE, PAST_SIDE, cable_length, cable_rate, cable_spans


def length_of_line(line: Tendon, pose_of: Callable[[str], Frame]) -> float:
    """The length of a tendon over points and drums, m.

    Args:
        line: the tendon.
        pose_of: the pose of a link.

    Raises:
        FormatError: two points that follow each other lie in one place.
    """
    return float(cable_length(_path(line, pose_of)))


def rate_of_line(
    line: Tendon, pose_of: Callable[[str], Frame], motion_of: Callable[[str, Any], Any]
) -> float:
    """The rate of the length of a tendon, m/s.

    Args:
        line, pose_of: as of ``length_of_line``.
        motion_of: velocity, (3,), of a point of a link, and how this turns, in global axes.
    """
    points = [tuple(motion_of(link, at)[0]) for link, at in line.points]
    moves = [motion_of(drum.link, drum.at.r) for drum in line.ordered_drums]
    speeds, turns = ([tuple(move[k]) for move in moves] for k in range(2))
    return float(cable_rate(_path(line, pose_of), points, speeds, turns))


def _path(line: Tendon, pose_of: Callable[[str], Frame]) -> Any:
    def place(link: str, frame: Frame) -> tuple[float, ...]:
        return tuple((pose_of(link) @ frame).r.tolist())

    drums = line.ordered_drums
    axes = [tuple((pose_of(d.link) @ d.at).A[:, 2].tolist()) for d in drums if d.cylinder]
    sides = [d.side or (d.link, d.at.r) for d in drums]
    ways = tuple(INSIDE if d.inside else PAST_SIDE * (d.side is not None) for d in drums)
    points = [place(link, Frame(at)) for link, at in line.points]
    divisors = line.divisors or (1.0,) * len(points)
    ends = zip(points[:-1], points[1:], divisors[: len(points) - 1], strict=True)
    if any(by and one == other for one, other, by in ends):
        what = f"tendon {line.name}: two points that follow each other lie in one place"
        raise FormatError(what, line.place, "they have no direction; move one, or leave it out")
    return cable_spans(
        points,
        [place(d.link, d.at) for d in drums], [d.radius for d in drums], axes,
        [place(link, Frame(at)) for link, at in sides], tuple(float(d.after) for d in drums), ways,
        divisors,
    )  # fmt: skip
