#!/usr/bin/env python3
"""Random landmarks on real meshes, and every pair of them without any; writes docs/robustness.md.

    tests/bench/robust.py [landmarks|pairs|all] [--bin build/bin] [--meshes ../shared/meshes] [--jobs 2] [--sets 1000]
                          [--preset default|fast|quality] [--keep DIR] [--out docs/robustness.md]

The meshes are those that index.csv calls good and that have 2,000 to 50,000 triangles. Lines that a run before left in
--keep are taken over, so that a long run can be interrupted. Exit status 1: fewer than 99 % of the sets could be met, a
refusal named no landmark, or a pair failed. Standard library only.
"""
import argparse
import concurrent.futures
import csv
import json
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
CHUNK = 50  # sets or pairs a process
HEAD = """# Landmarks at random, and every pair

Written by `tests/bench/robust.py` on the real meshes of 2,000 to 50,000 triangles. CPU seconds are of one thread, the
library's own; the machine had other work.
"""
LANDMARKS = """## Random landmarks

Each set takes two meshes and as many places on each, at random vertices, inside triangles and on edges, and matches
them in random order: far harder than what anyone would mark, since the surfaces must be wound about each other. `pin`
with the preset `fast`. Met: certified in exact arithmetic, closed, landmarks at bit-equal points on both spheres.
Growth is how many times its triangles the mesh that grew more has afterwards; a set of 60 on a mesh of a few hundred
triangles needs most.
"""
PAIRS = """## Every pair

No landmarks, `auto`, `adaptive` at the tolerance 0.1 %. Certified: closed, of genus zero, nothing flipped on the
sphere. *Bound* is the proved distance from either input, in % of its diagonal; *energy* that of the composed map
(1: isometric), *inverted* the share of triangles turned in space.
"""


def meshes_of(folder):
    with open(folder / "index.csv", newline="", encoding="utf-8") as file:
        return [str(folder / "good" / row["name"]) for row in csv.DictReader(file)
                if row["kind"] == "good" and 2000 <= int(row["usable_f"] or 0) <= 50000]


def lines_of(path):
    try:
        with open(path, encoding="utf-8") as file:
            return [json.loads(line) for line in file if line.endswith("\n")]
    except FileNotFoundError:
        return []


def run(options, name, total, arguments, meshes):
    """All lines of one command: what is kept, and the rest run in chunks."""
    keep = pathlib.Path(options.keep)
    keep.mkdir(parents=True, exist_ok=True)

    def one(first):
        path = keep / f"{name}-{first}.jsonl"
        count = min(CHUNK, total - first)
        if len(lines_of(path)) < count:
            with open(path, "w", encoding="utf-8") as file:
                command = [str(pathlib.Path(options.bin) / "orbmorph-bench"), name, "--threads", "1", "--first", str(first),
                           "--sets", str(count), "--seconds", str(options.seconds), *arguments, *meshes]
                subprocess.run(command, stdout=file, check=True, preexec_fn=lambda: os.nice(19))
        print(f"{name} {first + count} of {total}", file=sys.stderr)
        return lines_of(path)

    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        return [line for part in pool.map(one, range(0, total, CHUNK)) for line in part]


def quantile(values, share):
    values = sorted(values)
    return values[min(len(values) - 1, int(share * len(values)))] if values else float("nan")


