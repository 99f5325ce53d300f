"""The compiler: typed Python functions and traced kernels to machine code, by llvmlite.

    types        types, and the machine words that represent their values
    writing      syntax trees, instructions, blocks, stack slots, casts
    functions    the typed subset of Python: functions and statements
    expressions  names, arrays, calls
    operations   arithmetic, comparisons, conditional expressions
    words        known functions of Python, numpy and the C library
    trace        kernels, run once with symbolic numbers
    objects      from LLVM IR to object code, stored in files, loaded
    ready        object code that comes with the package
    background   the process that optimises while unoptimised code runs
    units        object files with some functions, and calls from Python into them

docs/concepts/compiled-python.md describes the subset.
"""
