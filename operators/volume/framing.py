# SPDX-License-Identifier: GPL-3.0-or-later
"""Frame Picture: pan, tilt, roll, dolly and zoom the whole volume, by values or by dragging."""

import math

import bpy
from bpy.props import FloatProperty
from mathutils import Matrix, Vector

from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.camera.volume_fit import move_volume
from ...scfpf_addon.projection.editing.volume_edits import framing
from ..common.modal_job import ModalJob
from ..common.target import flexible_camera_of, poll_slot
from ..common.tool import ARROWS, Action
from ..common.words import report_text

# The effect of a drag across the region: radians, the logarithm of a factor, a share of the volume's depth.
TURN, ZOOM, DOLLY = math.radians(60), 2.0, 1.0
# The zoom of one notch of the wheel.
WHEEL = 1.05
# The effect of an arrow key, as that of a drag across this share of the region: half a degree.
ARROW = 1 / 120
# The zoom that the properties allow.
LEAST_ZOOM, MOST_ZOOM = 0.01, 100.0
# An axis of the camera foreshortened to less than this share has no direction on the screen.
SEEN = 0.2
KEYS = (
    "Move, arrow keys: pan and tilt    Ctrl or wheel: zoom    Shift: dolly    R: roll    "
    "Enter, click: accept    Esc, right click: restore"
)


