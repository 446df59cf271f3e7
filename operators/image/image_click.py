# SPDX-License-Identifier: GPL-3.0-or-later
"""A click in the picture, in an Image Editor that shows it: what operators that ask for one share."""

from bpy.props import FloatProperty

from ...scfpf_addon.bridge.render.result_image import result_image

NO_PICTURE = "No Image Editor of this window shows the picture: press Show Picture, then click in it"
# Clicks elsewhere go on to Blender meanwhile: anything may have been removed, undone or started.
NO_MORE = "The camera or the mapping was removed: select it again, then click"


def picture_regions(window) -> list:
    """The regions of a window's Image Editors that show our picture."""
    image = result_image()
    return [
        region
        for area in window.screen.areas
        if area.ui_type == "IMAGE_EDITOR" and image is not None and area.spaces.active.image == image
        for region in area.regions
        if region.type == "WINDOW"
    ]


def image_position(window, x: int, y: int) -> tuple[float, float] | None:
    """The position in the picture, each share in [0, 1], under a pixel of the window; None beside it."""
    for region in picture_regions(window):
        inside = 0 <= x - region.x < region.width and 0 <= y - region.y < region.height
        if inside:
            u, v = region.view2d.region_to_view(x - region.x, y - region.y)
            return (u, v) if 0 <= u <= 1 and 0 <= v <= 1 else None
    return None


class PictureClick:
    """Wait for a click in the picture, put its position into x and y, and execute.

    cursor: that says so meanwhile; hint: in the status bar.
    """

    cursor = "EYEDROPPER"
    hint = ""

    x: FloatProperty(
        name="X",
        description="From the picture's left border, as a share of its width",
        default=0.5,
        min=0.0,
        max=1.0,
        precision=4,
        step=1,
        options={"SKIP_SAVE"},
    )
    y: FloatProperty(
        name="Y",
        description="From the picture's lower border, as a share of its height",
        default=0.5,
        min=0.0,
        max=1.0,
        precision=4,
        step=1,
        options={"SKIP_SAVE"},
    )

    def invoke(self, context, _event):
        if context.window is None or not picture_regions(context.window):
            self.report({"ERROR"}, NO_PICTURE)
            return {"CANCELLED"}
        context.window_manager.modal_handler_add(self)
        context.window.cursor_modal_set(self.cursor)
        context.workspace.status_text_set(f"{self.hint}    Esc: cancel")
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS":
            self.cancel(context)
            return {"CANCELLED"}
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            position = image_position(context.window, event.mouse_x, event.mouse_y)
            if position is not None:
                self.cancel(context)
                if not self.poll(context):
                    self.report({"ERROR"}, NO_MORE)
                    return {"CANCELLED"}
                self.x, self.y = position
                return self.execute(context)
            return {"RUNNING_MODAL"}
        return {"PASS_THROUGH"}

    def cancel(self, context):
        """Take back what invoke put up."""
        if context.window is not None:
            context.window.cursor_modal_restore()
        if context.workspace is not None:
            context.workspace.status_text_set(None)
