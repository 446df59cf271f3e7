# SPDX-License-Identifier: GPL-3.0-or-later
"""The gallery's animation: perspective, orthographic, inverted perspective by one factor, keyed and eased.

Two flexible cameras stand in one place: a perspective and an orthographic one, as wide as each other at the
house. *Blend Cameras* makes a third one between them; its factor goes on beyond the second, where
what is far is larger than what is near.
"""

from __future__ import annotations

from pathlib import Path

from . import render_demo
from .gallery_panels import preset_text, sizes
from .render_demo import Shot

STEM = "one-slider-dolly"
HEADING = "Between two cameras: a dolly by one slider"
TEXT = (
    "*Blend Cameras* between a perspective (0) and an orthographic camera (1) in one place, as wide as each "
    "other at the front of the house. One factor, keyed and eased, goes from the first through the second "
    "and on to an inverted perspective: the front stays as large as it is, what is behind it shrinks, keeps "
    "its size, or grows."
)
SHOT = Shot((0.0, -22.0, 13.0), (0.0, -6.0, 3.2), size=(480, 270))
# Distance and width of what keeps its size: the house's front. Both volumes begin and end at these distances.
DISTANCE, WIDTH, ENDS = 18.8, 19.0, (2.0, 44.0)
# The factor's keyframes; beyond 1 the far end shrinks, and would be a point at 1.75.
# Blender eases them: Bézier curves with level ends.
KEYS = {1: 0.0, 17: 1.0, 29: 1.6}
HOLD = 6  # Pictures for which the ends are held still.
MILLISECONDS, QUALITY = 70, 70
SLIDER = 30  # Height of the strip below the picture.
INK, KNOB, PAPER = (70, 70, 70), (63, 111, 208), (255, 255, 255)


def make_blend(scene):
    """Both cameras and the one between them, made the scene's, its factor keyed; returns it."""
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
    """A rendered picture over a strip that shows where the factor is."""
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
    """There and back, the ends held still, for ever."""
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
