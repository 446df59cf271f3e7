# SPDX-License-Identifier: GPL-3.0-or-later
"""The projection that is read is the one that is there now, whatever hides its surfaces."""

import importlib
import itertools
import sys

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

FRAMES = (1, 6, 11)
# Blender's matrices, parameters and vertices are float32; lengths here are below 20.
FLOAT32 = 1e-5
ALL = tuple(axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 3)))


@pytest.fixture
def nodes(addon):
    return addon("bridge.surfaces.surface_object")


@pytest.fixture
def pure(addon):
    return addon("projection.surfaces.surface")


@pytest.fixture
def camera():
    made = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(made)
    bpy.context.scene.camera = made
    return made


@pytest.fixture
def in_render():
    """Calls a function with the render depsgraph of the current frame, as a render engine sees it."""

    class Probe(bpy.types.RenderEngine):
        bl_idname = "SCFPF_TEST_PROBE"
        bl_label = "Probe"
        act = None
        answer = None

        def render(self, depsgraph):
            try:
                Probe.answer = Probe.act(depsgraph)
            except Exception as error:
                Probe.answer = error
            result = self.begin_result(0, 0, 4, 4)
            result.layers[0].passes["Combined"].rect.foreach_set(np.zeros(64, np.float32))
            self.end_result(result)

    bpy.utils.register_class(Probe)

    def call(act):
        render = bpy.context.scene.render
        render.engine = Probe.bl_idname
        render.resolution_x = render.resolution_y = 4
        render.resolution_percentage = 100
        Probe.act, Probe.answer = staticmethod(act), None
        bpy.ops.render.render()
        if isinstance(Probe.answer, Exception):
            raise Probe.answer
        return Probe.answer

    yield call
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    bpy.utils.unregister_class(Probe)


def in_viewport(act):
    return act(bpy.context.evaluated_depsgraph_get())


def key(owner, path, values):
    """Key values at the frames, straight lines between them."""
    for frame, value in zip(FRAMES, values, strict=True):
        if path.startswith("["):
            owner[path[2:-2]] = value
        else:
            setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)


def animated_camera(bridge, nodes, camera):
    """A moving camera with a plane, a displaced cylinder and a shape-keyed grid, all keyed."""
    within = bpy.data.collections.new("Within")
    bpy.context.scene.collection.children.link(within)
    within.objects.link(camera)
    bpy.context.scene.collection.objects.unlink(camera)
    bridge.make_flexible(camera)
    key(camera, "location", [(0, f, 0) for f in FRAMES])
    plane = bridge.add_surface(camera, "PLANE", "Plane")
    key(plane, "location", [(f, 0, -1) for f in FRAMES])
    cylinder = bridge.add_surface(camera, "CYLINDER", "Cylinder")
    for surface, label, values in (
        (plane, "Width", [2.0 * f for f in FRAMES]),
        (cylinder, "Radius", [3.0 + f for f in FRAMES]),
    ):
        owner, path = {name: place for name, *place in nodes.parameter_properties(surface)}[label]
        key(owner, path, values)
    displace = cylinder.modifiers.new("Displace", "DISPLACE")
    displace.direction, displace.mid_level = "Z", 0.0
    key(displace, "strength", [0.5 * f for f in FRAMES])
    points = np.random.default_rng(1).normal(size=(3, 4, 3)).astype(np.float32).astype(float)
    grid = bridge.add_surface(camera, "GRID", "Grid", points=points)
    grid.shape_key_add(name="Basis")
    up = grid.shape_key_add(name="Up")
    for vertex in up.data:
        vertex.co.y += 1
    up.slider_max = 10
    key(up, "value", [0.25 * f for f in FRAMES])
    return plane, cylinder, grid, points


def expected_surfaces(pure, frame, points):
    world = np.eye(4)
    world[1, 3] = frame
    plane = world.copy()
    plane[:3, 3] += (frame, 0, -1)
    columns, rows = (np.arange(n + 1) / n for n in (32, 4))
    cylinder = pure.Cylinder(3.0 + frame, 2 * np.pi, 1.0)
    u, v = (axis.ravel() for axis in np.meshgrid(columns, rows))
    ring = cylinder.evaluate(u, v).position.T.reshape(5, 33, 3) + np.array([0, 0, 0.5 * frame])
    return (
        pure.Plane(2.0 * frame, 1.0, matrix=plane),
        pure.Grid(ring, matrix=world),
        pure.Grid(points + np.array([0, 0.25 * frame, 0]), matrix=world),
    )


