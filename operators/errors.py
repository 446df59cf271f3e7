# SPDX-License-Identifier: GPL-3.0-or-later
"""The errors that mean bad input: operators report them in one line; all others are bugs and are raised."""

from ..scfpf_addon.bridge.edit_volume import EditVolumeError
from ..scfpf_addon.bridge.flexible_camera import FlexibleCameraError
from ..scfpf_addon.bridge.mapping_edits import MappingError
from ..scfpf_addon.bridge.render_job import RENDER_ERRORS, reason
from ..scfpf_addon.bridge.result_image import ResultError
from ..scfpf_addon.bridge.slot_animation import SlotError
from ..scfpf_addon.bridge.surface_nodes import SurfaceError
from ..scfpf_addon.cycles.rig_data import RigError
from ..scfpf_addon.projection.blending import BlendError
from ..scfpf_addon.projection.editing import EditingError
from ..scfpf_addon.projection.preset import PresetError
from ..scfpf_addon.scanline.preview_data import PreviewError
from ..scfpf_addon.scanline.preview_viewports import ViewportError

BAD_INPUT = (
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
    """Report one of BAD_INPUT; what an operator returns then."""
    operator.report({"ERROR"}, reason(error))
    return {"CANCELLED"}
