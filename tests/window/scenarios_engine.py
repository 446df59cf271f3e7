# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine in a window: F12, cancelled renders, an animation, panels, Rendered shading, textures."""

import sys
import time

import bpy
import numpy as np
from driver import DRAW, PATIENCE, build_scene

# Seconds from Esc to the end of the job: 0.5 with the machine to itself, which tests have not.
ESC_SECONDS = 2.0
# The cross beside the progress bar: pixels to the right of the window's middle, and from below.
CROSS = (118, 11)


def prepare(driver, preset="nonlinear_twist"):
    """A scene for the engine, whose result is shown in the 3D viewport's place."""
    build_scene()
    driver.add_camera(preset)
    bpy.context.scene.render.engine = "SCFPF"
    bpy.context.preferences.view.render_display_type = "AREA"


def running():
    return bpy.app.is_job_running("RENDER")


def ended(job_name="render"):
    """Generator: wait for the render job."""
    end = time.monotonic() + PATIENCE
    while running():
        assert time.monotonic() < end, f"the {job_name} does not end"
        yield 0.05
    yield DRAW


def show(driver, tab):
    driver.area("PROPERTIES").spaces.active.context = tab


def f12(driver):
    """F12: progress, tiles, the picture; the panels of the engine beside it."""
    prepare(driver)
    scene = bpy.context.scene
    view_layer = scene.view_layers[0]
    view_layer.use_pass_z = view_layer.scfpf.use_pass_parameters = True
    scene.camera.scfpf.samples = 3
    show(driver, "RENDER")
    yield DRAW
    driver.key("F12")
    end = time.monotonic() + PATIENCE
    while not running():
        assert time.monotonic() < end, "F12 renders nothing"
        yield 0.05
    yield 1.0
    driver.shot("progress")
    yield from ended()
    driver.shot("done")
    assert driver.region_pixels("IMAGE_EDITOR").std() > 10, "the Image Editor shows nothing"
    for tab in ("OUTPUT", "VIEW_LAYER", "WORLD"):
        show(driver, tab)
        yield DRAW
        driver.shot(f"tab-{tab.lower()}")


