# SPDX-License-Identifier: GPL-3.0-or-later
"""Viewing volumes drawn offscreen: the right colours at the right places, and nowhere else.

Needs OpenGL; Mesa's software renderer does (libegl1, libgl1-mesa-dri).
"""

import pathlib

import bpy
import gpu
import numpy as np
import pytest
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix, Vector

PRESETS = pathlib.Path(__file__).resolve().parents[3] / "presets"
SIZE = 400
BACKGROUND = (0.25, 0.25, 0.25, 1.0)
# Pixels: half of the widest line, its smooth rim, and the rounding of a position.
LINE_REACH = 3.0
ASPECT = 1.0


@pytest.fixture
def drawing(addon):
    return addon("bridge.overlays.viewport_overlay")


@pytest.fixture
def flexible(addon):
    return addon("bridge.camera.flexible_camera")


@pytest.fixture
def gpu_context():
    """OpenGL in background mode: by ``gpu.init``, before 5.2 by a Workbench render."""
    if hasattr(gpu, "init"):
        gpu.init()
        return
    scene = bpy.data.scenes.new("Workbench")
    scene.camera = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
    scene.collection.objects.link(scene.camera)
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.resolution_x = scene.render.resolution_y = 16
    bpy.ops.render.render(scene=scene.name)
    bpy.data.objects.remove(scene.camera)
    bpy.data.scenes.remove(scene)


@pytest.fixture
def camera(addon, flexible):
    """A flexible camera with the nonlinear twist, away from the origin and turned."""
    made = bpy.data.objects.new("Flexible", bpy.data.cameras.new("Flexible"))
    bpy.context.scene.collection.objects.link(made)
    made.matrix_world = Matrix.Translation((3, -2, 1)) @ Matrix.Rotation(0.7, 4, (1, 2, 3))
    preset = addon("projection.presets.preset").read_preset(PRESETS / "nonlinear_twist.json")
    flexible.apply_preset(made, preset, ASPECT)
    made.scfpf.projector_count = 3
    render = bpy.context.scene.render
    render.resolution_x = render.resolution_y = 100
    bpy.context.view_layer.update()
    return made


@pytest.fixture
def view(camera):
    """View and projection matrices of an observer beside the volume."""
    eye, target = Vector((24, 14, 6)), Vector((0, 0, -12))
    to_camera = Matrix.LocRotScale(eye, (target - eye).to_track_quat("-Z", "Y"), None)
    projection = Matrix(((2.2, 0, 0, 0), (0, 2.2, 0, 0), (0, 0, -1.0, -0.2), (0, 0, -1, 0)))
    return (camera.matrix_world @ to_camera).inverted(), projection


def shoot(view, draw):
    """The pixels that ``draw`` renders offscreen, (SIZE, SIZE, 4), row 0 at the bottom."""
    offscreen = gpu.types.GPUOffScreen(SIZE, SIZE, format="RGBA8")
    with offscreen.bind():
        framebuffer = gpu.state.active_framebuffer_get()
        framebuffer.clear(color=BACKGROUND, depth=1.0)
        with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            gpu.matrix.load_matrix(view[0])
            gpu.matrix.load_projection_matrix(view[1])
            draw()
        buffer = framebuffer.read_color(0, 0, SIZE, SIZE, 4, 0, "FLOAT")
    offscreen.free()
    buffer.dimensions = SIZE * SIZE * 4
    return np.array(buffer, np.float32).reshape(SIZE, SIZE, 4)


def draw(drawing, camera, **options):
    """A function that draws the camera's volume as the viewport does."""
    return lambda: drawing.draw_volume(camera, bpy.context.evaluated_depsgraph_get(), ASPECT, **options)


def pixels_of(view, points):
    """Pixel positions (2, N) of points (3, N) in world space."""
    matrix = np.array(view[1] @ view[0])
    clip = matrix @ np.vstack([points, np.ones(points.shape[1])])
    return (clip[:2] / clip[3] + 1) / 2 * SIZE - 0.5


def in_world(camera, x, y, z):
    """Points (3, N) given in camera space."""
    matrix = np.array(camera.matrix_world)
    return matrix[:3, :3] @ np.array(np.broadcast_arrays(x, y, z), float) + matrix[:3, 3:]


def projector(camera, u, v, t):
    """Points of the twist's projector in world space, by complex numbers."""
    z = ((u - 0.5) + 1j * (v - 0.5)) * 4 * ((1 - t) ** 2 + t**2 + 2j * t * (1 - t))
    return in_world(camera, z.real, z.imag, -2 - 20 * t)


