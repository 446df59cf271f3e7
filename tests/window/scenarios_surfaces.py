# SPDX-License-Identifier: GPL-3.0-or-later
"""Control surfaces as an artist handles them: added from the menu, dragged, edited fifty times and undone."""

from math import degrees, pi, radians, tan

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d
from driver import DRAW, build_scene, surfaces, volume

KINDS = (
    "POINT",
    "PLANE",
    "PATCH",
    "DISC",
    "CYLINDER",
    "CONE",
    "SPHERE",
    "GRID",
    "UV_MESH",
    "NURBS",
    "LATTICE",
)
# Share of the newly green pixels within the new surface's box; some others are lines no longer covered.
SHARE = 0.85
# Green pixels that a surface has at least in these views.
MANY = 1000
# Those of the far rim: a selected surface has its other lines in the colour that Blender gives it.
RIM = 400


def each_kind(driver):
    """Each kind of surface, added in mid-volume: the new green lines are where its mesh is."""
    driver.add_camera()
    for kind in KINDS:
        driver.look("FRONT")
        yield DRAW
        before = driver.surface_lines()
        with driver.override():
            done = bpy.ops.scfpf.surface_add("INVOKE_DEFAULT", True, kind=kind)
        assert done == {"FINISHED"}
        yield DRAW
        camera = bpy.context.scene.camera
        added = surfaces(camera)[1]
        assert len(surfaces(camera)) == 3 and added.scfpf_surface.kind == kind
        driver.shot(kind)
        new = driver.surface_lines() & ~before
        inside = new[driver.near(added)].sum()
        # A point has no lines of its own.
        assert kind == "POINT" or (inside > MANY and inside > SHARE * new.sum()), (kind, inside, new.sum())
        with driver.override():
            bpy.ops.ed.undo()
        yield DRAW
        assert len(surfaces(bpy.context.scene.camera)) == 2


def drags(driver):
    """G and the mouse move the far surface: it and the projectors follow, a right click takes it back."""
    build_scene()
    driver.add_camera()
    driver.look("TOP", 2.0)
    far = surfaces(bpy.context.scene.camera)[-1]
    with driver.override():
        # It enters the Edit Volume mode; out of it surfaces cannot be grabbed.
        assert bpy.ops.scfpf.surface_select("INVOKE_DEFAULT", True, index=1) == {"FINISHED"}
    yield 2 * DRAW
    region = driver.region("VIEW_3D")
    x, y = region.x + region.width // 2, region.y + region.height // 2
    start, place, old = driver.surface_lines(), far.matrix_world.copy(), driver.near(far)
    assert start[old].sum() > RIM
    driver.shot("before")
    for end in ("RIGHTMOUSE", "LEFTMOUSE"):
        driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
        driver.window.event_simulate("G", "PRESS", x=x, y=y)
        driver.window.event_simulate("G", "RELEASE", x=x, y=y)
        yield 0.5
        for step in range(1, 11):
            driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x - 20 * step, y=y + 5 * step)
            yield 0.1
        yield DRAW
        driver.shot(f"during-{end}")
        new, during = driver.near(far), driver.surface_lines()
        assert start[new].sum() < 50 and during[old].sum() < 50, "the views of both places should not overlap"
        assert during[new].sum() > RIM, "the lines do not follow the mouse"
        driver.window.event_simulate(end, "PRESS", x=x - 200, y=y + 50)
        driver.window.event_simulate(end, "RELEASE", x=x - 200, y=y + 50)
        yield 3 * DRAW
        driver.shot(f"after-{end}")
        lines = driver.surface_lines()
        if end == "RIGHTMOUSE":
            assert far.matrix_world == place and (lines ^ start).sum() < 50, "the drag was not taken back"
    assert (far.matrix_world.translation - place.translation).length > 10.0
    assert lines[old].sum() < 50 and lines[new].sum() > RIM


def fifty_undos(driver):
    """Fifty steps of all kinds, undone and redone one by one: each restores its volume."""
    build_scene()
    driver.add_camera()
    yield DRAW

    def grab():
        camera = bpy.context.scene.camera
        bpy.ops.scfpf.surface_select("EXEC_DEFAULT", False, index=camera.scfpf.active_surface)
        place = bpy.context.object.matrix_world.translation.copy()
        done = bpy.ops.transform.translate("EXEC_DEFAULT", True, value=(0.5, 0.2, 0.1))
        bpy.context.view_layer.update()
        assert (bpy.context.object.matrix_world.translation - place).length > 0.5
        return done

    scfpf = bpy.ops.scfpf
    # A preset makes the same volume in each round, with the same names.
    kinds, pans = iter(KINDS), iter((0.1, 0.2, 0.3, 0.4, 0.5))
    round_of_ten = (
        lambda: scfpf.surface_add("EXEC_DEFAULT", True, kind=next(kinds)),
        lambda: scfpf.surface_add("EXEC_DEFAULT", True, kind=next(kinds)),
        grab,
        lambda: scfpf.surface_move("EXEC_DEFAULT", True, direction="UP"),
        lambda: scfpf.surface_duplicate("EXEC_DEFAULT", True),
        lambda: scfpf.volume_swap("EXEC_DEFAULT", True),
        lambda: scfpf.surface_remove("EXEC_DEFAULT", True),
        lambda: scfpf.preset_apply("EXEC_DEFAULT", True, preset="cylindrical_panorama"),
        lambda: scfpf.volume_mirror("EXEC_DEFAULT", True, axis="U"),
        lambda: scfpf.volume_frame("EXEC_DEFAULT", True, pan=next(pans)),
    )
    states = [volume(bpy.context.scene.camera)]
    for step in range(50):
        with driver.override():
            assert round_of_ten[step % 10]() == {"FINISHED"}, step
        # A redraw each time would take a software renderer minutes.
        if step % 5 == 4:
            yield 0.1
        bpy.context.view_layer.update()
        states.append(volume(bpy.context.scene.camera))
    assert len(set(states)) > 40, "the steps should differ"
    driver.shot("fifty-steps")
    for step in range(49, -1, -1):
        with driver.override():
            bpy.ops.ed.undo()
        if step % 5 == 0:
            yield 0.1
        assert volume(bpy.context.scene.camera) == states[step], (step, states[step])
    driver.shot("undone")
    for step in range(1, 51):
        with driver.override():
            bpy.ops.ed.redo()
        if step % 5 == 0:
            yield 0.1
        assert volume(bpy.context.scene.camera) == states[step], (step, states[step])
    driver.shot("redone")


