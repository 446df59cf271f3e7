# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the pictures of docs/aim.md: `python3 dev.py pictures aim-car aim-valley aim-figures`, and others.

Each frame turns or moves the targets a little, lets the volume follow by warm steps as Live Aim does, and
renders with the engine; the last one is solved. Both sides at once are solved first: their frames blend from
the start to the solution, as keyframes do. The targets' frames and pins are drawn on top.
"""

from __future__ import annotations

import importlib
import math
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

FOLDER = ROOT / "docs" / "pictures"
SIZE = (560, 280)
FRAMES, STEPS = 9, 4
# Half the side of a pin's mark in pixels.
MARK = 4
INK = (255, 242, 38)


def module(name: str):
    """A module of the extension."""
    from demo import render_demo

    return importlib.import_module(f"{render_demo.MODULE}.scfpf_addon.{name}")


def add_camera(scene, location, target, lens: float):
    """Add an ordinary camera, the scene's, that looks at a point."""
    import bpy
    from mathutils import Vector

    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera, camera.location = camera, location
    camera.rotation_euler = (Vector(target) - camera.location).to_track_quat("-Z", "Y").to_euler()
    camera.data.lens, camera.data.clip_end = lens, 200.0
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    bpy.context.view_layer.update()
    return camera


def add_view(camera, **thing: str):
    """Add a view of a collection or an object, and return it."""
    import bpy

    bpy.ops.scfpf.aim_view_add(camera=camera.name, **thing)
    return camera.scfpf.aim_targets[-1]


def turn_car(street):
    """The car is turned, and the street stays."""
    import bpy

    camera = add_camera(street, (-2.6, -12.5, 2.3), (0.2, 0.0, 1.5), 30.0)
    add_view(camera, collection="Car")

    def move(share: float) -> None:
        bpy.ops.scfpf.aim_turn(camera=camera.name, left=-math.radians(60) * share)

    return camera, move


def _terrain(name: str, across, along, height, color):
    """A grid of quadrilaterals over an area, with a height."""
    import bpy
    import numpy as np

    from demo.mesh import material

    x, y = np.meshgrid(np.linspace(*across, 120), np.linspace(*along, 90))
    points = np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape(x.shape)
    corners = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.tolist(), [], np.stack(corners, axis=-1).reshape(-1, 4).tolist())
    mesh.materials.append(material(name, color, 0.9))
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)


def tilt_valley(scene):
    """The valley is seen from higher up, and the mountains behind it from the front."""
    import bpy
    import numpy as np

    for obj in list(scene.objects):
        if obj.type in {"MESH", "FONT"}:
            bpy.data.objects.remove(obj)

    def peaks(x, y):
        ridge = np.exp(-(((y - 26) / 5) ** 2))
        return ridge * (6 * np.abs(np.sin(0.35 * x + 0.5)) + np.abs(np.sin(1.3 * x + 0.7 * y)))

    def hills(x, y):
        return 0.3 * np.sin(1.1 * x) * np.cos(0.9 * y) + 0.15 * np.sin(2.3 * x + y)

    _terrain("Mountains", (-24, 24), (16, 36), peaks, (0.40, 0.38, 0.37))
    _terrain("Valley", (-16, 16), (-4, 15.5), hills, (0.12, 0.26, 0.06))
    camera = add_camera(scene, (0, -16, 4), (0, 20, 3), 24.0)
    for name in ("Mountains", "Valley"):
        add_view(camera, object=name).halo = 0.5

    def move(share: float) -> None:
        first, second = camera.scfpf.aim_targets
        bpy.ops.scfpf.aim_turn(camera=camera.name, index=1, up=math.radians(14) * share)
        first.position[1] += 0.06 * share
        second.position[1] -= 0.02 * share

    return camera, move


def look_into_street(scene):
    """The wall of a side street is seen from farther along it, past a corner that stays."""
    import bpy
    from mathutils import Matrix

    camera = add_camera(scene, (-10.0, -6.0, 2.4), (-21.0, 20.0, 4.5), 24.0)
    for point in ((-29.9, 30.0, 2.0), (-29.9, 30.0, 7.0), (-18.0, 10.0, 2.0), (-18.0, 10.0, 8.0)):
        bpy.ops.scfpf.aim_pin_add(camera=camera.name, point=point)
    for target in camera.scfpf.aim_targets:
        target.halo = 4.0
    deep = camera.scfpf.aim_targets[:2]
    for target in deep:
        sight = target.handle.location - camera.location
        target.handle.rotation_euler = sight.to_track_quat("-Z", "Y").to_euler()
        target.use_direction = True

    def move(share: float) -> None:
        for target in deep:
            turn = Matrix.Rotation(-math.radians(20) * share, 4, "Z")
            target.handle.rotation_euler = (turn @ target.handle.matrix_world).to_euler()
            target.position[0] -= 0.06 * share

    return camera, move


