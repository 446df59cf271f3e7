# SPDX-License-Identifier: GPL-3.0-or-later
"""Marks in a drawn volume: folds, iso-surfaces, the picked projector, and colours by the background.

Needs OpenGL, as test_drawing.
"""

import pathlib

import bpy
import gpu
import numpy as np
import pytest
from mathutils import Matrix, Vector

PRESETS = pathlib.Path(__file__).resolve().parents[3] / "presets"
# The epipolar plane image has a plane for a volume, which has no orientation.
SOLID = sorted(set(PRESETS.glob("*.json")) - {PRESETS / "epi.json"})
SIZE = 400
DARK, WHITE = (0.24, 0.24, 0.24), (0.95, 0.95, 0.95)


@pytest.fixture
def drawing(addon):
    """The module, with OpenGL: by ``gpu.init``, before 5.2 by a Workbench render."""
    if hasattr(gpu, "init"):
        gpu.init()
    else:
        scene = bpy.data.scenes.new("Workbench")
        scene.camera = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
        scene.collection.objects.link(scene.camera)
        scene.render.engine = "BLENDER_WORKBENCH"
        scene.render.resolution_x = scene.render.resolution_y = 16
        bpy.ops.render.render(scene=scene.name)
        bpy.data.objects.remove(scene.camera)
        bpy.data.scenes.remove(scene)
    return addon("bridge.overlays.viewport_overlay")


@pytest.fixture
def make(addon):
    """A flexible camera at the origin with a preset."""

    def made(preset):
        camera = bpy.data.objects.new("Flexible", bpy.data.cameras.new("Flexible"))
        bpy.context.scene.collection.objects.link(camera)
        read = addon("projection.presets.preset").read_preset
        addon("bridge.camera.flexible_camera").apply_preset(camera, read(PRESETS / f"{preset}.json"), 1.0)
        bpy.context.view_layer.update()
        return camera

    return made


@pytest.fixture
def camera(make):
    return make("nonlinear_twist")


@pytest.fixture
def view():
    eye, target = Vector((24, 14, 6)), Vector((0, 0, -12))
    placed = Matrix.LocRotScale(eye, (target - eye).to_track_quat("-Z", "Y"), None)
    return placed.inverted(), Matrix(((2.2, 0, 0, 0), (0, 2.2, 0, 0), (0, 0, -1.0, -0.2), (0, 0, -1, 0)))


def shoot(drawing, camera, view, background=DARK, depth=1.0):
    """The volume over a background at a depth, (SIZE, SIZE, 3), row 0 at the bottom."""
    offscreen = gpu.types.GPUOffScreen(SIZE, SIZE, format="RGBA8")
    with offscreen.bind():
        framebuffer = gpu.state.active_framebuffer_get()
        framebuffer.clear(color=(*background, 1.0), depth=depth)
        with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            gpu.matrix.load_matrix(view[0])
            gpu.matrix.load_projection_matrix(view[1])
            depsgraph = bpy.context.evaluated_depsgraph_get()
            drawing.draw_volume(camera, depsgraph, 1.0, background=background)
        buffer = framebuffer.read_color(0, 0, SIZE, SIZE, 4, 0, "FLOAT")
    offscreen.free()
    buffer.dimensions = SIZE * SIZE * 4
    return np.array(buffer, np.float32).reshape(SIZE, SIZE, 4)[..., :3]


def pixel_of(view, point):
    clip = np.array(view[1] @ view[0]) @ [*point, 1.0]
    return tuple(np.rint((clip[:2] / clip[3] + 1) / 2 * SIZE - 0.5).astype(int))


def is_like(picture, color):
    return np.abs(picture - color[:3]).max(axis=-1) < 0.03


def roles(drawing, camera):
    depsgraph = bpy.context.evaluated_depsgraph_get()
    return set(drawing.drawings.drawing(camera, depsgraph, 1.0).batches)


ALWAYS = {"SURFACE", "PROJECTOR", "FAR", "FRAME", "U", "V"}


