# SPDX-License-Identifier: GPL-3.0-or-later
"""The surface of a shader node tree as a ``MaterialGraph``.

Unsupported shaders do not vanish: each becomes a diffuse one of its colour and is noted once.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...shading.materials.lobes import DIELECTRIC_ROUGHNESS, METAL_ROUGHNESS
from ...shading.nodes.graph import Closure, MaterialGraph, Ref
from ..blender.shader_nodes import is_fed, output_node, resolve
from .graph_builder import GraphBuilder
from .graph_nodes import NODES
from .graph_reader import GraphReader, NodeInputs

# Closures that stand in for unsupported shaders; DIFFUSE for all others.
STAND_INS = {"BSDF_METALLIC": "GLOSSY", "BSDF_RAY_PORTAL": "TRANSPARENT", "HOLDOUT": "TRANSPARENT"}
# Unsupported inputs of supported shaders, and the value at which each has no effect.
UNSHOWN = {
    "BSDF_PRINCIPLED": {
        "Anisotropic": 0.0,
        "Coat Weight": 0.0,
        "Diffuse Roughness": 0.0,
        "Sheen Weight": 0.0,
        "Specular Tint": 1.0,
        "Subsurface Weight": 0.0,
        "Thin Film Thickness": 0.0,
        "Thin Wall": 0.0,
    },
    "BSDF_DIFFUSE": {"Roughness": 0.0},
    "BSDF_GLASS": {"Roughness": 0.0, "Thin Film Thickness": 0.0},
    "BSDF_GLOSSY": {"Anisotropy": 0.0},
    "BSDF_REFRACTION": {"Roughness": 0.0},
}
# The colour of a shader without one.
LIGHT_GREY = 0.8
# Shaders of volumes: as a surface they are black.
VOLUMES = {"PRINCIPLED_VOLUME", "VOLUME_ABSORPTION", "VOLUME_COEFFICIENTS", "VOLUME_SCATTER"}


@dataclass(frozen=True)
class GraphReading:
    """The surface of a material.

    graph: None for a black surface, or none. plain: whether it is one opaque closure of constants, of which
    rays follow no reflection. notes: on parts that are not shown as they are. volume_only: whether there
    is a volume and no surface, so that no ray meets the material's faces; as in Cycles a surface whose glow
    is always black does not count.
    """

    graph: MaterialGraph | None
    plain: bool
    notes: tuple[str, ...]
    volume_only: bool = False


def read_graph(tree) -> GraphReading:
    """Read the surface of a shader node tree."""
    output = output_node(tree)
    if output is None:
        return GraphReading(None, False, ())
    reader = SurfaceReader(NODES)
    surface = output.inputs["Surface"]
    reader.add_closures(surface, (), reader.builder.constant(1.0))
    builder = reader.builder
    if not builder.closures:
        volume = output.inputs.get("Volume")
        volume_only = volume is not None and is_fed(volume) and not reader.has_volume
        return GraphReading(None, False, tuple(builder.notes), volume_only)
    reflects = any(_reflects(builder, closure) for closure in builder.closures)
    plain = not reflects and len(builder.closures) == 1 and _is_plain(builder, builder.closures[0])
    return GraphReading(builder.graph(reflects), plain, tuple(builder.notes))


def _is_plain(builder: GraphBuilder, closure: Closure) -> bool:
    """Return whether a closure is opaque, of constants, with the surface's own normal and the weight 1."""
    constant = all(builder.value(ref) is not None for name, ref in closure.inputs.items() if name != "normal")
    opaque = closure.kind != "TRANSPARENT"
    if closure.kind == "PRINCIPLED":
        opaque = builder.is_always(closure.inputs["alpha"], 1.0)
    has_own_normal = closure.inputs["normal"] != builder.normal()
    return constant and opaque and not has_own_normal and builder.is_always(closure.weight, 1.0)


def _reflects(builder: GraphBuilder, closure: Closure) -> bool:
    """Return whether a closure may reflect or refract projectors, which then leave the volume."""
    if closure.kind in {"GLASS", "REFRACTION"}:
        return True
    if closure.kind not in {"GLOSSY", "PRINCIPLED"}:
        return False
    if closure.kind == "PRINCIPLED":
        if not builder.is_always(closure.inputs["transmission"], 0.0):
            return True
        matte = builder.is_always(closure.inputs["metallic"], 0.0) and any(
            builder.is_always(closure.inputs[name], value)
            for name, value in (("specular_level", 0), ("ior", 1))
        )
        if matte:
            return False
    diffuse = closure.kind == "PRINCIPLED" and builder.is_always(closure.inputs["metallic"], 0.0)
    roughness = builder.value(closure.inputs["roughness"])
    return (
        roughness is None or float(roughness[0]) < (DIELECTRIC_ROUGHNESS if diffuse else METAL_ROUGHNESS)[1]
    )


