# SPDX-License-Identifier: GPL-3.0-or-later
"""The base of modal operators that drag a frame in the image, by mouse, keys or numbers."""

from __future__ import annotations

import bpy
import numpy as np

from ...scfpf_addon.bridge.frames.shown_frame import ShownFrame, frame_at
from ...scfpf_addon.bridge.frames.shown_image import ShownImage
from ...scfpf_addon.bridge.render.image_size import image_size
from ...scfpf_addon.bridge.render.view_painter import Rectangle
from ...scfpf_addon.shading.picking.frame_drag import DIGITS, FrameDrag
from ...scfpf_addon.shading.picking.frame_handles import BODY, ORBIT, SIZE, TURN, FrameChange, HandledFrame
from .tool import ARROWS
from .words import report_text

PARTS = {"G": BODY, "S": SIZE, "R": TURN}


def pressed_part(context, event, frames: list[ShownFrame]) -> tuple[int, int]:
    """The index of the frame under a press of the mouse and the part of it; -1 and the body without one."""
    scale = context.preferences.system.ui_scale
    hit = frame_at(frames, event.mouse_region_x, event.mouse_region_y, scale)
    is_press = event.type == "LEFTMOUSE" and event.value == "PRESS"
    return hit if is_press and hit is not None else (-1, BODY)


def whole_image(context, camera) -> ShownImage:
    """The image of a camera in pixels of its own, for regions that do not show it. Raises UserError."""
    return ShownImage(camera, Rectangle(0.0, 0.0, *map(float, image_size(context.scene))))


class FrameDragging:
    """What drags of frames share beside ``ModalJob``. ``begin_drag`` comes first."""

    escapes = frozenset({"ESC", "RIGHTMOUSE"})
    # Whether the frame can only be moved.
    moves_only = False

    def begin_drag(self, context, event, image: ShownImage, shown: ShownFrame | None, part: int) -> None:
        """Take hold of a part of a frame, or without ``shown`` of the mouse's pixel. Raises UserError."""
        mouse = np.array([event.mouse_region_x, event.mouse_region_y], np.float64)
        frame = None if shown is None else shown.frame
        origin = mouse if shown is None else shown.origin
        unit = image.rectangle.width / image_size(context.scene)[0]
        held = frame or HandledFrame(origin, (0.0, 0.0, 0.0, 0.0), 0.0)
        self._drag = FrameDrag(held, part, mouse, unit, is_point=self.moves_only)
        self._size = image.rectangle.width, image.rectangle.height
        self._mouse = event.mouse_x, event.mouse_y

    def ends_drag(self, event) -> bool:
        """Return whether an event accepts the drag: the mouse is released, or Enter is pressed."""
        return event.type == "LEFTMOUSE" or (event.type in {"RET", "NUMPAD_ENTER"} and event.value == "PRESS")

    @property
    def is_click(self) -> bool:
        """Whether the frame is where it was: a press and a release, or a drag there and back."""
        return self.dragged == FrameChange()

    def take_event(self, event) -> bool:
        """Apply a movement of the mouse or a key; return whether it may change the drag."""
        self._drag.is_snapped = event.ctrl
        if event.type == "MOUSEMOVE":
            x, y = self._mouse
            self._mouse = event.mouse_x, event.mouse_y
            self._drag.move(event.mouse_x - x, event.mouse_y - y, event.shift)
        elif event.value == "PRESS":
            self._press(event)
        else:
            return False
        return True

    def _press(self, event) -> None:
        """Apply a key."""
        if event.type in PARTS:
            again = event.type == "R" and self._drag.part == TURN
            self._drag.choose(ORBIT if again else PARTS[event.type])
        elif event.type in {"X", "Y"}:
            self._drag.constrain(event.type)
        elif event.type in ARROWS:
            self._drag.nudge(*ARROWS[event.type])
        elif event.type == "BACK_SPACE":
            self._drag.type("\b")
        elif event.unicode and event.unicode in DIGITS + ",":
            self._drag.type(event.unicode)

    @property
    def dragged(self) -> FrameChange:
        """The change since the beginning, its shift as shares of the image's width and height."""
        (x, y), factor, turn, orbit = self._drag.change
        return FrameChange((x / self._size[0], y / self._size[1]), factor, turn, orbit)

    def show_drag(self, context, text: str, keys: str) -> None:
        """Show numbers, the axis, what is typed and the keys in the status bar, and redraw the frames."""
        typed = f"    {self._drag.typed}" if self._drag.typed else ""
        axis = f"    along {self._drag.axis}" if self._drag.axis else ""
        self.show(context, f"{text}{axis}{typed}    {report_text(keys)}")
        redraw_frames()


def redraw_frames() -> None:
    """Redraw the regions that may show frames."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"VIEW_3D", "IMAGE_EDITOR"}:
                area.tag_redraw()
