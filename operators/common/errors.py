# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators report errors that a user can mend, and bugs after which everything is as before."""

import traceback

from .words import report_text, translated_report


def refused(operator, error) -> set[str]:
    """Report one of USER_ERRORS, and return what a cancelled operator returns."""
    operator.report({"ERROR"}, translated_report(error))
    return {"CANCELLED"}


def failed(operator, error: Exception) -> set[str]:
    """Report a bug after which everything is as before; return what a cancelled operator returns.

    The system console gets the traceback. Call it while the error is handled.
    """
    traceback.print_exc()
    operator.report(
        {"ERROR"},
        report_text(
            "{0} met a fault of the add-on, and everything is as before: report it with the text in the "
            "system console ({1})",
            operator.bl_label,
            f"{type(error).__name__}: {error}",
        ),
    )
    return {"CANCELLED"}