def is_drawn(picture):
    return np.abs(picture[..., :3] - BACKGROUND[:3]).max(axis=-1) > 0.02


def colours_at(picture, view, points):
    """The colours of the 3 × 3 pixels about each point, (9, N, 3)."""
    x, y = np.rint(pixels_of(view, points)).astype(int)
    return np.stack([picture[y + j, x + i, :3] for i in (-1, 0, 1) for j in (-1, 0, 1)])


def is_blue(colours):
    """Return whether any of the pixels about each point is blue, (N,)."""
    return (colours[..., 2] > 1.5 * colours[..., :2].max(axis=-1)).any(axis=0)


def is_green(colours):
    """Return whether any of the pixels about each point is green, (N,)."""
    return (colours[..., 1] > 1.5 * colours[..., [0, 2]].max(axis=-1)).any(axis=0)


def test_projectors_are_blue_and_surfaces_green(gpu_context, drawing, camera, view):
    picture = shoot(view, draw(drawing, camera))
    # Not at the middle of the volume, where the middle surface's lines come near.
    t = np.array([0.1, 0.2, 0.3, 0.35, 0.65, 0.7, 0.8, 0.9])
    for u in (0.0, 0.5, 1.0):
        for v in (0.0, 0.5, 1.0):
            assert is_blue(colours_at(picture, view, projector(camera, u, v, t))).mean() >= 7 / 8
    # The far square's lines between the projectors' ends; two projectors pass before one of the points.
    across = np.array([-1.75, -1.25, -0.75, -0.25, 0.25, 0.75, 1.25, 1.75])
    for line in (-2.0, -1.0, 1.0, 2.0):
        assert is_green(colours_at(picture, view, in_world(camera, across, line, -22))).mean() >= 7 / 8
        assert is_green(colours_at(picture, view, in_world(camera, line, across, -22))).mean() >= 7 / 8
    # The picture's frame is the rim of the near square.
    assert is_green(colours_at(picture, view, in_world(camera, across, -2.0, -2))).all()


def test_nothing_is_drawn_away_from_the_lines(gpu_context, addon, drawing, camera, view):
    diagram = addon("projection.diagrams.diagram")
    read = addon("bridge.camera.read_projection").read_projection
    projection = read(camera, bpy.context.evaluated_depsgraph_get(), ASPECT)
    options = diagram.DiagramOptions(3, 3)
    segments = np.concatenate(list(diagram.diagram(projection, options).values())).astype(np.float64)
    steps = np.linspace(0, 1, 60)[:, None, None]
    points = (segments[:, 0] * (1 - steps) + segments[:, 1] * steps).reshape(-1, 3).T
    x, y = np.rint(pixels_of(view, points)).astype(int)
    near = np.zeros((SIZE, SIZE), bool)
    reach = int(LINE_REACH)
    for i in range(-reach, reach + 1):
        for j in range(-reach, reach + 1):
            near[y + j, x + i] = True
    drawn = is_drawn(shoot(view, draw(drawing, camera)))
    assert drawn.sum() > 5000
    assert not (drawn & ~near).any()
    # Lines are there all along, not only at their ends.
    on_line = np.zeros((SIZE, SIZE), bool)
    on_line[y, x] = True
    assert (on_line & drawn).sum() > 0.98 * on_line.sum()


def test_lines_hide_behind_what_is_nearer(gpu_context, drawing, camera, view):
    eye = np.array(view[0].inverted().translation)[:, None]
    covered = in_world(camera, 2.0, np.array([-3.0, 3, -3, 3]), np.array([-3.0, -3, -11, -11]))
    wall = np.ascontiguousarray((eye + (covered - eye) / 2).T, np.float32)

    def draw_behind_a_wall():
        shader = gpu.shader.from_builtin("UNIFORM_COLOR")
        gpu.state.depth_test_set("LESS_EQUAL")
        gpu.state.depth_mask_set(True)
        shader.bind()
        shader.uniform_float("color", (0.9, 0.1, 0.1, 1.0))
        batch_for_shader(shader, "TRI_STRIP", {"pos": wall}).draw(shader)
        gpu.state.depth_test_set("NONE")
        draw(drawing, camera)()

    picture = shoot(view, draw_behind_a_wall)
    behind = colours_at(picture, view, projector(camera, 1.0, 0.5, np.array([0.1, 0.2, 0.3, 0.4])))
    assert np.allclose(behind, (0.9, 0.1, 0.1), atol=0.01)
    assert is_blue(colours_at(picture, view, projector(camera, 1.0, 0.5, np.array([0.8, 0.9])))).all()