def hide(surfaces, view_layer, hide_render, hide_viewport, eye, excluded):
    layer = view_layer.layer_collection.children["Within"]
    layer.exclude = False
    for surface in surfaces:
        surface.hide_viewport = False
        surface.hide_set(eye)
        surface.hide_render, surface.hide_viewport = hide_render, hide_viewport
    layer.exclude = excluded


def agrees(projection, expected):
    for read, exact in zip(projection.volume.surfaces, expected, strict=True):
        assert type(read) is type(exact)
        assert np.abs(read.evaluate(*ALL).position - exact.evaluate(*ALL).position).max() < FLOAT32


@pytest.mark.parametrize("hidden", list(itertools.product((False, True), repeat=4)))
def test_surfaces_are_current_however_hidden(bridge, reading, nodes, pure, camera, in_render, hidden):
    """hide_render, hide_viewport, eye and exclusion in every combination; both depsgraphs."""
    *surfaces, points = animated_camera(bridge, nodes, camera)
    hide(surfaces, bpy.context.view_layer, *hidden)
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        for through in (in_viewport, in_render):
            projection = through(lambda depsgraph: reading.read_projection(camera, depsgraph, 1.5))
            agrees(projection, expected_surfaces(pure, frame, points))
            assert projection.aspect == 1.5


@pytest.mark.parametrize(
    "switch", ["collection.hide_render", "collection.hide_viewport", "layer.hide_viewport"]
)
def test_surfaces_are_current_in_a_hidden_collection(bridge, reading, nodes, pure, camera, in_render, switch):
    *_, points = animated_camera(bridge, nodes, camera)
    owner = {
        "collection": bpy.data.collections["Within"],
        "layer": bpy.context.view_layer.layer_collection.children["Within"],
    }[switch.split(".")[0]]
    setattr(owner, switch.split(".")[1], True)
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        for through in (in_viewport, in_render):
            projection = through(lambda depsgraph: reading.read_projection(camera, depsgraph, 1.5))
            agrees(projection, expected_surfaces(pure, frame, points))


def test_settings_are_read_as_animated(bridge, reading, nodes, camera, in_render):
    animated_camera(bridge, nodes, camera)
    settings = camera.scfpf
    settings.basis, settings.reparameterisation = "POLYLINE", "POLAR"
    key(settings, "u_range", [(0.0, 1.0), (0.25, 0.75), (0.5, 0.625)])
    for frame, ends in zip(FRAMES, [(0.0, 1.0), (0.25, 0.75), (0.5, 0.625)], strict=True):
        bpy.context.scene.frame_set(frame)
        for through in (in_viewport, in_render):
            projection = through(lambda depsgraph: reading.read_projection(camera, depsgraph, 1.0))
            assert projection.u_range == pytest.approx(ends)
            assert projection.volume.basis == "POLYLINE"
            assert type(projection.reparameterisation).__name__ == "Polar"


def read(reading, camera, aspect=1.0):
    return reading.read_projection(camera, bpy.context.evaluated_depsgraph_get(), aspect)


def near_and_far(bridge, camera):
    bridge.make_flexible(camera)
    near = bridge.add_surface(camera, "PLANE", "Near", Matrix.Translation((0, 0, -1)), {"width": 2})
    far = bridge.add_surface(camera, "SPHERE", "Far", Matrix.Translation((0, 0, -9)), {"radius": 4})
    return near, far


@pytest.fixture
def without_handlers(addon):
    """Without the handler that would bring a lost volume object back."""
    events = addon("events")
    events.unregister()
    yield
    events.register()


def test_a_lost_volume_object_is_named_or_not_needed(without_handlers, bridge, reading, pure, camera):
    _, far = near_and_far(bridge, camera)
    bpy.data.objects.remove(camera.scfpf.volume_object)
    assert len(read(reading, camera).volume.surfaces) == 2
    far.hide_viewport = True
    with pytest.raises(reading.UserError, match=r"'Far' is hidden.*volume object"):
        read(reading, camera)
    bridge.sync_volume_object(camera)
    assert read(reading, camera).volume.surfaces[1].radius == 4
    volume = camera.scfpf.volume_object
    for owner, switch, value in (
        (volume, "hide_viewport", True),
        (volume.modifiers[0], "show_viewport", False),
    ):
        setattr(owner, switch, value)
        with pytest.raises(reading.UserError, match="'Far' is hidden"):
            read(reading, camera)
        assert bridge.sync_volume_object(camera) == volume
        assert read(reading, camera).volume.surfaces[1].radius == 4


