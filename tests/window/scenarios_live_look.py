# SPDX-License-Identifier: GPL-3.0-or-later
"""The look of live images beside Blender's own Solid view of the same scene: the same colours off edges."""

import importlib
import time
from dataclasses import replace

import bpy
import numpy as np
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d
from driver import DRAW, PATIENCE
from mathutils import Vector

# Pixels of the viewport between two that are compared.
STEP = 4
# Mean difference off edges, of 255.
CLOSE = 1.0


def product(name):
    """A module of the extension, however it is installed."""
    root = next(one for one in bpy.context.preferences.addons.keys() if one.endswith(".scfpf"))
    return importlib.import_module(f"{root}.scfpf_addon.{name}")


LOOK = product("bridge.live.read_look")
OBJECTS = product("bridge.live.live_objects")
LiveHits = product("shading.live.live_hits").LiveHits
paint = product("shading.live.solid_look").paint


def build():
    """Flat-shaded things in several materials, an image, colour attributes; a wide view."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    random = np.random.default_rng(5)
    adders = (
        lambda at: bpy.ops.mesh.primitive_uv_sphere_add(location=at, segments=64, ring_count=32),
        lambda at: bpy.ops.mesh.primitive_monkey_add(location=at),
        lambda at: bpy.ops.mesh.primitive_torus_add(location=at),
        lambda at: bpy.ops.mesh.primitive_cube_add(location=at, rotation=(0.4, 0.2, 0.7)),
    )
    for number in range(8):
        adders[number % 4]((3.2 * (number % 4) - 4.8, 3.5 * (number // 4), 0.3))
        obj = bpy.context.object
        obj.color = (*random.random(3), 1.0)
        material = bpy.data.materials.new(f"Live {number}")
        material.diffuse_color = (*random.random(3), 1.0)
        material.metallic = (0.0, 0.0, 0.6, 1.0)[number % 4]
        material.roughness = 0.1 + 0.25 * (number // 2)
        obj.data.materials.append(material)
        if number % 2:
            layer = obj.data.color_attributes.new("Color", "FLOAT_COLOR", "POINT")
            layer.data.foreach_set("color", np.tile([*random.random(3), 1.0], len(layer.data)))
    bpy.ops.mesh.primitive_plane_add(size=40, location=(0, 0, -1))
    bpy.context.object.data.materials.append(painted_material())


def painted_material():
    """A material with an image of soft waves, seen as its active texture node."""
    image = bpy.data.images.new("Waves", 64, 64)
    place = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    wave = 0.5 + 0.4 * np.sin(place)[:, None] * np.cos(place)
    pixels = np.stack([wave, wave.T, 1 - wave, np.ones_like(wave)], axis=2)
    image.pixels.foreach_set(pixels.astype(np.float32).ravel())
    image.update()
    material = bpy.data.materials.new("Waves")
    material.diffuse_color = (0.3, 0.5, 0.2, 1.0)
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    material.node_tree.nodes.active = node
    return material


def prepare(driver):
    """The viewport without overlays, gizmos or toolbars."""
    space = driver.area("VIEW_3D").spaces.active
    space.show_gizmo = space.overlay.show_overlays = False
    space.show_region_header = space.show_region_toolbar = space.show_region_tool_header = False
    view = space.region_3d
    space.lens = 28
    view.view_perspective = "PERSP"
    view.view_location, view.view_distance = Vector((0, 1.2, 0)), 7.5
    view.view_rotation = Vector((0.35, -1.0, 0.6)).to_track_quat("Z", "Y")
    return space


def cast(driver):
    """The hits of Blender's own rays through every STEP-th pixel, as live hits, and the objects."""
    region, view = driver.region("VIEW_3D"), driver.area("VIEW_3D").spaces.active.region_3d
    view.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    columns, rows = (np.arange(STEP // 2, size, STEP) for size in (region.width, region.height))
    axes = np.array(view.view_matrix.inverted())[:3, :3]
    found = []
    for y in rows:
        for x in columns:
            where = (x + 0.5, y + 0.5)
            origin = region_2d_to_origin_3d(region, view, where)
            forward = region_2d_to_vector_3d(region, view, where)
            hit, place, normal, face, obj, _ = bpy.context.scene.ray_cast(depsgraph, origin, forward)
            found.append((hit, place, normal, face, obj.session_uid if hit else 0, forward))
    hit, place, normal, face, uids, forward = (np.array(values) for values in zip(*found, strict=True))
    forward, normal = forward.T, normal.T * -np.sign(np.einsum("nc,nc->n", normal, forward))
    right = np.cross(forward, axes[:, 1], axis=0)
    right /= np.linalg.norm(right, axis=0)
    objects = [obj for obj in bpy.data.objects if obj.type == "MESH"]
    number = {obj.session_uid: row for row, obj in enumerate(objects)}
    look = np.array([number[uid] if uid else -1 for uid in uids], np.int32)
    single = [np.ascontiguousarray(v, np.float32) for v in (place.T, forward, right)]
    up = np.cross(right, forward, axis=0).astype(np.float32)
    hits = LiveHits(
        len(columns),
        len(rows),
        np.ones(len(hit), bool),
        look,
        look,
        np.ones(len(hit), np.float32),
        *single,
        up,
        np.zeros(len(hit), bool),
        np.ascontiguousarray(normal, np.float32),
        *attributes(objects, look, face, place),
    )
    known = OBJECTS.LiveObjects()
    for obj in objects:
        key = OBJECTS.ObjectKey(obj.session_uid, obj.name, obj.session_uid, obj.name)
        known.table.first_look(known.table.number(key), 1)
    return hits, known, axes, (rows, columns)


def attributes(objects, look, face, place):
    """Texture coordinates of the plane, and the colour attribute, which is constant on each object."""
    uv = np.zeros((2, len(look)), np.float32)
    color = np.ones((3, len(look)), np.float32)
    for number, obj in enumerate(objects):
        some = look == number
        if "Plane" in obj.name:
            uv[:, some] = place[some, :2].T / 40 + 0.5
        if obj.data.color_attributes:
            color[:, some] = np.array(obj.data.color_attributes[0].data[0].color[:3])[:, None]
    return uv, color


def inside(look, shape):
    """Pixels whose neighbours show the same object, two pixels deep."""
    same = look.reshape(shape)
    kept = np.ones(shape, bool)
    for axis in (0, 1):
        for step in (-2, -1, 1, 2):
            kept &= np.roll(same, step, axis) == same
    kept[:2] = kept[-2:] = kept[:, :2] = kept[:, -2:] = False
    return kept


def compare(driver, scene, name, reader, allowed=CLOSE):
    """Compare the live image with the viewport's pixels, off edges; save both, side by side."""
    hits, objects, axes, (rows, columns) = scene
    space = driver.area("VIEW_3D").spaces.active
    depsgraph = bpy.context.evaluated_depsgraph_get()
    look = replace(reader.read(objects, space.shading, space.overlay, depsgraph), camera_axes=axes)
    ours = paint(hits, look)[..., :3] * 255
    theirs = driver.region_pixels()[np.ix_(rows, columns)].astype(float)
    difference = np.abs(ours - theirs).max(axis=2)
    # Inside a surface the normal may still change at an edge: medians of small squares are off edges.
    kept = inside(hits.look, difference.shape)
    smooth = np.abs(np.diff(hits.normal.reshape(3, *difference.shape), axis=2, prepend=0)).sum(axis=0) < 0.05
    kept &= smooth
    save(driver, name, ours, theirs)
    mean = difference[kept].mean()
    print(f"{name}: mean {mean:.2f}, 99 % {np.percentile(difference[kept], 99):.1f} of 255", flush=True)
    assert mean <= allowed, f"{name}: {mean:.2f} of 255 on average"
    return ours, theirs


def save(driver, name, ours, theirs):
    both = np.concatenate([ours, theirs], axis=1) / 255
    image = bpy.data.images.new("pair", both.shape[1], both.shape[0], float_buffer=False)
    pixels = np.ones((*both.shape[:2], 4), np.float32)
    pixels[..., :3] = both
    image.pixels.foreach_set(pixels.ravel())
    image.file_format = "PNG"
    image.filepath_raw = str(driver.folder / f"{driver.scenario}-{name}-pair.png")
    image.save()
    bpy.data.images.remove(image)


def live_studio(driver):
    """Studio lights, with and without highlights, in the world, and flat colours, as Workbench has them."""
    build()
    space = prepare(driver)
    yield 2 * DRAW
    scene, reader, shading = cast(driver), LOOK.LookReader(), space.shading
    names = [one.name for one in bpy.context.preferences.studio_lights if one.type == "STUDIO"]
    assert len(names) > 3
    for name in names:
        shading.studio_light = name
        yield DRAW
        compare(driver, scene, f"studio-{name}", reader)
    shading.show_specular_highlight = False
    yield DRAW
    compare(driver, scene, "no-highlights", reader)
    shading.show_specular_highlight = True
    shading.use_world_space_lighting, shading.studiolight_rotate_z = True, 1.1
    yield DRAW
    compare(driver, scene, "world-space", reader)
    shading.use_world_space_lighting = False
    shading.light = "FLAT"
    yield DRAW
    compare(driver, scene, "flat", reader)


def live_matcaps(driver):
    """Matcaps, which leave no datablocks behind."""
    build()
    space = prepare(driver)
    yield 2 * DRAW
    scene, reader, shading = cast(driver), LOOK.LookReader(), space.shading
    shading.light = "MATCAP"
    before = set(bpy.data.images.keys())
    for name in ("basic_bright.exr", "check_normal+y.exr", "metal_carpaint.exr"):
        shading.studio_light = name
        reader.read(scene[1], shading, space.overlay, bpy.context.evaluated_depsgraph_get())
        for _ in range(20):
            if reader.is_complete:
                break
            yield DRAW
            reader.read(scene[1], shading, space.overlay, bpy.context.evaluated_depsgraph_get())
        yield DRAW
        compare(driver, scene, f"matcap-{name}", reader, allowed=2 * CLOSE)
        assert reader.is_complete and set(bpy.data.images.keys()) == before


def live_colors(driver):
    """The colour settings and backgrounds, as Workbench has them."""
    build()
    space = prepare(driver)
    yield 2 * DRAW
    scene, reader, shading = cast(driver), LOOK.LookReader(), space.shading
    shading.single_color = (0.2, 0.5, 0.7)
    for kind in ("OBJECT", "RANDOM", "VERTEX", "TEXTURE", "SINGLE", "MATERIAL"):
        shading.color_type = kind
        yield DRAW
        compare(driver, scene, f"color-{kind}", reader)
    bpy.context.scene.world = bpy.data.worlds.new("Live")
    bpy.context.scene.world.color = (0.02, 0.2, 0.4)
    shading.background_color = (0.4, 0.1, 0.02)
    space.region_3d.view_rotation = Vector((0.35, -1.0, 0.3)).to_track_quat("Z", "Y")
    shading.light = "FLAT"
    yield DRAW
    scene = cast(driver)
    for kind in ("WORLD", "VIEWPORT"):
        shading.background_type = kind
        yield DRAW
        compare(driver, scene, f"background-{kind}", reader)
    shading.background_type = "THEME"
    gradients = bpy.context.preferences.themes[0].view_3d.space.gradients
    gradients.high_gradient, gradients.gradient = (0.9, 0.6, 0.3), (0.1, 0.2, 0.4)
    try:
        for kind in ("LINEAR", "RADIAL"):
            gradients.background_type = kind
            yield DRAW
            ours, theirs = compare(driver, scene, f"gradient-{kind}", reader)
            nothing = scene[0].look.reshape(ours.shape[:2]) < 0
            assert nothing.sum() > 1000
            difference = np.abs(ours - theirs).max(axis=2)[nothing].mean()
            print(f"gradient-{kind}: the largest of a pixel's differences, mean {difference:.2f} of 255")
            # The screen's values are whole numbers, and the largest of three differences is taken.
            assert difference < 2 * CLOSE
    finally:
        # Other scenarios look for colours on the background.
        bpy.ops.preferences.reset_default_theme()


def live_cavity(driver):
    """Screen-space cavity; at every fourth pixel it reaches further than the viewport's own."""
    build()
    space = prepare(driver)
    yield 2 * DRAW
    scene, reader, shading = cast(driver), LOOK.LookReader(), space.shading
    shading.show_cavity, shading.cavity_type = True, "SCREEN"
    yield DRAW
    compare(driver, scene, "cavity", reader, allowed=3 * CLOSE)


def framed(pixels):
    """The pixels well inside a camera's frame, which fills most of the viewport."""
    height, width = pixels.shape[:2]
    return pixels[height * 3 // 10 : height * 7 // 10, width * 3 // 10 : width * 7 // 10].astype(float)


def close_to(pixels, color, reach=25):
    """The mask of pixels that are close to a theme's colour."""
    return np.abs(pixels - np.array(color) * 255).max(axis=2) < reach


def live_beside_solid(driver):
    """A perspective looks the same with Live View on and off: surfaces, and outlines of what is selected."""
    build()
    for obj in bpy.data.objects:
        if obj.type == "MESH" and "Cube" not in obj.name:
            obj.data.shade_smooth()
    space = prepare(driver)
    driver.add_camera()
    camera, overlay = bpy.context.scene.camera, space.overlay
    space.region_3d.view_perspective = "CAMERA"
    shots, kinds = {}, {"texture": "TEXTURE", "attribute": "VERTEX"}
    for name in ("matcap", "texture", "attribute", "surfaces", "outlines"):
        shown = name == "outlines"
        space.shading.color_type = kinds.get(name, "MATERIAL")
        space.shading.light = "MATCAP" if name == "matcap" else "STUDIO"
        overlay.show_overlays = shown
        overlay.show_floor = overlay.show_axis_x = overlay.show_axis_y = overlay.show_extras = False
        overlay.show_cursor = overlay.show_text = overlay.show_object_origins = False
        for obj in bpy.context.view_layer.objects:
            obj.select_set(obj.type == "MESH" and "Plane" not in obj.name and shown)
        bpy.context.view_layer.objects.active = bpy.data.objects["Suzanne"]
        for live in (True, False):
            camera.scfpf.show_live = live
            yield from settled() if live else iter([2 * DRAW])
            if name == "matcap":
                # A timer reads it.
                yield 3 * DRAW
            shots[name, live] = framed(driver.region_pixels())
            driver.shot(f"{name}-{'live' if live else 'solid'}")
    for name in ("matcap", "texture", "attribute", "surfaces"):
        difference = np.abs(shots[name, True] - shots[name, False]).max(axis=2)
        print(f"{name}: median {np.median(difference):.1f}, 90 % {np.percentile(difference, 90):.1f} of 255")
        assert np.percentile(difference, 90) <= 3, name
    theme = bpy.context.preferences.themes[0].view_3d
    for color in (theme.object_selected, theme.object_active):
        own, other = (close_to(shots["outlines", live], color) for live in (True, False))
        # Blender's lines are smooth, so that fewer of their pixels have the full colour.
        near = other
        for axis in (0, 1):
            near = np.any([np.roll(near, step, axis) for step in range(-2, 3)], axis=0)
        print(f"outline: {own.sum()} and {other.sum()} pixels, {(own & near).sum() / own.sum():.2f} together")
        assert other.sum() > 100 and other.sum() < 3 * own.sum() < 12 * other.sum()
        assert (own & near).sum() > 0.8 * own.sum()


def live_folds(driver):
    """A folded volume is striped where its projectors are mirrored, unless overlays are off."""
    build()
    space = prepare(driver)
    driver.add_camera("nonlinear_twist")
    camera, overlay = bpy.context.scene.camera, space.overlay
    space.region_3d.view_perspective = "CAMERA"
    camera.scfpf.surfaces[1].object.scale.x *= -3
    camera.select_set(False)
    counts = {}
    for shown in (False, True):
        overlay.show_overlays = shown
        yield from settled()
        red, green, _ = np.moveaxis(framed(driver.region_pixels()), 2, 0)
        counts[shown] = int(((red > 200) & (red > 1.8 * green)).sum())
        driver.shot("stripes" if shown else "plain")
    assert counts[True] > counts[False] + 2000, counts


def live_pick(driver):
    """A cross marks the picked position in the camera's frame."""
    build()
    space = prepare(driver)
    driver.add_camera()
    settings = bpy.context.scene.camera.scfpf
    space.region_3d.view_perspective = "CAMERA"
    space.overlay.show_overlays = True
    bpy.context.scene.camera.select_set(False)
    yellow = {}
    for shown in (False, True):
        settings.pick, settings.show_pick = (0.5, 0.5), shown
        yield from settled()
        red, green, blue = np.moveaxis(driver.region_pixels(), 2, 0)
        found = np.argwhere((red > 220) & (green > 200) & (blue < 110))
        yellow[shown] = found
        driver.shot("cross" if shown else "none")
    assert len(yellow[True]) > len(yellow[False]) + 20
    region = driver.region("VIEW_3D")
    middle = np.array([region.height, region.width]) / 2
    assert np.abs(yellow[True].mean(axis=0) - middle).max() < 20, yellow[True].mean(axis=0)


def settled():
    """Generator: wait for the final image."""
    end = time.monotonic() + PATIENCE
    drawing = product("bridge.live.live_drawing")
    yield DRAW
    while True:
        images = [found.view.painter.image for found in drawing._viewports.values()]
        if images and images[0] is not None and images[0].step == 1.0:
            break
        assert time.monotonic() < end, "no final image comes"
        yield 0.1
    yield 2 * DRAW


SCENARIOS = live_studio, live_matcaps, live_colors, live_cavity, live_beside_solid, live_folds, live_pick
