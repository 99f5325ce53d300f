"""The compiler: typed Python functions and traced kernels to machine code, by llvmlite alone.

    types        what values there are, and the machine words that each is made of
    writing      instructions, blocks, places in memory
    functions    the typed subset of Python: functions and their statements
    expressions  its values, arrays and calls
    operations   its operations, comparisons and choices
    words        the functions of other libraries that it knows
    trace        kernels, run once with symbolic numbers
    objects      from LLVM IR to object code, kept in files, loaded
    units        object code that is made quickly first and well later; calls into it
    beside       the process that makes it well

docs/concepts/compiled-python.md says what the subset is.
"""
