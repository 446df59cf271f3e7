# SPDX-License-Identifier: GPL-3.0-or-later
"""The operations of each supported shader node: a function for each type of node."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...projection.typing import Array
from ...shading.nodes.colors import BLENDS
from ...shading.nodes.graph import Ref
from ...shading.nodes.light_path import OUTPUTS
from ...shading.nodes.numbers import MATH, VECTOR_MATH, VECTOR_VALUE
from ...shading.nodes.sky_model import Air
from .graph_reader import NodeInputs, Outputs

# Entries of a colour ramp's and of a curve's table.
RAMP_ENTRIES, CURVE_ENTRIES = 256, 1025

# Sky types that are shown as Preetham's, and their brightness in Cycles relative to his.
DAYLIGHTS = {"PREETHAM": 1.0, "HOSEK_WILKIE": 0.165}


def _rgb(inputs: NodeInputs) -> Outputs:
    return {"Color": inputs.builder.constant(*inputs.node.outputs[0].default_value[:3])}


def _value(inputs: NodeInputs) -> Outputs:
    return {"Value": inputs.builder.constant(inputs.node.outputs[0].default_value)}


def _light_falloff(inputs: NodeInputs) -> Outputs:
    """Quadratic without Smooth is light's own falloff; it stands in for the other outputs."""
    if not inputs.builder.is_always(inputs.value("Smooth"), 0.0) or inputs.linked_outputs() - {"Quadratic"}:
        inputs.note()
    return {one.identifier: inputs.value("Strength") for one in inputs.node.outputs}


def _light_path(inputs: NodeInputs) -> Outputs:
    linked = inputs.linked_outputs()
    if "Ray Length" in linked:
        inputs.note(": Ray Length")
    # The others are 0: the engine has no volumes and no portals.
    return {
        name: inputs.builder.one("LIGHT_PATH", row=OUTPUTS[name])
        if name in OUTPUTS
        else inputs.builder.constant(0.0)
        for name in linked
    }


def _matrix_from(obj) -> Array:
    return np.linalg.pinv(np.array(obj.matrix_world, np.float64))


def _texture_coordinates(inputs: NodeInputs) -> Outputs:
    builder, obj = inputs.builder, inputs.node.object
    linked = inputs.linked_outputs()
    for name in linked & {"Normal", "Camera", "Window"}:
        inputs.note(f": {name}")
    if linked & {"Generated", "UV"}:
        _note_instancer(inputs)
    found = {"Normal": builder.normal(), "Reflection": builder.one("REFLECTION")}
    if linked & {"Generated", "Camera", "Window"}:
        generated = builder.layer("GENERATED", 3)[0]
        found.update(Generated=generated, Camera=generated, Window=generated)
    if "UV" in linked:
        found["UV"] = builder.layer("UV:", 2)[0]
    if "Object" in linked:
        found["Object"] = (
            builder.layer("OBJECT", 3)[0]
            if obj is None
            else builder.one("POSITION", matrix=_matrix_from(obj))
        )
    return found


def _note_instancer(inputs: NodeInputs) -> None:
    if inputs.node.from_instancer:
        inputs.note(": From Instancer")


def _uv_map(inputs: NodeInputs) -> Outputs:
    _note_instancer(inputs)
    return {"UV": inputs.builder.layer(f"UV:{inputs.node.uv_map}", 2)[0]}


def _color_attribute(inputs: NodeInputs) -> Outputs:
    color, _, alpha, _ = inputs.builder.layer(f"COLOR:{inputs.node.layer_name}", 4)
    return {"Color": color, "Alpha": alpha}


def _attribute(inputs: NodeInputs) -> Outputs:
    node = inputs.node
    if node.attribute_type != "GEOMETRY":
        inputs.note(f" of {node.attribute_type.title()}s")
        grey = inputs.builder.constant(0.5, 0.5, 0.5)
        return {"Color": grey, "Vector": grey, "Fac": inputs.builder.constant(0.5)}
    color, number, alpha, _ = inputs.builder.layer(f"ATTRIBUTE:{node.attribute_name}", 4)
    return {"Color": color, "Vector": color, "Fac": number, "Alpha": alpha}


