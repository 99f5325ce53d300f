"""Tests for authors of types: formulas against derivatives, balances and each other.

    from dap3d_core.testing import checks_for

    @pytest.mark.parametrize("check", checks_for(Screw), ids=str)
    def test_screw(check):
        check()

``check_type`` runs all checks and returns a report; ``dap3d check-plugin`` shows it
(docs/how-to/check-plugin.md).
"""

from dap3d_core.testing.checks.findings import CheckOutcome, Finding, Report
from dap3d_core.testing.kit import Check, check_type, checks_for

__all__ = ["Check", "Finding", "CheckOutcome", "Report", "check_type", "checks_for"]
