"""Picture of a stick figure at an instant; the parts that do not move are drawn once."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D

from dap3d_core.model.groups import Floats
from dap3d_core.plot.film import projection
from dap3d_core.plot.film.stick_figure import Sticks
from dap3d_core.plot.style import LETTERS, WIDTH, columns_of, shown_text

#: More bodies have no names in the picture.
MOST_NAMES = 8
#: Inches: room for the title above, for the numbers of axes, for a row of the legend.
TOP, LEFT, BOTTOM, ROW = 0.26, 0.58, 0.42, 0.17
#: Height of the axes, where it follows from the motion, as a fraction of their width.
LOWEST, HIGHEST = 0.25, 0.85
SHADOW, GRID, DARK, PALE = "0.86", "0.90", "0.25", "0.4"
DASHED = (0, (2.2, 1.2))
#: Points squared: areas of the markers of mass centres, points and points of the ground.
MARKER, DOT, ANCHOR = 34.0, 9.0, 26.0
#: Where bodies are too many for names, lines and markers are this much smaller.
SMALLER = 0.6


class Stage:
    """A figure with everything that does not move, and the moving parts, ready to be placed.

    Args:
        sticks: the stick figure.
        camera: the camera.
        limits: (3, 2) of the room, whose floor is drawn, m.
        shown: (2, 2) visible rectangle, in the axes of the picture, m.
        size: width and height, pixels; a height of 0 becomes one that suits the motion.
        title: text in the upper left corner.
        about: body, from 0, from whose mass centre the visible rectangle is measured, or None.
    """

    def __init__(
        self,
        sticks: Sticks,
        camera: projection.Camera,
        limits: Floats,
        shown: Floats,
        size: tuple[int, int],
        title: str,
        about: int | None = None,
    ) -> None:
        self.sticks, self.camera, self.limits = sticks, camera, limits
        self._about = about
        self._few = len(sticks.names) <= MOST_NAMES
        shaped = sticks.shapes.hues if sticks.shapes is not None else {}
        self._bare = np.array([k not in shaped for k in range(1, len(sticks.names) + 1)], bool)
        dpi = size[0] / WIDTH
        self.figure = Figure(figsize=(WIDTH, WIDTH), dpi=dpi)
        self.canvas: Any = FigureCanvasAgg(self.figure)
        self._still: Any = None
        self._has_marker_size = not self._few
        self.ax = self._axes(shown, size[1] / dpi)
        self._colors = np.array(sticks.colors, dtype=object)
        if not camera.plane:
            self._draw_floor()
        self._moving: list[Any] = []
        self._shadows = None if camera.plane else self._lines(SHADOW, 1.6, zorder=1)
        self._links = self._lines(DARK, 1.2, zorder=2)
        self._springs = self._lines(DARK, 1.2, zorder=2, linestyle=DASHED)
        self._solids = self._add(PolyCollection([], zorder=2.2, linewidths=0.6))
        self.ax.add_collection(self._solids, autolim=False)
        self._sticks = self._lines("black", 2.0, zorder=3, capstyle="round")
        self._dots = self._markers("o", DOT, zorder=4)
        markers = dict.fromkeys(sticks.markers) if self._few else ()
        self._centres = {m: self._markers(m, MARKER, zorder=5) for m in markers}
        top = 1.0 - 0.06 / self.figure.get_figheight()
        self._time = self._add(self._text(0.985, top, "", "right", "top"))
        if title:
            self._text(0.02, top, shown_text(title), "left", "top")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture, pixels."""
        width, height = self.canvas.get_width_height()
        return int(width), int(height)

    def place(self, r: Floats, p: Floats, clock: str) -> None:
        """Put the moving parts at poses r (n, 3), p (n, 4), and set the text of the time."""
        sticks = self.sticks
        points = sticks.positions(r, p)
        flat, depth = self.camera.project(points), self.camera.depth(points)
        lines = sticks.lines
        order = np.argsort(depth[lines].mean(axis=1), kind="stable")
        self._sticks.set_segments(list(flat[lines[order]]))
        self._sticks.set_color(self._colors[sticks.body[lines[order, 0]] - 1])
        if sticks.shapes is not None:
            corners, colors = sticks.shapes.seen(r, p, self.camera)
            self._solids.set_verts(list(corners))
            self._solids.set_facecolor(colors)
            self._solids.set_edgecolor(colors)  # no seams between neighbours
        self._links.set_segments(list(flat[sticks.links]))
        self._springs.set_segments(list(flat[sticks.springs]))
        self._dots.set_offsets(flat[sticks.points])
        self._dots.set_facecolor(list(self._colors[sticks.body[sticks.points] - 1]))
        for marker, centres in self._centres.items():
            which = np.flatnonzero((np.array(sticks.markers) == marker) & self._bare)
            centres.set_offsets(flat[which])
            centres.set_edgecolor(list(self._colors[which]))
        self._fit_markers(flat[: len(sticks.names)][self._bare])
        if self._shadows is not None:
            on_floor = points.copy()
            on_floor[:, 2] = self.limits[2, 0]
            every = np.concatenate([lines, sticks.links, sticks.springs])
            self._shadows.set_segments(list(self.camera.project(on_floor)[every]))
        self._time.set_text(clock)
        if self._about is not None:
            (x, y), (x0, x1), (y0, y1) = self.camera.project(r[self._about]), *self._window
            self.ax.set(xlim=(x0 + x, x1 + x), ylim=(y0 + y, y1 + y))
            self._still = None  # what does not move does so in the picture

    def _fit_markers(self, centres: Floats) -> None:
        """Shrink markers to the usual distance of mass centres in the first picture."""
        if self._has_marker_size or len(centres) < 2:
            return
        self._has_marker_size = True
        apart = np.linalg.norm(centres[:, None] - centres, axis=2)
        np.fill_diagonal(apart, np.inf)
        box, (x0, x1) = self.ax.get_position(), self.ax.get_xlim()
        points = 72.0 * WIDTH * box.width / (x1 - x0)  # in one metre
        room = float(np.median(apart.min(axis=0))) * points
        for markers in (*self._centres.values(), self._dots):
            area = markers.get_sizes()
            markers.set_sizes(area * np.clip(room**2 / (3.0 * MARKER), SMALLER**4, 1.0))

    def pixels(self) -> Any:
        """The present picture, (height, width, 4) bytes; valid until the next call."""
        if self._still is None:
            for part in self._moving:
                part.set_animated(True)
            self.canvas.draw()
            self._still = self.canvas.copy_from_bbox(self.figure.bbox)
        self.canvas.restore_region(self._still)
        for part in self._moving:
            self.figure.draw_artist(part) if part.axes is None else part.axes.draw_artist(part)
        return np.asarray(self.canvas.buffer_rgba())

    def _axes(self, shown: Floats, height: float) -> Axes:
        """Axes of one scale that fill the figure, with the legend below; sets the height."""
        plane = self.camera.plane
        below = 0.08 + self._draw_legend() * ROW + (BOTTOM if plane else 0.0)
        left = LEFT if plane else 0.08
        wide, (across, along) = WIDTH - left - 0.1, shown[:, 1] - shown[:, 0]
        if not height:
            fitting = wide * min(max(along / across, LOWEST), HIGHEST) if across else wide * LOWEST
            height = round((fitting + TOP + below) * self.figure.dpi / 2) * 2 / self.figure.dpi
        self.figure.set_figheight(height)
        high = max(0.3, height - TOP - below)
        ax = self.figure.add_axes((left / WIDTH, below / height, wide / WIDTH, high / height))
        self._window = (x0, x1), (y0, y1) = projection.fill_limits(shown, wide, high)
        ax.set_xlim(x0, x1)
        ax.set_ylim(y0, y1)
        if plane:
            right, up = projection.PLANES[plane]
            ax.set_xlabel(f"{projection.AXES[right]} [m]", fontsize=LETTERS, labelpad=1.0)
            ax.set_ylabel(f"{projection.AXES[up]} [m]", fontsize=LETTERS, labelpad=1.0)
            ax.tick_params(labelsize=LETTERS, length=2.5, pad=2.0)
            ax.grid(True, color=GRID, linewidth=0.6)
            ax.set_axisbelow(True)
            ax.spines[["top", "right"]].set_visible(False)
        else:
            ax.set_axis_off()
        anchors = self.sticks.local[self.sticks.anchors]
        if len(anchors):
            at = self.camera.project(anchors)
            ax.scatter(at[:, 0], at[:, 1], s=self._area(ANCHOR), marker="s", c=DARK,
                       zorder=2.5, linewidths=0)  # fmt: skip
        return ax

    def _draw_floor(self) -> None:
        """The grid on the floor, the text of its spacing, and the directions of the axes."""
        # some four to ten lines
        size = float(np.max(self.limits[:2, 1] - self.limits[:2, 0]))
        if self._about is not None:
            size = self._window[0][1] - self._window[0][0]
        spacing = projection.round_number(size / 6.0)
        lines = self.camera.project(projection.floor_grid(self.limits, spacing))
        self.ax.add_collection(
            LineCollection(list(lines), colors=GRID, linewidths=0.7, zorder=0), autolim=False
        )
        bottom, height = self.ax.get_position().y0, self.figure.get_figheight()
        self._text(0.985, bottom, f"grid {spacing:g} m", "right", "bottom", color=PALE)
        length, corner = 0.24, np.array([0.3, 0.2 + bottom * height])  # inches
        scale = np.array([WIDTH, height])
        for k, name in enumerate(projection.AXES):
            tip = length * self.camera.project(np.eye(3)[k])
            if np.linalg.norm(tip) < 0.2 * length:
                continue
            xs, ys = np.stack([corner, corner + tip] / scale, axis=1)
            self.figure.add_artist(Line2D(xs, ys, color=PALE, linewidth=1.0))
            x, y = (corner + tip * (1.0 + 0.08 / np.linalg.norm(tip))) / scale
            self._text(x, y, name, "center", "center", color=PALE)

    def _draw_legend(self) -> int:
        """Bodies by colour and marker, ground, springs, at the foot; returns the number of rows."""
        sticks = self.sticks
        if not self._few:
            return 0
        handles: list[Any] = []
        for color, marker, bare in zip(sticks.colors, sticks.markers, self._bare, strict=True):
            line = Line2D([], [], color=color, linewidth=2.0 if bare else 6.0,
                          solid_capstyle="butt")  # fmt: skip
            centre = Line2D([], [], color=color, marker=marker, markersize=5.0, linewidth=0,
                            markerfacecolor="white", markeredgewidth=1.3)  # fmt: skip
            handles.append((line, centre) if bare else line)
        labels = [shown_text(name) for name in sticks.names]
        if len(sticks.anchors):
            handles.append(Line2D([], [], color=DARK, marker="s", markersize=4.5, linewidth=0))
            labels.append("ground")
        if len(sticks.springs):
            handles.append(Line2D([], [], color=DARK, linewidth=1.2, linestyle=DASHED))
            labels.append("spring")
        if not handles:
            return 0
        columns = columns_of(labels, WIDTH)
        self.figure.legend(
            handles, labels, loc="lower center", ncols=columns, fontsize=LETTERS, frameon=False,
            handlelength=1.6, columnspacing=1.0, borderaxespad=0.1, handletextpad=0.5,
            labelspacing=0.25, handler_map={tuple: HandlerTuple(ndivide=1)},
        )  # fmt: skip
        return -(-len(handles) // columns)

    def _text(self, x: float, y: float, text: str, ha: str, va: str, **style: Any) -> Any:
        """Text at fractions of the figure."""
        return self.figure.text(x, y, text, ha=ha, va=va, fontsize=LETTERS, **style)

    def _add(self, part: Any) -> Any:
        self._moving.append(part)
        return part

    def _area(self, area: float) -> float:
        return area if self._few else area * SMALLER**4

    def _lines(self, color: str, width: float, **style: Any) -> LineCollection:
        scale = 1.0 if self._few else SMALLER
        lines: LineCollection = self._add(
            LineCollection([], colors=color, linewidths=width * scale, **style)
        )
        self.ax.add_collection(lines, autolim=False)
        return lines

    def _markers(self, marker: str, area: float, zorder: float) -> PathCollection:
        markers: PathCollection = self._add(
            self.ax.scatter([], [], s=self._area(area), marker=marker, zorder=zorder,
                            linewidths=0.0 if area == DOT else 1.3)
        )  # fmt: skip
        markers.set_facecolor("white")
        return markers
