# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps that the operators on the image share: poll, inputs of a render, redrawing of panels."""

from ...scfpf_addon.bridge.render import render_job
from ...scfpf_addon.bridge.render.render_inputs import RenderInputs, prepare
from ..common.target import take_up_edits


def poll_no_render(cls, _context) -> bool:
    """A poll for operators that cannot run during a render."""
    if render_job.current() is not None:
        cls.poll_message_set(render_job.RUNNING)
        return False
    return True


def prepared_inputs(context, camera) -> RenderInputs:
    """The inputs of an image of the context's view layer, edits in progress included.

    Raises USER_ERRORS. Reading may free Blender data: afterwards look up ``camera`` by its uid.
    """
    take_up_edits(context)
    return prepare(context.scene, context.view_layer, camera)


def redraw_interface(window_manager) -> None:
    """Redraw the panels, not the views beside them."""
    for window in window_manager.windows:
        for area in window.screen.areas:
            for region in area.regions:
                is_sidebar = area.type == "VIEW_3D" and region.type == "UI"
                if is_sidebar or (area.type == "PROPERTIES" and region.type == "WINDOW"):
                    region.tag_redraw()
