#!/usr/bin/env python3
"""Measures what follows the alignment and writes docs/bench-merging.md with its pictures in docs/bench/.

    tests/bench/merge_report.py [--bin build/bin] [--meshes ../shared/meshes] [--out docs] [--keep DIR] [--quick]

Repeats Table 2 and Fig. 19 of Peng & Timalsena 2016 on real pairs of similar sizes, compares the remeshing methods with
those of the paper, and measures speed and growth on generated bodies. Reports the best of the repeats. --keep stores
alignments between runs. Writes the page after every part, so an interrupted run leaves what it has measured. --only
growth, visual or five measures that part alone and replaces it on the existing page. Standard library only.
"""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import png

PAPER = [  # Table 2: pair, vertices, alignment s, remeshing s, supermesh vertices, triangles, control points
    ("Cow + Triceratops", "2.0k + 2.5k", 0.03, 1.11, 3905, 7696, 17), ("Cow + Horse", "2.0k + 2.0k", 0.03, 0.83, 3333, 6540, 17),
    ("Eagle + Duck", "2.1k + 2.5k", 0.02, 1.32, 4503, 8886, 12), ("David + Manhead", "5.2k + 10.3k", 0.09, 12.88, 13078, 25874, 20),
    ("Woman (Run + Dance)", "5.7k + 5.7k", 0.73, 7.47, 9021, 18038, 57),
    ("Monster + Elf", "24.5k + 34.2k", 0.29, 187.52, 51724, 103022, 18),
    ("Dolphin + Merman", "1.9k + 43.1k", 0.11, 173.86, 57568, 114728, 8)]
PAIRS = ["cow-spot", "spot-koala_lr", "human_man-penguin", "human_man-human_woman", "shrec397-shrec393",
         "bumpy_cube-round_cube", "armadillo_29k-armadillo_86k", "koala_lr-koala_100k"]
METHODS = ["adaptive", "overlay", "subdivision", "convex-hull", "template"]
FIVE = ["shrec393.off", "round_cube.obj", "airliner.obj", "shrec388.off", "stellated_15k.obj"]  # nearest to 10k vertices
FIG19 = ["human_man-human_woman", "cow-spot"]


class Bench:
    def __init__(self, options, folder):
        self.bin, self.meshes = pathlib.Path(options.bin), pathlib.Path(options.meshes)
        self.keep = pathlib.Path(options.keep) if options.keep else folder
        self.folder, self.limit, self.notes = folder, options.limit, []

    def remesh(self, *arguments, repeat=1):
        command = [str(self.bin / "orbmorph-bench"), "remesh", "--threads", "2", "--repeat", str(repeat),
                   *map(str, arguments)]
        try:
            run = subprocess.run(command, capture_output=True, text=True, timeout=self.limit)
        except subprocess.TimeoutExpired:
            self.notes.append(f"given up after {self.limit:.0f} s: " +
                              " ".join(pathlib.Path(word).name for word in command[6:]))
            return None
        if run.returncode:
            self.notes.append(run.stderr.strip())
            return None
        lines = [json.loads(line) for line in run.stdout.splitlines()]
        return min(lines, key=lambda line: line["seconds"]["remesh"])

    def pair(self, name, method, out=None):
        """Measures one pair by one method. The first call aligns the pair; the alignment and its seconds are reused."""
        about = json.loads((self.meshes / "pairs" / f"{name}.json").read_text())
        marks = self.folder / f"{name}.landmarks.json"
        base = about.get("index_base", 0)
        marks.write_text(json.dumps([{"name": f"l{i}", "at": [{"vertex": v - base} for v in at]}
                                     for i, at in enumerate(about["landmarks"])]))
        files = [self.meshes / "good" / mesh for mesh in about["meshes"]]
        kept, clock = self.keep / f"{name}.keep", self.keep / f"{name}.align"
        result = self.remesh("--keep", kept, "--landmarks", marks, "--remesh", method,
                             *(["--out", out] if out else []), *files)
        if result and result["seconds"]["align"] > 0:
            clock.write_text(str(result["seconds"]["align"]))
        return result, len(about["landmarks"]), float(clock.read_text()) if clock.exists() else None

    def five(self):
        """Five shapes in one: generated bodies, unlike real ones rotated onto each other, and animals by landmarks."""
        good, marks = self.meshes / "good", self.folder / "five.json"
        read = lambda name: json.loads((self.meshes / "pairs" / f"{name}.json").read_text())["landmarks"]
        # the landmarks of a class share one list of features: line i of one pair corresponds to line i of the next
        places = [[b[1], a[1], b[0], a[0], c[0]] for a, b, c in
                  zip(read("shrec381-shrec388"), read("shrec397-shrec393"), read("spot-shrec381"))]
        marks.write_text(json.dumps([{"name": f"l{i}", "at": [{"vertex": v} for v in at]}
                                     for i, at in enumerate(places)]))
        animals = [f"shrec{n}.off" for n in (393, 388, 397, 381)] + ["spot.obj"]
        return {"bodies of 10,000 vertices": self.remesh("--bodies", "20000,20000,20000,20000,20000", repeat=3),
                ", ".join(name.split(".")[0] for name in FIVE) + "; `rotate`": self.remesh(
                    "--align", "rotate", "--keep", self.keep / "five-unlike.keep", *(good / name for name in FIVE),
                    repeat=3),
                ", ".join(name.split(".")[0] for name in animals) + "; `pin`, `fast`, 21 landmarks": self.remesh(
                    "--align", "pin", "--align-preset", "fast", "--landmarks", marks, "--keep",
                    self.keep / "five-animals.keep", *(good / name for name in animals), repeat=3)}

    def poses(self, glb):
        """Draws both shapes side by side."""
        target = glb.with_suffix(".png")
        subprocess.run([str(self.bin / "orbmorph"), "view", str(glb), "--poses", "2", "--size", "240", "-o",
                        str(target)], check=True, capture_output=True)
        return png.read(target)


