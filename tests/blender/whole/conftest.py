# SPDX-License-Identifier: GPL-3.0-or-later
"""The demo's street is built once a session: ten times as long as opening it again."""

import os
import tempfile

import bpy
import pytest

from demo import render_demo
from demo.compositions import joiner, squares
from demo.recipes import scenes

BUILD = render_demo.build_street


@pytest.fixture(scope="session")
def kept_street():
    """A function as ``build_street``."""
    with tempfile.TemporaryDirectory(prefix="scfpf-street-") as folder:
        path = os.path.join(folder, "street.blend")

        def build_street():
            if os.path.exists(path):
                bpy.ops.wm.read_homefile(filepath=path)
                return bpy.context.scene
            scene = BUILD()
            bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
            return scene

        yield build_street


@pytest.fixture(autouse=True)
def one_street(monkeypatch, kept_street):
    for module in (render_demo, joiner, squares, scenes):
        monkeypatch.setattr(module, "build_street", kept_street)
