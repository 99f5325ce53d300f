"""Numbers and bodies that are valid one by one."""

from bad_input.case import PENDULUM, ROD, Case, changed, pushed

MASS, JP, W = "mass = 1.0", "Jp = [0.1, 0.1, 0.05]", "r = [0.5, 0.0, 0.0]"


def rod(old, new):
    return changed(ROD, (old, new))


HUGE = changed(
    PENDULUM, (MASS, "mass = 1e99"), ('type = "weight"', 'type = "weight"\ngravity = 1e9')
)
LIGHT = 'type = "f"\nbody_i = "rod"\nf = [1e90, 0, 0]'

CASES = [
    Case("degrees given as radians",
         pushed('type = "rot_sda"\nv_i = "rod.x"\nv_j = "ground.x"\naxis = "ground.y"\n'
                "k = 1.0\ntheta_0 = 90"), "noted",
         ("forces.F.theta_0 = 90", "more than a full turn", "rad")),
    Case("product overflows", HUGE, "failed",
         ("force g (type weight)", "beyond 1e+100", "t = 0 s")),
    Case("product overflows", pushed(LIGHT, (MASS, "mass = 1e-90"), base=ROD), "failed",
         ("acceleration of body rod", "beyond 1e+100", "t = 0 s")),
    Case("product overflows", rod(W, "w = [1e80, 1e80, 1e79]"), "failed",
         ("acceleration of body rod", "beyond 1e+100")),
    Case("product overflows", rod(W, "w = [1e99, 0, 0]"), "failed", ("body rod runs away",)),
    Case("inertia breaks the triangle rule", rod(JP, "Jp = [0.1, 0.2, 0.30000000001]"), "allowed"),
    Case("inertia nearly zero on one axis", rod(JP, "Jp = [0.1, 0.1, 1e-7]"), "allowed"),
]  # fmt: skip
