# SPDX-License-Identifier: GPL-3.0-or-later
"""Projection mapping: a video projector's picture, and surfaces with the viewer's picture as UV map."""

import pathlib

import bpy
from bpy.props import BoolProperty, IntProperty, StringProperty

from ...scfpf_addon.bridge.camera.flexible_camera import control_objects
from ...scfpf_addon.bridge.render.image_size import image_aspect, image_size, require_size, shown_aspect
from ...scfpf_addon.bridge.render.render_inputs import read_view
from ...scfpf_addon.bridge.render.result_image import IMAGE_NAME
from ...scfpf_addon.bridge.render.video_projector import (
    device_size,
    device_view,
    lit_surfaces,
    write_content_mesh,
    write_map,
    write_picture,
)
from ...scfpf_addon.casting.scene.cast_scene import CastScene
from ...scfpf_addon.projection.calibration.lens_numbers import MOST_PIXELS
from ...scfpf_addon.projection.user_error import UserError
from ...scfpf_addon.shading.picking.video_projector import video_projector_map
from ..common.target import active_object, selected_objects
from ..common.tool import Action
from ..common.words import report_text, translated_report


def _lit(context) -> list:
    """The selected meshes, without control surfaces and volume objects."""
    own = control_objects()
    return [obj for obj in selected_objects(context) if obj.type == "MESH" and obj.name_full not in own]


def _poll_viewer(cls, context) -> bool:
    viewer = context.scene.camera
    if viewer is None or viewer.type != "CAMERA":
        cls.poll_message_set("Make the viewer's camera the scene's camera")
        return False
    if not _lit(context):
        cls.poll_message_set("Select the meshes that are projected on")
        return False
    return True


def _viewer(context, depsgraph):
    """The projection of the scene's camera, and its image's width and height in pixels."""
    return read_view(depsgraph, context.scene.camera, image_aspect(context.scene)), image_size(context.scene)


class SCFPF_OT_video_projector_picture(Action, bpy.types.Operator):
    """Make the picture that the active camera must project onto the selected meshes, so that the scene's
    camera sees its own picture on them"""

    bl_idname = "scfpf.video_projector_picture"
    bl_label = "Picture for Video Projector"

    picture: StringProperty(
        name="Picture",
        description="Name of the image that the viewer shall see; empty takes the last render",
    )
    width: IntProperty(
        name="Width",
        description="Width of the picture in pixels; 0 takes its calibration or the scene's resolution",
        default=0,
        min=0,
        max=MOST_PIXELS,
    )
    height: IntProperty(
        name="Height",
        description="Height of the picture in pixels; 0 takes its calibration or the scene's resolution",
        default=0,
        min=0,
        max=MOST_PIXELS,
    )

    @classmethod
    def poll(cls, context):
        if not _poll_viewer(cls, context):
            return False
        device = active_object(context)
        if device is None or device.type != "CAMERA" or device == context.scene.camera:
            cls.poll_message_set(
                "Select the meshes, then the video projector: a camera that is not the scene's"
            )
            return False
        return True

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop_search(self, "picture", bpy.data, "images")
        layout.prop(self, "width")
        layout.prop(self, "height")

    def act(self, context):
        depsgraph = context.evaluated_depsgraph_get()
        camera = active_object(context)
        image = bpy.data.images.get(self.picture or IMAGE_NAME)
        if image is None and self.picture:
            raise UserError("There is no image called '{0}'", self.picture)
        wide, high = device_size(camera) or image_size(context.scene)
        size = self.width or wide, self.height or high
        require_size(*size)
        scene = CastScene(*lit_surfaces(_lit(context), depsgraph))
        viewer, (across, up) = _viewer(context, depsgraph)
        device = device_view(camera, depsgraph, shown_aspect(context.scene.render, *size))
        places, shown = video_projector_map(scene, device, viewer, size, (1 / across, 1 / up))
        if not shown.any():
            raise UserError(
                "No pixel of the video projector lights what the viewer sees: aim both at the meshes"
            )
        made, warning = write_map(places, shown)
        if image is not None:
            made, warning = write_picture(image, places, shown)
        if warning:
            self.report({"WARNING"}, translated_report(warning))
        share = 100 * float(shown.mean())
        return report_text(
            "The image is '{0}': the viewer sees {1:.0f} percent of its pixels", made.name, share
        )


class SCFPF_OT_content_mesh_export(Action, bpy.types.Operator):
    """Write the selected meshes into an OBJ file whose UV map is the picture of the scene's camera, for
    media servers"""

    bl_idname = "scfpf.content_mesh_export"
    bl_label = "Export for Media Server"
    bl_options = {"REGISTER"}

    filepath: StringProperty(name="File", description="The OBJ file to write", subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.obj", options={"HIDDEN"})
    # Blender's file browser looks for this property of exporters.
    check_existing: BoolProperty(
        name="Check Existing", description="Warn before a file is replaced", default=True, options={"HIDDEN"}
    )

    @classmethod
    def poll(cls, context):
        return _poll_viewer(cls, context)

    def invoke(self, context, _event):
        if not self.filepath:
            self.filepath = "surfaces.obj"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def act(self, context):
        if not self.filepath:
            raise UserError("Choose a file to write the meshes into")
        path = pathlib.Path(bpy.path.abspath(bpy.path.ensure_ext(self.filepath, ".obj")))
        depsgraph = context.evaluated_depsgraph_get()
        vertices, triangles = lit_surfaces(_lit(context), depsgraph)
        viewer, size = _viewer(context, depsgraph)
        try:
            left, error = write_content_mesh(path, vertices, triangles, viewer, size)
        except OSError as problem:
            raise UserError("Cannot write {0}: {1}", path.name, problem.strerror or problem) from problem
        if left:
            self.report({"WARNING"}, report_text("{0} triangles leave the picture and were left out", left))
        return report_text(
            "{0}: off by {1:.2f} pixels at most; subdivide the meshes for less", path.name, error
        )


register, unregister = bpy.utils.register_classes_factory(
    (SCFPF_OT_video_projector_picture, SCFPF_OT_content_mesh_export)
)
