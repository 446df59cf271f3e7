# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours by supported shader nodes: by name, a function of a tree that gives an output socket.

Each glows on a sheet of ``shown_materials.wavy_sheet``; vectors are spread over where the nodes do something.
"""

import os
from functools import partial

import bpy
import numpy as np
from shown_materials import EDGES, add

CASES = {}
COLORS = ("BYTE_COLOR POINT", "BYTE_COLOR CORNER", "FLOAT_COLOR POINT", "FLOAT_COLOR CORNER")
ATTRIBUTES = ("Height", "Face", "FLOAT_COLOR POINT", "none")
RANGES = ("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP")
# What is infinite somewhere: pixels there differ by more.
STEEP = {"Math TANGENT", "Vector TANGENT", "Vector DIVIDE", "Mix DIVIDE", "Math DIVIDE", "Math POWER"}


def items(kind, name):
    """The choices of a node's setting."""
    return [item.identifier for item in getattr(bpy.types, kind).bl_rna.properties[name].enum_items]


def spread(tree, low=-1.5, high=2.5):
    """A vector that grows over the sheet, and its x and y."""
    uv = add(tree, "ShaderNodeUVMap", {"uv_map": "First"}).outputs[0]
    size = (high - low,) * 3
    wide = add(
        tree, "ShaderNodeVectorMath", {"operation": "MULTIPLY_ADD"}, _0=uv, _1=size, _2=(low, low, 0.7)
    )
    parts = add(tree, "ShaderNodeSeparateXYZ", _0=wide.outputs[0])
    return wide.outputs[0], parts.outputs[0], parts.outputs[1]


def half(tree, vector):
    """Unit vectors as colours."""
    return add(
        tree, "ShaderNodeVectorMath", {"operation": "MULTIPLY_ADD"}, _0=vector, _1=(0.5,) * 3, _2=(0.5,) * 3
    ).outputs[0]


def case(name):
    """Note a function under a name."""

    def note(function):
        CASES[name] = function
        return function

    return note


def each(name, values):
    """Note a function once for each value, which it takes second."""

    def note(function):
        for value in values:
            CASES[f"{name} {value}"] = partial(function, value=value)
        return function

    return note


@each("Coordinates", ("Generated", "UV", "Object", "Reflection"))
def _coordinates(tree, value):
    return add(tree, "ShaderNodeTexCoord").outputs[value]


@case("Coordinates of another object")
def _other(tree):
    return add(tree, "ShaderNodeTexCoord", {"object": bpy.context.scene.camera}).outputs["Object"]


@each("UV Map", ("First", "Second"))
def _uv_map(tree, value):
    return add(tree, "ShaderNodeUVMap", {"uv_map": value}).outputs[0]


@each("Geometry", ("Position", "Normal", "True Normal", "Incoming", "Backfacing"))
def _geometry(tree, value):
    return add(tree, "ShaderNodeNewGeometry").outputs[value]


@each(
    "Colours",
    [f"{kind} {domain}" for kind in ("BYTE_COLOR", "FLOAT_COLOR") for domain in ("POINT", "CORNER")],
)
def _colors(tree, value):
    node = add(tree, "ShaderNodeVertexColor", {"layer_name": value})
    return add(
        tree, "ShaderNodeMix", {"data_type": "RGBA"}, _0=node.outputs[1], _6=(0, 0, 1), _7=node.outputs[0]
    ).outputs[2]


@each(
    "Attribute",
    [(name, output) for name in ("Height", "Face", "FLOAT_COLOR POINT", "none") for output in range(4)],
)
def _attribute(tree, value):
    name, output = value
    return add(tree, "ShaderNodeAttribute", {"attribute_name": name}).outputs[output]


@each("Attribute of edges", [kind for kind, _, _ in EDGES])
def _of_edges(tree, value):
    return add(tree, "ShaderNodeAttribute", {"attribute_name": f"{value} EDGE"}).outputs[1]


