# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that run a script in another process that has bpy."""

import sys

import bpy


def interpreter():
    """The program that runs a Python script with bpy: Python itself, or this Blender."""
    if bpy.app.binary_path:
        return [
            bpy.app.binary_path,
            "--background",
            "--factory-startup",
            "--python-exit-code",
            "1",
            "--python",
        ]
    return [sys.executable]


def after():
    """Return the arguments that separate Blender's arguments from the script's."""
    return ["--"] if bpy.app.binary_path else []
