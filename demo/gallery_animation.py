# SPDX-License-Identifier: GPL-3.0-or-later
"""The gallery's animation: one keyed factor from perspective to orthographic to inverted perspective.

A perspective and an orthographic flexible camera stand in one place and are equally wide at the house. *Blend
Cameras* makes a third one between them. Its factor goes beyond the second, where distant things are enlarged.
"""

from __future__ import annotations

from pathlib import Path

from . import render_demo
from .gallery_panels import preset_text, sizes
from .render_demo import Shot

STEM = "one-slider-dolly"
HEADING = "Between two cameras: a dolly by one slider"
TEXT = (
    "*Blend Cameras* goes from a perspective (0) to an orthographic camera (1) in one place, equally wide at "
    "the front of the house. One keyed factor goes through both and on to an inverted perspective. The front "
    "keeps its size; things behind it shrink, keep theirs, or grow."
)
SHOT = Shot((0.0, -22.0, 13.0), (0.0, -6.0, 3.2), size=(480, 270))
# Distance and width of the house's front, which keeps its size, and the ends of both volumes.
DISTANCE, WIDTH, ENDS = 18.8, 19.0, (2.0, 44.0)
# The factor by frame, eased by Blender's Bézier curves. Above 1 the far end shrinks, to a point at 1.75.
KEYS = {1: 0.0, 17: 1.0, 29: 1.6}
HOLD = 6  # Repetitions of the first and the last image.
MILLISECONDS, QUALITY = 70, 70
SLIDER = 30  # Height of the strip below the image, in pixels.
INK, KNOB, PAPER = (70, 70, 70), (63, 111, 208), (255, 255, 255)


def make_blend(scene):
    """Make both cameras and the one between them, the scene's camera with a keyed factor; returns it."""
    import bpy

    cameras = []
    for stem in ("perspective", "orthographic"):
        aspect = SHOT.size[0] / SHOT.size[1]
        shares = [1.0 if stem == "orthographic" else distance / DISTANCE for distance in ENDS]
        extents = [(WIDTH * k, WIDTH * k / aspect, d) for k, d in zip(shares, ENDS, strict=True)]
        cameras.append(render_demo.add_shot(scene, preset_text(stem, sizes(*extents)), SHOT))
    layer = scene.view_layers[0]
    for camera in cameras:
        camera.select_set(True, view_layer=layer)
    layer.objects.active = cameras[1]
    bpy.context.window.scene = scene
    if bpy.ops.scfpf.camera_blend() != {"FINISHED"}:
        raise RuntimeError("The cameras were not blended; the lines above say why.")
    blend = scene.camera
    for frame, factor in KEYS.items():
        blend.scfpf.blend_factor = factor
        blend.keyframe_insert("scfpf.blend_factor", frame=frame)
    scene.frame_start, scene.frame_end = min(KEYS), max(KEYS)
    return blend


def render_animation(scene, folder: Path, scratch: Path, samples: int) -> Path:
    """Render every frame and join them, there and back, as one animated WebP; returns its file."""
    blend = make_blend(scene)
    blend.scfpf.samples = samples
    pictures = []
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        raw = scratch / f"{STEM}-{frame:02}.png"
        report = render_demo.render(scene, raw)
        pictures.append(_with_slider(raw, blend.scfpf.blend_factor))
        print(f"  {STEM} {frame}: {report}", flush=True)
    path = folder / f"{STEM}.webp"
    join(pictures, path)
    return path


def _with_slider(file: Path, factor: float):
    """A rendered image above a strip with a slider at the factor."""
    from PIL import Image, ImageDraw

    with Image.open(file) as rendered:
        picture = Image.new("RGB", (rendered.width, rendered.height + SLIDER), PAPER)
        picture.paste(rendered.convert("RGB"), (0, 0))
    draw, y = ImageDraw.Draw(picture), picture.height - SLIDER + 9
    left, right = 40, picture.width - 40
    span = (right - left) / max(KEYS.values())
    draw.line([(left, y), (right, y)], INK, 2)
    names = {"perspective": 0.0, "orthographic": 1.0, "inverted": max(KEYS.values())}
    for name, at in names.items():
        x = left + at * span
        draw.line([(x, y - 4), (x, y + 4)], INK, 2)
        draw.text((x - draw.textlength(name) / 2, y + 7), name, INK)
    x = left + factor * span
    draw.ellipse([(x - 6, y - 6), (x + 6, y + 6)], KNOB)
    return picture


def join(pictures, path: Path) -> None:
    """Write an endless animation, forwards and backwards, that rests at both ends."""
    there_and_back = [*[pictures[0]] * HOLD, *pictures, *[pictures[-1]] * HOLD, *pictures[-2:0:-1]]
    there_and_back[0].save(
        path,
        save_all=True,
        append_images=there_and_back[1:],
        duration=MILLISECONDS,
        loop=0,
        quality=QUALITY,
        method=6,
    )
