# SPDX-License-Identifier: GPL-3.0-or-later
"""Drag a view or a pin of Aim in the image, or lead a view's eye round its thing; the volume follows."""

import math

import bpy
from bpy.props import FloatProperty, FloatVectorProperty, IntProperty

from ...scfpf_addon.bridge.aim import new_targets
from ...scfpf_addon.bridge.aim.follower import Follower
from ...scfpf_addon.bridge.aim.shown_targets import shown_targets
from ...scfpf_addon.bridge.aim.solve_work import run_through
from ...scfpf_addon.bridge.blender.all_or_nothing import PLACE, Kept
from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.blender.unstored_edits import note_edit
from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.bridge.frames.shown_image import shown_image
from ...scfpf_addon.bridge.settings.aim_properties import PIN, VIEW
from ...scfpf_addon.projection.user_error import UserError
from ..common.errors import refused
from ..common.frame_drag_job import FrameDragging, pressed_part, redraw_frames, whole_image
from ..common.target import flexible_camera_of, poll_flexible_camera
from .solve_job import SolveJob

NO_PLACE = "'{0}' has no view or pin at place {1}: choose one in the list"
# Steps while the mouse rests, until the volume has settled.
RESTING_STEPS = 4
KEYS = (
    "G: move    S: size    R: roll    R R: turn in space    X, Y: along an axis    Arrows or a number: "
    "exactly    Shift: fine    Ctrl: steps    Release or Enter: solve    Esc, right click: restore"
)