def show_both_sides(street):
    """The car is seen from the left and from the right, in two frames that part."""
    import bpy

    camera = add_camera(street, (0.0, -12.5, 2.3), (0.0, 0.0, 1.2), 30.0)
    for _ in range(2):
        add_view(camera, collection="Car")

    def move(share: float) -> None:
        for index, side in enumerate((-1.0, 1.0)):
            angle = side * math.radians(60) * share
            bpy.ops.scfpf.aim_turn(camera=camera.name, index=index, left=-angle)
            camera.scfpf.aim_targets[index].position[0] += side * 0.16 * share

    return camera, move


# Scenes of the gallery, and what moves in them.
TASKS = {
    "aim-car": ("street", turn_car),
    "aim-street": ("long street", look_into_street),
    "aim-valley": ("street", tilt_valley),
    "aim-sides": ("street", show_both_sides),
}


# Tasks on whose way frames overlap, which no volume can follow.
BLENDED = {"aim-sides"}


def follow(name: str, camera, move, shoot) -> None:
    """Shoot while the targets move and the volume follows, and once it is solved."""
    import bpy

    drag = module("bridge.aim.follower").Follower(camera, bpy.context.evaluated_depsgraph_get())
    shoot("start")
    for _ in range(FRAMES - 1):
        move(1 / (FRAMES - 1))
        bpy.context.view_layer.update()
        left = [drag.step(bpy.context.evaluated_depsgraph_get()) for _ in range(STEPS)]
        shoot(f"{left[-1]:.2f} px")
    try:
        bpy.ops.scfpf.aim_solve(camera=camera.name)
    except RuntimeError as error:
        print(f"{name}: {error}", flush=True)
    else:
        shoot(camera.scfpf.aim.message)


def blend(name: str, camera, move, shoot) -> None:
    """Solve with the targets moved, and shoot from the start's control points to the solved ones."""
    import bpy

    volume = module("bridge.aim.aimed_volume")
    move(1.0)
    bpy.context.view_layer.update()
    bpy.ops.scfpf.aim_solve(camera=camera.name)
    print(f"{name}: {camera.scfpf.aim.message}", flush=True)
    start, solved = volume.start_of(camera), volume.present_patches(camera)
    move(-1.0)
    for number in range(FRAMES + 1):
        share = number / FRAMES
        pairs = zip(start, solved, strict=True)
        points = [replace(a, points=a.points + share * (b.points - a.points)) for a, b in pairs]
        volume.write_points(camera, tuple(points))
        bpy.context.view_layer.update()
        shoot(f"{share:.0%}")
        move(1 / FRAMES)


def outlines(camera):
    """The frames of all views and squares around pins, as pixels from the upper left, four corners each."""
    import bpy
    import numpy as np

    shown, marks = module("bridge.aim.shown_targets"), []
    image = shown.ShownImage(
        camera, module("bridge.render.view_painter").Rectangle(0.0, 0.0, *map(float, SIZE))
    )
    for target in shown.shown_targets(bpy.context, image):
        if target.frame is not None:
            marks.append([(float(x), SIZE[1] - float(y)) for x, y in np.array(target.frame.corners).T])
    for target in camera.scfpf.aim_targets:
        if target.kind == "PIN":
            x, y = target.position[0] * SIZE[0], (1.0 - target.position[1]) * SIZE[1]
            marks.append([(x + a * MARK, y + b * MARK) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    return marks


def record(name: str, scratch: Path) -> Path:
    """Make a moving picture: the targets go and come back."""
    import bpy
    from PIL import Image, ImageDraw

    from demo import render_demo, render_gallery
    from demo.gallery_animation import join

    place, task = TASKS[name]
    scene = render_gallery.build(place)
    bpy.context.window.scene = scene
    camera, move = task(scene)
    bpy.context.view_layer.update()
    camera.scfpf.samples = 4
    pictures = []

    def shoot(report: str) -> None:
        raw = scratch / f"{name}-{len(pictures)}.png"
        print(f"{name} {len(pictures)}: {report}, {render_demo.render(scene, raw)}", flush=True)
        picture = Image.open(raw).convert("RGB")
        for corners in outlines(camera):
            ImageDraw.Draw(picture).line([*corners, corners[0]], INK, 2)
        pictures.append(picture)

    (blend if name in BLENDED else follow)(name, camera, move, shoot)
    path = FOLDER / f"{name}.webp"
    join(pictures, path)
    return path


def main(names: list[str]) -> None:
    from demo import render_demo
    from demo.aim import figures

    with render_demo.scratch_profile(), tempfile.TemporaryDirectory() as folder:
        render_demo.enable_add_on(Path(folder))
        for name in names or [*TASKS, "aim-figures"]:
            if name == "aim-figures":
                figures.make_all(Path(folder))
                continue
            path = record(name, Path(folder))
            print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB", flush=True)


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    main(sys.argv[1:])
