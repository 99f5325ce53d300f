"""Arrays without an owner, for the inside of a compiled call.

Compiled code counts references to each array it touches, atomically, in every function that calls a
first-class function: 100 ns for a tuple of 24 arrays, more than a small scene's physics. The
outermost compiled function keeps the arrays alive; what it calls may as well borrow them.
Measurements: docs/decisions/0001.
"""

from numba.core import cgutils
from numba.extending import intrinsic, overload


@intrinsic
def _without_owners(_typing, arrays):
    def codegen(context, builder, signature, args):
        result = args[0]
        for k, type_ in enumerate(signature.args[0]):
            array = context.make_array(type_)(context, builder, builder.extract_value(args[0], k))
            array.meminfo = cgutils.get_null_value(array.meminfo.type)
            array.parent = cgutils.get_null_value(array.parent.type)
            result = builder.insert_value(result, array._getvalue(), k)
        return result

    return arrays(arrays), codegen


def borrow(arrays):
    """The same tuple of arrays without their owners; valid while the caller holds the tuple."""
    return arrays


@overload(borrow)
def _compiled_borrow(arrays):
    return lambda arrays: _without_owners(arrays)
