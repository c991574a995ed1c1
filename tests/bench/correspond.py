#!/usr/bin/env python3
"""Measures the maps of `auto` against dense truth, and writes docs/bench-correspond.md.

    tests/bench/correspond.py [--bin build/bin] [--base REVISION] [--meshes ../shared/meshes] [--half tune|report|all]
                              [--given 0,8] [--threads 1] [--jobs 1] [--out docs/bench-correspond.md] [A-B ...]

The pairs are those of MESHES/posed: people in poses, each triangulated by itself, with true places of the same points
on all of them. Pairs with an even number in pairs.csv are the half that constants are chosen on (`tune`); the others
are only for the report. --base measures an earlier version in the same run. --given N pins the first N true places by
`default`; 0 runs `auto`.

`orbmorph-bench truth` gives distances in space only, so each place is stated with four different targets: the four
distances yield the image, and the error is measured along the surface. Any version's program will do. Standard library
only.
"""
import argparse
import concurrent.futures
import csv
import heapq
import json
import math
import pathlib
import statistics
import subprocess
import sys
import tempfile

from first_answer import build_base

PLACES = 250  # of the 400; with four targets each they stay below the 1,024 landmarks of a request
RIGHT = 10
CURVE = (1, 2, 3, 4, 5, 7.5, 10, 15, 20, 30, 50)
HEAD = """# The map without landmarks, against dense truth

Written by `tests/bench/correspond.py` on bodies of six people in poses, each triangulated by itself ({half}). An error
is 100 · (length along the second surface between the image of a place and its true place) / √(its area), at {places}
places a pair. A pair is *right* if its mean is at most {right}. Constants are chosen on pairs with even numbers (`tune`)
only; the others (`report`) are for this page. Lengths are those of shortest paths over edges and across pairs of
triangles, which are up to a few percent long.
"""


def read_mesh(file):
    """Positions and triangles of an OBJ or OFF file of triangles."""
    lines = [line.split() for line in file.read_text().splitlines() if line.strip() and line[0] != "#"]
    if file.suffix == ".off":
        vertices, triangles = int(lines[1][0]), int(lines[1][1])
        return ([tuple(map(float, row[:3])) for row in lines[2:2 + vertices]],
                [tuple(map(int, row[1:4])) for row in lines[2 + vertices:2 + vertices + triangles]])
    return ([tuple(map(float, row[1:4])) for row in lines if row[0] == "v"],
            [tuple(int(x.split("/")[0]) - 1 for x in row[1:4]) for row in lines if row[0] == "f"])


def minus(p, q):
    return (p[0] - q[0], p[1] - q[1], p[2] - q[2])


def dot(p, q):
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def cross(p, q):
    return (p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0])


