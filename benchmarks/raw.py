# SPDX-License-Identifier: GPL-3.0-or-later
"""Raw Embree: a scene's triangles in embreex, without this project's code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.scene.embree_meshes import build_mesh


def raw_embree(scene: CastScene) -> Callable[..., NDArray[np.int32]]:
    """Return a function that casts rays, (3, N) float32 twice and limits (N,), at a scene's triangles."""
    raw, kept, _ = build_mesh(scene.vertices.T, scene.triangles)

    def cast(origins: NDArray[Any], ways: NDArray[Any], limits: NDArray[Any]) -> NDArray[np.int32]:
        found: NDArray[np.int32] = raw.run(origins.T, ways.T, limits)
        # Embree may read the triangles where they are.
        assert kept is not None
        return found

    return cast
