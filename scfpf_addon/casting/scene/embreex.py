# SPDX-License-Identifier: GPL-3.0-or-later
"""Loading embreex, the ray caster, and the messages where that fails."""

from __future__ import annotations

import re
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import Any

from ...projection.user_error import Message
from ..common.hits import CastError

# The first embreex on Embree 4 whose run() releases the GIL and takes any strides.
EMBREEX_MINIMUM = (4, 4)
REMEDY = "install Flexible Projection again from the zip for this system, which brings embreex {0} or later"

# File names of compiled modules and libraries: Linux, macOS, Windows.
LIBRARY = re.compile(r"\.(so|dylib|pyd|dll)(\.|$)")


def load_embreex() -> tuple[Any, Any]:
    """Return embreex's modules for scenes and meshes.

    Raises CastError if embreex is missing, damaged, too old or cannot be loaded.
    """
    remedy = Message(REMEDY, ".".join(map(str, EMBREEX_MINIMUM)))
    if "embreex" not in sys.modules and (damage := truncated_library("embreex")):
        raise CastError("the ray caster embreex is damaged ({0}): {1}", damage, remedy)
    try:
        from embreex import mesh_construction, rtcore_scene

        found = version("embreex")
    except ModuleNotFoundError as error:
        raise CastError("the ray caster embreex is missing ({0}): {1}", error, remedy) from error
    except ImportError as error:
        raise CastError("the ray caster embreex cannot be loaded ({0}): {1}", error, remedy) from error
    if not found:
        # Blender removes the wheel when the extension is disabled, perhaps during a render.
        raise CastError("the ray caster embreex is missing (it is being removed): {0}", remedy)
    if tuple(int(part) for part in found.split(".")[:2]) < EMBREEX_MINIMUM:
        raise CastError("the ray caster embreex {0} is too old: {1}", found, remedy)
    return rtcore_scene, mesh_construction


@cache
def caster_fault() -> str:
    """Return why embreex cannot be used and what to do, or ''. Cached, because panels ask while they draw."""
    try:
        load_embreex()
    except CastError as error:
        return str(error)
    return ""


def truncated_library(package: str) -> str:
    """Return which compiled file of an installed package is shorter than its RECORD says, or ''.

    An interrupted download or a full disk leaves such files, and loading one ends the whole program.
    Packages without a RECORD and those that are not installed give ''.
    """
    try:
        files = distribution(package).files or []
    except PackageNotFoundError:
        return ""
    for file in files:
        if file.size is None or not LIBRARY.search(file.name):
            continue
        try:
            size = Path(str(file.locate())).stat().st_size
        except OSError as error:
            return f"{file.name}: {error.strerror or error}"
        if size < file.size:
            return f"{file.name} has {size:,} of {file.size:,} bytes"
    return ""
