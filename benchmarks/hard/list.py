"""The hard cases, one record each."""

from hard.bodies import BODIES
from hard.extremes import EXTREMES
from hard.linkages import LINKAGES
from hard.scales import SCALES

CASES = (*LINKAGES, *BODIES, *SCALES, *EXTREMES)
