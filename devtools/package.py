# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's zips: fetch the locked wheels, validate the manifest, build one zip a platform."""

from __future__ import annotations

import hashlib
import pathlib
import re
import subprocess
import sys
import sysconfig

from .environments import REQUIREMENTS, ROOT, Environment, Failure, run, say

MANIFEST = ROOT / "blender_manifest.toml"
WHEELS = ROOT / "wheels"
DIST = ROOT / "dist"
LOCK = REQUIREMENTS / "wheels.txt"
# Blender's names of systems, by Python's.
SYSTEMS = {"linux": "linux", "darwin": "macos", "win32": "windows"}

# Where the module bpy keeps its scripts, without importing it.
FIND_SCRIPTS = """
import importlib.util, pathlib
folder = pathlib.Path(importlib.util.find_spec("bpy").origin).parent
print(next(folder.glob("*/scripts")))
"""


def build(environment: Environment) -> list[pathlib.Path]:
    """Build the zips into dist/ with the tool that Blender itself uses, and return them."""
    fetch_wheels(environment)
    scripts = pathlib.Path(
        subprocess.check_output([environment.python, "-c", FIND_SCRIPTS], text=True).strip()
    )
    tool = [environment.python, str(scripts / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py")]
    tags = f"--valid-tags={scripts / 'modules' / '_bpy_internal' / 'extensions' / 'tags.py'}"
    DIST.mkdir(exist_ok=True)
    for old in DIST.glob("*.zip"):
        old.unlink()
    run([*tool, "validate", tags, str(ROOT)])
    run([*tool, "build", tags, "--split-platforms", "--source-dir", str(ROOT), "--output-dir", str(DIST)])
    zips = sorted(DIST.glob("*.zip"))
    for path in zips:
        say(f"built {path.relative_to(ROOT)} ({path.stat().st_size / 1e6:.1f} MB)")
    return zips


def platform_zip() -> pathlib.Path:
    """The zip in dist/ for this machine."""
    machine = "arm64" if sysconfig.get_platform().endswith(("arm64", "aarch64")) else "x64"
    found = sorted(DIST.glob(f"scfpf-*-{SYSTEMS[sys.platform]}_{machine}.zip"))
    if len(found) != 1:
        raise Failure(f"dist/ holds {len(found)} zips for this machine: run `python3 dev.py build`")
    return found[0]


def manifest_wheels() -> list[str]:
    """The file names of the wheels that the manifest lists."""
    return re.findall(r'"\./wheels/([^"]+\.whl)"', MANIFEST.read_text(encoding="utf-8"))


def locked_hashes() -> set[str]:
    """The SHA-256 hashes of the wheels that may go into a zip."""
    return set(re.findall(r"--hash=sha256:([0-9a-f]{64})", LOCK.read_text(encoding="utf-8")))


def fetch_wheels(environment: Environment) -> None:
    """Fill wheels/ with exactly the wheels of the manifest, each of a locked hash."""
    WHEELS.mkdir(exist_ok=True)
    names = manifest_wheels()
    for stray in WHEELS.iterdir():
        if stray.name not in names:
            stray.unlink()
    hashes = locked_hashes()
    for name in names:
        if not is_locked(WHEELS / name, hashes):
            say(f"fetching {name}")
            run([environment.python, *download_command(name)])
        if not is_locked(WHEELS / name, hashes):
            raise Failure(f"pip brought no {name} with a hash of {LOCK.relative_to(ROOT)}")


def is_locked(path: pathlib.Path, hashes: set[str]) -> bool:
    """Return whether the file is there, with one of the hashes."""
    return path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() in hashes


def download_command(wheel: str) -> list[str]:
    """pip's arguments that fetch the locked requirement for the Python and platforms in a wheel's name."""
    _, _, python, abi, platforms = wheel[: -len(".whl")].split("-")
    command = ["-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
    command += ["--only-binary=:all:", "--require-hashes", f"--requirement={LOCK}", f"--dest={WHEELS}"]
    command += ["--implementation=cp", f"--python-version={python[2:]}", f"--abi={abi}"]
    return command + [f"--platform={platform}" for platform in platforms.split(".")]
