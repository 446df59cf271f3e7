# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures 1.8 m high, in coats of five colors, that give pictures a scale."""

from __future__ import annotations

import bpy

from .mesh import MeshBuilder, material

COATS = {
    "Coat red": (0.55, 0.02, 0.015),
    "Coat yellow": (0.75, 0.42, 0.03),
    "Coat white": (0.72, 0.69, 0.62),
    "Coat blue": (0.02, 0.14, 0.34),
    "Coat green": (0.03, 0.20, 0.10),
}


def people() -> dict[str, bpy.types.Mesh]:
    """A mesh a coat, which looks along -Y and stands on the ground."""
    palette = {name: material(name, color, 0.75) for name, color in COATS.items()}
    palette |= {
        "Skin": material("Skin", (0.55, 0.30, 0.19), 0.6),
        "Hair": material("Hair", (0.05, 0.028, 0.018), 0.6),
        "Trousers": material("Trousers", (0.045, 0.045, 0.06), 0.8),
    }
    return {coat: _person(coat).mesh(f"Person {coat}", palette) for coat in COATS}


def _person(coat: str) -> MeshBuilder:
    """A figure 1.8 m high that looks along -Y, with a long coat."""
    builder = MeshBuilder()
    for side in (-1.0, 1.0):
        leg = [(0.0, 0.0), (0.085, 0.02), (0.08, 0.5), (0.10, 0.8), (0.0, 0.82)]
        builder.lathe(leg, 12, "Z", (0.11 * side, 0.0, 0.0), "Trousers")
        builder.ball((0.11 * side, -0.06, 0.05), (0.07, 0.14, 0.05), "Trousers")
        arm = [(0.0, 0.78), (0.06, 0.80), (0.07, 1.1), (0.085, 1.38), (0.0, 1.46)]
        builder.lathe(arm, 12, "Z", (0.29 * side, 0.02, 0.0), coat)
        builder.ball((0.29 * side, 0.0, 0.76), (0.055, 0.06, 0.07), "Skin")
    body = [(0.0, 0.62), (0.30, 0.60), (0.25, 0.95), (0.235, 1.1), (0.27, 1.36), (0.17, 1.47), (0.0, 1.5)]
    builder.lathe(body, 20, "Z", (0.0, 0.0, 0.0), coat)
    builder.lathe([(0.07, 1.44), (0.065, 1.58)], 12, "Z", (0.0, 0.0, 0.0), "Skin")
    builder.ball((0.0, -0.01, 1.66), (0.115, 0.13, 0.15), "Skin")
    builder.ball((0.0, 0.025, 1.70), (0.128, 0.135, 0.14), "Hair")
    return builder
