# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile a job with a job type as Flamenco's manager does, and print its tasks as JSON.

    python flamenco_manager.py SCRIPT SETTINGS

Runs in the environment of devtools/farm_tools.py. What a manager gives to scripts is written anew here, by
its documents: chunks of two frames are lists (1,2), longer ones ranges (1-3).
"""

import pathlib
import sys

from py_mini_racer import MiniRacer

MANAGER = """
const tasks = [];
const print = () => {};
const path = {
    dirname: (text) => text.slice(0, text.lastIndexOf("/")),
    basename: (text) => text.slice(text.lastIndexOf("/") + 1),
};
const formatTimestampLocal = (when) => `stamp-${when}`;
const author = {
    Command: (name, parameters, steps) => ({ name, parameters, steps }),
    Task: (name, type) => {
        const task = { name, type, commands: [], dependencies: [] };
        task.addCommand = (command) => { task.commands.push(command); };
        task.addDependency = (other) => { task.dependencies.push(other.name); };
        return task;
    },
};
const framesOf = (text) => {
    const found = new Set();
    for (const part of text.split(",")) {
        const [first, last] = part.trim().split("-").map(Number);
        for (let frame = first; frame <= (last === undefined ? first : last); frame++) {
            found.add(frame);
        }
    }
    return [...found].sort((a, b) => a - b);
};
const merged = (frames) => {
    const runs = [];
    for (const frame of frames) {
        const run = runs[runs.length - 1];
        if (run && frame === run[run.length - 1] + 1) {
            run.push(frame);
        } else {
            runs.push([frame]);
        }
    }
    return runs.map((run) => (run.length > 2 ? `${run[0]}-${run[run.length - 1]}` : run.join(","))).join(",");
};
const frameChunker = (text, size) => {
    const frames = framesOf(text);
    const chunks = [];
    for (let start = 0; start < frames.length; start += size) {
        chunks.push(merged(frames.slice(start, start + size)));
    }
    return chunks;
};
"""
COMPILE = """
let told = "";
try {
    compileJob({ settings: SETTINGS, created: 7, addTask: (task) => tasks.push(task) });
} catch (reason) {
    told = String(reason);
}
JSON.stringify({ type: JOB_TYPE, tasks, told });
"""


def main(script, settings):
    program = "'use strict';" + MANAGER + pathlib.Path(script).read_text(encoding="utf-8")
    with MiniRacer() as engine:
        print(engine.eval(program + COMPILE.replace("SETTINGS", settings)))


if __name__ == "__main__":
    main(*sys.argv[1:])
