"""A Stewart platform whose six legs are driven: no freedom is left, all joints carry."""

import numpy as np

import dap3d_core as dap

#: Length of half a leg at the start is about 0.55 m; the drivers change it by this much, m.
STROKE = 0.05


def _turned(z):
    """Euler parameters that turn the x axis onto the unit vector z."""
    p = np.array([1.0 + z[0], 0.0, -z[2], z[1]])
    return p / np.linalg.norm(p)


def _axis(p, k):
    """The k-th axis of a body with Euler parameters p."""
    e0, e = p[0], p[1:]
    axis = np.eye(3)[k]
    return axis + 2.0 * np.cross(e, e0 * axis + np.cross(e, axis))


def stewart(platform, leg, push, *, spins=True):
    """Platform of ``platform`` kg on legs of two bodies of ``leg`` kg each, under ``push`` N.
    Legs that do not spin about their own axes stand on universal joints, with the cross along y of
    the leg and a ground vector ``cross0``, ... of its z at the start."""
    scene = dap.Scene(name="stewart")
    J = 0.1 * platform
    scene.add_body("top", mass=platform, Jp=[J, J, 2.0 * J], r=[0.0, 0.0, 1.0])
    for k in range(6):
        a = np.pi * k / 3.0
        b = a + (0.35 if k % 2 else -0.35)
        foot, head = (
            np.array([np.cos(a), np.sin(a), 0.0]),
            0.5 * np.array([np.cos(b), np.sin(b), 2]),
        )
        along = head - foot
        length = float(np.linalg.norm(along))
        p, J = _turned(along / length), leg * length**2 / 48.0
        for part, way in (("low", 0.25), ("up", 0.75)):
            scene.add_body(f"{part}{k}", mass=leg, Jp=[0.01 * leg, J, J], r=foot + way * along, p=p)
        scene.add_point(f"foot{k}", body="ground", sPp=foot)
        scene.add_point(f"head{k}", body="top", sPp=head - [0.0, 0.0, 1.0])
        scene.add_point(f"low_end{k}", body=f"low{k}", sPp=[-0.25 * length, 0.0, 0.0])
        scene.add_point(f"up_end{k}", body=f"up{k}", sPp=[0.25 * length, 0.0, 0.0])
        scene.add_function("harmonic", f"stroke{k}", amplitude=-STROKE, frequency=3.0 + k,
                           offset=-0.5 * length)  # fmt: skip
        slide = {"P_i": f"up{k}.O", "P_j": f"low{k}.O", "a_j": f"low{k}.x"}
        if spins:
            scene.add_joint("sph", f"S{k}", P_i=f"low_end{k}", P_j=f"foot{k}")
        else:
            scene.add_vector(f"cross{k}", body="ground", sp=_axis(p, 2))
            scene.add_joint("univ", f"S{k}", P_i=f"low_end{k}", P_j=f"foot{k}", a_i=f"low{k}.y",
                            n_j=f"cross{k}")  # fmt: skip
        scene.add_joint("tran", f"T{k}", **slide)
        scene.add_joint("sph", f"W{k}", P_i=f"up_end{k}", P_j=f"head{k}")
        scene.add_joint("drive-tran", f"D{k}", **slide, function=f"stroke{k}")
    scene.add_force("weight", "weight")
    scene.add_force("f", "push", body_i="top", f=[push, 0.3 * push, -push])
    return scene
