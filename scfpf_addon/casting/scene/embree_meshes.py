# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles on their way into Embree.

embreex copies a mesh number by number through Python objects, which takes longer than Embree takes to
build its tree. Embree's own C interface, which its library offers to whoever asks, takes arrays as they
are. embreex does not tell the scene's handle; where that stands in its object is found, not assumed, and
where it is not found embreex copies as ever.
"""

from __future__ import annotations

import ctypes
import re
import sys
from ctypes import c_int, c_size_t, c_uint, c_void_p
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.cancellation import raise_if_cancelled

# RTCBufferType, RTCFormat and RTCGeometryType of Embree 4.
INDEX_BUFFER, VERTEX_BUFFER = 0, 1
UINT, FLOAT3 = 0x5000, 0x9003
# By the number of a face's corners.
GEOMETRY = {3: 0, 4: 1}
# Bytes of a float32 or an int32.
NUMBER = 4

# The triangles that Embree takes a quad for: one without area where the last corner is named twice.
HALVES = ((0, 1, 3), (2, 3, 1))

# What is called of Embree: what it returns, what it takes.
FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "rtcGetSceneDevice": (c_void_p, c_void_p),
    "rtcReleaseDevice": (None, c_void_p),
    "rtcNewGeometry": (c_void_p, c_void_p, c_int),
    "rtcSetNewGeometryBuffer": (c_void_p, c_void_p, c_int, c_uint, c_int, c_size_t, c_size_t),
    "rtcSetSharedGeometryBuffer": (
        None,
        *(c_void_p, c_int, c_uint, c_int, c_void_p, c_size_t, c_size_t, c_size_t),
    ),
    "rtcCommitGeometry": (None, c_void_p),
    "rtcAttachGeometry": (c_uint, c_void_p, c_void_p),
    "rtcReleaseGeometry": (None, c_void_p),
    "rtcSetDeviceErrorFunction": (None, c_void_p, c_void_p, c_void_p),
    "rtcCommitScene": (None, c_void_p),
    "rtcGetDeviceError": (c_int, c_void_p),
}

# Names of files with machine code: Linux, macOS, Windows.
LIBRARY = re.compile(r"\.(so|dylib|pyd|dll)(\.|$)")

# A number that embreex's ``is_committed`` does not have by chance.
MARK = 0x5CF9F1


def cut_off_library(package: str) -> str:
    """Which binary file of an installed package is shorter than its RECORD says, and by how much; else ''.

    Loading such a library, as an interrupted download or a full disk leaves it, ends the whole program.
    Nothing is said of a package without a RECORD, nor of one that is not installed.
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


class SceneObject(ctypes.Structure):
    """embreex's EmbreeScene as its own declaration (rtcore_scene.pxd) has it, behind Python's header."""

    _fields_ = (
        ("header", ctypes.c_byte * object.__basicsize__),
        ("handle", c_void_p),
        ("is_committed", c_int),
        ("device", c_void_p),
    )


def mesh_in_embree(
    modules: tuple[Any, Any], vertices: NDArray[Any], faces: NDArray[np.int32]
) -> tuple[Any, Any, int]:
    """A scene of one mesh, built, what has to be kept as long as it, and as how many faces a face counts.

    modules: embreex's for scenes and meshes. vertices: (V, 3), of any kind and order. faces: (F, 3)
    or, for quads, (F, 4) int32, contiguous; they may be Embree's own from now on and must not change.
    embreex knows no quads: where it copies them each is two triangles, so that numbers of faces that
    are found have to be divided. Python's other threads go on while Embree builds, on all cores.
    Raises MemoryError, and ``Cancelled`` before it builds.
    """
    scenes, meshes = modules
    scene = scenes.EmbreeScene(robust=True)
    library = _library(scenes.__file__)
    handle = _handle(scene) if library else None
    corners = faces.shape[1]
    if library is None or handle is None:
        halves = faces if corners == 3 else faces[:, HALVES].reshape(-1, 3)
        mesh = meshes.TriangleMesh(scene, vertices.astype(np.float32), halves)
        raise_if_cancelled()
        # Embree builds at embreex's first run, which must happen in one thread.
        nowhere = np.zeros((1, 3), np.float32)
        scene.run(nowhere, nowhere, np.full(1, -1, np.float32))
        return scene, mesh, corners - 2
    device = library.rtcGetSceneDevice(handle)
    geometry = library.rtcNewGeometry(device, GEOMETRY[corners])
    try:
        place = library.rtcSetNewGeometryBuffer(geometry, VERTEX_BUFFER, 0, FLOAT3, 3 * NUMBER, len(vertices))
        if not place:
            raise MemoryError(f"There is not enough memory for {len(vertices):,} vertices")
        own = np.frombuffer((ctypes.c_float * (3 * len(vertices))).from_address(place), np.float32)
        own.reshape(-1, 3)[:] = vertices
        library.rtcSetSharedGeometryBuffer(
            geometry, INDEX_BUFFER, 0, UINT + corners, faces.ctypes.data, 0, corners * NUMBER, len(faces)
        )
        library.rtcCommitGeometry(geometry)
        library.rtcAttachGeometry(handle, geometry)
        raise_if_cancelled()
        # embreex's function would speak Python, in a thread that has let go of it.
        library.rtcSetDeviceErrorFunction(device, None, None)
        library.rtcCommitScene(handle)
        if library.rtcGetDeviceError(device):
            raise MemoryError("There is not enough memory to build the scene for casting")
    finally:
        library.rtcReleaseGeometry(geometry)
        library.rtcReleaseDevice(device)
    scene.is_committed = 1
    return scene, faces, 1


@cache
def _library(module: str) -> Any:
    """Embree's library as embreex's module file uses it, None where its functions are not found."""
    # Elsewhere than on Windows a module is asked for what it was linked with, too. On Linux that is not used
    # where the program has brought an Embree, as Debian's Blender does; a mixture of two never ends to build.
    places: list[Path | None] = [Path(module)]
    if sys.platform == "linux" and hasattr(ctypes.CDLL(None), "rtcNewScene"):
        places = [None]
    if sys.platform == "win32":
        places = [*Path(module).parents[1].glob("embreex.libs/*embree4*.dll")]
    for place in places:
        try:
            library = ctypes.CDLL(place and str(place))
        except OSError:  # no library that this process can open: embreex copies
            continue
        if all(hasattr(library, name) for name in FUNCTIONS):
            for name, (result, *arguments) in FUNCTIONS.items():
                function = getattr(library, name)
                function.restype, function.argtypes = result, arguments
            return library
    return None


def _handle(scene: Any) -> int | None:
    """Embree's handle of embreex's scene, None where the object is another than it was."""
    if type(scene).__basicsize__ != ctypes.sizeof(SceneObject):
        return None
    inside = SceneObject.from_address(id(scene))
    scene.is_committed = MARK
    marked = inside.is_committed == MARK
    scene.is_committed = 0
    handle: int | None = inside.handle
    return handle if marked and inside.is_committed == 0 else None
