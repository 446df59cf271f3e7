# SPDX-License-Identifier: GPL-3.0-or-later
"""Installs the zip of dist/ into a fresh profile, once a session, as Preferences › Install from Disk does."""

import importlib.machinery
import importlib.util
import os
import pathlib
import sys
import tempfile

SCRATCH = tempfile.TemporaryDirectory(prefix="scfpf-tests-", ignore_cleanup_errors=True)
if "bpy" not in sys.modules:  # inside a Blender, tests/run_in_blender.py has done it before Blender started
    os.environ["BLENDER_USER_RESOURCES"] = os.path.join(SCRATCH.name, "profile")
    os.mkdir(os.environ["BLENDER_USER_RESOURCES"])  # Blender passes over a folder that is not there

import bpy
import pytest

from devtools.package import platform_zip

REPOSITORY = "user_default"


class WheelFinder:
    """Finds embreex in the extensions' own site-packages only.

    An artist's Blender has no other; the environment that runs the tests has one, and it would come first.
    """

    def __init__(self, folder):
        self.folder = folder

    def find_spec(self, name, path=None, target=None):
        if name != "embreex":
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, [str(self.folder)])
        if spec is None:
            raise ModuleNotFoundError(f"no {name} in {self.folder}", name=name)
        return spec


@pytest.fixture(scope="session")
def this_zip():
    """The zip for this machine."""
    return platform_zip()


@pytest.fixture(scope="session")
def extensions_folder():
    """The folder in which this profile keeps its extensions."""
    return pathlib.Path(bpy.utils.user_resource("EXTENSIONS"))


@pytest.fixture(scope="session")
def wheel_finder(extensions_folder):
    """The finder of embreex for the add-on."""
    version = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    return WheelFinder(extensions_folder / ".local" / "lib" / version / "site-packages")


@pytest.fixture(scope="session")
def installed(this_zip, extensions_folder, wheel_finder):
    """The module name of the add-on, installed from the zip and enabled."""
    profile = pathlib.Path(os.environ["BLENDER_USER_RESOURCES"])
    assert extensions_folder.is_relative_to(profile)
    assert "embreex" not in sys.modules
    sys.meta_path.insert(0, wheel_finder)
    done = bpy.ops.extensions.package_install_files(
        filepath=str(this_zip), repo=REPOSITORY, enable_on_install=True
    )
    assert done == {"FINISHED"}
    return f"bl_ext.{REPOSITORY}.scfpf"
