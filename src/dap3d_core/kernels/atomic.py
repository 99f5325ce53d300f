"""Integers in memory that two threads read and write at once, and how compiled code waits.

Each is a word of an int64 array. In plain Python, where no second thread works, they are what they
look like.
"""

import os
import platform
from typing import Any

from llvmlite import ir
from numba import int64, types
from numba.core import cgutils
from numba.extending import intrinsic, overload

from dap3d_core.kernels.by_address import VECTOR

#: Words between two that different threads write: two lines of the cache, which comes in pairs.
APART = 16

#: LLVM's word for "a loop waits for another processor", and its argument where it takes one.
_PAUSE = {
    **dict.fromkeys(("x86_64", "amd64"), ("llvm.x86.sse2.pause", ())),
    **dict.fromkeys(("aarch64", "arm64"), ("llvm.aarch64.hint", (1,))),
}


def _word(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    array = context.make_array(signature.args[0])(context, builder, args[0])
    return cgutils.gep(builder, array.data, args[1])


@intrinsic
def _load(_typing: Any, array: Any, k: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load_atomic(_word(context, builder, signature, args), "acquire", 8)

    return int64(array, int64), codegen


@intrinsic
def _store(_typing: Any, array: Any, k: Any, value: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.store_atomic(args[2], _word(context, builder, signature, args), "release", 8)
        return context.get_dummy_value()

    return types.void(array, int64, int64), codegen


@intrinsic
def _replace(_typing: Any, array: Any, k: Any, old: Any, new: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        word = _word(context, builder, signature, args)
        found = builder.cmpxchg(word, args[2], args[3], "acq_rel", "acquire")
        return builder.extract_value(found, 1)

    return types.boolean(array, int64, int64, int64), codegen


@intrinsic
def _pause(_typing: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        name, arguments = _PAUSE.get(platform.machine().lower(), ("", ()))
        if name:
            integer = ir.IntType(32)
            type_ = ir.FunctionType(ir.VoidType(), [integer] * len(arguments))
            function = cgutils.get_or_insert_function(builder.module, type_, name)
            builder.call(function, [ir.Constant(integer, n) for n in arguments])
        return context.get_dummy_value()

    return types.void(), codegen


@intrinsic
def _address(_typing: Any, array: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, args[0]).data
        return builder.ptrtoint(data, ir.IntType(64))

    return int64(array), codegen


@intrinsic
def _vector(_typing: Any, address: Any, size: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = context.make_array(VECTOR)(context, builder)
        item = ir.Constant(ir.IntType(64), 8)
        array.data = builder.inttoptr(args[0], array.data.type)
        array.nitems, array.itemsize = args[1], item
        array.shape = cgutils.pack_array(builder, [args[1]])
        array.strides = cgutils.pack_array(builder, [item])
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        array.parent = cgutils.get_null_value(array.parent.type)
        return array._getvalue()

    return VECTOR(int64, int64), codegen


_sched_yield = types.ExternalFunction("sched_yield", types.int32())


def load(array: Any, k: int) -> int:
    """The word as it is; what its writer did before is seen after it."""
    return int(array[k])


def store(array: Any, k: int, value: int) -> None:
    """Write a word, after all that was written before."""
    array[k] = value


def replace(array: Any, k: int, old: int, new: int) -> bool:
    """Write ``new`` where ``old`` stands, in one go; False where something else stood there."""
    if array[k] != old:
        return False
    array[k] = new
    return True


def pause() -> None:
    """A moment's wait in a loop that looks at a word."""


def give_way() -> None:
    """Let another thread have this core, if one wants it."""
    os.sched_yield()


def address_of(array: Any) -> int:
    """Where the first number of an array stands."""
    return int(array.ctypes.data)


def vector_at(address: int, size: int) -> Any:
    """The numbers at an address, as an array whose owner is somewhere else; compiled code only."""
    raise NotImplementedError("in plain Python arrays are handed on themselves")


@overload(load)
def _compiled_load(array, k):  # type: ignore[no-untyped-def]
    return lambda array, k: _load(array, k)


@overload(store)
def _compiled_store(array, k, value):  # type: ignore[no-untyped-def]
    return lambda array, k, value: _store(array, k, value)


@overload(replace)
def _compiled_replace(array, k, old, new):  # type: ignore[no-untyped-def]
    return lambda array, k, old, new: _replace(array, k, old, new)


@overload(pause)
def _compiled_pause():  # type: ignore[no-untyped-def]
    return lambda: _pause()


@overload(give_way)
def _compiled_give_way():  # type: ignore[no-untyped-def]
    def yields() -> None:
        _sched_yield()

    return yields


@overload(address_of)
def _compiled_address(array):  # type: ignore[no-untyped-def]
    return lambda array: _address(array)


@overload(vector_at)
def _compiled_vector(address, size):  # type: ignore[no-untyped-def]
    return lambda address, size: _vector(address, size)
