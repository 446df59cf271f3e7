# SPDX-License-Identifier: GPL-3.0-or-later
"""Targets that nothing shows, that hold nothing or that contradict each other, by every way to a solution."""

from types import SimpleNamespace

import bpy
import pytest
from aim_scenes import box_scene, solve, turned_view

FRONT, PLACE = (1.0, -0.8, 1.0), (0.55, 0.45)


@pytest.fixture
def camera():
    camera = box_scene(bpy.context.scene).camera
    camera.scfpf.aim.columns, camera.scfpf.aim.rows = 6, 6
    return camera


def depsgraph():
    return bpy.context.evaluated_depsgraph_get()


def add_pin(camera, point=FRONT, position=PLACE):
    assert bpy.ops.scfpf.aim_pin_add(camera=camera.name, point=point, position=position) == {"FINISHED"}
    return camera.scfpf.aim_targets[-1]


def add_view(camera, shift=0.05):
    turned_view(bpy.context.scene, 0.0)
    target = camera.scfpf.aim_targets[-1]
    target.position[0] += shift
    return target


def remove_all(but=()):
    """Remove all meshes that are no control surfaces."""
    for obj in list(bpy.context.scene.objects):
        if obj.type == "MESH" and obj.scfpf_surface.kind == "NONE" and obj.name not in but:
            bpy.data.objects.remove(obj)


def hide_all(camera):
    add_pin(camera)
    for obj in bpy.context.scene.objects:
        if obj.type == "MESH" and obj.scfpf_surface.kind == "NONE":
            obj.hide_render = obj.hide_viewport = True


def exclude_thing(camera):
    target = add_view(camera)
    collection = bpy.data.collections.new("Excluded")
    bpy.context.scene.collection.children.link(collection)
    for other in target.object.users_collection:
        other.objects.unlink(target.object)
    collection.objects.link(target.object)
    bpy.context.view_layer.layer_collection.children["Excluded"].exclude = True


def leave_edges(camera):
    mesh = add_view(camera).object.data
    mesh.clear_geometry()
    mesh.from_pydata([(0, 0, 0), (1, 0, 0)], [(0, 1)], [])


def empty_collection(camera):
    collection = bpy.data.collections.new("Empty")
    bpy.context.scene.collection.children.link(collection)
    add_view(camera).collection = collection


def lose_handle(camera):
    handle = add_pin(camera).handle
    for collection in handle.users_collection:
        collection.objects.unlink(handle)


def same_point(camera):
    add_pin(camera).name = "One"
    add_pin(camera, position=(0.4, 0.6)).name = "Other"


def same_handle(camera):
    handle = add_pin(camera).handle
    add_pin(camera, (0, 5, 0), (0.4, 0.4)).handle = handle


def same_place(camera):
    add_pin(camera, (2.0, 17.5, 3.0))
    add_pin(camera)


def pin_off_its_view(camera):
    add_view(camera)
    add_pin(camera, position=(0.15, 0.85))


# Scenes and targets, and what is told about them.
REFUSED = [
    (hide_all, "nothing to aim at"),
    (exclude_thing, "has no faces that viewports and renders show"),
    (leave_edges, "has no faces that viewports and renders show"),
    (lambda camera: add_view(camera).object.data.clear_geometry(), "has no faces"),
    (lambda camera: setattr(add_view(camera).object, "hide_render", True), "has no faces"),
    (lambda camera: setattr(add_view(camera).object, "scale", (0, 0, 0)), "does not see 'Box'"),
    (lambda camera: bpy.data.objects.remove(add_view(camera).object), "shows nothing"),
    (empty_collection, "shows nothing"),
    (lambda camera: bpy.data.objects.remove(add_view(camera).eye), "has no camera"),
    (lambda camera: bpy.data.objects.remove(add_pin(camera).handle), "has no handle"),
    (lose_handle, "has no handle"),
    (lambda camera: setattr(add_pin(camera), "weight", 0.0), "has no view and no pin"),
    (same_point, "Not solved, because 'One' and 'Other' hold the same point at two places"),
    (same_handle, "hold the same point at two places"),
    (same_place, "'Pin Pin 2' and 'Pin Pin' hold two points at the same place"),
    (pin_off_its_view, "'Pin Pin' holds a point of what 'Box' shows elsewhere"),
]


