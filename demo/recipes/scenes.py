# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes of recipes: the street, with a head or a screen in it, and a landscape."""

from __future__ import annotations

import math

import numpy as np

from ..render_demo import build_street

# Where a screen's viewer stands.
EYE = (0.0, -13.0, 1.7)
# The stripes of the ball before a billboard.
STRIPES = 12
# The boxer's colors.
COLORS = {
    "Coat": (0.06, 0.20, 0.34),
    "Trousers": (0.09, 0.08, 0.10),
    "Skin": (0.58, 0.33, 0.22),
    "Hair": (0.05, 0.03, 0.02),
    "Gloves": (0.55, 0.03, 0.02),
    "Eyes": (0.02, 0.02, 0.02),
}
# Those for a picture in black and white, and the axes of the sky behind him: right, up, ahead.
WHITE, GREY, BLACK = (1.0, 1.0, 1.0), (0.4, 0.4, 0.4), (0.0, 0.0, 0.0)
MANGA_COLORS = {
    "Coat": GREY,
    "Trousers": BLACK,
    "Skin": WHITE,
    "Hair": BLACK,
    "Gloves": WHITE,
    "Eyes": BLACK,
}
SKY_AXES = ((1.0, 0.0, 0.0), (0.0, -0.34, 0.94), (0.0, 0.94, 0.34))


def land():
    """Open a new file with a landscape, and return its scene."""
    import bpy

    from .terrain import build_scene

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    build_scene(bpy.context.scene)
    return bpy.context.scene


def street():
    """The street."""
    return build_street()


def two_cameras():
    """The street with two ordinary cameras: one at the height of eyes, one above the roofs."""
    scene = build_street()
    add_level_and_above(scene)
    return scene


def add_level_and_above(scene) -> None:
    """Add two cameras that look along a street: one at the height of eyes, one above the roofs."""
    import bpy

    from ..render_demo import Shot, place_camera

    for name, shot in (
        ("Level", Shot((0.0, -16.0, 1.8), (0.0, 0.0, 2.6))),
        ("From Above", Shot((0.0, -22.0, 34.0), (0.0, 14.0, 0.0))),
    ):
        camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
        scene.collection.objects.link(camera)
        camera.data.lens, camera.data.clip_end = 24.0, 200.0
        place_camera(camera, shot)
        scene.camera = camera


def head():
    """The street with a monkey's head before an ordinary camera, which sees it from its side."""
    import bpy

    from ..mesh import material
    from ..render_demo import Shot, place_camera

    scene = build_street()
    bpy.ops.mesh.primitive_monkey_add(size=1.5, location=(0.2, -8.0, 1.7), rotation=(0, 0, math.radians(52)))
    monkey = bpy.context.view_layer.objects.active
    monkey.name = "Head"
    monkey.modifiers.new("Smooth", "SUBSURF").levels = 1
    monkey.data.shade_smooth()
    monkey.data.materials.append(material("Head", (0.50, 0.21, 0.11), 0.45))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera, camera.data.lens = camera, 35.0
    place_camera(camera, Shot((-1.4, -13.0, 2.0), (0.2, 0.0, 2.1)))
    return scene


def behind_a_wall():
    """The street with a monkey's head behind a brick wall, before an ordinary camera."""
    import bpy

    from ..mesh import material
    from ..render_demo import Shot, place_camera

    scene = build_street()
    bpy.ops.mesh.primitive_monkey_add(size=1.5, location=(0.4, -4.0, 1.5))
    monkey = bpy.context.view_layer.objects.active
    monkey.name = "Head"
    monkey.modifiers.new("Smooth", "SUBSURF").levels = 1
    monkey.data.shade_smooth()
    monkey.data.materials.append(material("Head", (0.80, 0.42, 0.10), 0.45))
    bpy.ops.mesh.primitive_cube_add(location=(0.2, -7.0, 1.2), scale=(0.95, 0.06, 1.1))
    wall = bpy.context.view_layer.objects.active
    wall.name = "Wall"
    wall.data.materials.append(material("Wall", (0.34, 0.12, 0.08), 0.8))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera, camera.data.lens = camera, 35.0
    place_camera(camera, Shot((-0.6, -13.0, 2.0), (0.4, 0.0, 1.9)))
    return scene


