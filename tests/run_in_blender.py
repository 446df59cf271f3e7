# SPDX-License-Identifier: GPL-3.0-or-later
"""The test suite inside a Blender that you already have.

    blender -b --python tests/run_in_blender.py
    blender -b --python tests/run_in_blender.py -- tests/blender -k preset

The exit code is 0 when all passed; the last line counts. Each part of the suite runs in a Blender process of
its own (why: devtools/testing.py), with a fresh profile.
"""

import pathlib
import sys

import bpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))

from devtools import environments, own_blender


def main(arguments):
    """Called by the user: prepare, then start the parts. Called by itself: run pytest."""
    if arguments[:1] == [own_blender.INNER]:
        # At the end of the path, so that Blender's own packages (NumPy above all) come first.
        sys.path.append(arguments[1])
        import pytest

        return int(pytest.main(arguments[2:]))

    title = f"Blender {bpy.app.version_string}, Python {sys.version.split()[0]}"
    try:
        return own_blender.run_inside(bpy.app.binary_path, title, arguments)
    except environments.Failure as failure:
        sys.stdout.flush()
        return str(failure)


sys.exit(main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []))
