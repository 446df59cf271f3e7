# SPDX-License-Identifier: GPL-3.0-or-later
"""The flexible camera that a 3D viewport shows live, and whether it shows the ordinary view instead."""

from __future__ import annotations

# Shadings of a viewport over which live images are drawn.
SHADINGS = {"SOLID", "MATERIAL"}
# Modes in which nothing of a thing is picked in the viewport: Live View is shown in them.
WITHOUT_PICKING = {"OBJECT", "POSE"}


def chosen_camera(context):
    """The flexible camera with Live View that a 3D viewport looks through, or None."""
    space, view = context.space_data, context.region_data
    if view is None or view.view_perspective != "CAMERA" or space.shading.type not in SHADINGS:
        return None
    camera = space.camera if space.use_local_camera else context.scene.camera
    if camera is None or camera.type != "CAMERA":
        return None
    return camera if camera.scfpf.enabled and camera.scfpf.show_live else None


def live_camera(context):
    """The flexible camera that a 3D viewport shows live, or None."""
    camera = chosen_camera(context)
    return None if camera is None or steps_aside(context) else camera


def steps_aside(context) -> bool:
    """Return whether the camera's ordinary view is shown, in which a thing is edited, sculpted or painted.

    The live image has no vertices, and Blender's clicks and brushes would meet what is not seen. Control
    surfaces are drawn over the image. If another viewport shows the thing, it can be edited there.
    """
    if context.mode in WITHOUT_PICKING:
        return False
    edited = context.objects_in_mode
    if edited and all(obj.scfpf_surface.kind != "NONE" for obj in edited):
        return False
    return not any(
        area.type == "VIEW_3D" and area.spaces.active.region_3d.view_perspective != "CAMERA"
        for area in context.screen.areas
    )