def cancelled(driver):
    """The cross beside the progress bar ends the job like Esc, and F12 works again.

    Blender notes an Esc where real keys come in, which it does not look at while events are simulated.
    """
    prepare(driver)
    scene = bpy.context.scene
    scene.camera.scfpf.samples = 256
    driver.key("F12")
    end = time.monotonic() + PATIENCE
    while not running():
        assert time.monotonic() < end, "F12 renders nothing"
        yield 0.05
    yield 2.0
    assert running(), "the render is too quick to be cancelled"
    driver.shot("rendering")
    cross = {"x": driver.window.width // 2 + CROSS[0], "y": CROSS[1]}
    for kind, value in (("MOUSEMOVE", "NOTHING"), ("LEFTMOUSE", "PRESS"), ("LEFTMOUSE", "RELEASE")):
        driver.window.event_simulate(kind, value, **cross)
        yield 0.2
    pressed = time.monotonic()
    while running():
        assert time.monotonic() - pressed < PATIENCE, "the render does not end"
        yield 0.02
    took = time.monotonic() - pressed
    print(f"cancelled in {took:.2f} s", flush=True)
    assert took < ESC_SECONDS, f"that took {took:.2f} s"
    yield DRAW
    driver.shot("cancelled")
    scene.camera.scfpf.samples = 1
    driver.key("F12", "IMAGE_EDITOR")
    yield 0.5
    yield from ended()
    driver.shot("again")
    assert driver.region_pixels("IMAGE_EDITOR").std() > 10, "the Image Editor shows nothing"


def animation(driver):
    """Ctrl-F12 writes every frame while the window lives; a broken volume stops it with a message."""
    prepare(driver)
    scene = bpy.context.scene
    surface = scene.camera.scfpf.surfaces[1].object
    for frame, angle in ((1, 0.0), (3, 0.6)):
        surface.rotation_euler.z = angle
        surface.keyframe_insert("rotation_euler", frame=frame)
    scene.camera.scfpf.samples = 1
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.filepath = str(driver.folder / "frame_")
    driver.key("F12", ctrl=True)
    yield 0.5
    yield from ended("animation")
    made = sorted(driver.folder.glob("frame_*.png"))
    assert len(made) == 3, made
    assert len({path.read_bytes() for path in made}) == 3, "frames are equal"
    driver.shot("done")
    for path in made:
        path.unlink()
    scene.camera.scfpf.surfaces.clear()
    driver.key("F12", "IMAGE_EDITOR", ctrl=True)
    yield 0.5
    yield from ended("animation")
    driver.shot("refused")
    left = sorted(driver.folder.glob("frame_*.png"))
    assert not left, f"the animation went on after a failure: {left}"


def blurred(driver):
    """F12 reads other times while the window lives: motion blur, adaptive samples, vectors, cryptomattes."""
    prepare(driver)
    scene = bpy.context.scene
    surface = scene.camera.scfpf.surfaces[1].object
    for frame, angle in ((0, -0.5), (2, 0.5)):
        surface.rotation_euler.z = angle
        surface.keyframe_insert("rotation_euler", frame=frame)
    cube = bpy.data.objects["Cube"]
    for frame, x in ((0, -1.0), (2, 1.0)):
        cube.location.x = x
        cube.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    scene.camera.scfpf.samples, scene.render.resolution_percentage = 8, 6
    scene.render.use_motion_blur = scene.scfpf_sampling.use_adaptive = True
    view_layer = scene.view_layers[0]
    view_layer.use_pass_vector = view_layer.use_pass_cryptomatte_object = True
    view_layer.scfpf.use_pass_chord_count = True
    show(driver, "RENDER")
    yield DRAW
    driver.key("F12")
    yield 0.5
    yield from ended()
    driver.shot("done")
    shown = driver.region_pixels("IMAGE_EDITOR")
    y, x = shown.shape[0] // 2, shown.shape[1] // 2
    # The picture is small, and in the middle.
    assert shown[y - 30 : y + 30, x - 60 : x + 60].std() > 10, "the Image Editor shows nothing"
    assert scene.frame_current == 1 and abs(cube.location.x) < 1e-6, "the frame is another"
    show(driver, "VIEW_LAYER")
    yield DRAW
    driver.shot("passes")
    # What comes after looks for it.
    driver.area("IMAGE_EDITOR").type = "VIEW_3D"


def painted():
    """Generator: wait until every viewport shows its image."""
    module = next(name for name in sys.modules if name.endswith("scfpf_addon.bridge.render.render_viewport"))
    yield DRAW
    end = time.monotonic() + PATIENCE
    while sys.modules[module].is_painting():
        assert time.monotonic() < end, "the viewport is not painted"
        yield 0.1
    yield 2 * DRAW


def rendered(driver):
    """Rendered shading: the flexible camera's picture in its frame, refined, following edits and the view."""
    prepare(driver)
    scene = bpy.context.scene
    space = driver.area("VIEW_3D").spaces.active
    space.overlay.show_overlays = False
    space.region_3d.view_perspective = "CAMERA"
    space.shading.type = "RENDERED"
    yield 0.3
    driver.shot("first")
    yield from painted()
    driver.shot("camera")
    through = driver.region_pixels()
    assert through.std() > 10, "nothing is shown"
    bpy.data.objects["Cube"].location.z += 1.0
    yield from painted()
    driver.shot("moved")
    assert (driver.region_pixels() != through).any(axis=2).mean() > 0.005, "an edit is not shown"
    space.overlay.show_overlays = True
    scene.camera.scfpf.surfaces[0].object.scale = (0, 0, 0)
    yield 2 * DRAW
    driver.shot("message")
    scene.camera.scfpf.surfaces[0].object.scale = (1, 1, 1)
    space.overlay.show_overlays = False
    space.region_3d.view_perspective = "PERSP"
    yield from painted()
    driver.shot("free")
    assert driver.region_pixels().std() > 10, "a view that is not a camera's is empty"
    space.shading.type = "SOLID"
    yield DRAW
    driver.shot("solid")


def drawn(driver):
    """Drawn Style: its panel, and the picture in Rendered shading at once."""
    prepare(driver)
    space = driver.area("VIEW_3D").spaces.active
    space.overlay.show_overlays = False
    space.region_3d.view_perspective = "CAMERA"
    space.shading.type = "RENDERED"
    panel = bpy.types.SCFPF_PT_engine_drawn
    bpy.utils.unregister_class(panel)
    # Open, and where it is seen.
    panel.bl_options, panel.bl_order = set(), -1
    bpy.utils.register_class(panel)
    show(driver, "RENDER")
    yield from painted()
    before = driver.region_pixels()
    with driver.override():
        assert bpy.ops.scfpf.drawn_style("INVOKE_DEFAULT", True, style="PAPER") == {"FINISHED"}
    yield from painted()
    driver.shot("panel")
    assert (driver.region_pixels() != before).any(axis=2).mean() > 0.05, "the style is not shown"


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


SCENARIOS = (f12, cancelled, animation, blurred, rendered, drawn, textured)
