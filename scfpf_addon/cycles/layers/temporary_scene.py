# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene in which layers are rendered: a linked copy of the artist's, removed afterwards.

It shares objects, world and collections with the scene, which itself stays as it is. Objects are hidden from
camera rays by collections of the copy, so that they go on casting shadows, light and reflections.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Collection, Iterable, Mapping
from contextlib import contextmanager, suppress

import bpy

from ...bridge.blender.all_or_nothing import all_or_nothing
from ...bridge.blender.rig_mark import PASSING_KEY
from ...bridge.blender.versions import image_format_properties
from ...bridge.scene.read_visibility import rendered_objects
from ...shading.settings.frame_settings import Border
from ..rig_data import CYCLES, rigs
from .layer_passes import SwitchedPasses

# The name of the copy's only view layer, by which its passes are found.
LAYER = "Layers"
# The name of the material of renders of positions.
PLAIN = "SCFPF Positions"
FORMAT = {
    "media_type": "MULTI_LAYER_IMAGE",
    "file_format": "OPEN_EXR_MULTILAYER",
    "color_mode": "RGBA",
    "color_depth": "32",
}
# Places across and up a pixel whose positions are found.
KEY_SIDE = 3
# Settings of Cycles for positions alone, each in the middle of its pixel.
QUICK = {
    "samples": 1,
    "use_adaptive_sampling": False,
    "use_denoising": False,
    "max_bounces": 0,
    # Positions need no light, and its tree takes a fifth of their time.
    "use_light_tree": False,
    "pixel_filter_type": "BLACKMAN_HARRIS",
    "filter_width": 0.01,
    "time_limit": 0.0,
    "sample_offset": 0,
}


