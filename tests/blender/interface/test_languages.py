# SPDX-License-Identifier: GPL-3.0-or-later
"""Translations: every text exists in the interface, values have their places, Blender is given all of them.

Blender as a Python module has no languages to switch to; tests/window does that.
"""

import string
from types import SimpleNamespace

import bpy
import pytest

from devtools import catalogue

MODULE = "bl_ext.checkout.scfpf"


class NamingLayout:
    """A layout that keeps the texts of its operators, and whether Blender may translate them."""

    def __init__(self):
        self.names, self.translates = [], set()

    def row(self):
        return self

    column = row

    def operator(self, _operator, text="", translate=True, icon=""):
        self.names.append(text)
        self.translates.add(translate)
        return SimpleNamespace()

    def __getattr__(self, name):
        return lambda *_, **__: SimpleNamespace()


@pytest.fixture
def languages(addon):
    return addon("panels.languages")


@pytest.fixture(scope="module")
def texts():
    return catalogue.catalogue(MODULE)


def places(text):
    """The places of values in a template, sorted, with their formats."""
    return sorted((name, form) for _, name, form, _ in string.Formatter().parse(text) if name is not None)


def test_the_template_is_that_of_the_code(texts):
    assert catalogue.TEMPLATE.read_text(encoding="utf-8") == catalogue.page(texts), (
        "python3 dev.py messages writes it anew"
    )
    assert len(texts) > 900 and all(text == text.strip("\n") for _, text in texts)


def test_translated_texts_exist_and_their_values_have_places(languages, texts):
    found = languages.languages()
    assert "de" in found
    for language, messages in found.items():
        assert not set(messages) - set(texts), language
        for (_, english), translated in messages.items():
            if "{" in english and "}" in english:
                assert places(english) == places(translated), english
            assert english.startswith(" ") == translated.startswith(" "), english
            assert english.endswith(("...", ":")) == translated.endswith(("...", ":")), english


def test_german_has_every_panel_menu_operator_and_setting_of_a_camera(languages, texts):
    german = languages.languages()["de"]
    wanted = {text for text in texts if text[0] == catalogue.OPERATOR}
    hidden = {
        cls.bl_label
        for cls in bpy.types.Operator.__subclasses__()
        if cls.__module__.startswith(MODULE) and "INTERNAL" in getattr(cls, "bl_options", ())
    }
    wanted = {text for text in wanted if text[1] not in hidden}
    for kind in (bpy.types.Panel, bpy.types.Menu):
        for cls in kind.__subclasses__():
            if cls.__module__.startswith(MODULE) and getattr(cls, "bl_label", ""):
                wanted.add((catalogue.ANY, cls.bl_label))
    for group in ("SCFPF_SurfaceSettings", "SCFPF_BlendEnds", "SCFPF_BlendFurther", "SCFPF_BlendMap"):
        for prop in bpy.types.PropertyGroup.bl_rna_get_subclass_py(group).bl_rna.properties:
            if prop.identifier not in ("rna_type", "name"):
                wanted |= {(catalogue.ANY, prop.name), (catalogue.ANY, prop.description)}
    assert not (wanted & set(texts)) - set(german)


def test_german_has_every_shipped_preset(languages):
    german = languages.languages()["de"]
    told = list(catalogue.presets())
    assert len(told) > 100 and not set(told) - {text for context, text in german if context == catalogue.ANY}
    names = [german[catalogue.ANY, name] for name in told[::2]]
    assert len(set(names)) == len(names), "two presets have one name"