def _geometry(inputs: NodeInputs) -> Outputs:
    builder = inputs.builder
    for one in inputs.node.outputs:
        if one.is_linked and one.identifier in {"Tangent", "Parametric", "Pointiness", "Random Per Island"}:
            inputs.note(f": {one.name}")
    normal, flat, view, back = builder.add("GEOMETRY", outputs=4)
    half = builder.constant(0.5)
    return {
        "Position": builder.one("POSITION"),
        "Normal": normal,
        "Tangent": normal,
        "True Normal": flat,
        "Incoming": view,
        "Backfacing": back,
        "Parametric": builder.constant(0.5, 0.5, 0.5),
        "Pointiness": half,
        "Random Per Island": half,
    }


def _mapping(inputs: NodeInputs) -> Outputs:
    location = "Location" if inputs.node.vector_type in {"POINT", "TEXTURE"} else None
    location_ref = inputs.vector(location) if location else inputs.builder.constant(0.0, 0.0, 0.0)
    refs = inputs.vector("Vector"), location_ref, inputs.vector("Rotation"), inputs.vector("Scale")
    return {"Vector": inputs.builder.one("MAPPING", *refs, kind=inputs.node.vector_type)}


def _math(inputs: NodeInputs) -> Outputs:
    node = inputs.node
    if node.operation not in MATH:
        inputs.note(f": {node.operation}")
        return {"Value": inputs.value(0)}
    refs = [inputs.value(number) for number in range(3)]
    return {"Value": inputs.builder.one("MATH", *refs, operation=node.operation, clamp=node.use_clamp)}


def _vector_math(inputs: NodeInputs) -> Outputs:
    operation = inputs.node.operation
    if operation not in VECTOR_MATH and operation not in VECTOR_VALUE:
        inputs.note(f": {operation}")
        return {"Vector": inputs.vector(0), "Value": inputs.builder.constant(0.5)}
    refs = [inputs.vector(number) for number in range(3)]
    vector, value = inputs.builder.add(
        "VECTOR_MATH", *refs, inputs.value("Scale"), outputs=2, operation=operation
    )
    return {"Vector": vector, "Value": value}


def _mix(inputs: NodeInputs) -> Outputs:
    node, kind = inputs.node, inputs.node.data_type
    clamp_result, blend = False, "MIX"
    factor = inputs.value("Factor_Float")
    if kind == "FLOAT":
        refs, name = (inputs.value("A_Float"), inputs.value("B_Float")), "Result_Float"
    elif kind == "RGBA":
        refs, name = (inputs.color("A_Color"), inputs.color("B_Color")), "Result_Color"
        clamp_result, blend = node.clamp_result, node.blend_type
    else:
        refs, name = (inputs.vector("A_Vector"), inputs.vector("B_Vector")), "Result_Vector"
        if kind == "VECTOR" and node.factor_mode == "NON_UNIFORM":
            factor = inputs.vector("Factor_Vector")
        if kind == "ROTATION":
            inputs.note(": Rotation")
            return {"Result_Rotation": inputs.builder.constant(0.0, 0.0, 0.0)}
    return {name: _mixed(inputs, (factor, *refs), blend, node.clamp_factor, clamp_result)}


def _mixed(inputs: NodeInputs, refs: tuple, blend: str, clamp_factor: bool, clamp_result: bool) -> Ref:
    if blend not in BLENDS:
        inputs.note(f": {blend}")
        blend = "MIX"
    return inputs.builder.one("MIX", *refs, blend=blend, clamp_factor=clamp_factor, clamp_result=clamp_result)


