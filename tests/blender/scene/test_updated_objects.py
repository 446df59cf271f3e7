# SPDX-License-Identifier: GPL-3.0-or-later
"""The originals of what Blender's updates name, some of which a handler has removed since."""

import bpy
import pytest


@pytest.mark.parametrize("removes", [False, True])
def test_what_is_gone_is_not_among_the_originals(addon, removes):
    originals = addon("bridge.blender.scene_objects").originals
    bpy.ops.mesh.primitive_cube_add()
    kept = bpy.context.object
    bpy.ops.mesh.primitive_plane_add()
    gone = bpy.context.object
    material = bpy.data.materials.new("Nodes")
    kept.data.materials.append(material)
    bpy.context.view_layer.update()
    found = []

    def look(_scene, depsgraph):
        if removes:
            mesh = gone.data
            bpy.data.objects.remove(gone)
            bpy.data.meshes.remove(mesh)
        found.extend(each.name for each in originals(update.id for update in depsgraph.updates))

    names = gone.name, gone.data.name
    for each in (kept, gone, kept.data, gone.data, material):
        each.update_tag()
    bpy.app.handlers.depsgraph_update_post.insert(0, look)
    try:
        bpy.context.view_layer.update()
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(look)
    assert {kept.name, kept.data.name, material.name} <= set(found)
    assert {name in found for name in names} == {not removes}
