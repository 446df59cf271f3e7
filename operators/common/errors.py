# SPDX-License-Identifier: GPL-3.0-or-later
"""The errors that mean bad input, which operators report in one line. Other errors are bugs.

Bugs propagate, unless an operator has to say that everything is as before: see ``failed``.
"""

import traceback

from ...scfpf_addon.bridge.aim.target_views import AimError
from ...scfpf_addon.bridge.blender.mesh_grid import SurfaceError
from ...scfpf_addon.bridge.blender.slot_animation import SlotError
from ...scfpf_addon.bridge.camera.flexible_camera import FlexibleCameraError
from ...scfpf_addon.bridge.mappings.mapping_edits import MappingError
from ...scfpf_addon.bridge.render.image_file import ResultError
from ...scfpf_addon.bridge.render.render_errors import RENDER_ERRORS
from ...scfpf_addon.bridge.volume.edit_mode import EditVolumeError
from ...scfpf_addon.cycles.rig_data import RigError
from ...scfpf_addon.projection.editing.blending import BlendError
from ...scfpf_addon.projection.editing.volume_edits import EditingError
from ...scfpf_addon.projection.presets.preset import PresetError
from ...scfpf_addon.scanline.preview.preview_data import PreviewError
from ...scfpf_addon.scanline.preview.preview_viewports import ViewportError
from .words import say, told

BAD_INPUT = (
    AimError,
    BlendError,
    EditVolumeError,
    EditingError,
    FlexibleCameraError,
    MappingError,
    PresetError,
    PreviewError,
    ResultError,
    RigError,
    SlotError,
    SurfaceError,
    ViewportError,
    *RENDER_ERRORS,
)


def refused(operator, error) -> set[str]:
    """Report one of BAD_INPUT, and return what a cancelled operator returns."""
    operator.report({"ERROR"}, told(error))
    return {"CANCELLED"}


def failed(operator, error: Exception) -> set[str]:
    """Report a bug after which everything is as before; return what a cancelled operator returns.

    The system console gets the traceback. Call it while the error is handled.
    """
    traceback.print_exc()
    operator.report(
        {"ERROR"},
        say(
            "{0} met a fault of the add-on, and everything is as before: report it with the text in the "
            "system console ({1})",
            operator.bl_label,
            f"{type(error).__name__}: {error}",
        ),
    )
    return {"CANCELLED"}
