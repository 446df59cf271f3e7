# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures in which each pixel has a time of its own: slit scans, rolling shutters, painted times."""

import math

import bpy
import numpy as np
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty

from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid, scene_by_uid
from ...scfpf_addon.bridge.render.image_size import image_size
from ...scfpf_addon.bridge.render.render_inputs import read_inputs, synced_image_size
from ...scfpf_addon.bridge.scene.render_depsgraph import with_render_depsgraph
from ...scfpf_addon.projection.user_error import UserError
from ...scfpf_addon.shading.time_map import IMAGE, ROLLING, SLIT, shares_of_time, time_steps
from ..common.target import flexible_camera_of
from ..common.tool import Action
from .image_editors import image_editors
from .render_series import RenderSeries

ASSEMBLED = "Assembled Frames"
WAYS = (
    (ROLLING, "Rolling Shutter", "Rows are taken one after the other, from the top"),
    (SLIT, "Slit Scan", "Columns are taken one after the other, from the left"),
    (IMAGE, "Image", "An image says when: black is the present frame, white the end of the time"),
)


class OfTime:
    """Operators whose pictures have a time for each pixel."""

    way: EnumProperty(
        name="Time", description="How time goes through the picture", items=WAYS, default=ROLLING
    )
    span: FloatProperty(
        name="Frames",
        description="How many frames the time lasts from the present one on, below 0 back from it",
        default=12.0,
        min=-1e6,
        max=1e6,
        soft_min=-250.0,
        soft_max=250.0,
    )
    image: StringProperty(name="Image", description="Name of the image whose first channel says when")

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        for name in ("way", "span", "steps"):
            if hasattr(self, name):
                layout.prop(self, name)
        if self.way == IMAGE:
            layout.prop_search(self, "image", bpy.data, "images")

    def shares(self, size):
        """The share of the time of each pixel, (H, W). Raises UserError."""
        painted = None
        if self.way == IMAGE:
            image = bpy.data.images.get(self.image)
            if image is None or not image.has_data or 0 in image.size:
                raise UserError("Choose an image that says when each pixel is taken")
            painted = _pixels(image)[..., 0]
        return shares_of_time(self.way, size, painted)


class SCFPF_OT_time_render(OfTime, RenderSeries, bpy.types.Operator):
    """Render a picture in which each pixel has its own time: what moves is skewed or bent, camera and volume,
    too"""

    bl_idname = "scfpf.time_render"
    bl_label = "Render over Time"
    bl_options = {"REGISTER"}

    steps: IntProperty(
        name="Steps",
        description="Looks at the scene; as many as rows or columns are smoothest, and take longest",
        default=64,
        min=1,
        max=16384,
        soft_max=2160,
    )

    def plan(self, context):
        camera = flexible_camera_of(context)
        self._scene, self._layer = context.scene.session_uid, context.view_layer.name
        # The artist may go to another frame meanwhile.
        self._first = context.scene.frame_current_final
        size = synced_image_size(context.scene, camera)
        self._steps = time_steps(self.shares(size), self.steps)
        if context.scene.render.use_motion_blur:
            self.report({"WARNING"}, "Motion blur is left out of pictures over time")
        return len(self._steps), size

    def parts(self, _context):
        for step in self._steps:
            camera, scene = object_by_uid(self._camera), scene_by_uid(self._scene)
            layer = None if scene is None else scene.view_layers.get(self._layer)
            if camera is None or layer is None:
                raise UserError("The camera was deleted meanwhile")
            own = scene.frame_current_final
            time = self._first + self.span * step.share

            def read(depsgraph, set_frame, camera=camera, own=own, time=time, border=step.border):
                set_frame(math.floor(time), subframe=time - math.floor(time))
                try:
                    size = image_size(depsgraph.scene)
                    return read_inputs(depsgraph, camera, size, border=border, may_be_empty=True)
                finally:
                    set_frame(math.floor(own), subframe=own - math.floor(own))

            yield with_render_depsgraph(scene, layer, read, with_time=True)

    def paste(self, number, pixels):
        border, shown = self._steps[number].border, self._steps[number].shown
        self.picture[border.bottom : border.top, border.left : border.right][shown] = pixels[shown]


class SCFPF_OT_time_assemble(OfTime, Action, bpy.types.Operator):
    """Make a picture in which each pixel has its own time from the frames of an animation that any engine has
    rendered to the scene's output path"""

    bl_idname = "scfpf.time_assemble"
    bl_label = "Assemble from Frames"

    def invoke(self, context, _event):
        return context.window_manager.invoke_props_dialog(self)

    def act(self, context):
        scene = context.scene
        first = scene.frame_current
        count = max(1, round(abs(self.span)))
        step = int(math.copysign(1, self.span))
        picture = None
        loaded = []
        try:
            for number in range(count):
                path = scene.render.frame_path(frame=first + step * number)
                try:
                    source = bpy.data.images.load(path, check_existing=False)
                except RuntimeError as error:
                    raise UserError("There is no frame {0}: render the animation first", path) from error
                loaded.append(source)
                pixels = _pixels(source)
                if picture is None:
                    height, width = pixels.shape[:2]
                    numbers = np.minimum((self.shares((width, height)) * count).astype(int), count - 1)
                    picture = np.zeros_like(pixels)
                    is_float, space = source.is_float, source.colorspace_settings.name
                elif pixels.shape != picture.shape:
                    raise UserError("The frame {0} has another size than the first one", path)
                here = numbers == number
                picture[here] = pixels[here]
                bpy.data.images.remove(loaded.pop())
        finally:
            for source in loaded:
                bpy.data.images.remove(source)
        made = bpy.data.images.new(ASSEMBLED, width, height, alpha=True, float_buffer=is_float)
        made.colorspace_settings.name = space
        made.pixels.foreach_set(picture.ravel())
        made.update()
        made.pack()
        for space in image_editors(context.window_manager)[:1]:
            space.image = made
        return made.name


def _pixels(image):
    """The pixels of an image, (H, W, 4) float32, row 0 at the bottom."""
    width, height = image.size
    values = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(values)
    values = values.reshape(height, width, image.channels)
    if image.channels == 4:
        return values
    wide = np.ones((height, width, 4), np.float32)
    wide[..., : min(image.channels, 3)] = values[..., :3]
    if image.channels == 1:
        wide[..., :3] = values
    return wide


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_time_render, SCFPF_OT_time_assemble))
