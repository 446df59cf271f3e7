# SPDX-License-Identifier: GPL-3.0-or-later
"""Every modal operator, ended in every way: by Esc, a fault, an error, a closed window, as it is disabled.

No timer, cursor, text, handler or thread stays, and the file is as before. A Blender as module sends no
events: the operators' own methods run with a context that counts.
"""

import json
import sys
import threading
import time
from types import SimpleNamespace

import bpy
import pytest
from file_state import differences, file_state
from operator_steps import add_camera, add_cube

PATIENCE = 30.0
# Of ``Window.left``.
NOTHING_LEFT = [], 0, [], 0


class Window:
    """The traces that operators leave in Blender: timers, cursors, texts, progress and handlers."""

    def __init__(self):
        self.timers, self.cursors, self.texts, self.progress, self.waiting = [], 0, {}, 0, []

    # Of the window manager
    windows = ()

    def event_timer_add(self, _step, window):
        self.timers.append(object())
        return self.timers[-1]

    def event_timer_remove(self, timer):
        self.timers.remove(timer)

    def modal_handler_add(self, operator):
        self.waiting.append(operator)

    def progress_begin(self, *_):
        self.progress += 1

    def progress_end(self):
        self.progress -= 1

    def progress_update(self, _value):
        pass

    # Of the window
    width, height = 800, 600

    def as_pointer(self):
        return 1

    def cursor_modal_set(self, _cursor):
        self.cursors += 1

    def cursor_modal_restore(self):
        self.cursors -= 1

    # Of the workspace and of the area
    name, type = "Layout", "PROPERTIES"
    session_uid = 1

    def status_text_set(self, text):
        self.texts["status"] = text

    def header_text_set(self, text):
        self.texts["header"] = text

    @property
    def left(self):
        return self.timers, self.cursors, [t for t in self.texts.values() if t is not None], self.progress


class Context:
    """Blender's context with a window that counts."""

    def __init__(self, window):
        self.window = self.window_manager = self.workspace = self.area = window
        self.region, self.region_data = None, None

    def __getattr__(self, name):
        return getattr(bpy.context, name)


class Timers:
    """Functions that Blender would call later."""

    def __init__(self):
        self.waiting = []

    def register(self, function, **_options):
        self.waiting.append(function)

    def run(self):
        while self.waiting:
            function = self.waiting.pop(0)
            while function() is not None:
                pass


class InWindow:
    """bpy as in a Blender with a window."""

    def __init__(self, window):
        self.context, self.timers = Context(window), Timers()
        self.data = SimpleNamespace(workspaces=[window], objects=bpy.data.objects)
        self.app = SimpleNamespace(
            background=False,
            timers=self.timers,
            handlers=bpy.app.handlers,
            version=bpy.app.version,
            is_job_running=bpy.app.is_job_running,
        )

    def __getattr__(self, name):
        return getattr(bpy, name)


def instance(cls):
    """An object with the methods and defaults of an operator class, which Python cannot make itself."""
    names = {}
    for base in reversed(cls.__mro__):
        if "scfpf" in base.__module__:
            names |= {n: v for n, v in vars(base).items() if not n.startswith("__")}
    # For ``super()``.
    names |= {"__class__": property(lambda _self: cls), "bl_label": cls.bl_label}
    made = type(cls.__name__, (), names)()
    made.reports = []
    made.report = lambda kinds, text: made.reports.append((*kinds, text))
    operator = getattr(bpy.ops.scfpf, cls.__name__.removeprefix("SCFPF_OT_"))
    for prop in operator.get_rna_type().properties:
        if prop.identifier != "rna_type" and not hasattr(made, prop.identifier):
            setattr(made, prop.identifier, getattr(prop, "default", None))
    return made


def event(kind, value="NOTHING", **facts):
    place = {"mouse_x": 0, "mouse_y": 0, "mouse_region_x": 0, "mouse_region_y": 0}
    held = {"shift": False, "ctrl": False, "alt": False, "unicode": ""}
    return SimpleNamespace(type=kind, value=value, **{**place, **held, **facts})