def seconds(value):
    return "–" if value is None else f"{value:.3f}" if value < 1 else f"{value:.2f}"


def worst(result, member):
    return max(shape[member] for shape in result["shapes"])


def table2(bench, names):
    rows, details = [], []
    for name in names:
        print(name, file=sys.stderr)
        by_method, marks, align = {}, 0, None
        for method in METHODS:
            result, marks, align = bench.pair(name, method)
            if not result and align is None:
                break  # no alignment: the other methods would only wait for it again
            if not result:
                continue
            by_method[method] = result
            counts = [shape["triangles"] for shape in result["shapes"]]
            inverted = sum(shape["inverted"] for shape in result["shapes"])
            slivers = sum(shape["slivers"] for shape in result["shapes"])
            bound = worst(result, "hausdorff_relative")
            details.append(f"| {name.replace('-', ' – ')} | {method} | {result['triangles']:,} | "
                           f"{result['triangles'] / max(counts):.2f} | {result['triangles'] / sum(counts):.2f} | "
                           f"{100 * bound:.2g} | {100 * worst(result, 'hausdorff_sampled_relative'):.2g} | "
                           f"{100 * inverted / result['triangles']:.3f} | {100 * slivers / result['triangles']:.2f} | "
                           f"{seconds(result['seconds']['remesh'])} | {seconds(result['seconds']['remesh_cpu'])} |")
        if "subdivision" in by_method and "adaptive" in by_method:
            sizes = " + ".join(f"{(shape['triangles'] / 2 + 2) / 1000:.1f}k" for shape in by_method["adaptive"]["shapes"])
            for method in ("subdivision", "adaptive"):
                result = by_method[method]
                rows.append(f"| {name.replace('-', ' – ')}, `{method}` | {sizes} | {seconds(align)} | "
                            f"{seconds(result['seconds']['remesh'])} | {result['vertices']:,} | "
                            f"{result['triangles']:,} | {marks} |")
    return rows, details


def scale(t):
    """Dark blue, cyan, yellow, bright red for 0 to 1."""
    stops = [(0, 0, 96), (0, 160, 255), (255, 230, 0), (255, 0, 0)]
    at = min(max(t, 0), 0.9999) * (len(stops) - 1)
    k, f = int(at), at - int(at)
    return tuple(round(a + f * (b - a)) for a, b in zip(stops[k], stops[k + 1]))