class SCFPF_OT_aim_drag(FrameDragging, SolveJob, bpy.types.Operator):
    """Move, scale, roll or turn the active view or pin in the picture, by mouse, keys or numbers: the volume
    follows, and is solved at the end"""

    bl_idname = "scfpf.aim_drag"
    bl_label = "Drag Target"
    bl_options = {"REGISTER", "UNDO"}

    # Between two steps while the mouse rests, and then between two looks at the solve.
    seconds = 0.05

    shift: FloatVectorProperty(
        name="Move", description="Movement, as shares of the picture's width and height", size=2
    )
    factor: FloatProperty(name="Size", description="Factor by which the size changes", default=1.0, min=0.01)
    turn: FloatProperty(name="Roll", description="Counterclockwise turn in the picture", subtype="ANGLE")
    orbit: FloatVectorProperty(
        name="Turn View",
        description="Angles by which the view's camera moves round the thing, to its left and up",
        size=2,
        subtype="EULER",
    )
    index: IntProperty(
        name="Target",
        description="Number of the target in the list; -1 for the active one",
        default=-1,
        min=-1,
    )

    @classmethod
    def poll(cls, context):
        if not poll_flexible_camera(cls, context):
            return False
        if not any(t.kind in (VIEW, PIN) for t in flexible_camera_of(context).scfpf.aim_targets):
            cls.poll_message_set("Add a view or a pin to the list first")
            return False
        return True

    def execute(self, context):
        note_edit()
        camera = flexible_camera_of(context)
        try:
            self._choose(camera)
            with Kept() as kept:
                follower = Follower(camera, context.evaluated_depsgraph_get())
                kept.callback(self._put_back)
                kept.callback(follower.restore)
                self._place(context)
                message = run_through(follower.finishing(context.evaluated_depsgraph_get()))
                kept.pop_all()
        except USER_ERRORS as error:
            return refused(self, error)
        self.tell(object_by_uid(self._camera), message)
        return {"FINISHED"}

    def invoke(self, context, event):
        image = shown_image(context)
        camera = flexible_camera_of(context) if image is None else image.camera
        frames = [] if image is None else shown_targets(context, image)
        self.shift, self.factor, self.turn, self.orbit = (0.0, 0.0), 1.0, 0.0, (0.0, 0.0)
        self.index, part = pressed_part(context, event, frames)
        try:
            self._choose(camera)
            self._follower = Follower(camera, context.evaluated_depsgraph_get())
            # Live Aim would take a second step at each event.
            self._is_live, camera.scfpf.aim.live = camera.scfpf.aim.live, False
            image = image or whole_image(context, camera)
            own = [shown for shown in shown_targets(context, image) if shown.index == self.index]
            self.begin_drag(context, event, image, own[0] if own else None, part)
        except USER_ERRORS as error:
            return refused(self, error)
        self._resting, self._is_solving = 0, False
        outcome = self.begin(context)
        self.ends.callback(self._restore_live)
        self._say(context)
        return outcome

    def is_lost(self):
        return not self._is_solving and object_by_uid(self._camera) is None

    def escape(self, context):
        return super().escape(context) if self._is_solving else {"CANCELLED"}

    def tick(self, context):
        if self._is_solving:
            return super().tick(context)
        if self._resting > 0:
            self._resting -= 1
            return self._follow(context)
        return {"PASS_THROUGH"}

    def respond(self, context, event):
        if self._is_solving:
            return {"RUNNING_MODAL"}
        if self.ends_drag(event):
            return {"CANCELLED"} if self.is_click else self._finish(context)
        if not self.take_event(event):
            return {"RUNNING_MODAL"}
        self._resting = RESTING_STEPS
        return self._follow(context)

    def _follow(self, context):
        """Put the target where the drag has it, and let the volume follow by one step. Raises USER_ERRORS."""
        self.shift, self.factor, self.turn, self.orbit = self.dragged
        self._place(context)
        self._follower.step(context.evaluated_depsgraph_get())
        self._say(context)
        return {"RUNNING_MODAL"}

    def _choose(self, camera) -> None:
        """Make the target active, and keep where it is. Raises UserError if it has no place in the image."""
        settings = camera.scfpf
        index = self.index if self.index >= 0 else settings.active_aim
        kinds = [target.kind for target in settings.aim_targets]
        if index >= len(kinds) or kinds[index] not in (VIEW, PIN):
            raise UserError(NO_PLACE, camera.name, index + 1)
        self.index, self._camera = index, camera.session_uid
        settings.active_aim = index
        target = self._target()
        self.moves_only = target.kind == PIN
        self._before = tuple(target.position), target.width, target.turn
        eye = None if self.moves_only else target.eye
        self._eye_before = {} if eye is None else {name: _value(eye, name) for name in PLACE}
        self._eye_matrix = None if eye is None else eye.matrix_world.copy()

    def _target(self):
        return object_by_uid(self._camera).scfpf.aim_targets[self.index]

    def _place(self, context) -> None:
        """Put the target and its eye where the properties say, from where they were. Raises UserError."""
        target, (position, width, turn) = self._target(), self._before
        if not self.moves_only and any(self.orbit):
            depsgraph = context.evaluated_depsgraph_get()
            new_targets.turn_eye(target, depsgraph, *self.orbit, self._eye_matrix)
        else:
            self._put_eye_back()
        target.position = position[0] + self.shift[0], position[1] + self.shift[1]
        target.width, target.turn = width * self.factor, turn + self.turn

    def _put_back(self) -> None:
        target = self._target()
        target.position, target.width, target.turn = self._before
        self._put_eye_back()

    def _put_eye_back(self) -> None:
        eye = self._target().eye
        for name, value in self._eye_before.items() if eye is not None else ():
            if _value(eye, name) != value:
                setattr(eye, name, value)

    def _finish(self, context):
        """Begin to solve. A solve that is refused or cancelled restores the volume. Raises USER_ERRORS."""
        self._is_solving, self.escapes = True, SolveJob.escapes
        steps = self._follower.finishing(context.evaluated_depsgraph_get())
        self.begin_solve(steps, object_by_uid(self._camera))
        self.show_solve(context)
        return {"RUNNING_MODAL"}

    def _say(self, context):
        """Tell the keys and the numbers, and redraw the frames."""
        target = self._target()
        text = f"{target.name}: x {target.position[0]:.1%}  y {target.position[1]:.1%}"
        if not self.moves_only:
            text += f"  size {target.width:.1%}  roll {math.degrees(target.turn):.1f}°"
        if any(self.orbit):
            left, up = (math.degrees(angle) for angle in self.orbit)
            text += f"  left {left:.1f}°  up {up:.1f}°"
        self.show_drag(context, text, KEYS)

    def _restore_live(self):
        """Leave Live Aim as it was, when targets and volume are in their places."""
        camera = object_by_uid(self._camera)
        if camera is not None:
            camera.scfpf.aim.live = self._is_live
        redraw_frames()

    def give_up(self, context):
        """Restore the target and the volume."""
        if not self._is_solving:
            self._follower.restore()
        super().give_up(context)
        if object_by_uid(self._camera) is not None:
            self._put_back()


def _value(eye, name: str):
    """A property that places an eye, as a value that stays."""
    value = getattr(eye, name)
    return value if isinstance(value, str) else tuple(value)


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_aim_drag,))
