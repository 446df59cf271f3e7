# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the pictures of docs/compose.md: `python3 dev.py pictures layers-car layers-still`.

Each also writes its scene into demo/output/layers/.
`layers-car-cycles` takes Cycles some minutes.
"""

from __future__ import annotations

import importlib
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "pictures"
OUTPUT = ROOT / "demo" / "output" / "layers"
SIZE = (1000, 500)
QUALITY = 88


def add_camera(scene, name: str, location, target, lens: float = 35.0):
    """Add an ordinary camera that looks at a point."""
    import bpy
    from mathutils import Vector

    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    scene.collection.objects.link(camera)
    camera.location = location
    camera.rotation_euler = (Vector(target) - camera.location).to_track_quat("-Z", "Y").to_euler()
    camera.data.lens, camera.data.clip_end = lens, 200.0
    return camera


def add_layer(camera, collection: str, eye, **settings):
    """Add a layer of a collection that another camera sees."""
    import bpy

    bpy.ops.scfpf.layer_add(camera=camera.name, collection=collection, seen_by=eye.name)
    layer = camera.scfpf.layers[-1]
    for name, value in settings.items():
        setattr(layer, name, value)
    return layer


def both_sides():
    """The car's front and both sides by a preset, which ends at the tail, before a street that stays."""
    import bpy

    from demo import render_demo

    scene = render_demo.build_street()
    # A picture with layers has the shape that its image has now.
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.camera = add_camera(scene, "Street", (0.0, -14.0, 2.2), (0.0, 2.0, 3.2), 28.0)
    eye = add_camera(scene, "Around the Car", (0.0, -10.0, 1.0), (0.0, 0.0, 1.0))
    presets = importlib.import_module(f"{render_demo.MODULE}.scfpf_addon.projection.presets.preset")
    flexible = importlib.import_module(f"{render_demo.MODULE}.scfpf_addon.bridge.camera.flexible_camera")
    preset = presets.load_preset((ROOT / "presets" / "around_the_car.json").read_text(encoding="utf-8"))
    flexible.apply_preset(eye, preset, preset.aspect, 1.0)
    # Without the back, which the preset has at both borders.
    low, high = eye.scfpf.u_range = (0.112, 0.888)
    layer = add_layer(scene.camera, "Car", eye, front="ORDER", halo=0.12)
    width = 0.78
    layer.size = width, width * SIZE[0] / SIZE[1] / (preset.aspect * (high - low))
    layer.position = 0.5, 0.235
    bpy.context.view_layer.update()
    return scene


def lathe(name: str, profile, color, place, roughness: float = 0.6):
    """A thing of revolution about the vertical, in a collection of its own. profile: radii and heights."""
    import numpy as np

    sides = 96
    turn = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    profile = np.asarray(profile, float)
    for _ in range(2):
        # Chaikin's corner cutting.
        cut = np.stack(
            [0.75 * profile[:-1] + 0.25 * profile[1:], 0.25 * profile[:-1] + 0.75 * profile[1:]], axis=1
        )
        profile = np.concatenate([profile[:1], cut.reshape(-1, 2), profile[-1:]])
    rings = [(r * np.cos(turn), r * np.sin(turn), np.full(sides, z)) for r, z in profile]
    points = np.concatenate([np.stack(ring, axis=1) for ring in rings])
    number = np.arange(len(points)).reshape(-1, sides)
    after = np.roll(number, -1, axis=1)
    faces = np.stack([number[:-1], after[:-1], after[1:], number[1:]], axis=-1).reshape(-1, 4)
    return _thing(name, points, faces, color, place, roughness)


def _thing(name: str, points, faces, color, place, roughness: float):
    """A smooth mesh in a collection of its own name, which may hold others."""
    import bpy

    from demo.mesh import material

    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.tolist(), [], faces.tolist())
    mesh.shade_smooth()
    mesh.materials.append(material(f"{name} {color}", color, roughness))
    made = bpy.data.objects.new(name, mesh)
    made.location = place
    scene, title = bpy.context.scene, name.split(".")[0]
    collection = bpy.data.collections.get(title) or bpy.data.collections.new(title)
    if title not in scene.collection.children:
        scene.collection.children.link(collection)
    collection.objects.link(made)
    return made


def box(name: str, low, high, color, place=(0, 0, 0), turn: float = 0.0):
    """A box with flat faces."""
    import numpy as np

    points = np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
    faces = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    made = _thing(name, points, faces, color, place, 0.6)
    made.data.shade_flat()
    made.rotation_euler.z = turn
    return made


# Things of the still life, the nearest first: where they stand, and how high and how far to the right the
# camera stands that sees them, degrees.
SEEN = {
    "Cup": (-0.28, -0.34, 46, 6),
    "Book": (0.70, -0.14, 50, 4),
    "Bowl": (0.15, 0.02, 60, 0),
    "Jug": (-0.58, 0.16, 4, -8),
    "Candle": (0.54, 0.40, 2, 0),
}


