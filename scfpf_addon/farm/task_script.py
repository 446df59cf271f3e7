# SPDX-License-Identifier: GPL-3.0-or-later
"""A task of a render job: some frames, a tile of each, or tiles joined. A worker's Blender runs this file.

    blender --background --python task_script.py -- render --way engine --scene FILE.blend --output DIR …

It needs no extension for a file with a Cycles rig, and names what the worker lacks in its first line, with
status 1. A picture appears under its name when it is complete, so a task can be killed and run again. Farms
read double braces as places of values: this file contains none.
"""

import argparse
import hashlib
import json
import os
import platform
import re
import shutil
import struct
import sys
import tempfile
import time
import zipfile
from contextlib import ExitStack, contextmanager

import bpy
import numpy as np

# The extension's name at the end of its module's.
EXTENSION = "scfpf"
# Its name for people.
NAME = "Flexible Projection"
# The repository of an extension that a task has brought along.
REPOSITORY = "scfpf_task"
# The custom property of a rig's sheets that says for which scene its rays skip chords.
SKIPS = "scfpf_skips"
# What the extension's command line calls the engines of the ways that it renders.
COMMANDS = {"layers": "cycles", "eevee": "eevee"}
# Bytes of a file that are read at once.
BLOCK = 1 << 20
# The place of a tile's number in the path of a tiled image.
TILE = re.compile(r"<(?:UDIM|UVTILE)>")


class Fault(Exception):
    """What keeps a worker from a task; the message says what to do."""


def parse(arguments):
    """The options of a task."""
    parser = argparse.ArgumentParser(prog="scfpf task")
    parser.add_argument("action", choices=["render", "join"])
    parser.add_argument("--way", required=True, choices=["engine", "cycles", *COMMANDS])
    parser.add_argument("--scene", required=True, help="the .blend file")
    parser.add_argument("--output", required=True, help="the folder of the pictures, made if it is absent")
    parser.add_argument("--name", required=True, help="the name of a picture; # stands for digits")
    parser.add_argument("--first", type=int, required=True)
    parser.add_argument("--last", type=int, required=True)
    parser.add_argument("--count", type=int, default=1, help="only frames below the first one plus this")
    parser.add_argument("--step", type=int, default=1, help="only each frame of so many")
    parser.add_argument("--origin", type=int, help="a frame that steps begin at (default: the first one)")
    parser.add_argument("--extension", default="", help="the zip of the extension for workers without it")
    parser.add_argument("--tiles", default="1x1", help="columns and rows of tiles")
    parser.add_argument("--tile", type=int, default=0, help="the number of a tile, from the bottom left on")
    parser.add_argument("--resume", default="false", help="whether pictures that exist are kept")
    parser.add_argument(
        "--require", default="{}", help="a JSON object of what must be as it was, or its file"
    )
    return parser.parse_args(arguments)


def extension():
    """The extension's module, None if it is not enabled."""
    for name in bpy.context.preferences.addons.keys():
        if name.rpartition(".")[2] == EXTENSION and hasattr(bpy.types.Object, EXTENSION):
            return sys.modules.get(name)
    return None


def version_of(module):
    """The version in an extension's manifest."""
    path = os.path.join(os.path.dirname(module.__file__), "blender_manifest.toml")
    with open(path, encoding="utf-8") as file:
        for line in file:
            key, _, value = line.partition("=")
            if key.strip() == "version":
                return value.strip().strip('"')
    return ""


def digest_of(path):
    """The SHA-256 of a file, in hexadecimal digits."""
    found = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(BLOCK):
            found.update(block)
    return found.hexdigest()