def _mix_rgb(inputs: NodeInputs) -> Outputs:
    refs = inputs.value("Fac"), inputs.color("Color1"), inputs.color("Color2")
    return {"Color": _mixed(inputs, refs, inputs.node.blend_type, True, inputs.node.use_clamp)}


def _ramp(inputs: NodeInputs) -> Outputs:
    ramp = inputs.node.color_ramp
    table = np.array([ramp.evaluate(i / (RAMP_ENTRIES - 1)) for i in range(RAMP_ENTRIES)], np.float64)
    smooth = ramp.interpolation != "CONSTANT" or ramp.color_mode != "RGB"
    refs = inputs.builder.add("TABLE", inputs.value("Fac"), outputs=2, table=table, smooth=smooth)
    return {"Color": refs[0], "Alpha": refs[1]}


def _curve_table(mapping, count: int) -> tuple[Array, float, float]:
    """Values of ``count`` curves, (CURVE_ENTRIES, count), and the ends of their domain."""
    mapping.initialize()
    curves = list(mapping.curves)
    low = min(curve.points[0].location[0] for curve in curves)
    high = max(curve.points[-1].location[0] for curve in curves)
    positions = np.linspace(low, high, CURVE_ENTRIES)
    columns = [[mapping.evaluate(curve, x) for x in positions] for curve in curves[:count]]
    if len(curves) == 4:
        # The fourth curve is applied first, to all channels.
        common = [mapping.evaluate(curves[3], x) for x in positions]
        columns = [[mapping.evaluate(curve, x) for x in common] for curve in curves[:3]]
    return np.array(columns, np.float64).T, low, high


def _curves(count: int, factor: str, name: str) -> Callable[[NodeInputs], Outputs]:
    def read(inputs: NodeInputs) -> Outputs:
        mapping = inputs.node.mapping
        table, low, high = _curve_table(mapping, count)
        fed = inputs.value(name) if count == 1 else inputs.color(name)
        ref = inputs.builder.one(
            "CURVES",
            inputs.value(factor),
            fed,
            table=table,
            low=low,
            high=max(high, low + 1e-6),
            extend=mapping.extend == "EXTRAPOLATED",
        )
        return {name: ref}

    return read


def _normal_map(inputs: NodeInputs) -> Outputs:
    node = inputs.node
    space = {"WORLD": "WORLD", "TANGENT": "TANGENT"}.get(node.space)
    if space is None:
        inputs.note(f" in {node.space.replace('_', ' ').title()} space")
        return {"Normal": inputs.builder.normal()}
    layer = f"TANGENT:{node.uv_map}"
    color = inputs.color("Color")
    if getattr(node, "convention", "OPENGL") == "DIRECTX":
        one, flip = inputs.builder.constant(0.0, 1.0, 0.0), inputs.builder.constant(1.0, -1.0, 1.0)
        flipped = inputs.builder.one("MULTIPLY", color, flip)
        color = inputs.builder.one("VECTOR_MATH", flipped, one, one, one, operation="ADD")
    ref = inputs.builder.one("NORMAL_MAP", inputs.value("Strength"), color, space=space, layer=layer)
    return {"Normal": ref}


def _bump(inputs: NodeInputs) -> Outputs:
    height = inputs.apart("Height")
    if height is None:
        return {"Normal": inputs.normal()}
    graph, output = height
    sign = -1.0 if inputs.node.invert else 1.0
    refs = inputs.value("Strength"), inputs.value("Distance"), inputs.normal()
    return {"Normal": inputs.builder.one("BUMP", *refs, height=graph, output=output, sign=sign)}


INTERPOLATIONS = {"Closest": "Closest", "Linear": "Linear", "Cubic": "Cubic", "Smart": "Cubic"}