@pytest.mark.parametrize("seen", ["perspective", "orthographic", "far away", "orthographic from far away"])
def test_lines_win_against_a_face_in_the_same_place(gpu_context, addon, drawing, camera, view, seen):
    """The same in a town of kilometres, where steps of the depth buffer are larger than pixels."""
    if seen == "orthographic":
        view = (view[0], Matrix(((0.06, 0, 0, 0), (0, 0.06, 0, 0), (0, 0, -0.01, 0), (0, 0, 0, 1))))
    if seen.endswith("far away"):
        eye = view[0].inverted()
        eye.translation = camera.matrix_world.translation + 100 * (
            eye.translation - camera.matrix_world.translation
        )
        camera.matrix_world = camera.matrix_world @ Matrix.Scale(100, 4)
        bpy.context.view_layer.update()
        near, far = 0.01, 1e4
        depth = (far + near) / (near - far), 2 * far * near / (near - far)
        view = (eye.inverted(), Matrix(((2.2, 0, 0, 0), (0, 2.2, 0, 0), (0, 0, *depth), (0, 0, -1, 0))))
    if seen == "orthographic from far away":
        # Blender's own have the same depth before and behind.
        view = (view[0], Matrix(((6e-4, 0, 0, 0), (0, 6e-4, 0, 0), (0, 0, -1 / 5e6, 0), (0, 0, 0, 1))))
    corners = in_world(camera, np.array([-2.0, 2, -2, 2]), np.array([-2.0, -2, 2, 2]), -22.0)
    face = np.ascontiguousarray(corners.T, np.float32)

    def draw_on_a_face():
        shader = gpu.shader.from_builtin("UNIFORM_COLOR")
        gpu.state.depth_test_set("LESS_EQUAL")
        gpu.state.depth_mask_set(True)
        shader.bind()
        shader.uniform_float("color", (0.9, 0.1, 0.1, 1.0))
        batch_for_shader(shader, "TRI_STRIP", {"pos": face}).draw(shader)
        gpu.state.depth_test_set("NONE")
        draw(drawing, camera)()

    alone, on_face = shoot(view, draw(drawing, camera)), shoot(view, draw_on_a_face)
    # Nothing of the volume is behind its far square, so every pixel that a line fills stays as it was.
    colors = addon("projection.diagrams.line_colors").BRIGHT.values()
    filled = np.any([np.abs(alone - color).max(axis=-1) < 0.02 for color in colors], axis=0)
    assert filled.sum() > 1000
    assert np.allclose(on_face[filled], alone[filled], atol=0.1)


def test_line_width_follows_the_scale(gpu_context, drawing, camera, view):
    thin = is_drawn(shoot(view, draw(drawing, camera))).sum()
    thick = is_drawn(shoot(view, draw(drawing, camera, width_scale=3.0))).sum()
    assert 1.4 * thin < thick < 3.2 * thin


def test_drawing_leaves_the_state_as_it_was(gpu_context, drawing, camera, view):
    def check():
        draw(drawing, camera)()
        assert gpu.state.depth_test_get() == "NONE"
        assert gpu.state.depth_mask_get()
        assert gpu.state.blend_get() == "NONE"

    shoot(view, check)


def test_the_drawing_follows_edits(gpu_context, drawing, camera, view):
    before = shoot(view, draw(drawing, camera))
    camera.scfpf.surfaces[2].object.location.z = -17
    bpy.context.view_layer.update()
    after = shoot(view, draw(drawing, camera))
    line = np.array([-1.75, -1.25, -0.75, -0.25, 0.25, 0.75, 1.25, 1.75])
    old, new = in_world(camera, line, 2.0, -22), in_world(camera, line, 2.0, -17)
    assert is_green(colours_at(before, view, old)).all() and is_green(colours_at(after, view, new)).all()
    assert (
        not is_green(colours_at(before, view, new)).all() and not is_drawn(colours_at(after, view, old)).any()
    )
    camera.scfpf.projector_count = 9
    bpy.context.view_layer.update()
    more = shoot(view, draw(drawing, camera))
    assert is_drawn(more).sum() > 1.2 * is_drawn(after).sum()


