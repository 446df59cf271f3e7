# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the film of docs/guide.md whose rows have times of their own: `python3 dev.py pictures over-time`.

A head turns once. On the left is each frame as it is, on the right *Assemble from Frames* of half a turn.
"""

from __future__ import annotations

import math
import shutil
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
NAME = "over-time"
# Pixels of a half of the film, milliseconds of a frame, and the quality of its WebP.
SIZE, PAUSE, QUALITY = (360, 400), 50, 72
# Frames of a turn, those of them that the film shows, and the frames from the top row to the lowest: each row
# has one of its own, or edges would have steps.
TURN, EACH, SPAN = 2 * SIZE[1], 10, SIZE[1]


def build():
    """A new file with a turning head before a flexible camera; return its scene."""
    import bpy

    from demo.mesh import material
    from demo.render_demo import Shot, place_camera

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("Studio")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.10, 0.17, 0.26, 1.0)
    bpy.ops.mesh.primitive_monkey_add(size=2.0, location=(0, 0, 1.35))
    head = bpy.context.object
    head.modifiers.new("Smooth", "SUBSURF").render_levels = 2
    head.data.shade_smooth()
    head.data.materials.append(material("Head", (0.80, 0.34, 0.07), 0.4))
    head.driver_add("rotation_euler", 2).driver.expression = f"frame * {2.0 * math.pi / TURN!r}"
    bpy.ops.mesh.primitive_cylinder_add(vertices=96, radius=0.75, depth=0.5, location=(0, 0, 0.05))
    stand = bpy.context.object
    stand.data.materials.append(material("Stand", (0.75, 0.72, 0.66), 0.5))
    for turn, energy in (((0.7, 0.2, 0.5), 3.2), ((1.2, 0.0, -1.9), 1.2)):
        bpy.ops.object.light_add(type="SUN", rotation=turn)
        bpy.context.object.data.energy = energy
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera, camera.data.lens = camera, 50.0
    place_camera(camera, Shot((0.0, -7.0, 1.9), (0.0, 0.0, 1.15)))
    bpy.context.view_layer.objects.active = camera
    bpy.ops.scfpf.camera_from_camera()
    camera.scfpf.samples = 8
    scene.scfpf_sampling.world_shadows = False
    scene.view_settings.view_transform = "Standard"
    render = scene.render
    render.resolution_x, render.resolution_y, render.engine = *SIZE, "SCFPF"
    render.image_settings.file_format = "PNG"
    return scene


def record(scratch: Path) -> Path:
    """Render the turn, and make the film of it."""
    import bpy

    scene = build()
    scene.render.filepath = str(scratch / "turn_####")
    scene.frame_start, scene.frame_end = 1, TURN
    bpy.ops.render.render(animation=True)
    return film_of(scene, scratch)


def film_of(scene, scratch: Path) -> Path:
    """Assemble the frames of the film from those of the turn, and write it."""
    import bpy
    from PIL import Image

    for frame in range(1, SPAN + 1):
        shutil.copy(scene.render.frame_path(frame=frame), scene.render.frame_path(frame=frame + TURN))
    images = []
    for frame in range(1, TURN + 1, EACH):
        scene.frame_set(frame)
        bpy.ops.scfpf.time_assemble(way="ROLLING", span=float(SPAN))
        made = bpy.data.images["Assembled Frames"]
        path = scratch / f"{NAME}.png"
        made.filepath_raw, made.file_format = str(path), "PNG"
        made.save()
        bpy.data.images.remove(made)
        both = Image.new("RGB", (2 * SIZE[0], SIZE[1]))
        for place, file in enumerate((scene.render.frame_path(frame=frame), path)):
            with Image.open(file) as half:
                both.paste(half.convert("RGB"), (place * SIZE[0], 0))
        images.append(both)
    path = ROOT / "docs" / "pictures" / f"{NAME}.webp"
    options = {"duration": PAUSE, "loop": 0, "quality": QUALITY, "method": 6}
    images[0].save(path, save_all=True, append_images=images[1:], **options)
    return path


def main() -> None:
    from demo import render_demo

    with render_demo.scratch_profile(), tempfile.TemporaryDirectory() as folder:
        render_demo.enable_add_on(Path(folder))
        path = record(Path(folder))
        print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB", flush=True)


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    main()
