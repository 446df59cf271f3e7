# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes preview's viewport: its look, what it follows, its end, undo, save and reload."""

import pathlib
import sys
import tempfile
import time
from math import radians

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from driver import DRAW, PATIENCE, build_scene
from mathutils import Matrix

VIEW = "VIEW_3D"
# Long enough for the preview to be computed and drawn by a software renderer.
SETTLE = 2 * DRAW
# Mean difference of equal views, of 1: smoothed edges are not always smoothed alike.
SAME = 2e-3
# The node group that previews share.
GROUP = "SCFPF Preview"


def source_of(camera):
    """The source collection of a camera's preview, or None."""
    found = [c for c in bpy.data.collections if c.scfpf_preview.is_source]
    return next((c for c in found if c.scfpf_preview.camera == camera), None)


def viewports(driver):
    return [area for area in driver.window.screen.areas if area.type == VIEW]


def preview_areas(driver):
    """The viewports that look through the camera of a preview."""
    cameras = {c.scfpf_preview.view_camera for c in bpy.data.collections} - {None}
    return [
        a for a in viewports(driver) if a.spaces.active.use_local_camera and a.spaces.active.camera in cameras
    ]


def artist_area(driver):
    shown = preview_areas(driver)
    return next(area for area in viewports(driver) if area not in shown)


def toggle(driver, area=None):
    """Press the toggle, with the mouse over the artist's viewport, as one step of undo.

    The first one builds the node group, which takes seconds; later scenarios append it.
    """
    area = area or artist_area(driver)
    region = next(region for region in area.regions if region.type == "WINDOW")
    groups, kept = bpy.data.node_groups, pathlib.Path(bpy.app.tempdir, "preview.blend")
    if GROUP not in groups and kept.exists():
        with bpy.data.libraries.load(str(kept)) as (_, here):
            here.node_groups = [GROUP]
    with bpy.context.temp_override(window=driver.window, area=area, region=region):
        assert bpy.ops.scfpf.preview_toggle("EXEC_DEFAULT", True) == {"FINISHED"}
    if GROUP in groups and not kept.exists():
        bpy.data.libraries.write(str(kept), {groups[GROUP]})


def look(driver, area, name):
    """The pixels of an area, (H, W, 3), in a screenshot that is saved under a name."""
    driver.shot(name)
    image = bpy.data.images.load(str(driver.folder / f"{driver.scenario}-{name}.png"))
    width, height = image.size
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    region = next(region for region in area.regions if region.type == "WINDOW")
    rows = slice(region.y, region.y + region.height)
    columns = slice(region.x, region.x + region.width)
    return pixels.reshape(height, width, -1)[rows, columns, :3]


