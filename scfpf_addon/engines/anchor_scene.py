# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene in which anchors are rendered: a linked copy of the artist's, removed afterwards.

It shares objects, world and collections with the scene, which itself stays as it is.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress

import bpy
from mathutils import Matrix

from ..anchors.anchor import Anchor
from ..bridge.blender import versions
from ..bridge.blender.all_or_nothing import all_or_nothing
from ..bridge.blender.rig_mark import PASSING_KEY
from ..bridge.blender.scene_objects import object_by_uid
from ..bridge.blender.versions import image_format_properties
from ..bridge.camera.flexible_camera import control_objects
from ..bridge.scene.read_visibility import rendered_objects
from ..cycles.layers.temporary_scene import FORMAT
from ..cycles.rig_data import CYCLES, rigs
from ..projection.typing import Array
from ..projection.user_error import UserError
from ..shading.typing import Single
from .anchor_passes import AnchorPasses
from .cautions import left_out
from .shared_renders import mapped_to

CAMERA = "SCFPF Anchor"
LOST = "The scene's copy was removed meanwhile: render again"
# The width of the pixel filter: each pixel of an anchor shows one place.
POINT = 0.01
# Engines whose cameras miss things that go on casting shadows.
SHADOW_ENGINES = {CYCLES, versions.EEVEE}
# What renders show no shape of.
SHAPELESS = {"LIGHT", "CAMERA", "SPEAKER", "LIGHT_PROBE"}
# An engine's camera shows nothing nearer than this.
NEAREST = 1e-6


