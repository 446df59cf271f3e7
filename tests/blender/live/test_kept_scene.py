# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene that Live View keeps follows every edit, and only what has changed is read and built again."""

import gc
import pathlib

import bmesh
import bpy
import numpy as np
import pytest

PRESETS = pathlib.Path(__file__).resolve().parents[3] / "presets"
SIZE = (48, 27)


@pytest.fixture
def street(addon):
    """A floor, boxes, a ball, an instanced collection, a curve; a flexible camera before them."""
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=30)
    for number in range(4):
        bpy.ops.mesh.primitive_cube_add(size=1.4, location=(2.2 * number - 3.3, 0, 0.7))
        bpy.context.object.name = f"Box {number}"
    bpy.ops.mesh.primitive_uv_sphere_add(location=(0, 3, 2))
    bpy.ops.object.shade_smooth()
    bpy.context.object.name = "Ball"
    bpy.ops.curve.primitive_bezier_circle_add(location=(4, 3, 2), rotation=(1.5, 0, 0))
    bpy.context.object.data.bevel_depth = 0.2
    group = bpy.data.collections.new("Group")
    mesh = bpy.data.meshes.new("Tent")
    mesh.from_pydata([(0, 0, 1.5), (-1, -1, 0), (1, -1, 0), (0, 1, 0)], [], [(0, 1, 2), (0, 2, 3), (0, 3, 1)])
    group.objects.link(bpy.data.objects.new("Tent", mesh))
    for number, x in enumerate((-2.2, 2.2)):
        tents = bpy.data.objects.new(f"Tents {number}", None)
        tents.instance_type, tents.instance_collection, tents.location = "COLLECTION", group, (x, -2, 0)
        scene.collection.objects.link(tents)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0, -11, 2.5), (1.45, 0, 0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    presets = addon("projection.presets.preset")
    flexible = addon("bridge.camera.flexible_camera")
    preset = presets.read_preset(PRESETS / "perspective.json")
    flexible.apply_preset(camera, preset, SIZE[0] / SIZE[1])
    bpy.context.view_layer.update()
    return camera


class Followed:
    """The live view of a camera, compared with the scene that renders read."""

    def __init__(self, addon, camera):
        self.camera = camera
        self.views, self.drawing = addon("bridge.live.live_view"), addon("bridge.live.live_drawing")
        self._casting, self._scenes = addon("shading.live.cast_live"), addon("shading.live.live_scene")
        self._read_scene = addon("bridge.scene.read_scene").read_scene
        self._inputs = addon("bridge.render.render_inputs")
        self.view = self.views.LiveView()
        self.source.objects.read(self.depsgraph)

    @property
    def depsgraph(self):
        return bpy.context.evaluated_depsgraph_get()

    @property
    def source(self):
        self.view.source = self.views.source_of(self.depsgraph)
        return self.view.source

    def hits(self):
        """The hits of the kept scene, its objects by name."""
        source = self.source
        scene = source.kept.updated(source.objects.read(self.depsgraph))
        hits = self._cast(scene)
        names = [key.name for key in source.objects.table.objects]
        return hits, [None if number < 0 else names[number] for number in hits.object]

    def expected(self):
        """The hits of everything that a render shows, read anew."""
        geometry = self._read_scene(self.depsgraph, may_be_empty=True).geometry
        hits = self._cast(self._scenes.LiveScene.built(geometry))
        names = geometry.object_names
        return hits, [None if number < 0 else names[number] for number in hits.object]

    def _cast(self, scene):
        casting = self._casting
        projection = self._inputs.read_view(self.depsgraph, self.camera, SIZE[0] / SIZE[1])
        window = casting.LiveWindow(0.0, 0.0, 1.0, 1.0, *SIZE)
        return casting.cast_live(scene, casting.LiveProjection.of(projection), window)

    def check(self):
        """Compare both, and return the names of the objects that are seen."""
        bpy.context.view_layer.update()
        (found, names), (expected, expected_names) = self.hits(), self.expected()
        # A pixel on an edge may fall to either side.
        same = np.array([one == other for one, other in zip(names, expected_names, strict=True)])
        assert same.mean() > 0.995
        for one, other in ((found.position, expected.position), (found.normal, expected.normal)):
            np.testing.assert_allclose(one[:, same], other[:, same], atol=2e-3)
        return set(names) - {None}

    @property
    def built(self):
        """The numbers of builds of the whole scene and of a part of it."""
        return self.source.kept.wholes, self.source.kept.parts


@pytest.fixture
def followed(addon, street):
    made = Followed(addon, street)
    yield made
    made.view.painter.stop()


def arrays(followed):
    """The arrays of meshes by the names of their objects."""
    objects = followed.source.objects
    return {
        objects.table.objects[place.number].name: place.mesh
        for place in objects.read(followed.depsgraph).values()
    }


def test_what_is_seen(followed):
    assert {"Plane", "Box 1", "Ball", "Tent"} <= followed.check()
    assert followed.built == (1, 0)
    followed.check()
    assert followed.built == (1, 0)


def test_surfaces_and_cameras_move_and_nothing_is_read(followed, monkeypatch):
    followed.check()
    before = arrays(followed)
    monkeypatch.setattr(type(followed.source.objects), "_read", None)
    for change in (
        lambda: setattr(followed.camera.scfpf.surfaces[1].object.location, "x", 0.5),
        lambda: setattr(followed.camera.location, "z", 3.0),
        lambda: setattr(followed.camera.scfpf.surfaces[1].object.rotation_euler, "z", 0.3),
    ):
        change()
        followed.check()
    assert followed.built == (1, 0)
    assert all(arrays(followed)[name] is mesh for name, mesh in before.items())


def test_an_object_moves(followed):
    followed.check()
    before = arrays(followed)
    for step in range(3):
        bpy.data.objects["Box 1"].location.x += 0.3
        followed.check()
        assert followed.built == (1, step + 1)
    bpy.data.objects["Ball"].scale.z = -1.3
    followed.check()
    assert all(arrays(followed)[name] is mesh for name, mesh in before.items())


def test_a_mesh_is_edited(followed):
    followed.check()
    before = arrays(followed)
    bpy.data.meshes["Cube.001"].vertices[3].co.x += 0.8
    bpy.data.meshes["Cube.001"].update()
    followed.check()
    after = arrays(followed)
    assert {name for name, mesh in before.items() if after[name] is not mesh} == {"Box 1"}
    assert followed.built == (1, 1)


def test_edit_mode(followed):
    followed.check()
    box = bpy.data.objects["Box 2"]
    bpy.context.view_layer.objects.active = box
    bpy.ops.object.mode_set(mode="EDIT")
    for step in range(2):
        before = followed.hits()[0].position
        mesh = bmesh.from_edit_mesh(box.data)
        mesh.verts.ensure_lookup_table()
        mesh.verts[0].co.z += 1.0
        bmesh.update_edit_mesh(box.data)
        assert np.abs(followed.hits()[0].position - before).max() > 0.1, step
        followed.check()
    bpy.ops.object.mode_set(mode="OBJECT")
    followed.check()
    assert followed.built[0] == 1


def test_hidden_deleted_and_new(followed):
    assert "Box 1" in followed.check()
    box = bpy.data.objects["Box 1"]
    for name in ("hide_viewport", "hide_render"):
        setattr(box, name, True)
        assert "Box 1" not in followed.check()
        setattr(box, name, False)
        assert "Box 1" in followed.check()
    box.hide_set(True)
    assert "Box 1" not in followed.check()
    box.hide_set(False)
    assert "Box 1" in followed.check()
    bpy.data.objects.remove(bpy.data.objects["Box 2"])
    assert "Box 2" not in followed.check()
    bpy.ops.mesh.primitive_monkey_add(location=(0, -2, 2))
    assert "Suzanne" in followed.check()
    for obj in [o for o in bpy.data.objects if o.type in {"MESH", "CURVE", "EMPTY"}]:
        if not obj.hide_render:
            obj.hide_viewport = True
    assert followed.check() == set()


def test_instances(followed):
    followed.check()
    for change in (
        lambda: setattr(bpy.data.objects["Tents 0"].location, "x", -2.0),
        lambda: setattr(bpy.data.meshes["Tent"].vertices[0].co, "z", 3.0),
        lambda: setattr(bpy.data.objects["Tent"].location, "x", 1.0),
    ):
        change()
        bpy.data.meshes["Tent"].update()
        followed.check()
    bpy.data.objects["Tents 0"].location = (0, -3, 0)
    assert "Tent" in followed.check()


def test_geometry_nodes(followed):
    """Points of a grid with instances of an object, whose own mesh is edited then."""
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    grid, on, info, out = (
        tree.nodes.new(kind)
        for kind in (
            "GeometryNodeMeshGrid",
            "GeometryNodeInstanceOnPoints",
            "GeometryNodeObjectInfo",
            "NodeGroupOutput",
        )
    )
    grid.inputs["Size X"].default_value = grid.inputs["Size Y"].default_value = 5.0
    info.inputs["Object"].default_value = bpy.data.objects["Box 3"]
    info.inputs["As Instance"].default_value = True
    tree.links.new(grid.outputs["Mesh"], on.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], on.inputs["Instance"])
    tree.links.new(on.outputs["Instances"], out.inputs[0])
    owner = bpy.data.objects.new("Scattered", bpy.data.meshes.new("Scattered"))
    owner.location = (0, 0, 3)
    bpy.context.scene.collection.objects.link(owner)
    owner.modifiers.new("Scatter", "NODES").node_group = tree
    followed.check()
    bpy.data.meshes["Cube.003"].vertices[0].co.x -= 0.5
    bpy.data.meshes["Cube.003"].update()
    followed.check()
    on.inputs["Scale"].default_value = (0.5, 0.5, 2.0)
    followed.check()
    grid.inputs["Vertices X"].default_value = 4
    followed.check()


