# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of several views by any engine, tile beside tile: quilts, and both eyes of stereoscopy."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty

from ...scfpf_addon.engines.tiled_job import RiggedTilesJob, TiledJob
from ...scfpf_addon.projection.user_error import UserError
from ..image.joined_engines import RENDERERS, RIG, OfAnyEngine
from ..image.quilt import OfQuilt, name_told
from .layer_render import PicturesRender

SIDE, TOP = "SIDE", "TOP"
LAYOUTS = (
    (SIDE, "Side by Side", "The left eye on the left"),
    (TOP, "Top-Bottom", "The left eye on top, as players of 360° stereo expect it"),
)
# The eyes from the lower left, and the columns.
TILES = {SIDE: (("LEFT", "RIGHT"), 2), TOP: (("RIGHT", "LEFT"), 1)}
NO_EYES = "Switch on Stereoscopy with Stereo 3D in Output Properties first: it says where both eyes are"


def _job(context, camera, eyes, columns: int, path: str, engine: str):
    """The job of a picture of several eyes. engine: of ``OfAnyEngine``. Raises USER_ERRORS."""
    if engine == RIG:
        return RiggedTilesJob(context, camera, eyes, columns, path)
    return TiledJob(context, camera, eyes, columns, path, RENDERERS[engine])


class SCFPF_OT_quilt_joined(OfAnyEngine, OfQuilt, PicturesRender, bpy.types.Operator):
    """Render a quilt by another engine, view by view; Esc cancels, the old picture stays"""

    bl_idname = "scfpf.quilt_joined"
    bl_label = "Render Quilt with Another Engine"
    bl_options = {"REGISTER"}

    def new_job(self, context, camera, _frames, path):
        quilt = self.quilt(context, camera)
        self.told = name_told(context.scene, quilt)
        return _job(context, camera, quilt.views(), quilt.columns, path, self.engine)


class SCFPF_OT_eyes_joined(OfAnyEngine, PicturesRender, bpy.types.Operator):
    """Render both eyes of the scene's Stereoscopy into one picture by another engine; Esc cancels, the old
    picture stays"""

    bl_idname = "scfpf.eyes_joined"
    bl_label = "Render Both Eyes"
    bl_options = {"REGISTER"}

    layout_of_eyes: EnumProperty(
        name="Layout", description="How both eyes lie in the picture", items=LAYOUTS, default=SIDE
    )

    def new_job(self, context, camera, _frames, path):
        render = context.scene.render
        if not render.use_multiview or render.views_format != "STEREO_3D":
            raise UserError(NO_EYES)
        eyes, columns = TILES[self.layout_of_eyes]
        return _job(context, camera, eyes, columns, path, self.engine)


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_quilt_joined, SCFPF_OT_eyes_joined))
