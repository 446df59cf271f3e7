# SPDX-License-Identifier: GPL-3.0-or-later
"""A session of random steps by a seed, and the conditions that must hold after each step.

Operators of ours are found by introspection, with random values of their properties; what artists do beside
them is in ``random_steps``. Everything is looked up again in each step, as undo
frees datablocks.
"""

import os
import pathlib
import random
import re
import sys
import tempfile

import bpy
from bpy.app.handlers import persistent
from random_steps import NAMES, PRESETS, ArtistSteps, small_pictures
from recorded_layout import drawn
from stored_edit import dangling, stored_edit

# What a report in plain words never has in it.
FAULT = re.compile(r"Traceback|[a-z]+(Error|Exception|Warning)\b|<bpy|<class|\bobject at 0x")
# Picks by hand rather than for every property: what would only make the session slow.
LARGEST = {"columns": 40, "rows": 40, "resolution": 40, "points_u": 6, "points_v": 6, "points_w": 6}
LARGEST |= {"overscan": 4, "samples": 4, "projector_count": 9, "iso_surfaces": 4, "pattern_seed": 9}
# Two small tiles rather than dozens of renders.
FEW_TILES = {"columns": 2, "rows": 1}
OPTIONS = {"quilt": FEW_TILES, "quilt_joined": FEW_TILES}
# Operators that set the size of pictures, as that of a calibration, make it no larger.
MOST_PIXELS = 4096


class Fault(AssertionError):
    """Something that no artist should see."""


class Errors:
    """The standard error output of Python and of C between two readings."""

    def __enter__(self):
        self._file = tempfile.TemporaryFile()
        self._kept = os.dup(2)
        os.dup2(self._file.fileno(), 2)
        return self

    def __exit__(self, *_):
        os.dup2(self._kept, 2)
        os.close(self._kept)
        self._file.close()

    def new(self) -> str:
        end = os.lseek(self._file.fileno(), 0, os.SEEK_END)
        os.lseek(self._file.fileno(), 0, os.SEEK_SET)
        text = os.read(self._file.fileno(), end).decode(errors="replace")
        os.ftruncate(self._file.fileno(), 0)
        os.lseek(self._file.fileno(), 0, os.SEEK_SET)
        return text