def landmarks_table(lines):
    text = ["| landmarks | sets | met | refused, named | growth: median | 90 % | most | CPU s: median | 90 % | most |",
            "|---|---|---|---|---|---|---|---|---|---|"]
    for size in sorted({line["landmarks"] for line in lines}):
        rows = [line for line in lines if line["landmarks"] == size]
        met = [line for line in rows if line["status"] == "ok" and line["right"]]
        named = [line for line in rows if line["status"] != "ok" and line["named"] > 0]
        growth, cpu = [max(line["growth"]) for line in met], [line["cpu_seconds"] for line in rows]
        cells = [size, len(rows), len(met), len(named)]
        cells += [f"{quantile(growth, q):.2f}" for q in (0.5, 0.9, 1)] + [f"{quantile(cpu, q):.2f}" for q in (0.5, 0.9, 1)]
        text.append("| " + " | ".join(map(str, cells)) + " |")
    failed = [line for line in lines if not (line["status"] == "ok" and line["right"])]
    for line in failed:
        text.append(f"\nSet {line['set']} ({' – '.join(line['shapes'])}, {line['landmarks']}): {line['detail']}")
    remeshed = [line for line in lines if "remesh_seconds" in line]
    if remeshed:
        worst, most = max(line["bound_relative"] for line in remeshed), max(line["triangles"] for line in remeshed)
        text.append(f"\n{len(remeshed)} of them went through `adaptive` as well: all certified, the proved bound at most "
                    f"{100 * worst:.3f} % of the diagonal, at most {most:,} triangles.")
    return text, failed


def pairs_table(lines):
    text = ["| pair | triangles | of the larger input | bound % | rms % | energy | inverted % | CPU s |",
            "|---|---|---|---|---|---|---|---|"]
    failed = []
    for line in lines:
        name = " – ".join(line["shapes"])
        if line["status"] != "ok" or not line["certificate"]["closed"] or any(line["certificate"]["flipped"]):
            failed.append(line)
            text.append(f"| {name} | {line['status']}: {line['detail']} | | | | | | {line['cpu_seconds']:.1f} |")
            continue
        energy = "" if line["energy"] is None else f"{line['energy']:.2f}"
        text.append(f"| {name} | {line['triangles']:,} | {line['triangles'] / line['largest_input']:.2f} | "
                    f"{100 * line['bound_relative']:.3f} | {100 * line['rms_relative']:.3f} | {energy} | "
                    f"{100 * (line['inverted'] or 0):.2f} | {line['cpu_seconds']:.1f} |")
    return text, failed


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="?", default="all", choices=["landmarks", "pairs", "all"])
    parser.add_argument("--bin", default=ROOT / "build/bin")
    parser.add_argument("--meshes", default=ROOT.parent / "shared/meshes")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--sets", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--merge-every", type=int, default=0)
    parser.add_argument("--seconds", type=int, default=3600, help="after which a set or pair counts as failed")
    parser.add_argument("--preset", default="default", help="of the alignment of pairs")
    parser.add_argument("--keep", default=pathlib.Path(tempfile.gettempdir()) / "orbmorph-robust")
    parser.add_argument("--out", help="the Markdown file; else the tables are printed")
    options = parser.parse_args()
    meshes, text, bad = meshes_of(pathlib.Path(options.meshes)), [HEAD], 0
    if options.what in ("landmarks", "all"):
        arguments = ["--seed", str(options.seed), "--merge-every", str(options.merge_every)]
        lines = run(options, "landmarks", options.sets, arguments, meshes)
        table, failed = landmarks_table(lines)
        text += [LANDMARKS, f"{len(lines)} sets, {len(lines) - len(failed)} met "
                 f"({100 * (1 - len(failed) / len(lines)):.2f} %).", "", *table, ""]
        bad |= len(failed) > 0.01 * len(lines) or any(line["status"] != "ok" and not line["named"] for line in failed)
    if options.what in ("pairs", "all"):
        total = len(meshes) * (len(meshes) - 1) // 2
        lines = run(options, "pairs", total, ["--align-preset", options.preset], meshes)
        table, failed = pairs_table(lines)
        over = sum(line["status"] == "ok" and line["bound_relative"] > 0.001 for line in lines)
        text += [PAIRS, f"{len(lines)} pairs, {len(lines) - len(failed)} certified, {over} of them with a bound above the "
                 f"tolerance; preset `{options.preset}`.", "", *table, ""]
        bad |= bool(failed)
    if options.out:
        pathlib.Path(options.out).write_text("\n".join(text), encoding="utf-8")
    else:
        print("\n".join(text))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
