# SPDX-License-Identifier: GPL-3.0-or-later
"""Base classes of operators, and the selection and local view of the objects that operators make."""

from collections.abc import Iterator
from contextlib import contextmanager

from bpy.app.translations import pgettext_rpt, pgettext_tip

from ...scfpf_addon.bridge.aim.kept_volume import camera_kept
from ...scfpf_addon.bridge.blender.all_or_nothing import all_or_nothing
from ...scfpf_addon.bridge.blender.unstored_edits import note_edit
from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from .errors import failed, refused
from .target import active_object, flexible_camera_of, poll_flexible_camera, selected_objects

# Steps in a list, by the property Direction.
STEPS = {"UP": -1, "DOWN": 1}
# Ways across and up of modal tools' keys.
ARROWS = {"LEFT_ARROW": (-1, 0), "RIGHT_ARROW": (1, 0), "DOWN_ARROW": (0, -1), "UP_ARROW": (0, 1)}


class Action:
    """An operator that does ``act(context)``, which may return a line to report, or {"CANCELLED"}.

    After bad input or a bug, which are reported, the file is as before.
    """

    bl_options = {"REGISTER", "UNDO"}

    def act(self, context) -> str | set[str] | None:
        raise NotImplementedError

    def execute(self, context):
        try:
            note_edit()
            with all_or_nothing() as kept:
                kept.callback(_select_again, context.view_layer, *_selection(context))
                message = self.act(context)
        except USER_ERRORS as error:
            return refused(self, error)
        except Exception as error:
            return failed(self, error)
        if isinstance(message, set):
            return message
        if message:
            self.report({"INFO"}, pgettext_rpt(message))
        return {"FINISHED"}


class Tool(Action):
    """An action ``edit(context, camera)`` on a flexible camera; new control surfaces join the local view."""

    poll = classmethod(poll_flexible_camera)

    def act(self, context):
        camera = flexible_camera_of(context)
        before = {slot.object for slot in camera.scfpf.surfaces}
        with camera_kept(camera):
            message = self.edit(context, camera)
            made = [slot.object for slot in camera.scfpf.surfaces if slot.object not in before]
            show_in_local_view(context, made)
        return message


@contextmanager
def wholly_made(context) -> Iterator[None]:
    """Remove the objects that the block has made, and restore selection and scene camera, if it raises."""
    with all_or_nothing() as kept:
        kept.callback(_select_again, context.view_layer, *_selection(context))
        kept.keep(context.scene, "camera")
        kept.keep(context.scene.scfpf_sampling, "world_shadows")
        yield


def _selection(context) -> tuple[set[str], str]:
    """The names of the selected objects, and of the active one or an empty text."""
    active = active_object(context)
    return {obj.name_full for obj in selected_objects(context)}, "" if active is None else active.name_full


def _select_again(view_layer, selected: set[str], active: str) -> None:
    # Until the next evaluation a view layer has None in the place of an object that was removed.
    present = [obj for obj in view_layer.objects if obj is not None]
    for obj in present:
        if obj.select_get(view_layer=view_layer) != (obj.name_full in selected):
            obj.select_set(obj.name_full in selected, view_layer=view_layer)
    view_layer.objects.active = next((obj for obj in present if obj.name_full == active), None)


def plain(text: str) -> str:
    """A docstring in one line, as a tooltip."""
    return " ".join(text.split())


def tooltip_of(cls, items, identifier: str) -> str:
    """The description of one of ``items`` (identifier, name, description), else the operator's own.

    It is translated, which Blender does not do with the text of an operator's ``description``.
    """
    text = next((text for item, _name, text in items if item == identifier and text), cls.__doc__)
    translated: str = pgettext_tip(text)
    return translated


def select_only(context, obj) -> None:
    """Make an object the only selected one, and the active one."""
    for other in selected_objects(context):
        other.select_set(False)
    obj.select_set(True)
    context.view_layer.objects.active = obj


def show_in_local_view(context, objects) -> None:
    """Add objects to the local view of the present 3D viewport, if any, as Blender's own Add does."""
    space = context.space_data
    if space is None or space.type != "VIEW_3D" or space.local_view is None:
        return
    context.view_layer.update()
    for obj in objects:
        if obj is not None and obj.name in context.view_layer.objects:
            obj.local_view_set(space, True)
