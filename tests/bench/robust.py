#!/usr/bin/env python3
"""Merges real meshes with random landmarks, and every pair of them without landmarks; writes docs/robustness.md.

    tests/bench/robust.py [landmarks|awkward|pairs|all] [--bin build/bin] [--meshes ../shared/meshes] [--jobs 2] [--sets 1000]
                          [--presets fast,default] [--keep DIR] [--out docs/robustness.md] [--kept]

The meshes are the good ones of index.csv with 2,000 to 50,000 triangles. --keep stores the result of every set and
pair, so an interrupted run can continue; --kept runs nothing and writes the stored results. Exit status 1: fewer than
99 % of the sets were met, a refusal named no landmark, a pair failed, or some have not run yet. Standard library
only.
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
CHUNK = 25  # sets or pairs per process
HEAD = """# Random landmarks, and every pair

Written by `tests/bench/robust.py`, on the real meshes of 2,000 to 50,000 triangles.

| what | run | certified | failed |
|---|---|---|---|
"""
LANDMARKS = """
## Random landmarks

A set takes two meshes and the same number of places on each: random vertices, points inside triangles and points on edges. It
matches them in random order, so the surfaces must wind around each other. The method is `pin` with the preset `fast`. CPU seconds
are those of one thread; the machine had other load.

* *met*: certified in exact arithmetic, closed, landmarks at bit-equal points on both spheres
* *growth*: the number of triangles after alignment divided by that before, of the mesh that grew more
"""
AWKWARD = """
## Awkward landmarks

Each set has eight landmarks on two of the meshes. The sets cycle through four kinds of first landmarks: on adjacent vertices of
one mesh; on adjacent vertices of both; three inside one triangle of one mesh and on one edge of the other; two at one place of one
mesh only. The last kind is a contradiction: the request must be refused, and the refusal must name both.
"""
PAIRS = """
## Every pair

Every pair of the meshes without landmarks: `auto`, and `adaptive` with the tolerance 0.1 %. A dash means not run yet.

* *certified*: closed, of genus zero, no triangle flipped
* *triangles*: those of the supermesh
* *energy*: that of the composed map; 1 for an isometry
* *inverted*: the share of inverted triangles
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


def run(options, name, command, total, arguments, meshes):
    """Returns all lines of one command: the stored ones, and the rest, which it runs in chunks."""
    keep = pathlib.Path(options.keep)
    keep.mkdir(parents=True, exist_ok=True)

    def one(first):
        path = keep / f"{name}-{first}.jsonl"
        lines, count = lines_of(path), min(CHUNK, total - first)
        if len(lines) < count and not options.kept:
            path.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
            with open(path, "a", encoding="utf-8") as file:
                call = [str(pathlib.Path(options.bin) / "orbmorph-bench"), command, "--threads", str(options.threads), "--first",
                        str(first + len(lines)), "--sets", str(count - len(lines)), "--seconds", str(options.seconds),
                        *arguments, *meshes]
                subprocess.run(call, stdout=file, check=True, preexec_fn=lambda: os.nice(19))
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


def is_certified(line):
    return line["status"] == "ok" and line["certificate"]["closed"] and not any(line["certificate"]["flipped"])


def pair_cells(line):
    if line is None:
        return "– | | | "
    if not is_certified(line):
        return f"{line['status']}: {line['detail']} | | | {line['cpu_seconds']:.1f}"
    energy = "" if line["energy"] is None else f"{line['energy']:.2f}"
    return f"{line['triangles']:,} | {energy} | {100 * (line['inverted'] or 0):.2f} | {line['cpu_seconds']:.1f}"


def pairs_table(runs):
    """runs maps a preset to its lines."""
    by_name = {preset: {tuple(line["shapes"]): line for line in lines} for preset, lines in runs.items()}
    names = list(dict.fromkeys(tuple(line["shapes"]) for lines in runs.values() for line in lines))
    text = ["| pair |" + "".join(f" {p}: triangles | energy | inverted % | CPU s |" for p in runs),
            "|---|" + "---|---|---|---|" * len(runs)]
    for name in names:
        text.append(f"| {' – '.join(name)} | " + " | ".join(pair_cells(by_name[p].get(name)) for p in runs) + " |")
    return text