def lone_car():
    """The street's car in the air, with light from above, from the left and from below."""
    import bpy

    scene = build_street()
    kept = set(bpy.data.collections["Car"].all_objects)
    for obj in list(scene.objects):
        if obj not in kept:
            bpy.data.objects.remove(obj)
    for name, turn, energy in (
        ("Above", (0.5, 0.3, 0.0), 3.0),
        ("Side", (1.3, 0.0, -1.0), 1.5),
        ("Below", (2.7, 0.2, 0.4), 1.2),
    ):
        sun = bpy.data.objects.new(name, bpy.data.lights.new(name, "SUN"))
        sun.data.energy, sun.rotation_euler = energy, turn
        scene.collection.objects.link(sun)
    return scene


def boxer():
    """The street with a figure whose fist is before an ordinary camera."""
    import bpy

    from ..render_demo import Shot, place_camera

    scene = build_street()
    _add_figure(scene.collection, (-0.45, -9.9, 0.0))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera, camera.data.lens, camera.data.clip_end = camera, 35.0, 150.0
    place_camera(camera, Shot((0.0, -12.6, 1.1), (0.0, -6.0, 1.2)))
    return scene


def manga():
    """A town in white and grey with a boxer in its street, before a sky of dots."""
    import bpy

    from ..inked_town import build_town, dot_sky
    from ..mesh import MeshBuilder, place

    scene = build_town()
    figure = bpy.data.collections.new("Boxer")
    scene.collection.children.link(figure)
    _add_figure(figure, (0.0, 0.0, 0.0), MANGA_COLORS)
    for obj in figure.objects:
        if obj.name == "Gloves":
            _leave_left_glove(obj.data)
    fist = bpy.data.collections.new("Fist")
    scene.collection.children.link(fist)
    palette = bpy.data.materials
    place("Fist", _fist().mesh("Fist", palette), fist)
    # His shadow and his face, as they are drawn.
    turn = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    drawn = MeshBuilder()
    rim = np.stack([1.5 * np.cos(turn) - 1.3, 0.3 * np.sin(turn) + 0.15, np.full(48, 0.02)], axis=-1)
    drawn.add(rim, [range(48)], "Dark")
    drawn.ball((0.0, -0.195, 1.695), (0.035, 0.02, 0.024), "Dark")
    for side in (-1.0, 1.0):
        brow = np.array([(0.02, 1.825), (0.085, 1.86), (0.085, 1.88), (0.02, 1.845)])
        drawn.add([(side * x, -0.225 + 0.3 * x, z) for x, z in brow], [(0, 1, 2, 3)], "Dark")
    place("Drawn", drawn.mesh("Drawn", palette), scene.collection)
    dot_sky(scene.world, *SKY_AXES)
    return scene


def _leave_left_glove(mesh) -> None:
    """Remove the glove of the stretched arm."""
    import bmesh

    shape = bmesh.new()
    shape.from_mesh(mesh)
    bmesh.ops.delete(shape, geom=[vertex for vertex in shape.verts if vertex.co.x > 0.0], context="VERTS")
    shape.to_mesh(mesh)
    shape.free()


