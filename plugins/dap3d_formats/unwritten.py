"""What acts in a joint and has no place in a file that is written."""

from math import isfinite

from dap3d_core.interface.formats import NOWHERE, Joint, Remarks

#: What acts on coordinates of a joint -> its name in a remark.
WORDS = {
    "damping": "damping", "stiffness": "spring", "friction": "friction", "armature": "armature",
    "limits": "stops",
}  # fmt: skip


def leave_out_forces(joint: Joint, remarks: Remarks, keys: tuple[str, ...] = tuple(WORDS)) -> None:
    """Remark what of a joint is left out, of some of its attributes."""
    for key in keys:
        values = getattr(joint, key)
        if key == "limits":
            values = [isfinite(one.lower) or isfinite(one.upper) for one in values]
        if any(values):
            remarks.leave_out(NOWHERE, f"{WORDS[key]} of joint {joint.name}", motion=True)