def check_worker(options, needs, ends):
    """Raise Fault if this Blender, or the extension in it, is not the one that the job was made with.

    ends: an ExitStack that disables an extension again which the job has brought. Return its version.
    """
    here = f"{bpy.app.version[0]}.{bpy.app.version[1]}"
    if needs.get("blender", here) != here:
        raise Fault(
            f"the job was made by Blender {needs['blender']} and this worker has {here}: "
            f"give it Blender {needs['blender']}, or write the job with Blender {here}"
        )
    module = extension()
    if module is None:
        if options.way == "cycles":
            return ""
        if options.extension:
            check_archive(options.extension, needs)
            ends.enter_context(extension_of(options.extension))
            return version_of(extension())
        raise Fault(
            f"this worker's Blender {here} has no extension Flexible Projection: install it there, "
            "or write the job with --extension and its zip"
        )
    found = version_of(module)
    if needs.get("extension", found) not in ("", found):
        made = f"the job was made with {NAME} {needs['extension']}"
        print(f"scfpf: warning: {made}, this worker has {found}")
    return found


def check_archive(path, needs):
    """Raise Fault if the extension's zip is absent or not that of the job."""
    if not os.path.isfile(path):
        raise Fault(f"there is no zip of the extension at {path}: copy it there from the job's folder")
    if needs.get("archive") not in (None, digest_of(path)):
        raise Fault(f"{path} is not the job's zip of the extension: copy it again, or write the job again")


@contextmanager
def extension_of(path):
    """Enable the extension of a zip meanwhile, from a folder that is removed afterwards. Raises Fault.

    The worker's own extensions, preferences and Python packages stay as they are.
    """
    here, repositories = [*sys.path], bpy.context.preferences.extensions.repos
    folder = tempfile.mkdtemp(prefix="scfpf-task-")
    module = f"bl_ext.{REPOSITORY}.{EXTENSION}"
    try:
        unpack(path, os.path.join(folder, EXTENSION), os.path.join(folder, ".packages"))
        repository = repositories.new(
            name=REPOSITORY, module=REPOSITORY, custom_directory=folder, remote_url=""
        )
        try:
            enable(module, path)
            yield
        finally:
            bpy.ops.preferences.addon_disable(module=module)
            repositories.remove(repository)
    finally:
        sys.path[:] = here
        # Windows keeps files that Python has loaded.
        shutil.rmtree(folder, ignore_errors=True)


def enable(module, path):
    """Enable an extension that comes of a zip. Raises Fault."""
    told = "read its messages above"
    try:
        bpy.ops.preferences.addon_enable(module=module)
    except RuntimeError as error:
        told = str(error)
    if extension() is None:
        raise Fault(f"the extension in {path} cannot be enabled: {told}")


def unpack(path, place, packages):
    """Unpack the zip of the extension, and the packages of its wheels that fit this Python. Raises Fault."""
    try:
        with zipfile.ZipFile(path) as archive:
            archive.extractall(place)
    except zipfile.BadZipFile as error:
        raise Fault(f"{path} is not a zip: {error}") from error
    manifest = os.path.join(place, "blender_manifest.toml")
    if not os.path.isfile(manifest):
        raise Fault(f"{path} is not the zip of the extension: it has no manifest")
    wheels = os.path.join(place, "wheels")
    found = os.listdir(wheels) if os.path.isdir(wheels) else []
    fitting = [name for name in found if fits(name)]
    if found and not fitting:
        raise Fault(f"{path} is made for another system than this {platform.platform(terse=True)}")
    for name in fitting:
        with zipfile.ZipFile(os.path.join(wheels, name)) as archive:
            archive.extractall(packages)
    sys.path.insert(0, packages)
    # Blender would install the wheels of an extension for all that follows.
    shutil.rmtree(wheels, ignore_errors=True)
    with open(manifest, encoding="utf-8") as file:
        text = file.read()
    with open(manifest, "w", encoding="utf-8") as file:
        file.write(re.sub(r"(?ms)^wheels = \[.*?^\]|^wheels = \[[^\n]*\]$", "", text))


def fits(wheel):
    """Return whether a wheel, by the tags of its name, is for this Python and system."""
    python, _, system = wheel.removesuffix(".whl").split("-")[-3:]
    kind = {"linux": "linux", "win32": "win", "darwin": "macosx"}.get(sys.platform, sys.platform)
    is_own = kind in system and platform.machine().lower() in system
    return python in (f"cp{sys.version_info[0]}{sys.version_info[1]}", "py3") and (is_own or system == "any")


