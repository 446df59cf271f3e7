import bpy
from driver import DRAW
from scenarios_engine import ended, prepare


def lightpanels(driver):
    prepare(driver)
    bpy.ops.object.light_add(type="AREA", location=(2, 2, 4))
    for panel in ("SCFPF_PT_engine_film", "SCFPF_PT_engine_filter"):
        cls = getattr(bpy.types, panel)
        bpy.utils.unregister_class(cls)
        cls.bl_options = set()
        bpy.utils.register_class(cls)
    bpy.utils.unregister_class(bpy.types.SCFPF_PT_engine_passes)
    driver.area("VIEW_3D").type = "PROPERTIES"
    yield DRAW
    spaces = [a for a in driver.window.screen.areas if a.type == "PROPERTIES"]
    spaces[0].spaces.active.context = "VIEW_LAYER"
    spaces[1].spaces.active.context = "DATA"
    yield DRAW
    driver.shot("layer_and_lamp")
    spaces[0].spaces.active.context = "RENDER"
    yield DRAW
    driver.shot("render_tab")


def dark(driver):
    prepare(driver, "perspective")
    for o in list(bpy.data.objects):
        if o.type == "LIGHT":
            bpy.data.objects.remove(o)
    bpy.context.scene.world = None
    m = bpy.data.materials.new("Glow")
    m.use_nodes = True
    m.node_tree.nodes["Principled BSDF"].inputs["Emission Strength"].default_value = 3
    next(o for o in bpy.data.objects if o.type == "MESH").data.materials.append(m)
    driver.key("F12")
    yield 1.0
    yield from ended()
    driver.shot("dark")


SCENARIOS = (lightpanels, dark)