# Things of revolution by name, whose part before the point is their collection: radii and heights by turns,
# millimetres, and the colour.
LATHES = {
    "Bowl": ("0 12 120 0 130 20 270 100 310 170 295 170 250 110 120 40 0 35", (0.75, 0.78, 0.80)),
    "Jug": (
        "0 0 120 0 130 20 200 140 215 240 190 340 110 440 95 500 130 580 118 580 85 500 100 430",
        (0.05, 0.13, 0.30),
    ),
    "Cup": ("0 0 60 0 65 15 100 100 110 150 103 150 90 100 50 30 0 25", (0.72, 0.66, 0.55)),
    "Cup.Coffee": ("0 110 93 110", (0.06, 0.02, 0.01)),
    "Candle": ("0 0 130 0 130 20 40 40 30 160 60 190 60 210 0 210", (0.55, 0.38, 0.12)),
    "Candle.Wax": ("35 200 35 550 0 560", (0.85, 0.82, 0.72)),
}
# Fruit in the bowl: place and colour.
FRUIT = {
    "Bowl.Apple": ((0.12, 0.03, 0.07), (0.70, 0.06, 0.03)),
    "Bowl.Peach": ((-0.07, 0.10, 0.07), (0.85, 0.42, 0.03)),
    "Bowl.Quince": ((-0.06, -0.10, 0.07), (0.45, 0.55, 0.05)),
    "Bowl.Orange": ((0.02, 0.01, 0.17), (0.80, 0.30, 0.02)),
}
# Boxes of the book: low and high corner, and the colour.
BOOK = {
    "Book": ((-0.19, -0.26, 0.0), (0.19, 0.26, 0.012), (0.35, 0.03, 0.04)),
    "Book.Pages": ((-0.18, -0.25, 0.012), (0.185, 0.25, 0.062), (0.80, 0.76, 0.66)),
    "Book.Cover": ((-0.19, -0.26, 0.062), (0.19, 0.26, 0.075), (0.35, 0.03, 0.04)),
    "Book.Label": ((-0.12, -0.03, 0.075), (0.12, 0.14, 0.077), (0.80, 0.62, 0.25)),
}


def set_table(scene) -> None:
    """Put the things of the still life on a table, in daylight."""
    import bpy
    import numpy as np

    from demo.street import daylight

    box("Table", (-1.35, -0.62, -0.06), (1.35, 0.7, 0.0), (0.30, 0.14, 0.06))
    box("Wall", (-4, 1.5, -2), (4, 1.6, 3), (0.25, 0.33, 0.32))
    at = {name: np.array([x, y, 0.0]) for name, (x, y, _up, _right) in SEEN.items()}
    for name, (profile, color) in LATHES.items():
        lathe(name, np.array(profile.split(), float).reshape(-1, 2) / 1000, color, at[name.split(".")[0]])
    angle = np.linspace(0, np.pi, 40)
    ball = np.stack([0.098 * np.sin(angle), 0.095 * (1 - np.cos(angle))], axis=1)
    for name, (place, color) in FRUIT.items():
        lathe(name, ball, color, at["Bowl"] + place)
    for name, (low, high, color) in BOOK.items():
        box(name, low, high, color, at["Book"], 0.35)
    lights = bpy.data.collections.new("Lights")
    scene.collection.children.link(lights)
    daylight(scene, lights, (52.0, 0.0, -38.0))
    scene.view_settings.exposure = -0.7


def still_life():
    """Each thing on a table as it is best seen: the bowl and the book from above, the jug in profile."""
    import bpy
    import numpy as np
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    set_table(scene)
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    master = scene.camera = add_camera(scene, "Table View", (0.0, -3.0, 1.25), (0.0, 0.0, 0.22), 44.0)
    bpy.context.view_layer.update()
    for name, (x, y, up, right) in SEEN.items():
        foot = Vector((x, y, 0.0))
        reach = (master.matrix_world.translation - foot).length
        up, right = np.radians((up, right))
        away = Vector((np.sin(right) * np.cos(up), -np.cos(right) * np.cos(up), np.sin(up)))
        eye = add_camera(scene, f"{name} View", foot + reach * away, foot, 44.0)
        seen = world_to_camera_view(scene, master, foot)
        # Their feet stay where they are, with their shadows.
        add_layer(master, name, eye, front="ORDER", position=(seen.x, seen.y))
    bpy.context.view_layer.update()
    return scene


def select_only(*cameras) -> None:
    """Select cameras alone, the last one active."""
    import bpy

    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    for camera in cameras:
        camera.select_set(True)
        bpy.context.view_layer.objects.active = camera


def past_the_tail():
    """The car's front and both sides before its street, by a volume that goes on behind the car."""
    from demo.showpieces.evening_car import evening_car

    return evening_car(SIZE)


PICTURES = {
    "layers-car": past_the_tail,
    "layers-car-cycles": past_the_tail,
    "layers-still": still_life,
}
# Width and height of a picture by Cycles, and its samples, which are denoised.
CYCLES_SIZE, CYCLES_SAMPLES = (640, 320), 32


def picture(name: str, scratch: Path) -> Path:
    """Build a scene, render it, and keep it as a .blend and the image as a JPEG."""
    import bpy
    from PIL import Image

    from demo import render_demo

    scene = PICTURES[name]()
    bpy.context.window.scene = scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    scene.camera.scfpf.samples = 16
    raw = scratch / f"{name}.png"
    if name.endswith("cycles"):
        scene.render.resolution_x, scene.render.resolution_y = CYCLES_SIZE
        scene.cycles.samples, scene.cycles.use_denoising = CYCLES_SAMPLES, True
        bpy.ops.scfpf.layers_render(camera=scene.camera.name, filepath=str(raw))
    else:
        print(name, render_demo.render(scene, raw), flush=True)
    path = FOLDER / f"{name}.jpg"
    render_demo.open_on(scene)
    OUTPUT.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(OUTPUT / f"{name}.blend"), compress=True)
    Image.open(raw).convert("RGB").save(path, quality=QUALITY, optimize=True)
    return path


def main(names: list[str]) -> None:
    from demo import render_demo

    with render_demo.scratch_profile(), tempfile.TemporaryDirectory() as folder:
        render_demo.enable_add_on(Path(folder))
        for name in names or PICTURES:
            path = picture(name, Path(folder))
            print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB", flush=True)


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    main(sys.argv[1:])
