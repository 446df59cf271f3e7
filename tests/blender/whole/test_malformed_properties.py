# SPDX-License-Identifier: GPL-3.0-or-later
"""Files whose properties are nonsense: no traceback, no crash, and refusals in plain words."""

import os

import bpy
import pytest
from malformed_properties import SPOILED, WITH_NODES, Scene, put
from random_sessions import FAULT, Errors
from recorded_layout import drawn

# The Cycles rig and the nodes preview as well; building their nodes takes seconds.
FULL = bool(os.environ.get("SCFPF_FULL_TESTS"))


class Exercise:
    """All that an artist would do with such a file; what Blender is told goes to ``told``."""

    def __init__(self, errors, path):
        self.errors, self.path, self.told = errors, path, []
        self.panels = [
            getattr(bpy.types, name)
            for name in sorted(dir(bpy.types))
            if name.startswith("SCFPF_PT_view") and hasattr(getattr(bpy.types, name), "draw")
        ]

    def check(self, what: str) -> None:
        printed = self.errors.new()
        assert "Traceback" not in printed and "Exception" not in printed, f"{what} printed:\n{printed}"

    def look(self, what: str) -> None:
        bpy.context.view_layer.update()
        self.check(what)
        camera = next((o for o in bpy.context.view_layer.objects if o.type == "CAMERA"), None)
        for active in (
            camera,
            *(o for o in bpy.context.view_layer.objects if o.scfpf_surface.kind != "NONE"),
        ):
            bpy.context.view_layer.objects.active = active
            for panel in self.panels:
                if not hasattr(panel, "poll") or panel.poll(bpy.context):
                    drawn(panel)
        bpy.context.view_layer.objects.active = camera
        self.check(f"drawing after {what}")

    def call(self, operator, **options) -> None:
        name = operator.idname_py()
        if not operator.poll():
            return
        try:
            operator(**options)
        except RuntimeError as error:
            self.told.append(str(error))
            assert not FAULT.search(str(error)), f"{name}: {error}"
        self.check(name)

    def render(self) -> None:
        self.call(bpy.ops.scfpf.render)
        bpy.context.scene.render.engine = "SCFPF"
        self.call(bpy.ops.render.render)

    def run(self) -> None:
        """The file is saved as it is, and then loaded and used."""
        self.load()
        self.render()
        if FULL:
            for operator in (bpy.ops.scfpf.cycles_rig, bpy.ops.scfpf.preview_toggle):
                self.call(operator)
                self.look(operator.idname_py())
            self.load()
            self.render()

    def load(self) -> None:
        bpy.ops.wm.save_as_mainfile(filepath=self.path)
        bpy.ops.wm.open_mainfile(filepath=self.path)
        self.look("loading")


@pytest.mark.parametrize("spoiled", [name for name in SPOILED if FULL or name not in WITH_NODES])
def test_nonsense_in_a_file_is_survived(spoiled, tmp_path):
    scene = Scene()
    with Errors() as errors:
        SPOILED[spoiled](scene)
        Exercise(errors, str(tmp_path / "nonsense.blend")).run()


@pytest.mark.parametrize(
    "spoiled", ["the_library_of_surfaces_is_missing", "the_library_of_the_camera_is_missing"]
)
def test_what_is_missing_says_where_it_was(spoiled, tmp_path):
    scene = Scene()
    with Errors() as errors:
        SPOILED[spoiled](scene)
        exercise = Exercise(errors, str(tmp_path / "nonsense.blend"))
        exercise.load()
        exercise.render()
    # The Render button and F12.
    assert len(exercise.told) == 2
    for message in exercise.told:
        assert "is missing from '" in message and "lost.blend'" in message and "Relocate" in message


def test_what_is_set_back_is_named_on_the_camera(tmp_path):
    settings, name = Scene().settings, bpy.context.object.name
    put(settings, "samples", 2**31 - 1)
    put(settings, "basis", 77)
    put(settings, "u_range", [float("nan"), 1.0])
    put(settings.surfaces[0], "object", bpy.context.scene)
    settings.pixel_error = 0.25
    path = str(tmp_path / "nonsense.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    settings = bpy.data.objects[name].scfpf
    assert (settings.samples, settings.basis, tuple(settings.u_range)) == (4, "BEZIER", (0.0, 1.0))
    assert settings.surfaces[0].object is None and settings.pixel_error == 0.25
    assert settings.report.startswith("Reset on loading")
    for title in ("Samples", "Projectors", "U Range", "Control Surface"):
        assert title in settings.report
    with pytest.raises(RuntimeError, match=r"Control surface 1 of .* is empty"):
        bpy.ops.scfpf.render()


def test_sound_settings_are_left_alone(tmp_path, addon):
    reset_invalid = addon("bridge.settings.validation").reset_invalid
    scene = Scene()
    for group in (scene.settings, scene.scene.scfpf_sampling, scene.scene.scfpf_drawn):
        assert reset_invalid(group) == []
    for surface in scene.surfaces:
        assert reset_invalid(surface.scfpf_surface) == []


def test_surfaces_of_an_older_version_get_limits_on_loading(addon, tmp_path):
    """Their node groups made as many faces as they were told to, and Blender ends itself from 2^30 on."""
    nodes, versions = (
        addon("bridge.surfaces.surface_object"),
        addon("bridge.blender.versions"),
    )
    surface = Scene().surfaces[0]
    modifier, identifiers = nodes.parameter_modifier(surface)
    group, name = modifier.node_group, surface.name
    for axis in "uv":
        faces = group.nodes[f"Faces along {axis}"]
        asked = faces.inputs["Value"].links[0].from_socket
        group.links.new(asked, group.nodes[f"Vertices along {axis}"].inputs[0])
        group.nodes.remove(faces)
    versions.set_modifier_input(modifier, identifiers["Resolution U"], 1500)
    versions.set_modifier_input(modifier, identifiers["Resolution V"], -3)
    surface.update_tag()

    def vertices():
        surface = bpy.data.objects[name]
        return len(surface.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices)

    assert vertices() == 0, "V was not limited"
    path = str(tmp_path / "older.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    for _ in range(2):
        bpy.ops.wm.open_mainfile(filepath=path)
        assert vertices() == 1025 * 2
        bpy.ops.wm.save_as_mainfile(filepath=path)
    names = [node.name for node in bpy.data.node_groups["SCFPF Plane"].nodes]
    assert sum(name.startswith("Faces along") for name in names) == 2, "limited once, not once a load"
