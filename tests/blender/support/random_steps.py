# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits by Blender's own means: the steps of ``random_sessions.Session``, one a ``do_`` method.

Methods that begin with ``do_edit_`` change something and then store a step of undo, themselves or not.
"""

import pathlib

import bpy

PRESETS = sorted(path.stem for path in pathlib.Path(__file__).resolve().parents[3].glob("presets/*.json"))
# What artists may rename: it looks alike in the Outliner, whoever made it.
RENAMED = ("objects", "node_groups", "collections", "cameras", "meshes", "materials", "scenes")
MODES = ("OBJECT", "EDIT", "SCULPT", "VERTEX_PAINT", "WEIGHT_PAINT", "TEXTURE_PAINT")
EXTENSION = "bl_ext.checkout.scfpf"
# Set by the extension alone, which keeps them in step with something.
KEPT = {"volume_object", "is_volume", "is_made", "hidden_in", "report", "statistics", "name"}
NAMES = ("", "Flexible Camera", "no such thing", "ä/ö\\..", "x" * 300)


def small_pictures(scene) -> None:
    """Let a scene render in no time."""
    scene.render.resolution_x, scene.render.resolution_y = 16, 9
    scene.cycles.samples = 1
    scene.eevee.taa_render_samples = 1
    if "EEVEE" in scene.render.engine:
        scene.render.engine = "BLENDER_WORKBENCH"  # EEVEE by software takes seconds a render
    scene.frame_end = 3


class EditSteps:
    """Edits of objects and cameras. A session adds random, folder, addon, steps, stores and its methods."""

    def objects(self) -> list:
        return list(bpy.context.view_layer.objects)

    def cameras(self) -> list:
        return [obj for obj in bpy.context.scene.objects if obj.type == "CAMERA" and obj.scfpf.enabled]

    def push(self) -> None:
        if self.stores:
            return
        bpy.ops.ed.undo_push(message=self.steps[-1][:60])

    def do_add_camera(self):
        self.call(bpy.ops.scfpf, "camera_add", {"preset": self.random.choice(PRESETS)})

    def do_add_surface(self):
        if bpy.ops.scfpf.surface_add.poll():
            self.call(bpy.ops.scfpf, "surface_add", self.options(bpy.ops.scfpf.surface_add))

    def do_apply_preset(self):
        if bpy.ops.scfpf.preset_apply.poll():
            self.call(bpy.ops.scfpf, "preset_apply", {"preset": self.random.choice(PRESETS)})

    def do_edit_select(self):
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

    def do_edit_remove_an_object(self):
        """As scripts do, volume objects and rigs too."""
        obj = self.random.choice(list(bpy.data.objects) or [None])
        self.note(f"remove {obj and obj.name}")
        if obj is not None:
            bpy.data.objects.remove(obj)
            self.push()

    def do_edit_remove_a_node_group(self):
        group = self.random.choice(list(bpy.data.node_groups) or [None])
        self.note(f"remove group {group and group.name}")
        if group is not None and self.random.random() < 0.3:
            bpy.data.node_groups.remove(group)
            self.push()

    def do_edit_remove_modifiers(self):
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

    def do_edit_transform(self):
        obj = self.random.choice(self.objects() or [None])
        self.note(f"transform {obj and obj.name}")
        if obj is not None:
            way = self.random.choice(("location", "rotation_euler", "scale"))
            values = [self.random.choice((0.0, self.random.uniform(-5, 5))) for _ in range(3)]
            setattr(obj, way, values)
            self.push()

    def do_edit_parent(self):
        there = self.objects()
        if len(there) > 1:
            child, parent = self.random.sample(there, 2)
            self.note(f"parent {child.name} to {parent.name}")
            try:
                child.parent = parent
            except (RuntimeError, ValueError):
                return  # a loop: Blender refuses
            self.push()

    def do_edit_keyframe(self):
        obj = self.random.choice(self.objects() or [None])
        self.note(f"key {obj and obj.name}")
        if obj is not None:
            obj.keyframe_insert(self.random.choice(("location", "scale")), frame=self.random.randint(1, 5))
            self.push()

    def do_frame(self):
        frame = self.random.randint(0, 5)
        self.note(f"frame {frame}")
        bpy.context.scene.frame_set(frame)

    def do_edit_set_a_property(self):
        """Set a random property of the extension that the interface shows, of an object or of the scene."""
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

    def do_edit_node_input(self):
        """A parameter of a surface, set in its modifier to anything."""
        surfaces = [o for o in bpy.data.objects if o.scfpf_surface.kind != "NONE" and o.modifiers]
        surface = self.random.choice(surfaces or [None])
        self.note(f"parameter of {surface and surface.name}")
        modifier = surface and next(
            (m for m in surface.modifiers if m.type == "NODES" and m.node_group), None
        )
        if not modifier:
            return
        versions = self.addon("bridge.blender.versions")
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


class ArtistSteps(EditSteps):
    """All steps: edits, and renders, undo, scenes, hiding, renaming, modes and files."""

    def do_f12(self):
        engine = "SCFPF" if self.random.random() < 0.9 else "CYCLES"
        bpy.context.scene.render.engine = engine
        self.call(bpy.ops.render, "render", {"write_still": False}, undo=False)

    def do_undo(self):
        self.call(bpy.ops.ed, "undo", {}, undo=False) if bpy.ops.ed.undo.poll() else None

    def do_redo(self):
        self.call(bpy.ops.ed, "redo", {}, undo=False) if bpy.ops.ed.redo.poll() else None

    def do_undo_and_redo(self):
        """Back and forth by several steps, as one looks for where it went wrong."""
        moves = [self.random.choice((bpy.ops.ed.undo, bpy.ops.ed.redo)) for _ in range(12)]
        self.note(f"{''.join('ur'[move == bpy.ops.ed.redo] for move in moves)}")
        for move in moves:
            if move.poll():
                move()

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
            small_pictures(bpy.context.scene)

    def do_another_scene(self):
        scene = self.random.choice(list(bpy.data.scenes))
        self.note(f"scene {scene.name}")
        bpy.context.window.scene = scene

    def do_delete_the_scene(self):
        if len(bpy.data.scenes) > 1 and self.random.random() < 0.3:
            self.call(bpy.ops.scene, "delete", {})

    def do_edit_hide(self):
        obj = self.random.choice(self.objects() or [None])
        self.note(f"hide {obj and obj.name}")
        if obj is not None:
            switch = self.random.choice(("hide_viewport", "hide_render", "hide_select"))
            setattr(obj, switch, not getattr(obj, switch))
            self.push()

    def do_edit_eye(self):
        """As H and Alt-H do, and the Outliner's eyes; often of a camera."""
        there = self.objects()
        cameras = [obj for obj in there if obj.type == "CAMERA"]
        obj = self.random.choice((cameras if self.random.random() < 0.6 else there) or [None])
        self.note(f"eye of {obj and obj.name}")
        if obj is None:
            return
        for other in there if self.random.random() < 0.3 else [obj]:
            other.hide_set(not obj.hide_get() if other == obj else False)
        self.push()

    def do_edit_rename(self):
        held = [one for name in RENAMED for one in getattr(bpy.data, name) if one.is_editable]
        ours = [one for one in held if "SCFPF" in one.name or "Flexible" in one.name]
        one = self.random.choice(ours if ours and self.random.random() < 0.7 else held)
        name = self.random.choice((f"Renamed {len(self.steps)}", *NAMES[1:], self.random.choice(held).name))
        self.note(f"rename {one.name} {name[:40]}")
        one.name = name
        self.push()

    def do_edit_remove_a_camera(self):
        camera = self.random.choice(self.cameras() or [None])
        self.note(f"remove the camera {camera and camera.name}")
        if camera is not None and self.random.random() < 0.5:
            bpy.data.objects.remove(camera)
            self.push()

    def do_delete_a_camera(self):
        cameras = [c for c in self.cameras() if c.name in bpy.context.view_layer.objects and c.visible_get()]
        if not cameras or self.random.random() < 0.5:
            return self.note("no camera to be deleted")
        for obj in self.objects():
            obj.select_set(False)
        chosen = self.random.choice(cameras)
        chosen.select_set(True)
        bpy.context.view_layer.objects.active = chosen
        self.note(f"delete {chosen.name}")
        return self.do_delete()

    def do_mode(self):
        """Any mode, then the nodes preview, as that looks at the screen and the mode."""
        obj = bpy.context.view_layer.objects.active
        mode = self.random.choice(MODES)
        if bpy.ops.object.mode_set.poll():
            try:
                self.call(bpy.ops.object, "mode_set", {"mode": mode})
            except TypeError:
                return  # this kind of object has no such mode
        if self.random.random() < 0.3 and bpy.ops.scfpf.preview_toggle.poll():
            self.note(f"of {obj and obj.name}")
            self.call(bpy.ops.scfpf, "preview_toggle", {})

    def do_disable_and_enable(self):
        if self.random.random() < 0.3:
            self.note("disable and enable the extension")
            assert bpy.ops.preferences.addon_disable(module=EXTENSION) == {"FINISHED"}
            bpy.context.view_layer.update()
            if self.random.random() < 0.5 and bpy.ops.ed.undo.poll():
                bpy.ops.ed.undo()
            assert bpy.ops.preferences.addon_enable(module=EXTENSION) == {"FINISHED"}
            # Handlers look at the file with the first edit.
            bpy.context.scene.update_tag()
            bpy.context.view_layer.update()

    def do_edit_exclude_a_collection(self):
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

    def do_edit_purge(self):
        self.note("purge")
        bpy.data.orphans_purge(do_recursive=True)
        self.push()
