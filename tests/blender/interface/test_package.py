# SPDX-License-Identifier: GPL-3.0-or-later
"""The manifest, validated by the running Blender's own tool, and the files that it names."""

import pathlib
import re
import shutil
import subprocess
import sys
import tomllib

import bpy
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[3]
SCRIPTS = pathlib.Path(bpy.utils.system_resource("SCRIPTS"))
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))


def validate(folder):
    """Run `validate --valid-tags` on the manifest in a folder."""
    tool = SCRIPTS / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
    tags = SCRIPTS / "modules" / "_bpy_internal" / "extensions" / "tags.py"
    command = [sys.executable, str(tool), "validate", f"--valid-tags={tags}", str(folder)]
    return subprocess.run(command, capture_output=True, text=True)


def test_manifest_is_valid():
    done = validate(ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_page_of_the_extension_has_the_manifests_words():
    """Blender cuts taglines and reasons off after 64 characters."""
    page = (ROOT / "docs" / "publishing.md").read_text("utf-8")
    assert f"    {MANIFEST['tagline']}\n" in page
    said = [MANIFEST["tagline"], *MANIFEST["permissions"].values()]
    assert all(len(text) <= 64 and text[-1].isalnum() for text in said)
    assert (
        re.search(r"^## (\S+)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.M)[1] == MANIFEST["version"]
    )
    presets = len(list((ROOT / "presets").glob("*.json")))
    assert presets == 51 and "Fifty-one projections" in page


@pytest.mark.parametrize("old, new", [('"Camera"', '"Camra"'), ('"4.5.0"', '"four"')])
def test_the_check_can_fail(tmp_path, old, new):
    shutil.copy(ROOT / "__init__.py", tmp_path)
    text = (ROOT / "blender_manifest.toml").read_text("utf-8")
    assert text.count(old) == 1
    (tmp_path / "blender_manifest.toml").write_text(text.replace(old, new), "utf-8")
    assert validate(tmp_path).returncode != 0


def test_a_wheel_for_this_blender():
    tag = f"cp{sys.version_info[0]}{sys.version_info[1]}"
    assert sum(f"-{tag}-{tag}-" in name for name in MANIFEST["wheels"]) == len(MANIFEST["platforms"])


def test_wheels_are_the_locked_version():
    lock = (ROOT / "devtools" / "requirements" / "wheels.txt").read_text("utf-8")
    version = re.search(r"^embreex==(\S+)", lock, re.MULTILINE).group(1)
    assert len(re.findall(r"--hash=sha256:[0-9a-f]{64}\b", lock)) == len(MANIFEST["wheels"])
    assert all(name.startswith(f"./wheels/embreex-{version}-") for name in MANIFEST["wheels"])
    requirements = (ROOT / "devtools" / "requirements" / "test.txt").read_text("utf-8")
    assert f"embreex=={version}\n" in requirements
    assert f"embreex {version} " in (ROOT / "THIRD_PARTY_NOTICES").read_text("utf-8")


def test_no_link_to_any_host_in_what_ships():
    """The extension neither asks for network permission nor needs it."""
    assert "network" not in MANIFEST["permissions"]
    for path in [*ROOT.glob("scfpf_addon/**/*.py"), *ROOT.glob("operators/*.py"), *ROOT.glob("panels/*.py")]:
        found = re.search(
            r"^\s*(?:import|from) (urllib|http|socket|requests|ssl)\b", path.read_text("utf-8"), re.M
        )
        assert found is None, f"{path}: {found}"
