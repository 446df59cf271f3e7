# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages and errors that can be translated after they were made."""

from __future__ import annotations


class Message(str):
    """An English message that keeps its template and the values for its places {0}, {1}, …

    Whoever shows it puts the values into the translated template. Without values the template is the message
    itself, and its braces are text. Values that are messages or errors are translated, too.
    """

    template: str
    values: tuple[object, ...]

    def __new__(cls, template: str, *values: object) -> Message:
        self = super().__new__(cls, template.format(*values) if values else template)
        self.template, self.values = template, values
        if isinstance(template, Message) and not values:
            self.template, self.values = template.template, template.values
        return self


class UserError(ValueError):
    """Something that a user can mend. Its ``message`` says how; str() is the English one."""

    def __init__(self, template: str, *values: object) -> None:
        self.message = Message(template, *values)
        super().__init__(str(self.message))
