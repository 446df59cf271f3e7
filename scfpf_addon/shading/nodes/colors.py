# SPDX-License-Identifier: GPL-3.0-or-later
"""Operations on colours: Mix and its blend modes, ramps, curves and the small converters.

Definitions of Blender's manual (Shader Nodes > Color, Converter); the blend modes are those of
image editors, without a limit at 1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...projection.colors import LUMINANCE
from ...projection.typing import Array
from ..vectors import dot_row
from .context import ShadingContext
from .graph import Evaluator, Inputs, Settings
from .numbers import divided, power
from .spectrum import observer

# The range of Blender's Blackbody in kelvin; wavelengths in nm at which its spectrum is summed.
COLDEST, HOTTEST = 800.0, 12000.0
SPECTRUM = np.arange(380.0, 781.0, 5.0)[:, None]
# The second radiation constant, nm K.
RADIATION = 1.438777e7
# CIE XYZ to linear Rec.709, Blender's working space.
REC709 = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])

Blend = Callable[[Array, Array, Array], Array]


def hsv_from_rgb(color: Array) -> Array:
    """Hue, saturation and value, (3, n), of colours (Smith 1978)."""
    most, least = color.max(axis=0), color.min(axis=0)
    spread = most - least
    saturation = np.where(most != 0.0, divided(spread, most), 0.0)
    red, green, blue = (divided(most - channel, spread) for channel in color)
    hue = np.where(
        color[0] == most, blue - green, np.where(color[1] == most, 2.0 + red - blue, 4.0 + green - red)
    )
    hue = np.where(spread == 0.0, 0.0, hue / 6.0)
    return np.stack([np.where(hue < 0.0, hue + 1.0, hue), saturation, most])


def rgb_from_hsv(color: Array) -> Array:
    """Colours, (3, n), of hue, saturation and value."""
    hue, saturation, value = color
    turned = (hue - np.floor(hue)) * 6.0
    channels = [np.clip(np.abs(turned - 3.0) - 1.0, 0.0, 1.0)]
    channels += [np.clip(2.0 - np.abs(turned - middle), 0.0, 1.0) for middle in (2.0, 4.0)]
    return np.stack([value * (1.0 - saturation * (1.0 - channel)) for channel in channels])


def hsl_from_rgb(color: Array) -> Array:
    """Hue, saturation and lightness, (3, n)."""
    most, least = color.max(axis=0), color.min(axis=0)
    light = (most + least) / 2.0
    room = np.where(light > 0.5, 2.0 - most - least, most + least)
    saturation = np.minimum(divided(most - least, room), 1.0)
    return np.stack([hsv_from_rgb(color)[0], saturation, np.minimum(light, 1.0)])


def rgb_from_hsl(color: Array) -> Array:
    """Colours, (3, n), of hue, saturation and lightness."""
    hue, saturation, light = color
    pure = rgb_from_hsv(np.stack([hue, np.ones_like(hue), np.ones_like(hue)]))
    chroma = (1.0 - np.abs(2.0 * light - 1.0)) * saturation
    color = (pure - 0.5) * chroma + light
    return color


def _dodge(t: Array, a: Array, b: Array) -> Array:
    """a / (1 - t b), at most 1."""
    left = 1.0 - t * b
    bright = np.minimum(divided(a, left), 1.0)
    return np.where(a == 0.0, a, np.where(left <= 0.0, 1.0, bright))


def _burn(t: Array, a: Array, b: Array) -> Array:
    left = 1.0 - t + t * b
    dark = np.clip(1.0 - divided(1.0 - a, left), 0.0, 1.0)
    return np.where(left <= 0.0, 0.0, dark)


def _overlay(t: Array, a: Array, b: Array) -> Array:
    rest = 1.0 - t
    return np.where(a < 0.5, a * (rest + 2.0 * t * b), 1.0 - (rest + 2.0 * t * (1.0 - b)) * (1.0 - a))


def _soft_light(t: Array, a: Array, b: Array) -> Array:
    screen = 1.0 - (1.0 - b) * (1.0 - a)
    return (1.0 - t) * a + t * ((1.0 - a) * b * a + a * screen)


def _by_hsv(keep: Callable[[Array, Array], Array]) -> Blend:
    """A blend that keeps parts of hue, saturation and value; a stays where b is grey."""

    def blend(t: Array, a: Array, b: Array) -> Array:
        """Blend colours a and b (3, n), by shares t (1, n) of b."""
        one, other = hsv_from_rgb(a), hsv_from_rgb(b)
        mixed: Array = np.where(other[1] != 0.0, a + t * (rgb_from_hsv(keep(one, other)) - a), a)
        return mixed

    return blend


def _saturation(t: Array, a: Array, b: Array) -> Array:
    one, other = hsv_from_rgb(a), hsv_from_rgb(b)
    mixed = rgb_from_hsv(np.stack([one[0], one[1] + t[0] * (other[1] - one[1]), one[2]]))
    return np.where(one[1] != 0.0, mixed, a)


def _value(t: Array, a: Array, b: Array) -> Array:
    one, other = hsv_from_rgb(a), hsv_from_rgb(b)
    return rgb_from_hsv(np.stack([one[0], one[1], one[2] + t[0] * (other[2] - one[2])]))


BLENDS: dict[str, Blend] = {
    "MIX": lambda t, a, b: a + t * (b - a),
    "DARKEN": lambda t, a, b: a + t * (np.minimum(a, b) - a),
    "MULTIPLY": lambda t, a, b: a * (1.0 - t + t * b),
    "BURN": _burn,
    "LIGHTEN": lambda t, a, b: a + t * (np.maximum(a, b) - a),
    "SCREEN": lambda t, a, b: 1.0 - (1.0 - t + t * (1.0 - b)) * (1.0 - a),
    "DODGE": _dodge,
    "ADD": lambda t, a, b: a + t * b,
    "OVERLAY": _overlay,
    "SOFT_LIGHT": _soft_light,
    "LINEAR_LIGHT": lambda t, a, b: a + t * (2.0 * b - 1.0),
    "DIFFERENCE": lambda t, a, b: a + t * (np.abs(a - b) - a),
    "EXCLUSION": lambda t, a, b: np.maximum(a + t * (b - 2.0 * a * b), 0.0),
    "SUBTRACT": lambda t, a, b: a - t * b,
    "DIVIDE": lambda t, a, b: np.where(b != 0.0, (1.0 - t) * a + t * divided(a, b), a),
    "HUE": _by_hsv(lambda one, other: np.stack([other[0], one[1], one[2]])),
    "COLOR": _by_hsv(lambda one, other: np.stack([other[0], other[1], one[2]])),
    "SATURATION": _saturation,
    "VALUE": _value,
}


def mix(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Mix node, of numbers, vectors or colours: factor, A, B."""
    share = inputs[0]
    if settings["clamp_factor"]:
        share = np.clip(share, 0.0, 1.0)
    a, b = np.broadcast_arrays(inputs[1], inputs[2])
    share, a, b = (
        np.broadcast_to(each, (len(each), max(a.shape[1], share.shape[1]))) for each in (share, a, b)
    )
    value = BLENDS[settings["blend"]](share, a, b)
    return (np.clip(value, 0.0, 1.0) if settings["clamp_result"] else value,)


