# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes preview where the volume is not one-to-one: what no ray reaches, and flat volumes."""

import bpy
import numpy as np
import pytest
from made_cameras import FOLDER
from mathutils import Matrix

pytestmark = pytest.mark.usefixtures("built_groups")

ASPECT = 1.5
FACES = 240


@pytest.fixture
def flexible(addon):
    return addon("bridge.camera.flexible_camera")


@pytest.fixture
def camera(flexible):
    made = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene = bpy.context.scene
    scene.collection.objects.link(made)
    scene.camera = bpy.context.view_layer.objects.active = made
    flexible.make_flexible(made)
    flexible.clear_surfaces(made)
    return made


@pytest.fixture
def switch_on(addon, camera):
    """Switches the camera's preview on: its source, and its pictures as evaluated."""
    data = addon("scanline.preview.preview_data")

    def switch():
        assert bpy.ops.scfpf.preview_toggle() == {"FINISHED"}
        source = data.preview_of(camera, bpy.context.scene)
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        return source, [picture.evaluated_get(depsgraph) for picture in data.pictures_of(source)]

    return switch


def add_hairpin(flexible, camera):
    """The far surface goes to the right and comes back: what is farther right no ray reaches."""
    size = {"width": 3.0, "height": 2.0}
    flexible.add_surface(camera, "PLANE", matrix=Matrix.Translation((0, 0, -2)), parameters=size)
    u, v = np.meshgrid(np.linspace(0, 1, 65), np.linspace(0, 1, 2))
    points = np.stack([16 * np.sin(2.4 * u) - 10, 12 * (v - 0.5), np.full_like(u, -20.0)], axis=-1)
    flexible.add_surface(camera, "GRID", points=points)


def small_faces(projection):
    """Triangles around the crease: corners (FACES, 3, 3), far from the picture's borders."""
    generator = np.random.default_rng(3)
    middles = generator.uniform((0.55, 0.25, 0.35), (0.75, 0.75, 0.85), (FACES, 3)).T
    image = projection.parameters(*middles[:2])
    points = projection.volume.evaluate(image.u, image.v, middles[2]).position
    return points.T[:, None] + generator.uniform(-0.35, 0.35, (FACES, 3, 3))


def test_faces_that_no_ray_reaches_wholly_are_counted(addon, flexible, camera, switch_on):
    """Against corners that float64 finds in the volume, by Newton's method from many places."""
    add_hairpin(flexible, camera)
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = 300, 200
    bpy.context.view_layer.update()
    read = addon("bridge.camera.read_projection").read_projection
    projection = read(camera, bpy.context.evaluated_depsgraph_get(), ASPECT)
    corners = small_faces(projection)
    found = addon("projection.volume.inverse").invert(projection.volume, corners.reshape(-1, 3).T).found
    per_face = found.reshape(FACES, 3).sum(axis=1)
    expected = ((per_face > 0) & (per_face < 3)).sum()
    assert 30 < expected < FACES - 30 and (per_face == 3).sum() > 30
    mesh = bpy.data.meshes.new("Faces")
    mesh.from_pydata(corners.reshape(-1, 3).tolist(), [], np.arange(3 * FACES).reshape(-1, 3).tolist())
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Faces", mesh))
    source, _ = switch_on()
    counts = addon("scanline.preview.preview_data").left_out(source, bpy.context.evaluated_depsgraph_get())
    # A corner within float32 of the crease may count either way.
    assert abs(counts["unreachable"] - expected) <= 1
    assert counts["folded"] > 100
    shown = addon("panels.messages").reported(counts)
    assert any(text.startswith(f"{counts['unreachable']:,} faces") for text in shown)


def test_a_flat_volume_shows_nothing_and_says_so(addon, flexible, camera, switch_on):
    """Two equal planes, then the epipolar plane image, then planes apart, which have a picture again."""
    data = addon("scanline.preview.preview_data")
    for _ in range(2):
        matrix = Matrix.Translation((0.0, 0.0, -3.0))
        flexible.add_surface(camera, "PLANE", matrix=matrix, parameters={"width": 3.0, "height": 2.0})
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0, 0, -3))
    bpy.context.view_layer.objects.active = camera
    source, _ = switch_on()

    def state():
        bpy.context.view_layer.update()
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        pictures = [picture.evaluated_get(depsgraph) for picture in data.pictures_of(source)]
        return data.is_flat(source, depsgraph), sum(len(picture.data.polygons) for picture in pictures)

    assert state() == (True, 0)
    told = [one.text for one in addon("panels.messages").messages(bpy.context, camera)]
    assert told[0] == addon("operators.camera.preview").FLAT
    load = addon("projection.presets.preset").load_preset
    flexible.apply_preset(camera, load((FOLDER / "epi.json").read_text(encoding="utf-8")), ASPECT)
    assert state() == (True, 0)
    flexible.apply_preset(camera, load((FOLDER / "perspective.json").read_text(encoding="utf-8")), ASPECT)
    flat, faces = state()
    assert not flat and faces > 0