def test_animation(followed):
    ball, surface = bpy.data.objects["Ball"], followed.camera.scfpf.surfaces[1].object
    for frame, x in ((1, -2.0), (5, 2.0)):
        ball.location.x = x
        ball.keyframe_insert("location", frame=frame)
        surface.location.x = x / 4
        surface.keyframe_insert("location", frame=frame)
    followed.check()
    for frame in (2, 3, 5, 1):
        bpy.context.scene.frame_set(frame)
        followed.check()
    assert followed.built[0] == 1


def test_undo(followed):
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.ed.undo_push(message="Before")
    followed.check()
    bpy.data.objects["Box 1"].location.z = 3.0
    bpy.data.meshes["Cube"].vertices[0].co.x -= 1.0
    bpy.data.meshes["Cube"].update()
    bpy.ops.ed.undo_push(message="Edit")
    followed.check()
    moved = followed.hits()[0].position
    bpy.ops.ed.undo()
    followed.camera = bpy.context.scene.camera
    followed.check()
    assert bpy.data.objects["Box 1"].location.z < 1.0
    assert np.abs(followed.hits()[0].position - moved).max() > 0.1
    bpy.ops.ed.redo()
    followed.camera = bpy.context.scene.camera
    followed.check()
    # Nearly all meshes are as they were.
    assert followed.built[0] == 1