def new_image(data=False, float_buffer=False, alpha=False):
    """A small packed image of random colours."""
    image = bpy.data.images.new("Noise", 8, 6, alpha=alpha, float_buffer=float_buffer)
    image.colorspace_settings.name = "Non-Color" if data else "Linear Rec.709" if float_buffer else "sRGB"
    pixels = np.random.default_rng(1).random((6, 8, 4)).astype(np.float32)
    pixels[..., 3] = pixels[..., 3] * 0.8 + 0.2 if alpha else 1
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    image.pack()
    return image


def image_node(tree, image, vector=None, **settings):
    turned = add(
        tree,
        "ShaderNodeMapping",
        _0=add(tree, "ShaderNodeUVMap", {"uv_map": "First"}).outputs[0],
        _1=(-0.4, 0.3, 0.1),
        _2=(0.1, 0.2, 0.5),
        _3=(2.3, 2.3, 2.3),
    )
    return add(tree, "ShaderNodeTexImage", {"image": image, **settings}, _0=vector or turned.outputs[0])


@each(
    "Image",
    [
        (extension, interpolation)
        for extension in ("REPEAT", "EXTEND", "CLIP", "MIRROR")
        for interpolation in ("Linear", "Closest", "Cubic")
    ],
)
def _extension(tree, value):
    extension, interpolation = value
    return image_node(tree, new_image(), extension=extension, interpolation=interpolation).outputs[0]


@each("Image of", ("data", "floats", "colours"))
def _space(tree, value):
    return image_node(tree, new_image(data=value == "data", float_buffer=value == "floats")).outputs[0]


@each("Image from a file", ("png", "exr"))
def _file(tree, value):
    image = new_image(float_buffer=value == "exr", alpha=True)
    image.filepath_raw = os.path.join(bpy.app.tempdir, f"image.{value}")
    image.file_format = {"png": "PNG", "exr": "OPEN_EXR"}[value]
    image.save()
    return image_node(tree, bpy.data.images.load(image.filepath_raw)).outputs[0]


@case("Image with alpha, unused")
def _alpha_unused(tree):
    return image_node(tree, new_image(alpha=True)).outputs[0]


@case("Image with alpha, used")
def _alpha_used(tree):
    node = image_node(tree, new_image(alpha=True))
    return add(
        tree, "ShaderNodeMix", {"data_type": "RGBA"}, _0=node.outputs[1], _6=(0, 0, 1), _7=node.outputs[0]
    ).outputs[2]


@each("Image on a", ("SPHERE", "TUBE"))
def _projected(tree, value):
    vector = add(tree, "ShaderNodeTexCoord").outputs["Generated"]
    return image_node(tree, new_image(), vector, projection=value).outputs[0]


@case("Image without a link")
def _unlinked(tree):
    return add(tree, "ShaderNodeTexImage", {"image": new_image()}).outputs[0]


@case("No image")
def _no_image(tree):
    return add(tree, "ShaderNodeTexImage").outputs[0]


@case("Missing image")
def _missing_image(tree):
    image = bpy.data.images.new("Missing", 4, 4)
    image.source, image.filepath = "FILE", "//missing.png"
    return add(tree, "ShaderNodeTexImage", {"image": image}).outputs[0]


@each("Math", items("ShaderNodeMath", "operation"))
def _math(tree, value):
    _, x, y = spread(tree)
    return add(tree, "ShaderNodeMath", {"operation": value}, _0=x, _1=y, _2=0.4).outputs[0]


@case("Math clamped")
def _math_clamped(tree):
    _, x, y = spread(tree)
    return add(tree, "ShaderNodeMath", {"use_clamp": True}, _0=x, _1=y).outputs[0]


@each("Vector", items("ShaderNodeVectorMath", "operation"))
def _vector_math(tree, value):
    vector, x, y = spread(tree)
    other = add(tree, "ShaderNodeCombineXYZ", _0=y, _1=x, _2=0.3).outputs[0]
    node = add(
        tree, "ShaderNodeVectorMath", {"operation": value}, _0=vector, _1=other, _2=(0.2, 0.5, 0.3), _3=0.7
    )
    return node.outputs[value in {"DOT_PRODUCT", "DISTANCE", "LENGTH"}]


