# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip as an artist gets it: installed, enabled, rendered from, switched off and on, taken away again."""

import importlib
import importlib.metadata
import pathlib
import re
import shutil
import sys
import types
import zipfile

import bpy
import numpy as np
import pytest

SIZE = (64, 36)


def render_a_cube():
    """Add a flexible camera to a file with one glowing cube and render: pixels (H, W, 4)."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    bpy.ops.mesh.primitive_cube_add(size=2)
    material = bpy.data.materials.new("Glow")
    if material.node_tree is None:  # Blender 4.5; 5 makes them at once
        material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Emission Color"].default_value = (1.0, 0.25, 0.0, 1.0)
    shader.inputs["Emission Strength"].default_value = 2.0
    bpy.context.object.data.materials.append(material)
    assert bpy.ops.scfpf.camera_add() == {"FINISHED"}
    assert scene.camera is not None and scene.camera.scfpf.enabled
    assert bpy.ops.scfpf.render() == {"FINISHED"}
    image = bpy.data.images["SCFPF Render"]
    assert tuple(image.size) == SIZE
    pixels = np.empty(SIZE[0] * SIZE[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(SIZE[1], SIZE[0], 4)


def assert_cube(pixels):
    """The cube glows in the middle, and a corner shows none of it."""
    assert np.isfinite(pixels).all()
    middle, corner = pixels[SIZE[1] // 2, SIZE[0] // 2], pixels[0, 0]
    # Emission alone; what light the world adds comes on top.
    assert middle[0] >= 1.9 and 0.4 <= middle[1] < middle[0] / 2
    assert corner[0] < 1.0


def test_installed_where_it_belongs(installed, extensions_folder):
    assert installed in bpy.context.preferences.addons
    folder = pathlib.Path(sys.modules[installed].__file__).parent
    assert folder == extensions_folder / "user_default" / "scfpf"


def test_renders_with_the_wheel_of_the_zip(installed, extensions_folder):
    assert_cube(render_a_cube())
    assert pathlib.Path(sys.modules["embreex"].__file__).is_relative_to(extensions_folder)


def test_off_and_on_again(installed):
    assert bpy.ops.preferences.addon_disable(module=installed) == {"FINISHED"}
    assert not hasattr(bpy.types.Object, "scfpf") and not hasattr(bpy.types.Object, "scfpf_surface")
    assert not hasattr(bpy.types, "SCFPF_OT_render")
    assert bpy.ops.preferences.addon_enable(module=installed) == {"FINISHED"}
    assert_cube(render_a_cube())


def test_a_file_outlives_the_add_on(installed, tmp_path):
    """A Blender without the add-on keeps a volume, and one with it finds it again."""
    render_a_cube()
    names = [slot.object.name for slot in bpy.context.scene.camera.scfpf.surfaces]
    assert len(names) >= 2
    first, second = str(tmp_path / "first.blend"), str(tmp_path / "second.blend")
    bpy.ops.wm.save_as_mainfile(filepath=first)
    bpy.ops.preferences.addon_disable(module=installed)
    bpy.ops.wm.open_mainfile(filepath=first)
    bpy.ops.wm.save_as_mainfile(filepath=second)
    bpy.ops.preferences.addon_enable(module=installed)
    bpy.ops.wm.open_mainfile(filepath=second)
    assert [slot.object.name for slot in bpy.context.scene.camera.scfpf.surfaces] == names


def renumbered(path, version, folder):
    """A copy of the zip that says it is another version."""
    copy = folder / f"scfpf-{version}.zip"
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(copy, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "blender_manifest.toml":
                data = re.sub(rb'(?m)^version = "[^"]*"', f'version = "{version}"'.encode(), data, count=1)
            new.writestr(name, data)
    return copy


def test_another_version_over_it_while_the_caster_is_in_use(installed, this_zip, extensions_folder, tmp_path):
    expected = render_a_cube()
    assert "embreex" in sys.modules
    path = tmp_path / "modelled.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    for version in ("99.0.0", "0.0.9"):
        done = bpy.ops.extensions.package_install_files(
            filepath=str(renumbered(this_zip, version, tmp_path)),
            repo="user_default",
            enable_on_install=True,
        )
        assert done == {"FINISHED"}
        manifest = (extensions_folder / "user_default" / "scfpf" / "blender_manifest.toml").read_text("utf-8")
        assert f'version = "{version}"' in manifest
        assert installed in bpy.context.preferences.addons
        bpy.ops.wm.open_mainfile(filepath=str(path))
        assert bpy.ops.scfpf.render() == {"FINISHED"}
        assert np.array_equal(render_a_cube(), expected)


def labels(installed):
    """The labels of the panel's popover of messages."""
    said = []

    class Layout:
        def __getattr__(self, name):
            return lambda *_arguments, **_options: Layout()

        def label(self, text="", **_options):
            said.append(text)

    panel = importlib.import_module(f"{installed}.panels.messages").SCFPF_PT_messages
    panel.draw(types.SimpleNamespace(layout=Layout()), bpy.context)
    return " ".join(said)


