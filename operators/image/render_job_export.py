# SPDX-License-Identifier: GPL-3.0-or-later
"""Export a render job for a farm, for those who have no command line."""

import argparse
import json
import shutil
import subprocess
import tempfile
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, IntVectorProperty, StringProperty

from ...scfpf_addon.bridge.blender.rig_mark import camera_behind
from ...scfpf_addon.bridge.blender.user_errors import translated_report
from ...scfpf_addon.cycles.engine_choice import renders_by_cycles
from ...scfpf_addon.farm.render_job_files import plan_job, write_job, write_job_type
from ...scfpf_addon.projection.user_error import Message, UserError
from ..common.errors import refused
from ..common.modal_job import ModalJob, in_window
from ..common.tool import Action
from ..common.words import report_text

PRICE_CANCELED = "Price canceled: the render job stays without one"
WAY_ITEMS = (
    ("ENGINE", "Flexible Projection", "The engine Flexible Projection. Workers need the extension"),
    ("CYCLES", "Cycles", "Cycles through the rig in the file. Workers need no extension"),
    ("LAYERS", "Layers by Cycles", "Cycles with the image layers. Workers need the extension"),
    ("EEVEE", "EEVEE", "EEVEE's renders, joined. Workers need the extension and a graphics card"),
)


class SCFPF_OT_render_job_export(Action, bpy.types.Operator):
    """Write a folder from which a render farm makes the film: a job in the format of Open Job Description,
    and a job type for Flamenco"""

    bl_idname = "scfpf.render_job_export"
    bl_label = "Export Render Job"
    bl_options = {"REGISTER"}

    directory: StringProperty(name="Folder", description="The folder of the job", subtype="DIR_PATH")
    way: EnumProperty(name="Way", description="What renders the pictures", items=WAY_ITEMS)
    chunk: IntProperty(
        name="Frames per Task",
        description="Each task opens the file once; 0 for 5 frames, or 32 by EEVEE",
        default=0,
        min=0,
        soft_max=250,
    )
    tiles: IntVectorProperty(
        name="Tiles",
        description="Columns and rows that a huge picture is rendered in, and joined from",
        size=2,
        default=(1, 1),
        min=1,
        max=99,
    )
    extension: StringProperty(
        name="Extension",
        description="The extension's zip, which workers without it load for their task; empty for one of "
        "this version beside the file, if there is one",
        subtype="FILE_PATH",
    )
    resume: BoolProperty(name="Keep Pictures", description="Keep pictures that exist", default=False)
    price: BoolProperty(
        name="Tell Price",
        description="Let another Blender render a picture of the job, to tell the time of all and the memory",
        default=True,
    )

    @classmethod
    def poll(cls, context):
        camera = camera_behind(context.scene.camera)
        if camera is None or not camera.scfpf.enabled:
            cls.poll_message_set("Make a flexible camera the scene's camera first")
            return False
        return True

    def invoke(self, context, _event):
        if not self.properties.is_property_set("way"):
            camera = camera_behind(context.scene.camera)
            self.way = "CYCLES" if renders_by_cycles(context.scene, camera) else "ENGINE"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def act(self, context):
        if not self.directory:
            raise UserError("Choose a folder to write the job into")
        scene, way = context.scene, self.way.lower()
        camera = camera_behind(scene.camera)
        options = argparse.Namespace(
            way=way,
            frames=None,
            chunk=self.chunk or None,
            tiles=tuple(self.tiles),
            # Without the rig's own camera the other ways need the flexible one by its name.
            camera=camera.name if way != "cycles" and camera != scene.camera else "",
            resume=self.resume,
            blender="blender",
            extension=bpy.path.abspath(self.extension) if self.extension else None,
        )
        plan, warnings = plan_job(scene, options)
        folder = bpy.path.abspath(self.directory)
        write_job(plan, folder)
        write_job_type(folder)
        if bpy.data.is_dirty:
            warnings.append(
                Message("The job renders the file as it was saved last: save it, and export again")
            )
        for warning in warnings:
            self.report({"WARNING"}, translated_report(warning))
        if self.price and in_window(context):
            words = price_command(bpy.app.binary_path, plan.scene, folder, options)
            bpy.ops.scfpf.render_job_price("INVOKE_DEFAULT", command=json.dumps(words))
        return report_text(
            "The job is in {0}. Frames: {1}, tasks: {2}", folder, plan.frame_count, plan.task_count
        )


class SCFPF_OT_render_job_price(ModalJob, bpy.types.Operator):
    """Tell the price of a render job that was exported; Esc cancels, the job stays without a price"""

    bl_idname = "scfpf.render_job_price"
    bl_label = "Price of Render Job"
    bl_options = {"INTERNAL"}

    seconds = 0.25
    canceled = PRICE_CANCELED

    command: StringProperty(
        name="Command",
        description="The words of the command that writes the job with its price, as JSON",
        options={"SKIP_SAVE"},
    )

    def invoke(self, context, _event):
        folder = tempfile.mkdtemp(prefix="scfpf-")
        self._told = Path(folder, "told.txt")
        try:
            with self._told.open("wb") as file:
                self._process = subprocess.Popen(
                    json.loads(self.command), stdout=file, stderr=subprocess.STDOUT
                )
        except OSError as error:
            shutil.rmtree(folder, ignore_errors=True)
            return refused(self, UserError("Cannot start Blender to tell the price: {0}", error.strerror))
        outcome = self.begin(context)
        self.ends.callback(shutil.rmtree, folder, ignore_errors=True)
        self.show(context, report_text("Rendering a picture to tell the price of the job    Esc: cancel"))
        return outcome

    def respond(self, _context, _event):
        # The artist works on.
        return {"PASS_THROUGH"}

    def tick(self, _context):
        if self._process.poll() is None:
            return {"PASS_THROUGH"}
        told = self._told.read_text(encoding="utf-8", errors="replace")
        lines = told_lines(told)
        if self._process.returncode != 0 or not lines:
            raise UserError("The price of the job cannot be told: {0}", (told.splitlines() or ["-"])[-1])
        for line in lines:
            self.report({"INFO"}, line)
        return {"FINISHED"}

    def give_up(self, _context):
        """End the other Blender, which writes the job when it is done."""
        self._process.kill()
        self._process.wait()


def price_command(blender: str, scene_file: str, folder: str, options: argparse.Namespace) -> list[str]:
    """The words of a command that writes a job and prints its price. options: see ``plan_job``."""
    words = [blender, "--background", "--command", "scfpf", "job", scene_file, f"--output={folder}"]
    words += [f"--way={options.way}", f"--tiles={options.tiles[0]}x{options.tiles[1]}"]
    given = {"chunk": options.chunk, "camera": options.camera, "extension": options.extension}
    words += [f"--{name}={value}" for name, value in given.items() if value]
    return [*words, "--resume"] if options.resume else words


def told_lines(text: str) -> list[str]:
    """The lines of a job's needs and price, in what the command has printed."""
    lines = [line.removeprefix("scfpf: ") for line in text.splitlines() if line.startswith("scfpf: ")]
    # Blender shows the last report longest.
    marks = "A worker needs", "on one machine as this"
    return [line for mark in marks for line in lines if mark in line]


CLASSES = (SCFPF_OT_render_job_export, SCFPF_OT_render_job_price)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