@each("Mix", items("ShaderNodeMix", "blend_type"))
def _mix(tree, value):
    vector, x, y = spread(tree, -0.3, 1.4)
    other = add(tree, "ShaderNodeCombineXYZ", _0=y, _1=0.3, _2=x).outputs[0]
    settings = {"data_type": "RGBA", "blend_type": value}
    return add(tree, "ShaderNodeMix", settings, _0=0.7, _6=vector, _7=other).outputs[2]


@case("Mix clamped")
def _mix_clamped(tree):
    vector, x, _ = spread(tree)
    settings = {"data_type": "RGBA", "blend_type": "ADD", "clamp_result": True}
    return add(tree, "ShaderNodeMix", settings, _0=x, _6=vector, _7=(0.1, 0.7, 0.2)).outputs[2]


@case("Mix of numbers")
def _mix_float(tree):
    _, x, y = spread(tree)
    return add(tree, "ShaderNodeMix", {"data_type": "FLOAT"}, _0=x, _2=y, _3=0.9).outputs[0]


@case("Mix of vectors")
def _mix_vector(tree):
    vector = spread(tree)[0]
    settings = {"data_type": "VECTOR", "factor_mode": "NON_UNIFORM"}
    return add(tree, "ShaderNodeMix", settings, _1=vector, _4=(0.1, 0.5, 0.9), _5=(0.9, 0.3, 0.2)).outputs[1]


@each("Ramp", ("LINEAR", "EASE", "CONSTANT", "B_SPLINE", "HSV"))
def _ramp(tree, value):
    node = add(tree, "ShaderNodeValToRGB", _0=spread(tree, -0.2, 1.2)[1])
    ramp = node.color_ramp
    if value == "HSV":
        ramp.color_mode = value
    else:
        ramp.interpolation = value
    ramp.elements.new(0.4).color = (1, 0.2, 0.1, 1)
    return node.outputs[0]


@each("Curves", ("RGB", "Float", "Vector"))
def _curves(tree, value):
    vector, x, _ = spread(tree, -1.2, 1.2)
    node = add(tree, f"ShaderNode{value}Curve", _0=0.8, _1=x if value == "Float" else vector)
    node.mapping.curves[0].points.new(0.4, 0.8)
    if value == "RGB":
        node.mapping.curves[3].points.new(0.5, 0.3)
    node.mapping.update()
    return node.outputs[0]


@each("Separate", ("RGB", "HSV", "HSL"))
def _separate(tree, value):
    parts = add(tree, "ShaderNodeSeparateColor", {"mode": value}, _0=spread(tree, 0, 1)[0]).outputs
    return add(tree, "ShaderNodeCombineXYZ", _0=parts[0], _1=parts[1], _2=parts[2]).outputs[0]


@each("Combine", ("RGB", "HSV", "HSL"))
def _combine(tree, value):
    _, x, y = spread(tree, 0, 1)
    return add(tree, "ShaderNodeCombineColor", {"mode": value}, _0=x, _1=y, _2=0.6).outputs[0]


@each(
    "Map Range",
    [
        (kind, clamp)
        for kind in ("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP")
        for clamp in (False, True)
    ],
)
def _map_range(tree, value):
    kind, clamp = value
    settings = {"interpolation_type": kind, "clamp": clamp}
    return add(
        tree, "ShaderNodeMapRange", settings, _0=spread(tree)[1], _1=-0.3, _2=0.8, _3=0.1, _4=0.9
    ).outputs[0]


@case("Map Range of vectors")
def _map_range_vector(tree):
    return add(tree, "ShaderNodeMapRange", {"data_type": "FLOAT_VECTOR"}, _6=spread(tree)[0]).outputs[1]


