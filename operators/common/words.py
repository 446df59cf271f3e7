# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages and labels with values in them, in the language of the interface.

Blender translates texts that never change by itself. A text with values is translated as a template, and the
values are put in afterwards: a catalogue cannot hold all of them. Users can switch the translation of reports
off and keep that of labels, or the other way round.
"""

from bpy.app.translations import pgettext_iface

from ...scfpf_addon.bridge.blender.user_errors import translated_report
from ...scfpf_addon.projection.user_error import Message

__all__ = ["label_text", "report_text", "translated_label", "translated_report"]


def report_text(template: str, *values: object) -> str:
    """A message with values in the places {0}, {1}, … of its translated template."""
    return translated_report(Message(template, *values))


def label_text(template: str, *values: object) -> str:
    """A label with values in the places {0}, {1}, … of its translated template."""
    return translated_label(Message(template, *values))


def translated_label(message: str | BaseException) -> str:
    """A message or an error as a translated label.

    message: a ``Message``, an error such as ``UserError``, or a text of the catalogue.
    """
    return translated_report(message, pgettext_iface)
