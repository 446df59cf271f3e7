# SPDX-License-Identifier: GPL-3.0-or-later
"""Look Behind: list what a flexible camera's picture hides, and add the view or the layer that shows it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import bpy
from bpy.props import EnumProperty, IntProperty

from ...scfpf_addon.bridge.aim.new_targets import (
    add_view,
    framing_eye,
    share_of_image,
    shown_thing,
    turn_to_free,
)
from ...scfpf_addon.bridge.blender.all_or_nothing import keep
from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.bridge.layers.layer_edits import add_layer_in_front
from ...scfpf_addon.bridge.scene.owners import under_owners
from ...scfpf_addon.bridge.tasks.task import Task
from ...scfpf_addon.projection.user_error import UserError
from ...scfpf_addon.shading.picking.look_behind import HiddenThing, hidden_things
from ..aim.aim_camera import AimAction, camera_name, own_projection
from ..aim.targets import collection_of, selected_things
from ..common.errors import refused
from ..common.modal_job import ModalJob, in_window
from ..common.target import flexible_camera_of, poll_flexible_camera
from ..common.tool import Action
from ..common.words import report_text
from ..image.preparation import poll_no_render, prepared_inputs, redraw_interface

# Rows that the list gets at most.
MOST_ROWS = 30
NOTHING = "The picture hides nothing that is large or selected"
CANCELED = "Look Behind canceled: the list is as before"
NOWHERE = "Nothing sees '{0}' freely within 75° of the picture's direction: press Add Layer instead"
# Lines of the sidebar.
PAST = {
    "LEFT": "Nearest free place: on its left",
    "RIGHT": "Nearest free place: on its right",
    "UP": "Nearest free place: above it",
    "DOWN": "Nearest free place: below it",
    "": "No place beside it is free",
}
STEPS_TO = {"LEFT": (-1, 0), "RIGHT": (1, 0), "UP": (0, 1), "DOWN": (0, -1), "": (0, 0)}
VIEW, LAYER = "VIEW", "LAYER"
WAYS = (
    (
        VIEW,
        "Add View",
        "A view of Aim beside what hides it, whose camera stands where nothing does; press Solve then",
    ),
    (LAYER, "Add Layer", "A layer that shows it where it is, in front of what hides it"),
)


class SCFPF_OT_look_behind(ModalJob, Action, bpy.types.Operator):
    """List what the picture hides though it is large or selected, with buttons that show it; materials that
    let light through hide nothing"""

    bl_idname = "scfpf.look_behind"
    bl_label = "Look Behind"
    seconds = 0.1
    canceled = CANCELED

    _task: Task | None = None

    @classmethod
    def poll(cls, context):
        return poll_flexible_camera(cls, context) and poll_no_render(cls, context)

    def act(self, context):
        self._prepare(context)
        self._task.run()
        return self._write()

    def invoke(self, context, _event):
        if not in_window(context):
            return self.execute(context)
        try:
            self._prepare(context)
            self._task.start()
        except USER_ERRORS as error:
            return refused(self, error)
        outcome = self.begin(context)
        self._show(context)
        return outcome

    def is_lost(self):
        return object_by_uid(self._camera) is None

    def tick(self, context):
        if self._task.running:
            self._show(context)
            return {"PASS_THROUGH"}
        self.report({"INFO"}, self._write())
        redraw_interface(bpy.context.window_manager)
        return {"FINISHED"}

    def respond(self, _context, _event):
        return {"PASS_THROUGH"}

    def give_up(self, _context):
        """End the thread; the list is as before."""
        self._task.cancel()
        self._task.wait()

    def _show(self, context):
        text = report_text("Flexible Projection: looking behind, {0:.0%}    Esc: cancel", self._task.progress)
        self.show(context, text, self._task.progress)

    def _prepare(self, context) -> None:
        """Read the scene, and note what is looked for. Raises USER_ERRORS."""
        camera = flexible_camera_of(context)
        self._camera = camera.session_uid
        asked = {obj.name_full for obj in selected_things(context)}
        inputs = prepared_inputs(context, camera)
        geometry = under_owners(inputs.scene.geometry, context.evaluated_depsgraph_get())
        names = self._names = geometry.object_names
        wanted = {number for number, name in enumerate(names) if name in asked}
        scene = replace(inputs.scene, geometry=geometry)
        self._task = Task(partial(_look, inputs.projection, scene, wanted), "SCFPF look behind")

    def _write(self) -> str:
        """Write the list; return the line to report. Raises USER_ERRORS."""
        rows: list[HiddenThing] = self._task.result() or []
        settings = object_by_uid(self._camera).scfpf
        keep(settings)
        settings.hidden_things.clear()
        settings.active_hidden = 0
        for row in rows[:MOST_ROWS]:
            made = settings.hidden_things.add()
            made.name, made.hider = self._names[row.number], self._names[row.hider]
            made.share, made.hidden = row.share, row.hidden
            made.past = [row.away * part for part in STEPS_TO[row.side]]
            made.message = self._message(row)
        found = report_text("Things hidden: {0}", len(rows))
        if len(rows) > MOST_ROWS:
            found = report_text("{0}, of which the list has {1}", found, MOST_ROWS)
        settings.hidden_message = found if rows else NOTHING
        return settings.hidden_message

    def _message(self, row: HiddenThing) -> str:
        part = report_text("{0:.0%} hidden, most by {1}", row.hidden, self._names[row.hider])
        share = report_text("Alone it is {0:.1%} of the picture", row.share)
        return " · ".join((part.replace("%", " %"), share.replace("%", " %"), report_text(PAST[row.side])))


def _look(projection, scene, wanted, task):
    """The work of the task."""

    def note(share: float) -> None:
        """Note the share that is done."""
        task.progress = share

    return hidden_things(projection, scene, wanted, note, task.cancellation.is_set)


class SCFPF_OT_hidden_show(AimAction, bpy.types.Operator):
    """Show the hidden thing in the picture"""

    bl_idname = "scfpf.hidden_show"
    bl_label = "Show Hidden Thing"

    camera: camera_name()
    index: IntProperty(
        name="Index",
        description="Place in the list of hidden things; -1 is the active one",
        default=-1,
        min=-1,
        options={"SKIP_SAVE"},
    )
    way: EnumProperty(name="Way", description="How the thing is shown", items=WAYS, default=VIEW)

    @classmethod
    def description(cls, _context, properties):
        return next(text for name, _title, text in WAYS if name == properties.way)

    def edit(self, context, camera):
        rows = camera.scfpf.hidden_things
        index = camera.scfpf.active_hidden if self.index < 0 else self.index
        if index >= len(rows):
            raise UserError(
                "'{0}' has no hidden thing at place {1}: press Look Behind", camera.name, index + 1
            )
        camera.scfpf.active_hidden = index
        name = rows[index].name
        thing = next((obj for obj in context.view_layer.objects if obj.name_full == name), None)
        if thing is None:
            raise UserError("'{0}' is not in the view layer any more: press Look Behind again", name)
        return (
            _add_view(context, camera, thing, tuple(rows[index].past))
            if self.way == VIEW
            else _add_layer(context, camera, thing)
        )


def _add_view(context, camera, thing, past):
    projection = own_projection(context, camera)
    target = add_view(camera, context.evaluated_depsgraph_get(), projection, None, thing)
    x, y = past
    target.position = min(max(target.position[0] + x, 0.0), 1.0), min(max(target.position[1] + y, 0.0), 1.0)
    # Projectors that pass what hides it on one side come to it from there.
    way = math.atan2(y, -x) if x or y else None
    # The new camera has to be evaluated.
    context.view_layer.update()
    if not turn_to_free(target, context.evaluated_depsgraph_get(), way):
        raise UserError(NOWHERE, thing.name)
    return report_text("Press Solve: the picture then sees '{0}' from '{1}'", thing.name, target.eye.name)


def _add_layer(context, camera, thing):
    projection, depsgraph = own_projection(context, camera), context.evaluated_depsgraph_get()
    shown = shown_thing(camera, projection, [thing], depsgraph)
    # A sphere around the thing fits into the height, too.
    eye = framing_eye(camera, f"{thing.name} Layer", shown, max(1.0, projection.aspect))
    collection = collection_of(context, [thing])
    add_layer_in_front(camera, collection, eye, shown.position, share_of_image(eye, shown))
    return report_text("'{0}' is shown in front of what hides it", thing.name)


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_look_behind, SCFPF_OT_hidden_show))
