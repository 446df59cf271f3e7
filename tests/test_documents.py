# SPDX-License-Identifier: GPL-3.0-or-later
"""The documents show what there is: pictures that exist, every preset, messages in the code's own words."""

import ast
import functools
import json
import pathlib
import re

import pytest

from demo.compositions.make import COMPOSITIONS
from demo.recipes import pages as recipes
from devtools import pictures, settings_page
from scfpf_addon.projection.surfaces.kinds import SURFACE_KINDS
from tests.british import british

ROOT = pathlib.Path(__file__).resolve().parents[1]
PAGES = (ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md")))
DECISIONS = [path for path in PAGES if path.parent.name == "decisions" and path.name != "README.md"]
# The most words of a page, its tables and code aside.
MOST_WORDS = {"README.md": 900, "architecture.md": 2000, "performance.md": 800, "accuracy.md": 1000}
GUIDE = ROOT / "docs" / "guide.md"
CODE = ("scfpf_addon", "operators", "panels")
# Keys of preset files and of node groups in saved files, which stay as they are.
KEYS = {"subject: centre", "Disc"}


def links(text):
    """The links and images of a page, without addresses of the web and places in the page itself."""
    found = re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r'<img src="([^"]+)"', text)
    return [link for link in found if "://" not in link and not link.startswith("#")]


def anchors(text):
    """The places of a page that can be linked to, as GitHub names them."""
    titles = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def words(text):
    """The number of words of a page without its tables and indented code."""
    lines = [line for line in text.splitlines() if not line.startswith(("|", "    "))]
    return len(" ".join(lines).split())


@pytest.mark.parametrize("name", MOST_WORDS)
def test_pages_are_short(name):
    (page,) = (path for path in PAGES if path.name == name and path.parent in (ROOT, ROOT / "docs"))
    assert words(page.read_text(encoding="utf-8")) <= MOST_WORDS[name]


def test_decisions_are_few_and_say_why():
    assert 20 <= len(DECISIONS) <= 33
    for path in DECISIONS:
        text = path.read_text(encoding="utf-8")
        assert 100 <= words(text) <= 200, path.name
        assert re.search(r"^\d{4}-\d\d-\d\d$", text, re.MULTILINE), f"{path.name} has no date"
        for part in ("Context", "Decision", "Consequence"):
            assert f"**{part}.**" in text, path.name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_is_linked_is_there(page):
    text = page.read_text(encoding="utf-8")
    for link in links(text):
        name, _, place = link.partition("#")
        path = (page.parent / name).resolve()
        assert path.exists(), f"{page.name} links to {link}"
        assert not place or place in anchors(path.read_text(encoding="utf-8")), f"{page.name}: {link}"
    for place in re.findall(r"\]\(#([^)]+)\)", text):
        assert place in anchors(text), f"{page.name} has no #{place}"


def test_pictures_are_shown_and_small():
    shown = {link for page in PAGES for link in links(page.read_text(encoding="utf-8"))}
    for path in (ROOT / "docs" / "pictures").iterdir():
        assert any(link.endswith(f"pictures/{path.name}") for link in shown), f"{path.name} is shown nowhere"
        most = pictures.LARGEST_MOVING_BYTES if path.suffix == ".webp" else pictures.LARGEST_BYTES
        assert path.stat().st_size <= most, path.name


def test_showpieces_are_shown_and_not_heavy():
    """Large pictures, of which the README has some."""
    text = (ROOT / "docs" / "showpieces.md").read_text(encoding="utf-8")
    found = sorted((ROOT / "docs" / "showpieces").iterdir())
    assert len(found) >= 3
    for path in found:
        most = pictures.LARGEST_MOVING_BYTES if path.suffix == ".webp" else 600_000
        assert f"showpieces/{path.name}" in text and path.stat().st_size <= most, path.name


def test_compositions_are_shown_and_small():
    text = (ROOT / "docs" / "compositions.md").read_text(encoding="utf-8")
    folder = ROOT / "docs" / "compositions"
    assert {path.name for path in folder.iterdir()} == {f"{name}.jpg" for name in COMPOSITIONS}
    for path in folder.iterdir():
        assert f"compositions/{path.name}" in text and path.stat().st_size <= 150_000, path.name


def test_recipes_are_those_of_the_steps_that_tests_perform():
    """Their pictures come first, and gallery and README lead to them."""
    found = {path.name: path.read_text(encoding="utf-8") for path in recipes.FOLDER.glob("*.md")}
    assert found == recipes.pages(), "python3 dev.py recipes writes them anew"
    images = {path.name for path in recipes.FOLDER.iterdir()} - set(found)
    jobs = [text for name, text in found.items() if name != "README.md"]
    assert images == {links(text)[0] for text in jobs}
    assert all(text.splitlines()[2].startswith("![") for text in jobs)
    for name in images:
        assert (recipes.FOLDER / name).stat().st_size <= pictures.LARGEST_BYTES, name
    gallery = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    plates, _, _ = gallery.partition("## Rendered with Cycles")
    assert plates.count("[Recipe](recipes/") == plates.count("\n### ")
    assert "docs/recipes/README.md" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_page_of_presets_is_that_of_the_files():
    page = pictures.PAGE.read_text(encoding="utf-8")
    assert page == pictures.presets_page(), "python3 dev.py pictures writes it anew"
    stems = {path.stem for path in (ROOT / "presets").glob("*.json")}
    assert set(re.findall(r"thumbnails/(\w+)\.png", page)) == stems