def check_files(options, needs):
    """Raise Fault if the scene's file or one that it uses is absent, or differs from that of the job."""
    if not os.path.isfile(options.scene):
        raise Fault(f"there is no file {options.scene}")
    folder = os.path.dirname(os.path.abspath(options.scene))
    own = {"path": os.path.abspath(options.scene), **needs.get("scene", {})}
    for asset in (own, *needs.get("assets", ())):
        path = os.path.join(folder, asset["path"])
        if not os.path.exists(path):
            raise Fault(f"this worker lacks {asset['path']}, which the file uses: copy it to {path}")
        size, digest = asset.get("bytes"), asset.get("sha256")
        is_other = size is not None and os.path.getsize(path) != size
        if is_other or (digest and digest_of(path) != digest):
            raise Fault(f"{path} has changed after the job was written: write the job again")


def files_at(path):
    """The files of a path: itself, the tiles of an image, or the pictures of a sequence that begins there."""
    if os.path.isdir(path):
        return files_below(path)
    folder, name = os.path.split(path)
    if TILE.search(name):
        parts = [re.escape(part) for part in TILE.split(name)]
        return matching(folder, r"(?:\d\d\d\d|u\d+_v\d+)".join(parts))
    if not os.path.isfile(path):
        return set()
    if path not in sequences():
        return {path}
    stem, ending = os.path.splitext(name)
    return matching(folder, re.escape(stem.rstrip("0123456789")) + r"\d+" + re.escape(ending)) | {path}


def sequences():
    """The paths of images and movie clips that are sequences of pictures."""
    return {
        os.path.normpath(bpy.path.abspath(clip.filepath, library=clip.library))
        for clip in [*bpy.data.images, *bpy.data.movieclips]
        if clip.source == "SEQUENCE"
    }


def matching(folder, pattern):
    """The files of a folder whose names match a pattern."""
    if not os.path.isdir(folder):
        return set()
    return {os.path.join(folder, name) for name in os.listdir(folder) if re.fullmatch(pattern, name)}


def files_below(folder):
    """All files of a folder and of those in it."""
    return {os.path.join(place, name) for place, _, names in os.walk(folder) for name in names}


def used_paths():
    """The paths of libraries, images and all else that the open file uses, sorted."""
    return sorted(map(os.path.normpath, {*bpy.utils.blend_paths(absolute=True, packed=False, local=False)}))


def absent_paths():
    """Those of ``used_paths`` at which there is nothing."""
    return [path for path in used_paths() if not files_at(path)]


def check_absent(needs):
    """Raise Fault if the open file uses files that this worker lacks, other than ones absent before.

    Farms may give files other places, so those are known by their names.
    """
    known = {os.path.basename(path.replace("\\", "/")) for path in needs.get("absent", ())}
    lacking = [path for path in absent_paths() if os.path.basename(path) not in known]
    if lacking:
        more = f" and {len(lacking) - 1} more files" if len(lacking) > 1 else ""
        raise Fault(f"this worker lacks {lacking[0]}{more}, which the file uses: copy them there")


def check_skips(needs):
    """Raise Fault if the open file does not skip the chords that it did when the job was written."""
    if "skips" in needs and needs["skips"] != skips_of_file():
        raise Fault(
            "the rig in this file was made for another scene than the job's: "
            "press Update Chords in the panel Cycles, save the file, and write the job again"
        )


def skips_of_file():
    """For which scenes the rays of the open file's rigs skip chords."""
    return sorted(str(obj[SKIPS]) for obj in bpy.data.objects if SKIPS in obj)


