# SPDX-License-Identifier: GPL-3.0-or-later
"""A layout that records what panels and menus draw, and checks that what they name exists."""

import bpy


class RecordingLayout:
    """Stands for a UILayout: checks that each property, operator and menu exists, and notes it."""

    CONTAINERS = ("row", "column", "box", "split")

    def __init__(self, record=None):
        self.record = [] if record is None else record

    def __getattr__(self, name):
        if name in self.CONTAINERS:
            return lambda **_options: type(self)(self.record)
        if name.startswith("template_"):
            return lambda *_owner, **_options: self.record.append(("template", name))
        raise AttributeError(name)

    def prop(self, owner, name, text=None, **_options):
        owner.path_resolve(name)
        self.record.append(("prop", type(owner).__name__, name, text))

    def operator(self, idname, **_options):
        module, name = idname.split(".")
        operator = getattr(getattr(bpy.ops, module), name)
        known = operator.get_rna_type().properties
        self.record.append(("operator", idname))

        class Properties:
            def __setattr__(self, name, value):
                assert name in known, f"{idname} has no property {name}"

        return Properties()

    def panel(self, _idname, **_options):
        return type(self)(self.record), type(self)(self.record)

    def operator_menu_enum(self, idname, prop, **options):
        properties = self.operator(idname, **options)
        setattr(properties, prop, None)
        return properties

    def menu(self, idname, **_options):
        assert hasattr(bpy.types, idname), idname
        self.record.append(("menu", idname))

    def template_list(self, kind, _identifier, owner, collection, active_owner, active, **_options):
        assert hasattr(bpy.types, kind)
        assert len(getattr(owner, collection)) >= 0
        assert isinstance(getattr(active_owner, active), int)
        self.record.append(("list", kind))

    def label(self, text="", **_options):
        self.record.append(("label", text))

    def popover(self, panel, text="", **_options):
        assert hasattr(bpy.types, panel), panel
        self.record.append(("popover", panel))

    def progress(self, factor, text):
        assert 0 <= factor <= 1
        self.record.append(("progress", text))

    def icon(self, datablock):
        assert isinstance(datablock, bpy.types.ID)
        return 1

    def separator(self, **_options):
        pass


class NamingLayout(RecordingLayout):
    """A layout that records the words that a user reads on buttons and menus, as labels.

    A button with an icon alone has its name in its tooltip.
    """

    def operator(self, idname, text=None, **options):
        self.record.append(("label", text or self._name_of(idname)))
        return super().operator(idname, **options)

    def menu(self, idname, text=None, **options):
        self.record.append(("label", getattr(bpy.types, idname).bl_label if text is None else text))
        super().menu(idname, **options)

    def prop(self, owner, name, text=None, **options):
        self.record.append(("label", owner.bl_rna.properties[name].name if text is None else text))
        super().prop(owner, name, text, **options)

    @staticmethod
    def _name_of(idname):
        module, name = idname.split(".")
        return getattr(getattr(bpy.ops, module), name).get_rna_type().name


class FakePanel:
    """A panel's Python side without Blender's."""

    def __init__(self, cls, layout=None):
        self.cls, self.layout = cls, layout or RecordingLayout()

    def __getattr__(self, name):
        found = getattr(self.cls, name)
        return found.__get__(self) if callable(found) else found


def drawn(cls, context=None):
    """Return the record of a panel's or a menu's drawing."""
    panel = FakePanel(cls)
    panel.draw(context or bpy.context)
    return panel.layout.record


def texts(record):
    return " ".join(entry[1] for entry in record if entry[0] == "label")


def read_words(addon, panel=None):
    """The words on all buttons, menus and labels that the sidebar's panels and the menus show at present.

    panel: the title of the only panel to read, without menus.
    """
    layout, menus = NamingLayout(), addon("panels.menus")
    for name in dir(bpy.types):
        cls = getattr(bpy.types, name)
        is_panel = name.startswith("SCFPF_PT_view") and cls.poll(bpy.context)
        if is_panel and panel in (None, cls.bl_label):
            layout.label(text=cls.bl_label)
        if (is_panel and panel in (None, cls.bl_label)) or (name.startswith("SCFPF_MT_") and panel is None):
            FakePanel(cls, layout).draw(bpy.context)
    entries = (menus._camera_entries, menus._surface_entries, menus._duplicate_entry)
    entries += (addon("panels.render_job").draw_export,)
    for draw in entries if panel is None else ():
        draw(FakePanel(menus.SCFPF_MT_surface_add, layout), bpy.context)
    return {entry[1].removesuffix("...") for entry in layout.record if entry[0] == "label"}
