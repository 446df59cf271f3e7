# SPDX-License-Identifier: GPL-3.0-or-later
"""Make a flexible camera with a measured lens, from a calibration file or from numbers."""

import pathlib

import bpy
import numpy as np
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    StringProperty,
)
from mathutils import Matrix

from ...scfpf_addon.bridge.blender.all_or_nothing import keep
from ...scfpf_addon.bridge.camera.calibrated_camera import (
    frame_size,
    set_image_size,
    volume_from_lens,
    write_lens_maps,
)
from ...scfpf_addon.bridge.render.image_size import image_aspect, image_size, require_size
from ...scfpf_addon.projection.calibration.calibration import MOST_OVERSCAN, Calibration, framed
from ...scfpf_addon.projection.calibration.lens_files import Wanted, read_calibration
from ...scfpf_addon.projection.calibration.lens_numbers import MOST_PIXELS, fisheye_lens, opencv_lens
from ...scfpf_addon.projection.user_error import UserError
from ..common.scene_box import scene_boxes
from ..common.target import active_object, poll_object_mode, poll_scene
from ..common.tool import Action, select_only, show_in_local_view, wholly_made
from ..common.words import report_text, translated_report
from .camera import EMPTY_SCENE
from .camera_placement import camera_like_view, camera_seeing

MODELS = (
    ("AUTO", "From File", "The model that the file names, else OpenCV's"),
    ("OPENCV", "OpenCV", "A lens with radial and tangential distortion, as cv2.projectPoints has it"),
    ("FISHEYE", "OpenCV Fisheye", "The fisheye of Kannala and Brandt, as cv2.fisheye has it"),
)
SOURCES = (
    ("FILE", "File", "Read a file of OpenCV, ROS, OCamCalib or COLMAP"),
    ("NUMBERS", "Numbers", "Type the numbers of OpenCV's lens or fisheye"),
)
ST_MAPS = (
    ("NONE", "None", "Write no ST map"),
    ("UNDISTORT", "Undistort", "Write the ST map that undistorts a picture of the lens"),
    ("BOTH", "Both", "Write also the ST map that distorts an undistorted picture"),
)
SIZE_SETTINGS = (
    "resolution_x",
    "resolution_y",
    "resolution_percentage",
    "pixel_aspect_x",
    "pixel_aspect_y",
)
# What the dialog asks for: of each lens, of a fisheye's or another one's distortion, and seldom.
PINHOLE = ("width", "height", "fx", "fy", "cx", "cy", "skew")
SELDOM = ("prism", "tilt")
# A fisheye has so many radial coefficients, another lens six.
FISHEYE_RADIAL, RADIAL = 4, 6


