# SPDX-License-Identifier: GPL-3.0-or-later
"""The share of a render that holds Python's lock, and the speed on more cores that it predicts.

It needs Linux and a C compiler.

    python3 dev.py bench --lock [--markdown FILE] [--percentage N]

CPython signals one condition when a thread releases the lock and another when one takes it. A preloaded
library notes these signals with the processor time of their thread, in renders by one thread, where nobody
waits. The simulation lets N threads on N cores run through such spans, each from a random one on, with one
lock in the order of arrival. It is an upper bound: memory has no limits, and waking a thread costs nothing.

A cell has the cores that tiles keep busy, and how much faster than by one core the whole image is made.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from heapq import heapify, heappop, heappush
from pathlib import Path
from time import process_time
from typing import NamedTuple

import bpy
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.document import check_files, replace_section
from benchmarks.real import beside_cycles, real_scenes
from scfpf_addon.projection.typing import Array

SECTION = "lock"
CASES = ("street, perspective", "street, around the car", "room, 200 materials", "meadow of cards")
CORES = (2, 8, 16, 32)
# Pairs of spans that each simulated thread runs through.
PAIRS = 30_000
SEED = 5
RECORD = np.dtype([("time", np.uint64), ("thread", np.uint32), ("condition", np.uint32)])
NOTES = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
#define MOST 30000000UL
struct record { uint64_t time; uint32_t thread, condition; };
static struct record *records;
static atomic_ulong count;
static int (*signal_itself)(pthread_cond_t *);
static __thread uint32_t thread;
__attribute__((constructor)) static void begin(void) {
    signal_itself = dlvsym(RTLD_NEXT, "pthread_cond_signal", "GLIBC_2.3.2");
    int flags = MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE;
    records = mmap(0, MOST * sizeof *records, PROT_READ | PROT_WRITE, flags, -1, 0);
}
int pthread_cond_signal(pthread_cond_t *condition) {
    struct timespec now;
    if (!thread) thread = syscall(SYS_gettid);
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    unsigned long place = atomic_fetch_add(&count, 1);
    uint64_t time = now.tv_sec * 1000000000UL + now.tv_nsec;
    if (place < MOST) records[place] = (struct record){time, thread, (uint32_t)(uintptr_t)condition};
    return signal_itself(condition);
}
__attribute__((destructor)) static void end(void) {
    FILE *file = fopen(getenv("LOCK_SPANS"), "wb");
    if (file) fwrite(records, sizeof *records, count < MOST ? count : MOST, file), fclose(file);
}
"""


class Spans(NamedTuple):
    """Processor seconds (n,) that a thread holds the lock, and works without it after each of them."""

    locked: Array
    free: Array

    @property
    def work(self) -> float:
        """Processor seconds of both."""
        return float(self.locked.sum() + self.free.sum())

    @property
    def share(self) -> float:
        """The share of its work that a thread does with the lock."""
        return float(self.locked.sum()) / self.work


def noted(path: str, percentage: float, folder: Path) -> tuple[NDArray, float]:
    """The signals of a render by one thread, and its processor seconds."""
    library, notes = folder / "notes.so", folder / "notes"
    (folder / "notes.c").write_text(NOTES)
    flags = ["-shared", "-fPIC", "-O2", "-w"]
    subprocess.run(["cc", *flags, "-o", str(library), str(folder / "notes.c"), "-ldl"], check=True)
    more = {"LD_PRELOAD": str(library), "LOCK_SPANS": str(notes)}
    command = [sys.executable, __file__, "--one", path, str(percentage)]
    done = subprocess.run(command, env=os.environ | more, check=True, capture_output=True, text=True)
    return np.fromfile(notes, RECORD), float(done.stdout.splitlines()[-1])


def spans(records: NDArray) -> Spans:
    """The spans of the thread that renders tiles: the one that signals most apart from the main one."""
    # The first signal of a process is that the lock is taken.
    conditions, first, counts = np.unique(records["condition"], return_index=True, return_counts=True)
    both = np.argsort(counts)[-2:]
    release = conditions[both[np.argmax(first[both])]]
    records = records[np.isin(records["condition"], conditions[both])]
    others = records["thread"] != records["thread"][0]
    threads, counts = np.unique(records["thread"][others], return_counts=True)
    own = records[records["thread"] == threads[np.argmax(counts)]]
    released, time = own["condition"] == release, own["time"].astype(np.float64) * 1e-9
    # Taken, released, taken.
    whole = np.flatnonzero(~released[:-2] & released[1:-1] & ~released[2:])
    return Spans(time[whole + 1] - time[whole], time[whole + 2] - time[whole + 1])


def cores_busy(found: Spans, threads: int) -> float:
    """Cores that so many threads keep busy, each on a core of its own."""
    generator = np.random.default_rng(SEED)
    count = len(found.locked)
    place = generator.integers(0, count, threads)
    # Threads ask for the lock in the order of these times.
    asking = [(float(found.free[place[thread]] * generator.random()), thread) for thread in range(threads)]
    heapify(asking)
    free_at, worked, last = 0.0, 0.0, 0.0
    for _ in range(PAIRS * threads):
        asked, thread = heappop(asking)
        place[thread] = (place[thread] + 1) % count
        locked, free = float(found.locked[place[thread]]), float(found.free[place[thread]])
        free_at = max(free_at, asked) + locked
        last = free_at + free
        worked += locked + free
        heappush(asking, (last, thread))
    return worked / max(time for time, _ in asking)


def render(path: str, percentage: float) -> None:
    """Render a scene by one thread, with the default bounces."""
    beside_cycles.register()
    beside_cycles.open_scene(path, beside_cycles.ENGINE, beside_cycles.BOUNCES["default bounces"], percentage)
    settings = bpy.context.scene.render
    settings.threads_mode, settings.threads = "FIXED", 1
    before = process_time()
    bpy.ops.render.render()
    print(process_time() - before)


def table(percentage: float) -> list[str]:
    """The table, as lines of Markdown."""
    heads = "scene", "share with the lock", "taken, a second", "outside tiles", *(f"{n} cores" for n in CORES)
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    with tempfile.TemporaryDirectory() as folder:
        for name in CASES:
            path = Path(folder, "real.blend")
            real_scenes.write(name, path)
            records, whole = noted(str(path), percentage, Path(folder))
            found = spans(records)
            outside, often = whole - found.work, len(found.locked) / found.work
            cells = [name, f"{found.share:.0%}", f"{often:,.0f}", f"{outside / whole:.0%}"]
            for cores in CORES:
                busy = cores_busy(found, cores)
                cells.append(f"{busy:.1f}, {whole / (outside + found.work / busy):.1f} ×")
            lines.append(f"| {' | '.join(cells)} |")
            print(lines[-1], flush=True)
    return lines


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--markdown", metavar="FILE", help="put the table into a document")
    parser.add_argument("--percentage", type=float, default=100, metavar="N", help="the size of the images")
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    check_files(parser, document=options.markdown, sections=[SECTION])
    if options.one:
        render(options.one[0], float(options.one[1]))
        return
    beside_cycles.register()
    lines = table(options.percentage)
    if options.markdown:
        replace_section(options.markdown, SECTION, lines)


if __name__ == "__main__":
    main()
