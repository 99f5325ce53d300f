"""Lets the tests of this folder import the reference simulators, which are plain scripts."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
