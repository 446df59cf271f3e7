# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads the checkout, or installs its zip, as an extension, once a session, in a fresh profile."""

import importlib
import os
import pathlib
import sys
import tempfile
from types import SimpleNamespace

# Of a Python that has bpy as a module; inside a Blender, tests/run_in_blender.py has loaded it before.
IS_MODULE = "bpy" not in sys.modules
SCRATCH = tempfile.TemporaryDirectory(prefix="scfpf-tests-", ignore_cleanup_errors=True)
if IS_MODULE:  # inside a Blender, tests/run_in_blender.py has done it before Blender started
    os.environ["BLENDER_USER_RESOURCES"] = os.path.join(SCRATCH.name, "profile")
    os.mkdir(os.environ["BLENDER_USER_RESOURCES"])  # Blender passes over a folder that is not there
# Processes that tests start compile the extension once, not each for itself.
if os.environ.pop("PYTHONDONTWRITEBYTECODE", None):
    os.environ["PYTHONPYCACHEPREFIX"] = os.path.join(SCRATCH.name, "compiled")

# For the modules in support/, which several tests share.
sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "support"))

import bpy
import pytest

from devtools.package import platform_zip
from devtools.testing import INSTALL_ZIP

ROOT = pathlib.Path(__file__).resolve().parents[2]
MODULE = "bl_ext.checkout.scfpf"


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    """Leave without Blender's own end: after some runs of this length 4.5's module waits for itself there.

    (A static object's destructor, after the module was not freed; reports are written by now.)
    """
    if IS_MODULE and hasattr(config, "scfpf_exit_status"):
        SCRATCH.cleanup()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(config.scfpf_exit_status)


def pytest_sessionfinish(session, exitstatus):
    session.config.scfpf_exit_status = int(exitstatus)


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
    bpy.context.preferences.extensions.repos.new(
        name="checkout", module="checkout", custom_directory=str(folder), remote_url=""
    )
    if os.environ.get(INSTALL_ZIP):
        install = {"repo": "checkout", "filepath": str(platform_zip()), "enable_on_install": True}
        assert bpy.ops.extensions.package_install_files(**install) == {"FINISHED"}
        assert (folder / "scfpf" / "blender_manifest.toml").is_file()
    else:
        link_folder(folder / "scfpf", ROOT)
        assert bpy.ops.preferences.addon_enable(module=MODULE) == {"FINISHED"}
    # Of a scene's empty space: the least grid that pays in large images takes longer than a test's picture.
    importlib.import_module(f"{MODULE}.scfpf_addon.casting.scene.occupancy").CELLS = 1 << 15
    yield importlib.import_module(MODULE)
    bpy.ops.preferences.addon_disable(module=MODULE)


@pytest.fixture
def addon():
    """Import a module by its path in the extension: addon("panels.menus"), addon("casting.cast")."""

    def imported(name):
        is_interface = name.startswith(("operators.", "panels."))
        return importlib.import_module(f"{MODULE}.{name}" if is_interface else f"{MODULE}.scfpf_addon.{name}")

    return imported


@pytest.fixture(autouse=True)
def empty_file(extension):
    """Every test starts from a file with one empty scene: in half the time from the second on."""
    path = os.path.join(SCRATCH.name, "empty.blend")
    if os.path.exists(path):
        bpy.ops.wm.read_homefile(filepath=path)
        return
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)


@pytest.fixture
def read(addon):
    """Read the scene as the viewport has it."""
    module = addon("bridge.scene.read_scene")
    return lambda: module.read_scene(bpy.context.evaluated_depsgraph_get())


@pytest.fixture
def read_render(addon):
    """Read the scene as F12 has it."""
    scene, depsgraph = (
        addon("bridge.scene.read_scene"),
        addon("bridge.scene.render_depsgraph"),
    )
    return lambda: depsgraph.with_render_depsgraph(
        bpy.context.scene, bpy.context.view_layer, scene.read_scene
    )


