# SPDX-License-Identifier: GPL-3.0-or-later
"""The Image Editor for a new image: one that is open and free, or else the one that F12 opens."""

import bpy

from ...scfpf_addon.bridge.render.result_image import result_image


def image_editors(window_manager) -> list:
    """The image spaces that may show a render, as F12 chooses them.

    Those that show the Render button's last image come first, then empty ones, then those of F12's. An
    editor with another image is the user's reference.
    """
    spaces = [
        area.spaces.active
        for window in window_manager.windows
        for area in window.screen.areas
        if area.ui_type == "IMAGE_EDITOR"
    ]
    free = [space for space in spaces if space.ui_mode == "VIEW" and not space.use_image_pin]
    ours = [space for space in spaces if space.image is not None and space.image == result_image()]
    empty = [space for space in free if space.image is None]
    renders = [space for space in free if space.image is not None and space.image.type == "RENDER_RESULT"]
    return ours + empty + renders


def reference_editor(context):
    """An image space for an image to look at: one of this window before others; None without any."""
    windows = sorted(context.window_manager.windows, key=lambda window: window != context.window)
    spaces = (
        area.spaces.active
        for window in windows
        for area in window.screen.areas
        if area.ui_type == "IMAGE_EDITOR"
    )
    return next(spaces, None)


def open_image_editor(context):
    """Make sure that an Image Editor is free where F12 would show its image; return its window.

    A free one in a window of its own comes to the front. None without a free one if the preference Render In
    is Keep User Interface. Esc in an opened editor restores the previous one, as after F12.
    """
    window_manager = context.window_manager
    editors = image_editors(window_manager)
    if editors:
        shown_in = _window_of(window_manager, editors[0])
        if shown_in != context.window and shown_in.screen.is_temporary:
            _view_show(context)
        return shown_in
    if context.preferences.view.render_display_type == "NONE":
        return None
    # Blender opens an editor for its own render: no other shows that, or it would be free.
    _view_show(context)
    opened = image_editors(window_manager)
    if not opened:
        return None
    opened[0].image = result_image()
    return _window_of(window_manager, opened[0])


def _view_show(context) -> None:
    """Call Blender's View Render, which opens the editor of renders or brings its window to the front."""
    window = context.window.parent if context.window.screen.is_temporary else context.window
    areas = window.screen.areas[:]
    largest = max(areas, key=lambda area: area.width * area.height)
    area = context.area if context.area in areas else largest
    with context.temp_override(window=window, area=area):
        bpy.ops.render.view_show("INVOKE_DEFAULT")


def _window_of(window_manager, space):
    """The window that shows an image space."""
    return next(
        window
        for window in window_manager.windows
        if any(area.spaces.active == space for area in window.screen.areas)
    )