def test_a_modifier_makes_a_parametric_surface_a_grid_only_while_it_acts(bridge, reading, camera, in_render):
    near, _ = near_and_far(bridge, camera)
    bend = near.modifiers.new("Displace", "DISPLACE")
    seen = {}
    for viewport, render in itertools.product((False, True), repeat=2):
        bend.show_viewport, bend.show_render = viewport, render
        seen[viewport, render] = [
            type(through(lambda d: reading.read_projection(camera, d, 1.0)).volume.surfaces[0]).__name__
            for through in (in_viewport, in_render)
        ]
    assert seen == {
        (v, r): ["Grid" if v else "Plane", "Grid" if r else "Plane"]
        for v, r in itertools.product((False, True), repeat=2)
    }


def test_a_subdivided_patch_is_a_grid(bridge, reading, camera):
    near_and_far(bridge, camera)
    patch = bridge.add_surface(camera, "PATCH", "Patch")
    assert type(read(reading, camera).volume.surfaces[2]).__name__ == "BilinearPatch"
    patch.modifiers.new("Subdivision", "SUBSURF").levels = 1
    assert read(reading, camera).volume.surfaces[2].points.shape == (3, 3, 3)


def test_world_space_is_float64_of_the_evaluated_matrices(bridge, reading, camera):
    near, _ = near_and_far(bridge, camera)
    camera.matrix_world = Matrix.LocRotScale((1e4, -2e4, 30), Euler((0.1, 2, 3)), (2, 2, 2))
    surface = read(reading, camera).volume.surfaces[0]
    assert surface.matrix.dtype == np.float64
    evaluated = near.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert np.array_equal(surface.matrix, np.array(evaluated.matrix_world, np.float64))


def no_surfaces(bridge, camera, near, far):
    bridge.clear_surfaces(camera)


def one_surface(bridge, camera, near, far):
    bridge.remove_surface(camera, 0)


def empty_slot(bridge, camera, near, far):
    camera.scfpf.surfaces.add()


def deleted_surface(bridge, camera, near, far):
    with bpy.context.temp_override(selected_objects=[far]):
        bpy.ops.object.delete()
    assert camera.scfpf.surfaces[1].object == far


def other_scene(bridge, camera, near, far):
    bpy.context.scene.collection.objects.unlink(far)
    bpy.data.scenes.new("Other").collection.objects.link(far)


def no_scene(bridge, camera, near, far):
    bpy.context.scene.collection.objects.unlink(far)
    bpy.data.collections.new("Assets").objects.link(far)


def camera_in_another_scene(bridge, camera, near, far):
    for obj in (camera, near, far):
        bpy.context.scene.collection.objects.unlink(obj)
        (bpy.data.scenes.get("Other") or bpy.data.scenes.new("Other")).collection.objects.link(obj)


def wrong_type(bridge, camera, near, far):
    light = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    bpy.context.scene.collection.objects.link(light)
    camera.scfpf.surfaces[1].object = light


def no_kind(bridge, camera, near, far):
    far.scfpf_surface.kind = "NONE"


def wrong_group(bridge, camera, near, far):
    """A cylinder's group has all the inputs of a disc, and one more."""
    cylinder, disc = (bridge.add_surface(camera, kind) for kind in ("CYLINDER", "DISC"))
    disc.modifiers[0].node_group = cylinder.modifiers[0].node_group


def zero_scale(bridge, camera, near, far):
    far.scale.y = 0


def zero_parent(bridge, camera, near, far):
    camera.scale = 0, 0, 0


def not_finite(bridge, camera, near, far):
    far.location.x = float("inf")


def not_a_number(bridge, camera, near, far):
    far.delta_location.x = float("nan")


def no_group(bridge, camera, near, far):
    bpy.data.node_groups.remove(far.modifiers[0].node_group)


def no_grid(bridge, camera, near, far):
    far.scfpf_surface.kind = "GRID"
    far.data.clear_geometry()


def broken_by_modifier(bridge, camera, near, far):
    far.scfpf_surface.kind = "GRID"
    far.modifiers.new("Decimate", "DECIMATE").ratio = 0.5