class SCFPF_OT_volume_frame(ModalJob, Action, bpy.types.Operator):
    """Pan, tilt, roll, dolly or zoom the whole volume with the mouse; the camera object stays where it is"""

    bl_idname = "scfpf.volume_frame"
    bl_label = "Frame Picture"

    pan: FloatProperty(name="Pan", description="Turn the volume to the right", subtype="ANGLE")
    tilt: FloatProperty(name="Tilt", description="Turn the volume upwards", subtype="ANGLE")
    roll: FloatProperty(name="Roll", description="Turn the volume counterclockwise", subtype="ANGLE")
    dolly: FloatProperty(name="Dolly", description="Move the volume forwards", subtype="DISTANCE")
    zoom: FloatProperty(
        name="Zoom",
        description="Show less than before, larger; below 1, more",
        default=1.0,
        min=LEAST_ZOOM,
        max=MOST_ZOOM,
    )

    escapes = frozenset({"ESC", "RIGHTMOUSE"})

    poll = classmethod(poll_slot)

    def act(self, context):
        move_volume(flexible_camera_of(context), self._matrix())

    def _matrix(self):
        return framing(self.pan, self.tilt, self.roll, self.dolly, self.zoom)

    def invoke(self, context, event):
        camera = flexible_camera_of(context)
        self.pan = self.tilt = self.roll = self.dolly = 0.0
        self.zoom = 1.0
        if self.execute(context) != {"FINISHED"}:
            return {"CANCELLED"}
        slots = camera.scfpf.surfaces
        self._camera = camera.session_uid
        self._before = {
            slot.object.session_uid: tuple(map(tuple, slot.object.matrix_parent_inverse)) for slot in slots
        }
        view = context.region_data if context.area is not None and context.area.type == "VIEW_3D" else None
        self._sides = _sides(camera, view)
        self._reach = context.region.width if context.region is not None else context.window.width
        centre = context.region if view is not None else None
        self._centre = (
            (centre.x + centre.width / 2, centre.y + centre.height / 2)
            if centre is not None
            else (context.window.width / 2, context.window.height / 2)
        )
        self._distance = max(_depth(camera, slot.object) for slot in slots) or 1.0
        self._rolling = False
        self._mouse = event.mouse_x, event.mouse_y
        outcome = self.begin(context)
        self.ends.callback(_clear_header)
        self._say(context)
        return outcome

    def is_lost(self):
        return object_by_uid(self._camera) is None

    def respond(self, context, event):
        if event.type in {"LEFTMOUSE", "RET", "NUMPAD_ENTER"} and event.value == "PRESS":
            return {"FINISHED"}
        if event.type == "R" and event.value == "PRESS":
            self._rolling = not self._rolling
        elif event.type in {"WHEELUPMOUSE", "WHEELDOWNMOUSE"}:
            self._zoom_by(WHEEL if event.type == "WHEELUPMOUSE" else 1 / WHEEL)
        elif event.type == "MOUSEMOVE":
            self._drag(event)
        elif event.type in ARROWS and event.value == "PRESS":
            self._step(event)
        else:
            return {"PASS_THROUGH"} if event.type.startswith("TIMER") else {"RUNNING_MODAL"}
        camera = object_by_uid(self._camera)
        self._restore(camera)
        move_volume(camera, self._matrix())
        self._say(context)
        return {"RUNNING_MODAL"}

    def _drag(self, event):
        """Apply a movement of the mouse, by the modifier keys that are held."""
        old, self._mouse = self._mouse, (event.mouse_x, event.mouse_y)
        x, y = ((now - then) / self._reach for now, then in zip(self._mouse, old, strict=True))
        if self._rolling:
            a, b = (math.atan2(p[1] - self._centre[1], p[0] - self._centre[0]) for p in (old, self._mouse))
            # From in front of the camera the roll looks reversed.
            self.roll += self._sides[2] * math.remainder(b - a, math.tau)
        else:
            self._shift(x, y, event)

    def _step(self, event):
        """Apply an arrow key, by the modifier keys that are held; a roll goes by the angle of a pan."""
        x, y = (ARROW * way for way in ARROWS[event.type])
        if self._rolling:
            self.roll -= self._sides[2] * TURN * (x + y)
        else:
            self._shift(x, y, event)

    def _shift(self, x: float, y: float, event):
        """Pan and tilt, zoom or dolly by shares of the region."""
        if event.ctrl:
            self._zoom_by(math.exp(ZOOM * (x + y)))
        elif event.shift:
            self.dolly += DOLLY * self._distance * (x + y)
        else:
            self.pan += TURN * self._sides[0] * x
            self.tilt += TURN * self._sides[1] * y

    def _zoom_by(self, factor: float):
        self.zoom = min(max(self.zoom * factor, LEAST_ZOOM), MOST_ZOOM)

    def _restore(self, camera):
        """Restore the matrices of all surfaces exactly."""
        for slot in camera.scfpf.surfaces:
            if slot.object is not None and slot.object.session_uid in self._before:
                slot.object.matrix_parent_inverse = Matrix(self._before[slot.object.session_uid])

    def _say(self, context):
        amounts = report_text(
            "Pan {0:.1f}°  Tilt {1:.1f}°  Roll {2:.1f}°  Dolly {3:.3g}  Zoom {4:.3f}",
            math.degrees(self.pan),
            math.degrees(self.tilt),
            math.degrees(self.roll),
            self.dolly,
            self.zoom,
        )
        if context.area is not None:
            context.area.header_text_set(amounts + ("    Rolling" if self._rolling else ""))
        self.show(context, KEYS)

    def give_up(self, _context):
        """Restore the volume."""
        camera = object_by_uid(self._camera)
        if camera is not None:
            self._restore(camera)


def _clear_header() -> None:
    if bpy.context.area is not None:
        bpy.context.area.header_text_set(None)


def _depth(camera, surface) -> float:
    """The depth in camera space of the farthest corner of a surface."""
    matrix = camera.matrix_world.inverted_safe() @ surface.matrix_world
    return max(abs((matrix @ Vector(corner)).z) for corner in surface.bound_box)


def _sides(camera, view) -> tuple[int, int, int]:
    """The signs of the camera's right, top and back on the screen, 1 or -1.

    They make a drag to the right move the image to the right from behind the camera and from in front.
    """
    if view is None:
        return 1, 1, 1
    turn = view.view_matrix.to_3x3() @ camera.matrix_world.to_3x3().normalized()
    along = turn.col[0].x, turn.col[1].y, turn.col[2].z
    return tuple(-1 if value < -SEEN else 1 for value in along)


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_volume_frame,))