def open_scene(options, camera):
    """Open the file and return its scene, ready for its way."""
    try:
        bpy.ops.wm.open_mainfile(filepath=os.path.abspath(options.scene), load_ui=False)
    except RuntimeError as error:
        raise Fault(f"cannot open {options.scene}: {error}") from error
    scene = bpy.context.scene
    if scene.render.is_movie_format:
        raise Fault("the file writes a movie: choose a format of pictures in Output Properties")
    if options.way == "engine":
        scene.render.engine = "SCFPF"
        if camera:
            scene.camera = scene.objects[camera]
    elif options.way == "cycles" and scene.render.engine != "CYCLES":
        raise Fault("the file does not render with Cycles: press Cycles in the camera's panel and save it")
    elif options.way in COMMANDS:
        # Its pictures have one view, and neither the compositor nor the sequencer sees them.
        scene.render.use_multiview = scene.render.use_compositing = scene.render.use_sequencer = False
    scene.render.use_file_extension = True
    if hasattr(scene.render, "save_output"):
        # From Blender 5 on a file may leave writing to the compositor.
        scene.render.save_output = True
    return scene


def frames_of(options):
    """The frames of a task."""
    origin = options.first if options.origin is None else options.origin
    end = min(options.first + options.count - 1, options.last) + 1
    return [frame for frame in range(options.first, end) if (frame - origin) % options.step == 0]


def grid_of(options):
    """The numbers of columns and rows of tiles."""
    columns, rows = options.tiles.lower().split("x")
    return int(columns), int(rows)


