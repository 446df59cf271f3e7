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
import shutil
import sys
import time

import bpy
import numpy as np

# The extension's name at the end of its module's.
EXTENSION = "scfpf"
# The custom property of a rig's sheets that says for which scene its rays skip chords.
SKIPS = "scfpf_skips"
# What the command line of the extension needs for the ways that it renders.
COMMANDS = {"layers": ("--cycles",), "eevee": ("--engine", "eevee")}
# Bytes of a file that are read at once.
BLOCK = 1 << 20


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
    parser.add_argument("--count", type=int, default=1, help="at most so many frames from the first one on")
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


def check_worker(options, needs):
    """Raise Fault if this Blender, or the extension in it, is not the one that the job was made with."""
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
        raise Fault(
            f"this worker's Blender {here} has no SCFPF extension: install it there, "
            "or set up Cycles in the file and choose the way cycles"
        )
    found = version_of(module)
    if needs.get("extension", found) not in ("", found):
        print(f"scfpf: warning: the job was made with SCFPF {needs['extension']}, this worker has {found}")
    return found


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
    """Open the file and return its scene, ready for a way that Blender itself renders."""
    try:
        bpy.ops.wm.open_mainfile(filepath=os.path.abspath(options.scene), load_ui=False)
    except RuntimeError as error:
        raise Fault(f"cannot open {options.scene}: {error}") from error
    scene = bpy.context.scene
    if options.way == "engine":
        scene.render.engine = "SCFPF"
        if camera:
            scene.camera = scene.objects[camera]
    elif options.way == "cycles" and scene.render.engine != "CYCLES":
        raise Fault("the file does not render with Cycles: press Cycles in the camera's panel and save it")
    if scene.render.is_movie_format:
        raise Fault("the file writes a movie: choose a format of pictures in Output Properties")
    scene.render.use_file_extension = True
    if hasattr(scene.render, "save_output"):
        # From Blender 5 on a file may leave writing to the compositor.
        scene.render.save_output = True
    return scene


def frames_of(options):
    """The frames of a task."""
    return range(options.first, min(options.first + options.count - 1, options.last) + 1)


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


def pictures_of(scene, pattern, frame):
    """The files of a frame: one, or one of each view."""
    scene.render.filepath = pattern
    views = [view.name for view in scene.render.views if view.use] if scene.render.use_multiview else []
    individual = scene.render.image_settings.views_format == "INDIVIDUAL"
    if views and individual:
        return [scene.render.frame_path(frame=frame, view=view) for view in views]
    return [scene.render.frame_path(frame=frame)]


def tile_file(options, frame, tile):
    """The file of a tile until it is joined."""
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


def keeps(options, paths):
    """Return whether the files of a picture exist and are to be kept."""
    if options.resume.lower() not in ("true", "1", "yes") or not all(map(os.path.exists, paths)):
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


def render_tiles(options, scene):
    """Render a tile of each frame of a task into a file of float32."""
    pattern, render = pattern_of(options), scene.render
    width, height = size_of(scene)
    left, bottom, right, top = rectangle(options, options.tile, (width, height))
    output = {frame: pictures_of(scene, pattern, frame) for frame in frames_of(options)}
    render.use_border = render.use_crop_to_border = True
    # Half a pixel further, because Blender rounds down.
    render.border_min_x, render.border_max_x = (left + 0.5) / width, (right + 0.5) / width
    render.border_min_y, render.border_max_y = (bottom + 0.5) / height, (top + 0.5) / height
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
    for frame, paths in output.items():
        begun, path = time.monotonic(), tile_file(options, frame, options.tile)
        if not keeps(options, paths) and not keeps(options, [path]):
            scene.frame_set(frame)
            note(render_to(scene, path), begun)


class JoiningEngine(bpy.types.RenderEngine):
    """A render engine whose picture is already there: Blender writes it with all settings of the output."""

    bl_idname = "SCFPF_JOIN"
    bl_label = "Joined Tiles"
    # The picture, (height, width, 4) float32, and whether Blender has taken it.
    whole, is_taken = None, False

    def render(self, depsgraph):
        height, width = self.whole.shape[:2]
        result = self.begin_result(0, 0, width, height, layer=depsgraph.view_layer_eval.name)
        try:
            result.layers[0].passes.find_by_name("Combined", "").rect.foreach_set(self.whole.ravel())
            JoiningEngine.is_taken = True
        finally:
            self.end_result(result)


