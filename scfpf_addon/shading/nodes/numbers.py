# SPDX-License-Identifier: GPL-3.0-or-later
"""Operations on numbers and vectors: Math, Vector Math, Mapping, Map Range, Clamp and conversions.

Definitions of Blender's manual (Shader Nodes > Converter). Undefined values are 0.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...projection.colors import LUMINANCE
from ...projection.typing import Array
from ..vectors import dot_row, unit
from .context import ShadingContext
from .graph import Evaluator, Inputs, Settings


def divided(a: Array, b: Array) -> Array:
    """a / b, 0 where b is 0."""
    a, b = np.broadcast_arrays(a, b)
    return np.divide(a, b, out=np.zeros(np.shape(a)), where=b != 0.0)


def power(a: Array, b: Array) -> Array:
    """a to the power of b, 0 where that is not finite."""
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        value = np.power(*np.broadcast_arrays(a, b))
    return np.where(np.isfinite(value), value, 0.0)


def _logarithm(a: Array, base: Array) -> Array:
    good = (a > 0.0) & (base > 0.0)
    return divided(np.log(np.where(good, a, 1.0)), np.log(np.where(good, base, 1.0)))


def _truncated_modulo(a: Array, b: Array) -> Array:
    a, b = np.broadcast_arrays(a, b)
    return np.where(b != 0.0, np.fmod(a, np.where(b != 0.0, b, 1.0)), 0.0)


def _floored_modulo(a: Array, b: Array) -> Array:
    return np.where(b != 0.0, a - np.floor(divided(a, b)) * b, 0.0)


def wrapped(value: Array, high: Array, low: Array) -> Array:
    """value moved by multiples of high - low into the range between the two."""
    size = high - low
    return np.where(size != 0.0, value - size * np.floor(divided(value - low, size)), low)


def _ping_pong(value: Array, scale: Array) -> Array:
    cycle = divided(value - scale, 2.0 * scale)
    return np.where(scale != 0.0, np.abs((cycle - np.floor(cycle)) * scale * 2.0 - scale), 0.0)


def _smooth_minimum(a: Array, b: Array, distance: Array) -> Array:
    """The lesser, rounded over ``distance`` by a cubic (Quilez, Smooth minimum)."""
    near = np.maximum(distance - np.abs(a - b), 0.0)
    rounded = divided(near, distance)
    return np.where(distance != 0.0, np.minimum(a, b) - rounded**3 * distance * (1.0 / 6.0), np.minimum(a, b))


MATH: dict[str, Callable[[Array, Array, Array], Array]] = {
    "ADD": lambda a, b, c: a + b,
    "SUBTRACT": lambda a, b, c: a - b,
    "MULTIPLY": lambda a, b, c: a * b,
    "DIVIDE": lambda a, b, c: divided(a, b),
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "POWER": lambda a, b, c: power(a, b),
    "LOGARITHM": lambda a, b, c: _logarithm(a, b),
    "SQRT": lambda a, b, c: np.sqrt(np.maximum(a, 0.0)),
    "INVERSE_SQRT": lambda a, b, c: divided(np.ones_like(a), np.sqrt(np.maximum(a, 0.0))),
    "ABSOLUTE": lambda a, b, c: np.abs(a),
    "EXPONENT": lambda a, b, c: np.exp(np.minimum(a, 700.0)),
    "MINIMUM": lambda a, b, c: np.minimum(a, b),
    "MAXIMUM": lambda a, b, c: np.maximum(a, b),
    "LESS_THAN": lambda a, b, c: (a < b).astype(np.float64),
    "GREATER_THAN": lambda a, b, c: (a > b).astype(np.float64),
    "SIGN": lambda a, b, c: np.sign(a),
    "COMPARE": lambda a, b, c: (np.abs(a - b) <= np.maximum(c, 1e-5)).astype(np.float64),
    "SMOOTH_MIN": _smooth_minimum,
    "SMOOTH_MAX": lambda a, b, c: -_smooth_minimum(-a, -b, c),
    "ROUND": lambda a, b, c: np.floor(a + 0.5),
    "FLOOR": lambda a, b, c: np.floor(a),
    "CEIL": lambda a, b, c: np.ceil(a),
    "TRUNC": lambda a, b, c: np.trunc(a),
    "FRACT": lambda a, b, c: a - np.floor(a),
    "MODULO": lambda a, b, c: _truncated_modulo(a, b),
    "FLOORED_MODULO": lambda a, b, c: _floored_modulo(a, b),
    "WRAP": wrapped,
    "SNAP": lambda a, b, c: np.floor(divided(a, b)) * b,
    "PINGPONG": lambda a, b, c: _ping_pong(a, b),
    "SINE": lambda a, b, c: np.sin(a),
    "COSINE": lambda a, b, c: np.cos(a),
    "TANGENT": lambda a, b, c: np.tan(a),
    "ARCSINE": lambda a, b, c: np.arcsin(np.clip(a, -1.0, 1.0)),
    "ARCCOSINE": lambda a, b, c: np.arccos(np.clip(a, -1.0, 1.0)),
    "ARCTANGENT": lambda a, b, c: np.arctan(a),
    "ARCTAN2": lambda a, b, c: np.arctan2(a, b),
    "SINH": lambda a, b, c: np.sinh(np.clip(a, -700.0, 700.0)),
    "COSH": lambda a, b, c: np.cosh(np.clip(a, -700.0, 700.0)),
    "TANH": lambda a, b, c: np.tanh(a),
    "RADIANS": lambda a, b, c: np.radians(a),
    "DEGREES": lambda a, b, c: np.degrees(a),
}


def math(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Math node."""
    value = MATH[settings["operation"]](*inputs)
    return (np.clip(value, 0.0, 1.0) if settings["clamp"] else value,)