class SCFPF_OT_camera_from_calibration(Action, bpy.types.Operator):
    """Add a flexible camera whose picture has the lens of a measured camera, from a file of OpenCV,
    OCamCalib or COLMAP"""

    bl_idname = "scfpf.camera_from_calibration"
    bl_label = "Flexible Camera from Calibration"

    source: EnumProperty(name="Source", description="Origin of the lens's numbers", items=SOURCES)
    filepath: StringProperty(
        name="File",
        description="The calibration file: OpenCV's YAML, XML or JSON, OCamCalib's calib_results.txt, "
        "COLMAP's cameras.txt or images.txt",
        subtype="FILE_PATH",
    )
    filter_glob: StringProperty(default="*.yml;*.yaml;*.xml;*.json;*.txt", options={"HIDDEN"})
    model: EnumProperty(name="Lens Model", description="The model that the numbers belong to", items=MODELS)
    image: StringProperty(
        name="Picture", description="Name of a picture in COLMAP's images.txt; empty takes the first"
    )
    width: IntProperty(
        name="Width",
        description="Width of the lens's picture in pixels; 0 takes the scene's resolution",
        default=0,
        min=0,
        max=MOST_PIXELS,
    )
    height: IntProperty(
        name="Height",
        description="Height of the lens's picture in pixels; 0 takes the scene's resolution",
        default=0,
        min=0,
        max=MOST_PIXELS,
    )
    fx: FloatProperty(
        name="Focal Length X", description="OpenCV's fx: the focal length in pixels", default=1000.0, min=1e-3
    )
    fy: FloatProperty(
        name="Focal Length Y",
        description="OpenCV's fy: the focal length in heights of a pixel; 0 takes that across",
        default=0.0,
        min=0.0,
    )
    cx: FloatProperty(
        name="Center X",
        description="OpenCV's cx: pixels from the first pixel's center; below 0 the middle",
        default=-1.0,
    )
    cy: FloatProperty(
        name="Center Y",
        description="OpenCV's cy: pixels down from the first pixel's center; below 0 the middle",
        default=-1.0,
    )
    skew: FloatProperty(name="Skew", description="The skew of the camera matrix in pixels", default=0.0)
    radial: FloatVectorProperty(
        name="K1 to K6",
        description="Radial coefficients k1 to k6; a fisheye has k1 to k4",
        size=6,
        default=(0.0,) * 6,
        precision=6,
    )
    tangential: FloatVectorProperty(
        name="P1, P2", description="Tangential coefficients", size=2, default=(0.0,) * 2, precision=6
    )
    prism: FloatVectorProperty(
        name="S1 to S4", description="Coefficients of a thin prism", size=4, default=(0.0,) * 4, precision=6
    )
    tilt: FloatVectorProperty(
        name="Tilt",
        description="Tilt of the sensor about its two axes",
        size=2,
        default=(0.0,) * 2,
        subtype="EULER",
    )
    set_size: BoolProperty(
        name="Set Resolution",
        description="Give the scene the resolution of the lens's picture, and its pixel aspect",
        default=True,
    )
    overscan: FloatProperty(
        name="Overscan",
        description="Size of the undistorted picture as a multiple of the lens's; 0 takes what is needed",
        default=0.0,
        min=0.0,
        max=MOST_OVERSCAN,
    )
    st_maps: EnumProperty(
        name="ST Maps", description="Images for compositing programs", items=ST_MAPS, default="UNDISTORT"
    )

    @classmethod
    def poll(cls, context):
        return poll_scene(cls, context) and poll_object_mode(cls, context)

    def invoke(self, context, _event):
        if self.source == "FILE":
            context.window_manager.fileselect_add(self)
            return {"RUNNING_MODAL"}
        if self.model == "AUTO":
            self.model = "OPENCV"  # there is no file that names one
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "model")
        if self.source == "FILE":
            layout.prop(self, "image")
        else:
            self._draw_numbers(layout)
        for name in ("set_size", "overscan", "st_maps"):
            layout.prop(self, name)

    def _draw_numbers(self, layout):
        """Draw the numbers that the lens model has; those of rare lenses are closed at first."""
        for name in PINHOLE:
            layout.prop(self, name)
        is_fisheye = self.model == "FISHEYE"
        column = layout.column(align=True)
        for index in range(FISHEYE_RADIAL if is_fisheye else RADIAL):
            column.prop(self, "radial", index=index, text=f"K{index + 1}")
        if is_fisheye:
            return
        column = layout.column(align=True)
        for index in range(2):
            column.prop(self, "tangential", index=index, text=f"P{index + 1}")
        header, body = layout.panel("scfpf_calibration_seldom", default_closed=True)
        header.label(text="Prism and Tilt")
        for name in SELDOM if body is not None else ():
            body.prop(self, name)

    def act(self, context):
        scene = context.scene
        given = self._calibration(scene)
        lens, overscan = framed(given.lens, self.overscan)
        if self.st_maps != "NONE":
            require_size(*frame_size(lens, overscan))
        if self.st_maps == "BOTH":
            require_size(*(round(side) for side in lens.size))
        boxes = scene_boxes(context) or EMPTY_SCENE
        aspect = image_aspect(scene)
        with wholly_made(context):
            render = scene.render
            if self.set_size:
                keep(render, *SIZE_SETTINGS)
                set_image_size(render, lens)
            matrix = _place(context, given, boxes, aspect)
            camera = bpy.data.objects.new(given.name, bpy.data.cameras.new(given.name))
            camera.matrix_world = matrix
            holder = context.collection if context.collection.is_editable else scene.collection
            holder.objects.link(camera)
            context.view_layer.update()
            reach = np.linalg.norm(boxes.whole.corners - np.array(matrix.translation), axis=1).max()
            volume_from_lens(camera, lens, float(reach), context.evaluated_depsgraph_get)
            if self.st_maps != "NONE":
                depsgraph = context.evaluated_depsgraph_get()
                warning = write_lens_maps(camera, lens, depsgraph, overscan, self.st_maps == "BOTH")
                if warning:
                    self.report({"WARNING"}, translated_report(warning))
            select_only(context, camera)
            show_in_local_view(context, [camera, *(slot.object for slot in camera.scfpf.surfaces)])
            if scene.camera is None:
                scene.camera = camera
        if given.unknown_size:
            self.report({"WARNING"}, report_text("The file has no picture size: that of the scene was taken"))
        width, height = (round(side) for side in lens.size)
        return report_text(
            "'{0}' sees {1} × {2} pixels; the undistorted picture has {3} × {4}",
            camera.name,
            width,
            height,
            *frame_size(lens, overscan),
        )

    def _calibration(self, scene) -> Calibration:
        """The camera of the file or of the numbers. Raises UserError."""
        width, height = image_size(scene)
        size = float(self.width or width), float(self.height or height)
        if self.source == "FILE":
            if not self.filepath:
                raise UserError("Choose a calibration file")
            path = pathlib.Path(bpy.path.abspath(self.filepath))
            return read_calibration(path, Wanted(self.model, self.image, size))
        cx = self.cx if self.cx >= 0 else (size[0] - 1) / 2
        cy = self.cy if self.cy >= 0 else (size[1] - 1) / 2
        matrix = np.array([[self.fx, self.skew, cx], [0.0, self.fy or self.fx, cy], [0.0, 0.0, 1.0]])
        k1, k2, k3, k4, k5, k6 = self.radial
        if self.model == "FISHEYE":
            return Calibration("Fisheye Camera", fisheye_lens(matrix, (k1, k2, k3, k4), size))
        numbers = k1, k2, *self.tangential, k3, k4, k5, k6, *self.prism, *self.tilt
        return Calibration("Calibrated Camera", opencv_lens(matrix, numbers, size))


def _place(context, given: Calibration, boxes, aspect: float) -> Matrix:
    """The new camera's place: that in the file, else the active camera's, else the viewport's view."""
    if given.pose is not None:
        return Matrix(given.pose.tolist())
    active = active_object(context)
    if active is not None and active.type == "CAMERA":
        return active.matrix_world.normalized()
    data, matrix = camera_like_view(context, aspect) or camera_seeing(boxes.things, aspect)
    bpy.data.cameras.remove(data)
    return Matrix(matrix).normalized()


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_camera_from_calibration,))
