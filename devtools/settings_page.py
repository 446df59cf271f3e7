# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/settings.md: every setting and button with its tooltip, read from the code without running it."""

from __future__ import annotations

import ast
import pathlib
from collections.abc import Iterator

from .environments import ROOT

PAGE = ROOT / "docs" / "settings.md"
BRIDGE = ROOT / "scfpf_addon" / "bridge"
HEAD = """# Settings and buttons

This page lists every setting and button with its tooltip. The [guide](guide.md) explains how to use them.
Where a panel shows a shorter name, the full name is in brackets. `python3 dev.py pictures` writes this page
from the code.
"""
# Titles, and the property groups below each: file and class.
GROUPS = (
    (
        "The panel Flexible Projection",
        tuple(("settings/camera_properties", name) for name in ("SCFPF_CameraSettings", "_Display")),
    ),
    (
        "A control surface",
        tuple(("settings/camera_properties", f"SCFPF_Surface{name}") for name in ("Slot", "Settings")),
    ),
    (
        "A blend",
        (
            *(("settings/camera_properties", f"SCFPF_Blend{name}") for name in ("Ends", "Further")),
            ("settings/blend_properties", "SCFPF_BlendMap"),
        ),
    ),
    ("Image Mappings", (("settings/mapping_properties", "SCFPF_ImageMapping"),)),
    ("Aim", tuple(("settings/aim_properties", f"SCFPF_Aim{name}") for name in ("", "Target"))),
    ("Layers", (("settings/layer_properties", "SCFPF_ImageLayer"),)),
    ("Look Behind", (("settings/hidden_properties", "SCFPF_HiddenThing"),)),
    ("Sampling, Film, Motion Blur", (("settings/sampling", "SCFPF_Sampling"),)),
    ("Passes", (("render/render_passes", "SCFPF_ViewLayer"),)),
    ("Drawn Style", (("settings/stylised_properties", "SCFPF_Drawn"),)),
)
SIZES = (
    (ROOT / "scfpf_addon" / "projection" / "surfaces" / "kinds.py", "Parameter", 1),
    (BRIDGE / "surfaces" / "kinds.py", "Input", 5),
)
# Settings whose choices are in tables of the guide.
CHOICES_IN_GUIDE = {"basis", "reparameterisation", "kind"}
Row = tuple[str, str]


def page() -> str:
    """The text of the page."""
    shown, labels = interface()
    lines = [HEAD]
    for title, groups in GROUPS:
        rows: list[Row] = []
        for stem, name in groups:
            module = parsed(BRIDGE / f"{stem}.py")
            rows += [row for key, row in settings(module, classes(module)[name], labels) if key in shown]
        if title == "A control surface":
            rows += sizes()
        lines += table(title, "setting", rows)
    lines += table("Buttons and menu entries", "button", buttons(labels))
    return "\n".join(lines)


def table(title: str, kind: str, rows: list[Row]) -> list[str]:
    """A heading and a table."""
    cells = [f"| {name} | {text} |" for name, text in ((n, t.replace("|", "\\|")) for n, t in rows)]
    return [f"## {title}", "", f"| {kind} | what it does |", "|---|---|", *cells, ""]