def _length(a: Array) -> Array:
    return np.sqrt(dot_row(a, a))


def _refract(incident: Array, normal: Array, ratio: Array) -> Array:
    cosine = dot_row(normal, incident)
    under = 1.0 - ratio**2 * (1.0 - cosine**2)
    bent = ratio * incident - (ratio * cosine + np.sqrt(np.maximum(under, 0.0))) * normal
    return np.where(under < 0.0, 0.0, bent)


def _cross(a: Array, b: Array) -> Array:
    product: Array = np.cross(np.broadcast_to(a, np.broadcast_shapes(a.shape, b.shape)), b, axis=0)
    return product


VectorFunction = Callable[[Array, Array, Array, Array], Array]


def _componentwise(function: Callable[[Array, Array, Array], Array]) -> VectorFunction:
    """A function of numbers applied to each component of vectors; the scale has no effect."""
    return lambda a, b, c, s: function(a, b, c)


# Functions of three vectors and a scale that return a vector.
VECTOR_MATH: dict[str, VectorFunction] = {
    "CROSS_PRODUCT": lambda a, b, c, s: _cross(a, b),
    "PROJECT": lambda a, b, c, s: divided(dot_row(a, b), dot_row(b, b)) * b,
    "REFLECT": lambda a, b, c, s: a - 2.0 * unit(b) * dot_row(unit(b), a),
    "REFRACT": lambda a, b, c, s: _refract(a, unit(b), s),
    "FACEFORWARD": lambda a, b, c, s: np.where(dot_row(c, b) < 0.0, a, -a),
    "SCALE": lambda a, b, c, s: a * s,
    "NORMALIZE": lambda a, b, c, s: unit(a),
    "FRACTION": _componentwise(MATH["FRACT"]),
}
VECTOR_MATH |= {
    name: _componentwise(MATH[name])
    for name in (
        *("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "MULTIPLY_ADD", "POWER", "ABSOLUTE", "SIGN"),
        *("MINIMUM", "MAXIMUM", "ROUND", "FLOOR", "CEIL", "MODULO", "WRAP", "SNAP"),
        *("SINE", "COSINE", "TANGENT"),
    )
}
# Functions of two vectors that return a number.
VECTOR_VALUE: dict[str, Callable[[Array, Array], Array]] = {
    "DOT_PRODUCT": dot_row,
    "DISTANCE": lambda a, b: _length(a - b),
    "LENGTH": lambda a, b: _length(a),
}


def vector_math(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Vector Math node: Vector, Value."""
    operation = settings["operation"]
    if operation in VECTOR_VALUE:
        return np.zeros((3, 1)), VECTOR_VALUE[operation](inputs[0], inputs[1])
    return VECTOR_MATH[operation](*inputs), np.zeros((1, 1))


def rotation(angles: Array) -> Array:
    """Matrices (3, 3, n) of Euler angles (3, n) in the order XYZ: about x first."""
    (sx, sy, sz), (cx, cy, cz) = np.sin(angles), np.cos(angles)
    matrix: Array = np.stack(
        [
            np.stack([cy * cz, sx * sy * cz - cx * sz, cx * sy * cz + sx * sz]),
            np.stack([cy * sz, sx * sy * sz + cx * cz, cx * sy * sz - sx * cz]),
            np.stack([-sy, sx * cy, cx * cy]),
        ]
    )
    return matrix


def mapping(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Mapping node: vector, location, rotation, scale."""
    vector, location, angles, scale = inputs
    turn, kind = rotation(angles), settings["kind"]
    if kind == "TEXTURE":
        return (divided(np.einsum("ji...,j...->i...", turn, vector - location), scale),)
    if kind == "NORMAL":
        return (unit(np.einsum("ij...,j...->i...", turn, divided(vector, scale))),)
    turned = np.einsum("ij...,j...->i...", turn, vector * scale)
    return (turned + location if kind == "POINT" else turned,)


def clamp(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Clamp node."""
    value, low, high = inputs
    if settings["range"]:
        low, high = np.minimum(low, high), np.maximum(low, high)
    return (np.minimum(np.maximum(value, low), high),)


def map_range(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Map Range node, of numbers and of vectors: value, from min, from max, to min, to max, steps."""
    value, low, high, to_low, to_high, steps = inputs
    share = divided(value - low, high - low)
    kind = settings["kind"]
    if kind == "STEPPED":
        share = np.where(steps > 0.0, divided(np.floor(share * (steps + 1.0)), steps), 0.0)
    elif kind == "SMOOTHSTEP":
        share = np.clip(share, 0.0, 1.0)
        share = share * share * (3.0 - 2.0 * share)
    elif kind == "SMOOTHERSTEP":
        share = np.clip(share, 0.0, 1.0)
        share = share**3 * (share * (share * 6.0 - 15.0) + 10.0)
    result = to_low + share * (to_high - to_low)
    if settings["clamp"] and kind in ("LINEAR", "STEPPED"):
        result = np.clip(result, np.minimum(to_low, to_high), np.maximum(to_low, to_high))
    return (result,)


def constant(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """A constant, (1,) or (3,)."""
    return (np.asarray(settings["value"], np.float64).reshape(-1, 1),)


def parameter(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """A constant that differs by graph, (1, n) or (3, n)."""
    values: Array = settings["values"].take(context.variant, axis=1)
    return (values,)


def convert(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """Conversion between kinds of sockets: GREY of a colour, MEAN of a vector, SPREAD of a number."""
    (value,) = inputs
    if settings["to"] == "GREY":
        return (dot_row(value, LUMINANCE[:, None]),)
    if settings["to"] == "MEAN":
        return (value.mean(axis=0, keepdims=True),)
    return (np.repeat(value, 3, axis=0),)


def combine(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """Three numbers as a vector."""
    return (np.concatenate(np.broadcast_arrays(*inputs)),)


def separate(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """A vector as three numbers."""
    (value,) = inputs
    return value[0:1], value[1:2], value[2:3]


def multiply(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """A product, of weights of shaders for example."""
    return (inputs[0] * inputs[1],)


def rest(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The two shares of a mix of shaders: 1 - f and f, f in [0, 1]."""
    share = np.clip(inputs[0], 0.0, 1.0)
    return 1.0 - share, share


OPERATIONS: dict[str, Evaluator] = {
    "CLAMP": clamp,
    "COMBINE": combine,
    "CONSTANT": constant,
    "CONVERT": convert,
    "MAPPING": mapping,
    "MAP_RANGE": map_range,
    "MATH": math,
    "MULTIPLY": multiply,
    "PARAMETER": parameter,
    "REST": rest,
    "SEPARATE": separate,
    "VECTOR_MATH": vector_math,
}
