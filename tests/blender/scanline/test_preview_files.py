# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes preview in saved files, without the add-on, and with what other files hold."""

import os
import subprocess
import sys

import bpy
import pytest

pytestmark = pytest.mark.usefixtures("built_groups")


@pytest.fixture
def data(addon):
    return addon("scanline.preview.preview_data")


@pytest.fixture
def source(data):
    """The preview of a new flexible camera that looks at a cube."""
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.scfpf.camera_add()
    bpy.ops.scfpf.preview_toggle()
    return data.preview_of(bpy.context.scene.camera, bpy.context.scene)


def picture_points(source):
    """World positions of the preview's vertices as evaluated."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = source.scfpf_preview.parts[0].picture.evaluated_get(depsgraph)
    return [evaluated.matrix_world @ vertex.co for vertex in evaluated.data.vertices]


def extent(points):
    """The lowest and highest coordinates: matrices of overrides are rounded again when loaded."""
    return [limit(point[axis] for point in points) for limit in (min, max) for axis in range(3)]


def names(source):
    bpy.context.view_layer.update()
    return {member.name for member in source.all_objects}


def test_save_and_reload(source, data, tmp_path):
    before = picture_points(source)
    path = str(tmp_path / "preview.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    source = data.preview_of(bpy.context.scene.camera, bpy.context.scene)
    assert picture_points(source) == before
    bpy.ops.mesh.primitive_cube_add(location=(0, 0, 3))
    assert names(source) == {"Cube", "Cube.001"}
    bpy.context.view_layer.objects.active = bpy.context.scene.camera
    bpy.ops.scfpf.preview_toggle()
    assert data.previews() == []


def test_nodes_of_an_older_version_are_replaced_when_the_file_is_opened(source, data, addon, tmp_path):
    fields = addon("scanline.nodes.geometry_nodes")
    before = picture_points(source)
    for group in bpy.data.node_groups:
        if fields.BUILD_KEY in group:
            group[fields.BUILD_KEY] -= 1
    # What an older version would have drawn otherwise.
    old = bpy.data.node_groups["SCFPF Remap"]
    old.links.clear()
    path = str(tmp_path / "older.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    source = data.preview_of(bpy.context.scene.camera, bpy.context.scene)
    assert picture_points(source) == before
    builds = {group.get(fields.BUILD_KEY, fields.BUILD) for group in bpy.data.node_groups if group.users}
    assert builds == {fields.BUILD}
    # Not once more with each edit.
    count = len(bpy.data.node_groups)
    data.update_pictures(source)
    assert len(bpy.data.node_groups) == count


WITHOUT_ADDON = """
import bpy, os, sys
bpy.ops.wm.open_mainfile(filepath=sys.argv[-1])
picture = next(obj for obj in bpy.data.objects if obj.name.endswith(" Preview"))
def count():
    evaluated = picture.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return len(evaluated.data.vertices), sum(vertex.co.x for vertex in evaluated.data.vertices)
