#!/usr/bin/env python3
"""Times the alignment without landmarks of pairs of real meshes, with several versions by turns.

    tests/bench/by_turns.py [--meshes ../shared/meshes] [--every 26] [--first 0] [--threads 2] BIN BIN...

Every BIN is a folder of programs. The pairs are those of docs/robustness.md: all two of the good meshes of 2,000 to
50,000 triangles; every 26th is measured, from number --first on. All versions align a pair one after another, so they
meet the same load. Prints the energy, CPU and wall seconds of each, and their medians and ratios to the first version.
The seconds include reading, embedding, remeshing and a measurement of the map, which takes about 0.1 s. Standard
library only.
"""
import argparse
import csv
import itertools
import json
import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile
import time


def pairs_of(meshes):
    with open(meshes / "index.csv", newline="", encoding="utf-8") as rows:
        names = [row["name"] for row in csv.DictReader(rows)
                 if row["kind"] == "good" and 2000 <= int(row["usable_f"] or 0) <= 50000]
    return list(itertools.combinations([meshes / "good" / name for name in names], 2))


def measure(program, pair, threads, landmarks):
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    command = [program / "orbmorph-bench", "truth", "--threads", str(threads), "--methods", "auto", "--given", "0",
               "--landmarks", landmarks, *pair]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    wall, after = time.monotonic() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        sys.exit(f"{program}: {done.stderr}")
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads(done.stdout)["energy"], cpu, wall


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bins", nargs="+", type=pathlib.Path, metavar="BIN")
    parser.add_argument("--meshes", type=pathlib.Path, default="../shared/meshes")
    parser.add_argument("--every", type=int, default=26)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    if not (options.meshes / "index.csv").exists():
        print(f"skipped: there are no meshes in {options.meshes}")
        return
    results = []
    with tempfile.TemporaryDirectory() as folder:
        none = pathlib.Path(folder, "none.json")
        none.write_text("[]")
        for pair in pairs_of(options.meshes)[options.first::options.every]:
            turn = len(results) % len(options.bins)  # another one reads the files first each time
            order = options.bins[turn:] + options.bins[:turn]
            measured = {program: measure(program, pair, options.threads, none) for program in order}
            results.append([measured[program] for program in options.bins])
            print(f"{pair[0].stem}–{pair[1].stem}: " +
                  "; ".join(f"energy {e:.3f}, CPU {c:.2f} s, wall {w:.2f} s" for e, c, w in results[-1]), flush=True)
    for i, program in enumerate(options.bins if results else []):
        own, first = [row[i] for row in results], [row[0] for row in results]
        ratios = [statistics.median(a[k] / b[k] for a, b in zip(own, first)) for k in range(3)]
        print(f"{program}: CPU {statistics.median(r[1] for r in own):.2f} s, wall "
              f"{statistics.median(r[2] for r in own):.2f} s in the median, {max(r[2] for r in own):.2f} s at most; "
              f"ratios to the first: energy {ratios[0]:.3f}, CPU {ratios[1]:.2f}, wall {ratios[2]:.2f}")


if __name__ == "__main__":
    main()
