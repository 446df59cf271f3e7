# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures, mirrors and glass in Rendered shading, following edits."""

import bpy
import numpy as np
from driver import DRAW
from scenarios_engine import painted, prepare, show


def textured_floor():
    """The factory floor with an image of stripes."""
    image = bpy.data.images.new("Stripes", 64, 64)
    pixels = np.ones((64, 64, 4), np.float32)
    pixels[:, ::8, :2] = pixels[::8, :, 1:3] = 0.1
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    material = bpy.data.materials.new("Floor")
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    texture, mapping = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeMapping")
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    texture.image = image
    mapping.inputs["Scale"].default_value = (8, 8, 8)
    tree.links.new(coordinates.outputs["UV"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    bpy.data.objects["Plane"].data.materials.append(material)
    return image, shader


def principled(name, **values):
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    for key, value in values.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    return material


def textured(driver):
    """An image on the floor, a mirror and glass; the image is painted on, the floor is polished."""
    prepare(driver, "perspective")
    image, floor = textured_floor()
    cube = bpy.data.objects["Cube"].data.materials
    cube.clear()
    cube.append(principled("Mirror", Metallic=1.0, Roughness=0.02))
    for name, material in (
        ("Suzanne.001", principled("Glass", Transmission_Weight=1.0, Roughness=0.0)),
        ("Suzanne.002", principled("Veil", Alpha=0.4)),
    ):
        bpy.data.objects[name].data.materials.clear()
        bpy.data.objects[name].data.materials.append(material)
    show(driver, "RENDER")
    space = driver.area("VIEW_3D").spaces.active
    space.overlay.show_overlays = False
    space.region_3d.view_perspective = "CAMERA"
    space.shading.type = "RENDERED"
    yield from painted()
    driver.shot("textured")
    before = driver.region_pixels()
    image.pixels.foreach_set(np.tile(np.array([0.1, 0.2, 1.0, 1.0], np.float32), 64 * 64))
    image.update()
    floor.inputs["Roughness"].default_value = 0.05
    yield from painted()
    driver.shot("painted")
    assert (driver.region_pixels() != before).any(axis=2).mean() > 0.05, "a painted image is not shown"
    yield DRAW


SCENARIOS = (textured,)