def middle(picture):
    """The middle ninth of an image."""
    rows, columns = (slice(size // 3, 2 * size // 3) for size in picture.shape[:2])
    return picture[rows, columns]


def until_shown(driver, count):
    """Generator: wait until a given number of viewports show a preview, and no other was split off."""
    end = time.monotonic() + PATIENCE
    while len(preview_areas(driver)) != count or len(viewports(driver)) != count + 1:
        assert time.monotonic() < end, f"{len(preview_areas(driver))} previews are shown, not {count}"
        yield 0.2
    yield SETTLE


def prepare(driver, preset="VIEW"):
    """Generator: a scene, a flexible camera, its preview switched on."""
    build_scene()
    driver.add_camera(preset)
    yield DRAW
    toggle(driver)
    yield SETTLE


def preview_look(driver):
    """The preview stands beside the artist's viewport, which keeps its look; off gives the room back."""
    build_scene()
    # EEVEE compiles a shader for materials, which takes long.
    for mesh in bpy.data.meshes:
        mesh.materials.clear()
    driver.add_camera()
    yield from driver.show_sidebar()
    (area,) = viewports(driver)
    whole = area.width
    before = look(driver, area, "before")
    toggle(driver)
    yield SETTLE
    (shown,) = preview_areas(driver)
    space = shown.spaces.active
    assert shown.x > artist_area(driver).x and not space.overlay.show_overlays
    picture = look(driver, shown, "on")
    assert picture.std() > 0.01, "the preview is empty"
    source = source_of(bpy.context.scene.camera)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = source.scfpf_preview.parts[0].picture.evaluated_get(depsgraph)
    assert evaluated.visible_in_viewport_get(space)
    assert not source.scfpf_preview.parts[0].picture.visible_get(viewport=artist_area(driver).spaces.active)
    space.shading.type = "MATERIAL"
    yield SETTLE
    # EEVEE compiles its shaders first, and shows nothing until then.
    end = time.monotonic() + PATIENCE
    while middle(look(driver, shown, "material-preview")).std() < 0.01:
        assert time.monotonic() < end, "Material Preview shows nothing"
        yield SETTLE
    toggle(driver)
    yield SETTLE
    (area,) = viewports(driver)
    assert area.width == whole
    after = look(driver, area, "off")
    # Its middle: Blender's own panel about the last step comes and goes in a corner.
    difference = np.abs(middle(after) - middle(before)).mean()
    assert difference < SAME, f"the artist's viewport differs by {difference} from what it was"


def preview_stays_out(driver):
    """Local collections, a local view, quad views and Rendered shading of the artist's are left alone."""
    build_scene()
    driver.add_camera()
    space = artist_area(driver).spaces.active
    space.use_local_collections = True
    space.shading.type = "WIREFRAME"
    with driver.override():
        bpy.ops.object.select_all(action="DESELECT")
        bpy.data.objects["Cube"].select_set(True)
        bpy.ops.view3d.localview(frame_selected=False)
        bpy.ops.object.select_all(action="DESELECT")
        bpy.ops.screen.region_quadview()
    yield DRAW
    active = bpy.context.view_layer.objects.active
    toggle(driver)
    yield from until_shown(driver, 1)
    driver.shot("on")
    assert not bpy.context.selected_objects and bpy.context.view_layer.objects.active == active
    (shown,) = preview_areas(driver)
    picture = source_of(bpy.context.scene.camera).scfpf_preview.parts[0].picture
    evaluated = picture.evaluated_get(bpy.context.evaluated_depsgraph_get())
    own = artist_area(driver).spaces.active
    assert own.local_view is not None and own.use_local_collections and own.region_quadviews
    assert own.shading.type == "WIREFRAME" and shown.spaces.active.shading.type == "SOLID"
    assert not shown.spaces.active.region_quadviews
    assert evaluated.visible_in_viewport_get(shown.spaces.active)
    with driver.override():
        bpy.ops.view3d.localview(frame_selected=False)
    yield DRAW
    evaluated = picture.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert not evaluated.visible_in_viewport_get(artist_area(driver).spaces.active)
    with driver.override():
        bpy.ops.mesh.primitive_torus_add("EXEC_DEFAULT", True, location=(0, 0, 2), major_radius=2)
    area = shown
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=driver.window, area=area, region=region):
        bpy.ops.mesh.primitive_cone_add("EXEC_DEFAULT", True, location=(0, 0, 4))
    yield SETTLE
    driver.shot("added")
    for name in ("Torus", "Cone"):
        assert not bpy.data.objects[name].local_view_get(shown.spaces.active), name
    toggle(driver)
    yield from until_shown(driver, 0)


def preview_follows(driver):
    """Moved objects, moved surfaces, new objects and the frame change the picture; playback runs."""
    yield from prepare(driver)
    (shown,) = preview_areas(driver)
    scene = bpy.context.scene
    pictures = [look(driver, shown, "start")]

    def changed(name):
        pictures.append(look(driver, shown, name))
        return np.abs(pictures[-1] - pictures[-2]).max() > 0.05

    assert bpy.data.objects["Cube"] is not None
    bpy.data.objects["Cube"].location.z += 1.5
    yield SETTLE
    assert changed("moved"), "a moved object"
    scene.camera.scfpf.surfaces[0].object.scale.x *= 0.5
    yield SETTLE
    assert changed("surface"), "a scaled control surface"
    with driver.override():
        bpy.ops.mesh.primitive_torus_add(location=(0, 0, 2), major_radius=2)
    yield SETTLE
    assert changed("added"), "a new object"
    torus = bpy.data.objects["Torus"]
    for frame, height in ((1, 2.0), (20, 6.0)):
        torus.location.z = height
        torus.keyframe_insert("location", frame=frame)
    scene.frame_set(20)
    yield SETTLE
    assert changed("frame"), "another frame"
    with driver.override():
        bpy.ops.screen.animation_play()
    yield 2 * SETTLE
    with driver.override():
        bpy.ops.screen.animation_cancel(restore_frame=False)
    yield DRAW
    torus.hide_render = True
    yield SETTLE
    pictures.append(look(driver, shown, "shown"))
    torus.hide_render = False
    yield SETTLE
    assert changed("hidden"), "an object hidden in renders"
    scene.render.resolution_x = scene.render.resolution_y
    yield SETTLE
    assert changed("square"), "another resolution"


def preview_undo(driver):
    """The toggle is one step of undo; the viewport comes and goes with it, and with the camera."""
    build_scene()
    driver.add_camera()
    bpy.ops.ed.undo_push(message="ready")
    toggle(driver)
    yield from until_shown(driver, 1)

    def step(operator):
        with driver.override():
            operator()

    step(bpy.ops.ed.undo)
    yield from until_shown(driver, 0)
    assert source_of(bpy.context.scene.camera) is None
    driver.shot("undone")
    step(bpy.ops.ed.redo)
    yield from until_shown(driver, 1)
    (shown,) = preview_areas(driver)
    assert look(driver, shown, "redone").std() > 0.01
    with driver.override():
        bpy.ops.mesh.primitive_torus_add("EXEC_DEFAULT", True, location=(0, 0, 2), major_radius=2)
    yield SETTLE
    for _ in range(3):
        step(bpy.ops.ed.undo)
        yield 0.3
        step(bpy.ops.ed.redo)
        yield 0.3
    yield from until_shown(driver, 1)
    with driver.override():
        bpy.ops.object.select_all(action="DESELECT")
        bpy.context.scene.camera.select_set(True)
        bpy.ops.object.delete("EXEC_DEFAULT", True)
    yield from until_shown(driver, 0)
    driver.shot("camera-deleted")
    assert not [c for c in bpy.data.collections if c.scfpf_preview.is_source]
    step(bpy.ops.ed.undo)
    yield from until_shown(driver, 1)
    (shown,) = preview_areas(driver)
    assert look(driver, shown, "camera-back").std() > 0.01


def preview_reload(driver):
    """A saved file still shows the preview, which still follows; F12 and Render leave it out."""
    yield from prepare(driver)
    (shown,) = preview_areas(driver)
    before = look(driver, shown, "saved")
    with tempfile.TemporaryDirectory() as folder:
        bpy.ops.wm.save_as_mainfile(filepath=f"{folder}/preview.blend")
        bpy.ops.wm.open_mainfile(filepath=f"{folder}/preview.blend")
    yield 2 * SETTLE
    (shown,) = preview_areas(driver)
    after = look(driver, shown, "reloaded")
    difference = np.abs(after - before).mean()
    assert difference < SAME, f"the preview differs by {difference} after reloading"
    bpy.data.objects["Cube"].location.z += 1.5
    yield SETTLE
    assert np.abs(look(driver, shown, "moved") - after).max() > 0.05
    scene = bpy.context.scene
    scene.render.resolution_percentage = 25
    driver.start_render()
    yield from driver.finished()
    with_preview = driver.pixels()
    scene.render.engine = "BLENDER_WORKBENCH"
    bpy.ops.render.render()
    path = driver.folder / f"{driver.scenario}-workbench.png"
    bpy.data.images["Render Result"].save_render(str(path))
    toggle(driver)
    yield SETTLE
    assert len(viewports(driver)) == 1
    driver.start_render()
    yield from driver.finished()
    assert np.array_equal(driver.pixels(), with_preview)
    bpy.ops.render.render()
    other = driver.folder / f"{driver.scenario}-workbench-off.png"
    bpy.data.images["Render Result"].save_render(str(other))
    one, two = (bpy.data.images.load(str(p)) for p in (path, other))
    assert np.array_equal(np.array(one.pixels), np.array(two.pixels))


def preview_windows(driver):
    """Two cameras have a preview each; where there is no room, in a window of its own."""
    name = next(name for name in sys.modules if name.endswith("scanline.preview.preview_viewports"))
    # So that two find room on a small screen, and a third does not.
    kept, sys.modules[name].NARROWEST = sys.modules[name].NARROWEST, 200
    try:
        yield from two_and_a_window(driver)
    finally:
        sys.modules[name].NARROWEST = kept


def two_and_a_window(driver):
    """Generator: a preview is closed and shown again; a second one, and a third one in a window."""
    yield from prepare(driver)
    (shown,) = preview_areas(driver)
    region = next(region for region in shown.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=driver.window, area=shown, region=region):
        bpy.ops.screen.area_close()
    yield from until_shown(driver, 0)
    with driver.override():
        assert bpy.ops.scfpf.preview_show("INVOKE_DEFAULT") == {"FINISHED"}
    yield from until_shown(driver, 1)
    first = bpy.context.scene.camera
    driver.add_camera("nonlinear_twist")
    second = bpy.context.scene.camera
    assert first != second
    toggle(driver)
    yield SETTLE
    assert source_of(first) and source_of(second)
    windows = bpy.context.window_manager.windows
    driver.shot("two")
    driver.add_camera("cylindrical_panorama")
    toggle(driver)
    yield 2 * SETTLE
    assert len(windows) == 2, "the third preview has found room"
    driver.shot("window")
    toggle(driver)
    yield SETTLE
    assert len(windows) == 1
    for camera in (first, second):
        bpy.context.view_layer.objects.active = camera
        toggle(driver)
        yield SETTLE
    assert len(viewports(driver)) == 1
    driver.shot("off")


# Flat colours that no mixture of two others is taken for; the last is the background.
PALETTE = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1), (1, 1, 1), (0, 0, 0), (1, 0, 1))
# Of the pixels that are two pixels or more from any silhouette, how many may show another object.
MISTAKES = 2e-3
# The others are compared without a window, in tests/blender/scanline/test_scanline_pictures.py.
COMPARED = ("nonlinear_twist", "cylindrical_panorama", "around_the_car")
# Those that look all round: they stand among the objects.
AMIDST = {"cylindrical_panorama"}


