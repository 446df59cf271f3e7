# SPDX-License-Identifier: GPL-3.0-or-later
"""The rig's sheets are where the exact volume is, of whatever surfaces it is made; no pictures are needed."""

import bpy
import numpy as np
import pytest
from rig_scenes import keep_groups, rectangle, reference, start_anew, switch

# Tables are linear in cells of a 256th: what a turn's arc is off by there, as a share of the volume's size.
OFF = 3e-4
# A lens without falloff has an edge, and cells across it are in between.
LENS_OFF = 2e-3
SURFACES = ("POINT", "PATCH", "DISC", "CYLINDER", "CONE", "SPHERE", "GRID", "NURBS", "UV_MESH")


@pytest.fixture(autouse=True)
def empty_file(extension):
    """In place of an empty file."""
    start_anew()
    yield
    keep_groups()


@pytest.fixture
def camera(addon):
    camera = reference.add_camera(96, 54)
    camera.location, camera.rotation_euler = (0.4, -0.6, 0.3), (1.4, 0.1, 0.5)
    flexible = addon("bridge.camera.flexible_camera")
    flexible.make_flexible(camera)
    flexible.clear_surfaces(camera)
    for described in ((1.6, 0.9, 1), (8, 4.5, 20, 3.0)):
        kind, matrix, parameters, points = rectangle(*described)
        flexible.add_surface(camera, kind, matrix=matrix, parameters=parameters, points=points)
    camera.scfpf.pixel_error = 0.3
    camera.scfpf.active_surface = 0
    bpy.context.view_layer.objects.active = camera
    bpy.context.view_layer.update()
    return camera


def sheets_off(addon, camera):
    """Largest distance of the sheets' vertices from the volume, as a share of its size, where both exist."""
    rig = addon("cycles.rig_data").rig_of(bpy.context.scene)
    portals = rig.scfpf_rig.portals
    addon("cycles.skipping.refresh").stop_skipping(rig)
    rig.hide_viewport = portals.hide_viewport = False
    bpy.context.view_layer.update()
    mesh = portals.evaluated_get(bpy.context.evaluated_depsgraph_get()).data

    def values(data, name, width):
        attribute = data.attributes[name]
        flat = np.empty(width * len(attribute.data), np.float32)
        attribute.data.foreach_get({1: "value", 3: "vector"}[width], flat)
        return flat.reshape(-1, width).T.astype(np.float64)

    # Breaks and the surround come first, then a sheet for each break.
    x, y, number = values(portals.data, "position", 3)
    x, y = (a[number < -2.5] for a in (x, y))
    breaks, shifts = addon("cycles.rig_data").present_chords(rig)
    number = np.repeat(np.arange(len(breaks)), len(x))
    x, y = (np.tile(a, len(breaks)) for a in (x, y))
    there = values(mesh, "position", 3)[:, -len(x) :]
    scene = bpy.context.scene.render
    projection = addon("bridge.camera.read_projection").read_projection(
        camera, bpy.context.evaluated_depsgraph_get(), scene.resolution_x / scene.resolution_y
    )
    places = addon("cycles.portals.sheets")
    inside = (np.minimum(x, y) >= 0) & (np.maximum(x, y) <= 1) & (number >= 1)
    if addon("projection.mappings.stack").is_disc(projection.reparameterisation, projection.aspect):
        x, y = places.disc_places(x, y, projection.aspect)
    image = projection.parameters(x, y)
    controls = projection.volume.controls(image.u, image.v)
    usable = inside & image.mask & controls.valid
    largest, spans, size = 0.0, projection.volume.spans, np.ptp(there[:, usable], axis=1).max()
    for sheet, (at, by) in enumerate(zip(breaks, shifts, strict=True)):
        which = np.flatnonzero(usable & (number == sheet))
        if len(which) == 0:
            continue
        span = int(np.clip(np.searchsorted(spans.breaks, at) - 1, 0, len(spans.matrices) - 1))
        low, high = spans.breaks[span : span + 2]
        weights, _, bends = spans.within(span, np.array([(at - low) / (high - low)]))
        exact = np.einsum("k,kcs->cs", (weights - by * bends)[0], controls.points[:, :, which])
        largest = max(largest, np.abs(exact - there[:, which]).max() / size)
    assert usable.any()
    return largest