def figure19(bench, name, out):
    """Rows: the input, then each method's picture and its difference from the input's picture, 0 to 64 of 255."""
    picture = bench_picture(bench, name, "overlay")
    if not picture:
        return []
    width, height, channels, wanted = picture
    shown, rows = [], [rgb(line, channels) for line in wanted]
    for method in ("adaptive", "subdivision", "convex-hull"):
        picture = bench_picture(bench, name, method)
        if not picture:
            continue
        got = picture[3]
        total, high, covered = 0, 0, 0
        for mine, theirs in zip((rgb(line, channels) for line in got), (rgb(line, channels) for line in wanted)):
            row, background = bytearray(), theirs[:3]  # a colour a row: it is shaded from top to bottom
            for x in range(0, len(mine), 3):
                a, b = mine[x:x + 3], theirs[x:x + 3]
                if a == background and b == background:
                    row += bytes((255, 255, 255))
                    continue
                far = max(abs(p - q) for p, q in zip(a, b))
                total, high, covered = total + far, high + (far > 32), covered + 1
                row += bytes(scale(far / 64))
            rows.append(bytes(row))
        shown.append((method, total / max(covered, 1) / 2.55, 100 * high / max(covered, 1)))
    png.write(out / "bench" / f"visual-error-{name}.png", width, rows)
    return shown


def rgb(line, channels):
    return line if channels == 3 else b"".join(line[i:i + 3] for i in range(0, len(line), channels))


def bench_picture(bench, name, method):
    glb = bench.folder / f"{name}-{method}.glb"
    result, _, _ = bench.pair(name, method, glb)
    return bench.poses(glb) if result else None


def growth(bench, sizes):
    rows = []
    for size in sizes:
        print("bodies of", size, file=sys.stderr)
        cells = [f"{size:,}"]
        for method in ("overlay", "adaptive"):
            r = bench.remesh("--bodies", f"{size},{size}", "--remesh", method)
            cells += [f"{r['seconds']['remesh']:.2f}", f"{r['seconds']['remesh_cpu']:.2f}",
                      f"{1e6 * r['seconds']['remesh_cpu'] / r['input_triangles']:.1f}",
                      f"{r['peak_rss_bytes'] / 1e6:,.0f}"] if r else ["–"] * 4
        rows.append("| " + " | ".join(cells) + " |")
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--meshes", default="../shared/meshes")
    parser.add_argument("--out", default="docs")
    parser.add_argument("--keep")
    parser.add_argument("--limit", type=float, default=60, help="abandon a run after this many seconds, and note it")
    parser.add_argument("--only", choices=["growth", "visual", "five"])
    parser.add_argument("--quick", action="store_true", help="two pairs and small bodies only")
    options = parser.parse_args()
    out = pathlib.Path(options.out)
    (out / "bench").mkdir(parents=True, exist_ok=True)
    sizes = [8000, 32000] if options.quick else [8000, 32000, 125000, 500000]
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(options, pathlib.Path(folder))
        if options.only == "growth":
            replace_part(out / "bench-merging.md", growth_part(growth(bench, sizes)))
            return
        if options.only == "five":
            replace_part(out / "bench-merging.md", five_part(bench.five()))
            return
        names, drawn = (PAIRS[:2], FIG19[1:]) if options.quick else (PAIRS, FIG19)
        if options.only == "visual":
            replace_part(out / "bench-merging.md", visual_part({name: figure19(bench, name, out) for name in drawn}))
            return
        page = {"rows": [], "details": [], "pictures": {}, "speed": {}, "five": {}, "grown": [], "notes": bench.notes}
        for name in drawn:
            page["pictures"][name] = figure19(bench, name, out)
            write(out, **page)
        for name in names:
            rows, details = table2(bench, [name])
            page["rows"] += rows
            page["details"] += details
            write(out, **page)
        page["speed"] = {m: bench.remesh("--bodies", "68000,48000", "--remesh", m) for m in METHODS}
        page["five"] = bench.five()
        for size in sizes:
            page["grown"] += growth(bench, [size])
            write(out, **page)


def five_part(five):
    return ["## Five shapes", "", "Five shapes in one supermesh, `adaptive` (0.1 %), without the alignment; best of three.", "",
            "| shapes | input triangles | triangles | by largest | bound % | inverted % | s | processor s | transfer s |",
            "|---|---|---|---|---|---|---|---|---|"] + [
        f"| {name} | {r['input_triangles']:,} | {r['triangles']:,} | {r['by_largest']:.2f} | "
        f"{100 * worst(r, 'hausdorff_relative'):.2g} | "
        f"{100 * sum(shape['inverted'] for shape in r['shapes']) / r['triangles']:.3f} | "
        f"{seconds(r['seconds']['remesh'])} | {seconds(r['seconds']['remesh_cpu'])} | "
        f"{seconds(r['seconds']['transfer'])} |" for name, r in five.items() if r]