class TemporaryScene:
    """The copy of a scene, with one view layer. Call ``remove`` in any case.

    It keeps names only, because Blender may free data between two calls. passes: of the artist's view layer.
    """

    def __init__(self, scene, view_layer) -> None:
        with all_or_nothing() as kept:
            copy = scene.copy()
            self.name, self._folder = copy.name, tempfile.mkdtemp(prefix="scfpf-")
            kept.callback(shutil.rmtree, self._folder, ignore_errors=True)
            self._prepare(copy, view_layer)

    def _prepare(self, copy, view_layer) -> None:
        self._made: list[str] = []
        self._groups: list[str] = []
        self._beyond: dict[frozenset[int], str] = {}
        self._plain = ""
        copy[PASSING_KEY] = True
        layer = copy.view_layers[view_layer.name]
        for other in copy.view_layers[:]:
            if other != layer:
                copy.view_layers.remove(other)
        layer.name = LAYER
        for collection in copy.collection.children[:]:
            if collection in rigs():
                # Rays of a rig that two scenes have skip no chords.
                copy.collection.children.unlink(collection)
        self.passes = SwitchedPasses(layer)
        _settle(copy, layer)
        # One picture takes several renders, of which only the first need send the scene to Cycles. Passes are
        # switched between them, which Blender 4.5 does not survive then.
        copy.render.use_persistent_data = not self.passes.is_any

    @property
    def scene(self):
        """The copy; None if it has been removed meanwhile, as by undo."""
        return bpy.data.scenes.get((self.name, None))

    @property
    def path(self) -> str:
        """The file that renders are written to."""
        return os.path.join(self._folder, "passes.exr")

    def add_groups(self, members: Mapping[int, int], count: int) -> None:
        """Sort the objects that renders show into one collection a layer, from 0 to count - 1.

        members: the number of the layer by an object's session id, 0 for others.
        """
        groups: dict[int, list] = {number: [] for number in range(count)}
        for obj in rendered_objects(self.scene.view_layers[0]):
            groups[members.get(obj.session_uid, 0)].append(obj)
        self._groups = [
            self._add_group(f"SCFPF Layer {number}", objects) for number, objects in groups.items()
        ]

    def _add_group(self, name: str, objects: Iterable) -> str:
        group = bpy.data.collections.new(name)
        self._made.append(group.name)
        self.scene.collection.children.link(group)
        for obj in objects:
            group.objects.link(obj)
        return group.name

    def show(self, numbers: Collection[int], but: Collection[int] = (), held_out: int = -1) -> None:
        """Let camera rays meet only objects of some layers.

        but: session ids of objects that they miss. held_out: the layer whose objects leave holes.
        """
        layer, hidden = self.scene.view_layers[0], frozenset(but)
        if hidden and hidden not in self._beyond:
            objects = [obj for obj in rendered_objects(layer) if obj.session_uid in hidden]
            self._beyond[hidden] = self._add_group("SCFPF Beyond", objects)
        shown = {self._groups[number] for number in numbers}
        shown |= {name for group, name in self._beyond.items() if group != hidden}
        for name in self._made:
            child = layer.layer_collection.children[name]
            child.indirect_only = name not in shown
            child.holdout = held_out >= 0 and name == self._groups[held_out]

    @contextmanager
    def shaped(self, ratio: float):
        """Let the image be ``ratio`` times as wide as it is, undistorted, while a rig is made."""
        render = self.scene.render
        before = render.pixel_aspect_x, render.pixel_aspect_y
        across, up = before[0] * max(ratio, 1.0), before[1] * max(1.0 / ratio, 1.0)
        render.pixel_aspect_x, render.pixel_aspect_y = across, up
        try:
            yield
        finally:
            if self.scene is not None:
                render.pixel_aspect_x, render.pixel_aspect_y = before

    @contextmanager
    def colored(self, window: Border, size: tuple[int, int], is_layer: bool, is_rigged: bool):
        """Render colours and passes of some pixels of an image of a size, those of a layer without the world.

        is_rigged: whether a rig sees them.
        """
        scene = self.scene
        with self._kept((scene.render, "film_transparent")):
            if is_layer:
                scene.render.film_transparent = True
            self._frame(window, size)
            self.passes.switch_on(scene.view_layers[0], is_rigged)
            try:
                yield
            finally:
                if self.scene is not None:
                    self.passes.switch_off(self.scene.view_layers[0])

    @contextmanager
    def located(self, window: Border, size: tuple[int, int], is_plain: bool):
        """Render the positions at KEY_SIDE × KEY_SIDE places of some pixels of an image of a size.

        is_plain: whether materials make no difference to them: computing these would take most of the time.
        """
        scene = self.scene
        layer = scene.view_layers[0]
        places = ((scene.render, name) for name in ("resolution_x", "resolution_y", "resolution_percentage"))
        more = (scene.render, "film_transparent"), (layer, "material_override")
        with self._kept(*more, *places, *((scene.cycles, name) for name in QUICK)):
            scene.render.film_transparent = True
            if is_plain:
                layer.material_override = self._plain_material()
            scene.render.resolution_percentage = 100
            scene.render.resolution_x, scene.render.resolution_y = (n * KEY_SIDE for n in size)
            for name, value in QUICK.items():
                setattr(scene.cycles, name, value)
            self._frame(Border(*(end * KEY_SIDE for end in window)), tuple(n * KEY_SIDE for n in size))
            yield

    def _plain_material(self):
        """An opaque material that takes no light."""
        material = self._plain and bpy.data.materials.get((self._plain, None))
        if not material:
            material = bpy.data.materials.new(PLAIN)
            material.use_nodes = True  # from 5.0 every material has a tree, and the switch is deprecated
            self._plain, tree = material.name, material.node_tree
            tree.nodes.clear()
            glow, output = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Emission", "OutputMaterial"))
            tree.links.new(glow.outputs[0], output.inputs["Surface"])
        return material

    @contextmanager
    def _kept(self, *properties):
        """Restore properties (owner, name) of the copy afterwards, if there still is one."""
        before = [(owner, name, getattr(owner, name)) for owner, name in properties]
        try:
            yield
        finally:
            if self.scene is not None:
                for owner, name, value in before:
                    setattr(owner, name, value)

    def _frame(self, window: Border, size: tuple[int, int]) -> None:
        """Render only some pixels of an image of a size, into a file that does not exist yet."""
        with suppress(FileNotFoundError):
            os.remove(self.path)
        render = self.scene.render
        render.filepath = self.path
        render.use_border = render.use_crop_to_border = True
        # Blender multiplies in float32 and cuts off.
        ends = [min((end + 0.5) / size[axis % 2], 1.0) for axis, end in enumerate(window)]
        render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y = ends

    def remove(self) -> None:
        """Remove the copy, its collections, its material and its files."""
        scene = self.scene
        made = [bpy.data.collections.get((name, None)) for name in self._made]
        if scene is not None:
            # Cycles frees the data that it has kept for further renders.
            scene.render.use_persistent_data = False
            bpy.data.scenes.remove(scene)
        plain = bpy.data.materials.get((self._plain, None)) if self._plain else None
        bpy.data.batch_remove([each for each in (*made, plain) if each is not None])
        shutil.rmtree(self._folder, ignore_errors=True)


def _settle(scene, layer) -> None:
    """Give a copy the settings of a render whose passes are read from a file."""
    render = scene.render
    render.engine = CYCLES
    render.use_multiview = render.use_sequencer = render.use_compositing = False
    render.use_freestyle = render.use_file_extension = False
    # In a window: edits between two renders would be seen in one of them only.
    render.use_lock_interface = True
    scene.timeline_markers.clear()
    settings = render.image_settings
    for name in image_format_properties():
        setattr(settings, name, FORMAT[name])
    settings.exr_codec, settings.color_management = "NONE", "FOLLOW_SCENE"
    layer.use = True
