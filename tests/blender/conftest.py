# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads the checkout as an extension, once a session, in a fresh profile."""

import importlib
import os
import pathlib
import sys
import tempfile

SCRATCH = tempfile.TemporaryDirectory(prefix="scfpf-tests-", ignore_cleanup_errors=True)
if "bpy" not in sys.modules:  # inside a Blender, tests/run_in_blender.py has done it before Blender started
    os.environ["BLENDER_USER_RESOURCES"] = os.path.join(SCRATCH.name, "profile")
    os.mkdir(os.environ["BLENDER_USER_RESOURCES"])  # Blender passes over a folder that is not there

# For modules that several tests share.
sys.path.append(os.path.dirname(os.path.abspath(__file__)))

import bpy
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
MODULE = "bl_ext.checkout.scfpf"


def link_folder(link, target):
    """A folder that is another one: a symbolic link, on Windows (where that needs a privilege) a junction."""
    if os.name == "nt":
        import _winapi

        _winapi.CreateJunction(str(target), str(link))
    else:
        link.symlink_to(target, target_is_directory=True)


@pytest.fixture(scope="session", autouse=True)
def extension():
    """The add-on's root package, enabled; disabled again at the end."""
    folder = pathlib.Path(SCRATCH.name, "repository")
    folder.mkdir()
    link_folder(folder / "scfpf", ROOT)
    bpy.context.preferences.extensions.repos.new(
        name="checkout", module="checkout", custom_directory=str(folder), remote_url=""
    )
    assert bpy.ops.preferences.addon_enable(module=MODULE) == {"FINISHED"}
    yield importlib.import_module(MODULE)
    bpy.ops.preferences.addon_disable(module=MODULE)


@pytest.fixture
def addon():
    """Import a module of the extension by its path inside it: addon("scfpf_addon.bridge.versions")."""
    return lambda name: importlib.import_module(f"{MODULE}.{name}")


@pytest.fixture(autouse=True)
def empty_file(extension):
    """Every test starts from a file with one empty scene."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


@pytest.fixture
def engine_scene(tmp_path):
    """A lit cube and a flexible camera, small, to be rendered by SCFPF into a multilayer EXR."""
    from engine_pictures import write_multilayer

    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.light_add(type="SUN", rotation=(0.4, 0.3, 0))
    bpy.context.object.data.energy = 3
    scene = bpy.context.scene
    scene.render.engine = "SCFPF"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 36, 100
    bpy.ops.scfpf.camera_add()
    bpy.context.object.scfpf.samples = 2
    write_multilayer(scene, tmp_path / "out")
    return scene