def by_drag(camera, addon):
    drag = addon("bridge.aim.follower").Follower(camera, depsgraph())
    drag.step(depsgraph())
    return addon("bridge.aim.solve_work").run_through(drag.finishing(depsgraph()))


def by_keys(camera, _addon):
    for frame in (1, 11):
        for target in camera.scfpf.aim_targets:
            target.position[1] += 0.01
            target.keyframe_insert("position", frame=frame)
    solve(camera)
    return camera.scfpf.aim.message


def by_live_aim(camera, addon):
    live = addon("bridge.aim.live_aim")
    live.forget()
    bpy.ops.scfpf.aim_live(camera=camera.name)
    live.follow(camera, bpy.context.evaluated_depsgraph_get())
    live._cameras[camera.session_uid].rests_at = 0.0
    while live.is_busy():
        live.settle()
    camera.scfpf.aim.live = False
    return camera.scfpf.aim.message


def by_button(camera, _addon):
    solve(camera)
    return camera.scfpf.aim.message


WAYS = [by_button, by_drag, by_keys, by_live_aim]


def told(camera, addon, way):
    """The outcome of a way to a solution: an error or the result."""
    errors = addon("bridge.blender.user_errors").USER_ERRORS
    try:
        return way(camera, addon)
    except (RuntimeError, *errors) as error:
        assert "Traceback" not in str(error), str(error)
        return str(error)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("number", range(len(REFUSED)))
def test_what_cannot_be_is_told_before_any_solve(camera, addon, monkeypatch, number, way):
    prepare, message = REFUSED[number]
    prepare(camera)
    bpy.context.view_layer.update()

    def never(*_):
        raise AssertionError("nothing is solved")

    monkeypatch.setattr(addon("bridge.aim.solve_targets"), "solve_in_rounds", never)
    aim, before = camera.scfpf.aim, len(camera.scfpf.surfaces)
    text = told(camera, addon, way)
    assert message in text, text
    assert len(camera.scfpf.surfaces) >= before and not aim.is_solved


def wide_halo(camera):
    add_pin(camera).halo = 1e6


def one_triangle(camera):
    remove_all()
    mesh = bpy.data.meshes.new("Triangle")
    mesh.from_pydata([(0, 0, 2), (0.01, 0, 2), (0, 0, 2.01)], [], [(0, 1, 2)])
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Triangle", mesh))
    add_pin(camera, (0, 0, 2))


def hardly_a_stay(camera):
    remove_all(("Box", "Back Wall"))
    add_view(camera).alone = True
    assert bpy.ops.scfpf.aim_stay_add(camera=camera.name, object="Back Wall") == {"FINISHED"}
    camera.scfpf.aim_targets[-1].weight = 1e-5


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("prepare", [wide_halo, one_triangle, hardly_a_stay])
def test_where_nothing_has_to_stay_targets_are_met(camera, addon, prepare, way):
    prepare(camera)
    bpy.context.view_layer.update()
    text = told(camera, addon, way)
    count = 24 if prepare is hardly_a_stay else 1
    assert f"{count} of {count} points within 1.5 px" in text and camera.scfpf.aim.flaws == "", text


def test_a_small_thing_far_away_is_solved_at_once(camera, addon, monkeypatch):
    """The pin is near the end of the projectors, as the scene ends there."""
    remove_all(("Box",))
    camera.location.y, camera.data.clip_end = -200.0, 1000.0
    bpy.context.view_layer.update()
    add_pin(camera)
    rounds = addon("aim.rounds")
    results, right = [], rounds.solve

    def noted(*given):
        results.append(right(*given))
        return results[-1]

    monkeypatch.setattr(rounds, "solve", noted)
    camera.scfpf.aim.degree = 3
    assert solve(camera) == {"FINISHED"}
    assert len(results) == 1 and camera.scfpf.aim_targets[0].residual_max < 0.5


