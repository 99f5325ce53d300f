"""The motion arrays of the post-processor: what follows from stored states and accelerations."""

from functools import cached_property

import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.model.rotations import read_only, to_body
from dap3d_core.model.state_layout import split
from dap3d_core.result.arrays import Arrays
from dap3d_core.result.file.lazy_arrays import FileArrays
from dap3d_core.result.model_summary import Subject
from dap3d_core.result.post.point_motion import accelerations, point_motion


class Kinematics:
    """Motion of n bodies and nP points at nt instants (spec 10), each array when first asked for.

    Attributes:
        subject: names and constants of bodies, joints and points.
        arrays: what is stored.
    """

    subject: Subject
    arrays: Arrays | FileArrays

    @property
    def t(self) -> Floats:
        """(nt,) reported instants, s. T of the manual."""
        return self.arrays.t

    @property
    def u(self) -> Floats:
        """(nt, 13 n) states: r, p, then r_dot, omega of each body; uT of the manual."""
        return self.arrays.u

    @property
    def v_dot(self) -> Floats:
        """(nt, 6 n) accelerations: r_ddot (m/s^2), omega_dot (rad/s^2) of each body."""
        return self.arrays.v_dot

    @property
    def r(self) -> Floats:
        """(nt, n, 3) positions of the mass centres, m."""
        return split(self.u)[0]

    @property
    def p(self) -> Floats:
        """(nt, n, 4) Euler parameters."""
        return split(self.u)[1]

    @property
    def rd(self) -> Floats:
        """(nt, n, 3) velocities, m/s."""
        return split(self.u)[2]

    @property
    def w(self) -> Floats:
        """(nt, n, 3) angular velocities, rad/s, global axes."""
        return split(self.u)[3]

    @cached_property
    def wp(self) -> Floats:
        """(nt, n, 3) angular velocities, rad/s, body axes: A^T omega."""
        return read_only(to_body(self.p, self.w))

    @property
    def rdd(self) -> Floats:
        """(nt, n, 3) accelerations, m/s^2."""
        return accelerations(self.v_dot)[0]

    @property
    def wd(self) -> Floats:
        """(nt, n, 3) angular accelerations, rad/s^2, global axes."""
        return accelerations(self.v_dot)[1]

    @cached_property
    def wpd(self) -> Floats:
        """(nt, n, 3) angular accelerations, rad/s^2, body axes: A^T omega_dot (spec 1)."""
        return read_only(to_body(self.p, self.wd))

    @cached_property
    def rP(self) -> Floats:
        """(nt, nP, 3) positions of the points, m; animation points come last."""
        return self._points(0)

    @cached_property
    def rPd(self) -> Floats:
        """(nt, nP, 3) velocities of the points, m/s."""
        return self._points(1)

    @cached_property
    def rPdd(self) -> Floats:
        """(nt, nP, 3) accelerations of the points, m/s^2."""
        return self._points(2)

    def _points(self, level: int) -> Floats:
        every = np.arange(len(self.subject.point_names))
        return read_only(point_motion(self.subject, self.u, self.v_dot, every, level))
