"""The compiler: typed Python functions and traced kernels to machine code, by llvmlite.

    types        types, and the machine words that represent their values
    writer       instructions: casts, arithmetic, comparisons, blocks, stack slots
    intrinsics   known functions of Python, numpy and the C library
    expressions  the typed subset of Python: names, operations, arrays, calls
    functions    the typed subset of Python: functions, variables, statements
    trace        kernels, run once with symbolic numbers
    objects      from LLVM IR to object code, stored in files, loaded
    ready        object code that comes with the package
    background   the process that optimises while unoptimised code runs
    units        object files with some functions, and calls from Python into them

docs/concepts/compiled-python.md describes the subset.
"""