def _fist():
    """A bare fist at the end of the stretched arm: fingers side by side before what is black between them."""
    from ..mesh import MeshBuilder

    ahead = np.array([0.16, -0.68, -0.05]) / np.linalg.norm([0.16, -0.68, -0.05])
    aside = np.cross(ahead, (0.0, 0.0, 1.0)) / np.linalg.norm(np.cross(ahead, (0.0, 0.0, 1.0)))
    up = np.cross(aside, ahead)
    middle, fist = np.array([0.685, -1.42, 1.21]), MeshBuilder()

    def bar(start, end, radius: float) -> None:
        """A finger's bone, round at both ends. start, end: ahead, aside and up of the middle."""
        first, last = (middle + np.array(at) @ (ahead, aside, up) for at in (start, end))
        along = (last - first) / np.linalg.norm(last - first)
        across = np.cross(along, ahead + 0.3 * aside)
        across /= np.linalg.norm(across)
        third, turn = np.cross(along, across), np.linspace(0.0, 2.0 * np.pi, 20, endpoint=False)
        ring = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * third
        bend = np.linspace(0.0, 0.5 * np.pi, 7)
        rows = [(first, -np.cos(angle), np.sin(angle)) for angle in bend]
        rows += [(last, np.sin(angle), np.cos(angle)) for angle in bend]
        points = np.array(
            [at + radius * (share * along + max(wide, 1e-3) * ring) for at, share, wide in rows]
        )
        fist.grid(points, "Skin", closed=True)

    fist.ball(middle, (0.115, 0.085, 0.075), "Dark")
    for number, (low, high) in enumerate(((-0.055, 0.05), (-0.06, 0.06), (-0.055, 0.055), (-0.05, 0.04))):
        side = 0.074 * (1.5 - number)
        bar((0.085, side, high), (0.09, side, low), 0.033)
        bar((-0.06, 0.9 * side, high - 0.012), (0.06, side, high + 0.006), 0.032)
    bar((0.03, -0.15, -0.05), (0.10, 0.03, -0.105), 0.034)
    return fist


def _add_figure(collection, place: tuple[float, float, float], colors=COLORS) -> None:
    """Add a boxer who looks along -Y and whose right fist is 1.6 m before him.

    place: between his feet. colors: of his parts.
    """
    import bmesh
    import bpy
    from mathutils import Matrix

    from ..mesh import material

    # Limbs by both ends and the radius at both, in metres from between the feet. They look along -Y.
    shapes = {
        "Coat": (
            ((0.0, 0.05, 0.95), (0.0, 0.0, 1.25), 0.19, 0.20),
            ((-0.10, 0.0, 1.38), (0.12, -0.04, 1.38), 0.17, 0.17),
            ((0.24, -0.06, 1.42), (0.50, -0.62, 1.30), 0.10, 0.085),
            ((0.50, -0.62, 1.30), (0.66, -1.30, 1.22), 0.085, 0.07),
            ((-0.24, 0.02, 1.42), (-0.50, 0.10, 1.08), 0.10, 0.085),
            ((-0.50, 0.10, 1.08), (-0.42, -0.36, 1.16), 0.085, 0.07),
        ),
        "Trousers": (
            ((-0.08, 0.05, 0.88), (0.08, 0.05, 0.88), 0.18, 0.18),
            ((0.10, 0.05, 0.86), (0.24, -0.22, 0.48), 0.14, 0.10),
            ((0.24, -0.22, 0.48), (0.26, 0.02, 0.08), 0.10, 0.07),
            ((-0.10, 0.05, 0.86), (-0.22, 0.26, 0.46), 0.14, 0.10),
            ((-0.22, 0.26, 0.46), (-0.30, 0.55, 0.10), 0.10, 0.07),
        ),
        "Skin": (
            ((0.0, -0.02, 1.50), (0.0, -0.06, 1.66), 0.075, 0.075),
            ((0.0, -0.08, 1.72), (0.0, -0.07, 1.80), 0.115, 0.135),
            ((0.0, -0.21, 1.76), (0.0, -0.22, 1.74), 0.025, 0.03),
        ),
        "Hair": (((0.0, -0.03, 1.84), (0.0, 0.02, 1.80), 0.135, 0.14),),
        "Gloves": (
            ((0.67, -1.34, 1.22), (0.69, -1.48, 1.22), 0.085, 0.13),
            ((0.69, -1.48, 1.22), (0.69, -1.54, 1.20), 0.13, 0.125),
            ((0.57, -1.50, 1.28), (0.62, -1.60, 1.29), 0.05, 0.05),
            ((-0.42, -0.40, 1.17), (-0.40, -0.52, 1.20), 0.085, 0.13),
        ),
    }
    figure = bpy.data.objects.new("Figure", None)
    figure.location = place
    collection.objects.link(figure)
    parts = []
    for name, limbs in shapes.items():
        shape, mesh = bmesh.new(), bpy.data.meshes.new(name)
        for start, end, first, last in limbs:
            start, end = np.array(start), np.array(end)
            for share in np.linspace(
                0.0, 1.0, 2 + int(np.linalg.norm(end - start) / (0.2 * min(first, last)))
            ):
                place = Matrix.Translation(start + share * (end - start))
                radius = first + share * (last - first)
                bmesh.ops.create_icosphere(shape, subdivisions=2, radius=radius, matrix=place)
        shape.to_mesh(mesh)
        shape.free()
        part = bpy.data.objects.new(name, mesh)
        part.parent = figure
        collection.objects.link(part)
        joined = part.modifiers.new("Joined", "REMESH")
        joined.mode, joined.voxel_size, joined.use_smooth_shade = "VOXEL", 0.016, True
        part.modifiers.new("Smooth", "SMOOTH").iterations = 12
        mesh.materials.append(material(name, colors[name], 0.35 if name == "Gloves" else 0.7))
        parts.append(part)
    # As a mesh: each render would join the limbs anew.
    graph = bpy.context.evaluated_depsgraph_get()
    for part in parts:
        part.data = bpy.data.meshes.new_from_object(part.evaluated_get(graph))
        part.modifiers.clear()
    for side in (-1.0, 1.0):
        shape, mesh = bmesh.new(), bpy.data.meshes.new("Eye")
        bmesh.ops.create_uvsphere(shape, u_segments=32, v_segments=16, radius=0.016)
        shape.to_mesh(mesh)
        shape.free()
        eye = bpy.data.objects.new("Eye", mesh)
        eye.parent, eye.location = figure, (side * 0.048, -0.19, 1.805)
        collection.objects.link(eye)
        mesh.shade_smooth()
        mesh.materials.append(material("Eyes", colors["Eyes"], 0.1))