def table(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Color Ramp node: colour and alpha of a table (S, 4) over [0, 1]."""
    values = settings["table"]
    at = np.clip(np.nan_to_num(inputs[0][0]), 0.0, 1.0) * (len(values) - 1)
    low = np.floor(at).astype(np.intp)
    found = values.take(low, axis=0)
    if settings["smooth"]:
        following = values.take(np.minimum(low + 1, len(values) - 1), axis=0)
        found = found + (following - found) * (at - low)[:, None]
    return found[:, :3].T, found[:, 3:].T


def curves(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """RGB, Vector and Float Curves: factor, value; a table (S, C) over [low, high], extended linearly."""
    factor, value = inputs
    values, low, high = settings["table"], settings["low"], settings["high"]
    last = len(values) - 1
    channels = []
    for channel, column in zip(value, values.T, strict=True):
        at = (channel - low) / (high - low) * last
        inside = np.clip(at, 0.0, last)
        bent = np.interp(inside, np.arange(last + 1), column)
        slope = np.where(at < 0.0, column[1] - column[0], column[last] - column[last - 1])
        channels.append(bent + (at - inside) * slope if settings["extend"] else bent)
    return (value + factor * (np.stack(channels) - value),)


def invert(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Invert Color node."""
    share, color = inputs
    return (color + share * (1.0 - 2.0 * color),)


def gamma(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Gamma node: channels at or below 0 stay."""
    color, exponent = inputs
    return (np.where(color > 0.0, power(np.maximum(color, 0.0), exponent), color),)


def blackbody(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Blackbody node: Planck's spectrum at a temperature, of luminance 1, within Rec.709.

    Cycles uses a fit of it. Its channels above 0.1 differ by at most 2 %.
    """
    temperature = np.clip(inputs[0], COLDEST, HOTTEST)
    spectrum = 1.0 / (SPECTRUM**5 * np.expm1(RADIATION / (SPECTRUM * temperature)))
    seen = np.stack([curve @ spectrum for curve in observer(SPECTRUM[:, 0])])
    return (np.maximum(REC709 @ (seen / seen[1]), 0.0),)


def bright_contrast(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Brightness/Contrast node."""
    color, bright, contrast = inputs
    return (np.maximum((1.0 + contrast) * color + bright - contrast * 0.5, 0.0),)


def hue_saturation(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Hue/Saturation/Value node: hue, saturation, value, factor, colour."""
    hue, saturation, value, share, color = inputs
    h, s, v = hsv_from_rgb(color)
    h = h + hue[0] + 0.5
    changed = rgb_from_hsv(
        np.stack(np.broadcast_arrays(h, np.clip(s * saturation[0], 0.0, 1.0), v * value[0]))
    )
    return (np.maximum(color + share * (changed - color), 0.0),)


def separate_color(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Separate Color node."""
    (color,) = inputs
    if settings["mode"] == "HSV":
        color = hsv_from_rgb(color)
    elif settings["mode"] == "HSL":
        color = hsl_from_rgb(color)
    return color[0:1], color[1:2], color[2:3]


def combine_color(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Combine Color node."""
    color = np.concatenate(np.broadcast_arrays(*inputs))
    if settings["mode"] == "HSV":
        color = rgb_from_hsv(color)
    elif settings["mode"] == "HSL":
        color = rgb_from_hsl(color)
    return (color,)


def grey(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The RGB to BW node."""
    return (dot_row(inputs[0], LUMINANCE[:, None]),)


OPERATIONS: dict[str, Evaluator] = {
    "BLACKBODY": blackbody,
    "BRIGHT_CONTRAST": bright_contrast,
    "COMBINE_COLOR": combine_color,
    "CURVES": curves,
    "GAMMA": gamma,
    "GREY": grey,
    "HUE_SATURATION": hue_saturation,
    "INVERT": invert,
    "MIX": mix,
    "SEPARATE_COLOR": separate_color,
    "TABLE": table,
}