def as_grid(far, place, value):
    """A regular grid one of whose coordinates is no number, or infinite."""
    far.modifiers.clear()
    far.scfpf_surface.kind = "GRID"
    points = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 1.0], [0.0]), axis=-1)[:, :, 0]
    write_grid = importlib.import_module(f"{bridge_package()}.blender.mesh_grid").write_grid
    write_grid(far.data, points)
    far.data.vertices[place].co.y = value
    far.data.update()


def bridge_package():
    return next(name for name in sys.modules if name.endswith("scfpf_addon.bridge"))


def grid_vertex_no_number(bridge, camera, near, far):
    as_grid(far, 2, float("nan"))


def grid_vertex_infinite(bridge, camera, near, far):
    as_grid(far, 5, float("-inf"))


def reshaped_vertex_no_number(bridge, camera, near, far):
    far.modifiers.new("Cast", "CAST").factor = 1e30


def near_is_far(bridge, camera, near, far):
    camera.scfpf.surfaces[1].object = near


def equal_planes(bridge, camera, near, far):
    twin = near.copy()
    bpy.context.scene.collection.objects.link(twin)
    camera.scfpf.surfaces[1].object = twin


def empty_range(bridge, camera, near, far):
    camera.scfpf.v_range = 0.5, 0.5


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (no_surfaces, "'Camera' has no control surface:.*at least two"),
        (one_surface, "'Camera' has 1 control surface:.*at least two"),
        (empty_slot, "surface 3 of 'Camera' is empty"),
        (deleted_surface, "'Far' was deleted: undo"),
        (other_scene, "'Far' is in the scene 'Other', not in 'Scene': link it .*Link Objects to Scene"),
        (no_scene, "'Far' is in no scene: drag its collection 'Assets' into 'Scene'"),
        (
            camera_in_another_scene,
            "'Near' and its camera 'Camera' are in the scene 'Other'.*: go to that scene",
        ),
        (wrong_type, "'Lamp' is of type Light"),
        (no_kind, "'Far' is not a control surface"),
        (wrong_group, "'Disk' has no node group with just the inputs Radius, Arc, Resolution"),
        (zero_scale, "'Far' has no size"),
        (zero_parent, "'Near' has no size"),
        (not_finite, "'Far' is not finite"),
        (not_a_number, "'Far' is not finite"),
        (no_group, "'Far' has no node group"),
        (no_grid, "'Far' has no vertices"),
        (broken_by_modifier, "'Far' is not a regular grid|'Far' has a seam"),
        (empty_range, "V range of 'Camera' is empty"),
        (grid_vertex_no_number, "'Far' has vertices that are not finite"),
        (grid_vertex_infinite, "'Far' has vertices that are not finite"),
        (reshaped_vertex_no_number, "'Far' has vertices that are not finite"),
        (near_is_far, "All control surfaces of 'Camera' lie in one place.*'Near' is on the list twice"),
        (equal_planes, "All control surfaces of 'Camera' lie in one place.*move one of them"),
    ],
)
def test_bad_input_is_named(bridge, reading, camera, damage, message):
    near, far = near_and_far(bridge, camera)
    damage(bridge, camera, near, far)
    with pytest.raises(reading.UserError, match=message):
        read(reading, camera)


@pytest.mark.parametrize("aspect", [0.0, -1.0, float("nan"), float("inf")])
def test_a_picture_without_size_is_refused(bridge, reading, camera, aspect):
    near_and_far(bridge, camera)
    with pytest.raises(reading.UserError, match="resolution"):
        read(reading, camera, aspect)


def test_a_point_may_have_no_scale(bridge, reading, camera):
    near_and_far(bridge, camera)
    point = bridge.add_surface(camera, "POINT", index=0)
    point.scale = 0, 0, 0
    assert type(read(reading, camera).volume.surfaces[0]).__name__ == "Point"
    point.location.x = float("nan")
    with pytest.raises(reading.UserError, match="'Point' is not finite"):
        read(reading, camera)


def test_a_deleted_surface_of_a_doubled_name_is_found(bridge, reading, camera):
    """The scene's object of the same name is another one."""
    _, far = near_and_far(bridge, camera)
    bpy.context.scene.collection.objects.unlink(far)
    far.name = "Old"
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Far", None))
    with pytest.raises(reading.UserError, match="'Old' was deleted"):
        read(reading, camera)