@pytest.fixture
def built_groups(empty_file, addon):
    """The preview's node groups are in the file from the second test on: building them takes seconds.

    As in a file that was saved with a preview. What is not there is built as ever.
    """
    path = os.path.join(SCRATCH.name, "groups.blend")
    kept = set()
    if os.path.exists(path):
        bpy.ops.wm.read_homefile(filepath=path)
        kept = {group.name for group in bpy.data.node_groups}
        for group in bpy.data.node_groups:
            group.use_fake_user = False
    yield
    nodes = addon("scanline.nodes.geometry_nodes")
    # Neither those of an older version nor their successors under other names; none if the test removed some.
    made = {
        group
        for group in bpy.data.node_groups
        if group.name.startswith("SCFPF")
        and not group.name[-3:].isdigit()
        and not group.library
        and group.get(nodes.BUILD_KEY, nodes.BUILD) == nodes.BUILD
    }
    if {group.name for group in made} > kept:
        keep_file_of(made, path)


def keep_file_of(groups, path):
    """Write an empty file with some node groups: opening it takes a tenth of appending them."""
    alone = f"{path}.alone"
    bpy.data.libraries.write(alone, groups)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(alone) as (there, here):
        here.node_groups = list(there.node_groups)
    for group in bpy.data.node_groups:
        group.use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)


@pytest.fixture
def kept_street(monkeypatch):
    """The demo's street is built once a session: that takes ten times as long as opening it again."""
    from demo import render_demo
    from demo.compositions import joiner, squares
    from demo.recipes import scenes

    path, build = os.path.join(SCRATCH.name, "street.blend"), render_demo.build_street

    def build_street():
        if os.path.exists(path):
            bpy.ops.wm.read_homefile(filepath=path)
            return bpy.context.scene
        scene = build()
        bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
        return scene

    for module in (render_demo, joiner, squares, scenes):
        monkeypatch.setattr(module, "build_street", build_street)


@pytest.fixture
def light_nodes(addon, monkeypatch):
    """Nodes that pass the collection on: what is about datablocks need not invert volumes."""

    def group():
        found = bpy.data.node_groups.get("Passes On")
        if found is not None:
            return found
        tree = bpy.data.node_groups.new("Passes On", "GeometryNodeTree")
        for name, kind in (
            ("Collection", "Collection"),
            ("Table", "Object"),
            ("Aspect", "Float"),
            ("Picture Width", "Float"),
            ("Pixel Error", "Float"),
        ):
            tree.interface.new_socket(name, in_out="INPUT", socket_type=f"NodeSocket{kind}")
        tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        given, info, real, end = (
            tree.nodes.new(kind)
            for kind in (
                "NodeGroupInput",
                "GeometryNodeCollectionInfo",
                "GeometryNodeRealizeInstances",
                "NodeGroupOutput",
            )
        )
        tree.links.new(given.outputs["Collection"], info.inputs["Collection"])
        tree.links.new(info.outputs[0], real.inputs[0])
        tree.links.new(real.outputs[0], end.inputs[0])
        return tree

    def table(camera, scene=None):
        name = f"{camera.name} Table"
        found = bpy.data.objects.get(name)
        return found or bpy.data.objects.new(name, bpy.data.meshes.new(name))

    data = addon("scanline.preview.preview_data")
    nodes = SimpleNamespace(preview_group=group, is_flat=lambda _table: False)
    monkeypatch.setattr(data, "remap_nodes", nodes)
    monkeypatch.setattr(addon("scanline.table.table_object"), "table_object", table)


@pytest.fixture
def engine_scene(tmp_path):
    """A lit cube and a flexible camera, small, to be rendered by SCFPF into a multilayer EXR."""
    from engine_images import write_multilayer

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


@pytest.fixture
def bridge(addon):
    """The module that makes cameras flexible."""
    return addon("bridge.camera.flexible_camera")


@pytest.fixture
def reading(addon):
    """The module that reads projections."""
    return addon("bridge.camera.read_projection")