@pytest.mark.parametrize("background", [DARK, WHITE])
def test_folds_are_red_and_only_folds(drawing, addon, camera, view, background):
    colors = addon("projection.diagrams.line_colors").line_colors(background)
    assert not is_like(shoot(drawing, camera, view, background), colors["FOLD"]).any()
    camera.scfpf.surfaces[2].object.scale.x = -0.6
    bpy.context.view_layer.update()
    picture = shoot(drawing, camera, view, background)
    red, blue = is_like(picture, colors["FOLD"]), is_like(picture, colors["PROJECTOR"])
    assert red.sum() > 300 and blue.sum() > 300
    # The far end, at the bottom of this picture, is the folded one: det at t = 1 has the mirrored sign.
    assert np.flatnonzero(red.any(axis=1)).max() < np.median(np.flatnonzero(blue.any(axis=1)))
    camera.scfpf.show_folds = False
    bpy.context.view_layer.update()
    assert not is_like(shoot(drawing, camera, view, background), colors["FOLD"]).any()


@pytest.mark.parametrize("path", SOLID, ids=lambda path: path.stem)
def test_no_preset_folds_as_read_back_from_blender(drawing, addon, make, path):
    """Float32 parameters may place a pole beyond its position."""
    camera = make(path.stem)
    camera.matrix_world = Matrix.Translation((30, -20, 10)) @ Matrix.Rotation(0.7, 4, (1, 2, 3))
    camera.scfpf.projector_count = 9
    bpy.context.view_layer.update()
    read = addon("bridge.camera.read_projection").read_projection
    projection = read(camera, bpy.context.evaluated_depsgraph_get(), 1.0)
    folds = addon("projection.volume.folds").find_folds(projection)
    assert not folds and folds.orientation != 0
    assert "FOLD" not in roles(drawing, camera)


def test_iso_surfaces_are_drawn_at_will(drawing, camera, view):
    assert roles(drawing, camera) == ALWAYS
    before = shoot(drawing, camera, view)
    camera.scfpf.iso_surfaces, camera.scfpf.iso_t = 1, 0.75
    bpy.context.view_layer.update()
    assert roles(drawing, camera) == ALWAYS | {"ISO"}
    low = shoot(drawing, camera, view)
    # The middle of the lattice's border: at t = ¾ the square has turned and shrunk, z is -17.
    z = 2 * ((1 - 0.75) ** 2 + 0.75**2 + 2j * 0.75 * 0.25) * (1 + 0j)
    x, y = pixel_of(view, (z.real, z.imag, -17.0))
    near = np.s_[y - 2 : y + 3, x - 2 : x + 3]
    assert not np.array_equal(before[near], low[near])
    camera.scfpf.iso_surfaces = 4
    bpy.context.view_layer.update()
    many = shoot(drawing, camera, view)
    assert (many != before).any(axis=-1).sum() > 2 * (low != before).any(axis=-1).sum() > 200


def test_the_picked_projector_is_yellow_with_a_dot_at_its_hit(drawing, addon, camera, view):
    color = addon("projection.diagrams.line_colors").BRIGHT["PICK"]
    camera.scfpf.pick, camera.scfpf.pick_t = (1.0, 0.5), 0.25
    assert not is_like(shoot(drawing, camera, view), color).any()
    camera.scfpf.show_pick = True
    bpy.context.view_layer.update()
    picture = is_like(shoot(drawing, camera, view), color)
    for t in (0.05, 0.25, 0.6, 0.9):
        z = 2 * ((1 - t) ** 2 + t**2 + 2j * t * (1 - t))
        x, y = pixel_of(view, (z.real, z.imag, -2 - 20 * t))
        around = picture[y - 4 : y + 5, x - 4 : x + 5].sum()
        assert around > 60 if t == 0.25 else 9 <= around < 50, t
    camera.scfpf.pick_t = -1.0
    bpy.context.view_layer.update()
    assert is_like(shoot(drawing, camera, view), color).sum() < picture.sum() - 20


def test_a_pick_outside_a_round_picture_draws_nothing(drawing, make):
    camera = make("angular_fisheye")
    camera.scfpf.pick, camera.scfpf.pick_t, camera.scfpf.show_pick = (0.01, 0.01), 0.5, True
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    made = drawing.drawings.drawing(camera, depsgraph, 1.0)
    assert "PICK" not in made.batches and made.dot is None and "PROJECTOR" in made.batches