def build_flat_scene():
    """Objects of one flat colour each, which identify them in any image."""
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.ops.mesh.primitive_plane_add(size=40, location=(0, 0, -1))
    for x, y in ((-6, 3), (-3, -4), (0, 0), (3, 4), (6, -3)):
        bpy.ops.mesh.primitive_monkey_add(location=(x, y, 1))
    bpy.ops.mesh.primitive_cube_add(location=(0, 7, 1))
    meshes = [obj for obj in bpy.data.objects if obj.type == "MESH"]
    for obj, color in zip(meshes, PALETTE, strict=False):
        material = bpy.data.materials.new(obj.name)
        material.diffuse_color = (*color, 1)
        material.use_nodes = True
        shader = material.node_tree.nodes["Principled BSDF"]
        shader.inputs["Base Color"].default_value = (0, 0, 0, 1)
        shader.inputs["Specular IOR Level"].default_value = 0
        shader.inputs["Emission Color"].default_value = (*color, 1)
        shader.inputs["Emission Strength"].default_value = 1
        obj.data.materials.append(material)
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 480, 270, 100
    render.film_transparent = True


def flatten(space):
    """Flat colours in a viewport, and the palette's background."""
    space.shading.light = "FLAT"
    space.shading.color_type = "MATERIAL"
    space.shading.background_type = "VIEWPORT"
    space.shading.background_color = PALETTE[-1]


