#!/usr/bin/env python3
"""Draws the contact sheet of every pair with landmarks: OUT/A-B.png, five poses each.

    tests/bench/contact_sheets.py [--bin build/bin] [--meshes ../shared/meshes] [--out docs/pairs] [--page docs/pairs.md] [PAIR...]

Merges each pair with its landmarks and the default options, and prints the JSON line of orbmorph-bench. Skips a pair
that is refused or exceeds the limit; the exit status is then 1.
Standard library only.
"""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

TABLE = "| pair | landmarks | triangles | farthest % | rms % | distortion | inverted % | align s | all s |"


def row(meshes, run):
    """A pair's line: the worse of the two shapes, the median energy of the map, wall seconds."""
    shapes, pair, seconds = run["shapes"], run["pairs"][0], run["seconds"]
    farthest, rms = (100 * max(shape[key] for shape in shapes) for key in ("hausdorff_relative", "rms_relative"))
    cells = [" – ".join(pathlib.Path(mesh).stem for mesh in meshes), len(run["landmarks"]), f"{run['triangles']:,}",
             f"{farthest:.3f}", f"{rms:.3f}", f"{pair['distortion']['symmetric_dirichlet']['median']:.2f}",
             f"{100 * pair['inverted_fraction']:.2f}", f"{seconds['align']:.1f}",
             f"{seconds['total'] - seconds['read'] - seconds['embed']:.1f}"]
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def put_table(page, rows):
    before, after = page.read_text(encoding="utf-8").split(TABLE, 1)
    rest = after.split("\n\n", 1)[1]
    page.write_text(before + "\n".join([TABLE, "|---" * 9 + "|", *rows]) + "\n\n" + rest, encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, default="build/bin")
    parser.add_argument("--meshes", type=pathlib.Path, default="../shared/meshes")
    parser.add_argument("--out", type=pathlib.Path, default="docs/pairs")
    parser.add_argument("--limit", type=float, default=60, help="abandon a merge after this many seconds")
    parser.add_argument("--page", type=pathlib.Path, help="write the table of all pairs into this page, such as docs/pairs.md")
    parser.add_argument("pairs", nargs="*", help="such as cow-spot (default: all)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    refused, rows = 0, []
    with tempfile.TemporaryDirectory() as folder:
        for file in sorted((options.meshes / "pairs").glob("*.json")):
            if options.pairs and file.stem not in options.pairs:
                continue
            pair, marks, glb = json.loads(file.read_text()), pathlib.Path(folder, "marks.json"), pathlib.Path(folder, "morph.glb")
            base = pair.get("index_base", 0)
            marks.write_text(json.dumps([{"name": f"l{i}", "at": [{"vertex": v - base} for v in at]}
                                         for i, at in enumerate(pair["landmarks"])]))
            command = [options.bin / "orbmorph-bench", "merge", "--landmarks", marks, "--out", glb,
                       *(options.meshes / "good" / mesh for mesh in pair["meshes"])]
            try:
                merged = subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=options.limit)
            except subprocess.TimeoutExpired:
                merged = None
                print(f"{file.stem}: given up after {options.limit:.0f} s", file=sys.stderr)
            if not merged or merged.returncode:
                refused += 1
                continue
            print(merged.stdout.strip(), flush=True)
            rows.append(row(pair["meshes"], json.loads(merged.stdout)))
            subprocess.run([options.bin / "orbmorph", "view", glb, "--size", "240", "-o",
                            options.out / f"{file.stem}.png"], check=True, stdout=sys.stderr)
    if options.page:
        put_table(options.page, rows)
    sys.exit(1 if refused else 0)


if __name__ == "__main__":
    main()
