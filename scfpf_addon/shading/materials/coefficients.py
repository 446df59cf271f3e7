# SPDX-License-Identifier: GPL-3.0-or-later
"""The coefficients that radiance is summed with, made of the constants of materials."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, IndexArray
from ..typing import Single
from .constants import Materials
from .microfacet import (
    FRESNEL_MEAN,
    SCHLICK_MEAN,
    VIEWS,
    AlbedoCurves,
    dielectric_reflectance,
    ior_of,
    mean_albedo,
    multiscatter_share,
    schlick,
)

Numbers = TypeVar("Numbers", bound=NDArray[Any])

# The least roughness: a highlight a degree across. The rounding of float32 changes its middle by less than
# 1 %.
SMALLEST_ROUGHNESS = 0.08
# Multiple scattering is left out below this share of single scattering.
FAINT = 2e-3
# The reflectance of at most FEW materials is tabulated, by cosines a thousandth apart where it is steepest.
REFLECTANCES, FEW = 4096, 64


class ViewTerms(NamedTuple):
    """Factors of N points that depend on the direction to the viewer, (N,) each.

    layer_transmittance: share of diffuse light that the dielectric layer lets through; None for all.
    compensation: multiple over single scattering of white facets; None where it is left out.
    schlick_albedo: share of a uniform environment that facets reflect by Schlick's (1 - cos)⁵; None where
    no metal reflects the environment. metal: F0 and F90 - F0 with multiple scattering, (3, N) each, where
    they have been looked up.
    """

    layer_transmittance: Single | None = None
    compensation: Single | None = None
    schlick_albedo: Single | None = None
    metal: tuple[Single, Single] | None = None


@dataclass(frozen=True)
class MaterialCoefficients:
    """Coefficients of M materials under lamps and a uniform environment, float32.

    ambient: (3, M) radiance without lamps, that of metals apart: emission and the environment's light.
    ambient_below: (3, M) what is added to it, times the layer's transmittance. emission: (3, M) alone.
    diffuse: (3, M) albedo/π. alpha: (M,) GGX's α squared. albedo: of the facets, by the view.
    Of the dielectric layer, (M,): coverage, f0; multiscatter, the share of multiple scattering that leaves
    the surface; specular, the factor of its highlights; ior.
    Of metals, (3, M): metal_f0; metal_grazing, F90 - F0; metal_multiscatter; environment, the radiance that
    they reflect.
    tabulated: whether the reflectance of each material is worth a table. unit: the coefficients without
    emission under an environment of radiance 1, where they are wanted.
    """

    ambient: Single
    ambient_below: Single
    emission: Single
    diffuse: Single
    alpha: Single
    albedo: AlbedoCurves
    coverage: Single
    f0: Single
    multiscatter: Single
    specular: Single
    ior: Single
    metal_f0: Single
    metal_grazing: Single
    metal_multiscatter: Single
    environment: Single
    tabulated: bool
    unit: MaterialCoefficients | None = None

    @classmethod
    def of(
        cls, materials: Materials, environment: Array, per_hit: bool = False, with_unit: bool = False
    ) -> MaterialCoefficients:
        """The coefficients under a uniform environment of radiance ``environment`` (3,).

        per_hit: each row is of one hit; its coefficients must not depend on the number of rows.
        with_unit: see the class.

        Diffuse is Lambert's, scaled by 1 - metallic and by the transmittance of the dielectric layer.
        Highlights are those of GGX facets with α = roughness² (Walter et al. 2007), a dielectric's by
        Fresnel, a metal's by Schlick, with energy compensation for multiple scattering (Kulla, Conty 2017).
        """
        base = np.asarray(materials.base_color, np.float64).reshape(-1, 3).T
        metallic = np.asarray(materials.metallic, np.float64)
        rough = np.maximum(materials.roughness, SMALLEST_ROUGHNESS)
        f0 = np.asarray(materials.specular_f0, np.float64)
        multiple = _or_one(materials.multiscatter)
        white, layer_albedo = mean_albedo(rough)
        compensation = 1.0 / white - 1.0
        multiscatter = multiple * multiscatter_share(f0 + (1.0 - f0) * FRESNEL_MEAN, white)
        reflected = _reflected_by_layer(f0, multiscatter, compensation, layer_albedo)
        metal_grazing = (1.0 - base) * _or_one(materials.grazing)
        ambient, ambient_below = _ambient(materials, base * (1.0 - metallic), reflected)
        emission = np.asarray(materials.emission, np.float64).reshape(-1, 3).T
        world, mirrored = np.reshape(environment, (3, 1)), _or_one(materials.ambient) * np.ones_like(base)
        albedo = AlbedoCurves.of(rough)
        made = cls(
            ambient=_single(emission + ambient * world),
            ambient_below=_single(ambient_below * world),
            emission=_single(emission),
            diffuse=_single(base * (1.0 - metallic) / np.pi),
            alpha=_single(rough**4),
            albedo=albedo,
            coverage=_single(np.where(f0 > 0.0, _or_one(materials.specular_coverage), 0.0)),
            f0=_single(f0),
            multiscatter=_single(multiscatter),
            specular=_single(np.where(f0 > 0.0, (1.0 - metallic) * (1.0 + multiscatter * compensation), 0.0)),
            ior=_single(ior_of(f0)),
            metal_f0=_single(base * metallic),
            metal_grazing=_single(metal_grazing * metallic),
            metal_multiscatter=_single(
                multiple * multiscatter_share(base + metal_grazing * SCHLICK_MEAN, white)
            ),
            environment=_single(mirrored * world),
            tabulated=not per_hit and len(albedo.row) <= FEW,
        )
        if not with_unit:
            return made
        unit = replace(
            made,
            ambient=_single(ambient * np.ones((3, 1))),
            ambient_below=_single(ambient_below),
            emission=np.zeros_like(made.emission),
            environment=_single(mirrored),
        )
        return replace(made, unit=unit)

    @cached_property
    def dielectric(self) -> bool:
        """Return whether any material has the highlights of a dielectric."""
        return bool(self.specular.any())

    @cached_property
    def metal(self) -> bool:
        """Return whether any material has the highlights of a metal."""
        return bool(self.metal_f0.any() or self.metal_grazing.any())

    @property
    def glossy(self) -> bool:
        """Return whether any material has a highlight."""
        return self.dielectric or self.metal

    @cached_property
    def _layered(self) -> bool:
        # The layer of a black surface, too, reflects the environment.
        return self._ambient_layered or bool((self.coverage * self.diffuse).any())

    @cached_property
    def _ambient_layered(self) -> bool:
        return bool(self.ambient_below.any())

    @cached_property
    def _metal_mirrors(self) -> bool:
        return bool((self.environment * (self.metal_f0 + self.metal_grazing)).any())

    @cached_property
    def _metal_multiscatters(self) -> bool:
        if not (self.metal and self.tabulated):
            return self.metal
        compensation = self.albedo.compensation.reshape(-1, VIEWS)[self.albedo.row // VIEWS]
        return bool(self.metal_multiscatter.max() * compensation.max() > FAINT)

    @cached_property
    def _transmittances(self) -> Single:
        """The transmittance of the layers of a few materials, (M · VIEWS,)."""
        curves = self.albedo
        rows = (each.reshape(-1, VIEWS)[curves.row // VIEWS] for each in (curves.compensation, curves.layer))
        reflected = _reflected_by_layer(self.f0[:, None], self.multiscatter[:, None], *rows)
        return (1 - self.coverage[:, None] * reflected).reshape(-1)

    @cached_property
    def _reflectances(self) -> Single:
        """The reflectance of the layers of a few materials, (M · REFLECTANCES,), by the cosine to facets."""
        cosines = _single((np.arange(REFLECTANCES) + 0.5) / REFLECTANCES)
        return (dielectric_reflectance(cosines, self.ior[:, None]) * self.specular[:, None]).reshape(-1)

    def view_terms(self, material: IndexArray, facing: Single) -> ViewTerms:
        """Factors of points under a cosine ``facing`` (N,) to the viewer; material: (N,), or (1,) for all."""
        transmittance = compensation = schlick_albedo = None
        if not (self._layered or self._metal_multiscatters or self._metal_mirrors):
            return ViewTerms()
        column, curves = _column(facing, VIEWS), self.albedo
        row = column + by_material(curves.row, material)
        if self._layered and self.tabulated:
            transmittance = self._transmittances.take(self._entry(column, VIEWS, material))
        elif self._layered:
            reflected = _reflected_by_layer(
                by_material(self.f0, material),
                by_material(self.multiscatter, material),
                curves.compensation.take(row),
                curves.layer.take(row),
            )
            transmittance = 1 - by_material(self.coverage, material) * reflected
        if self._metal_multiscatters or self._metal_mirrors:
            compensation = curves.compensation.take(row)
        if self._metal_mirrors:
            schlick_albedo = curves.schlick.take(row)
        return ViewTerms(transmittance, compensation, schlick_albedo)

    def unlit(self, material: IndexArray, view: ViewTerms) -> Single:
        """Radiance without lamps, (3, N) or (3, 1)."""
        light = by_material(self.ambient, material)
        if view.layer_transmittance is not None and self._ambient_layered:
            light = light + by_material(self.ambient_below, material) * view.layer_transmittance
        if view.schlick_albedo is not None and view.compensation is not None:
            mirrored = by_material(self.metal_f0, material) / (1 + view.compensation)
            mirrored += by_material(self.metal_grazing, material) * view.schlick_albedo
            mirrored *= 1 + by_material(self.metal_multiscatter, material) * view.compensation
            mirrored *= by_material(self.environment, material)
            light = light + mirrored
        return light

    def reflectance(self, material: IndexArray, cosine: Single, view: ViewTerms) -> Single:
        """Reflectance of facets under a cosine (N,) to them, (N,), or (3, N) where there are metals."""
        if self.dielectric:
            if self.tabulated:
                column = _column(cosine, REFLECTANCES)
                layer = self._reflectances.take(self._entry(column, REFLECTANCES, material))
            else:
                layer = dielectric_reflectance(cosine, by_material(self.ior, material))
                layer *= by_material(self.specular, material)
            if not self.metal:
                return layer
        front, grazing = view.metal or metal_terms(self, material, view)
        light: Single = grazing * schlick(cosine)
        light += front
        if self.dielectric:
            light += layer
        return light

    def _entry(self, column: IndexArray, columns: int, material: IndexArray) -> IndexArray:
        """The place of a column (N,) in a flat table (M · columns,)."""
        return column + material * columns if self.alpha.size > 1 else column


def by_material(table: Numbers, material: IndexArray) -> Numbers:
    """The entries (…, N) of a table (…, M) by material, or its one entry (…, 1)."""
    if table.shape[-1] == 1:
        return table
    return cast(Numbers, table.take(material, axis=-1, mode="clip"))


def metal_terms(
    coefficients: MaterialCoefficients, material: IndexArray, view: ViewTerms
) -> tuple[Single, Single]:
    """``ViewTerms.metal``, or (3, 1) where all points are alike."""
    front = by_material(coefficients.metal_f0, material)
    grazing = by_material(coefficients.metal_grazing, material)
    if view.compensation is None:
        return front, grazing
    whole = 1 + by_material(coefficients.metal_multiscatter, material) * view.compensation
    return front * whole, grazing * whole


def _ambient(materials: Materials, below: Array, reflected: Array) -> tuple[Array, Array]:
    """Reflection of a uniform environment of radiance 1 by all but metals: ambient, ambient_below, (3, M).

    below: (3, M) diffuse albedo. reflected: (M,) mean reflectance of the dielectric layer.
    """
    ambient, shown = _or_one(materials.ambient), _or_one(materials.specular_ambient)
    f0, coverage = np.asarray(materials.specular_f0), np.asarray(_or_one(materials.specular_coverage))
    opaque = 1.0 - np.asarray(materials.metallic, np.float64)
    reflects = f0 > 0.0
    # A layer reflects the light that it keeps from the diffuse surface, as far as rays do not follow it.
    covered = reflects & (coverage > 0.0)
    layer = np.where(covered, shown * opaque / np.where(covered, coverage, 1.0), 0.0)
    alone = ambient * below + shown * np.where(reflects, reflected, 0.0) * opaque
    return np.where(covered, layer, alone), np.where(covered, ambient * below - layer, 0.0)


def _reflected_by_layer(
    f0: Numbers, multiscatter: Numbers, compensation: Numbers, layer_albedo: Numbers
) -> Numbers:
    """Share of light that a dielectric layer reflects, (N,), by single and multiple scattering.

    All (N,) or alike, as in ``MaterialCoefficients`` and ``AlbedoCurves``. After Cycles' layers.
    """
    single = f0 / (1 + compensation) + (1 - f0) * layer_albedo
    return cast(Numbers, single * (1 + multiscatter * compensation))


def _column(cosine: Single, columns: int) -> IndexArray:
    """The column of each cosine (N,) in a table from 0 to 1."""
    place = (cosine * np.float32(columns)).astype(np.intp)
    np.maximum(place, 0, out=place)
    return np.minimum(place, columns - 1, out=place)


def _or_one(values: Array | None) -> Array | float:
    return 1.0 if values is None else values


def _single(values: Array) -> Single:
    return values.astype(np.float32)
