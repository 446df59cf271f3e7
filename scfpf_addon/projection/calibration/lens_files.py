# SPDX-License-Identifier: GPL-3.0-or-later
"""Calibration files: OpenCV's YAML, XML and JSON, ROS' YAML, OCamCalib's text, COLMAP's text.

A file is data: nothing in it is executed, sizes are limited, and XML may have no declarations of its own. The
YAML is the part that these programs write: keys with values, indented blocks, lists of numbers in brackets.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from ..file_limits import MAXIMUM_BYTES, read_bytes, shown
from ..typing import Array
from ..user_error import UserError
from .calibration import Calibration
from .lens_numbers import colmap_lens, fisheye_lens, omnidirectional_lens, opencv_lens

# A calibration's own text is short; COLMAP's lists of images are long.
MOST_BYTES = 2**20
MOST_DEPTH = 16
# COLMAP's camera space looks along +z with y down, ours along -z with y up.
FLIP = np.diag([1.0, -1.0, -1.0])
# Names by which programs write each thing, without capitals and underscores, the first first.
_MATRIX = ("cameramatrix", "k", "intrinsicmatrix", "intrinsic", "m1", "k1")
_COEFFICIENTS = ("distortioncoefficients", "distcoeffs", "distcoefs", "distortion", "d", "d1")
_SIZES = ("imagesize", "imgsize", "resolution", "size")
_FISHEYE_MODELS = ("fisheye", "equidistant", "kannalabrandt", "kannalabrandt4")
# A word near the beginning of OCamCalib's file, and how near.
OCAM_MARK, MARK_WITHIN = "polynomial", 200
# The sections of the file, each by a word of its comment.
_SECTIONS = ("direct", "inverse", "center", "affine", "size")


class Wanted(NamedTuple):
    """What the user says about a file. model: AUTO, OPENCV or FISHEYE. image: a name in images.txt, or the
    empty text for the first. size: of the image where the file lacks it.
    """

    model: str = "AUTO"
    image: str = ""
    size: tuple[float, float] = (1920.0, 1080.0)


def read_calibration(path: Path, wanted: Wanted) -> Calibration:
    """The camera of a calibration file, by the ending of its name. Raises UserError, with the file's name."""
    try:
        text = _text(path, MAXIMUM_BYTES if path.name == "images.txt" else MOST_BYTES)
        if path.suffix.lower() == ".txt":
            if path.name == "images.txt":
                return _colmap_image(text, path.with_name("cameras.txt"), wanted)
            if OCAM_MARK in text[:MARK_WITHIN].lower():
                return _ocam(text, path.stem)
            return next(iter(_colmap_cameras(text).values()))
        reader = _READERS.get(path.suffix.lower())
        if reader is None:
            raise UserError("its ending must be one of {0}", ", ".join([".txt", *_READERS]))
        return _opencv(_flat(reader(text)), path.stem, wanted)
    except OSError as error:
        raise UserError("Cannot read {0}: {1}", path.name, error.strerror or error) from error
    except UserError as error:
        raise UserError("{0}: {1}", path.name, error) from error


def _text(path: Path, most: int) -> str:
    """The text of a file. Raises OSError, and UserError for more bytes than ``most`` and for other data."""
    data = read_bytes(path, most + 1)
    if len(data) > most:
        raise UserError("the file is larger than {0} MB", most // 2**20)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UserError("not a text file in UTF-8") from error
    return text.replace("\r\n", "\n")


def _numbers(words: object, where: str) -> list[float]:
    """Finite numbers. words: a list of texts or numbers."""
    try:
        values = [float(word) for word in words]  # type: ignore[attr-defined]
    except (TypeError, ValueError, OverflowError) as error:
        raise UserError("{0} must be numbers", where) from error
    if not np.isfinite(values).all():
        raise UserError("{0} must be finite numbers", where)
    return values


def _json(text: str) -> object:
    try:
        return json.loads(text)
    except RecursionError as error:
        raise UserError("the file is nested too deeply") from error
    except ValueError as error:
        raise UserError("the file is not valid JSON: {0}", error) from error


def _xml(text: str) -> object:
    # An entity can stand for any number of others, and for other files.
    if "<!" in re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL):
        raise UserError("declarations such as <!DOCTYPE> are not allowed in the file")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise UserError("the file is not valid XML: {0}", error) from error
    return _element(root, 0)