def labels(pixels):
    """The number of the nearest colour of the palette for each pixel, (..., 3)."""
    return np.argmin([((pixels - np.array(color)) ** 2).sum(-1) for color in PALETTE], axis=0)


def frame_of(area, width, height, picture):
    """The labels that a preview's viewport shows at the pixel centres of a picture of that size."""
    region = next(region for region in area.regions if region.type == "WINDOW")
    space = area.spaces.active
    camera = space.camera
    corners = [
        location_3d_to_region_2d(region, space.region_3d, camera.matrix_world @ corner)
        for corner in camera.data.view_frame(scene=bpy.context.scene)
    ]
    (right, top), (left, bottom) = corners[0], corners[2]
    columns = left + (np.arange(width) + 0.5) / width * (right - left)
    rows = bottom + (np.arange(height) + 0.5) / height * (top - bottom)
    return labels(picture)[np.ix_(rows.astype(int), columns.astype(int))]


def uniform(found):
    """The mask of pixels whose surroundings of two pixels have one label."""
    height, width = found.shape
    padded = np.pad(found, 2, mode="edge")
    around = [padded[y : y + height, x : x + width] for y in range(5) for x in range(5)]
    return np.all([part == found for part in around], axis=0)


def preview_against_caster(driver):
    """Preview and caster show each object at the same place, preset by preset."""
    build_flat_scene()
    scene = bpy.context.scene
    width, height = scene.render.resolution_x, scene.render.resolution_y
    with driver.override():
        bpy.ops.view3d.view_all("EXEC_DEFAULT")
    yield DRAW
    found = {}
    for preset in COMPARED:
        driver.add_camera(preset)
        if preset in AMIDST:
            scene.camera.matrix_world = Matrix.Translation((1.5, -1, 1)) @ Matrix.Rotation(
                radians(90), 4, "X"
            )
        toggle(driver)
        yield from until_shown(driver, 1)
        (shown,) = preview_areas(driver)
        flatten(shown.spaces.active)
        yield SETTLE
        seen = frame_of(shown, width, height, look(driver, shown, preset))
        driver.start_render()
        yield from driver.finished()
        pixels = driver.pixels().reshape(height, width, 4)
        background = np.array(PALETTE[-1])
        cast = labels(np.where(pixels[..., 3:] > 0.5, pixels[..., :3], background))
        colors = np.array(PALETTE, np.float32)
        beside = np.concatenate((colors[seen], colors[cast]), axis=1)
        keep_picture(driver.folder / f"{driver.scenario}-{preset}-beside.png", beside)
        inside = uniform(cast)
        found[preset] = (seen != cast)[inside].mean()
        print(f"{preset}: {found[preset]:.5f} of {inside.mean():.2f}", flush=True)
        toggle(driver)
        yield from until_shown(driver, 0)
    assert max(found.values()) < MISTAKES, found


def keep_picture(path, pixels):
    """Save (H, W, 3) as a PNG file."""
    height, width, _ = pixels.shape
    image = bpy.data.images.new("Kept", width, height)
    image.pixels.foreach_set(np.dstack((pixels, np.ones((height, width), np.float32))).ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)


SCENARIOS = (
    preview_look,
    preview_stays_out,
    preview_follows,
    preview_undo,
    preview_reload,
    preview_windows,
    preview_against_caster,
)