def test_menus_and_tooltips_show_presets_in_the_language_of_the_interface(addon, languages, monkeypatch):
    """Entries are in the order of the translated names; names that artists gave stay as they are."""
    german = {text: shown for (_context, text), shown in languages.languages()["de"].items()}

    def translate(text, *_):
        return german.get(text, text)

    menus, tool = addon("panels.preset_menus"), addon("operators.common.tool")
    monkeypatch.setattr(menus, "pgettext_iface", translate)
    monkeypatch.setattr(tool, "pgettext_tip", translate)
    shown = []
    for menu in menus.APPLY_MENUS:
        layout = NamingLayout()
        menu.draw(SimpleNamespace(layout=layout), bpy.context)
        names = [translate(name) for name in layout.names]
        assert names == sorted(names) and layout.translates == {True}
        shown += names
    assert {"Umgekehrte Perspektive", "Militärprojektion", "Kugelpanorama"} <= set(shown)
    monkeypatch.setattr(menus, "own_presets", lambda: [("mine", "Perspective", "")])
    for menu in (menus.SCFPF_MT_presets_own, menus.SCFPF_MT_presets_remove):
        layout = NamingLayout()
        menu.draw(SimpleNamespace(layout=layout), bpy.context)
        assert "Perspective" in layout.names and False in layout.translates
    described = tool.tooltip_of(
        bpy.types.SCFPF_OT_preset_apply, addon("operators.camera.presets").preset_items(), "panini"
    )
    assert described.startswith("150 Grad Breite")


def test_blender_is_given_the_translations_and_loses_them(languages, monkeypatch):
    """Operators' tooltips are found with the line breaks that Blender keeps of their docstrings."""
    given = {}
    translations = SimpleNamespace(register=given.__setitem__, unregister=given.pop)
    monkeypatch.setattr(
        languages, "bpy", SimpleNamespace(types=bpy.types, app=SimpleNamespace(translations=translations))
    )
    languages.register()
    (german,) = [found["de"] for found in given.values()]
    assert german["Operator", "Add Flexible Camera"] == "Flexible Kamera hinzufügen"
    languages.unregister()
    assert not given
    text = bpy.types.SCFPF_OT_view_live.__doc__
    assert "\n" in text
    made = languages.as_blender_has_them({("*", " ".join(text.split())): "Live"})
    assert made["*", text] == "Live"


def test_a_po_file_is_read_with_contexts_and_continued_lines(languages):
    text = 'msgid ""\nmsgstr ""\n"X: Y\\n"\n\nmsgctxt "Operator"\nmsgid "Add"\nmsgstr "Hin"\n"zu"\n\n'
    text += 'msgid "Say \\"{0}\\""\nmsgstr "„{0}“ sagen"\n\nmsgid "Not yet"\nmsgstr ""\n'
    assert languages.read_po(text) == {("Operator", "Add"): "Hinzu", ("*", 'Say "{0}"'): "„{0}“ sagen"}


def test_messages_put_values_into_translated_templates(addon, monkeypatch):
    words, errors = addon("operators.common.words"), addon("bridge.blender.user_errors")
    german = {"'{0}' is not a view: choose one": "Eine Ansicht wählen: '{0}' ist keine"}
    monkeypatch.setattr(errors.translated_report, "__defaults__", (lambda text: german.get(text, text),))
    assert (
        words.report_text("'{0}' is not a view: choose one", "Pin") == "Eine Ansicht wählen: 'Pin' ist keine"
    )
    assert words.report_text("{0:.1f} px", 1.25) == "1.2 px"


def test_errors_of_the_core_are_translated_with_the_messages_inside_them(addon):
    words, template = addon("operators.common.words"), addon("projection.user_error")
    texts = {"Layer '{0}': {1}": "Ebene '{0}': {1}", "{0} {{}}": "{0} Klammern", "{no} value": "{kein} Wert"}

    def german(message):
        return words.translated_report(message, lambda text: texts.get(text, text))

    for kind in (template.UserError, template.Message):
        inner = kind("{0} {{}}", 3)
        error = template.UserError("Layer '{0}': {1}", "Car", inner)
        assert str(error) == "Layer 'Car': 3 {}"
        assert german(error) == german(template.UserError(error.message)) == "Ebene 'Car': 3 Klammern"
        assert german(kind("{no} value")) == "{kein} Wert"
    assert german("{no} value") == "{kein} Wert"
    assert words.translated_report(MemoryError()).startswith("There is not enough memory")


def test_german_has_every_message_of_errors(languages):
    german = languages.languages()["de"]
    told = {text for text in catalogue.raised() if not catalogue.NO_TEXT.fullmatch(text)}
    assert len(told) > 250 and not told - {text for _, text in german}