TIMER = event("TIMER")
ESC = event("ESC", "PRESS")
MOUSE = event("MOUSEMOVE", mouse_x=40, mouse_y=30)
CANCELED, NOTHING_CHANGED = "Render canceled", "Canceled: nothing was changed"

# By class: its module, the events before the end, and what Esc reports, "" for nothing. None: it has no Esc.
JOBS = {
    "SCFPF_OT_volume_frame": ("operators.volume.framing", [MOUSE, event("WHEELUPMOUSE")], ""),
    "SCFPF_OT_distance_drag": ("operators.volume.by_distance", [MOUSE], ""),
    "SCFPF_OT_cycles_rig": ("operators.camera.cycles", [TIMER, TIMER], NOTHING_CHANGED),
    "SCFPF_OT_cycles_rig_update": ("operators.camera.cycles", [TIMER, TIMER], NOTHING_CHANGED),
    "SCFPF_OT_preview_toggle": ("operators.camera.preview", [TIMER, TIMER], NOTHING_CHANGED),
    "SCFPF_OT_engine_warn": ("operators.camera.engine", [], None),
    "SCFPF_OT_render": ("operators.image.render", [TIMER], CANCELED),
    "SCFPF_OT_quilt": ("operators.image.quilt", [TIMER], CANCELED),
    "SCFPF_OT_time_render": ("operators.image.time_render", [TIMER], CANCELED),
    "SCFPF_OT_render_job_price": (
        "operators.image.render_job_export",
        [TIMER],
        "Price canceled",
    ),
    "SCFPF_OT_render_escape": ("operators.image.render", [], None),
    "SCFPF_OT_pick": ("operators.image.pick", [MOUSE], ""),
    "SCFPF_OT_mapping_place": ("operators.volume.mappings", [MOUSE], ""),
    "SCFPF_OT_aim_pin_click": ("operators.aim.pin_click", [MOUSE], ""),
    "SCFPF_OT_aim_drag": ("operators.aim.drag", [MOUSE, TIMER], ""),
    "SCFPF_OT_layer_drag": ("operators.layers.layer_drag", [MOUSE, TIMER], ""),
    "SCFPF_OT_aim_solve": ("operators.aim.solve", [TIMER], "Solve canceled: the volume is as before"),
    "SCFPF_OT_layers_render": ("operators.layers.layer_render", [TIMER], CANCELED),
    "SCFPF_OT_quilt_joined": ("operators.layers.layer_render", [TIMER], CANCELED),
    "SCFPF_OT_eyes_joined": ("operators.layers.layer_render", [TIMER], CANCELED),
    "SCFPF_OT_look_behind": ("operators.layers.look_behind", [], "Look Behind canceled"),
    "SCFPF_OT_joined_render": ("operators.layers.layer_render", [TIMER], CANCELED),
    "SCFPF_OT_joined_plan": ("operators.layers.layer_render", [TIMER], "Planning canceled"),
}
JOINED = {"SCFPF_OT_joined_render", "SCFPF_OT_quilt_joined", "SCFPF_OT_eyes_joined"}
# It leaves nothing: it only waits for what becomes of a press.
KEEPS_NOTHING = {"SCFPF_OT_live_select"}


def test_the_table_is_whole():
    ours = {f"SCFPF_OT_{name}" for name in dir(bpy.ops.scfpf)}
    modal = {name for name in ours if hasattr(getattr(bpy.types, name), "modal")}
    assert modal == JOBS.keys() | KEEPS_NOTHING


