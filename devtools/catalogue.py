# SPDX-License-Identifier: GPL-3.0-or-later
"""The catalogue of texts that translations of the interface are made of: devtools/languages/scfpf.pot.

`python3 dev.py messages` writes it, under a Python that has bpy. A text is (context, English): names of
operators have Blender's context "Operator", all others "*".
"""

from __future__ import annotations

import ast
import json
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TEMPLATE = ROOT / "devtools" / "languages" / "scfpf.pot"
HEAD = """# Texts of Flexible Projection's interface. `python3 dev.py messages` writes this file.
# SPDX-License-Identifier: GPL-3.0-or-later
msgid ""
msgstr ""
"Content-Type: text/plain; charset=UTF-8\\n"
"""
# Functions whose text arguments are shown.
SHOWING = {"report_text", "label_text", "draw_text", "report", "poll_message_set", "Message"}
# Methods that return a message.
TELLING = {"act", "edit"}
Text = tuple[str, str]
# Places of values alone, and icons, whose names are in capitals.
NO_TEXT = re.compile(r"([ .:()]|\{\d\})*|[A-Z0-9_]{2,}")
ANY, OPERATOR = "*", "Operator"


def catalogue(module: str) -> list[Text]:
    """All texts, sorted. module: the name of the enabled extension's package."""
    found = {*registered(module), *((ANY, text) for text in (*written(), *raised(), *presets()))}
    # A docstring's line breaks depend on Python.
    plain = {(context, " ".join(text.split()) if "\n" in text else text) for context, text in found}
    kept = (text for text in plain if not NO_TEXT.fullmatch(text[1]))
    return sorted(kept, key=lambda text: (text[1], text[0]))


def registered(module: str) -> Iterator[Text]:
    """The texts of the classes that the extension has registered with Blender."""
    import bpy

    kinds = ("Panel", "Menu", "Operator", "PropertyGroup", "UIList", "RenderEngine")
    for kind in kinds:
        base = getattr(bpy.types, kind)
        inherited = set(base.bl_rna.properties.keys())
        for cls in _subclasses(base):
            if not cls.__module__.startswith(module) or not getattr(cls, "is_registered", True):
                continue
            if kind == "Operator":
                group, name = cls.bl_idname.split(".")
                rna = getattr(getattr(bpy.ops, group), name).get_rna_type()
                yield OPERATOR, rna.name
                yield ANY, rna.description
            else:
                rna = cls.bl_rna
                yield ANY, getattr(cls, "bl_label", "")
            for prop in rna.properties:
                if prop.identifier not in inherited:
                    yield from _of_property(prop)


def _subclasses(base: type) -> Iterator[type]:
    for cls in base.__subclasses__():
        yield cls
        yield from _subclasses(cls)


def _of_property(prop) -> Iterator[Text]:
    yield ANY, prop.name
    yield ANY, prop.description
    if prop.type == "ENUM":
        for item in prop.enum_items_static:
            yield ANY, item.name
            yield ANY, item.description


def written() -> Iterator[str]:
    """The texts that the code of operators and panels shows, messages and labels."""
    for folder in ("operators", "panels"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            if path.parent.name == "languages":
                continue
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                yield from _shown_by(node)


def presets() -> Iterator[str]:
    """The names and descriptions of the shipped presets."""
    for path in sorted((ROOT / "presets").glob("*.json")):
        preset = json.loads(path.read_text(encoding="utf-8"))
        yield from (preset["name"], preset["description"])


@cache
def raised() -> tuple[str, ...]:
    """The texts of messages, and those of errors that are derived from UserError."""
    return tuple(_raised())


def _raised() -> Iterator[str]:
    paths = sorted((ROOT / "scfpf_addon").rglob("*.py"))
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in paths]
    kinds = {"Message", "UserError"}
    nodes = [list(ast.walk(tree)) for tree in trees]
    classes = [node for each in nodes for node in each if isinstance(node, ast.ClassDef)]
    bases = {node.name: set(map(ast.unparse, node.bases)) for node in classes}
    while more := {name for name in bases if bases[name] & kinds} - kinds:
        kinds |= more
    for tree, each in zip(trees, nodes, strict=True):
        assigned = [node for node in tree.body if isinstance(node, ast.Assign)]
        named = {ast.unparse(node.targets[0]): node.value for node in assigned}
        for node in each:
            if isinstance(node, ast.Call) and ast.unparse(node.func) in kinds and node.args:
                template = node.args[0]
                yield from _constants(named.get(ast.unparse(template), template))


def _shown_by(node: ast.AST) -> Iterator[str]:
    """The texts that one node of a syntax tree shows."""
    if isinstance(node, ast.Call):
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if called in SHOWING or called.endswith("Error"):
            for argument in node.args:
                yield from _constants(argument)
        for keyword in node.keywords:
            if keyword.arg == "text":
                yield from _constants(keyword.value)
    elif isinstance(node, ast.FunctionDef) and node.name in TELLING:
        for inner in ast.walk(node):
            if isinstance(inner, ast.Return) and inner.value is not None:
                yield from _constants(inner.value)
    elif isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "").isupper():
        # Tables and sentences of a module that its panels draw.
        yield from (text for text in _constants(node.value) if " " in text)


def _constants(node: ast.AST) -> Iterator[str]:
    """The texts of an expression, those of both branches of a condition too."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from _constants(node.body)
        yield from _constants(node.orelse)
    elif isinstance(node, (ast.Tuple, ast.List)):
        for part in node.elts:
            yield from _constants(part)
    elif isinstance(node, ast.Dict):
        for part in node.values:
            yield from _constants(part)


def quoted(text: str) -> str:
    """A text as a string of a .po file."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'


def page(texts: list[Text]) -> str:
    """The catalogue as a .pot file."""
    lines = [HEAD]
    for context, text in texts:
        if context != ANY:
            lines.append(f"msgctxt {quoted(context)}")
        lines += [f"msgid {quoted(text)}", 'msgstr ""', ""]
    return "\n".join(lines)


def main() -> None:
    from demo.render_demo import MODULE, enable_add_on, scratch_profile

    with scratch_profile() as scratch:
        enable_add_on(scratch)
        texts = catalogue(MODULE)
    TEMPLATE.write_text(page(texts), encoding="utf-8")
    print(f"{TEMPLATE.relative_to(ROOT)}: {len(texts)} texts", flush=True)


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    main()