def _element(element: ElementTree.Element, depth: int) -> object:
    if depth > MOST_DEPTH:
        raise UserError("the file is nested too deeply")
    if len(element):
        return {child.tag: _element(child, depth + 1) for child in element}
    words = (element.text or "").strip().strip('"').split()
    return words[0] if len(words) == 1 else words


def _yaml(text: str) -> object:
    """The part of YAML that OpenCV and ROS write, as nested dictionaries of texts and lists of texts."""
    # Lists in brackets may go over several lines.
    joined = re.sub(r"\[[^\[\]]*\]", lambda found: found.group().replace("\n", " "), text)
    root: dict[str, object] = {}
    open_blocks: list[tuple[int, dict[str, object]]] = [(-1, root)]
    rows: list[object] | None = None
    for line in joined.split("\n"):
        bare = line.split(" #", 1)[0].rstrip()
        content = bare.strip()
        if not content or content[0] in "%#" or content in ("---", "..."):
            continue
        indent = len(bare) - len(bare.lstrip())
        if content.startswith("- "):
            if rows is None:
                raise UserError("the YAML has a list where no key stands: {0}", shown(content))
            item = content
            while item.startswith("- "):
                item = item[2:].strip()
            rows.append(_scalar(item))
            continue
        key, colon, value = content.partition(":")
        if not colon:
            raise UserError("the YAML has a line that is no key and value: {0}", shown(content))
        while open_blocks[-1][0] >= indent:
            open_blocks.pop()
        if len(open_blocks) > MOST_DEPTH:
            raise UserError("the file is nested too deeply")
        # A word such as !!opencv-matrix says what a block is, which its keys say as well.
        value = re.sub(r"^!\S*", "", value.strip()).strip()
        parent = open_blocks[-1][1]
        name = key.strip().strip("\"'")
        if value:
            parent[name], rows = _scalar(value), None
        else:
            block: dict[str, object] = {}
            rows = []
            parent[name] = block
            block["data"] = rows
            open_blocks.append((indent, block))
    return root


def _scalar(value: str) -> object:
    if value.startswith("["):
        return [word for word in re.split(r"[\s,]+", value.strip("[] \t")) if word]
    return value.strip("\"'")


_READERS = {".yml": _yaml, ".yaml": _yaml, ".xml": _xml, ".json": _json}


def _plain(name: object) -> str:
    return re.sub(r"[_\-\s]", "", str(name)).lower()


def _flat(data: object) -> dict[str, object]:
    """The values of a file by their plain names; of equal names the outermost and first counts."""
    found: dict[str, object] = {}
    layer: list[object] = [data]
    for _ in range(MOST_DEPTH):
        blocks = [item for item in layer if isinstance(item, dict)]
        for block in blocks:
            for key, value in block.items():
                found.setdefault(_plain(key), value)
        layer = [value for block in blocks for value in block.values()]
    return found


def _values(value: object, where: str) -> list[float]:
    """The numbers of a list, of nested lists, or of a block with data."""
    if isinstance(value, dict):
        value = {_plain(key): item for key, item in value.items()}.get("data", [])
    if not isinstance(value, list):
        value = [value]
    flat: list[object] = []
    for item in value:
        flat += item if isinstance(item, list) else [item]
    return _numbers(flat, where)


def _opencv(values: dict[str, object], name: str, wanted: Wanted) -> Calibration:
    matrix_name = next((key for key in _MATRIX if key in values and _is_matrix(values[key])), None)
    if matrix_name is not None:
        matrix = np.reshape(_values(values[matrix_name], matrix_name), (3, 3))
    elif "fx" in values and "cx" in values:
        fx, cx, cy = (_values(values.get(key, []), key) for key in ("fx", "cx", "cy"))
        fy, skew = _values(values.get("fy", fx), "fy"), _values(values.get("skew", 0.0), "skew")
        try:
            matrix = np.array([[fx[0], skew[0], cx[0]], [0.0, fy[0], cy[0]], [0.0, 0.0, 1.0]])
        except IndexError as error:
            raise UserError("the file needs fx, fy, cx and cy, one number each") from error
    else:
        raise UserError("the file has no camera matrix: camera_matrix with 9 numbers, or fx, fy, cx and cy")
    key = next((key for key in _COEFFICIENTS if key in values), None)
    if key is not None:
        coefficients = _values(values[key], key)
    else:
        named = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tx", "ty")
        coefficients = [_values(values.get(key, 0.0), key)[0] for key in named]
    size, known = _size(values, wanted)
    is_fisheye = wanted.model == "FISHEYE"
    if wanted.model == "AUTO":
        model = next(
            (values[key] for key in ("distortionmodel", "cameramodel", "model") if key in values), ""
        )
        flag = str(values.get("fisheyemodel", 0)).lower()
        is_fisheye = _plain(model) in _FISHEYE_MODELS or flag in ("1", "true")
    if is_fisheye:
        # Without a list, names give only the first four: no number of a fisheye is called p1.
        if key is None:
            coefficients = [_values(values.get(f"k{power}", 0.0), "k")[0] for power in range(1, 5)]
        lens = fisheye_lens(matrix, coefficients, size)
    else:
        lens = opencv_lens(matrix, coefficients, size)
    return Calibration(str(values.get("cameraname", name)).strip() or name, lens, unknown_size=not known)