def pairs_summary(preset, lines):
    met = [line for line in lines if is_certified(line)]
    over = sum(line["bound_relative"] > 0.001 for line in met)
    bound = f", {over} of them with a bound above the tolerance" if over else ", the proved bound within the tolerance"
    cpu, wall = [line["cpu_seconds"] for line in lines], [line["seconds"] for line in lines]
    return (f"| pairs, `{preset}`; CPU s {quantile(cpu, 0.5):.1f} in the median, {quantile(cpu, 1):.1f} at most; wall s "
            f"{quantile(wall, 0.5):.2f} and {quantile(wall, 1):.1f} | {len(lines)} | {len(met)}{bound} | {len(lines) - len(met)} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="?", default="all", choices=["landmarks", "awkward", "pairs", "all"])
    parser.add_argument("--bin", default=ROOT / "build/bin")
    parser.add_argument("--meshes", default=ROOT.parent / "shared/meshes")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--threads", type=int, default=1, help="of each program: 2 with --jobs 1 for wall seconds")
    parser.add_argument("--sets", type=int, default=1000)
    parser.add_argument("--awkward", type=int, default=100, help="sets of awkward landmarks")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--merge-every", type=int, default=0)
    parser.add_argument("--seconds", type=int, default=3600, help="a set or pair that takes longer counts as failed")
    parser.add_argument("--presets", default="fast,default", help="alignment presets of the pairs")
    parser.add_argument("--keep", default=pathlib.Path(tempfile.gettempdir()) / "orbmorph-robust")
    parser.add_argument("--kept", action="store_true", help="run nothing, write the stored results")
    parser.add_argument("--row", action="append", default=[], help="a further row of the summary: what|run|met|failed")
    parser.add_argument("--note", default="", help="a sentence below the summary")
    parser.add_argument("--out", help="the Markdown file (default: print the tables)")
    options = parser.parse_args()
    meshes, summary, text, bad = meshes_of(pathlib.Path(options.meshes)), [], [], False
    if options.what in ("landmarks", "all"):
        arguments = ["--seed", str(options.seed), "--merge-every", str(options.merge_every)]
        lines = run(options, f"landmarks-{options.seed}", "landmarks", options.sets, arguments, meshes)
        table, failed = landmarks_table(lines)
        share = f" ({100 * (1 - len(failed) / len(lines)):.2f} %)" if lines else ""
        summary.append(f"| sets of random landmarks, seed {options.seed} | {len(lines)} | {len(lines) - len(failed)}{share} "
                       f"| {len(failed)} |")
        text += [LANDMARKS, *table]
        bad |= len(failed) > 0.01 * len(lines) or any(line["status"] != "ok" and not line["named"] for line in failed)
        bad |= len(lines) < options.sets
    if options.what in ("awkward", "all"):
        lines = run(options, "awkward", "landmarks", options.awkward, ["--sizes", "awkward"], meshes)
        met = [line for line in lines if line["right"] and (line["status"] == "ok") != line.get("contradicts", False)]
        named = sum(line["contradicts"] for line in met)
        text += [AWKWARD] + [f"\nSet {line['set']} ({' – '.join(line['shapes'])}): {line['detail']}"
                             for line in lines if line not in met]
        summary.append(f"| awkward sets | {len(lines)} | {len(met) - named}, and {named} contradictory ones refused, both "
                       f"landmarks named | {len(lines) - len(met)} |")
        bad |= len(met) < options.awkward
    if options.what in ("pairs", "all"):
        total, runs = len(meshes) * (len(meshes) - 1) // 2, {}
        for preset in options.presets.split(","):
            runs[preset] = run(options, f"pairs-{preset}", "pairs", total, ["--align-preset", preset], meshes)
            if runs[preset]:
                summary.append(pairs_summary(preset, runs[preset]))
            bad |= len(runs[preset]) < total or not all(map(is_certified, runs[preset]))
        text += [PAIRS, *pairs_table(runs)]
    summary += [f"| {' | '.join(row.split('|'))} |" for row in options.row]
    summary += ["", options.note] if options.note else []
    page = HEAD + "\n".join(summary + text) + "\n"
    if options.out:
        pathlib.Path(options.out).write_text(page, encoding="utf-8")
    else:
        print(page)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
