# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures over time: a moving edge is skewed by a closed form; frames of other engines give the same."""

import math

import bpy
import numpy as np
import pytest

WIDTH, HEIGHT = 48, 32
# Units a frame, and where the plate begins: half the picture is 6 units wide.
SPEED, START, HALF = 0.25, -3.0, 1.0
SIGHT = 12.0


@pytest.fixture
def scene():
    """A plate that slides to the right before a camera that shows 12 units across, from frame 10 on."""
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=2 * HALF)
    plate = bpy.context.object
    plate.scale.y = 20
    for frame in (10, 30):
        plate.location.x = START + SPEED * (frame - 10)
        plate.keyframe_insert("location", index=0, frame=frame)
    action = plate.animation_data.action
    curves = (
        action.fcurves if hasattr(action, "fcurves") else action.layers[0].strips[0].channelbags[0].fcurves
    )
    for key in curves[0].keyframe_points:
        key.interpolation = "LINEAR"
    bpy.ops.object.camera_add(location=(0, 0, 10))
    camera = bpy.context.object
    camera.data.type, camera.data.ortho_scale = "ORTHO", SIGHT
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.film_transparent = True
    bpy.ops.scfpf.camera_from_camera()
    camera.scfpf.samples = 1
    scene.frame_set(10)
    return scene


def image(name="SCFPF Render"):
    shown = bpy.data.images[name]
    pixels = np.empty(shown.size[0] * shown.size[1] * 4, np.float32)
    shown.pixels.foreach_get(pixels)
    return pixels.reshape(shown.size[1], shown.size[0], 4)


def expected(time):
    """Where the plate is, (H, W), at a time of each pixel in frames after frame 10."""
    x = ((np.arange(WIDTH) + 0.5) / WIDTH - 0.5) * SIGHT
    return np.abs(x - (START + SPEED * time)) < HALF, np.abs(np.abs(x - (START + SPEED * time)) - HALF) < 1e-3


SHARES = {
    "ROLLING": 1 - (np.arange(HEIGHT)[:, None] + 0.5) / HEIGHT + np.zeros((1, WIDTH)),
    "SLIT": (np.arange(WIDTH)[None] + 0.5) / WIDTH + np.zeros((HEIGHT, 1)),
}


@pytest.mark.parametrize("way", SHARES)
@pytest.mark.parametrize("span", [16.0, -8.0, 0.0])
def test_a_moving_edge_is_skewed_by_its_speed(scene, way, span):
    steps = {"ROLLING": HEIGHT, "SLIT": WIDTH}[way]
    assert bpy.ops.scfpf.time_render(way=way, span=span, steps=steps) == {"FINISHED"}
    inside, border = expected(np.maximum(span * SHARES[way], 0.0))
    found = image()[..., 3] > 0.5
    assert not ((found != inside) & ~border).any()
    assert scene.frame_current == 10


def test_an_image_says_when(scene):
    painted = bpy.data.images.new("When", 2, 1, float_buffer=True)
    painted.pixels.foreach_set(np.array([0, 0, 0, 1, 1, 0, 0, 1], np.float32))
    assert bpy.ops.scfpf.time_render(way="IMAGE", image="When", span=16.0, steps=4) == {"FINISHED"}
    # The middles of the first and of the last of four steps.
    time = np.where(np.arange(WIDTH) < WIDTH / 2, 2.0, 14.0)[None] + np.zeros((HEIGHT, 1))
    inside, border = expected(time)
    assert not (((image()[..., 3] > 0.5) != inside) & ~border).any()


def test_frames_of_another_engine_are_assembled(scene, tmp_path):
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.camera.scfpf.enabled = False
    scene.display.render_aa = "OFF"
    scene.render.filepath = str(tmp_path / "frame_")
    scene.frame_start, scene.frame_end = 10, 17
    bpy.ops.render.render(animation=True)
    scene.frame_set(10)
    scene.camera.scfpf.enabled = True
    assert bpy.ops.scfpf.time_assemble(way="ROLLING", span=8.0) == {"FINISHED"}
    inside, border = expected(np.floor(SHARES["ROLLING"] * 8))
    found = image("Assembled Frames")[..., 3] > 0.5
    assert not ((found != inside) & ~border).any()
    assert [each.name for each in bpy.data.images if each.name.startswith("frame_")] == []


def test_what_is_missing_is_named(scene, tmp_path):
    images = len(bpy.data.images)
    with pytest.raises(RuntimeError, match="Choose an image"):
        bpy.ops.scfpf.time_render(way="IMAGE")
    scene.render.filepath = str(tmp_path / "none_")
    with pytest.raises(RuntimeError, match="render the animation first"):
        bpy.ops.scfpf.time_assemble()
    assert len(bpy.data.images) == images
    assert math.isclose(scene.frame_current_final, 10.0)