def propeller():
    """The nose of an old aeroplane before a bright sky; its propeller turns once in eight frames."""
    import bpy

    from ..mesh import material
    from ..render_demo import Shot, place_camera

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("Sky")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.36, 0.58, 0.85, 1.0)

    def add(name, color, roughness, metallic=0.0, parent=None):
        obj = bpy.context.view_layer.objects.active
        obj.name, obj.parent = name, parent
        obj.data.shade_smooth()
        obj.data.materials.append(material(name, color, roughness, metallic))
        return obj

    bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=48, radius=1.0, scale=(0.92, 2.4, 0.92))
    add("Fuselage", (0.55, 0.05, 0.03), 0.3).location.y = 1.9
    bpy.ops.mesh.primitive_torus_add(
        major_radius=0.83,
        minor_radius=0.09,
        major_segments=96,
        minor_segments=24,
        rotation=(math.pi / 2, 0, 0),
    )
    add("Cowl", (0.75, 0.72, 0.66), 0.25).location.y = 0.62
    bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=48, radius=0.3, scale=(1.0, 1.5, 1.0))
    hub = add("Hub", (0.80, 0.62, 0.12), 0.2)
    hub.location.y = -0.35
    for number in range(3):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=1.0)
        blade = add("Blade", (0.10, 0.06, 0.04), 0.35, parent=hub)
        blade.scale = (0.16, 0.03, 0.95)
        turn = 2.0 * math.pi * number / 3.0
        blade.rotation_mode = "YXZ"
        blade.rotation_euler = (0.0, turn, 0.0)
        blade.location = (0.95 * math.sin(turn), 0.0, 0.95 * math.cos(turn))
    for side in (-1.0, 1.0):
        for level in (-0.35, 1.25):
            bpy.ops.mesh.primitive_cube_add(size=1, location=(side * 3.2, 1.7, level), scale=(5.0, 1.4, 0.09))
            wing = add("Wing", (0.80, 0.77, 0.68), 0.5)
            bevel = wing.modifiers.new("Round", "BEVEL")
            bevel.width, bevel.segments = 0.04, 3
        bpy.ops.mesh.primitive_cylinder_add(radius=0.05, depth=1.6, location=(side * 3.6, 1.3, 0.45))
        add("Strut", (0.30, 0.18, 0.09), 0.5)
    for frame, turns in ((1, 0), (81, 10)):
        hub.rotation_euler.y = 2.0 * math.pi * turns
        hub.keyframe_insert("rotation_euler", index=1, frame=frame)
    action = hub.animation_data.action
    curves = (
        action.fcurves if hasattr(action, "fcurves") else action.layers[0].strips[0].channelbags[0].fcurves
    )
    for key in curves[0].keyframe_points:
        key.interpolation = "LINEAR"
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.data.angle = 3.5, 0.02
    sun.rotation_euler = (0.75, -0.35, 0.2)
    scene.collection.objects.link(sun)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera, camera.data.lens = camera, 42.0
    place_camera(camera, Shot((0.4, -7.0, 0.0), (0.0, 0.0, 0.3)))
    scene.frame_set(1)
    return scene


