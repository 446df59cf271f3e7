# SPDX-License-Identifier: GPL-3.0-or-later
"""The contents of each zip: the files of the allow-list as in the checkout, and its platform's wheels."""

import pathlib
import re
import subprocess
import sys
import tomllib
import zipfile

import bpy
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
WHEEL_TAGS = {
    "linux_x64": "manylinux_2_27_x86_64.manylinux_2_28_x86_64",
    "windows_x64": "win_amd64",
    "macos_arm64": "macosx_13_0_arm64",
    "macos_x64": "macosx_13_0_x86_64",
}
PYTHONS = ("cp311", "cp313", "cp314")


def shipped_files():
    """Paths, from the root, of what ships beside the manifest and the wheels."""
    code = [
        path for folder in ("scfpf_addon", "operators", "panels") for path in ROOT.glob(f"{folder}/**/*.py")
    ]
    data = [
        *ROOT.glob("presets/*.json"),
        *ROOT.glob("presets/thumbnails/*.png"),
        *ROOT.glob("panels/languages/*.po"),
        *ROOT.glob("scfpf_addon/farm/*.js"),
        *(ROOT / name for name in ("__init__.py", "LICENSE", "THIRD_PARTY_NOTICES")),
    ]
    return {path.relative_to(ROOT).as_posix() for path in (*code, *data)}


def zip_of(platform):
    version = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))["version"]
    return zipfile.ZipFile(ROOT / "dist" / f"scfpf-{version}-{platform}.zip")


@pytest.mark.parametrize("platform", WHEEL_TAGS)
def test_accepted_by_blenders_own_tool(platform):
    scripts = pathlib.Path(bpy.utils.system_resource("SCRIPTS"))
    tool = scripts / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
    tags = scripts / "modules" / "_bpy_internal" / "extensions" / "tags.py"
    command = [sys.executable, str(tool), "validate", f"--valid-tags={tags}", zip_of(platform).filename]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_one_zip_a_platform():
    platforms = tomllib.loads((ROOT / "blender_manifest.toml").read_text("utf-8"))["platforms"]
    built = {re.sub(r".*-(\w+)\.zip", r"\1", path.name) for path in (ROOT / "dist").glob("*.zip")}
    assert built == {name.replace("-", "_") for name in platforms} == set(WHEEL_TAGS)


@pytest.mark.parametrize("platform", WHEEL_TAGS)
def test_listing(platform):
    wheels = {f"wheels/embreex-4.4.0.post1-{tag}-{tag}-{WHEEL_TAGS[platform]}.whl" for tag in PYTHONS}
    with zip_of(platform) as archive:
        names = archive.namelist()
    assert sorted(names) == sorted({"blender_manifest.toml", *shipped_files(), *wheels})


@pytest.mark.parametrize("platform", WHEEL_TAGS)
def test_contents(platform):
    """A difference means that dist/ is older than the checkout, or the tool changes files."""
    with zip_of(platform) as archive:
        for name in sorted(shipped_files()):
            assert archive.read(name) == (ROOT / name).read_bytes(), name
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        wheels = [name for name in archive.namelist() if name.endswith(".whl")]
        for name in wheels:
            with archive.open(name) as wheel, zipfile.ZipFile(wheel) as inner:
                assert inner.testzip() is None
    generated = manifest["build"]["generated"]
    assert generated["platforms"] == [platform.replace("_", "-", 1)]
    assert sorted(generated["wheels"]) == sorted(f"./{name}" for name in wheels)
