#!/usr/bin/env python3
"""Measures the profiles of the assets of real pairs and writes docs/bench-profiles.md.

    tests/bench/profiles.py [--bin build/bin] [--meshes ../shared/meshes] [--out docs] [--keep DIR]

Merges each pair of MESHES/pairs with its landmarks, writes the profiles with bench-profile, and compresses the same float
asset with gltfpack where that is installed, for comparison only. --keep stores the float assets between runs. Standard
library only.
"""
import argparse
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile


def float_asset(options, name, keep, folder):
    """The pair's asset; merged unless it was kept."""
    about = json.loads((options.meshes / "pairs" / f"{name}.json").read_text())
    base, asset, marks = about.get("index_base", 0), keep / f"{name}.glb", folder / f"{name}.landmarks.json"
    if not asset.exists():
        marks.write_text(json.dumps([{"name": f"l{i}", "at": [{"vertex": v - base} for v in at]}
                                     for i, at in enumerate(about["landmarks"])]))
        files = [str(options.meshes / "good" / mesh) for mesh in about["meshes"]]
        subprocess.run([str(options.bin / "orbmorph-bench"), "merge", "--threads", "2", "--landmarks", str(marks), "--out",
                        str(asset), *files], check=True, stdout=subprocess.DEVNULL)
    return asset


def gltfpack(asset, folder, *arguments):
    """Bytes that gltfpack makes of it; None: it is not installed."""
    if not shutil.which("gltfpack"):
        return None
    out = folder / "packed.glb"
    subprocess.run(["gltfpack", "-i", str(asset), "-o", str(out), "-kn", "-km", "-ke", *arguments], check=True,
                   stdout=subprocess.DEVNULL)
    return out.stat().st_size


def texcoords(asset):
    data = asset.read_bytes()
    return b'"TEXCOORD_0"' in data[:20 + int.from_bytes(data[12:16], "little")]


def measure(options, name, keep, folder):
    asset = float_asset(options, name, keep, folder)
    run = subprocess.run([str(options.bin / "bench-profile"), str(asset)], check=True, capture_output=True, text=True)
    made = {line["profile"]: line for line in map(json.loads, run.stdout.splitlines())}
    return {"name": name, "float": asset.stat().st_size, **made, "plain": gltfpack(asset, folder),
            "packed": gltfpack(asset, folder, "-c"), "sixteen": gltfpack(asset, folder, "-c", "-vp", "16"),
            "texcoords": texcoords(asset)}


def share(part, whole):
    return "—" if part is None else f"{part:,} ({part / whole:.3f})"


def row(m):
    bound = lambda profile: f"{m[profile]['position_relative']:.1e} / {m[profile]['normal_degrees']:.2f}°"
    mark = " ᵗ" if m["texcoords"] else ""
    return (f"| {m['name'].replace('-', ' + ')}{mark} | {m['float']:,} | {share(m['quantized']['bytes'], m['float'])} | "
            f"{share(m['meshopt']['bytes'], m['float'])} | {share(m['plain'], m['float'])} | "
            f"{share(m['packed'], m['float'])} | {share(m['sixteen'], m['float'])} | {bound('quantized')} | "
            f"{bound('meshopt')} | {m['quantized']['cpu_ms']:.0f} / {m['meshopt']['cpu_ms']:.0f} |")


def total(measured):
    add = lambda get: None if any(get(m) is None for m in measured) else sum(get(m) for m in measured)
    whole = add(lambda m: m["float"])
    cells = [share(add(get), whole) for get in (
        lambda m: m["quantized"]["bytes"], lambda m: m["meshopt"]["bytes"], lambda m: m["plain"], lambda m: m["packed"],
        lambda m: m["sixteen"])]
    return f"| all | {whole:,} | {' | '.join(cells)} | | | |"


def page(measured):
    return f"""# Profiles: sizes

Written by `tests/bench/profiles.py`: the assets of {len(measured)} pairs with their landmarks, at the default tolerance, in all
profiles ([docs](assets-by-url.md#profiles)). In brackets: the share of the float asset. Bounds are `quantization_relative` and
`normal_degrees`, both proved. The last column is the processor time to make a profile, in milliseconds.

| pair | float | quantized | meshopt | gltfpack | gltfpack -c | gltfpack -c -vp 16 | bounds of quantized | of meshopt | ms |
|---|---|---|---|---|---|---|---|---|---|
{chr(10).join(map(row, measured))}
{total(measured)}

ᵗ: with texture coordinates, which gltfpack drops because no texture uses them.

gltfpack 0.18 (Debian) is there to compare with; the daemon does not use it. It quantizes positions to 14 bits (16 with `-vp 16`)
and normals to 8, and clamps the deltas of normals to −1 … 1. The profiles here keep every normal within a degree, at every
weight of one target.
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (("bin", "build/bin"), ("meshes", "../shared/meshes"), ("out", "docs"), ("keep", None)):
        parser.add_argument(f"--{name}", type=pathlib.Path, default=default and pathlib.Path(default))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        names = sorted(file.stem for file in (pathlib.Path(options.meshes) / "pairs").glob("*.json"))
        measured = [measure(options, name, options.keep or folder, folder) for name in names]
    (pathlib.Path(options.out) / "bench-profiles.md").write_text(page(measured))
    return 0


if __name__ == "__main__":
    sys.exit(main())
