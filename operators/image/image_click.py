# SPDX-License-Identifier: GPL-3.0-or-later
"""The common base of operators that wait for a click in the image, in an Image Editor that shows it."""

from bpy.props import FloatProperty

from ...scfpf_addon.bridge.render.result_image import result_image
from ..common.modal_job import ModalJob
from ..common.tool import ARROWS

NO_PICTURE = "No Image Editor of this window shows the picture: press Show Picture, then click in it"
# Clicks elsewhere are passed to Blender meanwhile: anything may have been removed, undone or started.
NO_MORE = "The camera or the mapping was removed: select it again, then click"

# Arrow keys move the mouse pointer by so many pixels; with Shift by one.
STEP = 10
KEYS = "Arrows, with Shift finely: move the pointer    Enter: click    Esc: cancel"


def image_regions(window) -> list:
    """The main regions of a window's Image Editors that show the last render."""
    image = result_image()
    return [
        region
        for area in window.screen.areas
        if area.ui_type == "IMAGE_EDITOR" and image is not None and area.spaces.active.image == image
        for region in area.regions
        if region.type == "WINDOW"
    ]


def image_position(window, x: int, y: int) -> tuple[float, float] | None:
    """The position in the image, in [0, 1], under a pixel of the window; None outside the image."""
    for region in image_regions(window):
        inside = 0 <= x - region.x < region.width and 0 <= y - region.y < region.height
        if inside:
            u, v = region.view2d.region_to_view(x - region.x, y - region.y)
            return (u, v) if 0 <= u <= 1 and 0 <= v <= 1 else None
    return None


def _share(name: str, description: str):
    return FloatProperty(
        name=name,
        description=description,
        default=0.5,
        min=0.0,
        max=1.0,
        precision=4,
        step=1,
        options={"SKIP_SAVE"},
    )


class ImageClick(ModalJob):
    """Wait for a click in the image, or Enter, store its position in x and y, and execute.

    Arrow keys move the pointer.

    cursor, hint: the mouse cursor and the text in the status bar meanwhile.
    """

    cursor = "EYEDROPPER"
    escapes = frozenset({"ESC", "RIGHTMOUSE"})
    hint = ""
    # The position that Enter chooses when the mouse is elsewhere, None to wait: numbers can follow.
    without_mouse: tuple[float, float] | None = (0.5, 0.5)

    x: _share("X", "From the picture's left border, as a share of its width")
    y: _share("Y", "From the picture's lower border, as a share of its height")

    def invoke(self, context, _event):
        if context.window is None or not image_regions(context.window):
            self.report({"ERROR"}, NO_PICTURE)
            return {"CANCELLED"}
        return self.wait(context)

    def wait(self, context):
        """Begin to wait for the click."""
        outcome = self.begin(context)
        self.show(context, f"{self.hint}    {KEYS}")
        return outcome

    def respond(self, context, event):
        if event.type in ARROWS and event.value == "PRESS":
            step = 1 if event.shift else STEP
            x, y = ARROWS[event.type]
            context.window.cursor_warp(event.mouse_x + step * x, event.mouse_y + step * y)
            return {"RUNNING_MODAL"}
        if event.type in {"LEFTMOUSE", "RET", "NUMPAD_ENTER"} and event.value == "PRESS":
            position = self.position_at(context, event.mouse_x, event.mouse_y)
            if position is None and event.type != "LEFTMOUSE":
                position = self.without_mouse
            if position is None:
                return {"RUNNING_MODAL"}
            self.leave()
            if not self.poll(context):
                self.report({"ERROR"}, NO_MORE)
                return {"CANCELLED"}
            self.x, self.y = position
            return self.execute(context)
        return {"PASS_THROUGH"}

    def position_at(self, context, x: int, y: int) -> tuple[float, float] | None:
        """The position that a click at a pixel of the window chooses, None to wait for another."""
        return image_position(context.window, x, y)
