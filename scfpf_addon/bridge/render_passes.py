# SPDX-License-Identifier: GPL-3.0-or-later
"""Which passes a view layer has: one list for Blender, the compositor, the files and the renderer."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import bpy
from bpy.props import BoolProperty, PointerProperty

from . import versions


class RenderPass(NamedTuple):
    """name: in Blender. channels: a letter each. type: how Blender takes it. source: of
    ``shading.passes.PASSES``, empty for the picture itself.
    """

    name: str
    channels: str
    type: str
    source: str


def list_render_passes(view_layer) -> Iterator[RenderPass]:
    """The passes that are switched on for a view layer, the picture first."""
    yield RenderPass("Combined", "RGBA", "COLOR", "")
    own = view_layer.scfpf
    object_index, material_index = versions.index_pass_names()
    for switch, each in (
        (view_layer.use_pass_z, RenderPass("Depth", "Z", "VALUE", "DEPTH")),
        (view_layer.use_pass_position, RenderPass("Position", "XYZ", "VECTOR", "POSITION")),
        (view_layer.use_pass_normal, RenderPass("Normal", "XYZ", "VECTOR", "NORMAL")),
        (view_layer.use_pass_vector, RenderPass("Vector", "XYZW", "VECTOR", "VECTOR")),
        (view_layer.use_pass_uv, RenderPass("UV", "UVA", "VECTOR", "UV")),
        (view_layer.use_pass_object_index, RenderPass(object_index, "X", "VALUE", "OBJECT_INDEX")),
        (view_layer.use_pass_material_index, RenderPass(material_index, "X", "VALUE", "MATERIAL_INDEX")),
        (own.use_pass_parameters, RenderPass("ProjectorParameters", "UVT", "VECTOR", "PARAMETERS")),
        (
            own.use_pass_perspective_depth,
            RenderPass("PerspectiveDepth", "Z", "VALUE", "PERSPECTIVE_DEPTH"),
        ),
        (own.use_pass_tangent, RenderPass("ProjectorTangent", "XYZ", "VECTOR", "TANGENT")),
        (own.use_pass_chord_count, RenderPass("ChordCount", "X", "VALUE", "CHORD_COUNT")),
        (own.use_pass_chord_error, RenderPass("ChordError", "X", "VALUE", "CHORD_ERROR")),
    ):
        if switch:
            yield each


def _switched(self, _context):
    # Blender tells the compositor by itself for its own switches only.
    for view_layer in self.id_data.view_layers:
        view_layer.update_render_passes()


class SCFPF_ViewLayer(bpy.types.PropertyGroup):
    """Passes of a view layer that only the SCFPF engine has."""

    use_pass_parameters: BoolProperty(
        name="Projector Parameters",
        description="Where in the viewing volume each pixel's hit lies: u, v and t, 0 where nothing is hit",
        default=False,
        update=_switched,
        override={"LIBRARY_OVERRIDABLE"},
    )
    use_pass_perspective_depth: BoolProperty(
        name="Perspective Depth",
        description="Depth from 0 at the near to 1 at the far surface, in the steps of linear perspective: "
        "finer than t near the camera. It equals t where projectors are parallel",
        default=False,
        update=_switched,
        override={"LIBRARY_OVERRIDABLE"},
    )
    use_pass_tangent: BoolProperty(
        name="Projector Tangent",
        description="Direction of each pixel's projector at its hit, in world space, away from the viewer",
        default=False,
        update=_switched,
        override={"LIBRARY_OVERRIDABLE"},
    )
    use_pass_chord_count: BoolProperty(
        name="Chord Count",
        description="Into how many straight chords each pixel's projector is cut up to its hit: where "
        "the picture costs time",
        default=False,
        update=_switched,
        override={"LIBRARY_OVERRIDABLE"},
    )
    use_pass_chord_error: BoolProperty(
        name="Chord Error",
        description="How far, in pixels, the chord that found a pixel's hit is from the curve there: how far "
        "a silhouette may be displaced. 0 for straight projectors",
        default=False,
        update=_switched,
        override={"LIBRARY_OVERRIDABLE"},
    )


def register():
    bpy.utils.register_class(SCFPF_ViewLayer)
    bpy.types.ViewLayer.scfpf = PointerProperty(type=SCFPF_ViewLayer)


def unregister():
    del bpy.types.ViewLayer.scfpf
    bpy.utils.unregister_class(SCFPF_ViewLayer)