def closest(p, a, b, c):
    """The point of a triangle nearest to p (Ericson, Real-Time Collision Detection, 5.1.5)."""
    ab, ac, ap = minus(b, a), minus(c, a), minus(p, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    bp, cp = minus(p, b), minus(p, c)
    d3, d4, d5, d6 = dot(ab, bp), dot(ac, bp), dot(ab, cp), dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0 and d2 <= 0:
        v, w = 0, 0
    elif d3 >= 0 and d4 <= d3:
        v, w = 1, 0
    elif d6 >= 0 and d5 <= d6:
        v, w = 0, 1
    elif vc <= 0 <= d1 and d3 <= 0:
        v, w = d1 / (d1 - d3), 0
    elif vb <= 0 <= d2 and d6 <= 0:
        v, w = 0, d2 / (d2 - d6)
    elif va <= 0 and d4 >= d3 and d5 >= d6:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1 - w
    else:
        v, w = vb / (va + vb + vc), vc / (va + vb + vc)
    return tuple(a[k] + v * ab[k] + w * ac[k] for k in range(3))


class Surface:
    """A mesh with its true places, and shortest paths on it."""

    def __init__(self, file):
        self.file = file
        self.positions, self.triangles = read_mesh(file)
        with file.with_name(file.stem + ".truth.csv").open() as rows:
            self.places = [(int(r["triangle"]), tuple(float(r[f"b{k}"]) for k in range(3))) for r in csv.DictReader(rows)]
        corners = [[self.positions[v] for v in t] for t in self.triangles]
        self.area = sum(math.hypot(*cross(minus(b, a), minus(c, a))) / 2 for a, b, c in corners)
        low, high = (tuple(f(p[k] for p in self.positions) for k in range(3)) for f in (min, max))
        self.diagonal = math.dist(low, high)
        self.link_vertices()
        self.fill_cells()

    def link_vertices(self):
        self.links = [[] for _ in self.positions]
        opposite = {}
        for a, b, c in self.triangles:
            opposite[a, b], opposite[b, c], opposite[c, a] = c, a, b
        for (a, b), c in opposite.items():
            self.links[a].append((b, math.dist(self.positions[a], self.positions[b])))
            d = opposite[b, a]
            length = self.across(a, b, c, d)
            if length:
                self.links[c].append((d, length))

    def across(self, a, b, c, d):
        """The straight way from c to d over edge a–b, both triangles in one plane; None where it misses the edge."""
        edge, u, w = (minus(self.positions[v], self.positions[a]) for v in (b, c, d))
        length = math.hypot(*edge)
        cx, dx = dot(u, edge) / length, dot(w, edge) / length
        cy, dy = (math.sqrt(max(0, dot(p, p) - x * x)) for p, x in ((u, cx), (w, dx)))
        at = (cx * dy + dx * cy) / (cy + dy) if cy + dy else -1
        return math.hypot(cx - dx, cy + dy) if 0 < at < length else None

    def cell(self, p):
        return tuple(math.floor(x / self.size) for x in p)

    def fill_cells(self):
        self.size, self.cells = self.diagonal / 60, {}
        for t, corners in enumerate(self.triangles):
            ends = [self.cell(f(self.positions[v][k] for v in corners) for k in range(3)) for f in (min, max)]
            for x in range(ends[0][0], ends[1][0] + 1):
                for y in range(ends[0][1], ends[1][1] + 1):
                    for z in range(ends[0][2], ends[1][2] + 1):
                        self.cells.setdefault((x, y, z), []).append(t)

    def triangle_at(self, p):
        """The triangle that p lies on, p being on the surface but for rounding."""
        x, y, z = self.cell(p)
        near = {t for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)
                for t in self.cells.get((x + i, y + j, z + k), ())} or range(len(self.triangles))
        return min(near, key=lambda t: math.dist(p, closest(p, *(self.positions[v] for v in self.triangles[t]))))

    def position(self, place):
        corners = [self.positions[v] for v in self.triangles[place[0]]]
        return tuple(sum(w * corner[k] for w, corner in zip(place[1], corners)) for k in range(3))

    def error(self, place, image):
        """100 · length of the way from a place to an image / √area: A*, the straight line being the bound."""
        start, end = self.position(place), self.triangle_at(image)
        if set(self.triangles[place[0]]) & set(self.triangles[end]):
            return 100 * math.dist(start, image) / math.sqrt(self.area)
        last = {v: math.dist(self.positions[v], image) for v in self.triangles[end]}
        best, done, length = math.inf, set(), {}
        heap = []
        for v in self.triangles[place[0]]:
            length[v] = math.dist(start, self.positions[v])
            heapq.heappush(heap, (length[v] + math.dist(self.positions[v], image), v))
        while heap and heap[0][0] < best:
            v = heapq.heappop(heap)[1]
            if v in done:
                continue
            done.add(v)
            best = min(best, length[v] + last.get(v, math.inf))
            for u, step in self.links[v]:
                if length[v] + step < length.get(u, math.inf):
                    length[u] = length[v] + step
                    heapq.heappush(heap, (length[u] + math.dist(self.positions[u], image), u))
        return 100 * best / math.sqrt(self.area)


def anchors(surface):
    """Four places that span a large tetrahedron."""
    points = [surface.position(place) for place in surface.places]
    chosen = [0, max(range(len(points)), key=lambda i: math.dist(points[i], points[0]))]
    a, b = (points[i] for i in chosen)
    chosen.append(max(range(len(points)), key=lambda i: math.hypot(*cross(minus(b, a), minus(points[i], a)))))
    normal = cross(minus(b, a), minus(points[chosen[2]], a))
    chosen.append(max(range(len(points)), key=lambda i: abs(dot(normal, minus(points[i], a)))))
    return chosen


def solve(points, distances):
    """The point at these distances from four points: the differences of the squares are linear in it."""
    rows = [tuple(2 * (q - p) for p, q in zip(points[0], point)) for point in points[1:]]
    right = [distances[0] ** 2 - d * d + dot(p, p) - dot(points[0], points[0])
             for p, d in zip(points[1:], distances[1:])]
    determinant = dot(rows[0], cross(rows[1], rows[2]))
    sides = [cross(rows[1], rows[2]), cross(rows[2], rows[0]), cross(rows[0], rows[1])]
    return tuple(sum(r * side[k] for r, side in zip(right, sides)) / determinant for k in range(3))