before = count()
bpy.data.objects["Cube"].location.x += 0.5
after = count()
print("POINTS", before[0], before[1] != after[1], flush=True)
os._exit(0)
"""


def test_a_file_works_without_the_add_on(source, tmp_path):
    path = tmp_path / "preview.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    environment = os.environ | {"BLENDER_USER_RESOURCES": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_ADDON, str(path)],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    told = next(line for line in done.stdout.splitlines() if line.startswith("POINTS"))
    assert told.split() == ["POINTS", str(len(picture_points(source))), "True"]


def write_library(tmp_path, obj):
    """Write an object into a file of its own, remove it here, and link it; returns the linked one."""
    path, name = str(tmp_path / "library.blend"), obj.name
    bpy.data.libraries.write(path, {obj})
    bpy.data.objects.remove(obj)
    with bpy.data.libraries.load(path, link=True) as (_, to):
        to.objects = [name]
    linked = next(obj for obj in bpy.data.objects if obj.library and obj.name == name)
    bpy.context.scene.collection.objects.link(linked)
    return linked


def test_linked_objects_are_shown(source, tmp_path):
    alone = len(picture_points(source))
    bpy.ops.mesh.primitive_cube_add(location=(0.5, 0, 0.5))
    bpy.context.object.name = "Linked"
    write_library(tmp_path, bpy.context.object)
    assert names(source) == {"Cube", "Linked"}
    assert len(picture_points(source)) > alone


def test_instances_of_linked_and_of_empty_collections_are_shown(source, tmp_path):
    alone = picture_points(source)
    held = bpy.data.collections.new("Held")
    bpy.ops.mesh.primitive_cube_add(location=(0, 0, 0))
    cube = bpy.context.object
    held.objects.link(cube)
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {held})
    bpy.data.batch_remove([cube, held])
    with bpy.data.libraries.load(path, link=True) as (_, to):
        to.collections = ["Held"]
    carrier = bpy.data.objects.new("Carrier", None)
    carrier.instance_type = "COLLECTION"
    bpy.context.scene.collection.objects.link(carrier)
    for held in (bpy.data.collections.new("Empty"), to.collections[0]):
        carrier.instance_collection = held
        assert names(source) == {"Cube", "Carrier"}
        assert (len(picture_points(source)) > len(alone)) == (held.library is not None)
    bpy.data.objects["Cube"].hide_render = True
    carrier.instance_collection = bpy.data.collections["Empty"]
    names(source)
    assert picture_points(source) == []


def test_a_linked_camera_is_refused(data, tmp_path):
    bpy.ops.scfpf.camera_add()
    linked = write_library(tmp_path, bpy.context.scene.camera)
    bpy.context.view_layer.objects.active = linked
    with pytest.raises(RuntimeError, match="make a library override"):
        bpy.ops.scfpf.preview_toggle()
    assert data.previews() == []


def test_a_file_that_is_linked_brings_no_preview(source, data, tmp_path):
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(path, link=True) as (_, to):
        to.scenes = ["Scene"]
    bpy.context.view_layer.update()
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.view_layer.update()
    assert data.previews() == []


def test_an_overridden_camera_is_previewed(data, tmp_path):
    bpy.ops.mesh.primitive_cube_add()
    rig = bpy.data.collections.new("Rig")
    bpy.context.scene.collection.children.link(rig)
    bpy.context.view_layer.active_layer_collection = bpy.context.view_layer.layer_collection.children["Rig"]
    bpy.ops.scfpf.camera_add()
    library = str(tmp_path / "library.blend")
    bpy.data.libraries.write(library, {rig})
    bpy.data.batch_remove([*rig.objects, rig])
    with bpy.data.libraries.load(library, link=True) as (_, to):
        to.collections = ["Rig"]
    linked = to.collections[0]
    bpy.context.scene.collection.children.link(linked)
    linked.override_hierarchy_create(bpy.context.scene, bpy.context.view_layer, do_fully_editable=True)

    def camera():
        return next(o for o in bpy.context.scene.objects if o.type == "CAMERA" and o.override_library)

    def toggle():
        bpy.context.view_layer.update()
        bpy.context.view_layer.objects.active = camera()
        assert bpy.ops.scfpf.preview_toggle() == {"FINISHED"}
        return data.preview_of(camera(), bpy.context.scene)

    source = toggle()
    before = picture_points(source)
    # The overridden volume object, which has no faces, may be among them.
    assert before and names(source) - {"Flexible Camera Volume"} == {"Cube"}
    path = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    source = data.preview_of(camera(), bpy.context.scene)
    assert extent(picture_points(source)) == pytest.approx(extent(before), abs=1e-4)
    camera().scfpf.basis = "POLYLINE"
    assert names(source) - {"Flexible Camera Volume"} == {"Cube"}
    assert toggle() is None
    assert not [o.name for o in bpy.data.objects if "Table" in o.name or "Preview" in o.name]
