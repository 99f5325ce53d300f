"""Types of the arrays that all layers hand to each other."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
#: Of a parameter of a compiled function that writes into it: no other argument shares its memory,
#: so that loops run over several numbers at once without a test.
SeparateFloats = Floats
