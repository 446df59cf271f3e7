# SPDX-License-Identifier: GPL-3.0-or-later
"""A material's nodes → ``MaterialGraph``: links followed, groups expanded, types converted.

What is not supported does not vanish: a node passes an input of its kind through, as if it were muted,
or gives middle grey; a shader becomes a diffuse one of its colour. Each is noted once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...shading.materials.lobes import COAT_ROUGHNESS, METAL_ROUGHNESS
from ...shading.nodes.graph import Closure, MaterialGraph, Ref
from ..blender.shader_nodes import resolve
from .graph_builder import GraphBuilder
from .graph_nodes import NODES

# Shaders that stand in for others, with the note on what is lost.
STAND_INS = {
    "BSDF_TRANSLUCENT": "DIFFUSE",
    "SUBSURFACE_SCATTERING": "DIFFUSE",
    "BSDF_SHEEN": "DIFFUSE",
    "BSDF_TOON": "DIFFUSE",
    "BSDF_HAIR": "DIFFUSE",
    "BSDF_HAIR_PRINCIPLED": "DIFFUSE",
    "BSDF_METALLIC": "GLOSSY",
    "BSDF_RAY_PORTAL": "TRANSPARENT",
    "HOLDOUT": "TRANSPARENT",
    "EEVEE_SPECULAR": "DIFFUSE",
}
# Inputs of shaders that are not shown, and the value at which they do nothing.
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
# What an unsupported colour or number is.
GREY = 0.5
# What a shader without a colour is.
LIGHT_GREY = 0.8


@dataclass(frozen=True)
class GraphReading:
    """graph: None where the material has no surface shader. plain: whether it is an opaque surface of
    constants, which needs no graph. notes: what is not shown as it is.
    """

    graph: MaterialGraph | None
    plain: bool
    notes: tuple[str, ...]


def read_graph(tree) -> GraphReading:
    """The surface of a shader node tree."""
    output = tree.get_output_node("CYCLES") or tree.get_output_node("EEVEE")
    if output is None:
        return GraphReading(None, False, ())
    reader = GraphReader()
    reader.shader(output.inputs["Surface"], (), reader.builder.constant(1.0))
    builder = reader.builder
    if not builder.closures:
        return GraphReading(None, False, tuple(builder.notes))
    reflects = any(_reflects(builder, closure) for closure in builder.closures)
    plain = len(builder.closures) == 1 and not reflects and _is_plain(builder, builder.closures[0])
    return GraphReading(builder.graph(reflects), plain, tuple(builder.notes))


def _is_plain(builder: GraphBuilder, closure: Closure) -> bool:
    constant = all(builder.value(ref) is not None for name, ref in closure.inputs.items() if name != "normal")
    see_through = closure.kind == "TRANSPARENT"
    if closure.kind == "PRINCIPLED":
        see_through = not builder.is_always(closure.inputs["alpha"], 1.0)
    own_normal = closure.inputs["normal"] != builder.normal()
    return constant and not see_through and not own_normal and builder.is_always(closure.weight, 1.0)


def _reflects(builder: GraphBuilder, closure: Closure) -> bool:
    """Whether a closure may send light on to what the volume does not hold."""
    if closure.kind in {"GLASS", "REFRACTION"}:
        return True
    if closure.kind not in {"GLOSSY", "PRINCIPLED"}:
        return False
    if closure.kind == "PRINCIPLED":
        if not builder.is_always(closure.inputs["transmission"], 0.0):
            return True
        matt = builder.is_always(closure.inputs["metallic"], 0.0) and any(
            builder.is_always(closure.inputs[name], value)
            for name, value in (("specular_level", 0), ("ior", 1))
        )
        if matt:
            return False
    diffuse = closure.kind == "PRINCIPLED" and builder.is_always(closure.inputs["metallic"], 0.0)
    roughness = builder.value(closure.inputs["roughness"])
    return roughness is None or float(roughness[0]) < (COAT_ROUGHNESS if diffuse else METAL_ROUGHNESS)[1]


class GraphReader:
    """Follows the links of one tree. ``builder`` is what comes of it."""

    def __init__(self) -> None:
        self.builder = GraphBuilder()
        self._known: dict[tuple, dict[str, Ref]] = {}

    def note(self, node, text: str = "") -> None:
        """A node is not shown as it is."""
        self.builder.notes[f"{node.bl_label}{text}"] = None

    def shader(self, socket, groups: tuple, weight: Ref) -> None:
        """Add the closures behind a shader socket, with their share ``weight``."""
        socket, groups = resolve(socket, groups)
        if not socket.is_output or self.builder.is_always(weight, 0.0):
            return
        node = socket.node
        inputs = NodeInputs(self, node, groups)
        if node.type == "MIX_SHADER":
            first, second = (each for each in node.inputs if each.type == "SHADER")
            shares = self.builder.add("REST", inputs.value("Fac"), outputs=2)
            self.shader(first, groups, self.builder.product(weight, shares[0]))
            self.shader(second, groups, self.builder.product(weight, shares[1]))
        elif node.type == "ADD_SHADER":
            for each in node.inputs:
                self.shader(each, groups, weight)
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
        self.builder.closures.append(closure)

    def _note_clear(self, node, closure: Closure) -> None:
        """Note the shadow of a surface that is seen through, and glass that is not clear."""
        always, given = self.builder.is_always, closure.inputs
        if closure.kind == "TRANSPARENT":
            self.note(node, ", whose shadow is opaque")
        elif closure.kind == "PRINCIPLED":
            if not always(given["alpha"], 1.0):
                self.note(node, ": Alpha, whose shadow is opaque")
            if not always(given["transmission"], 0.0) and not always(given["roughness"], 0.0):
                self.note(node, ": Roughness of what is behind it")

    def value(self, socket, groups: tuple, wanted: str) -> Ref | None:
        """What feeds an input socket, as a socket of type ``wanted`` has it; None where nothing is linked."""
        source, groups = resolve(socket, groups)
        if source.is_output:
            refs = self._outputs(source.node, groups)
            return self.builder.convert(refs[source.identifier], source.type, wanted)
        if source == socket:
            return None
        # The input of a group.
        return self.default(source, wanted)

    def default(self, socket, wanted: str) -> Ref:
        """A socket's own value."""
        if not hasattr(socket, "default_value"):
            return self.builder.constant(*(0.0,) * (1 if wanted == "VALUE" else 3))
        value = np.array(socket.default_value, np.float64).reshape(-1)[:3]
        return self.builder.convert(self.builder.constant(*value), socket.type, wanted)

    def _outputs(self, node, groups: tuple) -> dict[str, Ref]:
        """All outputs of a node by identifier."""
        # What feeds a node is read before it, by a list of our own: trees may be deeper than Python's stack.
        waiting, opened = [(node, groups)], set()
        while waiting:
            here, around = waiting[-1]
            key = _key(here, around)
            if key in self._known:
                waiting.pop()
            elif key in opened:
                self._known[key] = self._read(here, around)
            else:
                opened.add(key)
                waiting.extend(self._sources(here, around, opened))
        return self._known[_key(node, groups)]

    def _sources(self, node, groups: tuple, opened: set) -> list[tuple]:
        """The nodes that feed a node, and that were not looked at before."""
        places = (resolve(socket, groups) for socket in node.inputs if socket.is_linked)
        return [
            (socket.node, around)
            for socket, around in places
            if socket.is_output and socket.type != "SHADER" and _key(socket.node, around) not in opened
        ]

    def _read(self, node, groups: tuple) -> dict[str, Ref]:
        inputs = NodeInputs(self, node, groups)
        read = NODES.get(node.type)
        found = read(inputs) if read else {}
        for output in node.outputs:
            if output.identifier not in found and output.type != "SHADER":
                found[output.identifier] = self._stand_in(inputs, output, bool(read))
        return found

    def _stand_in(self, inputs: NodeInputs, output, partly: bool) -> Ref:
        """What an output gives that its node's reader does not know; partly: because nothing asks for it."""
        return self.builder.constant(0.0) if partly else inputs.passed(output)