def _with_screen(points, faces, uvs):
    """The street with a screen, and an empty at its viewer's eye."""
    import bpy

    scene = build_street()
    mesh = bpy.data.meshes.new("Screen")
    mesh.from_pydata(np.asarray(points, float).tolist(), [], faces)
    layer = mesh.uv_layers.new(name="Pixels")
    for loop in mesh.loops:
        layer.uv[loop.index].vector = uvs[loop.vertex_index]
    scene.collection.objects.link(bpy.data.objects.new("Screen", mesh))
    eye = bpy.data.objects.new("Eye", None)
    eye.location = EYE
    scene.collection.objects.link(eye)
    return scene


def _strip(plan, low: float, high: float):
    """An upright screen over a line in the plan, (n, 2) points; u goes by its length."""
    plan = np.asarray(plan)
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(plan, axis=0).T))])
    points = [(x, y, z) for x, y in plan for z in (low, high)]
    faces = [(2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1) for i in range(len(plan) - 1)]
    return points, faces, [(u, v) for u in length / length[-1] for v in (0.0, 1.0)]


def led_wall():
    """A wall of LED panels, bent round its viewer."""
    turn = np.radians(np.linspace(-62, 62, 63))
    return _with_screen(*_strip(np.stack([6 * np.sin(turn), 6 * np.cos(turn) - 13], axis=1), 0.05, 4.0))


def billboard():
    """Two walls of a house's corner, seen aslant, and a striped ball between them and the eye."""
    import bpy

    from ..mesh import material

    scene = _with_screen(*_strip([(-5.0, -6.5), (0.8, -7.5), (4.2, -3.8)], 0.4, 4.6))
    place, turn = (-0.85, -9.6, 2.5), (math.radians(35), math.radians(25), 0.0)
    bpy.ops.mesh.primitive_uv_sphere_add(
        segments=STRIPES * 8, ring_count=32, radius=0.5, location=place, rotation=turn
    )
    ball = bpy.context.view_layer.objects.active
    ball.name = "Ball"
    ball.data.shade_smooth()
    for name, color in (("Red Stripe", (0.62, 0.05, 0.03)), ("White Stripe", (0.85, 0.83, 0.78))):
        ball.data.materials.append(material(name, color, 0.35))
    for face in ball.data.polygons:
        around = math.atan2(face.center.y, face.center.x) / math.tau % 1.0
        face.material_index = int(around * STRIPES) % 2
    return scene


def dome():
    """Half a sphere over its viewer. Its UV map is a dome master: the radius is the angle from the zenith."""
    rings, parts, radius = 24, 72, 2.5
    points, uvs = [(0.0, -5.0, radius)], [(0.5, 0.5)]
    for ring in range(1, rings + 1):
        angle = math.pi / 2 * ring / rings
        for turn in np.arange(parts) * 2 * math.pi / parts:
            x, y = math.sin(turn), -math.cos(turn)
            points.append(
                (radius * math.sin(angle) * x, radius * math.sin(angle) * y - 5, radius * math.cos(angle))
            )
            uvs.append((0.5 + ring / rings / 2 * x, 0.5 - ring / rings / 2 * y))
    around = [(k, k % parts + 1) for k in range(1, parts + 1)]
    faces = [(0, a, b) for a, b in around]
    for ring in range(rings - 1):
        first = ring * parts
        faces += [(first + a, first + a + parts, first + b + parts, first + b) for a, b in around]
    scene = _with_screen(points, faces, uvs)
    scene.objects["Eye"].location = (0.0, -5.0, 1.6)
    return scene