def test_the_drawing_follows_the_list_of_surfaces(gpu_context, drawing, flexible, camera, view):
    before = shoot(view, draw(drawing, camera))
    flexible.move_surface(camera, 1, 1)
    bpy.context.view_layer.update()
    swapped = shoot(view, draw(drawing, camera))
    assert is_drawn(swapped).any() and not np.array_equal(swapped, before)
    flexible.move_surface(camera, 2, -1)
    bpy.context.view_layer.update()
    assert np.array_equal(shoot(view, draw(drawing, camera)), before)
    flexible.remove_surface(camera, 1)
    bpy.context.view_layer.update()
    straight = shoot(view, draw(drawing, camera))
    line = in_world(camera, 2.0, 2.0, np.linspace(-4, -20, 9))
    assert is_blue(colours_at(straight, view, line)).all()
    assert not is_blue(colours_at(before, view, line)).any()


def test_the_drawing_follows_animation(gpu_context, drawing, camera, view):
    far = camera.scfpf.surfaces[2].object
    for frame, z in ((1, -22), (11, -17)):
        far.location.z = z
        far.keyframe_insert("location", frame=frame)
    line = np.array([-1.75, -1.25, -0.75, 0.75, 1.25])
    for frame, z in ((1, -22), (11, -17)):
        bpy.context.scene.frame_set(frame)
        picture = shoot(view, draw(drawing, camera))
        assert is_green(colours_at(picture, view, in_world(camera, line, 2.0, z))).all()


def test_nothing_is_read_or_made_again_while_only_the_view_turns(
    gpu_context, drawing, camera, view, monkeypatch
):
    reads, makes = [], []
    read, make = drawing.read_projection, drawing.diagram
    monkeypatch.setattr(drawing, "read_projection", lambda *a: (reads.append(1), read(*a))[1])
    monkeypatch.setattr(drawing, "diagram", lambda *a: (makes.append(1), make(*a))[1])
    drawing.drawings.clear()
    turned = (view[0] @ Matrix.Rotation(0.1, 4, "Z"), view[1])
    first = shoot(view, draw(drawing, camera))
    assert not np.array_equal(shoot(turned, draw(drawing, camera)), first)
    assert np.array_equal(shoot(view, draw(drawing, camera)), first)
    assert (len(reads), len(makes)) == (1, 1)
    # An edit that has nothing to do with the volume: read again, but the lines stay.
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Other", None))
    bpy.context.view_layer.update()
    shoot(view, draw(drawing, camera))
    assert (len(reads), len(makes)) == (2, 1)
    camera.scfpf.surfaces[0].object.location.x = 0.5
    bpy.context.view_layer.update()
    shoot(view, draw(drawing, camera))
    assert (len(reads), len(makes)) == (3, 2)


def break_range(camera, flexible):
    camera.scfpf.u_range = (0.5, 0.5)


def break_scale(camera, flexible):
    camera.scfpf.surfaces[1].object.scale = (0, 1, 1)


def break_list(camera, flexible):
    flexible.clear_surfaces(camera)


def break_pointer(camera, flexible):
    bpy.data.objects.remove(camera.scfpf.surfaces[2].object)


@pytest.mark.parametrize("break_volume", [break_range, break_scale, break_list, break_pointer])
def test_a_broken_volume_draws_nothing(gpu_context, drawing, flexible, camera, view, break_volume):
    assert is_drawn(shoot(view, draw(drawing, camera))).any()
    break_volume(camera, flexible)
    bpy.context.view_layer.update()
    assert not is_drawn(shoot(view, draw(drawing, camera))).any()
    assert not is_drawn(shoot(view, draw(drawing, camera))).any()


def test_a_mended_volume_is_drawn_again(gpu_context, drawing, camera, view):
    whole = shoot(view, draw(drawing, camera))
    for u_range, same in (((0.5, 0.5), False), ((0.0, 1.0), True)):
        camera.scfpf.u_range = u_range
        bpy.context.view_layer.update()
        assert np.array_equal(shoot(view, draw(drawing, camera)), whole) == same


