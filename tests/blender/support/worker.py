# SPDX-License-Identifier: GPL-3.0-or-later
"""A worker's Blender for the tests of render jobs: Blender as a Python module, which has no command line.

    python worker.py [--background …] --python SCRIPT -- ARGUMENTS

It takes the options that jobs give to Blender. Variables of the environment change it: SCFPF_WITHOUT leaves
the extension out; SCFPF_EEVEE names the engine that stands in for EEVEE, whose shaders take minutes without
a GPU.
"""

import os
import pathlib
import runpy
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[3]


def enable(bpy, folder):
    """Enable the checkout as an extension."""
    (folder / "repository").mkdir()
    bpy.context.preferences.extensions.repos.new(
        name="checkout", module="checkout", custom_directory=str(folder / "repository"), remote_url=""
    )
    link = folder / "repository" / "scfpf"
    if os.name == "nt":
        import _winapi

        _winapi.CreateJunction(str(ROOT), str(link))
    else:
        link.symlink_to(ROOT, target_is_directory=True)
    bpy.ops.preferences.addon_enable(module="bl_ext.checkout.scfpf")
    if "SCFPF_EEVEE" in os.environ:
        versions = sys.modules["bl_ext.checkout.scfpf.scfpf_addon.bridge.blender.versions"]
        versions.EEVEE = os.environ["SCFPF_EEVEE"]


def state(bpy, folder):
    """The worker's files but Blender's index of extensions, its add-ons, repositories and paths of Python."""
    files = (str(path) for path in pathlib.Path(folder).rglob("*.*") if ".cache" not in path.parts)
    repositories = (each.module for each in bpy.context.preferences.extensions.repos)
    return {*files, *bpy.context.preferences.addons.keys(), *repositories, *sys.path}


def main():
    words = sys.argv[1:]
    with tempfile.TemporaryDirectory(prefix="scfpf-worker-", ignore_cleanup_errors=True) as folder:
        os.environ["BLENDER_USER_RESOURCES"] = os.path.join(folder, "profile")
        os.mkdir(os.environ["BLENDER_USER_RESOURCES"])
        import bpy

        before = None
        if "SCFPF_WITHOUT" in os.environ:
            before = state(bpy, folder)
        else:
            enable(bpy, pathlib.Path(folder))
        if "--python-expr" in words:
            status = status_of(
                lambda: exec(words[words.index("--python-expr") + 1], {"__name__": "__main__"})
            )
        else:
            script = words[words.index("--python") + 1]
            status = status_of(lambda: runpy.run_path(script, run_name="__main__"))
        if before is not None:
            print("left behind:", sorted(state(bpy, folder) ^ before))
    sys.stdout.flush()
    sys.stderr.flush()
    # Some modules of Blender wait for themselves at their end.
    os._exit(status)


def status_of(run):
    """The exit status of a script."""
    try:
        run()
    except SystemExit as left:
        return int(left.code or 0)
    return 0


main()
