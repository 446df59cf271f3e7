# SPDX-License-Identifier: GPL-3.0-or-later
"""A session of an artist who does anything at all: random steps by a seed, and what must hold after each.

Operators of ours are found by introspection, with random values of their properties; what artists do beside
them is in ``Session``'s methods that begin with ``do_``. Everything is looked up again in each step, as undo
frees datablocks.
"""

import os
import pathlib
import random
import re
import tempfile

import bpy
from test_panels import drawn

PRESETS = sorted(path.stem for path in pathlib.Path(__file__).resolve().parents[2].glob("presets/*.json"))
# What a report in plain words never has in it.
FAULT = re.compile(r"Traceback|[a-z]+(Error|Exception|Warning)\b|<bpy|<class|\bobject at 0x")
# Picks by hand rather than for every property: what would only make the session slow.
LARGEST = {"columns": 40, "rows": 40, "resolution": 40, "points_u": 6, "points_v": 6, "points_w": 6}
LARGEST |= {"samples": 4, "projector_count": 9, "iso_surfaces": 4, "pattern_seed": 9}
OWN_GROUPS = ("scfpf", "scfpf_surface", "scfpf_sampling")
# Set by the extension alone, which keeps them in step with something.
KEPT = {"volume_object", "is_volume", "report", "statistics", "name"}
NAMES = ("", "Flexible Camera", "no such thing", "ä/ö\\..", "x" * 300)


class Fault(AssertionError):
    """Something that no artist should see."""


class Errors:
    """What is written to the standard error output, by Python or by C, from one look to the next."""

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


