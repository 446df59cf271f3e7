# SPDX-License-Identifier: GPL-3.0-or-later
"""Flamenco's job type, compiled by a JavaScript engine with a stand-in for the manager's functions."""

import json
import pathlib
import subprocess

import pytest

from devtools import farm_tools
from scfpf_addon.farm import flamenco
from scfpf_addon.farm.template import SCRIPT, WAYS

MANAGER = pathlib.Path(__file__).with_name("flamenco_manager.py")
# Of its OpenAPI document: the types of settings, and when they are shown.
TYPES = {"string": str, "int32": int, "float": float, "bool": bool}
SHOWN = {"visible", "hidden", "submission", "web"}


@pytest.fixture
def compiled(tmp_path):
    """Compile a job with some settings: its type, its tasks, and the reason if it cannot be."""
    script = tmp_path / flamenco.NAME
    script.write_text(flamenco.job_type(), encoding="utf-8")

    def compile_job(**settings):
        given = {
            "way": "engine",
            "frames": "1-7",
            "chunk_size": 5,
            "tiles": "1x1",
            "resume": True,
            "render_output_path": "/out/film/{timestamp}/film_####",
            "blendfile": "/in/my film.blend",
            "blender_version": "5.2",
            **settings,
        }
        words = [farm_tools.python(), str(MANAGER), str(script), json.dumps(given)]
        done = subprocess.run(words, capture_output=True, text=True, timeout=60)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return compile_job


def options(command):
    """The options of a task's script in a command, by their names, and what it is to do."""
    words = command["parameters"]["args"]
    rest = words[words.index("--") + 1 :]
    return {"action": rest[0], **dict(zip(rest[1::2], rest[2::2], strict=True))}


def test_settings_are_as_flamenco_declares_them(compiled):
    settings = {each["key"]: each for each in compiled()["type"]["settings"]}
    assert settings["way"]["choices"] == list(WAYS)
    for each in settings.values():
        assert each.get("visible", "visible") in SHOWN
        assert isinstance(each.get("default", TYPES[each["type"]]()), TYPES[each["type"]])
        if "eval" in each:
            compile(each["eval"], each["key"], "eval")


def test_workers_get_the_script_of_tasks_without_places_of_variables(compiled):
    (command, *_) = compiled()["tasks"][0]["commands"]
    assert command["name"] == "blender-render" and command["parameters"]["blendfile"] == ""
    words = command["parameters"]["args"]
    program = words[words.index("--python-expr") + 1]
    assert "\n" not in program and "{" not in program
    received = []
    exec(program, {"exec": received.append})
    assert received == [SCRIPT.read_bytes()]
    # Windows passes at most 32,767 characters to a program.
    assert sum(len(word) + 3 for word in words) < 30_000


def test_frames_are_rendered_in_chunks(compiled):
    found = compiled(frames="1-7, 20", chunk_size=3)
    tasks = found["tasks"]
    assert found["told"] == ""
    assert [task["name"] for task in tasks] == ["render-1-3", "render-4-6", "render-7,20"]
    runs = [
        [(options(one)["--first"], options(one)["--last"], one["steps"]) for one in task["commands"]]
        for task in tasks
    ]
    assert runs == [[("1", "3", 3)], [("4", "6", 3)], [("7", "20", 2)]]
    assert options(tasks[2]["commands"][0])["--step"] == "13"
    given = options(tasks[0]["commands"][0])
    assert given["action"] == "render" and given["--scene"] == "/in/my film.blend"
    assert given["--output"] == "/out/film/stamp-7" and given["--name"] == "film_####"
    assert json.loads(given["--require"]) == {"camera": "", "blender": "5.2"}


def test_chunks_of_two_frames_are_one_command(compiled):
    tasks = compiled(frames="1-4", chunk_size=2)["tasks"]
    assert [task["name"] for task in tasks] == ["render-1,2", "render-3,4"]
    assert [len(task["commands"]) for task in tasks] == [1, 1]
    assert options(tasks[1]["commands"][0])["--count"] == "2"


def test_frames_of_a_step_are_one_command(compiled):
    tasks = compiled(frames="1,4,7,10,13,14,20", chunk_size=4)["tasks"]
    found = [
        [
            [options(one)[each] for each in ("--first", "--last", "--count", "--step")]
            for one in task["commands"]
        ]
        for task in tasks
    ]
    assert found == [[["1", "10", "10", "3"]], [["13", "14", "2", "1"], ["20", "20", "1", "1"]]]
    assert [one["steps"] for task in tasks for one in task["commands"]] == [4, 2, 1]


def test_a_zip_of_the_extension_is_given_to_workers(compiled):
    (command, *_) = compiled(extension="/shared/scfpf.zip")["tasks"][0]["commands"]
    assert options(command)["--extension"] == "/shared/scfpf.zip"


def test_missing_files_refuse_a_job_that_does_not_allow_them(compiled):
    missing = json.dumps(["/in/library {a}.blend", "/in/wood.png"])
    found = compiled(missing=missing)
    assert found["tasks"] == []
    assert 'uses 2 files that are missing, such as "/in/library {a}.blend"' in found["told"]
    (command, *_) = compiled(missing=missing, allow_missing=True)["tasks"][0]["commands"]
    assert json.loads(options(command)["--require"])["absent"] == ["/in/library {a}.blend", "/in/wood.png"]


def test_tiles_are_joined_when_all_are_rendered(compiled):
    tasks = compiled(frames="3", tiles="2x2", way="cycles", skips='["a {b} scene"]')["tasks"]
    assert [options(task["commands"][0]).get("--tile") for task in tasks] == ["0", "1", "2", "3", None]
    join = tasks[-1]
    assert join["dependencies"] == [task["name"] for task in tasks[:4]]
    assert options(join["commands"][0])["action"] == "join"
    assert json.loads(options(join["commands"][0])["--require"])["skips"] == ["a {b} scene"]


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"tiles": "2x2", "way": "eevee"}, "Tiles need the way engine, cycles or layers"),
        ({"tiles": "0x2"}, "Tiles are columns and rows"),
        ({"tiles": "four"}, "Tiles are columns and rows"),
    ],
)
def test_what_cannot_be_is_said(compiled, settings, reason):
    assert reason in compiled(**settings)["told"]
