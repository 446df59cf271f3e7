# SPDX-License-Identifier: GPL-3.0-or-later
"""Export a render job for a farm, for those who have no command line."""

import argparse

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, IntVectorProperty, StringProperty

from ...scfpf_addon.bridge.blender.rig_mark import camera_behind
from ...scfpf_addon.bridge.blender.user_errors import translated_report
from ...scfpf_addon.cycles.engine_choice import renders_by_cycles
from ...scfpf_addon.farm.render_job_files import plan_job, write_job, write_job_type
from ...scfpf_addon.projection.user_error import Message, UserError
from ..common.tool import Action
from ..common.words import report_text

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
        return report_text(
            "The job is in {0}. Frames: {1}, tasks: {2}", folder, plan.frame_count, plan.task_count
        )


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_render_job_export,))