def growth_part(grown):
    return ["## Growth", "", "Two generated bodies with this number of triangles each.", "",
            "| triangles a shape | overlay s | processor s | µs a triangle | MB | adaptive s | processor s | µs a triangle | MB |",
            "|---|---|---|---|---|---|---|---|---|"] + grown


def visual_part(pictures):
    text = ["## Visual error (Fig. 19 of the paper)", "",
             "Rendered by `orbmorph view`: the two inputs, then the difference between the picture of each method and that of the "
             "input. Dark",
             "blue is no difference, bright red a quarter of the range or more. The methods are `adaptive` (0.1 %), "
             "`subdivision` (that of the",
             "paper) and `convex-hull` (Fig. 11 of the paper).", "", "| pair | method | mean difference % | pixels above an eighth of the range % |", "|---|---|---|---|"]
    for name, shown in pictures.items():
        text += [f"| {name.replace('-', ' – ')} | {m} | {mean:.2f} | {high:.2f} |" for m, mean, high in shown]
    for name in (name for name, shown in pictures.items() if shown):
        text += ["", f"![Visual error, {name.replace('-', ' and ')}](bench/visual-error-{name}.png)"]
    return text


def replace_part(page, part):
    """Replaces the part of the page with the same heading, or appends the part."""
    heading = part[0]
    lines = page.read_text().rstrip().split("\n")
    begin = lines.index(heading) if heading in lines else len(lines)
    end = next((i for i in range(begin + 1, len(lines)) if lines[i].startswith("## ")), len(lines))
    before, after = lines[:begin], lines[end:]
    page.write_text("\n".join(before + ([""] if before and before[-1] else []) + part + ([""] + after if after else [])) +
                    "\n")


def write(out, rows, details, pictures, speed, five, grown, notes):
    text = ["# Merging, measured", "",
            "Written by `tests/bench/merge_report.py`. Two threads, stored embeddings.",
            "Seconds are wall time on a shared machine, so they are upper bounds. *Inverted* triangles face away from the "
            "surface of a shape;",
            "*slivers* have a height below a ninetieth of their longest side. Both are given in % of the triangles of the "
            "supermesh, over all",
            "shapes.", "",
            "## Table 2 of the paper", "",
            "The pairs of the paper, then real pairs of similar sizes. The paper aligns with its warp. orbmorph also improves "
            "the composed map,",
            "which takes longer and decides how a morph looks.", "",
            "| pair | vertices | alignment s | remeshing s | supermesh vertices | triangles | control points |",
            "|---|---|---|---|---|---|---|"]
    text += [f"| paper: {p[0]} | {p[1]} | {p[2]:.2f} | {p[3]:.2f} | {p[4]:,} | {p[5]:,} | {p[6]} |" for p in PAPER]
    text += rows + ["", "## All methods", "",
                    "*By largest* and *by inputs* divide the number of triangles by that of the largest shape, and by that of "
                    "all shapes together.",
                    "Distances are in % of the diagonal, for the worst shape: *bound* is proved, *sampled* is the largest of "
                    "many samples.", "",
                    "| pair | method | triangles | by largest | by inputs | bound % | sampled % | inverted % | slivers % | s | processor s |",
                    "|---|---|---|---|---|---|---|---|---|---|---|"] + details
    text += ["", "## Speed", "",
             "Generated bodies with limbs, of 34,000 and 24,000 vertices. These are the sizes of the paper's Elf and Monster, "
             "which the paper",
             "remeshes in 188 s.", "", "| method | triangles | seconds | processor seconds |", "|---|---|---|---|"]
    text += [f"| {m} | {r['triangles']:,} | {r['seconds']['remesh']:.2f} | {r['seconds']['remesh_cpu']:.2f} |"
             for m, r in speed.items() if r]
    text += [""] + five_part(five)
    text += [""] + growth_part(grown)
    text += [""] + visual_part(pictures)
    text += [f"\nRefused or given up: {note}" for note in notes]
    (out / "bench-merging.md").write_text("\n".join(text) + "\n")


if __name__ == "__main__":
    main()