def duplicated(driver):
    """Duplicate Flexible Camera copies the surfaces too, and the mouse moves the copy as after Shift-D."""
    driver.add_camera("nonlinear_twist")
    driver.look("TOP", 2.0)
    yield DRAW
    camera = bpy.context.scene.camera
    objects, before = len(bpy.data.objects), volume(camera)
    region = driver.region("VIEW_3D")
    x, y = region.x + region.width // 2, region.y + region.height // 2
    driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
    yield 0.5
    with driver.override():
        assert bpy.ops.scfpf.camera_duplicate("INVOKE_DEFAULT", True) == {"FINISHED"}
    yield DRAW
    for step in range(1, 6):
        driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x + 40 * step, y=y)
        yield 0.2
    yield DRAW
    driver.shot("moving")
    driver.window.event_simulate("LEFTMOUSE", "PRESS", x=x + 200, y=y)
    driver.window.event_simulate("LEFTMOUSE", "RELEASE", x=x + 200, y=y)
    yield 3 * DRAW
    driver.shot("placed")
    copy = bpy.context.object
    assert copy != camera and not set(surfaces(copy)) & set(surfaces(camera))
    assert (copy.matrix_world.translation - camera.matrix_world.translation).length > 1
    assert volume(camera) == before
    while len(bpy.data.objects) > objects:
        with driver.override():
            bpy.ops.ed.undo()
        yield DRAW
    assert volume(bpy.context.scene.camera) == before


def handles_of_distances(driver):
    """Perspective by Distance: the arrows of the middle plane drag its distance and its width, undo too."""
    build_scene()
    bpy.ops.object.camera_add(location=(0, 0, 0), rotation=(pi / 2, 0, 0))
    camera = bpy.context.object
    bpy.context.scene.camera = camera
    camera.data.clip_start, camera.data.clip_end = 1.0, 12.0
    with driver.override():
        assert bpy.ops.scfpf.by_distance("EXEC_DEFAULT", True) == {"FINISHED"}
    own = surfaces(camera)[1].scfpf_surface
    own.distance, own.angle = 6.0, radians(60)
    camera.select_set(True)
    bpy.context.view_layer.objects.active = camera
    driver.look("TOP", 1.4)
    driver.area("VIEW_3D").spaces.active.show_gizmo = True
    with driver.override():
        bpy.ops.ed.undo_push(message="Before")
    yield 2 * DRAW
    driver.shot("before")
    region, view = driver.region("VIEW_3D"), driver.area("VIEW_3D").spaces.active.region_3d

    def pixel(*place):
        found = location_3d_to_region_2d(region, view, place)
        return region.x + round(found.x), region.y + round(found.y)

    # From above the camera looks up the screen along world Y, its X to the right.
    for name, start, end in (
        ("distance", (0.0, 6.0, 0.0), (0.0, 8.0, 0.0)),
        ("half_width", (6.0 * tan(radians(30)), 6.0, 0.0), (6.0, 6.0, 0.0)),
    ):
        yield from press_and_move(driver, pixel(*start), pixel(*end))
        driver.shot(name)
        # Undo has replaced the objects.
        own = surfaces(bpy.context.scene.camera)[1].scfpf_surface
        if name == "distance":
            assert abs(own.distance - 8.0) < 0.3, own.distance
        else:
            assert abs(own.distance * tan(own.angle / 2) - 6.0) < 0.4, degrees(own.angle)
        with driver.override():
            bpy.ops.ed.undo()
        yield DRAW
        own = surfaces(bpy.context.scene.camera)[1].scfpf_surface
        assert abs(own.distance - 6.0) < 1e-4 and abs(degrees(own.angle) - 60.0) < 1e-3


def press_and_move(driver, start, end):
    """Generator: drag the left button from one pixel of the window to another."""
    for step in range(7):
        share = max(step - 1, 0) / 5
        x, y = (round(a + share * (b - a)) for a, b in zip(start, end, strict=True))
        driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
        yield DRAW / 2
        if step == 0:
            driver.window.event_simulate("LEFTMOUSE", "PRESS", x=x, y=y)
            yield DRAW / 2
    driver.window.event_simulate("LEFTMOUSE", "RELEASE", x=x, y=y)
    yield DRAW


SCENARIOS = (each_kind, drags, fifty_undos, duplicated, handles_of_distances)
