# SPDX-License-Identifier: GPL-3.0-or-later
"""One file through one way to an image, in a Blender of its own: called by corpus.py.

    python devtools/corpus_case.py FILE.blend WAY FOLDER WIDTH SAMPLES

BLENDER_USER_RESOURCES names an empty profile, in a folder for temporary files.
The folder receives WAY.png and WAY.npy, scene-linear RGBA of float32 with shape (H, W, 4), row 0 below.
The last lines of the output are the figures, as JSON.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from pathlib import Path
from time import perf_counter

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from demo.render_demo import MODULE, enable_add_on
from devtools.corpus import BEGINS, FIGURES

# Differences above this, of colours that are clipped to [0, 1], count as pixels that are off.
OFF = 0.1
# Alpha above this is a pixel that something covers.
COVERED = 0.5
# Scene-linear values are clipped here, so that fireflies and suns do not outweigh the rest.
WHITE = 1.0


def main(file: str, way: str, folder: str, width: str, samples: str) -> None:
    """Open the file, make the image, print the figures."""
    scratch = Path(os.environ["BLENDER_USER_RESOURCES"]).parent
    enable_add_on(scratch)
    bpy.ops.wm.open_mainfile(filepath=file, load_ui=False)
    print(BEGINS, flush=True)
    figures = Case(Path(folder), scratch, int(width), int(samples)).figures(way)
    print(FIGURES + json.dumps(figures), flush=True)
    # Blender's own end takes seconds, and its faults are not the file's.
    sys.stdout.flush()
    os._exit(0)


class Case:
    """The scene of the open file, reduced to a small image of few samples."""

    def __init__(self, folder: Path, scratch: Path, width: int, samples: int) -> None:
        self.folder, self.scratch = folder, scratch
        self.scene = scene = bpy.context.scene
        render, cycles = scene.render, scene.cycles
        render.resolution_percentage = 100
        share = width / render.resolution_x
        render.resolution_x, render.resolution_y = width, max(round(render.resolution_y * share), 1)
        render.use_border = render.use_multiview = render.use_sequencer = render.use_compositing = False
        render.use_motion_blur = False
        cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = samples, False, False
        eye = scene.camera
        self.is_flexible = eye is not None and eye.scfpf.enabled
        if eye is not None:
            eye.scfpf.samples = samples

    def figures(self, way: str) -> dict[str, object]:
        """The figures of a way: seconds, and how its image differs from the ordinary camera's."""
        if self.scene.camera is None or self.scene.camera.type != "CAMERA":
            return {"outcome": "no camera"}
        return getattr(self, way)()

    def camera(self) -> dict[str, object]:
        """An ordinary Cycles camera: the image, its noise between two seeds, and what covers its pixels.

        No ordinary camera shows a volume that the file has already: the engine's image takes its place.
        """
        if self.is_flexible:
            return self.reference("SCFPF", "the engine's image: the file's camera is flexible")
        return self.reference("CYCLES", "")

    def reference(self, engine: str, outcome: str) -> dict[str, object]:
        """The image that the ways are compared with, by one engine."""
        self.scene.render.engine = engine
        self.scene.cycles.seed = 0
        image, seconds = self.rendered("camera")
        self.scene.cycles.seed = 1
        again, _ = self.rendered("camera_again")
        self.scene.render.film_transparent = True
        covered, _ = self.rendered("camera_covered")
        self.keep("camera", image)
        self.keep("camera_covered", covered)
        return {"seconds": seconds, **difference(image, again), "outcome": outcome}

    def engine(self) -> dict[str, object]:
        """F12 with the extension's own engine."""
        self.flexible_camera()
        self.scene.render.engine = "SCFPF"
        return self.compared("engine")

    def rig(self) -> dict[str, object]:
        """F12 by Cycles through the rig."""
        started = perf_counter()
        self.operator("cycles_rig", self.flexible_camera())
        making = perf_counter() - started
        self.scene.cycles.seed = 1
        figures = self.compared("rig")
        return {**figures, "outcome": f"set up in {making:.1f} s"}

    def live(self) -> dict[str, object]:
        """Live View: what covers each pixel. Its colours are those of Solid shading, as no camera renders."""
        camera = self.flexible_camera()
        view = importlib.import_module(f"{MODULE}.scfpf_addon.bridge.live.live_view").LiveView()
        size = self.scene.render.resolution_x, self.scene.render.resolution_y
        depsgraph = bpy.context.evaluated_depsgraph_get()
        started = perf_counter()
        image = view.refresh(depsgraph, camera, size)
        seconds = perf_counter() - started
        self.keep("live", image)
        # What is hidden in renders only, or in viewports only, differs by right.
        empty = self.empty_live_image(camera, size)
        covered = abs(image - empty).max(-1) > 0.0
        return {"seconds": seconds, **self.coverage(covered)}

    def empty_live_image(self, camera, size):
        """Live View's image of the same scene without its objects: the background."""
        view = importlib.import_module(f"{MODULE}.scfpf_addon.bridge.live.live_view").LiveView()
        for layer in self.scene.view_layers:
            for child in layer.layer_collection.children:
                child.exclude = True
        for thing in self.scene.collection.objects:
            thing.hide_viewport = thing != camera
        return view.refresh(bpy.context.evaluated_depsgraph_get(), camera, size)

    def nodes(self) -> dict[str, object]:
        """The nodes preview, drawn by Workbench through its own camera: what covers each pixel."""
        camera = self.flexible_camera()
        started = perf_counter()
        self.operator("preview_toggle", camera)
        data = importlib.import_module(f"{MODULE}.scfpf_addon.scanline.preview.preview_data")
        source = data.preview_of(camera, self.scene)
        if source is None:
            return {"outcome": "refused"}
        # A preview that no viewport shows computes nothing.
        data.set_asleep(source, False)
        drawn = bpy.data.scenes.new("Drawn")
        depsgraph = bpy.context.evaluated_depsgraph_get()
        for picture in data.pictures_of(source):
            mesh = bpy.data.meshes.new_from_object(picture.evaluated_get(depsgraph), depsgraph=depsgraph)
            still = bpy.data.objects.new("Still", mesh)
            still.matrix_world = picture.evaluated_get(depsgraph).matrix_world
            drawn.collection.objects.link(still)
        seconds = perf_counter() - started
        seen = source.scfpf_preview.view_camera
        eye = bpy.data.objects.new("Eye", seen.data)
        eye.matrix_world = seen.evaluated_get(depsgraph).matrix_world
        drawn.collection.objects.link(eye)
        drawn.camera, drawn.render.engine = eye, "BLENDER_WORKBENCH"
        for name in ("resolution_x", "resolution_y", "pixel_aspect_x", "pixel_aspect_y"):
            setattr(drawn.render, name, getattr(self.scene.render, name))
        drawn.render.film_transparent = True
        image, _ = self.rendered("nodes", drawn)
        self.keep("nodes", image)
        return {"seconds": seconds, **self.coverage(image[..., 3] > COVERED)}

    def flexible_camera(self):
        """The scene's camera, made flexible as by the button unless it is already."""
        camera = self.scene.camera
        if not self.is_flexible:
            self.operator("camera_from_camera", camera)
        return camera

    def operator(self, name: str, camera) -> None:
        """Call an operator of the extension for a camera; what it reports is printed by Blender."""
        with bpy.context.temp_override(active_object=camera, object=camera):
            getattr(bpy.ops.scfpf, name)()

    def rendered(self, name: str, scene=None):
        """Render a scene, the file's own by default; returns the image and the seconds that F12 took."""
        scene = scene or self.scene
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "IMAGE"
        settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
        scene.render.use_file_extension = True
        scene.render.filepath = str(self.scratch / name)
        started = perf_counter()
        bpy.ops.render.render(write_still=True, scene=scene.name)
        seconds = perf_counter() - started
        loaded = bpy.data.images.load(str(self.scratch / f"{name}.exr"))
        pixels = np.empty(len(loaded.pixels), np.float32)
        loaded.pixels.foreach_get(pixels)
        image = pixels.reshape(loaded.size[1], loaded.size[0], -1)
        bpy.data.images.remove(loaded)
        settings.file_format = "PNG"
        bpy.data.images["Render Result"].save_render(str(self.folder / f"{name}.png"), scene=scene)
        return image, seconds

    def keep(self, name: str, image) -> None:
        """Write an image for the comparisons of other ways."""
        np.save(self.folder / f"{name}.npy", image)

    def compared(self, name: str) -> dict[str, object]:
        """Render, and compare with the ordinary camera's image if there is one."""
        image, seconds = self.rendered(name)
        self.keep(name, image)
        camera = self.folder / "camera.npy"
        return {"seconds": seconds, **(difference(image, np.load(camera)) if camera.is_file() else {})}

    def coverage(self, covered) -> dict[str, object]:
        """The share of pixels that something covers in one of the two images only."""
        camera = self.folder / "camera_covered.npy"
        if not camera.is_file():
            return {}
        return {"coverage": float(np.mean(covered != (np.load(camera)[..., 3] > COVERED)))}


def difference(image, other) -> dict[str, object]:
    """The root mean square of the differences of two images, and the share of pixels that are off."""
    if image.shape[:2] != other.shape[:2]:
        sizes = " and ".join(f"{width} x {height}" for height, width in (image.shape[:2], other.shape[:2]))
        return {"outcome": f"the images have different sizes: {sizes}"}
    apart = np.abs(np.clip(image[..., :3], 0.0, WHITE) - np.clip(other[..., :3], 0.0, WHITE))
    return {"rmse": float(np.sqrt(np.mean(apart**2))), "off": float(np.mean(apart.max(-1) > OFF))}


if __name__ == "__main__":
    main(*sys.argv[-5:])
