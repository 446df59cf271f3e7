# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene as shading reads it: triangles, materials, lights and the world, as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ...casting.common.geometry import Geometry
from ...projection.typing import Array, BoolArray
from ..materials.constants import Materials
from ..nodes.image import ImageData
from .world import World

LightKind = Literal["POINT", "SUN", "SPOT", "AREA"]


@dataclass(frozen=True)
class LightPaths:
    """Limits of bounces: in total, glossy, through refraction, and through transparency, which is not in the
    total. One bounce beyond a limit sees only emission and the world. clamp: the most light that a hit adds
    to a pixel sample after a bounce, the mean of its channels; 0 for no limit.
    """

    total: int = 12
    glossy: int = 4
    transmission: int = 12
    transparent: int = 8
    clamp: float = 0.0

    def clamping(self, light: Array, indirect: BoolArray) -> Array:
        """The factors (n,) that limit light (3, n), as Cycles clamps indirect light."""
        mean = light.sum(axis=0) / 3.0
        beyond = indirect & (mean > self.clamp) & (self.clamp > 0.0)
        factors: Array = np.divide(self.clamp, mean, out=np.ones_like(mean), where=beyond)
        return factors


@dataclass(frozen=True)
class Light:
    """One lamp in world space.

    color: (3,) colour times power: watts for POINT, SPOT and AREA, W/m² for SUN.
    matrix: (4, 4), the lamp shines along its local -Z. radius: soft size of POINT
    and SPOT; angle: a SUN's angular diameter, radians. size: (2,) extents of AREA along
    local X and Y; ellipse: AREA is an ellipse; spread: full angle of the beam that leaves each of its points,
    radians. spot_angle: full cone angle, radians; spot_blend in [0, 1]. sphere: POINT and SPOT light as a
    sphere of their radius (no soft falloff), not as a disc that faces what it lights.
    receivers, blockers: whether it lights, and is shadowed by, the objects of each number in
    ``Geometry.linked``; None for all. diffuse, specular: whether it makes diffuse light and highlights.
    """

    kind: LightKind
    color: Array
    matrix: Array
    casts_shadow: bool = True
    radius: float = 0.0
    angle: float = 0.0
    size: tuple[float, float] = (1.0, 1.0)
    ellipse: bool = False
    spread: float = np.pi
    sphere: bool = False
    spot_angle: float = np.pi / 4
    spot_blend: float = 0.15
    receivers: BoolArray | None = None
    blockers: BoolArray | None = None
    diffuse: bool = True
    specular: bool = True

    @property
    def has_extent(self) -> bool:
        """Return whether the lamp is more than a point or a direction."""
        return self.kind == "AREA" or self.radius > 0.0 or self.angle > 0.0


@dataclass(frozen=True)
class Scene:
    """A scene.

    world_color: (3,) radiance of the uniform environment. warnings: a line about each feature that the reader
    left out. object_index, material_index: the number that the user gave
    each object of ``geometry.object_names`` and each of the materials. material_names: of these.
    images: those that materials read, by name, without missing ones. bounces: of light.
    world: the light by direction, whose shadows are cast; None for the uniform environment ``world_color``.
    world_seen: whether projectors see the world, not only mirrors, glass and the surfaces that it lights.
    """

    geometry: Geometry
    materials: Materials
    lights: tuple[Light, ...] = ()
    world_color: Array = field(default_factory=lambda: np.zeros(3))
    warnings: tuple[str, ...] = ()
    object_index: tuple[int, ...] = ()
    material_index: tuple[int, ...] = ()
    material_names: tuple[str, ...] = ()
    images: Mapping[str, ImageData] = field(default_factory=dict)
    bounces: LightPaths = field(default_factory=LightPaths)
    world: World | None = None
    world_seen: bool = True

    @property
    def backdrop(self) -> tuple[Array, World | None]:
        """Radiance (3,) behind the scene as projectors see it, and the world in its place."""
        return (self.world_color, self.world) if self.world_seen else (np.zeros(3), None)
