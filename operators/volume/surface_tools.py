# SPDX-License-Identifier: GPL-3.0-or-later
"""Tools for the shape of control surfaces: convert, subdivide, equalise, apply the scale."""

import bpy
from bpy.props import EnumProperty, IntProperty

from ...scfpf_addon.bridge.camera import surface_edits
from ...scfpf_addon.bridge.camera.surface_scale import apply_scale, is_scaled
from ...scfpf_addon.bridge.render.image_size import image_aspect, image_size
from ...scfpf_addon.bridge.surfaces import lattice_object
from ...scfpf_addon.bridge.surfaces.kinds import PARAMETRIC_KINDS
from ...scfpf_addon.projection.editing.respacing import EVEN
from ..common.target import active_slot, flexible_camera_of, poll_slot, poll_volume
from ..common.tool import Tool
from ..common.words import report_text

# A converted surface counts as changed above this share of its size; float32 gives about 1e-7.
CHANGED_SHARE = 1e-6

DIRECTIONS = (
    ("U", "U", "Along the picture's width"),
    ("V", "V", "Along the picture's height"),
    ("BOTH", "Both", "Along u and along v"),
)


def _chosen(direction: str) -> dict[str, bool]:
    """The arguments ``along_u`` and ``along_v`` of an edit, by an item of DIRECTIONS."""
    return {"along_u": direction != "V", "along_v": direction != "U"}


def kept_share(scene, camera) -> float:
    """The change of a surface that stays within the pixel error, as a share of its size."""
    error = camera.scfpf.pixel_error / max(image_size(scene))
    return max(error, CHANGED_SHARE)


def _off(change: float, what: str, kept: float = CHANGED_SHARE) -> str | None:
    """The message that a converted shape is off by more than ``kept``, else None."""
    if change <= kept:
        return None
    return report_text(
        "The {0} is off by up to {1:.2g} % of the size: use more points to reduce that", what, 100 * change
    )


def _count(name: str, description: str, most: int):
    """A number of columns or rows, of which 0 is chosen by the pixel error."""
    return IntProperty(name=name, description=description, default=0, min=0, max=most)


class Conversion(Tool):
    """Make the active control surface one of another kind and of the same shape, within the pixel error."""

    # The edit, and the new kind in a sentence.
    convert, result = None, ""

    poll = classmethod(poll_slot)

    def edit(self, context, camera):
        kept = kept_share(context.scene, camera)
        change = self.convert(
            camera,
            context.evaluated_depsgraph_get(),
            camera.scfpf.active_surface,
            columns=self.columns,
            rows=self.rows,
            share=kept,
        )
        return _off(change, self.result, kept)


class SCFPF_OT_surface_to_grid(Conversion, bpy.types.Operator):
    """Make the active control surface a mesh grid of the same shape, for editing point by point"""

    bl_idname = "scfpf.surface_to_grid"
    bl_label = "Convert to Grid"
    convert, result = staticmethod(surface_edits.convert_to_grid), "grid"

    columns: _count("Columns", "Faces along u; 0 chooses enough to stay within the pixel error", 1024)
    rows: _count("Rows", "Faces along v; 0 chooses enough to stay within the pixel error", 1024)


class SCFPF_OT_surface_to_patch(Conversion, bpy.types.Operator):
    """Make the active control surface a smooth surface patch of the same shape, with modifiers applied, for
    editing by a few control points"""

    bl_idname = "scfpf.surface_to_patch"
    bl_label = "Convert to Surface Patch"
    convert, result = staticmethod(surface_edits.convert_to_patch), "patch"

    columns: _count(
        "Columns",
        "Control points along u, at least 4; 0 in either direction chooses enough to stay within the pixel "
        "error. A grid keeps its own number",
        64,
    )
    rows: _count(
        "Rows",
        "Control points along v, at least 4; 0 in either direction chooses enough to stay within the pixel "
        "error. A grid keeps its own number",
        64,
    )