def _key(node, groups: tuple) -> tuple:
    """A node within groups."""
    return (node.as_pointer(), *(group.as_pointer() for group in groups))


class NodeInputs:
    """One node of a tree, as translators see it."""

    def __init__(self, reader: GraphReader, node, groups: tuple) -> None:
        self._reader, self.node, self._groups = reader, node, groups
        self.builder = reader.builder

    def _socket(self, name: str | int):
        if isinstance(name, int):
            return self.node.inputs[name]
        return next((one for one in self.node.inputs if one.identifier == name), None)

    def _read(self, name: str | int, wanted: str) -> Ref:
        socket = self._socket(name)
        found = self._reader.value(socket, self._groups, wanted)
        return self._reader.default(socket, wanted) if found is None else found

    def value(self, name: str | int) -> Ref:
        """A number."""
        return self._read(name, "VALUE")

    def color(self, name: str | int) -> Ref:
        """A colour."""
        return self._read(name, "RGBA")

    def vector(self, name: str | int) -> Ref:
        """A vector that has its own value where nothing is linked."""
        return self._read(name, "VECTOR")

    def coordinates(self, layer: str) -> Ref:
        """The Vector of a texture; a layer where nothing is linked."""
        socket = self._socket("Vector")
        found = None if socket is None else self._reader.value(socket, self._groups, "VECTOR")
        return self.builder.layer(layer, LAYER_CHANNELS[layer.split(":")[0]])[0] if found is None else found

    def normal(self, name: str = "Normal") -> Ref:
        """A normal; the surface's where nothing is linked."""
        socket = self._socket(name)
        found = None if socket is None else self._reader.value(socket, self._groups, "VECTOR")
        # A group's input without a link is 0, which is no direction.
        return self.builder.normal() if found is None or self.builder.is_always(found, 0.0) else found

    def apart(self, name: str) -> tuple[MaterialGraph, Ref] | None:
        """What is linked to a number, as a graph of its own and an output in it; None without a link."""
        reader = GraphReader()
        found = reader.value(self._socket(name), self._groups, "VALUE")
        self.builder.notes.update(reader.builder.notes)
        return None if found is None else reader.builder.apart(found)

    def note(self, text: str = "") -> None:
        """The node is not shown as it is."""
        self._reader.note(self.node, text)

    def passed(self, output) -> Ref:
        """What stands for an output of a node that is not supported: the first linked input of its type."""
        self.note()
        if output.name == "Normal":
            return self.normal()
        for socket in self.node.inputs:
            if socket.type == output.type and socket.is_linked:
                found = self._reader.value(socket, self._groups, output.type)
                if found is not None:
                    return found
        if output.type == "VECTOR":
            return self.builder.layer("GENERATED", 3)[0]
        return self.builder.constant(*(GREY,) * (3 if output.type == "RGBA" else 1))


# Of layers by the beginning of their name.
LAYER_CHANNELS = {"UV": 2, "GENERATED": 3}

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
        "multiple": _multiple(inputs),
    }


def _multiple(inputs: NodeInputs) -> Ref:
    """1 where light that facets send to each other counts, 0 where it is lost."""
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
    return {**_rough(inputs), "multiple": _multiple(inputs) if known else one}


def _emission(inputs: NodeInputs) -> dict[str, Ref]:
    builder = inputs.builder
    strength = builder.convert(inputs.value("Strength"), "VALUE", "RGBA")
    return {
        "color": builder.one("MULTIPLY", inputs.color("Color"), strength),
        "normal": builder.normal(),
    }


def _bending(inputs: NodeInputs) -> dict[str, Ref]:
    return {**_rough(inputs), "ior": inputs.value("IOR")}


CLOSURE_INPUTS = {
    "DIFFUSE": _colored,
    "EMISSION": _emission,
    "GLASS": _bending,
    "GLOSSY": _glossy,
    "PRINCIPLED": _principled,
    "REFRACTION": _bending,
    "TRANSPARENT": _colored,
}