@pytest.fixture(params=JOBS)
def job(request, addon, monkeypatch):
    """A job that has begun and done some work; see the names at the end."""
    name, (path, events, told) = request.param, JOBS[request.param]
    add_cube((0, 0, -4))
    camera = add_camera()
    camera.scfpf.pixel_error = 2.0
    scene = bpy.context.scene
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = 32, 18
    bpy.ops.scfpf.mapping_add()
    bpy.data.objects["Cube"].select_set(True)
    bpy.ops.scfpf.aim_view_add()
    if name == "SCFPF_OT_layer_drag":
        bpy.ops.scfpf.layer_add()
    bpy.context.view_layer.objects.active = camera
    if name == "SCFPF_OT_aim_drag":
        camera.scfpf.aim.live = True
    if name in {"SCFPF_OT_layers_render", "SCFPF_OT_joined_plan", *JOINED}:
        scene.render.engine = "CYCLES"
        monkeypatch.setattr(addon("cycles.layers.layers_job").LayersJob, "render", lambda *_, **__: None)
    if "joined" in name:
        # Many anchors, which a thread plans.
        bpy.ops.scfpf.preset_apply(preset="inverted_perspective")
        scene.render.resolution_x, scene.render.resolution_y = 320, 180
    scene.render.use_multiview = name == "SCFPF_OT_eyes_joined"
    if name == "SCFPF_OT_distance_drag":
        camera.data.type, camera.data.clip_start = "PERSP", 0.1
        bpy.ops.scfpf.by_distance()
    if "cycles" in name:
        # Of an animated volume several frames are read.
        for frame, x in ((1, 0.0), (20, 0.1)):
            camera.scfpf.surfaces[1].object.location.x = x
            camera.scfpf.surfaces[1].object.keyframe_insert("location", frame=frame)
        scene.frame_set(1)
    if name == "SCFPF_OT_cycles_rig_update":
        bpy.ops.scfpf.cycles_rig()
        for frame in (2, 1):
            scene.frame_set(frame)  # the rig notes that its volume moves
    if name in {"SCFPF_OT_render", "SCFPF_OT_quilt", "SCFPF_OT_time_render"}:
        # Many times as long as any test waits.
        scene.render.resolution_x = scene.render.resolution_y = 2048
        camera.scfpf.samples = 64
    bpy.context.view_layer.update()
    before = file_state()
    window = Window()
    fake = InWindow(window)
    context, jobs, module = fake.context, addon("operators.common.modal_job"), addon(path)
    monkeypatch.setattr(jobs, "bpy", fake)
    if hasattr(module, "bpy"):
        monkeypatch.setattr(module, "bpy", fake)
    operator = instance(getattr(bpy.types, name))
    if name == "SCFPF_OT_distance_drag":
        operator.surface, operator.part = camera.scfpf.surfaces[1].object.name, "distance"
        # How far the mouse is along the way, when it is pressed and after it.
        along = iter((1.0, 2.5))
        operator._along = lambda *_: next(along)
    if name in {"SCFPF_OT_quilt", "SCFPF_OT_quilt_joined"}:
        operator.columns, operator.rows = 2, 1
    if name in {"SCFPF_OT_quilt", "SCFPF_OT_time_render"}:
        operator._is_asked, operator.wait = True, operator.execute
    if name == "SCFPF_OT_aim_solve":
        operator.prepared = lambda _context: camera
    if name == "SCFPF_OT_render_job_price":
        operator.command = json.dumps([sys.executable, "-c", "import time; time.sleep(600)"])
    if name == "SCFPF_OT_aim_pin_click":
        operator._camera = camera.session_uid
    begun = operator.wait(context) if hasattr(operator, "wait") else operator.invoke(context, event("NONE"))
    assert begun == {"RUNNING_MODAL"} and jobs.is_running(getattr(bpy.types, name))
    assert window.waiting == [operator] and window.left != NOTHING_LEFT
    operator._may_open = False  # no editor for the image
    for each in events:
        assert not operator.modal(context, each) & jobs.ENDS
    made = {"name": name, "told": told, "before": before, "timers": fake.timers}
    yield SimpleNamespace(operator=operator, context=context, jobs=jobs, window=window, **made)
    assert jobs._running == []


def assert_left(job, file_too=True):
    """Nothing of a job is left in Blender, and the file is as before."""
    assert job.window.left == NOTHING_LEFT
    assert not job.jobs.is_running(getattr(bpy.types, job.name))
    end = time.monotonic() + PATIENCE
    while any(thread.name.startswith("SCFPF") for thread in threading.enumerate()):
        assert time.monotonic() < end, "a thread goes on"
        time.sleep(0.01)
    bpy.context.view_layer.update()
    if file_too:
        assert differences(job.before, file_state()) == []