def parsed(path: pathlib.Path) -> ast.Module:
    """The syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


def classes(tree: ast.Module) -> dict[str, ast.ClassDef]:
    """The classes of a module by name."""
    return {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}


def texts(tree: ast.AST) -> dict[str, object]:
    """The constants of a module, those in its functions too."""
    found: dict[str, object] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            try:
                found[node.targets[0].id] = ast.literal_eval(node.value)
            except ValueError:
                continue  # not a constant
    return found


def value(node: ast.expr | None, known: dict[str, object]) -> object:
    """The value of an expression of constants; None for any other expression."""
    if isinstance(node, ast.Name):
        return known.get(node.id)
    if isinstance(node, ast.JoinedStr):
        parts = [part.value if isinstance(part, ast.FormattedValue) else part for part in node.values]
        made = [value(part, known) for part in parts]
        return None if None in made else "".join(map(str, made))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "format":
        return str(value(node.func.value, known)).format(*(value(one, known) for one in node.args))
    try:
        return None if node is None else ast.literal_eval(node)
    except ValueError:
        return None


def argument(call: ast.Call, name: str, place: int) -> ast.expr | None:
    """An argument by its name, else by its position."""
    named = {keyword.arg: keyword.value for keyword in call.keywords}
    return named.get(name, call.args[place] if len(call.args) > place else None)


def interface() -> tuple[set[str], dict[str, str]]:
    """The identifiers that panels name, and the short labels that they give to settings and buttons."""
    shown = {"u_range", "v_range"}
    labels: dict[str, str] = {}
    # Panels name kinds of lines and passes by tables of these modules.
    tables = BRIDGE / "settings" / "stylised_properties.py", BRIDGE / "render" / "render_passes.py"
    for path in (*sorted((ROOT / "panels").glob("*.py")), *tables):
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                shown.add(node.value)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                place = {"prop": 1, "operator": 0}.get(node.func.attr)
                identifier = None if place is None else value(argument(node, "property", place), {})
                text = value(argument(node, "text", 99), {})
                if isinstance(identifier, str) and isinstance(text, str) and text:
                    labels.setdefault(identifier, text)
    return shown - {
        "active_surface",
        "active_mapping",
        "active_aim",
        "active_layer",
        "aim",
        "aim_targets",
        "layers",
        "statistics",
    }, labels


def settings(tree: ast.Module, owner: ast.ClassDef, labels: dict[str, str]) -> Iterator[tuple[str, Row]]:
    """Identifier, name and tooltip of a class's properties, with the choices of each."""
    known = texts(tree)
    for node in owner.body:
        if not isinstance(node, ast.AnnAssign) or not isinstance(node.annotation, ast.Call):
            continue
        call, key = node.annotation, ast.unparse(node.target)
        name, text = (value(argument(call, *one), known) for one in (("name", 0), ("description", 1)))
        if name is None or text is None:
            continue
        items = None if key in CHOICES_IN_GUIDE else value(argument(call, "items", 99), known)
        choices = "".join(f"<br>*{title}*: {what}" for _, title, what in items or ())
        yield key, (titled(str(name), labels.get(key)), f"{text}{choices}")


def titled(name: str, label: str | None) -> str:
    """A name as a panel shows it."""
    label = (label or name).removesuffix("...")
    return f"*{label}* ({name})" if label != name else f"*{name}*"


def sizes() -> Iterator[Row]:
    """Each size of control surfaces once, with its tooltip."""
    found = {}
    for path, call, place in SIZES:
        tree = parsed(path)
        known = texts(tree)
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == call:
                name = value(argument(node, "label", 0), known)
                text = value(argument(node, "description", place), known)
                if isinstance(name, str) and isinstance(text, str):
                    found.setdefault((name.replace("_", " ").title(), text), None)
    for label, text in found:
        yield f"*{label}*", text


def buttons(labels: dict[str, str]) -> list[Row]:
    """Every operator with its tooltip and its own settings, in alphabetical order."""
    modules = [parsed(path) for path in sorted((ROOT / "operators").rglob("*.py"))]
    owners = {name: (owner, tree) for tree in modules for name, owner in classes(tree).items()}
    rows = []
    for owner, _ in owners.values():
        known = texts(owner)
        if "bl_idname" not in known:
            continue
        bases = [base.id for base in owner.bases if isinstance(base, ast.Name) and base.id in owners]
        whose = [owners[name] for name in (owner.name, *bases)]
        parts = [row for cls, tree in whose for row in settings(tree, cls, {})]
        own = "".join(f"<br>{name}: {text}" for _, (name, text) in parts)
        text = " ".join((ast.get_docstring(owner) or "").split())
        rows.append((titled(str(known["bl_label"]), labels.get(str(known["bl_idname"]))), f"{text}{own}"))
    return sorted(rows, key=lambda row: row[0].lower())