def unmoved(addon, monkeypatch):
    """Let the solver find nothing but the start."""
    rounds = addon("aim.rounds")
    right = rounds.solve

    def same(problem, is_cancelled, schedule):
        found = right(problem, is_cancelled, schedule)
        return found and type(found)(problem.patches, found.t, found.residuals, found.steps)

    monkeypatch.setattr(rounds, "solve", same)


def test_a_missed_pin_is_named_and_its_solution_not_taken(camera, addon, monkeypatch):
    add_pin(camera).name = "Corner"
    unmoved(addon, monkeypatch)
    before = [slot.object for slot in camera.scfpf.surfaces]
    bpy.context.view_layer.update()
    with pytest.raises(
        RuntimeError, match=r"Not taken, because 'Corner' would be 7\d px from its place: bring"
    ):
        solve(camera)
    monkeypatch.setattr(addon("bridge.aim.solve_targets"), "BUDGET", 0.0)
    with pytest.raises(RuntimeError, match=r"from its place, and nothing better was found in 10 s: bring"):
        solve(camera)
    assert [slot.object for slot in camera.scfpf.surfaces] == before


def test_a_target_of_less_weight_may_yield_and_is_warned_of(camera, addon, monkeypatch):
    target = add_pin(camera)
    target.name, target.weight = "Corner", 0.5
    unmoved(addon, monkeypatch)
    assert solve(camera) == {"FINISHED"}
    aim = camera.scfpf.aim
    assert "'Corner' is 7" in aim.flaws and aim.message.startswith(aim.flaws)
    reported = []
    watched = addon("operators.aim.solve_job").SolveJob
    operator = SimpleNamespace(report=lambda kind, text: reported.append((kind, text)))
    watched.tell(operator, camera, aim.message)
    aim.flaws = ""
    watched.tell(operator, camera, "Fine")
    assert reported == [({"WARNING"}, aim.message), ({"INFO"}, "Fine")]


@pytest.mark.parametrize(("name", "words"), [("mirrored", "is mirrored"), ("folded", "behind a fold")])
def test_mirrored_and_folded_pixels_are_warned_of(camera, addon, monkeypatch, name, words):
    add_pin(camera)
    judge = addon("aim.judge")
    right = judge.Judge.judgement_of
    calls = []

    def worse(self, after, released=None):
        found = right(self, after, released)
        calls.append(1)
        return type(found)(**{**vars(found), name: 0.0 if len(calls) == 1 else 0.001})

    monkeypatch.setattr(judge.Judge, "judgement_of", worse)
    assert solve(camera) == {"FINISHED"}
    assert f"0.1 % of the picture {words if name == 'mirrored' else 'is ' + words}" in camera.scfpf.aim.flaws


def test_the_worst_places_are_marked_in_the_image(camera, addon):
    target = add_view(camera)
    assert solve(camera) == {"FINISHED"}
    widgets, shown = addon("bridge.aim.widgets"), addon("bridge.frames.shown_image")
    rectangle = addon("bridge.render.view_painter").Rectangle(40.0, 30.0, 480.0, 270.0)
    image, settings = shown.ShownImage(camera, rectangle), camera.scfpf
    target.whole_max, target.whole_worst = 28.0, (0.25, 0.5)
    settings.aim.background_max, settings.aim.background_worst = 1e9, (1.0, 0.0)
    marks = {label: (x, y) for x, y, label in widgets.worst_places(settings, image)}
    assert marks == {"Box: 28 px off": (160.0, 165.0), "background: is lost here": (520.0, 30.0)}
    # What nobody notices is not marked, nor what has moved since.
    target.whole_max = 1.0
    assert len(widgets.worst_places(settings, image)) == 1
    drag = addon("bridge.aim.follower").Follower(camera, depsgraph())
    target.position[0] += 0.01
    drag.step(depsgraph())
    assert widgets.worst_places(settings, image) == [] and target.whole_95 == -1.0
    drag.restore()
    assert len(widgets.worst_places(settings, image)) == 1 and target.whole_95 >= 0.0
