"""One input again: a find is seen as it was."""

import faulthandler

from fuzz.guided import GUIDED
from fuzz.targets import TARGETS


def repeat(name, data):
    """Check one input of a target; what is wrong with it comes out as it is."""
    faulthandler.enable()
    check = GUIDED[name].check if name in GUIDED else TARGETS[name].check
    print(check(data))
    return 0
