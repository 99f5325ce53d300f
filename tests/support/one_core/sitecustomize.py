"""Child processes of tests see one core: none leaves a process behind that optimises its code,
which takes longer than all that the child does (``kernels.compiler.background``)."""

import os

os.sched_getaffinity = lambda pid: {0}
