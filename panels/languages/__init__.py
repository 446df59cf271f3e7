# SPDX-License-Identifier: GPL-3.0-or-later
"""Translations of the interface: a file LANGUAGE.po each, which Blender looks up by itself.

`python3 dev.py messages` writes their template, devtools/languages/scfpf.pot. A text that a file lacks stays
English.
"""

import ast
import pathlib

import bpy

FOLDER = pathlib.Path(__file__).resolve().parent
# Blender's contexts of texts without one, and of the texts of operators' buttons.
ANY, OPERATOR = "*", "Operator"
Messages = dict[tuple[str, str], str]


def read_po(text: str) -> Messages:
    """The translations of a .po file by (context, English text); its header and empty ones are left out."""
    found: Messages = {}
    entry: dict[str, str] = {}
    key = ""
    for line in [*text.splitlines(), 'msgid ""']:
        word, _, rest = line.partition(" ")
        if line.startswith('"'):
            entry[key] += ast.literal_eval(line)
        elif word in ("msgctxt", "msgid", "msgstr"):
            if "msgstr" in entry and word != "msgstr":
                if entry["msgid"] and entry["msgstr"]:
                    found[entry.get("msgctxt", ANY), entry["msgid"]] = entry["msgstr"]
                entry = {}
            key, entry[word] = word, ast.literal_eval(rest)
    return found


def languages() -> dict[str, Messages]:
    """The translations of each language of this folder."""
    return {path.stem: read_po(path.read_text(encoding="utf-8")) for path in FOLDER.glob("*.po")}


def as_blender_has_them(messages: Messages) -> Messages:
    """The translations in all forms in which Blender looks for them.

    Labels may be on operators' buttons, and Blender keeps the line breaks of operators' docstrings.
    """
    made = {(OPERATOR, text): translated for (_context, text), translated in messages.items()}
    made |= messages
    for operator in bpy.types.Operator.__subclasses__():
        text = operator.__doc__ or ""
        plain = ANY, " ".join(text.split())
        if "\n" in text and plain in messages:
            made[ANY, text] = messages[plain]
    return made


def register():
    made = {language: as_blender_has_them(messages) for language, messages in languages().items()}
    bpy.app.translations.register(__name__, made)


def unregister():
    bpy.app.translations.unregister(__name__)
