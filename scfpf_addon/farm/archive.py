# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip of the extension that a job takes to workers without it. Imports no bpy."""

from __future__ import annotations

import os
import platform
import re
import sys
import zipfile

from ..projection.user_error import UserError

MANIFEST = "blender_manifest.toml"
# Blender's names of systems and machines in the names of zips, by Python's.
SYSTEMS = {"linux": "linux", "darwin": "macos", "win32": "windows"}
MACHINES = {"x86_64": "x64", "amd64": "x64", "arm64": "arm64", "aarch64": "arm64"}


def require_zip(path: str, version: str) -> str:
    """Return the absolute path of a zip of the extension's version. Raises UserError for another file."""
    try:
        with zipfile.ZipFile(path) as archive:
            manifest = archive.read(MANIFEST).decode()
    except (OSError, KeyError, UnicodeDecodeError, zipfile.BadZipFile) as error:
        raise UserError(
            "'{0}' is not the extension's zip: give the one that Blender installs", path
        ) from error
    values = dict(re.findall(r'(?m)^(id|version)\s*=\s*"([^"]*)"', manifest))
    if values.get("id") != "scfpf":
        raise UserError("'{0}' is not the extension's zip: give the one that Blender installs", path)
    if values.get("version") != version:
        raise UserError(
            "The zip is of Flexible Projection {0} and this is {1}: give the zip of this version",
            values.get("version"),
            version,
        )
    return os.path.abspath(path)


def found_zip(folder: str, version: str) -> str:
    """The zip of a version for this system in a folder, "" if it has none."""
    system, machine = SYSTEMS.get(sys.platform), MACHINES.get(platform.machine().lower())
    for ending in (f"-{system}_{machine}", ""):
        path = os.path.join(folder, f"scfpf-{version}{ending}.zip")
        if os.path.isfile(path):
            return path
    return ""
