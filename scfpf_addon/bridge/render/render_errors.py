# SPDX-License-Identifier: GPL-3.0-or-later
"""The errors that bad input to a render raises, and the messages to the user about them."""

from __future__ import annotations

import traceback
from collections.abc import Callable

from bpy.app.translations import pgettext_rpt

from ...casting.common.hits import CastError
from ...projection.template_error import Message, TemplateError
from ..camera.ordinary_camera import FrustumError
from ..camera.read_projection import ProjectionError
from ..camera.stereo_views import MultiViewError
from ..scene.read_scene import SceneError
from ..scene.render_depsgraph import RenderDepsgraphError

NO_MEMORY = Message(
    "There is not enough memory for this picture: lower the resolution, or close other programs"
)
NO_THREAD = "The system starts no more threads: close other programs, or restart Blender, and render again"


class RenderError(TemplateError):
    """A render is not possible; the message has the remedy."""


# All errors that ``render_inputs.prepare`` and a job's ``result`` raise for bad input; others are bugs.
RENDER_ERRORS = (
    CastError,
    FrustumError,
    MemoryError,
    MultiViewError,
    ProjectionError,
    RenderDepsgraphError,
    RenderError,
    SceneError,
)


def reason(error: BaseException) -> str:
    """The message of one of RENDER_ERRORS: Python may raise a MemoryError without a text."""
    return str(error) or NO_MEMORY


def told(message: str | BaseException, translate: Callable[[str], str] = pgettext_rpt) -> str:
    """A message or an error in the language of the interface, with the messages and errors in it."""
    if isinstance(message, BaseException):
        message = message.message if isinstance(message, TemplateError) else reason(message)
    if not isinstance(message, Message):
        return translate(message)
    values = [
        told(each, translate) if isinstance(each, (Message, BaseException)) else each
        for each in message.values
    ]
    return translate(message.template).format(*values) if values else translate(message.template)


def failure_message(error: Exception) -> str:
    """The message of any error; of a bug it names the error, and the traceback goes to the console."""
    if isinstance(error, RENDER_ERRORS):
        return told(error)
    traceback.print_exception(error)
    return told(
        Message(
            "SCFPF failed: look at the system console for the place ({0}: {1})",
            type(error).__name__,
            str(error),
        )
    )
