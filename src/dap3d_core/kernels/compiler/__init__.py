"""The compiler: typed Python functions and traced kernels to machine code, by llvmlite alone.

    types        what values there are, and the machine words that each is made of
    writing      instructions, blocks, places in memory
    functions    the typed subset of Python: functions and their statements
    expressions  its values, arrays and calls
    operations   its operations, comparisons and choices
    words        the functions of other libraries that it knows
    trace        kernels, run once with symbolic numbers
    objects      from LLVM IR to object code, stored in files, loaded
    background   the process that optimises while unoptimised code runs
    units        object files with some functions, and calls from Python into them

docs/concepts/compiled-python.md describes the subset.
"""