class Session(ArtistSteps):
    """Random steps; ``journal`` gets a line before each, so that a crash has a name."""

    def __init__(self, seed: int, folder, addon, journal=None):
        self.random = random.Random(seed)
        self.folder, self.addon, self.journal = pathlib.Path(folder), addon, journal
        self.bad_input = addon("bridge.blender.user_errors").USER_ERRORS
        self.steps: list[str] = []
        self.stores = False  # whether the step of undo is stored by what called the method
        self.doings = [getattr(self, name) for name in sorted(dir(self)) if name.startswith("do_")]
        self.panels = [
            cls
            for name in sorted(dir(bpy.types))
            if name.startswith("SCFPF_PT_view") and hasattr(cls := getattr(bpy.types, name), "draw")
        ]
        self.operators = sorted(dir(bpy.ops.scfpf))
        scene = bpy.context.scene
        small_pictures(scene)
        scene.render.filepath = str(self.folder / "frame")
        bpy.ops.mesh.primitive_cube_add(location=(0, 0, -3))
        bpy.ops.mesh.primitive_plane_add(size=20)
        bpy.ops.scfpf.camera_add()
        bpy.ops.ed.undo_push(message="start")

    def run(self, count: int) -> None:
        @persistent
        def look(*_):
            self.look_for_dangling()

        histories = bpy.app.handlers.undo_post, bpy.app.handlers.redo_post
        for handlers in histories:
            handlers.insert(0, look)
        try:
            with Errors() as errors:
                for number in range(count):
                    self.run_step(number, errors)
        finally:
            for handlers in histories:
                handlers.remove(look)

    def run_step(self, number: int, errors: Errors) -> None:
        try:
            self.step()
            self.check()
        except Fault:
            raise
        except Exception as error:
            raise Fault(f"step {number}, {self.steps[-1]}: {type(error).__name__}: {error}") from error
        printed = errors.new()
        if "Traceback" in printed or "Exception" in printed:
            raise Fault(f"step {number}, {self.steps[-1]} printed:\n{printed}")

    def look_for_dangling(self) -> None:
        """After undo and redo, before anything else: Blender ends itself where it follows such a pointer."""
        lost = dangling()
        if lost:
            self.note(f"these point to what is gone: {lost}")
            print(f"Exception: {self.steps[-1]}", file=sys.stderr)

    def note(self, what: str) -> None:
        self.steps.append(what)
        if self.journal is not None:
            print(len(self.steps), what, file=self.journal, flush=True)

    def step(self) -> None:
        if self.random.random() < 0.5:
            self.call_one_of_ours()
        else:
            self.do(self.random.choice(self.doings))

    def do(self, method) -> None:
        """Call a method; half of those that edit have their step stored before handlers see what they did."""
        if not method.__name__.startswith("do_edit_") or self.random.random() < 0.5:
            return method()
        self.stores = True
        try:
            stored_edit(method)
        finally:
            self.stores = False
        return None

    # Operators

    def call_one_of_ours(self) -> None:
        able = [name for name in self.operators if getattr(bpy.ops.scfpf, name).poll()]
        if not able:
            return self.note("no operator of ours can be called")
        name = self.random.choice(able)
        # Python stores no step of undo by default.
        undo = self.random.random() < 0.5
        options = self.options(getattr(bpy.ops.scfpf, name)) | OPTIONS.get(name, {})
        self.call(bpy.ops.scfpf, name, options, undo)
        render = bpy.context.scene.render
        if render.resolution_x * render.resolution_y > MOST_PIXELS:
            small_pictures(bpy.context.scene)
        return None

    def options(self, operator) -> dict:
        """Some of an operator's properties, with random values."""
        known = [p for p in operator.get_rna_type().properties if p.identifier != "rna_type"]
        return {p.identifier: self.value(p) for p in known if self.random.random() < 0.8}

    def value(self, prop):
        """Any value that a property takes, seldom an outermost one."""
        pick = self.random
        if prop.type == "BOOLEAN":
            return (
                [pick.random() < 0.5 for _ in range(prop.array_length)]
                if prop.is_array
                else pick.random() < 0.5
            )
        if prop.type in ("INT", "FLOAT"):
            numbers = [self.number(prop) for _ in range(prop.array_length if prop.is_array else 1)]
            return numbers if prop.is_array else numbers[0]
        if prop.type == "ENUM":
            chosen = [item.identifier for item in prop.enum_items] or PRESETS
            if prop.identifier == "engine" and "EEVEE" in chosen and pick.random() < 0.9:
                chosen.remove("EEVEE")  # by software it takes seconds a render, however small
            return {pick.choice(chosen)} if prop.is_enum_flag else pick.choice(chosen)
        if prop.type == "STRING":
            return self.path() if prop.subtype == "FILE_PATH" else self.name()
        raise Fault(f"a property of type {prop.type} is new to this test: {prop.identifier}")

    def number(self, prop):
        low, high = prop.hard_min, prop.hard_max
        whole = prop.type == "INT"
        if prop.identifier in LARGEST:
            high = LARGEST[prop.identifier]
        elif self.random.random() < 0.05:
            return self.random.choice((low, high, 0 if low <= 0 <= high else low))
        low, high = max(low, -10), min(high, 10 + max(low, -10))
        return self.random.randint(int(low), int(high)) if whole else self.random.uniform(low, high)

    def name(self) -> str:
        names = [obj.name for obj in bpy.data.objects] + list(NAMES)
        return self.random.choice(names)

    def path(self) -> str:
        files = [str(path) for path in sorted(self.folder.iterdir()) if path.is_file()]
        new = [
            str(self.folder / f"own{self.random.randrange(4)}.json"),
            str(self.folder),
            "",
            "nowhere/at all",
        ]
        return self.random.choice(files + new)

    def call(self, module, name: str, options: dict, undo: bool = True) -> None:
        """Call an operator: it finishes, is cancelled or says in plain words what is wrong."""
        self.note(f"{name} {options}" + ("" if undo else " without a step"))
        try:
            getattr(module, name)("EXEC_DEFAULT", undo, **options)
        except RuntimeError as error:
            if FAULT.search(str(error)):
                raise Fault(f"{self.steps[-1]} says: {error}") from error

    # What must hold

    def check(self) -> None:
        bpy.context.view_layer.update()
        if lost := dangling():
            raise Fault(f"these point to what is gone after {self.steps[-1]}: {lost}")
        self.check_cameras()
        self.check_handlers()
        for panel in self.panels:
            if not hasattr(panel, "poll") or panel.poll(bpy.context):
                drawn(panel)

    def check_cameras(self) -> None:
        read = self.addon("bridge.camera.read_projection")
        depsgraph = bpy.context.evaluated_depsgraph_get()
        owned: dict[str, str] = {}
        for camera in self.cameras():
            volume = camera.scfpf.volume_object
            if volume is None or volume.parent != camera:
                raise Fault(f"{camera.name} has no volume object after {self.steps[-1]}")
            if volume.name in owned:
                raise Fault(f"{camera.name} and {owned[volume.name]} share one after {self.steps[-1]}")
            owned[volume.name] = camera.name
            is_lost = any(
                slot.object is None or bpy.context.scene not in slot.object.users_scene
                for slot in camera.scfpf.surfaces
            )
            try:
                read.read_projection(camera, depsgraph, 16 / 9)
            except self.bad_input as error:
                if FAULT.search(str(error)):
                    raise Fault(f"{camera.name}: {error}") from error
            else:
                if is_lost:
                    raise Fault(f"{camera.name} has lost a surface and says nothing, {self.steps[-1]}")
        everyone = {o.scfpf.volume_object for o in bpy.data.objects if o.type == "CAMERA"}
        for obj in bpy.data.objects:
            if obj.scfpf_surface.is_volume and obj not in everyone:
                raise Fault(f"{obj.name} is nobody's volume object after {self.steps[-1]}")

    def check_handlers(self) -> None:
        for name in dir(bpy.app.handlers):
            functions = getattr(bpy.app.handlers, name)
            if isinstance(functions, list):
                known = [(f.__module__, f.__qualname__) for f in functions]
                if len(known) != len(set(known)):
                    raise Fault(f"{name} has a handler twice")
