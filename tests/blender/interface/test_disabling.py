# SPDX-License-Identifier: GPL-3.0-or-later
"""Disabling the extension ends every modal operator of ours: no timer, cursor or text stays.

A Blender as module sends no events: the operators' own methods run with a context that counts.
"""

from types import SimpleNamespace

import bpy
import pytest
from operator_steps import add_camera, add_cube


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

    # Of the workspace
    name = "Layout"

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
        self.window = self.window_manager = self.workspace = window
        self.area, self.region, self.region_data = None, None, None

    def __getattr__(self, name):
        return getattr(bpy.context, name)


class InWindow:
    """bpy as in a Blender with a window."""

    app = SimpleNamespace(
        background=False,
        timers=bpy.app.timers,
        handlers=bpy.app.handlers,
        version=bpy.app.version,
        is_job_running=bpy.app.is_job_running,
    )

    def __init__(self, window):
        self.data = Data(window)

    def __getattr__(self, name):
        return getattr(bpy, name)


class Data:
    """bpy.data with the workspace that counts."""

    def __init__(self, window):
        self.workspaces = {window.name: window}

    def __getattr__(self, name):
        return getattr(bpy.data, name)


def instance(cls):
    """An object with the methods and defaults of an operator class, which Python cannot make itself."""
    names = {}
    for base in reversed(cls.__mro__):
        if "scfpf" in base.__module__:
            names |= {n: v for n, v in vars(base).items() if not n.startswith("__")}
    names |= {"report": lambda *_: None, "bl_label": cls.bl_label}
    made = type(cls.__name__, (), names)()
    operator = getattr(bpy.ops.scfpf, cls.__name__.removeprefix("SCFPF_OT_"))
    for prop in operator.get_rna_type().properties:
        if prop.identifier != "rna_type" and not hasattr(made, prop.identifier):
            setattr(made, prop.identifier, getattr(prop, "default", None))
    return made


# The module of each operator class with events, and the class.
MODAL = {
    "operators.volume.framing": ("SCFPF_OT_volume_frame",),
    "operators.camera.cycles": ("SCFPF_OT_cycles_rig", "SCFPF_OT_cycles_rig_update"),
    "operators.camera.preview": ("SCFPF_OT_preview_toggle",),
    "operators.camera.engine": ("SCFPF_OT_engine_warn",),
    "operators.image.render": ("SCFPF_OT_render", "SCFPF_OT_render_escape"),
    "operators.image.pick": ("SCFPF_OT_pick",),
    "operators.volume.mappings": ("SCFPF_OT_mapping_place",),
    "operators.aim.pin_click": ("SCFPF_OT_aim_pin_click",),
    "operators.aim.drag": ("SCFPF_OT_aim_drag",),
    "operators.aim.solve": ("SCFPF_OT_aim_solve",),
    "operators.layers.layer_render": ("SCFPF_OT_layers_render",),
}
# It leaves nothing: it only waits for what becomes of a press.
KEEPS_NOTHING = {"SCFPF_OT_live_select"}


def test_the_table_is_whole():
    known = {name for names in MODAL.values() for name in names} | KEEPS_NOTHING
    ours = {f"SCFPF_OT_{name}" for name in dir(bpy.ops.scfpf)}
    assert {name for name in ours if hasattr(getattr(bpy.types, name), "modal")} == known


@pytest.mark.parametrize("path", MODAL)
def test_disabling_ends_what_runs(path, addon, monkeypatch):
    add_cube((0, 0, -4))
    camera = add_camera()
    camera.scfpf.pixel_error = 2.0
    bpy.context.scene.camera = camera
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = 32, 18
    bpy.ops.scfpf.mapping_add()
    bpy.data.objects["Cube"].select_set(True)
    bpy.ops.scfpf.aim_view_add()
    bpy.context.view_layer.objects.active = camera
    camera.scfpf.aim.live = True
    bpy.context.view_layer.update()
    if "layer" in path:
        bpy.context.scene.render.engine = "CYCLES"
    running = addon("operators.common.running")
    for name in MODAL[path]:
        if name.endswith("rig_update"):
            bpy.ops.scfpf.cycles_rig()
        facts = sorted(o.name for o in bpy.data.objects), camera.scfpf.aim.live, len(bpy.data.scenes)
        window = Window()
        context, module = Context(window), addon(path)
        monkeypatch.setattr(module, "bpy", InWindow(window))
        for helper in ("operators.aim.watched", "operators.image.image_click"):
            if hasattr(addon(helper), "bpy"):
                monkeypatch.setattr(addon(helper), "bpy", InWindow(window))
        operator = instance(getattr(module, name))
        event = SimpleNamespace(
            type="NONE", value="NOTHING", mouse_x=0, mouse_y=0, mouse_region_x=0, mouse_region_y=0
        )
        begin = operator.wait if hasattr(operator, "wait") else lambda c, o=operator, e=event: o.invoke(c, e)
        if name.endswith("aim_solve"):
            operator.prepared = lambda _context: camera
        if name.endswith("pin_click"):
            operator._camera = camera.session_uid
        assert begin(context) == {"RUNNING_MODAL"}
        assert window.waiting == [operator] and window.left != ([], 0, [], 0)
        monkeypatch.setattr(running, "bpy", SimpleNamespace(context=context))
        monkeypatch.setattr(running, "_override", lambda _place: monkeypatch.context())
        running.cancel_all()
        assert window.left == ([], 0, [], 0), name
        assert running._running == []
        now = sorted(o.name for o in bpy.data.objects), camera.scfpf.aim.live, len(bpy.data.scenes)
        assert now == facts
        monkeypatch.undo()
