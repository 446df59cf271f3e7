# SPDX-License-Identifier: GPL-3.0-or-later
"""Building meshes in Embree.

embreex copies a mesh number by number through Python objects, which takes longer than Embree takes to
build its tree. Embree's own C interface, which its library exports, takes whole arrays. embreex does not
expose the scene's handle. Its place in embreex's object is checked, and where the check fails embreex
copies the mesh as usual.
"""

from __future__ import annotations

import ctypes
import sys
from ctypes import c_int, c_size_t, c_uint, c_void_p
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..common.cancellation import raise_if_cancelled
from .embreex import load_embreex

# RTCBufferType, RTCFormat and RTCGeometryType of Embree 4.
INDEX_BUFFER, VERTEX_BUFFER = 0, 1
UINT, FLOAT3 = 0x5000, 0x9003
# By the number of a face's corners.
GEOMETRY = {3: 0, 4: 1}
# Bytes of a float32 or an int32.
NUMBER = 4

# The two triangles of a quad; the second has no area where the quad's last corner is named twice.
HALVES = ((0, 1, 3), (2, 3, 1))

# Result type and argument types of the functions called.
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

# A number that embreex's ``is_committed`` does not have by chance.
MARK = 0x5CF9F1


class SceneObject(ctypes.Structure):
    """The memory of embreex's EmbreeScene, as its declaration (rtcore_scene.pxd) lays it out."""

    _fields_ = (
        ("header", ctypes.c_byte * object.__basicsize__),
        ("handle", c_void_p),
        ("is_committed", c_int),
        ("device", c_void_p),
    )


class EmbreeMesh(NamedTuple):
    """An embreex scene of one mesh, built.

    scene: embreex's; its ``run`` casts rays. kept: an object that must live as long as the scene.
    faces_each: how many of Embree's faces stand for one face of the mesh.
    """

    scene: Any
    kept: Any
    faces_each: int


def build_mesh(vertices: NDArray[Any], faces: NDArray[np.int32]) -> EmbreeMesh:
    """Build an Embree scene of one mesh.

    vertices: (V, 3), of any dtype and order. faces: (F, 3) or, for quads, (F, 4) int32, contiguous; Embree
    may read them in place, so they must not change. embreex has no quads: if it copies, each is two
    triangles, and the numbers of faces found have to be divided. Python's other threads run while Embree
    builds, on all cores. Raises MemoryError, and Cancelled before Embree builds.
    """
    scenes, meshes = load_embreex()
    scene = scenes.EmbreeScene(robust=True)
    library = _library(scenes.__file__)
    handle = _handle(scene) if library else None
    if library is None or handle is None:
        return _copied_by_embreex(scene, meshes, vertices, faces)
    device = library.rtcGetSceneDevice(handle)
    try:
        _attach(library, device, handle, vertices, faces)
        raise_if_cancelled()
        # embreex's own error function would call Python in a thread that has released the GIL.
        library.rtcSetDeviceErrorFunction(device, None, None)
        library.rtcCommitScene(handle)
        if library.rtcGetDeviceError(device):
            raise MemoryError("There is not enough memory to build the scene for casting")
    finally:
        library.rtcReleaseDevice(device)
    scene.is_committed = 1
    return EmbreeMesh(scene, faces, 1)


def _copied_by_embreex(
    scene: Any, meshes: Any, vertices: NDArray[Any], faces: NDArray[np.int32]
) -> EmbreeMesh:
    """Build an Embree scene that has embreex's own copy of the mesh."""
    corners = faces.shape[1]
    halves = faces if corners == 3 else faces[:, HALVES].reshape(-1, 3)
    mesh = meshes.TriangleMesh(scene, vertices.astype(np.float32), halves)
    raise_if_cancelled()
    # Embree builds at embreex's first run, which must happen in one thread.
    nowhere = np.zeros((1, 3), np.float32)
    scene.run(nowhere, nowhere, np.full(1, -1, np.float32))
    return EmbreeMesh(scene, mesh, corners - 2)


def _attach(library: Any, device: Any, handle: int, vertices: NDArray[Any], faces: NDArray[np.int32]) -> None:
    """Attach a mesh to Embree's scene: vertices are copied, faces shared."""
    corners = faces.shape[1]
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
    finally:
        library.rtcReleaseGeometry(geometry)


@cache
def _library(module: str) -> Any:
    """Embree's library as embreex's module file uses it, or None if its functions are not found."""
    # Except on Windows, the module's symbols include those of the libraries it is linked with. On Linux a
    # program's own Embree, as in Debian's Blender, takes precedence: a mixture of two never ends to build.
    places: list[Path | None] = [Path(module)]
    if sys.platform == "linux" and hasattr(ctypes.CDLL(None), "rtcNewScene"):
        places = [None]
    if sys.platform == "win32":
        places = [*Path(module).parents[1].glob("embreex.libs/*embree4*.dll")]
    for place in places:
        try:
            library = ctypes.CDLL(place and str(place))
        except OSError:  # not a library that this process can open
            continue
        if all(hasattr(library, name) for name in FUNCTIONS):
            for name, (result, *arguments) in FUNCTIONS.items():
                function = getattr(library, name)
                function.restype, function.argtypes = result, arguments
            return library
    return None


def _handle(scene: Any) -> int | None:
    """Embree's handle of embreex's scene, or None if the object has another layout."""
    if type(scene).__basicsize__ != ctypes.sizeof(SceneObject):
        return None
    inside = SceneObject.from_address(id(scene))
    scene.is_committed = MARK
    marked = inside.is_committed == MARK
    scene.is_committed = 0
    handle: int | None = inside.handle
    return handle if marked and inside.is_committed == 0 else None