def _image(inputs: NodeInputs) -> Outputs:
    node = inputs.node
    projection = node.projection
    if projection == "BOX":
        inputs.note(": Box projection")
        projection = "FLAT"
    refs = inputs.builder.add(
        "IMAGE",
        inputs.coordinates("UV:"),
        outputs=2,
        image=_image_name(node),
        projection=projection,
        interpolation=INTERPOLATIONS[node.interpolation],
        extension=node.extension,
        straight="Alpha" in inputs.linked_outputs(),
    )
    return {"Color": refs[0], "Alpha": refs[1]}


def _image_name(node) -> str:
    return "" if node.image is None else node.image.name_full


def _environment(inputs: NodeInputs) -> Outputs:
    node = inputs.node
    color = inputs.builder.one(
        "ENVIRONMENT",
        inputs.coordinates("GENERATED"),
        image=_image_name(node),
        projection=node.projection,
        interpolation=INTERPOLATIONS[node.interpolation],
    )
    return {"Color": color}


def _sky(inputs: NodeInputs) -> Outputs:
    node = inputs.node
    kind = node.sky_type
    if kind in DAYLIGHTS:
        return _daylight(inputs, DAYLIGHTS[kind])
    dust = node.aerosol_density if hasattr(node, "aerosol_density") else node.dust_density
    again = kind == "MULTIPLE_SCATTERING"
    if again:
        inputs.note(": Multiple Scattering, about as bright")
    color = inputs.builder.one(
        "SKY",
        inputs.coordinates("GENERATED"),
        air=Air(
            elevation=node.sun_elevation,
            altitude=node.altitude,
            air=node.air_density,
            dust=dust,
            ozone=node.ozone_density,
            multiscatter=again,
        ),
        rotation=float(node.sun_rotation),
        size=node.sun_size if node.sun_disc else 0.0,
        intensity=node.sun_intensity,
        scale=1.0,
    )
    return {"Color": color}


def _daylight(inputs: NodeInputs, scale: float) -> Outputs:
    """Preetham's sky, without a sun disc. The length of the sun's direction has no effect, as in Cycles."""
    node = inputs.node
    if node.sky_type != "PREETHAM":
        inputs.note(f": {node.sky_type.replace('_', ' ').title()}, as Preetham")
    color = inputs.builder.one(
        "DAYLIGHT",
        inputs.coordinates("GENERATED"),
        sun=tuple(node.sun_direction.normalized()),
        turbidity=node.turbidity,
        scale=scale,
    )
    return {"Color": color}


def _noise(inputs: NodeInputs) -> Outputs:
    node = inputs.node
    if node.noise_type != "FBM" or node.noise_dimensions not in {"2D", "3D"}:
        inputs.note(f": {node.noise_type.replace('_', ' ').title()} in {node.noise_dimensions}")
    names = ("Scale", "Detail", "Roughness", "Lacunarity", "Distortion")
    refs = inputs.builder.add(
        "NOISE",
        inputs.coordinates("GENERATED"),
        *(inputs.value(name) for name in names),
        outputs=2,
        dimensions=2 if node.noise_dimensions == "2D" else 3,
        normalise=node.normalize,
        colored="Color" in inputs.linked_outputs(),
    )
    return {"Fac": refs[0], "Color": refs[1]}


def _clamp(inputs: NodeInputs) -> Outputs:
    refs = [inputs.value(name) for name in ("Value", "Min", "Max")]
    return {"Result": inputs.builder.one("CLAMP", *refs, range=inputs.node.clamp_type == "RANGE")}


def _map_range(inputs: NodeInputs) -> Outputs:
    node = inputs.node
    if node.data_type == "FLOAT":
        names = ("Value", "From Min", "From Max", "To Min", "To Max", "Steps")
        refs, result = [inputs.value(name) for name in names], "Result"
    else:
        names = ("From_Min", "From_Max", "To_Min", "To_Max", "Steps")
        refs = [inputs.vector("Vector"), *(inputs.vector(f"{name}_FLOAT3") for name in names)]
        result = "Vector"
    return {result: inputs.builder.one("MAP_RANGE", *refs, kind=node.interpolation_type, clamp=node.clamp)}


