# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene with things for layers, and pictures of them by Cycles: the button's, and F12's of some things."""

import bpy
import numpy as np
from engine_images import f12
from mathutils import Matrix, Vector
from rig_scenes import keep_groups

WIDTH, HEIGHT = 48, 32
# Marks a flexible camera whose volume is its own frustum, which F12 shows without a rig.
OWN = "own frustum"


def looking(place, at=(0, 0, 0)):
    way = Vector(at) - Vector(place)
    return Matrix.Translation(place) @ way.to_track_quat("-Z", "Y").to_matrix().to_4x4()


def new_camera(name, matrix):
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    bpy.context.scene.collection.objects.link(camera)
    camera.matrix_world, camera.data.clip_end = matrix, 60.0
    return camera


def flexible(camera, preset="perspective"):
    master = bpy.context.scene.camera
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.preset_apply(preset=preset) == {"FINISHED"}
    camera.pop(OWN, None)
    bpy.context.scene.camera = master


def select_only(camera):
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    camera.select_set(True)
    bpy.context.view_layer.objects.active = camera


def collected(name, *objects):
    made = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(made)
    for each in objects:
        made.objects.link(bpy.data.objects[each])


def add(front="DEPTH", collection="Things", seen_by="Side"):
    bpy.context.view_layer.objects.active = bpy.data.objects["Master"]
    given = {"camera": "Master", "collection": collection, "seen_by": seen_by, "front": front}
    assert bpy.ops.scfpf.layer_add(**given) == {"FINISHED"}
    return bpy.data.objects["Master"].scfpf.layers[-1]


def result():
    image = bpy.data.images["SCFPF Render"]
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)


def layered(**options):
    """The picture of the button, (H, W, 4)."""
    assert bpy.ops.scfpf.layers_render(camera="Master", **options) == {"FINISHED"}
    return result()


def things(scene):
    return [obj for obj in scene.objects if obj.type == "MESH" and obj.scfpf_surface.kind == "NONE"]


def alone(scene, names, camera="Master", transparent=False):
    """The image by Blender's F12 and Cycles of some objects; others are not seen, but cast shadows."""
    return passes_alone(scene, names, camera, transparent)["ViewLayer.Combined"]


def passes_alone(scene, names, camera, transparent):
    """The passes of ``alone``."""
    seer, before = bpy.data.objects[camera], (scene.camera, scene.render.engine)
    bpy.context.view_layer.objects.active = seer
    for obj in things(scene):
        obj.visible_camera = obj.name in names
    has_rig = seer.scfpf.enabled and OWN not in seer
    if has_rig:
        assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
    else:
        scene.camera, scene.render.engine = seer, "CYCLES"
    scene.render.film_transparent = transparent
    image = f12(scene)
    scene.render.film_transparent = False
    if has_rig:
        assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
    scene.camera, scene.render.engine = before
    for obj in things(scene):
        obj.visible_camera = True
    return image


def fill(engine_scene):
    """A cube on a floor before a second one, seen by a flexible camera."""
    bpy.data.objects["Cube"].name = "Thing"
    collected("Things", "Thing")
    bpy.ops.mesh.primitive_cube_add(location=(1.5, 3.0, 0.5), size=3.0)
    bpy.context.object.name = "Wall"
    bpy.ops.mesh.primitive_plane_add(location=(0, 0, -1), size=30)
    bpy.context.object.name = "Floor"
    engine_scene.render.resolution_x, engine_scene.render.resolution_y = WIDTH, HEIGHT
    camera = engine_scene.camera
    camera.name = "Master"
    camera.matrix_world = looking((0, -9, 2))
    select_only(camera)
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    camera[OWN] = True
    cycles = engine_scene.cycles
    cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling, cycles.seed = 16, False, False, 7
    keep_groups()
