#!/usr/bin/env python3
"""Compares the time to a first answer with an earlier version in the same run; writes docs/bench-first-answer.md.

    tests/bench/first_answer.py [--base REVISION] [--bin build/bin] [--meshes ../shared/meshes] [--repeat 3]
                                [--threads 2] [--pairs 12] [--out docs/bench-first-answer.md] [ROW...]

Builds the base (8bbd71c) once in the cache folder, then alternates between both versions on every row: `orbmorph-bench
merge` reads, embeds, aligns and remeshes two shapes and writes the asset, without a store. CPU and wall seconds are
medians of the repeats. A ratio is base / this version, so more than 1 is faster. Then all rows are measured over HTTP, each
with a daemon that has just started: two uploads and one POST that waits for the asset. --pairs N adds N pairs without
landmarks, spread evenly over all pairs of the good meshes. Standard library only; needs cmake, git and curl.
"""
import argparse
import csv
import itertools
import json
import os
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.parse
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parents[2]
HEAD = """# The first answer

Written by `tests/bench/first_answer.py`. It alternates between version {base} and this version in one run with {threads}
threads; the numbers are medians of {repeat}. A ratio is {base} / this version: more than 1 is faster. *CPU* and *wall*
cover everything from the files to the asset; the stages are ratios of their wall seconds, on one machine with {cores} cores. *Energy* is
that of the map, *triangles* are those of the supermesh, both as base → now. The load average at the end was {load:.0f}:
with other load, the seconds are upper bounds, and the ratios hold, since both versions met the same load.

"""
COLUMNS = ("row", "CPU s", "ratio", "wall s", "ratio", "embed", "align", "remesh", "transfer", "energy", "triangles")


