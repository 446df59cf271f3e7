# SPDX-License-Identifier: GPL-3.0-or-later
"""An error whose message can be translated after it was raised."""


class TemplateError(ValueError):
    """Bad input: a template and the values for its places {0}, {1}, …

    str() is the English message; operators put the values into the translated template. Without values the
    template is the message itself, and its braces are text. A value that is an error is translated too.
    """

    def __init__(self, template: str, *values: object) -> None:
        super().__init__(template.format(*values) if values else template)
        self.template, self.values = template, values
