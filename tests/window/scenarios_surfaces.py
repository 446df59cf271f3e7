# SPDX-License-Identifier: GPL-3.0-or-later
"""Control surfaces as an artist handles them: added from the menu, dragged, edited fifty times and undone."""

import bpy
from driver import DRAW, build_scene, surfaces, volume

KINDS = ("POINT", "PLANE", "PATCH", "DISC", "CYLINDER", "CONE", "SPHERE", "GRID", "UV_MESH", "NURBS")
# Share of the newly green pixels within the new surface's box; some others are lines no longer covered.
SHARE = 0.85
# Green pixels that a surface has at least in these views.
MANY = 2000


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
    """G and the mouse move the far surface: the lines follow during the drag, a right click takes it back."""
    build_scene()
    driver.add_camera()
    driver.look("TOP", 2.0)
    bpy.ops.object.select_all(action="DESELECT")
    far = surfaces(bpy.context.scene.camera)[-1]
    # Without the Edit Volume mode, in which a selected surface is orange.
    far.hide_select = False
    far.select_set(True)
    bpy.context.view_layer.objects.active = far
    yield 2 * DRAW
    region = driver.region("VIEW_3D")
    x, y = region.x + region.width // 2, region.y + region.height // 2
    start, place, old = driver.surface_lines(), far.matrix_world.copy(), driver.near(far)
    assert start[old].sum() > MANY
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
        assert during[new].sum() > MANY, "the lines do not follow the mouse"
        driver.window.event_simulate(end, "PRESS", x=x - 200, y=y + 50)
        driver.window.event_simulate(end, "RELEASE", x=x - 200, y=y + 50)
        yield 3 * DRAW
        driver.shot(f"after-{end}")
        lines = driver.surface_lines()
        if end == "RIGHTMOUSE":
            assert far.matrix_world == place and (lines ^ start).sum() < 50, "the drag was not taken back"
    assert (far.matrix_world.translation - place.translation).length > 10.0
    assert lines[old].sum() < 50 and lines[new].sum() > MANY


def fifty_undos(driver):
    """Fifty steps of all sorts, undone and redone one by one: after each the volume is what it was then."""
    build_scene()
    driver.add_camera()
    yield DRAW

    def grab():
        camera = bpy.context.scene.camera
        surfaces(camera)[camera.scfpf.active_surface].select_set(True)
        return bpy.ops.transform.translate("EXEC_DEFAULT", True, value=(0.5, 0.2, 0.1))

    scfpf = bpy.ops.scfpf
    kinds = iter(KINDS)
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
        lambda: scfpf.volume_frame("EXEC_DEFAULT", True),
    )
    states = [volume(bpy.context.scene.camera)]
    for step in range(50):
        with driver.override():
            assert round_of_ten[step % 10]() == {"FINISHED"}, step
        # A redraw each time would take a software renderer minutes.
        if step % 5 == 4:
            yield 0.1
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


SCENARIOS = (each_kind, drags, fifty_undos)
