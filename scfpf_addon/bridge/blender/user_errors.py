# SPDX-License-Identifier: GPL-3.0-or-later
"""The errors that a user can mend, and the messages about them. All other errors are bugs."""

from __future__ import annotations

import traceback
from collections.abc import Callable

from bpy.app.translations import pgettext_rpt

from ...projection.user_error import Message, UserError

NO_MEMORY = Message(
    "There is not enough memory for this picture: lower the resolution, or close other programs"
)

# What to report in one line. Bugs propagate.
USER_ERRORS = (UserError, MemoryError)


def reason(error: BaseException) -> str:
    """The message of one of USER_ERRORS: Python may raise a MemoryError without a text."""
    return str(error) or NO_MEMORY


def translated_report(message: str | BaseException, translate: Callable[[str], str] = pgettext_rpt) -> str:
    """A message or an error in the language of the interface, with the messages and errors in it."""
    if isinstance(message, BaseException):
        message = message.message if isinstance(message, UserError) else reason(message)
    if not isinstance(message, Message):
        return translate(message)
    values = [
        translated_report(each, translate) if isinstance(each, (Message, BaseException)) else each
        for each in message.values
    ]
    return translate(message.template).format(*values) if values else translate(message.template)


def failure_message(error: Exception) -> str:
    """The message of any error; of a bug it names the error, and the traceback goes to the console."""
    if isinstance(error, USER_ERRORS):
        return translated_report(error)
    traceback.print_exception(error)
    return translated_report(
        Message(
            "Flexible Projection failed: look at the system console for the place ({0}: {1})",
            type(error).__name__,
            str(error),
        )
    )
