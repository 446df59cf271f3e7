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
          eval: "f'{C.scene.frame_start}-{C.scene.frame_end}' if C.scene.frame_step == 1 else ','.join(map(str, range(C.scene.frame_start, C.scene.frame_end + 1, C.scene.frame_step)))",
          evalInfo: { showLinkButton: true, description: "Frames of the scene" },
          description: "Frames to render, such as 7, 1-250 or 1-10, 20-30" },
        { key: "chunk_size", type: "int32", default: 5, propargs: { min: 1 }, visible: "submission",
          description: "Frames of a task, which opens the file once; 32 for eevee, which plans the renders of 16 frames together" },
        { key: "tiles", type: "string", default: "1x1", visible: "submission",
          description: "Columns and rows of tiles of a huge picture, such as 4x2; not for eevee" },
        { key: "resume", type: "bool", default: true, visible: "submission",
          description: "Keep pictures that exist" },
        { key: "camera", type: "string", default: "", visible: "submission",
          description: "The flexible camera, if it is not the scene's" },
        { key: "extension", type: "string", subtype: "file_path", default: "", visible: "submission",
          description: "The zip of Flexible Projection where workers find it, which those without the extension load for their task" },
        { key: "allow_missing", type: "bool", default: false, visible: "submission",
          description: "Render although files are missing that the .blend file uses" },
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
        { key: "missing", type: "string", visible: "hidden",
          eval: "__import__('json').dumps(sorted(p for p in bpy.utils.blend_paths(absolute=True, packed=False, local=False) if not (__import__('os').path.exists(p) or '<UDIM>' in p or '<UVTILE>' in p)))",
          description: "Files that the .blend file uses and that are missing" },
    ],
};

// The task that workers run: a program in Python, packed by zlib. Windows passes at most 32,767 characters on.
const TASK = "@TASK@";
const TILED_WAYS = ["engine", "cycles", "layers"];

function compileJob(job) {
    const settings = job.settings;
    const grid = gridOf(settings);
    const missing = missingFiles(settings);
    if (missing.length && !settings.allow_missing) {
        throw `The file uses ${missing.length} files that are missing, such as "${missing[0]}": find them in File > External Data, or allow missing files`;
    }
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
        throw `Tiles need the way engine, cycles or layers: "${settings.way}" joins whole pictures`;
    }
    return grid;
}

function missingFiles(settings) {
    return settings.missing ? JSON.parse(settings.missing) : [];
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

// The first, the last and the step of frames that follow one another evenly. Flamenco writes a chunk as 7, as 7,8
// or as 7-11,20.
function runsOf(chunk) {
    const runs = [];
    for (const part of String(chunk).split(",")) {
        const ends = part.split("-").map(Number);
        for (let frame = ends[0]; frame <= ends[ends.length - 1]; frame++) {
            const run = runs[runs.length - 1];
            if (run !== undefined && (run.first === run.last || frame === run.last + run.step)) {
                run.step = frame - run.last;
                run.last = frame;
            } else {
                runs.push({ first: frame, last: frame, step: 1 });
            }
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
    const missing = missingFiles(settings);
    if (missing.length) {
        needs.absent = missing;
    }
    if (settings.extension) {
        more = more.concat(["--extension", settings.extension]);
    }
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
            "--first", String(run.first),
            "--last", String(run.last),
            "--count", String(run.last - run.first + 1),
            "--step", String(run.step),
            "--tiles", settings.tiles || "1x1",
            "--resume", settings.resume ? "true" : "false",
            "--require", JSON.stringify(needs),
        ].concat(more),
    }, (run.last - run.first) / run.step + 1);
}

// A program of one line, without the braces in which Flamenco would look for its variables.
function pythonOf(packed) {
    return `exec(__import__("zlib").decompress(__import__("base64").b64decode("${packed}")))`;
}