# Readers of an input by the first character of its name in ``_simple``; the others are numbers.
PREFIXES = {
    "#": NodeInputs.color,
    ">": NodeInputs.vector,
    "^": NodeInputs.normal,
    "@": NodeInputs.coordinates,
}


def _simple(kind: str, results: str, /, *names: str, **settings: str) -> Callable[[NodeInputs], Outputs]:
    """Reader of a node that is one operation.

    results: the outputs. names: the inputs, with '#' before colours, '>' vectors and '^' normals; after '@'
    the layer of a texture's coordinates. settings: the node's property for each setting of the operation.
    """
    outputs = results.split()

    def read(inputs: NodeInputs) -> Outputs:
        refs = [
            PREFIXES[name[0]](inputs, name[1:]) if name[0] in PREFIXES else inputs.value(name)
            for name in names
        ]
        given = {name: getattr(inputs.node, source) for name, source in settings.items()}
        return dict(zip(outputs, inputs.builder.add(kind, *refs, outputs=len(outputs), **given), strict=True))

    return read


NODES: dict[str, Callable[[NodeInputs], Outputs]] = {
    "ATTRIBUTE": _attribute,
    "BLACKBODY": _simple("BLACKBODY", "Color", "Temperature"),
    "BRIGHTCONTRAST": _simple("BRIGHT_CONTRAST", "Color", "#Color", "Bright", "Contrast"),
    "BUMP": _bump,
    "CLAMP": _clamp,
    "COMBINE_COLOR": _simple("COMBINE_COLOR", "Color", "Red", "Green", "Blue", mode="mode"),
    "COMBXYZ": _simple("COMBINE", "Vector", "X", "Y", "Z"),
    "CURVE_FLOAT": _curves(1, "Factor", "Value"),
    "CURVE_RGB": _curves(3, "Fac", "Color"),
    "CURVE_VEC": _curves(3, "Fac", "Vector"),
    "FRESNEL": _simple("FRESNEL", "Fac", "IOR", "^Normal"),
    "GAMMA": _simple("GAMMA", "Color", "#Color", "Gamma"),
    "HUE_SAT": _simple("HUE_SATURATION", "Color", "Hue", "Saturation", "Value", "Fac", "#Color"),
    "INVERT": _simple("INVERT", "Color", "Fac", "#Color"),
    "LAYER_WEIGHT": _simple("LAYER_WEIGHT", "Fresnel Facing", "Blend", "^Normal"),
    "LIGHT_FALLOFF": _light_falloff,
    "LIGHT_PATH": _light_path,
    "MAPPING": _mapping,
    "MAP_RANGE": _map_range,
    "MATH": _math,
    "MIX": _mix,
    "MIX_RGB": _mix_rgb,
    "NEW_GEOMETRY": _geometry,
    "NORMAL_MAP": _normal_map,
    "RGB": _rgb,
    "RGBTOBW": _simple("GREY", "Val", "#Color"),
    "SEPARATE_COLOR": _simple("SEPARATE_COLOR", "Red Green Blue", "#Color", mode="mode"),
    "SEPXYZ": _simple("SEPARATE", "X Y Z", ">Vector"),
    "TEX_CHECKER": _simple("CHECKER", "Color Fac", "@GENERATED", "#Color1", "#Color2", "Scale"),
    "TEX_ENVIRONMENT": _environment,
    "TEX_COORD": _texture_coordinates,
    "TEX_GRADIENT": _simple("GRADIENT", "Color Fac", "@GENERATED", kind="gradient_type"),
    "TEX_IMAGE": _image,
    "TEX_NOISE": _noise,
    "TEX_SKY": _sky,
    "UVMAP": _uv_map,
    "VALTORGB": _ramp,
    "VALUE": _value,
    "VECT_MATH": _vector_math,
    "VERTEX_COLOR": _color_attribute,
}
