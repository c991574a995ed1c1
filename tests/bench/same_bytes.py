#!/usr/bin/env python3
"""Compares the results of two builds for the same requests, byte for byte.

    tests/bench/same_bytes.py --base OTHER/build/bin [--bin build/bin] [--meshes ../shared/meshes] [--keep DIR] [CASE...]

Each case runs `orbmorph-bench` of both builds and compares the GLB or sphere PLY and the report without its times. The
cases are the samples and, if present, the pairs of the real meshes: every alignment and remesh method, the presets
`fast` and `default`, both embedding methods. --keep stores the digests of the base, so a second run computes only the
other half. Prints one line per case; exit status 1 if any differs. Standard library only.
"""
import argparse
import hashlib
import json
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
TIMES = {"seconds", "cpu_seconds", "embed_cpu_seconds", "threads", "peak_rss_bytes", "triangles_per_minute", "mesh"}
MERGES = [  # alignment, its preset, remeshing; what does not depend on each other is not multiplied
    ("pin", "fast", "adaptive"), ("pin", "default", "adaptive"), ("pin", "fast", "overlay"),
    ("pin", "fast", "subdivision"), ("pin", "fast", "convex-hull"), ("rbf", "fast", "overlay"),
    ("rbf", "default", "overlay"), ("rotate", "fast", "overlay"), ("rotate", "default", "overlay"),
    ("auto", "fast", "adaptive"), ("auto", "default", "adaptive")]


def without_times(value):
    if isinstance(value, dict):
        return {key: without_times(item) for key, item in value.items() if key not in TIMES}
    return [without_times(item) for item in value] if isinstance(value, list) else value


def digest(lines, files):
    hashed = hashlib.sha256()
    for line in lines:
        hashed.update(json.dumps(without_times(json.loads(line)), sort_keys=True).encode())
    for file in files:
        hashed.update(file.read_bytes())
    return hashed.hexdigest()


def run(program, arguments, out, limit):
    done = subprocess.run([program / "orbmorph-bench", *arguments], capture_output=True, text=True, timeout=limit)
    if done.returncode != 0:
        return "refused: " + done.stderr.strip().splitlines()[-1]
    files = sorted(out.glob("*.ply")) if out.is_dir() else [out]
    return digest(done.stdout.splitlines(), files)


def landmark_file(pair, folder):
    read = json.loads(pair.read_text())
    base = read.get("index_base", 0)
    marks = [{"name": f"l{i}", "at": [{"vertex": v - base} for v in at]} for i, at in enumerate(read["landmarks"])]
    file = pathlib.Path(folder, pair.stem + ".json")
    file.write_text(json.dumps(marks))
    return file


def cases(meshes, folder):
    """Yields the name and the arguments of each case; OUT stands for the output."""
    samples = ROOT / "tests" / "samples"
    pairs = [("samples", [samples / "dog.obj", samples / "giraffe.off"], samples / "dog-giraffe.json")]
    pairs += [(file.stem, [meshes / "good" / mesh for mesh in json.loads(file.read_text())["meshes"]],
               landmark_file(file, folder)) for file in sorted((meshes / "pairs").glob("*.json"))]
    seen = set()
    for name, files, marks in pairs:
        for align, preset, remesh in MERGES:
            given = ["--landmarks", marks] if align in ("pin", "rbf") else []
            yield f"{name}/{align}-{preset}-{remesh}", [
                "merge", "--threads", "1", "--align", align, "--align-preset", preset, "--remesh", remesh, *given,
                "--out", "OUT.glb", *files]
        for file in files:
            for method in ("newton", "kernel-sampling"):
                if (file, method) not in seen and (method == "newton" or file.stat().st_size < 600_000):
                    seen.add((file, method))
                    yield f"{name}/{file.stem}-{method}", ["embed", "--threads", "1", "--method", method, "--out", "OUT", file]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", type=pathlib.Path, required=True)
    parser.add_argument("--bin", type=pathlib.Path, default="build/bin")
    parser.add_argument("--meshes", type=pathlib.Path, default=ROOT.parent / "shared" / "meshes")
    parser.add_argument("--keep", type=pathlib.Path, help="folder for the digests of the base")
    parser.add_argument("--limit", type=float, default=3600, help="abandon a run after this many seconds")
    parser.add_argument("cases", nargs="*", help="such as cow-spot or pin-default (default: all)")
    options = parser.parse_args()
    known, differ, count = {}, 0, 0
    store = options.keep / "digests.json" if options.keep else None
    if store and store.exists():
        known = json.loads(store.read_text())
    with tempfile.TemporaryDirectory() as folder:
        for name, arguments in cases(options.meshes, folder):
            if options.cases and not any(wanted in name for wanted in options.cases):
                continue
            found = []
            for side, program in (("base", options.base), ("bin", options.bin)):
                if side == "base" and name in known:
                    found.append(known[name])
                    continue
                out = pathlib.Path(folder, f"{side}-{count}")
                glb = "OUT.glb" in arguments
                if not glb:
                    out.mkdir()
                target = out.with_suffix(".glb") if glb else out
                found.append(run(program, [target if a in ("OUT", "OUT.glb") else a for a in arguments], target,
                                 options.limit))
            if store:
                known[name] = found[0]
                store.parent.mkdir(parents=True, exist_ok=True)
                store.write_text(json.dumps(known, indent=1))
            count += 1
            same = found[0] == found[1]
            differ += not same
            print("same" if same else "DIFFERS", name, "" if same else found, flush=True)
    print(f"{count - differ} of {count} the same")
    return 1 if differ or not count else 0


if __name__ == "__main__":
    sys.exit(main())