class SurfaceReader(GraphReader):
    """Reads the shaders of one node tree, as closures of ``builder``.

    has_volume: whether a shader of a volume is among them.
    """

    has_volume = False

    def add_closures(self, socket, groups: tuple, weight: Ref) -> None:
        """Add the closures behind a shader socket, with the share ``weight``."""
        if not is_fed(socket, groups) or self.builder.is_always(weight, 0.0):
            return
        source, around = resolve(socket, groups)
        if source.type != "SHADER":
            # A color or number in a shader's place glows.
            light = self.value(socket, groups, "RGBA")
            self._add(Closure("EMISSION", weight, {"color": light, "normal": self.builder.normal()}))
            return
        node, groups = source.node, around
        inputs = NodeInputs(self, node, groups)
        if node.type in VOLUMES:
            self.has_volume = True
        elif node.type == "MIX_SHADER":
            first, second = (each for each in node.inputs if each.type == "SHADER")
            shares = self.builder.add("REST", inputs.value("Fac"), outputs=2)
            self.add_closures(first, groups, self.builder.product(weight, shares[0]))
            self.add_closures(second, groups, self.builder.product(weight, shares[1]))
        elif node.type == "ADD_SHADER":
            for each in node.inputs:
                self.add_closures(each, groups, weight)
        else:
            self._closure(node, inputs, weight)

    def _closure(self, node, inputs: NodeInputs, weight: Ref) -> None:
        kind = CLOSURE_KINDS.get(node.type)
        if kind is None:
            kind = STAND_INS.get(node.type, "DIFFUSE")
            self.note(node)
        for name, nothing in UNSHOWN.get(node.type, {}).items():
            if name in node.inputs and not self.builder.is_always(inputs.color(name), nothing):
                self.note(node, f": {name}")
        closure = Closure(kind, weight, CLOSURE_INPUTS[kind](inputs))
        self._note_clear(node, closure)
        self._add(closure)

    def _add(self, closure: Closure) -> None:
        """Add a closure; one that glows in black is left out, as in Cycles."""
        if closure.kind != "EMISSION" or not self.builder.is_always(closure.inputs["color"], 0.0):
            self.builder.closures.append(closure)

    def _note_clear(self, node, closure: Closure) -> None:
        """Note the opaque shadow of a transparent surface, and rough transmission."""
        always, given = self.builder.is_always, closure.inputs
        if closure.kind == "TRANSPARENT":
            self.note(node, ", whose shadow is opaque")
        elif closure.kind == "PRINCIPLED":
            if not always(given["alpha"], 1.0):
                self.note(node, ": Alpha, whose shadow is opaque")
            if not always(given["transmission"], 0.0) and not always(given["roughness"], 0.0):
                self.note(node, ": Roughness of what is behind it")


CLOSURE_KINDS = {
    "BSDF_PRINCIPLED": "PRINCIPLED",
    "BSDF_DIFFUSE": "DIFFUSE",
    "BSDF_GLOSSY": "GLOSSY",
    "EMISSION": "EMISSION",
    "BACKGROUND": "EMISSION",
    "BSDF_TRANSPARENT": "TRANSPARENT",
    "BSDF_GLASS": "GLASS",
    "BSDF_REFRACTION": "REFRACTION",
}


def _principled(inputs: NodeInputs) -> dict[str, Ref]:
    builder = inputs.builder
    strength = builder.convert(inputs.value("Emission Strength"), "VALUE", "RGBA")
    return {
        "base_color": inputs.color("Base Color"),
        "metallic": inputs.value("Metallic"),
        "roughness": inputs.value("Roughness"),
        "ior": inputs.value("IOR"),
        "specular_level": inputs.value("Specular IOR Level"),
        "alpha": inputs.value("Alpha"),
        "transmission": inputs.value("Transmission Weight"),
        "emission": builder.one("MULTIPLY", inputs.color("Emission Color"), strength),
        "normal": inputs.normal(),
        "multiscatter": _multiscatter(inputs),
    }


def _multiscatter(inputs: NodeInputs) -> Ref:
    """1 with multiscatter between microfacets, 0 without."""
    distribution = inputs.node.distribution
    if distribution in {"BECKMANN", "ASHIKHMIN_SHIRLEY"}:
        inputs.note(f": {distribution.replace('_', '-').title()}")
    return inputs.builder.constant(float(distribution == "MULTI_GGX"))


def _colored(inputs: NodeInputs) -> dict[str, Ref]:
    """A diffuse or transparent surface of the node's colour."""
    name = next((one.identifier for one in inputs.node.inputs if one.type == "RGBA"), None)
    light = inputs.builder.constant(*(LIGHT_GREY,) * 3)
    if name is None and inputs.node.type in {"HOLDOUT", "BSDF_RAY_PORTAL"}:
        light = inputs.builder.constant(1.0, 1.0, 1.0)
    return {"color": light if name is None else inputs.color(name), "normal": inputs.normal()}


def _rough(inputs: NodeInputs) -> dict[str, Ref]:
    return {**_colored(inputs), "roughness": inputs.value("Roughness")}


def _glossy(inputs: NodeInputs) -> dict[str, Ref]:
    one = inputs.builder.constant(1.0)
    known = inputs.node.type == "BSDF_GLOSSY"
    return {**_rough(inputs), "multiscatter": _multiscatter(inputs) if known else one}


def _emission(inputs: NodeInputs) -> dict[str, Ref]:
    builder = inputs.builder
    strength = builder.convert(inputs.value("Strength"), "VALUE", "RGBA")
    return {
        "color": builder.one("MULTIPLY", inputs.color("Color"), strength),
        "normal": builder.normal(),
    }


def _refractive(inputs: NodeInputs) -> dict[str, Ref]:
    return {**_rough(inputs), "ior": inputs.value("IOR")}


CLOSURE_INPUTS = {
    "DIFFUSE": _colored,
    "EMISSION": _emission,
    "GLASS": _refractive,
    "GLOSSY": _glossy,
    "PRINCIPLED": _principled,
    "REFRACTION": _refractive,
    "TRANSPARENT": _colored,
}
