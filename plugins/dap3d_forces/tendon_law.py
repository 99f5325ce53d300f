"""Tension of a tendon: spring, damper and stops of its length, a control, a muscle."""

from dap3d_core.interface import Force, choice, number
from dap3d_core.kernels import maximum, where
from dap3d_forces.bounds import UNLIMITED, bounds, within


class TendonLaw(Force):
    """Fields of the laws of tendons."""

    length: float = number(None, unit="m", doc="above it the spring pulls; as at the start")
    play: float = number(0.0, unit="m", minimum=0.0, doc="by which it is shorter as it pushes")
    k: float = number(0.0, unit="N/m", minimum=0.0, doc="stiffness of the spring")
    c: float = number(0.0, unit="N s/m", minimum=0.0, doc="damping coefficient")
    slack: bool = choice((False, True), False, doc="spring and damper do not push")
    control: float = number(None, by_name=("function", "input"), doc="u")
    gain: float = number(1.0, unit="N", doc="tension for a control of 1")
    bias: float = number(0.0, unit="N", doc="tension with a control of 0")
    control_min: float = number(None, doc="least control, if any")
    control_max: float = number(None, doc="greatest control, if any")
    tension_min: float = number(None, unit="N", doc="least tension, if any")
    tension_max: float = number(None, unit="N", doc="greatest tension, if any")
    activation: str = choice(("none", "lag", "integral", "muscle"), "none", doc="how u acts")
    activation_min: float = number(None, doc="least activation, if any")
    activation_max: float = number(None, doc="greatest activation, if any")
    time: float = number(1.0, unit="s", positive=True, doc="time constant of the activation")
    z_0: float = number(0.0, doc="initial activation")
    peak: float = number(0.0, unit="N", doc="of a muscle: greatest active force")
    optimum: float = number(1.0, unit="m", doc="of a muscle: length of fibres at that force")
    sinew: float = number(0.0, unit="m", doc="of a muscle: length without that of its fibres")
    l_min: float = number(
        0.5, maximum=1.0, doc="of a muscle: length of fibres, over optimum, without force"
    )
    l_max: float = number(1.6, minimum=1.0, doc="of a muscle: that on the other side")
    v_max: float = number(1.5, unit="1/s", positive=True, doc="of a muscle: speed without force")
    fp_max: float = number(1.3, doc="of a muscle: passive force at l_max, over 1.5 peak")
    fv_max: float = number(
        1.2, minimum=1.0, doc="of a muscle: force as it lengthens fast, over the peak"
    )
    time_up: float = number(0.01, unit="s", positive=True, doc="of a muscle: of activation")
    time_down: float = number(0.04, unit="s", positive=True, doc="of a muscle: of deactivation")
    smoothing: float = number(0.0, minimum=0.0, doc="of a muscle: width between both times")


def numbers_of(element, start):
    """The numbers of the kernels: of the spring, of the control, of the muscle.

    Raises:
        ValueError: bounds that hold for none.
    """
    high = start if element.length is None else element.length
    low = -UNLIMITED if element.slack else high - element.play
    if element.activation == "muscle" and not element.l_min < 1.0 < element.l_max:
        raise ValueError("l_min should lie below 1, and l_max above it")
    if element.activation == "muscle" and not (element.optimum and element.fv_max > 1.0):
        raise ValueError("optimum should not be 0, and fv_max should lie above 1")
    return bounds(element, "control", "tension", "activation") | {
        "length": high,
        "spring": (high, low, element.k, element.c, 0.0 if element.slack else 1.0),
        "muscle": tuple(getattr(element, name) for name in MUSCLE),
    }  # fmt: skip


#: Fields of a muscle, in the order in which its functions take them.
MUSCLE = ("peak", "optimum", "sinew", "l_min", "l_max", "v_max", "fp_max", "fv_max", "time_up",
          "time_down", "smoothing")  # fmt: skip


def passive(L, L_dot, spring):
    """Tension of spring and damper, N."""
    high, low, k, c, pushes = spring
    T = k * (maximum(L - high, 0.0) - maximum(low - L, 0.0)) + c * L_dot
    return where(pushes > 0.0, T, where(high > L, 0.0, maximum(T, 0.0)))


def stored(L, spring):
    """Potential of the spring, J."""
    high, low, k, _, _ = spring
    x, y = maximum(L - high, 0.0), maximum(low - L, 0.0)
    return 0.5 * k * (x * x + y * y)


def contracted(L, L_dot, z, muscle):
    """Tension of a muscle by curves of length and speed that are parabolas, N."""
    peak, optimum, sinew, l_min, l_max, v_max, fp_max, fv_max, *_ = muscle
    l, v = (L - sinew) / optimum, L_dot / (optimum * v_max)
    long = l > 1.0
    end = where(long, l_max, l_min)
    x = (l - 1.0) / (end - 1.0)  # 0 at the optimum, 1 where the force ends
    active = where(x < 0.5, 1.0 - 2.0 * x * x, where(x < 1.0, 2.0 * (1.0 - x) * (1.0 - x), 0.0))
    more = fv_max - 1.0
    out = where(v < more, fv_max - (more - v) * (more - v) / more, fv_max)
    speed = where(v > 0.0, out, where(v > -1.0, (1.0 + v) * (1.0 + v), 0.0))
    b = 2.0 * x
    stretched = where(long, where(b < 1.0, 0.5 * b * b, b - 0.5), 0.0)
    return peak * (active * speed * z + fp_max * stretched)


def activated(u, z, muscle):
    """The rate of the activation of a muscle (Millard et al., J. Biomech. Eng. 135 (2013))."""
    *_, time_up, time_down, smoothing = muscle
    slower = 0.5 + 1.5 * within(z, 0.0, 1.0)
    up, down = time_up * slower, time_down / slower
    wanted = within(u, 0.0, 1.0) - z
    smooth = smoothing > 1e-15
    s = within(wanted / where(smooth, smoothing, 1.0) + 0.5, 0.0, 1.0)
    part = where(smooth, s * s * s * (10.0 + s * (6.0 * s - 15.0)), where(wanted > 0.0, 1.0, 0.0))
    return wanted / (down + (up - down) * part)
