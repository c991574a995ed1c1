#!/usr/bin/env python3
"""Draws contact sheets of pairs, OUT/A-B.png, five poses each: real pairs with their landmarks, and generated ones without.

    tests/bench/contact_sheets.py [--bin build/bin] [--meshes ../shared/meshes] [--out docs/pairs] [--page docs/pairs.md] [PAIR...]

Merges each pair with the default options, and prints the JSON line of orbmorph-bench. Generated pairs are those of GENERATED, or
any two bodies that orbmorph-posed makes, such as dog-run+cow-sit. Skips a pair that is refused or exceeds the limit; the exit
status is then 1.
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


GENERATED = ("cat-stand+elephant-stand", "horse-stand+cow-stand", "head-stand+bust-stand")  # without landmarks


def real_pairs(options, folder):
    """The name, the meshes and the arguments of each pair that has landmarks."""
    for file in sorted((options.meshes / "pairs").glob("*.json")):
        if options.pairs and file.stem not in options.pairs:
            continue
        pair, marks = json.loads(file.read_text()), folder / f"{file.stem}.json"
        base = pair.get("index_base", 0)
        marks.write_text(json.dumps([{"name": f"l{i}", "at": [{"vertex": v - base} for v in at]}
                                     for i, at in enumerate(pair["landmarks"])]))
        yield file.stem, [options.meshes / "good" / mesh for mesh in pair["meshes"]], ["--landmarks", marks]


def generated_pairs(options, folder):
    for name in [pair for pair in options.pairs if "+" in pair] if options.pairs else GENERATED:
        bodies = name.split("+")
        for body in bodies:
            if subprocess.run([options.bin / "orbmorph-posed", folder, body], stdout=subprocess.DEVNULL).returncode:
                sys.exit(f"{name}: there is no body {body}")
        yield "-".join(bodies), [folder / f"{body}.obj" for body in bodies], ["--align", "auto"]


def draw(options, folder, name, meshes, how):
    """Merges a pair, and draws its sheet. Returns what was measured, or None."""
    glb = folder / "morph.glb"
    try:
        merged = subprocess.run([options.bin / "orbmorph-bench", "merge", *how, "--out", glb, *meshes],
                                stdout=subprocess.PIPE, text=True, timeout=options.limit)
    except subprocess.TimeoutExpired:
        print(f"{name}: given up after {options.limit:.0f} s", file=sys.stderr)
        return None
    if merged.returncode:
        return None
    print(merged.stdout.strip(), flush=True)
    subprocess.run([options.bin / "orbmorph", "view", glb, "--size", "240", "-o", options.out / f"{name}.png"],
                   check=True, stdout=sys.stderr)
    return json.loads(merged.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, default="build/bin")
    parser.add_argument("--meshes", type=pathlib.Path, default="../shared/meshes")
    parser.add_argument("--out", type=pathlib.Path, default="docs/pairs")
    parser.add_argument("--limit", type=float, default=60, help="abandon a merge after this many seconds")
    parser.add_argument("--page", type=pathlib.Path, help="write the table of all pairs into this page, such as docs/pairs.md")
    parser.add_argument("pairs", nargs="*", help="such as cow-spot or cat-run+dog-lift (default: all)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    refused, rows = 0, []
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        for pairs in real_pairs, generated_pairs:
            for name, meshes, how in pairs(options, folder):
                run = draw(options, folder, name, meshes, how)
                refused += run is None
                rows += [row(meshes, run)] if run else []
    if options.page:
        put_table(options.page, rows)
    sys.exit(1 if refused else 0)


if __name__ == "__main__":
    main()