def switched_off(installed):
    """As in a Blender that starts anew: nothing of the add-on is imported any more."""
    assert bpy.ops.preferences.addon_disable(module=installed) == {"FINISHED"}
    for name in [name for name in sys.modules if name.startswith(installed)]:
        del sys.modules[name]


def broken_copy(site_packages, folder):
    """The wheel's embreex in another folder, its libraries cut off as by a download that broke."""
    without = shutil.ignore_patterns("__pycache__")
    copy = pathlib.Path(shutil.copytree(site_packages / "embreex", folder / "embreex", ignore=without))
    libraries = [*copy.glob("*.so"), *copy.glob("*.pyd")]
    assert libraries
    for library in libraries:
        library.write_bytes(library.read_bytes()[:100])
    return folder


def edit_preview_and_render_by_cycles(scene):
    """Do what needs no caster. What keeps it from use makes no difference here."""
    assert bpy.ops.scfpf.preset_apply(preset="angular_fisheye") == {"FINISHED"}
    assert bpy.ops.scfpf.preview_toggle() == {"FINISHED"}
    assert bpy.ops.scfpf.preview_toggle() == {"FINISHED"}
    assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
    scene.cycles.samples = 1
    assert bpy.ops.render.render() == {"FINISHED"}


@pytest.mark.parametrize("fault", ["missing", "cannot be loaded", "too old"])
def test_without_a_caster_all_else_works(installed, wheel_finder, monkeypatch, tmp_path, fault):
    render_a_cube()
    assert "embreex" not in labels(installed)
    broken = broken_copy(wheel_finder.folder, tmp_path)
    switched_off(installed)  # which takes the wheel away too
    for name in [name for name in sys.modules if name == "embreex" or name.startswith("embreex.")]:
        monkeypatch.delitem(sys.modules, name)
    if fault == "missing":
        monkeypatch.setitem(sys.modules, "embreex", None)
    elif fault == "cannot be loaded":
        monkeypatch.setattr(wheel_finder, "folder", broken)
    else:
        found = importlib.metadata.version
        monkeypatch.setattr(
            importlib.metadata, "version", lambda name: "2.17.7" if name == "embreex" else found(name)
        )
    assert bpy.ops.preferences.addon_enable(module=installed) == {"FINISHED"}
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.mesh.primitive_cube_add(size=2)
    assert bpy.ops.scfpf.camera_add() == {"FINISHED"}
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    said = labels(installed)
    assert fault in said and "install Flexible Projection again from the zip for this system" in said
    with pytest.raises(RuntimeError, match=f"{fault}.*install Flexible Projection again"):
        bpy.ops.scfpf.render()
    scene.render.engine = "SCFPF"
    with pytest.raises(RuntimeError, match=f"{fault}.*install Flexible Projection again"):
        bpy.ops.render.render()
    if fault == "missing":
        edit_preview_and_render_by_cycles(scene)
    switched_off(installed)
    monkeypatch.undo()
    bpy.ops.preferences.addon_enable(module=installed)
    assert_cube(render_a_cube())


def test_taken_away(installed, extensions_folder):
    """The last of the file: afterwards nothing of the add-on is left."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    repositories = [one.module for one in bpy.context.preferences.extensions.repos]
    index = repositories.index("user_default")
    assert bpy.ops.extensions.package_uninstall(repo_index=index, pkg_id="scfpf") == {"FINISHED"}
    assert installed not in bpy.context.preferences.addons
    assert not (extensions_folder / "user_default" / "scfpf").exists()