@pytest.mark.parametrize("kind", SURFACES)
def test_sheets_follow_every_kind_of_surface(addon, camera, kind):
    assert bpy.ops.scfpf.surface_add(kind=kind) == {"FINISHED"}
    camera.scfpf.surfaces[1].object.location.x += 2.0
    bpy.context.view_layer.update()
    assert switch(camera) == {"FINISHED"}
    off = sheets_off(addon, camera)
    print(kind, off)
    assert off < OFF


def test_a_lattice_is_refused_in_words(addon, camera):
    """Before a rig is made, and when its volume becomes one."""
    assert switch(camera) == {"FINISHED"}
    rig = addon("cycles.rig_data").rig_of(bpy.context.scene)
    assert rig.scfpf_rig.problem == ""
    assert bpy.ops.scfpf.volume_to_lattice(points_u=3, points_v=3, points_w=3) == {"FINISHED"}
    bpy.context.view_layer.update()
    assert "cannot follow the lattice" in rig.scfpf_rig.problem
    assert switch(camera) == {"FINISHED"}
    with pytest.raises(RuntimeError, match="cannot follow the lattice"):
        switch(camera)


@pytest.mark.parametrize("name", ["blend", "mappings", "polar mapping"])
def test_sheets_follow_what_is_made_of_a_whole_volume(addon, camera, name):
    if name == "blend":
        assert bpy.ops.scfpf.camera_blend_preset(preset="curved_convergence") == {"FINISHED"}
        camera = bpy.context.object
    else:
        if name == "polar mapping":
            camera.scfpf.reparameterisation = "POLAR"
        for kind in ("RADIAL_CURVE", "LENS"):
            assert bpy.ops.scfpf.mapping_add(kind=kind) == {"FINISHED"}
    bpy.context.view_layer.update()
    assert switch(camera) == {"FINISHED"}
    off = sheets_off(addon, camera)
    print(name, off)
    assert off < (LENS_OFF if "mapping" in name else OFF)


def test_materials_are_noted_later_if_a_handler_has_removed_objects(addon, camera, monkeypatch):
    """Blender follows freed pointers if the instances of a depsgraph are read that has objects of before."""
    flexible = addon("bridge.camera.flexible_camera")
    for size in (1.0, 4.0):
        flexible.add_surface(camera, "PLANE", parameters={"width": size, "height": size})
    camera.scfpf.surfaces[1].object.location.z = -8.0
    camera.scfpf.surfaces[0].object.location.z = -1.0
    bpy.context.view_layer.update()
    switch(camera)
    rigs, sync = addon("cycles.rig"), addon("bridge.sync.camera_sync")
    noted = []
    found = rigs.seen_data.strokes
    monkeypatch.setattr(rigs.seen_data, "strokes", lambda scene: noted.append(1) or found(scene))
    other = bpy.data.objects.new("Other", None)
    bpy.context.scene.collection.objects.link(other)
    bpy.context.view_layer.update()
    noted.clear()

    def removing(scene, depsgraph, own=sync.scene_updated):
        own(scene, depsgraph)
        if "Other" in bpy.data.objects:
            bpy.data.objects.remove(bpy.data.objects["Other"])

    events = addon("events")
    functions = tuple(
        removing if each is sync.scene_updated else each for each in events.UPDATES["depsgraph_update_post"]
    )
    handler = events._handler(functions, 2)
    handlers = bpy.app.handlers.depsgraph_update_post
    kept = list(handlers)
    handlers.clear()
    handlers.append(handler)
    try:
        bpy.data.materials.new("New").roughness = 0.3
        bpy.context.scene.collection.objects.link(bpy.data.objects.new("More", None))
        bpy.context.view_layer.update()
        assert "Other" not in bpy.data.objects and not noted
        bpy.context.scene.collection.objects.link(bpy.data.objects.new("Last", None))
        bpy.context.view_layer.update()
        assert noted
    finally:
        handlers[:] = kept