def test_a_thousand_projectors_cost_nothing_while_only_the_view_turns(drawing, camera, view, monkeypatch):
    camera.scfpf.projector_count, camera.scfpf.iso_surfaces = 32, 3
    camera.scfpf.show_pick, camera.scfpf.pick_t = True, 0.5
    bpy.context.view_layer.update()
    first = shoot(drawing, camera, view)
    calls = []
    for name in ("read_projection", "diagram", "volume_signature", "diagram_options", "batch_for_shader"):
        monkeypatch.setattr(drawing, name, lambda *_, name=name: calls.append(name))
    for turn in range(5):
        turned = (view[0] @ Matrix.Rotation(0.1 * turn, 4, "Z"), view[1])
        assert np.array_equal(shoot(drawing, camera, turned), first) == (turn == 0)
    assert calls == []


def test_lines_are_dark_on_a_light_background(drawing, addon, camera, view):
    colors = addon("projection.diagrams.line_colors")
    for background, mine, other in (
        (DARK, colors.BRIGHT, colors.DARK),
        (WHITE, colors.DARK, colors.BRIGHT),
    ):
        picture = shoot(drawing, camera, view, background)
        assert is_like(picture, mine["PROJECTOR"]).sum() > 500
        assert not is_like(picture, other["PROJECTOR"]).any()


def test_the_viewport_s_own_background_chooses_the_colours(drawing):
    window = bpy.context.window_manager.windows[0]
    space = next(a for a in window.screen.areas if a.type == "VIEW_3D").spaces.active
    theme, scene = bpy.context.preferences.themes[0], bpy.context.scene
    gradients = tuple(theme.view_3d.space.gradients.high_gradient)

    def seen():
        return drawing.viewport_background(scene, space, theme)

    space.shading.type, space.shading.background_type = "SOLID", "THEME"
    assert seen() == gradients
    space.shading.background_type, space.shading.background_color = "VIEWPORT", (1, 1, 1)
    assert seen() == pytest.approx((1, 1, 1), abs=1e-3)
    space.shading.background_color = (0.214, 0.214, 0.214)
    assert seen() == pytest.approx((0.5, 0.5, 0.5), abs=0.005), "scene-linear becomes display"
    space.shading.background_type, scene.world = "WORLD", None
    assert seen() == (0, 0, 0)
    scene.world = bpy.data.worlds.new("Sky")
    scene.world.color = (1, 1, 1)
    assert seen() == pytest.approx((1, 1, 1), abs=1e-3)
    space.shading.type = "MATERIAL"
    assert seen() == gradients


def test_safe_areas_are_drawn_and_follow_their_settings_without_an_edit_of_the_volume(drawing, camera, view):
    before, edits = shoot(drawing, camera, view), drawing.drawings.edits
    camera.data.show_safe_areas = True
    drawing.drawings.edits = edits  # whatever Blender has said of it
    assert roles(drawing, camera) == ALWAYS | {"SAFE"}
    shown = shoot(drawing, camera, view)
    assert (shown != before).any()
    bpy.context.scene.safe_areas.title = (0.5, 0.5)
    drawing.drawings.edits = edits
    assert not np.array_equal(shoot(drawing, camera, view), shown)
    camera.data.show_safe_areas = False
    drawing.drawings.edits = edits
    assert roles(drawing, camera) == ALWAYS


def test_a_surface_that_blender_draws_as_a_wire_has_no_second_grid(drawing, camera):
    near, *others = (slot.object for slot in camera.scfpf.surfaces)
    near.select_set(True)
    assert drawing.wired_surfaces(camera) == () and "SURFACE" in roles(drawing, camera)
    camera.scfpf.edit_volume = True
    bpy.context.view_layer.update()
    assert {surface.display_type for surface in (near, *others)} == {"WIRE"}
    assert roles(drawing, camera) == ALWAYS - {"SURFACE"}
    # The color of a selected one is that of its outline, whatever it is drawn as.
    near.select_set(True)
    near.display_type = others[0].display_type = "TEXTURED"
    others[1].hide_set(True)
    assert drawing.wired_surfaces(camera) == (0,)
    assert roles(drawing, camera) == ALWAYS


def test_edit_volume_draws_projectors_in_front_too(drawing, addon, camera, view):
    blue = addon("projection.diagrams.line_colors").BRIGHT["PROJECTOR"]
    free = is_like(shoot(drawing, camera, view), blue).sum()
    wall = shoot(drawing, camera, view, depth=0.0)
    assert free > 300 and not is_like(wall, blue).any()
    camera.scfpf.edit_volume = True
    bpy.context.view_layer.update()
    assert is_like(shoot(drawing, camera, view, depth=0.0), blue).sum() > 0.7 * free