@pytest.fixture
def viewport():
    """Area, region and space of a 3D viewport."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    space = area.spaces.active
    with bpy.context.temp_override(window=window, area=area, region=region):
        yield space


def shown(drawing, space, looking_through=False):
    context = bpy.context
    return drawing.visible_cameras(context.scene, context.view_layer, space, looking_through)


def test_only_enabled_cameras_with_projectors_shown_are_drawn(drawing, camera, viewport):
    other = bpy.data.objects.new("Ordinary", bpy.data.cameras.new("Ordinary"))
    bpy.context.scene.collection.objects.link(other)
    bpy.context.view_layer.update()
    assert shown(drawing, viewport) == [camera]
    for name in ("enabled", "show_projectors"):
        setattr(camera.scfpf, name, False)
        bpy.context.view_layer.update()
        assert shown(drawing, viewport) == []
        setattr(camera.scfpf, name, True)
        bpy.context.view_layer.update()
        assert shown(drawing, viewport) == [camera]


def test_hidden_cameras_are_not_drawn(drawing, camera, viewport):
    camera.hide_viewport = True
    bpy.context.view_layer.update()
    assert shown(drawing, viewport) == []
    camera.hide_viewport = False
    bpy.context.view_layer.update()
    camera.hide_set(True)
    assert shown(drawing, viewport) == []
    camera.hide_set(False)
    assert shown(drawing, viewport) == [camera]
    collection = bpy.data.collections.new("Cameras")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(camera)
    bpy.context.scene.collection.objects.unlink(camera)
    bpy.context.view_layer.layer_collection.children["Cameras"].exclude = True
    bpy.context.view_layer.update()
    assert shown(drawing, viewport) == []


def test_overlays_local_view_and_object_types_are_respected(drawing, camera, viewport):
    for owner, name in (
        (viewport.overlay, "show_overlays"),
        (viewport.overlay, "show_extras"),
        (viewport, "show_object_viewport_camera"),
    ):
        setattr(owner, name, False)
        assert shown(drawing, viewport) == []
        setattr(owner, name, True)
        assert shown(drawing, viewport) == [camera]
    other = bpy.data.objects.new("Other", None)
    bpy.context.scene.collection.objects.link(other)
    for selected in bpy.context.selected_objects:
        selected.select_set(False)
    other.select_set(True)
    bpy.context.view_layer.objects.active = other
    assert bpy.ops.view3d.localview(frame_selected=False) == {"FINISHED"}
    assert shown(drawing, viewport) == []
    bpy.ops.view3d.localview(frame_selected=False)
    assert shown(drawing, viewport) == [camera]


def test_a_camera_looked_through_does_not_draw_its_own_volume(drawing, camera, viewport, flexible):
    second = bpy.data.objects.new("Second", bpy.data.cameras.new("Second"))
    bpy.context.scene.collection.objects.link(second)
    flexible.make_flexible(second)
    bpy.context.scene.camera = camera
    bpy.context.view_layer.update()
    viewport.camera = camera
    assert shown(drawing, viewport) == [camera, second]
    assert shown(drawing, viewport, looking_through=True) == [second]


def test_another_scene_s_cameras_are_not_drawn(drawing, camera, viewport):
    assert shown(drawing, viewport) == [camera]
    other = bpy.data.scenes.new("Other")
    assert drawing.visible_cameras(other, other.view_layers[0], viewport, False) == []


def test_the_handler_draws_what_the_viewport_shows(gpu_context, drawing, camera, view, viewport):
    picture = shoot(view, drawing.draw_viewport)
    assert np.array_equal(picture, shoot(view, draw(drawing, camera)))
    camera.scfpf.enabled = False
    bpy.context.view_layer.update()
    assert not is_drawn(shoot(view, drawing.draw_viewport)).any()
    camera.scfpf.enabled = True
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 65536
    bpy.context.view_layer.update()
    assert not is_drawn(shoot(view, drawing.draw_viewport)).any()


def test_drawings_of_removed_cameras_are_forgotten(gpu_context, drawing, camera, view, viewport):
    shoot(view, drawing.draw_viewport)
    assert len(drawing.drawings) == 1
    bpy.data.objects.remove(camera)
    bpy.context.view_layer.update()
    shoot(view, drawing.draw_viewport)
    assert len(drawing.drawings) == 0


def test_loading_a_file_forgets_the_drawings(gpu_context, drawing, camera, view):
    shoot(view, draw(drawing, camera))
    assert len(drawing.drawings) == 1
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert len(drawing.drawings) == 0


def test_unregistering_removes_the_drawing(drawing):
    assert drawing._draw_handler.is_registered
    drawing.unregister()
    try:
        assert not drawing._draw_handler.is_registered
    finally:
        drawing.register()
    assert drawing._draw_handler.is_registered