def test_much_moves_and_settles(followed):
    followed.check()
    bpy.data.objects["Ball"].location.x += 0.5
    bpy.data.objects["BézierCircle"].location.x += 0.5
    followed.check()
    # They have most of the triangles: all is built at once.
    assert followed.built == (2, 0)
    for number in range(4):
        bpy.data.objects[f"Box {number}"].location.z += 0.2
        followed.check()
    assert followed.built == (2, 4)
    assert not followed.source.kept.settle()
    for number in range(4):
        modifier = bpy.data.objects[f"Box {number}"].modifiers.new("Finer", "SUBSURF")
        modifier.levels = 2
    followed.check()
    assert followed.source.kept.settle()
    assert followed.built[0] == 3
    followed.check()
    assert followed.built[0] == 3


def test_transforms_that_are_not_finite(followed):
    bpy.data.objects["Box 1"].scale.x = float("inf")
    followed.check()
    bpy.data.objects["Box 1"].scale.x = 0.0
    followed.check()


def test_scenes_are_apart_and_nothing_stays(followed):
    followed.check()
    other, source_of = bpy.data.scenes.new("Other"), followed.views.source_of
    with bpy.context.temp_override(scene=other, view_layer=other.view_layers[0]):
        kept = source_of(bpy.context.evaluated_depsgraph_get())
        assert not kept.objects.read(bpy.context.evaluated_depsgraph_get())
    assert len(followed.views.sources()) == 2
    kept = followed.view.source = None
    gc.collect()
    assert followed.views.sources() == []