def _is_matrix(value: object) -> bool:
    try:
        return len(_values(value, "")) == 9
    except UserError:
        return False


def _size(values: dict[str, object], wanted: Wanted) -> tuple[tuple[float, float], bool]:
    """Width and height of the image in a file, else those wanted, and whether the file has them."""
    for width, height in (("imagewidth", "imageheight"), ("width", "height"), ("w", "h")):
        if width in values and height in values:
            given = [*_values(values[width], width), *_values(values[height], height)]
            if len(given) == 2:
                return (given[0], given[1]), True
    for key in _SIZES:
        if key in values:
            given = _values(values[key], key)
            if len(given) == 2:
                return (given[0], given[1]), True
    return wanted.size, False


def _ocam(text: str, name: str) -> Calibration:
    """OCamCalib's calib_results.txt."""
    found: dict[str, list[float]] = {}
    section = ""
    for line in text.split("\n"):
        if line.startswith("#"):
            section = next((word for word in _SECTIONS if word in line.lower()), "")
        elif line.strip() and section:
            found.setdefault(section, []).extend(_numbers(line.split(), section))
    counts = {"center": 2, "affine": 3, "size": 2}
    direct = found.get("direct", [])
    if (
        not direct
        or len(direct) != 1 + direct[0]
        or any(len(found.get(k, ())) != n for k, n in counts.items())
    ):
        raise UserError(
            "the file lacks a part that OCamCalib writes: polynomial, center, affine or image size"
        )
    height, width = found["size"]
    return Calibration(
        name, omnidirectional_lens(direct[1:], found["center"], found["affine"], (width, height))
    )


def _colmap_cameras(text: str) -> dict[str, Calibration]:
    """The cameras of COLMAP's cameras.txt by their numbers."""
    found: dict[str, Calibration] = {}
    for line in text.split("\n"):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if len(words) < 5:
            raise UserError("a camera needs a number, a model, a width, a height and parameters")
        width, height, *parameters = _numbers(words[2:], "size and parameters")
        found[words[0]] = Calibration(
            f"Camera {words[0]}"[:60], colmap_lens(words[1], parameters, (width, height))
        )
    if not found:
        raise UserError("the file has no camera")
    return found


def _colmap_image(text: str, cameras: Path, wanted: Wanted) -> Calibration:
    """A camera with its pose, of COLMAP's images.txt: a line of ten words an image, then one of points."""
    lines = [line for line in text.split("\n") if not line.startswith("#")]
    for line in lines[::2]:
        words = line.split(maxsplit=9)
        if len(words) < 10:
            continue
        if wanted.image in ("", words[9].strip()):
            try:
                known = _colmap_cameras(_text(cameras, MOST_BYTES))
            except OSError as error:
                raise UserError("cameras.txt must lie beside it: {0}", error.strerror or error) from error
            if words[8] not in known:
                raise UserError("cameras.txt has no camera {0}", words[8])
            pose = _pose(_numbers(words[1:8], "pose"))
            return Calibration(words[9].strip()[:60], known[words[8]].lens, pose)
    raise UserError("the file has no picture called '{0}'", wanted.image)


def _pose(numbers: list[float]) -> Array:
    """The camera's place from a unit quaternion w, x, y, z and a translation, world to COLMAP's camera."""
    quaternion = np.array(numbers[:4])
    length = float(np.linalg.norm(quaternion))
    if length == 0:
        raise UserError("the quaternion of a pose must not be 0")
    w, x, y, z = quaternion / length
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    pose = np.eye(4)
    pose[:3, :3] = turn.T @ FLIP
    pose[:3, 3] = -turn.T @ np.array(numbers[4:])
    return pose