def size_of(scene):
    """Width and height of the whole picture in pixels."""
    render = scene.render
    share = render.resolution_percentage
    return max(render.resolution_x * share // 100, 1), max(render.resolution_y * share // 100, 1)


def rectangle(options, tile, size):
    """The pixels of a tile: left, bottom, right, top."""
    (columns, rows), (width, height) = grid_of(options), size
    column, row = tile % columns, tile // columns
    return (
        width * column // columns,
        height * row // rows,
        width * (column + 1) // columns,
        height * (row + 1) // rows,
    )


def pattern_of(options):
    """The path of pictures, with # for digits and without an ending."""
    folder = os.path.abspath(options.output)
    os.makedirs(folder, exist_ok=True)
    return os.path.join(folder, options.name if "#" in options.name else f"{options.name}_####")


def views_of(scene):
    """The views of a stereo picture, none of an ordinary one."""
    render = scene.render
    if not render.use_multiview:
        return []
    is_pair = render.views_format == "STEREO_3D"
    return [view for view in render.views if view.use and (not is_pair or view.name in ("left", "right"))]


def pictures_of(scene, pattern, frame):
    """The files of a frame: one, or one of each view."""
    scene.render.filepath = pattern
    views = views_of(scene)
    if views and scene.render.image_settings.views_format == "INDIVIDUAL":
        return [scene.render.frame_path(frame=frame, view=view.name) for view in views]
    return [scene.render.frame_path(frame=frame)]


def tile_files(options, scene, frame, tile):
    """The files of a tile until it is joined, by the names of views: "" for an ordinary picture."""
    suffixes = {view.name: view.file_suffix for view in views_of(scene)} or {"": ""}
    path = os.path.splitext(tile_file(options, frame, tile))[0]
    return {name: f"{path}{suffix}.exr" for name, suffix in suffixes.items()}


def tile_file(options, frame, tile):
    """The path of a tile's files, without the suffix of a view."""
    folder = os.path.join(os.path.abspath(options.output), "tiles")
    os.makedirs(folder, exist_ok=True)
    return os.path.join(folder, f"{options.name.replace('#', '')}_{frame}_{tile}.exr")


def render_to(scene, path):
    """Render the present frame, and move what Blender writes beside ``path`` when it is complete.

    path: without the suffix of a view, with its ending. Return the files.
    """
    folder, name = os.path.split(path)
    part = os.path.join(folder, f".{name}.part")
    shutil.rmtree(part, ignore_errors=True)
    os.mkdir(part)
    try:
        scene.render.filepath = os.path.join(part, os.path.splitext(name)[0])
        try:
            bpy.ops.render.render(write_still=True)
        except RuntimeError as error:
            raise Fault(str(error).removeprefix("Error: ").strip()) from error
        names = sorted(os.listdir(part))
        if not names:
            raise Fault(f"Blender has written no picture for {path}: read its messages above")
        for each in names:
            os.replace(os.path.join(part, each), os.path.join(folder, each))
        return [os.path.join(folder, each) for each in names]
    finally:
        shutil.rmtree(part, ignore_errors=True)


def note(paths, begun):
    """Print the files of a picture, in the words by which Flamenco recognises them."""
    for path in paths:
        print(f"Saved: '{path}'")
    print(f"Time: {time.monotonic() - begun:.2f} s", flush=True)


def is_resumed(options):
    """Return whether pictures that exist are to be kept."""
    return options.resume.lower() in ("true", "1", "yes")


def keeps(options, paths):
    """Return whether the files of a picture exist and are to be kept."""
    if not is_resumed(options) or not all(map(os.path.exists, paths)):
        return False
    print(f"scfpf: Skipping existing frame {paths[0]}", flush=True)
    return True


def render_frames(options, scene):
    """Render the frames of a task."""
    pattern = pattern_of(options)
    for frame in frames_of(options):
        begun, paths = time.monotonic(), pictures_of(scene, pattern, frame)
        if not keeps(options, paths):
            scene.frame_set(frame)
            scene.render.filepath = pattern
            note(render_to(scene, scene.render.frame_path(frame=frame)), begun)


def render_tiles(options, scene, camera):
    """Render a tile of each frame of a task into files with all passes in float32.

    The compositor and the sequencer get the joined picture.
    """
    pattern, render = pattern_of(options), scene.render
    width, height = size_of(scene)
    left, bottom, right, top = rectangle(options, options.tile, (width, height))
    output = {frame: pictures_of(scene, pattern, frame) for frame in frames_of(options)}
    render.use_border = render.use_crop_to_border = True
    # Half a pixel further, because Blender rounds down.
    render.border_min_x, render.border_max_x = (left + 0.5) / width, (right + 0.5) / width
    render.border_min_y, render.border_max_y = (bottom + 0.5) / height, (top + 0.5) / height
    render.use_compositing = render.use_sequencer = False
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    settings.exr_codec, settings.views_format = "NONE", "INDIVIDUAL"
    # Tiles hold what Blender renders: a colour space of the file is for the joined picture.
    settings.color_management = "FOLLOW_SCENE"
    for frame, paths in output.items():
        begun, path = time.monotonic(), tile_file(options, frame, options.tile)
        if keeps(options, paths) or keeps(
            options, [*tile_files(options, scene, frame, options.tile).values()]
        ):
            continue
        if options.way in COMMANDS:
            scene.frame_set(frame)
            render_by_command(options, scene, camera, [], path)
        else:
            scene.frame_set(frame)
            note(render_to(scene, path), begun)


class JoiningEngine(bpy.types.RenderEngine):
    """A render engine whose picture is already there: Blender goes on with it as with one it has rendered."""

    bl_idname = "SCFPF_JOIN"
    bl_label = "Joined Tiles"
    # The passes by view and view layer, (letters, (height, width, channels) float32) by name; the notes in
    # the tiles' files; whether Blender has taken the picture.
    views, notes, is_taken = None, None, False

    def update_render_passes(self, scene=None, renderlayer=None):
        kinds = {1: "VALUE", 2: "VECTOR"}
        for layers in self.views.values():
            for name, (letters, _) in layers.get(renderlayer.name, dict()).items():
                kind = "VECTOR" if letters.startswith("X") else kinds.get(len(letters), "COLOR")
                self.register_pass(scene, renderlayer, name, len(letters), letters, kind)
            return

    def render(self, depsgraph):
        name = depsgraph.view_layer_eval.name
        for key, text in self.notes.items():
            self.get_result().stamp_data_add_field(key, text)
        for view in [each.name for each in self.get_result().views]:
            passes = self.views[view if view in self.views else ""].get(name, dict())
            for each, (letters, _) in passes.items():
                if each != "Combined":
                    self.add_pass(each, len(letters), letters, layer=name)
            height, width = passes["Combined"][1].shape[:2]
            result = self.begin_result(0, 0, width, height, layer=name, view=view)
            try:
                for each, (_, values) in passes.items():
                    result.layers[0].passes.find_by_name(each, view).rect.foreach_set(values.ravel())
                JoiningEngine.is_taken = True
            finally:
                self.end_result(result)


def join_tiles(options, scene):
    """Join the tiles of each frame of a task, and remove them."""
    pattern, render = pattern_of(options), scene.render
    bpy.utils.register_class(JoiningEngine)
    try:
        wanted = [
            frame for frame in frames_of(options) if not keeps(options, pictures_of(scene, pattern, frame))
        ]
        for frame in wanted:
            begun = time.monotonic()
            parts = read_tiles(options, scene, frame)
            if frame == wanted[0]:
                prepare_join(options, scene)
            scene.frame_set(frame)
            render.filepath, JoiningEngine.is_taken = pattern, False
            made = render_to(scene, render.frame_path(frame=frame))
            if not JoiningEngine.is_taken:
                raise Fault(f"Blender has not taken the joined picture {made[0]}: read its messages above")
            for part in parts:
                os.remove(part)
            note(made, begun)
    finally:
        bpy.utils.unregister_class(JoiningEngine)
        JoiningEngine.views = JoiningEngine.notes = None


def prepare_join(options, scene):
    """Let a scene show nothing but the joined picture."""
    render, camera = scene.render, scene.camera
    render.use_border = render.use_freestyle = False
    # Its picture is not that of a flexible camera, whose volume it would ignore. Compositors see the lens.
    lens = camera.data if camera is not None else bpy.data.cameras.new("Joined")
    scene.camera = bpy.data.objects.new("Joined", lens)
    if camera is not None:
        scene.camera.matrix_world = camera.matrix_world
    have = next(iter(JoiningEngine.views.values()))
    for layer in scene.view_layers:
        layer.use = layer.name in have
        # Blender would draw Grease Pencil again.
        for child in layer.layer_collection.children:
            child.exclude = True
    for obj in scene.collection.objects:
        obj.hide_render = True
    render.engine = JoiningEngine.bl_idname
    for layer in scene.view_layers:
        layer.update_render_passes()


def read_tiles(options, scene, frame):
    """Read the tiles of a frame into the engine that joins them; return their files."""
    (columns, rows), (width, height) = grid_of(options), size_of(scene)
    JoiningEngine.views, JoiningEngine.notes, parts = dict(), dict(), []
    for tile in range(columns * rows):
        left, bottom, right, top = rectangle(options, tile, (width, height))
        for view, path in tile_files(options, scene, frame, tile).items():
            parts.append(path)
            layers = JoiningEngine.views.setdefault(view, dict())
            for layer, name, letters, values in passes_of(path, (right - left, top - bottom)):
                passes = layers.setdefault(layer, dict())
                if name not in passes:
                    passes[name] = letters, np.zeros((height, width, len(letters)), np.float32)
                passes[name][1][bottom:top, left:right] = values
    return parts


def passes_of(path, size):
    """Read the passes of a tile: the view layer, the name, the letters and the values from the bottom row up.

    It is an uncompressed OpenEXR file, whose pixels Blender does not give to Python.
    """
    if not os.path.exists(path):
        raise Fault(f"there is no tile {path}: run the tasks that render tiles first")
    data = np.fromfile(path, np.uint8)
    try:
        parts, at = headers_of(data)
        found = dict()
        at += 8 * len(parts) * size[1]
        for channels, shape in parts:
            if shape != size:
                raise Fault(f"the tile {path} has another size than the job's: remove it and render it again")
            line = 4 * len(channels) * size[0]
            stride = line + (12 if data[5] & 0x10 else 8)
            lines = data[at : at + stride * size[1]].reshape(size[1], stride)[::-1, stride - line :]
            values = np.ascontiguousarray(lines).view("<f4").reshape(size[1], len(channels), size[0])
            for number, title in enumerate(channels):
                layer, name, letter = title.rsplit(".", 2)
                found.setdefault((layer, name), dict())[letter] = values[:, number]
            at += stride * size[1]
    except (ValueError, IndexError, struct.error) as error:
        raise Fault(f"the tile {path} cannot be read: remove it and render it again") from error
    for (layer, name), channels in found.items():
        letters = "".join(sorted(channels, key="RGBXYZWUVTArgba".index))
        yield layer, name, letters, np.stack([channels[letter] for letter in letters], axis=-1)


def headers_of(data):
    """The parts of an OpenEXR file, channels and (width, height), and where its tables of offsets begin.

    Notes, such as the names in cryptomattes, are kept for the joined picture.
    """
    parts, at, is_multipart = [], 8, bool(data[5] & 0x10)
    while True:
        found = dict()
        while data[at]:
            (name, kind), at = texts(data, at, 2)
            size = struct.unpack("<i", data[at : at + 4].tobytes())[0]
            found[name], at = data[at + 4 : at + 4 + size], at + 4 + size
            # Blender writes notes of its own anew; those of Cycles are of one tile.
            if kind == "string" and re.search("[/.]", name) and not re.match("name$|cycles[.]", name):
                JoiningEngine.notes[name] = found[name].tobytes().decode()
        at += 1
        channels, place = [], 0
        while found["channels"][place]:
            (title,), place = texts(found["channels"], place, 1)
            channels.append(title)
            # Four numbers follow.
            place += 16
        left, top, right, bottom = struct.unpack("<4i", found["dataWindow"].tobytes())
        parts.append((channels, (right - left + 1, bottom - top + 1)))
        if not is_multipart:
            return parts, at
        if not data[at]:
            return parts, at + 1


def texts(data, at, count):
    """Some texts that end with a zero each, and the offset behind them."""
    found = []
    for _ in range(count):
        end = at + int(np.argmin(data[at : at + 256] != 0))
        found.append(data[at:end].tobytes().decode())
        at = end + 1
    return found, at


def render_by_command(options, scene, camera, frames, path):
    """Render pictures by the extension as its command line does; no frames for the present one."""
    scene.render.use_overwrite = not is_resumed(options)
    command = sys.modules[f"{extension().__name__}.scfpf_addon.bridge.render.command_line"]
    try:
        command.render_by_others(scene, camera or None, COMMANDS[options.way], frames, path)
    except command.UserError as error:
        raise Fault(str(error)) from error


def run(arguments):
    """Do a task; return its status: 0, or 1 after a line with the reason."""
    options = parse(arguments)
    try:
        with ExitStack() as ends:
            do(options, ends)
    except (Fault, OSError) as error:
        print(f"scfpf: {' '.join(str(error).split())}", file=sys.stderr, flush=True)
        return 1
    return 0


def do(options, ends):
    """Do a task. Raises Fault and OSError."""
    text = options.require
    if not text.lstrip().startswith("{"):
        with open(text, encoding="utf-8") as file:
            text = file.read()
    needs = json.loads(text)
    found = check_worker(options, needs, ends)
    check_files(options, needs)
    frames, camera = frames_of(options), needs.get("camera", "")
    if not frames:
        print("scfpf: no frames of the job's step are among those of this task", flush=True)
        return
    scene = open_scene(options, camera)
    check_absent(needs)
    check_skips(needs)
    print(
        f"scfpf: {options.action} {frames[0]} to {frames[-1]} of {options.scene} by {options.way}, "
        f"Blender {bpy.app.version_string}, {f'{NAME} {found}' if found else f'without {NAME}'}",
        flush=True,
    )
    if options.action == "join":
        join_tiles(options, scene)
    elif grid_of(options) != (1, 1):
        render_tiles(options, scene, camera)
    elif options.way in COMMANDS:
        render_by_command(options, scene, camera, frames, pattern_of(options))
    else:
        render_frames(options, scene)


if __name__ == "__main__":
    sys.exit(run(sys.argv[sys.argv.index("--") + 1 :]))