class AnchorScene:
    """The copy of a scene, with one view layer and a camera. Call ``remove`` in any case.

    It keeps names only, because Blender may free data between two calls. engine: the identifier of the
    render engine. members: the number of the image layer by an object's session id, 0 for others.
    instancers: session ids of the objects that instance others.
    """

    def __init__(self, scene, view_layer, engine: str = "") -> None:
        """engine: the identifier of a render engine, empty for the scene's own."""
        self.members: Mapping[int, int] = {}
        self.instancers: Collection[int] = ()
        with all_or_nothing() as kept:
            copy = scene.copy()
            self.name, self._folder = copy.name, tempfile.mkdtemp(prefix="scfpf-")
            self._kept = 0
            kept.callback(shutil.rmtree, self._folder, ignore_errors=True)
            self._prepare(copy, view_layer, engine or scene.render.engine)

    def _prepare(self, copy, view_layer, engine: str) -> None:
        copy[PASSING_KEY] = True
        layer = copy.view_layers[view_layer.name]
        for other in copy.view_layers[:]:
            if other != layer:
                copy.view_layers.remove(other)
        for collection in copy.collection.children[:]:
            if collection in rigs():
                copy.collection.children.unlink(collection)
        camera = bpy.data.objects.new(CAMERA, bpy.data.cameras.new(CAMERA))
        copy.collection.objects.link(camera)
        copy.camera, self._camera = camera, camera.name
        layer.use = True
        render, self.engine = copy.render, engine
        try:
            render.engine = engine
        except TypeError as error:
            raise UserError("There is no render engine '{0}': choose another", engine) from error
        self.left_out = left_out(copy)
        self.passes, self._has_strokes = AnchorPasses(layer), layer.use_grease_pencil
        # The names of passes in files end at dots.
        layer.name = layer.name.replace(".", "_")
        render.use_multiview = render.use_sequencer = render.use_compositing = False
        render.use_freestyle = render.use_file_extension = False
        render.use_border = False
        # In a window: edits between two renders would be seen in one of them only.
        render.use_lock_interface = True
        copy.timeline_markers.clear()
        settings = render.image_settings
        for name in image_format_properties():
            setattr(settings, name, FORMAT[name])
        settings.exr_codec, settings.color_management = "NONE", "FOLLOW_SCENE"
        render.filepath = self.path

    @property
    def scene(self):
        """The copy; None if it has been removed meanwhile, as by undo."""
        return bpy.data.scenes.get((self.name, None))

    def _present(self):
        """The copy. Raises UserError if it has been removed."""
        if self.scene is None or self.scene.camera is None:
            raise UserError(LOST)
        return self.scene

    @property
    def path(self) -> str:
        """The file that renders are written to."""
        return os.path.join(self._folder, "anchor.exr")

    def look_through(self, anchor: Anchor) -> None:
        """Let the next render be that of an anchor, into a file that does not exist yet."""
        with suppress(FileNotFoundError):
            os.remove(self.path)
        scene = self._present()
        camera, lens = scene.camera, scene.camera.data
        camera.matrix_world = Matrix(anchor.matrix.tolist())
        width = anchor.window.extent[0]
        lens.sensor_fit = "HORIZONTAL"
        if anchor.is_parallel:
            lens.type, lens.ortho_scale = "ORTHO", float(width)
        else:
            lens.type, lens.lens_unit, lens.sensor_width = "PERSP", "MILLIMETERS", 36.0
            lens.lens = 36.0 / float(width)
        lens.shift_x = 0.5 * (anchor.window.left + anchor.window.right) / float(width)
        lens.shift_y = 0.5 * (anchor.window.bottom + anchor.window.top) / float(width)
        lens.clip_start, lens.clip_end = max(anchor.start, NEAREST), anchor.end
        render = scene.render
        render.resolution_percentage, render.pixel_aspect_x, render.pixel_aspect_y = 100, 1.0, 1.0
        render.resolution_x, render.resolution_y = anchor.size
        render.use_motion_blur = False
        render.filter_size, scene.display.render_aa = POINT, "OFF"
        strokes = scene.grease_pencil_settings
        strokes.antialias_threshold_render, strokes.aa_samples = 0.0, 1
        if hasattr(scene, "cycles"):
            scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", POINT

    @contextmanager
    def showing(self, number: int, with_rest: bool = False) -> Iterator[None]:
        """Let renders show the things of an image layer alone, or those in none for 0.

        with_rest: those in none as well. Other things go on casting shadows, if the engine knows such. What
        no image shows, such as control surfaces, is absent. The artist's objects are as before afterwards.
        """
        scene = self._present()
        before: list[tuple[int, str, bool]] = []
        hides = "visible_camera" if scene.render.engine in SHADOW_ENGINES else "hide_render"
        absent, shown = control_objects(), {number, *([0] if with_rest else [])}
        for obj in rendered_objects(scene.view_layers[0]):
            if obj.hide_render:
                # What instances show of it follows its other settings.
                continue
            name = hides
            if obj.name_full in absent:
                name = "hide_render"
            elif not self.members or obj.type in SHAPELESS or self.members.get(obj.session_uid, 0) in shown:
                continue
            elif obj.session_uid in self.instancers and scene.render.engine != CYCLES:
                # EEVEE's cameras see the instances of an object that they miss.
                name = "hide_render"
            wanted = name == "hide_render"
            if getattr(obj, name) != wanted:
                before.append((obj.session_uid, name, not wanted))
                setattr(obj, name, wanted)
        is_transparent = scene.render.film_transparent
        scene.render.film_transparent = is_transparent or number > 0
        del scene
        try:
            yield
        finally:
            for uid, name, value in before:
                if (obj := object_by_uid(uid)) is not None:
                    setattr(obj, name, value)
            if self.scene is not None:
                self.scene.render.film_transparent = is_transparent

    def show_faceless(self, strokes: bool) -> None:
        """Let renders have depths. strokes: whether they show Grease Pencil, if the artist's picture does."""
        layer = self._present().view_layers[0]
        layer.use_pass_z, layer.use_grease_pencil = True, strokes and self._has_strokes

    @property
    def shows_strokes(self) -> bool:
        """Whether renders show Grease Pencil."""
        return self._present().view_layers[0].use_grease_pencil

    def kept(self, values: Single) -> Single:
        """Move values into a file."""
        self._kept += 1
        return mapped_to(os.path.join(self._folder, f"kept{self._kept}"), values)

    def look_as(self, camera) -> None:
        """Let the next render be the ordinary one of a camera."""
        self._present().camera = camera

    def look_as_eye(self, camera, place: Array, shift: float) -> None:
        """Let the next render be that of an ordinary camera at a place (4, 4) with the lens of a camera.

        shift: what is added to its horizontal shift.
        """
        own = self._present().camera
        before, own.data = own.data, camera.data.copy()
        bpy.data.cameras.remove(before)
        own.data.animation_data_clear()
        own.data.shift_x += shift
        # It moves with the camera while the shutter is open.
        own.parent, own.matrix_basis = camera, Matrix()
        own.matrix_parent_inverse = camera.matrix_world.inverted_safe() @ Matrix(place.tolist())

    def leave_out_sky(self) -> None:
        """Let renders be clear where they show nothing."""
        self._present().render.film_transparent = True

    def show_world_alone(self) -> None:
        """Leave all things out of further renders."""
        scene = self._present()
        for child in scene.view_layers[0].layer_collection.children:
            child.exclude = True
        for obj in scene.collection.objects[:]:
            if obj.name != self._camera:
                scene.collection.objects.unlink(obj)

    def remove(self) -> None:
        """Remove the copy, its camera and its files."""
        scene, camera = self.scene, bpy.data.objects.get((self._camera, None))
        if scene is not None:
            # Cycles frees the data that it has kept for further renders.
            scene.render.use_persistent_data = False
            bpy.data.scenes.remove(scene)
        if camera is not None:
            bpy.data.cameras.remove(camera.data)
        shutil.rmtree(self._folder, ignore_errors=True)