def until_ended(job):
    """Send timers until the job ends; return the outcome."""
    end = time.monotonic() + PATIENCE
    while True:
        outcome = job.operator.modal(job.context, TIMER)
        if outcome & job.jobs.ENDS:
            return outcome
        assert time.monotonic() < end, "the job goes on"
        time.sleep(0.01)


def test_esc_cancels(job):
    outcome = job.operator.modal(job.context, ESC)
    if not outcome & job.jobs.ENDS:
        outcome = until_ended(job)
    if job.told is None:
        assert "FINISHED" in outcome
    else:
        assert outcome == {"CANCELLED"}
        reports = [text for kind, text in job.operator.reports if kind == "INFO"]
        assert len(reports) == bool(job.told) and all(text.startswith(job.told) for text in reports)
    assert_left(job)


def fail_by(job, error):
    """Let the next event end in an exception; return the outcome."""

    def fail(*_):
        raise error

    job.operator.tick = job.operator.respond = fail
    return job.operator.modal(job.context, TIMER)


def test_a_fault_is_reported(job, capsys):
    assert fail_by(job, ZeroDivisionError("of the test")) == {"CANCELLED"}
    kind, text = job.operator.reports[-1]
    assert kind == "ERROR" and "a fault of the add-on" in text and "of the test" in text
    assert "ZeroDivisionError: of the test" in capsys.readouterr().err
    assert_left(job)


def test_an_error_that_a_user_can_mend_is_reported(job, addon, capsys):
    error = addon("projection.user_error").UserError("Do '{0}' first", "this")
    assert fail_by(job, error) == {"CANCELLED"}
    assert job.operator.reports[-1] == ("ERROR", "Do 'this' first")
    assert "Traceback" not in capsys.readouterr().err
    assert_left(job)


@pytest.mark.parametrize("job", ["SCFPF_OT_cycles_rig", "SCFPF_OT_cycles_rig_update"], indirect=True)
def test_a_fault_after_the_planning(job):
    """Node groups are built by then."""
    groups = len(bpy.data.node_groups)

    def fail(*_):
        assert len(bpy.data.node_groups) > groups or "update" in job.name
        raise ZeroDivisionError("at last")

    job.operator.finish = fail
    assert until_ended(job) == {"CANCELLED"}
    assert "at last" in job.operator.reports[-1][1]
    assert_left(job)


@pytest.mark.parametrize("job", ["SCFPF_OT_aim_drag", "SCFPF_OT_layer_drag"], indirect=True)
def test_a_drag_there_and_back_changes_nothing(job):
    """As a click on a frame: nothing is solved."""
    job.operator.modal(job.context, event("MOUSEMOVE"))
    assert job.operator.modal(job.context, event("LEFTMOUSE", "RELEASE")) == {"CANCELLED"}
    assert_left(job)


def test_what_python_itself_raises_leaves_nothing(job):
    with pytest.raises(KeyboardInterrupt):
        fail_by(job, KeyboardInterrupt())
    assert_left(job)


def test_a_closed_window_ends_it(job):
    """Blender opens a file or quits alike. What cannot be changed meanwhile waits for a timer."""
    job.operator.cancel(job.context)
    assert job.window.left == NOTHING_LEFT
    job.timers.run()
    # Groups of a preview that are built stay: nothing refers to them.
    assert_left(job, file_too=job.name != "SCFPF_OT_preview_toggle")


@pytest.mark.parametrize("name", ["SCFPF_OT_quilt", "SCFPF_OT_time_render"])
def test_esc_in_the_dialog_before_a_job_has_nothing_to_end(name):
    """Blender calls ``cancel`` then, of an operator whose job has not begun."""
    operator = instance(getattr(bpy.types, name))
    assert operator.cancel(bpy.context) is None and operator.reports == []


def test_disabling_the_extension_ends_it(job):
    job.jobs.disable_all()
    assert_left(job)


def test_events_within_an_event_are_passed_on(job):
    """Blender sends them while a job opens a window."""
    within = []

    def respond(_context, _event=None):
        within.append(job.operator.modal(job.context, TIMER))
        return {"CANCELLED"}

    job.operator.tick = job.operator.respond = respond
    assert job.operator.modal(job.context, TIMER) == {"CANCELLED"}
    assert within == [{"PASS_THROUGH"}]
    assert_left(job)
