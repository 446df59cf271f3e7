# SPDX-License-Identifier: GPL-3.0-or-later
"""Render jobs as openjd reads them: valid, with the tasks that they are to have."""

import json
import subprocess

import pytest

from devtools import farm_tools
from scfpf_addon.farm.template import (
    SCRIPT,
    WAYS,
    Asset,
    RenderPlan,
    bundle,
    duration,
    job_template,
    needs_text,
    plain_text,
    price_text,
)

SCENE = "/film/a {{b}} film.blend"


def plan(way="engine", frames=(1, 250), **more):
    return RenderPlan(SCENE, Asset(SCENE, 7, "0" * 64), way, frames, version="5.2", extension="1.0.0", **more)


def written(one, folder):
    for name, text in bundle(one, str(folder)).items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder / "template.json"


def openjd(*words):
    done = subprocess.run([farm_tools.python(), "-m", "openjd", *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout[done.stdout.index("{") :])


def summary(one, folder):
    """The numbers of tasks by step, as openjd counts them."""
    template = str(written(one, folder))
    values = f"file://{folder / 'parameters.json'}"
    told = openjd("summary", template, "--job-param", values, "--output", "json")
    return {step["name"]: step["total_tasks"] for step in told["steps"]}


@pytest.mark.parametrize("way", WAYS)
def test_openjd_takes_the_template_of_every_way(way, tmp_path):
    one = plan(way, memory=3 << 30, assets=(Asset("a}} {{ b.png", 3),), camera="{{Task.File.Run}}")
    told = openjd("check", str(written(one, tmp_path)), "--output", "json")
    assert told["status"] == "success"


@pytest.mark.parametrize(
    ("more", "tasks"),
    [
        ({"chunk": 5}, {"Render": 50}),
        ({"chunk": 7}, {"Render": 36}),
        ({"chunk": 5, "frames": (-3, 3)}, {"Render": 2}),
        ({"chunk": 1, "frames": (9, 9), "tiles": (4, 2)}, {"Render": 8, "Join": 1}),
        ({"chunk": 2, "frames": (1, 5), "tiles": (3, 1)}, {"Render": 9, "Join": 3}),
    ],
)
def test_openjd_counts_the_tasks_that_are_told(more, tasks, tmp_path):
    one = plan(**more)
    assert summary(one, tmp_path) == tasks
    assert one.task_count == tasks["Render"]


def test_the_script_of_tasks_has_no_places_of_values():
    text = SCRIPT.read_text(encoding="utf-8")
    assert "{{" not in text and "}}" not in text


def test_names_with_braces_stay_what_they_are(tmp_path):
    one = plan(assets=(Asset("a}} {{ b.png", 3),), camera="{{Param.Blender}}")
    template = json.loads(written(one, tmp_path).read_text(encoding="utf-8"))
    (text,) = (
        file["data"] for file in template["steps"][0]["script"]["embeddedFiles"] if file["name"] == "Require"
    )
    assert "{{" not in text and "}}" not in text
    needs = json.loads(text)
    assert needs["assets"][0]["path"] == "a}} {{ b.png" and needs["camera"] == "{{Param.Blender}}"
    assert template["name"] == "a b film by engine"


def test_names_of_jobs_are_printable():
    assert plain_text("a{{\x07b\n}}") == "ab" and plain_text("{}") == "Film"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.04, "0.0 s"), (99.9, "99.9 s"), (100.0, "2 min"), (5400.0, "90 min"), (12_000.0, "3 h 20 min")],
)
def test_durations(seconds, text):
    assert duration(seconds) == text


def test_the_price_is_frames_and_the_beginnings_of_tasks():
    assert price_text(plan(chunk=5), 2.0, 10.0) == (
        "250 frames × 10.0 s + 50 tasks × 2.0 s to begin = 43 min on one machine as this"
    )
    one = plan(frames=(1, 1), tiles=(2, 2))
    assert price_text(one, 1.0, 5.0).startswith("4 tiles × 5.0 s + 4 tasks × 1.0 s to begin = 24.0 s")


@pytest.mark.parametrize("way", WAYS)
def test_people_read_the_name_that_the_interface_shows(way):
    """In the job's description, in those of its parameters, and in what a worker needs."""
    archive = Asset("/film/scfpf.zip", 7, "0" * 64)
    one = plan(way, archive=archive)
    template = job_template(one)
    told = [one.get("description", "") for one in (template, *template["parameterDefinitions"])]
    assert len(told) > 5 and "SCFPF" not in " ".join(told) + needs_text(one)


def test_what_a_worker_needs():
    assert needs_text(plan("cycles")) == "A worker needs Blender 5.2, no extension, no GPU"
    assert "Flexible Projection 1.0.0, a GPU" in needs_text(plan("eevee", memory=2_500_000_000))
    assert "2.5 GB of memory" in needs_text(plan("eevee", memory=2_500_000_000))