def build_base(revision):
    """The folder of the programs of an earlier version. Builds them once."""
    cache = pathlib.Path(os.environ.get("XDG_CACHE_HOME", pathlib.Path.home() / ".cache")) / "orbmorph-bench"
    sha = subprocess.run(["git", "-C", ROOT, "rev-parse", revision], capture_output=True, text=True,
                         check=True).stdout.strip()
    folder = cache / sha
    if not (folder / "build/bin/orbmorph-bench").exists():
        cache.mkdir(parents=True, exist_ok=True)
        subprocess.run(["git", "-C", ROOT, "worktree", "add", "-f", "--detach", folder, sha], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        subprocess.run(["cmake", "--preset", "release", "-DORB_TESTS=OFF"], cwd=folder, check=True, stdout=sys.stderr)
        subprocess.run(["cmake", "--build", "build"], cwd=folder, check=True, stdout=sys.stderr)
    return folder / "build/bin"


def marks_of(pair, folder):
    read = json.loads(pair.read_text())
    base = read.get("index_base", 0)
    file = pathlib.Path(folder, pair.stem + ".json")
    file.write_text(json.dumps([{"name": f"l{i}", "at": [{"vertex": v - base} for v in at]}
                                for i, at in enumerate(read["landmarks"])]))
    return file


def rows(options, folder):
    """Yields name, arguments of orbmorph-bench merge and files."""
    samples, good = ROOT / "tests/samples", options.meshes / "good"
    dog, giraffe = samples / "dog.obj", samples / "giraffe.off"
    marks = samples / "dog-giraffe.json"
    for preset in ("fast", "default"):
        yield f"dog–giraffe, 21 landmarks, {preset}", ["--landmarks", marks, "--align-preset", preset], [dog, giraffe]
    yield "dog–giraffe, no landmarks", ["--align", "auto"], [dog, giraffe]
    yield "dog–elephant, no landmarks", ["--align", "auto"], [dog, samples / "elephant.ply"]
    if not good.is_dir():
        print("skipped: the real meshes are missing", file=sys.stderr)
        return
    for pair in sorted((options.meshes / "pairs").glob("*.json")):
        read = json.loads(pair.read_text())
        files = [good / mesh for mesh in read["meshes"]]
        for preset in ("fast", "default"):
            yield (f"{pair.stem}, {len(read['landmarks'])} landmarks, {preset}",
                   ["--landmarks", marks_of(pair, folder), "--align-preset", preset], files)
    with open(options.meshes / "index.csv", newline="", encoding="utf-8") as table:
        listed = list(csv.DictReader(table))
    names = [row["name"] for row in listed if row["kind"] == "good" and 2000 <= int(row["usable_f"] or 0) <= 50000]
    pairs = list(itertools.combinations(sorted(names), 2))
    step = max(1, len(pairs) // max(1, options.pairs))
    for a, b in pairs[::step][:options.pairs]:
        yield f"{pathlib.Path(a).stem}–{pathlib.Path(b).stem}, no landmarks", ["--align", "auto"], [good / a, good / b]


def measure(program, arguments, files, threads):
    command = [program / "orbmorph-bench", "merge", "--threads", str(threads), *arguments, *files]
    before = os.times()
    start = time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    wall, after = time.monotonic() - start, os.times()
    if done.returncode != 0:
        sys.exit(f"{command}: {done.stderr.strip()}")
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return cpu, wall, json.loads(done.stdout)


def cold(program, members, files):
    """Seconds from the first upload to the last byte of the asset, with a daemon that has just started."""
    with tempfile.TemporaryDirectory() as data:
        daemon = subprocess.Popen([program / "orbmorphd", "--listen", "127.0.0.1:0", "--data", data],
                                  stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        try:
            url = re.search(r"http://\S+", daemon.stdout.readline())[0]

            def send(path, body, kind):
                request = urllib.request.Request(url + path, data=body, method="POST",
                                                 headers={"Content-Type": kind, "Prefer": "wait=60"})
                with urllib.request.urlopen(request) as answer:
                    return json.load(answer)

            start = time.monotonic()
            ids = [send(f"/v1/meshes?name={urllib.parse.quote(file.stem)}", file.read_bytes(), "application/octet-stream")["id"]
                   for file in files]
            request = json.dumps({"shapes": [{"mesh": i} for i in ids], **members}).encode()
            made = {}
            while "asset" not in made:  # the base takes more than the longest wait for some
                made = send("/v1/supermeshes", request, "application/json")
            with urllib.request.urlopen(url + made["asset"]) as answer:
                answer.read()
            return time.monotonic() - start
        finally:
            daemon.terminate()
            daemon.wait()


def line(cells):
    return "| " + " | ".join(str(cell) for cell in cells) + " |\n"


def run_row(programs, row, options):
    """One line of the table: the median of every figure over the repeats."""
    name, arguments, files = row
    found = {"base": [], "now": []}
    for _ in range(options.repeat):
        for side in found:
            found[side].append(measure(programs[side], arguments, files, options.threads))
    cpu, wall = ({side: statistics.median(run[k] for run in found[side]) for side in found} for k in (0, 1))
    stages = {stage: {side: statistics.median(run[2]["seconds"][stage] for run in found[side]) for side in found}
              for stage in ("embed", "align", "remesh", "transfer")}
    last = {side: found[side][-1][2] for side in found}
    energy = " → ".join("–" if last[side].get("energy") is None else f"{last[side]['energy']:.3f}" for side in found)
    cells = [name, f"{cpu['now']:.2f}", f"{cpu['base'] / cpu['now']:.1f}", f"{wall['now']:.2f}",
             f"{wall['base'] / wall['now']:.1f}",
             *(f"{times['base'] / max(times['now'], 1e-6):.1f}" for times in stages.values()), energy,
             " → ".join(f"{last[side]['triangles']:,}" for side in found)]
    return cells, cpu, stages


def members_of(arguments):
    """The members of the request that asks for what these arguments of orbmorph-bench merge do."""
    given = dict(zip(arguments[::2], arguments[1::2]))
    if "--landmarks" not in given:
        return {}
    read = json.loads(pathlib.Path(given["--landmarks"]).read_text())
    return {"landmarks": read["landmarks"] if isinstance(read, dict) else read,
            "align": {"options": {"preset": given["--align-preset"]}}}


def cold_table(programs, chosen, options):
    """The rows again, over HTTP, and their medians."""
    text = "## Cold over HTTP\n\nFrom the first upload to the last byte of the asset, with a daemon that has just started.\n\n"
    text += line(("request", "base s", "now s", "ratio")) + "|---" * 4 + "|\n"
    kinds = {"fast": [], "default": [], "no landmarks": []}
    for name, arguments, files in chosen:
        runs = [{side: cold(program, members_of(arguments), files) for side, program in programs.items()}
                for _ in range(options.repeat)]
        seconds = {side: statistics.median(run[side] for run in runs) for side in programs}
        kinds[name.split(", ")[-1]].append(seconds)
        text += line((name, f"{seconds['base']:.2f}", f"{seconds['now']:.2f}", f"{seconds['base'] / seconds['now']:.1f}"))
        print(text.splitlines()[-1], flush=True)
    text += "\n" + line(("median of", "rows", "base s", "now s", "at most", "ratio")) + "|---" * 6 + "|\n"
    for kind, found in ((kind, found) for kind, found in kinds.items() if found):
        base, now = (statistics.median(one[side] for one in found) for side in programs)
        ratio = statistics.median(one["base"] / one["now"] for one in found)
        text += line((kind if kind == "no landmarks" else f"landmarks, {kind}", len(found), f"{base:.2f}", f"{now:.2f}",
                      f"{max(one['now'] for one in found):.2f}", f"{ratio:.1f}"))
    return text


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", default="8bbd71c")
    parser.add_argument("--bin", type=pathlib.Path, default="build/bin")
    parser.add_argument("--meshes", type=pathlib.Path, default=ROOT.parent / "shared" / "meshes")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--pairs", type=int, default=12)
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("rows", nargs="*", help="parts of row names (default: all rows)")
    options = parser.parse_args()
    programs = {"base": build_base(options.base), "now": options.bin}
    text = HEAD.format(base=options.base, threads=options.threads, repeat=options.repeat, cores=os.cpu_count(),
                       load=os.getloadavg()[0])
    text += line(COLUMNS) + "|---" * len(COLUMNS) + "|\n"
    ratios = []
    with tempfile.TemporaryDirectory() as folder:
        chosen = [row for row in rows(options, folder) if not options.rows or any(part in row[0] for part in options.rows)]
        if not chosen:
            sys.exit("no row has such a name")
        for row in chosen:
            cells, cpu, _ = run_row(programs, row, options)
            ratios.append(cpu["base"] / cpu["now"])
            text += line(cells)
            print(line(cells), end="", flush=True)
        text += f"\nCPU, all rows: {statistics.median(ratios):.2f} in the median, {min(ratios):.2f} at least.\n\n"
        text += cold_table(programs, chosen, options)
    print(text.split("| median of")[1])
    if options.out:
        options.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