def join_tiles(options, scene):
    """Join the tiles of each frame of a task, and remove them."""
    pattern, render = pattern_of(options), scene.render
    bpy.utils.register_class(JoiningEngine)
    try:
        render.engine, render.use_border = JoiningEngine.bl_idname, False
        # Its picture is not that of a flexible camera, whose volume it would ignore.
        scene.camera = bpy.data.objects.new("Joined", bpy.data.cameras.new("Joined"))
        # Tiles have been through them.
        render.use_compositing = render.use_sequencer = False
        for layer in scene.view_layers:
            layer.use = layer == scene.view_layers[0]
        for frame in frames_of(options):
            paths = pictures_of(scene, pattern, frame)
            if not keeps(options, paths):
                join_frame(options, scene, frame, paths[0])
    finally:
        bpy.utils.unregister_class(JoiningEngine)
        JoiningEngine.whole = None


def join_frame(options, scene, frame, path):
    """Join the tiles of a frame into a file, and remove them."""
    begun, (columns, rows), (width, height) = time.monotonic(), grid_of(options), size_of(scene)
    whole = np.empty((height, width, 4), np.float32)
    parts = [tile_file(options, frame, tile) for tile in range(columns * rows)]
    for tile, part in enumerate(parts):
        left, bottom, right, top = rectangle(options, tile, (width, height))
        whole[bottom:top, left:right] = pixels_of(part, (right - left, top - bottom))
    JoiningEngine.whole, JoiningEngine.is_taken = whole, False
    scene.frame_set(frame)
    made = render_to(scene, path)
    if not JoiningEngine.is_taken:
        raise Fault(f"Blender has not taken the joined picture {path}: read its messages above")
    for part in parts:
        os.remove(part)
    note(made, begun)


def pixels_of(path, size):
    """The pixels of a tile, (height, width, 4) float32, from the bottom row up."""
    if not os.path.exists(path):
        raise Fault(f"there is no tile {path}: run the tasks that render tiles first")
    image = bpy.data.images.load(path)
    try:
        if tuple(image.size) != size:
            raise Fault(f"the tile {path} has another size than the job's: remove it and render it again")
        found = np.empty(size[0] * size[1] * 4, np.float32)
        image.pixels.foreach_get(found)
    finally:
        bpy.data.images.remove(image)
    return found.reshape(size[1], size[0], 4)


def render_by_command(options, module, camera):
    """Render the frames of a task by the extension's command line."""
    frames = frames_of(options)
    words = ["render", options.scene, "-o", pattern_of(options), *COMMANDS[options.way]]
    words += ["--frames", str(frames[0]), str(frames[-1])]
    words += ["--camera", camera] if camera else []
    words += ["--resume"] if options.resume.lower() in ("true", "1", "yes") else []
    command = f"{module.__name__}.scfpf_addon.bridge.render.command_line"
    return sys.modules[command].run(words)


def run(arguments):
    """Do a task; return its status: 0, or 1 after a line with the reason."""
    options = parse(arguments)
    try:
        text = options.require
        if not text.lstrip().startswith("{"):
            with open(text, encoding="utf-8") as file:
                text = file.read()
        needs = json.loads(text)
        found = check_worker(options, needs)
        check_files(options, needs)
        frames, camera = frames_of(options), needs.get("camera", "")
        print(
            f"scfpf: {options.action} {frames[0]} to {frames[-1]} of {options.scene} by {options.way}, "
            f"Blender {bpy.app.version_string}, {f'SCFPF {found}' if found else 'without SCFPF'}",
            flush=True,
        )
        if options.way in COMMANDS:
            return render_by_command(options, extension(), camera)
        scene = open_scene(options, camera)
        check_skips(needs)
        if options.action == "join":
            join_tiles(options, scene)
        elif grid_of(options) != (1, 1):
            render_tiles(options, scene)
        else:
            render_frames(options, scene)
    except (Fault, OSError) as error:
        print(f"scfpf: {' '.join(str(error).split())}", file=sys.stderr, flush=True)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(run(sys.argv[sys.argv.index("--") + 1 :]))