@each("Clamp", ("MINMAX", "RANGE"))
def _clamp(tree, value):
    return add(tree, "ShaderNodeClamp", {"clamp_type": value}, _0=spread(tree)[1], _1=0.8, _2=0.2).outputs[0]


@each("Mapping", ("POINT", "TEXTURE", "VECTOR", "NORMAL"))
def _mapping(tree, value):
    turn, scale = (0.3, 0.5, 1.1), (1.2, 0.7, 2.0)
    node = add(tree, "ShaderNodeMapping", _0=spread(tree)[0], _1=(0.1, 0.2, 0.3), _2=turn, _3=scale)
    node.vector_type = value
    return node.outputs[0]


@case("Invert")
def _invert(tree):
    return add(tree, "ShaderNodeInvert", _0=0.8, _1=spread(tree, 0, 1)[0]).outputs[0]


@case("Gamma")
def _gamma(tree):
    return add(tree, "ShaderNodeGamma", _0=spread(tree, -0.2, 1)[0], _1=1.7).outputs[0]


@case("Brightness")
def _brightness(tree):
    return add(tree, "ShaderNodeBrightContrast", _0=spread(tree, 0, 1)[0], _1=0.2, _2=0.5).outputs[0]


@case("Hue")
def _hue(tree):
    color = spread(tree, 0, 1)[0]
    return add(tree, "ShaderNodeHueSaturation", _0=0.3, _1=1.4, _2=0.8, _3=0.9, _4=color).outputs[0]


@case("Grey")
def _grey(tree):
    return add(tree, "ShaderNodeRGBToBW", _0=spread(tree, 0, 1)[0]).outputs[0]


@each("Converted", ("colour", "vector"))
def _converted(tree, value):
    color = add(tree, "ShaderNodeVertexColor", {"layer_name": "FLOAT_COLOR POINT"}).outputs[0]
    source = color if value == "colour" else spread(tree)[0]
    return add(tree, "ShaderNodeMath", _0=source, _1=0.0).outputs[0]


@each("Checker", ("Generated", "UV"))
def _checker(tree, value):
    links = {} if value == "Generated" else {"_0": spread(tree)[0]}
    colors = {"_1": (1, 0.2, 0.1), "_2": (0.1, 0.4, 0.9)}
    return add(tree, "ShaderNodeTexChecker", **links, **colors, _3=4.3).outputs[0]


NOISES = [("Fac", {}), ("Color", {}), ("Fac", {"normalize": False}), ("Color", {"noise_dimensions": "2D"})]


@each("Noise", NOISES)
def _noise(tree, value):
    output, settings = value
    inputs = {"Scale": 3.0, "Detail": 2.4, "Roughness": 0.6, "Lacunarity": 2.2, "Distortion": 0.5}
    return add(tree, "ShaderNodeTexNoise", settings, _0=spread(tree)[0], **inputs).outputs[output]


@case("Noise without a link")
def _plain_noise(tree):
    return add(tree, "ShaderNodeTexNoise").outputs["Color"]


@each("Gradient", items("ShaderNodeTexGradient", "gradient_type"))
def _gradient(tree, value):
    return add(tree, "ShaderNodeTexGradient", {"gradient_type": value}, _0=spread(tree, -1, 1)[0]).outputs[0]


@each("Layer Weight", [(output, blend) for output in (0, 1) for blend in (0.3, 0.5, 0.8)])
def _layer_weight(tree, value):
    output, blend = value
    return add(tree, "ShaderNodeLayerWeight", _0=blend).outputs[output]


@case("Fresnel")
def _fresnel(tree):
    return add(tree, "ShaderNodeFresnel", _0=1.7).outputs[0]


@each("Normal Map", [(space, strength) for space in ("TANGENT", "WORLD") for strength in (0.6, 1.0, 1.5)])
def _normal_map(tree, value):
    space, strength = value
    settings = {"space": space, "uv_map": "First"}
    return half(tree, add(tree, "ShaderNodeNormalMap", settings, _0=strength, _1=(0.7, 0.4, 0.85)).outputs[0])