class Session:
    """Random steps; ``journal`` gets a line before each, so that a crash has a name."""

    def __init__(self, seed: int, folder, addon, journal=None):
        self.random = random.Random(seed)
        self.folder, self.addon, self.journal = pathlib.Path(folder), addon, journal
        self.bad_input = addon("operators.errors").BAD_INPUT
        self.steps: list[str] = []
        self.doings = [getattr(self, name) for name in sorted(dir(self)) if name.startswith("do_")]
        self.panels = [
            cls
            for name in sorted(dir(bpy.types))
            if name.startswith("SCFPF_PT_view") and hasattr(cls := getattr(bpy.types, name), "draw")
        ]
        self.operators = sorted(dir(bpy.ops.scfpf))
        scene = bpy.context.scene
        scene.render.resolution_x, scene.render.resolution_y = 16, 9
        scene.cycles.samples = 1
        scene.render.filepath = str(self.folder / "frame")
        bpy.ops.mesh.primitive_cube_add(location=(0, 0, -3))
        bpy.ops.mesh.primitive_plane_add(size=20)
        bpy.ops.scfpf.camera_add()
        bpy.ops.ed.undo_push(message="start")

    def run(self, count: int) -> None:
        with Errors() as errors:
            for number in range(count):
                try:
                    self.step()
                    self.check()
                except Fault:
                    raise
                except Exception as error:
                    raise Fault(
                        f"step {number}, {self.steps[-1]}: {type(error).__name__}: {error}"
                    ) from error
                printed = errors.new()
                if "Traceback" in printed or "Exception" in printed:
                    raise Fault(f"step {number}, {self.steps[-1]} printed:\n{printed}")

    def note(self, what: str) -> None:
        self.steps.append(what)
        if self.journal is not None:
            print(len(self.steps), what, file=self.journal, flush=True)

    def step(self) -> None:
        if self.random.random() < 0.5:
            self.call_one_of_ours()
        else:
            self.random.choice(self.doings)()

    # Operators

    def call_one_of_ours(self) -> None:
        able = [name for name in self.operators if getattr(bpy.ops.scfpf, name).poll()]
        if not able:
            return self.note("no operator of ours can be called")
        name = self.random.choice(able)
        self.call(bpy.ops.scfpf, name, self.options(getattr(bpy.ops.scfpf, name)))
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
        self.note(f"{name} {options}")
        try:
            getattr(module, name)("EXEC_DEFAULT", undo, **options)
        except RuntimeError as error:
            if FAULT.search(str(error)):
                raise Fault(f"{self.steps[-1]} says: {error}") from error

    # What artists do with Blender's own means

    def objects(self) -> list:
        return list(bpy.context.view_layer.objects)

    def cameras(self) -> list:
        return [obj for obj in bpy.context.scene.objects if obj.type == "CAMERA" and obj.scfpf.enabled]

    def push(self) -> None:
        bpy.ops.ed.undo_push(message=self.steps[-1][:60])

    def do_add_camera(self):
        self.call(bpy.ops.scfpf, "camera_add", {"preset": self.random.choice(PRESETS)})

    def do_add_surface(self):
        if bpy.ops.scfpf.surface_add.poll():
            self.call(bpy.ops.scfpf, "surface_add", self.options(bpy.ops.scfpf.surface_add))

    def do_apply_preset(self):
        if bpy.ops.scfpf.preset_apply.poll():
            self.call(bpy.ops.scfpf, "preset_apply", {"preset": self.random.choice(PRESETS)})

    def do_select(self):
        there = self.objects()
        chosen = {obj.name for obj in self.random.sample(there, min(len(there), self.random.randint(0, 3)))}
        self.note(f"select {chosen}")
        for obj in there:
            obj.select_set(obj.name in chosen)
        wanted = [obj for obj in there if obj.name in chosen] + self.cameras()
        active = self.random.choice(wanted or [None])
        bpy.context.view_layer.objects.active = active
        self.push()

    def do_select_two_cameras(self):
        cameras = [c for c in self.cameras() if c.name in bpy.context.view_layer.objects]
        self.note("select cameras")
        for obj in self.objects():
            obj.select_set(obj in cameras[:2])
        if cameras:
            bpy.context.view_layer.objects.active = cameras[0]

    def do_delete(self):
        self.call(bpy.ops.object, "delete", {}) if bpy.ops.object.delete.poll() else None

    def do_remove_an_object(self):
        """As scripts do, volume objects and rigs too."""
        obj = self.random.choice(list(bpy.data.objects) or [None])
        self.note(f"remove {obj and obj.name}")
        if obj is not None:
            bpy.data.objects.remove(obj)
            self.push()

    def do_remove_a_node_group(self):
        group = self.random.choice(list(bpy.data.node_groups) or [None])
        self.note(f"remove group {group and group.name}")
        if group is not None and self.random.random() < 0.3:
            bpy.data.node_groups.remove(group)
            self.push()

    def do_remove_modifiers(self):
        holders = [obj for obj in bpy.data.objects if obj.modifiers]
        obj = self.random.choice(holders or [None])
        self.note(f"remove modifiers of {obj and obj.name}")
        if obj is not None and self.random.random() < 0.4:
            obj.modifiers.clear()
            self.push()

    def do_duplicate(self):
        linked = self.random.random() < 0.5
        self.call(
            bpy.ops.object, "duplicate", {"linked": linked}
        ) if bpy.ops.object.duplicate.poll() else None

    def do_transform(self):
        obj = self.random.choice(self.objects() or [None])
        self.note(f"transform {obj and obj.name}")
        if obj is not None:
            way = self.random.choice(("location", "rotation_euler", "scale"))
            values = [self.random.choice((0.0, self.random.uniform(-5, 5))) for _ in range(3)]
            setattr(obj, way, values)
            self.push()

    def do_parent(self):
        there = self.objects()
        if len(there) > 1:
            child, parent = self.random.sample(there, 2)
            self.note(f"parent {child.name} to {parent.name}")
            try:
                child.parent = parent
            except (RuntimeError, ValueError):
                return  # a loop: Blender refuses
            self.push()

    def do_keyframe(self):
        obj = self.random.choice(self.objects() or [None])
        self.note(f"key {obj and obj.name}")
        if obj is not None:
            obj.keyframe_insert(self.random.choice(("location", "scale")), frame=self.random.randint(1, 5))
            self.push()

    def do_frame(self):
        frame = self.random.randint(0, 5)
        self.note(f"frame {frame}")
        bpy.context.scene.frame_set(frame)

    def do_set_a_property(self):
        """Any property of ours that the interface shows, of any object or of the scene."""
        owners = [obj.scfpf for obj in self.cameras()]
        owners += [obj.scfpf_surface for obj in bpy.data.objects if obj.scfpf_surface.kind != "NONE"]
        owners += [item for camera in self.cameras() for item in camera.scfpf.mappings]
        owners += [slot for camera in self.cameras() for slot in camera.scfpf.surfaces]
        owners += [bpy.context.scene.scfpf_sampling]
        owner = self.random.choice(owners)
        known = [p for p in owner.bl_rna.properties if not p.is_readonly and p.identifier not in KEPT]
        prop = self.random.choice(known)
        is_pointer = prop.type == "POINTER"
        value = self.random.choice([None, *bpy.data.objects]) if is_pointer else self.value(prop)
        shown = getattr(value, "name", value)
        self.note(f"set {owner.path_from_id()}.{prop.identifier} = {shown}")
        try:
            setattr(owner, prop.identifier, value)
        except TypeError:
            return  # a pointer to another type of datablock
        self.push()

    def do_edit_a_node_input(self):
        """A parameter of a surface, set in its modifier to anything."""
        surfaces = [o for o in bpy.data.objects if o.scfpf_surface.kind != "NONE" and o.modifiers]
        surface = self.random.choice(surfaces or [None])
        self.note(f"parameter of {surface and surface.name}")
        modifier = surface and next(
            (m for m in surface.modifiers if m.type == "NODES" and m.node_group), None
        )
        if not modifier:
            return
        versions = self.addon("scfpf_addon.bridge.versions")
        for item in modifier.node_group.interface.items_tree:
            if (
                item.item_type == "SOCKET"
                and item.in_out == "INPUT"
                and item.socket_type == "NodeSocketFloat"
            ):
                value = self.random.choice((0.0, -1.0, 1e9, float("nan"), self.random.uniform(0, 9)))
                versions.set_modifier_input(modifier, item.identifier, value)
                break
        surface.update_tag()
        self.push()

    def do_f12(self):
        engine = "SCFPF" if self.random.random() < 0.9 else "CYCLES"
        bpy.context.scene.render.engine = engine
        self.call(bpy.ops.render, "render", {"write_still": False}, undo=False)

    def do_undo(self):
        self.call(bpy.ops.ed, "undo", {}, undo=False) if bpy.ops.ed.undo.poll() else None

    def do_redo(self):
        self.call(bpy.ops.ed, "redo", {}, undo=False) if bpy.ops.ed.redo.poll() else None

    def do_undo_all(self):
        self.note("undo fifty times")
        for _ in range(50 if self.random.random() < 0.2 else 8):
            try:
                bpy.ops.ed.undo()
            except RuntimeError:
                break

    def do_copy_the_scene(self):
        if len(bpy.data.scenes) < 4:
            kind = self.random.choice(("LINK_COPY", "FULL_COPY", "EMPTY"))
            self.call(bpy.ops.scene, "new", {"type": kind})
            bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = 16, 9
            bpy.context.scene.cycles.samples = 1

    def do_another_scene(self):
        scene = self.random.choice(list(bpy.data.scenes))
        self.note(f"scene {scene.name}")
        bpy.context.window.scene = scene

    def do_delete_the_scene(self):
        if len(bpy.data.scenes) > 1 and self.random.random() < 0.3:
            self.call(bpy.ops.scene, "delete", {})

    def do_hide(self):
        obj = self.random.choice(self.objects() or [None])
        self.note(f"hide {obj and obj.name}")
        if obj is not None:
            switch = self.random.choice(("hide_viewport", "hide_render", "hide_select"))
            setattr(obj, switch, not getattr(obj, switch))
            self.push()

    def do_exclude_a_collection(self):
        layers = list(bpy.context.view_layer.layer_collection.children)
        layer = self.random.choice(layers or [None])
        self.note(f"exclude {layer and layer.name}")
        if layer is not None:
            layer.exclude = not layer.exclude
            self.push()

    def do_save(self):
        path = str(self.folder / "session.blend")
        self.call(bpy.ops.wm, "save_as_mainfile", {"filepath": path, "copy": True}, undo=False)

    def do_save_and_reload(self):
        path = str(self.folder / "session.blend")
        self.call(bpy.ops.wm, "save_as_mainfile", {"filepath": path}, undo=False)
        self.call(bpy.ops.wm, "open_mainfile", {"filepath": path}, undo=False)
        bpy.ops.ed.undo_push(message="loaded")

    def do_purge(self):
        self.note("purge")
        bpy.data.orphans_purge(do_recursive=True)
        self.push()

    # What must hold

    def check(self) -> None:
        bpy.context.view_layer.update()
        self.check_cameras()
        self.check_handlers()
        for panel in self.panels:
            if not hasattr(panel, "poll") or panel.poll(bpy.context):
                drawn(panel)

    def check_cameras(self) -> None:
        read = self.addon("scfpf_addon.bridge.read_projection")
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
