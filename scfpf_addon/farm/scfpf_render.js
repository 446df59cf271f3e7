// SPDX-License-Identifier: GPL-3.0-or-later
// A job type of Flamenco 3: films of flexible cameras, in four ways. The command
// `blender -c scfpf flamenco -o DIR` writes it; it belongs into the folder `scripts` beside flamenco-manager.

const JOB_TYPE = {
    label: "Flexible Film",
    description: "Render a flexible camera by Flexible Projection, by Cycles through a rig, with image layers, or by EEVEE",
    settings: [
        { key: "way", type: "string", required: true, default: "engine",
          choices: ["engine", "cycles", "layers", "eevee"],
          description: "engine: Flexible Projection. cycles: the rig in the file, without the extension. layers: image layers by Cycles. eevee: through anchors" },
        { key: "frames", type: "string", required: true,
          eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
          evalInfo: { showLinkButton: true, description: "Frames of the scene" },
          description: "Frames to render, such as 7, 1-250 or 1-10, 20-30" },
        { key: "chunk_size", type: "int32", default: 5, propargs: { min: 1 }, visible: "submission",
          description: "Frames of a task, which opens the file once; 32 for eevee, which plans the renders of 16 frames together" },
        { key: "tiles", type: "string", default: "1x1", visible: "submission",
          description: "Columns and rows of tiles of a huge picture, such as 4x2; for engine and cycles" },
        { key: "resume", type: "bool", default: true, visible: "submission",
          description: "Keep pictures that exist" },
        { key: "camera", type: "string", default: "", visible: "submission",
          description: "The flexible camera, if it is not the scene's" },
        { key: "render_output_root", type: "string", subtype: "dir_path", required: true, visible: "submission",
          description: "The folder that gets a folder of the job's pictures" },
        { key: "render_output_path", type: "string", subtype: "file_path", editable: false,
          eval: "str(Path(abspath(settings.render_output_root), jobname, '{timestamp}', jobname + '_####'))",
          description: "The pictures; # stands for a digit of the frame" },
        { key: "blendfile", type: "string", required: true, visible: "web",
          description: "The .blend file" },
        { key: "blender_version", type: "string", visible: "hidden",
          eval: "f'{bpy.app.version[0]}.{bpy.app.version[1]}'" },
        { key: "skips", type: "string", visible: "hidden",
          eval: "__import__('json').dumps(sorted(str(o['scfpf_skips']) for o in bpy.data.objects if 'scfpf_skips' in o))",
          description: "For what scene the rays of rigs skip empty chords" },
    ],
};

// The task that workers run, in Python.
const TASK = "@TASK@";
const TILED_WAYS = ["engine", "cycles"];

function compileJob(job) {
    const settings = job.settings;
    const grid = gridOf(settings);
    settings.render_output_path = settings.render_output_path.replace(
        "{timestamp}", formatTimestampLocal(job.created));
    for (const chunk of frameChunker(settings.frames, settings.chunk_size)) {
        const renders = renderTasks(settings, chunk, grid);
        renders.forEach((task) => job.addTask(task));
        if (grid[0] * grid[1] > 1) {
            const join = blenderTask(settings, "join", chunk, []);
            renders.forEach((task) => join.addDependency(task));
            job.addTask(join);
        }
    }
}

// The numbers of columns and rows of tiles.
function gridOf(settings) {
    const text = settings.tiles || "1x1";
    if (!/^[1-9][0-9]{0,2}x[1-9][0-9]{0,2}$/.test(text)) {
        throw `Tiles are columns and rows such as 4x2, not "${text}"`;
    }
    const grid = text.split("x").map(Number);
    if (grid[0] * grid[1] > 1 && !TILED_WAYS.includes(settings.way)) {
        throw `Tiles need the way engine or cycles: "${settings.way}" joins whole pictures`;
    }
    return grid;
}

function renderTasks(settings, chunk, grid) {
    if (grid[0] * grid[1] === 1) {
        return [blenderTask(settings, "render", chunk, [])];
    }
    const found = [];
    for (let tile = 0; tile < grid[0] * grid[1]; tile++) {
        found.push(blenderTask(settings, "render", chunk, ["--tile", String(tile)], `-tile-${tile}`));
    }
    return found;
}

// The first and the last of frames that follow one another. Flamenco writes a chunk as 7, as 7,8 or as 7-11,20.
function runsOf(chunk) {
    const runs = [];
    for (const part of String(chunk).split(",")) {
        const ends = part.split("-").map(Number);
        const last = runs.length ? runs[runs.length - 1] : undefined;
        if (last !== undefined && ends[0] === last[1] + 1) {
            last[1] = ends[ends.length - 1];
        } else {
            runs.push([ends[0], ends[ends.length - 1]]);
        }
    }
    return runs;
}

function blenderTask(settings, action, chunk, more, suffix) {
    const task = author.Task(`${action}-${chunk}${suffix || ""}`, "blender");
    runsOf(chunk).forEach((run) => task.addCommand(blenderCommand(settings, action, run, more)));
    return task;
}

function blenderCommand(settings, action, run, more) {
    const needs = { camera: settings.camera || "" };
    if (settings.blender_version) {
        needs.blender = settings.blender_version;
    }
    if (settings.way === "cycles" && settings.skips) {
        needs.skips = JSON.parse(settings.skips);
    }
    const count = run[1] - run[0] + 1;
    return author.Command("blender-render", {
        exe: "{blender}",
        exeArgs: "{blenderArgs}",
        argsBefore: [],
        blendfile: "",
        args: [
            "--python-exit-code", "1",
            "--python-expr", pythonOf(TASK),
            "--", action,
            "--way", settings.way,
            "--scene", settings.blendfile,
            "--output", path.dirname(settings.render_output_path),
            "--name", path.basename(settings.render_output_path),
            "--first", String(run[0]),
            "--last", String(run[1]),
            "--count", String(count),
            "--tiles", settings.tiles || "1x1",
            "--resume", settings.resume ? "true" : "false",
            "--require", JSON.stringify(needs),
        ].concat(more),
    }, count);
}

// A program of one line, without the braces in which Flamenco would look for its variables: a text in JSON is
// one in Python, too.
function pythonOf(program) {
    return `exec(${JSON.stringify(program).replace(/{/g, "\\x7b")})`;
}
