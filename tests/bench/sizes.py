#!/usr/bin/env python3
"""Measures what a merge costs by the size of its shapes; writes docs/bench-sizes.md.

    tests/bench/sizes.py [--base DIR] [--bin build/bin] [--meshes ../shared/meshes] [--repeat 1] [--threads 2]
                         [--steps 3] [--out docs/bench-sizes.md] [ROW...]

Refines pairs of real meshes by √3 subdivision (Kobbelt 2000), which triples the triangles and smooths: the same two
shapes, at several sizes. Landmarks are vertices and keep their numbers. --base: the programs of an earlier version; both
then alternate on every row. ROW: parts of names of rows. Standard library only.
"""
import argparse
import json
import math
import os
import pathlib
import statistics
import sys
import tempfile

import surface
from first_answer import line, measure

ROOT = pathlib.Path(__file__).resolve().parents[2]
HEAD = """# What a merge costs by the size of its shapes

Written by `tests/bench/sizes.py`: pairs of real meshes, refined by √3 subdivision, which triples the triangles and
smooths. `orbmorph-bench merge` with {threads} threads; medians of {repeat}. *CPU* and *wall* cover everything from the
files to the asset; the stages are wall seconds. *Energy* is that of the map: 1 is an isometry. The load average at the end
was {load:.1f}; with other load, the seconds are upper bounds.

Later shapes of more than 9,000 vertices are aligned as decimated copies and follow them (docs/method.md). So the time of
an alignment grows with the vertices, and the number of trials no longer multiplies it.

"""
COLUMNS = ("row", "triangles", "CPU s", "wall s", "embed", "align", "remesh", "transfer", "energy")
ROWS = (("man–woman", "human_man.obj", "human_woman.obj", "human_man-human_woman.json"),
        ("man–woman", "human_man.obj", "human_woman.obj", None),
        ("dog–giraffe", "dog.obj", "giraffe.off", "dog-giraffe.json"),
        ("dog–giraffe", "dog.obj", "giraffe.off", None))


def subdivide(points, triangles):
    """One step of √3 subdivision. Vertices keep their numbers."""
    around = [set() for _ in points]
    beside = {}
    for t, (a, b, c) in enumerate(triangles):
        for p, q in ((a, b), (b, c), (c, a)):
            around[p].add(q)
            around[q].add(p)
            beside[p, q] = t
    count, moved = len(points), []
    for v, ring in enumerate(around):
        n = len(ring)
        share = (4 - 2 * math.cos(2 * math.pi / n)) / 9
        moved.append(tuple((1 - share) * points[v][k] + share / n * sum(points[w][k] for w in ring) for k in range(3)))
    for a, b, c in triangles:
        moved.append(tuple((points[a][k] + points[b][k] + points[c][k]) / 3 for k in range(3)))
    fine = [(p, count + beside[q, p], count + t) for (p, q), t in beside.items()]
    return moved, fine


def write(file, points, triangles):
    with file.open("w") as out:
        out.writelines("v %.9g %.9g %.9g\n" % p for p in points)
        out.writelines("f %d %d %d\n" % (a + 1, b + 1, c + 1) for a, b, c in triangles)


def read_shape(file):
    points, triangles = surface.read_mesh(file)
    return [tuple(p) for p in points], [tuple(t) for t in triangles]


def find(name, options):
    for folder in (ROOT / "tests/samples", options.meshes / "good"):
        if (folder / name).exists():
            return folder / name
    return None


def landmarks_of(name, folder, options):
    file = ROOT / "tests/samples" / name
    if file.exists():
        return file
    read = json.loads((options.meshes / "pairs" / name).read_text())
    first = read.get("index_base", 0)
    made = folder / name
    made.write_text(json.dumps([{"name": f"l{i}", "at": [{"vertex": v - first} for v in at]}
                                for i, at in enumerate(read["landmarks"])]))
    return made


def rows(options, folder):
    """Yields name, landmarks file or None, and the two files."""
    made = {}
    for name, one, other, marks in ROWS:
        given = [find(one, options), find(other, options)]
        if None in given:
            print(f"skipped: {name}, a mesh is missing", file=sys.stderr)
            continue
        marks_file = landmarks_of(marks, folder, options) if marks else None
        read = json.loads(marks_file.read_text()) if marks else []
        count = len(read["landmarks"] if isinstance(read, dict) else read)
        for step in range(options.steps + 1):
            for file in given:
                if (file, step) not in made:
                    shape = read_shape(file) if step == 0 else subdivide(*made[file, step - 1][0])
                    made[file, step] = shape, folder / f"{file.stem}-{step}.obj"
                    write(made[file, step][1], *shape)
            label = f"{name}, {count or 'no'} landmarks, ×{3 ** step}"
            if options.rows and not any(row in label for row in options.rows):
                continue
            yield label, marks_file, [made[file, step][1] for file in given]


def figures(program, row, options):
    name, marks, files = row
    arguments = ["--landmarks", marks, "--align-preset", "default"] if marks else ["--align", "auto"]
    found = [measure(program, arguments, files, options.threads) for _ in range(options.repeat)]
    middle = [statistics.median(values) for values in zip(*((cpu, wall) for cpu, wall, _ in found))]
    stages = {k: statistics.median(one["seconds"][k] for *_, one in found)
              for k in ("embed", "align", "remesh", "transfer")}
    return middle, stages, found[0][2]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", type=pathlib.Path)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "build/bin")
    parser.add_argument("--meshes", type=pathlib.Path, default=ROOT.parent / "shared/meshes")
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--steps", type=int, default=3)
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("rows", nargs="*", metavar="ROW")
    options = parser.parse_args()
    programs = {"base": options.base} if options.base else {}
    programs["now"] = options.bin
    with tempfile.TemporaryDirectory() as folder:
        text = line(COLUMNS) + line(["---"] + ["---:"] * (len(COLUMNS) - 1))
        print(text, end="", flush=True)
        for row in rows(options, pathlib.Path(folder)):
            for side, program in programs.items():
                (cpu, wall), stages, one = figures(program, row, options)
                made = line((row[0] + (" (base)" if side == "base" else ""), f"{triangle_count(row[2][0]):,}",
                             f"{cpu:.1f}", f"{wall:.1f}", *(f"{stages[k]:.1f}" for k in stages),
                             f"{one['energy']:.3f}"))
                text += made
                print(made, end="", flush=True)
    if options.out:
        options.out.write_text(HEAD.format(threads=options.threads, repeat=options.repeat, load=os.getloadavg()[0]) + text)


def triangle_count(file):
    with file.open() as lines:
        return sum(each.startswith("f") for each in lines)


if __name__ == "__main__":
    main()