class SCFPF_OT_surface_subdivide(Tool, bpy.types.Operator):
    """Give the active patch, grid or surface patch twice as many pieces; its shape and the picture stay"""

    bl_idname = "scfpf.surface_subdivide"
    bl_label = "Subdivide Control Surface"

    direction: EnumProperty(
        name="Direction",
        description="Directions that get more control points",
        items=DIRECTIONS,
        default="BOTH",
    )

    poll = classmethod(poll_slot)

    def edit(self, context, camera):
        across, up = surface_edits.subdivide(camera, camera.scfpf.active_surface, **_chosen(self.direction))
        return report_text("{0} × {1} control points", across, up)


class SCFPF_OT_surface_equalise(Tool, bpy.types.Operator):
    """Make the active control surface a grid of the same shape with evenly spaced points, which spreads
    crowded parts of the picture"""

    bl_idname = "scfpf.surface_equalise"
    bl_label = "Equalize by Arc Length"

    direction: EnumProperty(
        name="Direction", description="The lines to space evenly", items=DIRECTIONS, default="BOTH"
    )
    columns: IntProperty(name="Columns", description="Faces along u", default=32, min=2, max=512)
    rows: IntProperty(name="Rows", description="Faces along v", default=16, min=2, max=512)

    poll = classmethod(poll_slot)

    def edit(self, context, camera):
        left = surface_edits.equalise(
            camera,
            context.evaluated_depsgraph_get(),
            camera.scfpf.active_surface,
            columns=self.columns,
            rows=self.rows,
            **_chosen(self.direction),
        )
        if left <= EVEN:
            return None
        return report_text(
            "One direction alone can be even: steps still differ by up to {0:.2g} %", 100 * left
        )


class SCFPF_OT_surface_apply_scale(Tool, bpy.types.Operator):
    """Put the active control surface's whole scale, including its parents', into its sizes, so that its
    shape stays, which Blender's own Apply Scale (Ctrl-A) may lose"""

    bl_idname = "scfpf.surface_apply_scale"
    bl_label = "Apply Scale to Sizes"

    @classmethod
    def poll(cls, context):
        if not poll_slot(cls, context):
            return False
        surface = active_slot(flexible_camera_of(context)).object
        if surface is not None and surface.scfpf_surface.kind in PARAMETRIC_KINDS and not is_scaled(surface):
            cls.poll_message_set("The sizes are already those in the world: there is no scale to apply")
            return False
        return True

    def edit(self, context, camera):
        context.evaluated_depsgraph_get()  # updates the matrices of objects that were moved
        apply_scale(camera, camera.scfpf.active_surface)


class SCFPF_OT_volume_to_lattice(Tool, bpy.types.Operator):
    """Replace the whole volume by one lattice of the same shape at this frame, for editing point by
    point: projectors then follow the lattice's interpolation"""

    bl_idname = "scfpf.volume_to_lattice"
    bl_label = "Convert Volume to Lattice"

    points_u: IntProperty(name="Points U", description="Points across the picture", default=4, min=2, max=64)
    points_v: IntProperty(name="V", description="Points up the picture", default=4, min=2, max=64)
    points_w: IntProperty(name="W", description="Layers from near to far", default=4, min=2, max=64)
    interpolation: EnumProperty(
        name="Interpolation",
        description="Interpolation between the points of the lattice",
        items=(
            ("LINEAR", "Linear", "Straight pieces, exact for straight projectors between flat surfaces"),
            ("CARDINAL", "Cardinal", "Smooth and tight curves through the points"),
            ("CATMULL_ROM", "Catmull-Rom", "Smooth curves through the points"),
            ("BSPLINE", "B-Spline", "The smoothest curves, which pass beside the points"),
        ),
        default="LINEAR",
    )

    poll = classmethod(poll_volume)

    def edit(self, context, camera):
        change = surface_edits.convert_to_lattice(
            camera,
            context.evaluated_depsgraph_get(),
            image_aspect(context.scene),
            (self.points_w, self.points_v, self.points_u),
            self.interpolation,
        )
        return _off(change, lattice_object.TITLE.lower())


register, unregister = bpy.utils.register_classes_factory(
    (
        SCFPF_OT_surface_to_grid,
        SCFPF_OT_surface_to_patch,
        SCFPF_OT_surface_subdivide,
        SCFPF_OT_surface_equalise,
        SCFPF_OT_surface_apply_scale,
        SCFPF_OT_volume_to_lattice,
    )
)
