"""Hard cases: scenes that break programs, each with a reference that does not come from dap3d."""

from hard.case import Case, Try, run_case
from hard.list import CASES

__all__ = ["CASES", "Case", "Try", "measure", "run_case", "write_page"]


def measure():
    """Rows of all cases."""
    return [row for case in CASES for row in run_case(case)]


def write_page(rows):
    """Renew docs/reference/hard-cases.md from rows of ``measure`` or of ``long_time.measure``."""
    from hard.page import write

    write(rows)