def measure(program, first, second, given, threads):
    """Errors at the places, CPU seconds and energy of one map."""
    chosen = anchors(second)
    at = [{"triangle": t, "barycentric": list(w)} for t, w in first.places]
    to = [{"triangle": t, "barycentric": list(w)} for t, w in second.places]
    numbers = range(given, PLACES)
    marks = [{"name": str(i), "at": [at[i], to[i]]} for i in range(given)]
    marks += [{"name": f"{i} {k}", "at": [at[i], to[k]]} for i in numbers for k in chosen]
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        json.dump(marks, file)
        file.flush()
        run = subprocess.run([program, "truth", "--threads", str(threads), "--methods", "default" if given else "auto",
                              "--given", str(given), "--landmarks", file.name, first.file, second.file],
                             capture_output=True, text=True)
    if run.returncode != 0:
        sys.exit(f"{first.file.name} – {second.file.name}: {run.stderr}")
    line = json.loads(run.stdout)
    points = [second.position(second.places[k]) for k in chosen]
    held = [d * second.diagonal / 100 for d in line["held_out"]]
    images = [solve(points, held[4 * i:4 * i + 4]) for i in range(len(numbers))]
    errors = [second.error(second.places[i], image) for i, image in zip(numbers, images)]
    return {"errors": errors, "cpu": line["cpu_seconds"], "energy": line["energy"]}


def summary(name, given, results):
    means = [statistics.mean(r["errors"]) for r in results]
    whole = sorted(e for r in results for e in r["errors"])
    return [name, str(given), str(len(results)), f"{statistics.mean(means):.1f}", f"{statistics.median(means):.1f}",
            f"{sum(m <= RIGHT for m in means)} of {len(means)}", f"{whole[len(whole) * 95 // 100]:.1f}",
            f"{statistics.mean(r['cpu'] for r in results):.1f}"]


def curve(name, given, results):
    errors = [e for r in results for e in r["errors"]]
    return [name, str(given)] + [f"{100 * sum(e <= x for e in errors) / len(errors):.0f}" for x in CURVE]


def table(columns, rows):
    lines = ["| " + " | ".join(row) + " |" for row in [columns] + rows]
    return "\n".join([lines[0], "|" + "---|" * len(columns)] + lines[1:]) + "\n"


def read_pairs(folder, half, names):
    with (folder / "pairs.csv").open() as rows:
        pairs = [(i, r["A"], r["B"], r["kind"]) for i, r in enumerate(csv.DictReader(rows))]
    pairs = [p for p in pairs if half == "all" or p[0] % 2 == (half == "report")]
    return [p for p in pairs if not names or f"{pathlib.Path(p[1]).stem}-{pathlib.Path(p[2]).stem}" in names]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--base")
    parser.add_argument("--meshes", default="../shared/meshes")
    parser.add_argument("--half", choices=("tune", "report", "all"), default="all")
    parser.add_argument("--given", default="0", help="numbers with commas")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="maps at once")
    parser.add_argument("--out")
    parser.add_argument("pairs", nargs="*")
    options = parser.parse_args()
    folder = pathlib.Path(options.meshes) / "posed"
    programs = {"now": pathlib.Path(options.bin)}
    if options.base:
        programs[options.base] = build_base(options.base)
    pairs = read_pairs(folder, options.half, options.pairs)
    if not pairs:
        sys.exit("correspond.py: there is no such pair")
    surfaces = {name: Surface(folder / name) for name in {p[k] for p in pairs for k in (1, 2)}}
    given = [int(n) for n in options.given.split(",")]
    work = [(pair, number, name) for pair in pairs for number in given for name in programs]
    results, rows = {}, []

    def one(item):
        (_, first, second, _), number, name = item
        return measure(programs[name] / "orbmorph-bench", surfaces[first], surfaces[second], number, options.threads)

    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for (pair, number, name), result in zip(work, pool.map(one, work)):
            results.setdefault((name, number), []).append(result)
            errors = sorted(result["errors"])
            rows.append([str(pair[0]), pathlib.Path(pair[1]).stem, pathlib.Path(pair[2]).stem, pair[3], name, str(number),
                         f"{statistics.mean(errors):.1f}", f"{errors[len(errors) // 2]:.1f}",
                         f"{errors[len(errors) * 95 // 100]:.1f}", f"{result['energy']:.2f}", f"{result['cpu']:.1f}"])
            print("  ".join(rows[-1]), flush=True)
    text = HEAD.format(half={"tune": "the half that constants are chosen on", "report": "the half that nothing is "
                             "chosen on", "all": "all pairs"}[options.half], places=PLACES, right=RIGHT)
    text += "\n" + table(["version", "given", "pairs", "mean", "median", "right", "95th percentile", "CPU s"],
                         [summary(*key, value) for key, value in results.items()])
    text += "\nShare of the places, in %, with an error of at most:\n\n" + table(
        ["version", "given"] + [str(x) for x in CURVE], [curve(*key, value) for key, value in results.items()])
    text += "\n" + table(["pair", "first", "second", "kind", "version", "given", "mean", "median", "95th percentile",
                          "energy", "CPU s"], rows)
    print("\n" + text)
    if options.out:
        pathlib.Path(options.out).write_text(text)


if __name__ == "__main__":
    main()
