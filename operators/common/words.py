# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages and labels with values in them, in the language of the interface.

Blender translates texts that never change by itself. A text with values is translated as a template, and the
values are put in afterwards: a catalogue cannot hold all of them.
"""

from bpy.app.translations import pgettext_iface, pgettext_rpt

from ...scfpf_addon.bridge.render.render_errors import reason
from ...scfpf_addon.projection.template_error import TemplateError


def say(template: str, *values: object) -> str:
    """A message with values in the places {0}, {1}, … of its translated template."""
    return pgettext_rpt(template).format(*values)


def worded(template: str, *values: object) -> str:
    """A label with values in the places {0}, {1}, … of its translated template."""
    return pgettext_iface(template).format(*values)


def told(error: BaseException) -> str:
    """The message of an error, translated; of a TemplateError its template, and errors among its values."""
    if not isinstance(error, TemplateError):
        return pgettext_rpt(reason(error))
    if not error.values:
        return pgettext_rpt(error.template)
    values = [told(value) if isinstance(value, BaseException) else value for value in error.values]
    return say(error.template, *values)