@functools.cache
def texts(path):
    """The syntax tree's nodes with texts of a file: strings, f-strings, and expressions that stand alone."""
    kinds = ast.Constant, ast.JoinedStr, ast.Expr
    return [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, kinds)]


def strings():
    """Every text in the code; what f-strings put in is an ellipsis."""
    for folder in CODE:
        for path in (ROOT / folder).rglob("*.py"):
            for node in texts(path):
                if isinstance(node, ast.JoinedStr):
                    parts = (part.value if isinstance(part, ast.Constant) else "…" for part in node.values)
                    yield "".join(parts)
                elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                    yield node.value
                    # A template of ``say`` or ``worded``.
                    yield re.sub(r"\{\d[^{}]*\}", "…", node.value)


def interface_strings():
    """Texts of the code that may be shown, with their places: neither docstrings nor identifiers and keys."""
    for path in (file for folder in CODE for file in (ROOT / folder).rglob("*.py")):
        alone = {id(node.value) for node in texts(path) if isinstance(node, ast.Expr)}
        for node in texts(path):
            if not (isinstance(node, ast.Constant) and isinstance(node.value, str)) or id(node) in alone:
                continue
            if not re.fullmatch(r"[a-z0-9_.]+|[A-Z0-9_]+", node.value) and node.value not in KEYS:
                yield f"{path.relative_to(ROOT)}:{node.lineno}", node.value


def test_messages_and_names_are_in_american_english():
    found = {place: words for place, text in interface_strings() if (words := british(text))}
    assert not found


def test_texts_of_presets_are_in_american_english():
    for path in (ROOT / "presets").glob("*.json"):
        preset = json.loads(path.read_text(encoding="utf-8"))
        shown = [preset[key] for key in ("name", "description", "source", "group")]
        shown += [part["name"] for key in ("surfaces", "mappings") for part in preset.get(key, ())]
        assert not british(" ".join(shown)), path.name


@pytest.mark.parametrize("page", [GUIDE, ROOT / "README.md"], ids=lambda page: page.name)
def test_pages_quote_the_interface_in_its_own_spelling(page):
    quoted = re.findall(r"(?<![\w*])\*([^*\n]+)\*(?!\w)", page.read_text(encoding="utf-8"))
    assert len(quoted) > 20
    assert not [text for text in quoted if british(text)]


def test_messages_in_the_guide_are_those_of_the_code():
    text = GUIDE.read_text(encoding="utf-8")
    table = text[text.index("| message | what to do |") :]
    rows = [line.split(" | ")[0] for line in table.splitlines()[2:] if line.startswith("| ")]
    messages = [message for row in rows for message in re.findall(r"\*([^*]+)\*", row)]
    assert len(messages) > 25
    code = list(strings())
    for message in messages:
        pattern = re.compile(".*".join(re.escape(part) for part in message.split("…")), re.DOTALL)
        assert any(pattern.search(one) for one in code), f"no message in the code reads: {message}"


def choices(path, name):
    """The items of a menu, a constant of a module that only Blender can import."""
    for node in ast.parse((ROOT / "scfpf_addon" / "bridge" / path).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == name:
            return ast.literal_eval(node.value)
    raise AssertionError(f"{path} has no {name}")


def test_guide_has_each_choice_with_its_tooltip():
    rows = GUIDE.read_text(encoding="utf-8").splitlines()
    shown = [(kind.title, kind.text) for kind in SURFACE_KINDS.values()]
    for name in ("BASES", "REPARAMETERISATIONS"):
        shown += [item[1:] for item in choices("settings/camera_properties.py", name)]
    for title, tooltip in shown:
        row = f"| {title} | {tooltip} |"
        assert any(row in one for one in rows), f"the guide has no row of {title} and its tooltip"
    for _, title, _ in choices("settings/mapping_properties.py", "MAPPING_KINDS"):
        assert any(row.startswith(f"| {title} |") for row in rows), title


def test_page_of_settings_is_that_of_the_code():
    page = settings_page.PAGE.read_text(encoding="utf-8")
    assert page == settings_page.page(), "python3 dev.py pictures writes it anew"
    buttons = page[page.index("## Buttons") :]
    labels = operator_labels()
    assert len(labels) > 50
    for label in labels:
        assert re.search(rf"^\| (\*{re.escape(label)}\*|.*\({re.escape(label)}\)) \|", buttons, re.M), label


def operator_labels():
    """The name of every operator."""
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "operators").rglob("*.py")]
    return re.findall(r'^    bl_label = "(.+)"$', "\n".join(texts), re.MULTILINE)


def panel_titles():
    """The titles of all panels: of classes whose bases or users are panels, not of menus."""
    for path in (ROOT / "panels").glob("*.py"):
        for owner in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(owner, ast.ClassDef) and (
                "SCFPF_PT" in owner.name or owner.name.endswith("Section")
            ):
                for node in owner.body:
                    if isinstance(node, ast.Assign) and node.targets[0].id == "bl_label":
                        yield node.value.value


def test_guide_has_a_paragraph_of_every_panel():
    text = GUIDE.read_text(encoding="utf-8")
    titles = list(panel_titles())
    assert len(titles) > 15
    for title in titles:
        own = f"**{title}.**" in text or f"*{title}* (" in text
        assert own, f"no paragraph of {title}"
