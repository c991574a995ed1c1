#!/usr/bin/env python3
"""Measures the embedding and writes docs/bench-embedding.md with its plots in docs/bench/.

    tests/bench/report.py [--bin build/bin] [--meshes ../shared/meshes] [--out docs] [--quick]

Repeats Table 1, Fig. 13, Fig. 16 and Fig. 18 of Peng & Timalsena 2016 on real meshes of similar sizes, compares both
methods, measures the scaling with threads and sizes, and prints each goal beside its measurement. Reports the best of
the repeats. Some rates use processor seconds, for machines with other load; the page says which. Standard library only.
"""
import argparse
import hashlib
import json
import math
import os
import pathlib
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile

from svg import bars, lines

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAPER = [  # Table 1: triangles, simplification, parameterization, kernel points, optimization, iterations, total
    ("Dolphin", 3730, 0.31, 0.24, 83.3, 3.33, 19.9, 3.88), ("Cow", 3996, 0.32, 0.24, 86.5, 3.06, 18.8, 3.62),
    ("Horse", 3996, 0.34, 0.36, 86.6, 4.71, 21.6, 5.41), ("Eagle", 4266, 0.39, 0.28, 87.1, 2.61, 10.6, 3.28),
    ("Duck", 4990, 0.41, 0.37, 93.4, 3.24, 10.4, 4.02), ("Triceratops", 4996, 0.39, 0.33, 89.7, 3.37, 17.5, 4.09),
    ("David", 10390, 0.66, 0.78, 88.0, 7.13, 12.4, 8.57), ("Woman (Run)", 11348, 0.76, 0.69, 92.4, 8.95, 21.0, 10.40),
    ("Woman (Dance)", 11378, 0.77, 0.70, 92.3, 9.21, 23.6, 10.68),
    ("Manhead", 20658, 1.27, 2.09, 92.1, 17.42, 15.1, 20.78),
    ("Monster", 48904, 4.27, 8.09, 94.6, 52.83, 21.1, 65.19), ("Elf", 68384, 6.87, 14.65, 97.2, 85.63, 22.9, 107.15),
    ("Merman", 86206, 7.35, 23.08, 96.5, 134.93, 23.4, 165.36)]
TABLE1 = ["busted.stl", "cow.off", "spot.obj", "penguin.obj", "koala_lr.obj", "spheretext.obj", "human_man.obj",
          "human_woman.obj", "shrec381.off", "shrec393.off", "sword.obj", "nefertiti_70k.obj", "armadillo_86k.obj"]
# Mean symmetric Dirichlet energy of the first prototype. The default preset must not exceed it.
PROTOTYPE = {"spot.obj": 1.403, "human_man.obj": 4.00, "sword.obj": 8.52, "armadillo_86k.obj": 2.366,
             "koala_100k.obj": 1.614}
STRETCH = {"armadillo_29k.obj": 0.435, "human_man.obj": 0.257, "spot.obj": 0.718}  # measured with Praun & Hoppe's library


class Bench:
    def __init__(self, options):
        self.bin, self.meshes, self.refused = pathlib.Path(options.bin), pathlib.Path(options.meshes), []
        self.samples = sorted(str(p) for p in (ROOT / "tests/samples").iterdir() if p.suffix in (".obj", ".off", ".ply"))

    def lines_of(self, program, *arguments, env=None):
        run = subprocess.run([str(self.bin / program), *map(str, arguments)], capture_output=True, text=True,
                             env={**os.environ, **(env or {})})
        if run.returncode == 2:
            sys.exit(f"{program}: {run.stderr}")
        for line in run.stderr.splitlines():
            self.refused.append(f"{pathlib.Path(line.split(':')[0]).stem} ({line.split(':')[1].strip()})")
            print(f"  refused: {line}", file=sys.stderr)
        return [json.loads(line) for line in run.stdout.splitlines()]

    def embed(self, file, threads=1, repeat=1, method="newton", preset="default", options=None, out=None, cpu="auto"):
        """The fastest repeat by wall clock, with the smallest cpu_seconds and the largest peak of all repeats."""
        arguments = ["embed", "--threads", threads, "--repeat", repeat, "--method", method, "--preset", preset]
        arguments += ["--options", json.dumps(options)] if options else []
        arguments += ["--cpu", cpu] if cpu != "auto" else []
        arguments += ["--out", out] if out else []
        runs = self.lines_of("orbmorph-bench", *arguments, file)
        if not runs:
            return None
        best = min(runs, key=lambda r: r["seconds"]["total"] - r["seconds"]["read"])
        best["cpu_seconds"] = min(r["cpu_seconds"] for r in runs)
        best["peak_rss_bytes"] = max(r["peak_rss_bytes"] for r in runs)
        best["cpu_rate"] = 60 * best["triangles"] / best["cpu_seconds"]
        return best

    def find(self, name):
        for kind in ("good", "weldable"):
            if (self.meshes / kind / name).exists():
                return self.meshes / kind / name
        return None

    def shared(self):
        """Every usable mesh of the collection: its path, and its newton run or None."""
        found = [p for kind in ("good", "weldable") for p in sorted((self.meshes / kind).glob("*"))
                 if p.suffix in (".obj", ".off", ".ply", ".stl", ".3mf", ".glb", ".gltf")]
        runs = [(p, self.lines_of("orbmorph-bench", "embed", "--repair", "largest_component", p)) for p in found]
        return [(p, lines[0] if lines else None) for p, lines in runs]


class Report:
    def __init__(self, out):
        self.folder, self.text, self.goals = pathlib.Path(out), [], []
        (self.folder / "bench").mkdir(parents=True, exist_ok=True)

    def add(self, *paragraphs):
        self.text += [*paragraphs, ""]
        print(*paragraphs, sep="\n", flush=True)

    def table(self, heads, rows):
        body = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
        body += ["| " + " | ".join(str(c) for c in row) + " |" for row in rows]
        self.add("\n".join(body))

    def plot(self, name, caption, svg):
        (self.folder / "bench" / f"{name}.svg").write_text(svg)
        self.add(f"![{caption}](bench/{name}.svg)")

    def goal(self, what, goal, measured, met):
        self.goals.append((what, goal, measured, "yes" if met else "**no**"))

    def write(self, head):
        goals = ["| goal | wanted | measured | met |", "|---|---|---|---|"]
        goals += ["| " + " | ".join(row) + " |" for row in self.goals]
        print("\n".join(goals))
        text = "\n".join([head, "## Goals", "", *goals, "", *self.text])
        (self.folder / "bench-embedding.md").write_text(text.rstrip() + "\n")


def rate(value):
    return f"{value / 1e6:.2f} M" if value >= 1e6 else f"{value / 1e3:.0f} k"


def share(part, whole):
    return f"{part:.2f} ({100 * part / whole:.1f}%)"


def paper_table(bench, report):
    report.add("## The paper's method: Table 1", "The columns of the paper, on one thread. The rows of the paper (Core i7, 3.60 GHz) come first.")
    heads = ["Models", "# of triangles", "Simplification time (s)", "Parameterization time (s)", "Avg. # of kernel points",
             "Optimization time (s)", "Avg. # of iterations", "Total", "triangles/min"]
    rows = [(n, t, share(s, a), share(p, a), k, share(o, a), i, a, rate(60 * t / a)) for n, t, s, p, k, o, i, a in PAPER]
    files = [p for p in map(bench.find, TABLE1) if p]
    measured = bench.lines_of("bench-kernel-sampling", *files, *bench.samples)
    for m in sorted(measured, key=lambda m: m["triangles"]):
        parts = m["simplify_seconds"] + m["place_seconds"] + m["optimize_seconds"]
        shrink = m["cpu_seconds"] / parts  # converts wall to processor seconds
        s, p, o = (m[k] * shrink for k in ("simplify_seconds", "place_seconds", "optimize_seconds"))
        rows.append((f"*{m['mesh']}*", m["triangles"], share(s, m["cpu_seconds"]), share(p, m["cpu_seconds"]),
                     f"{m['kernel_points']:.1f}", share(o, m["cpu_seconds"]), f"{m['iterations']:.1f}",
                     f"{m['cpu_seconds']:.2f}", rate(60 * m["triangles"] / m["cpu_seconds"])))
    report.table(heads, rows)
    report.add("The rows of orbmorph are *in italics*, in processor seconds. Parameterization includes the sweeps around "
               "insertions into dense regions (core/embed/kernel_sampling/kernel_sampling.h), so it takes a larger share than in the paper.",
               *([f"Refused: {', '.join(bench.refused)}."] if bench.refused else []))
    return measured


def paper_goals(bench, report, measured):
    sizes = [m for m in measured if 3500 <= m["triangles"] <= 21000]
    triangles, seconds = sum(m["triangles"] for m in sizes), sum(m["cpu_seconds"] for m in sizes)
    total = 60 * triangles / seconds
    report.goal("kernel-sampling, meshes of the paper's sizes (4k to 20k), processor time", "580 k/min", rate(total),
                total >= 580e3)


def whole_collection(bench, report):
    """Runs newton on every shared mesh, kernel-sampling on those up to 15,000 triangles and on those up to 50,000."""
    shared = bench.shared()
    if not shared:
        return
    valid = [p for p, m in shared if m and m["certificate"]["valid"] and m["certificate"]["exact"]]
    failed = [p.name for p, m in shared if p not in valid]
    report.goal("newton valid on every shared mesh", "all", f"{len(valid)} of {len(shared)}", not failed)
    small = [p for p, m in shared if not m or m["triangles"] <= 15000]
    large = [p for p, m in shared if p not in small and m["triangles"] <= 50000]
    done = {}
    for some in (small, large):
        lines = bench.lines_of("orbmorph-bench", "embed", "--method", "kernel-sampling", "--repair", "largest_component",
                               "--threads", 1, *some)
        done[id(some)] = [m["mesh"] for m in lines if m["certificate"]["valid"]]
    report.goal("kernel-sampling valid on shared meshes up to 15,000 triangles", "all",
                f"{len(done[id(small)])} of {len(small)}", len(done[id(small)]) == len(small) > 0)
    refused = [p.stem for p in large if p.stem not in done[id(large)]]
    report.add("## All shared meshes", f"newton: {len(valid)} of {len(shared)} certified"
               + (f", not {', '.join(failed)}." if failed else ", every one exactly.")
               + f" kernel-sampling: {len(done[id(small)])} of {len(small)} up to 15,000 triangles, "
               f"{len(done[id(large)])} of {len(large)} from there to 50,000"
               + (f"; refused: {', '.join(refused)}." if refused else "."))
    extreme = sorted((m for _, m in shared if m), key=lambda m: m["certificate"]["min_determinant"])[:5]
    report.add("The most extreme, by the smallest determinant:")
    report.table(["mesh", "triangles", "smallest determinant", "symmetric Dirichlet, mean", "worst triangle"],
                 [(m["mesh"], m["triangles"], f"{m['certificate']['min_determinant']:.2e}",
                   f"{m['distortion']['symmetric_dirichlet']['mean']:.3g}",
                   f"{m['distortion']['symmetric_dirichlet']['max']:.3g}") for m in extreme])


def fig13(bench, report):
    name = bench.find("armadillo_29k.obj") or bench.find("cow.off")
    traced = bench.lines_of("bench-kernel-sampling", "--trace", name)
    if traced:
        points = traced[0]["trace"]
        report.add("## Fig. 13: time against vertices inserted", f"{traced[0]['mesh']}, {traced[0]['vertices']} vertices.")
        report.plot("fig13", "Seconds against vertices inserted",
                    lines([("parameterization", [(p[0], p[1]) for p in points]),
                           ("optimization", [(p[0], p[2]) for p in points])], "vertices inserted", "seconds"))


def fig16(bench, report):
    path = bench.find("shrec398.off") or pathlib.Path(bench.samples[0])
    rows, values, rates = [], {}, []
    rhos, phis = (1.5, 2.0, 2.5, 3.0), (0.0, 6.0, 12.0)
    for phi in phis:
        row = [f"φ = {phi}"]
        for rho in rhos:
            m = bench.embed(path, method="kernel-sampling", options={"area_exponent": rho, "aspect_exponent": phi})
            if m:
                rates.append(m["cpu_rate"])
                values[rho, phi] = m["distortion"]["area"]["std"], m["distortion"]["aspect"]["mean"]
                row.append("{:.2f} / {:.3f}".format(*values[rho, phi]))
            else:
                row.append("refused")
        rows.append(row)
    report.add("## Fig. 16: the exponents", f"{path.stem}: standard deviation of the log "
               "area ratio / mean aspect ratio of the image's triangles.")
    report.table(["", *(f"ϱ = {rho}" for rho in rhos)], rows)
    if rates:
        report.add(f"Rates over the grid: {rate(min(rates))} to {rate(max(rates))} triangles a minute of processor time.")
    ends = [(values.get((rhos[0], p)), values.get((rhos[-1], p))) for p in phis]
    area = [b[0] < a[0] for a, b in ends if a and b]
    ends = [(values.get((r, phis[0])), values.get((r, phis[-1]))) for r in rhos]
    shape = [b[1] < a[1] for a, b in ends if a and b]
    report.goal("ϱ 1.5 to 3: lower spread of areas, for each φ", "all", f"{sum(area)} of {len(area)}", all(area) and area)
    report.goal("φ 0 to 12: lower aspect ratio, for each ϱ", "all", f"{sum(shape)} of {len(shape)}", all(shape) and shape)


def fig18(report, measured):
    m = max((m for m in measured if m["triangles"] < 80000), key=lambda m: m["triangles"])
    report.add("## Fig. 18: histograms", f"{m['mesh']} by kernel-sampling, {m['triangles']} triangles.")
    for key, caption in (("angle", "angle distortion σ₁/σ₂"), ("area", "area distortion ln σ₁σ₂"),
                         ("aspect", "aspect ratio of the image")):
        h = m["distortion"][key]["histogram"]
        report.plot(f"fig18-{key}", caption, bars(h["edges"], h["counts"], caption, "triangles"))


def methods(bench, report, repeat):
    report.add("## Both methods", "Rates by wall clock on one thread, without reading the file.")
    rows = []
    for name in ("spot.obj", "cow.off", "human_man.obj", "shrec397.off"):
        path = bench.find(name)
        if path:
            a, b = bench.embed(path, repeat=repeat), bench.embed(path, method="kernel-sampling")
            rows.append((path.stem, a["triangles"], rate(a["triangles_per_minute"]), rate(b["triangles_per_minute"]) if b else "refused",
                         f"{a['distortion']['symmetric_dirichlet']['mean']:.2f}",
                         f"{b['distortion']['symmetric_dirichlet']['mean']:.3g}" if b else ""))
    report.table(["mesh", "triangles", "newton, a minute", "kernel-sampling, a minute", "newton, symmetric Dirichlet",
                  "kernel-sampling, symmetric Dirichlet"], rows)


def newton_goals(bench, report, repeat):
    rows, by_preset = [], {}
    for name in sorted(PROTOTYPE):
        path = bench.find(name)
        if path:
            by_preset[name] = [bench.embed(path, threads=2, preset=p)["distortion"]["symmetric_dirichlet"]["mean"]
                               for p in ("fast", "default", "quality")]
            rows.append((path.stem, PROTOTYPE[name], *(f"{v:.4f}" for v in by_preset[name])))
            report.goal(f"symmetric Dirichlet mean, {path.stem}: no worse than the prototype's", f"{PROTOTYPE[name]}",
                        f"{by_preset[name][1]:.4f}", by_preset[name][1] <= PROTOTYPE[name])
    report.add("## Newton: quality", "Mean symmetric Dirichlet energy of each preset and of the first prototype.")
    report.table(["mesh", "prototype", "fast", "default", "quality"], rows)
    if by_preset:
        gain = math.exp(sum(math.log(v[2] / v[1]) for v in by_preset.values()) / len(by_preset))
        report.goal("quality below default, geometric mean of the energy", "2 %", f"{100 * (1 - gain):.1f} %", gain <= 0.98)
    for name, wanted in STRETCH.items():
        path = bench.find(name)
        if path:
            got = bench.embed(path, threads=2, options={"energy_weight": 0})["distortion"]["stretch_efficiency"]
            report.goal(f"L2 stretch efficiency with w = 0, {path.stem}", f"{wanted}", f"{got:.3f}", got >= wanted)
    small = [(path.stem, bench.embed(path, threads=2, repeat=repeat)) for path in
             filter(None, map(bench.find, ("cow.off", "spot.obj", "penguin.obj", "human_man.obj", "shrec397.off")))]
    if small:
        least = min(small, key=lambda s: s[1]["triangles_per_minute"])
        report.goal("newton, 5,000 to 15,000 triangles, slowest of five, two threads", "6 M/min",
                    f"{rate(least[1]['triangles_per_minute'])} ({least[0]})", least[1]["triangles_per_minute"] >= 6e6)


def scaling(bench, report, repeat, folder, quick):
    """Embeds one shape at about 100,000, 500,000 and 2 million triangles, at the first size with each instruction set."""
    source = bench.find("armadillo_29k.obj") or pathlib.Path(bench.samples[0])
    rows, measured, narrow = [], [], {}
    for size in [100000, 400000] if quick else [100000, 400000, 1600000]:
        path = pathlib.Path(folder) / f"size{size}.ply"
        subprocess.run([str(bench.bin / "bench-subdivide"), str(source), str(size), str(path)], check=True)
        measured.append([bench.embed(path, threads=n, repeat=repeat) for n in (1, 2)])
        one, two = measured[-1]
        rows.append((one["triangles"], rate(one["triangles_per_minute"]), rate(two["triangles_per_minute"]),
                     rate(one["cpu_rate"]), f"{one['peak_rss_bytes'] / one['triangles']:.0f}",
                     f"{two['peak_rss_bytes'] / two['triangles']:.0f}"))
        if not narrow:
            narrow = {cpu: [bench.embed(path, threads=n, repeat=repeat, cpu=cpu) for n in (1, 2)]
                      for cpu in ("avx2", "plain")}
        path.unlink()
    report.add("## Newton: scaling with size", f"{source.stem}, split four-way; default preset.")
    report.table(["triangles", "one thread, a minute", "two threads, a minute", "one thread by processor time",
                  "peak bytes per triangle, one thread", "two threads"], rows)
    report.plot("size", "Rate against size", lines(
        [("one thread", [(m[0]["triangles"], m[0]["triangles_per_minute"] / 1e6) for m in measured]),
         ("two threads", [(m[1]["triangles"], m[1]["triangles_per_minute"] / 1e6) for m in measured])],
        "triangles", "million triangles a minute"))
    report.add("## Newton: instruction sets", f"{source.stem}, {measured[0][0]['triangles']} triangles; `--cpu`.")
    report.table(["instructions", "one thread, a minute", "two threads, a minute", "symmetric Dirichlet"],
                 [(m[0]["cpu"], *(rate(r["triangles_per_minute"]) for r in m),
                   f"{m[0]['distortion']['symmetric_dirichlet']['mean']:.5f}")
                  for m in (measured[0], *narrow.values())])
    for n, wanted in ((1, 12e6), (2, 20e6)):
        threads = f"{n} thread{'s' * (n > 1)}"
        got = statistics.median(m[n - 1]["triangles_per_minute"] for m in measured)
        report.goal(f"newton above 100,000 triangles, median of the sizes, {threads}", rate(wanted) + "/min", rate(got), got >= wanted)
        got = narrow["avx2"][n - 1]
        report.goal(f"the same with AVX2 only, {threads}", rate(wanted / 2) + "/min", rate(got["triangles_per_minute"]),
                    got["triangles_per_minute"] >= wanted / 2 and got["cpu"] == "avx2")
    for n in (1, 2):
        last, first = measured[-1][n - 1], measured[0][n - 1]
        keep = last["triangles_per_minute"] / first["triangles_per_minute"]
        report.goal(f"rate at {last['triangles']} over that at {first['triangles']}, {n} thread{'s' * (n > 1)}", "0.8",
                    f"{keep:.2f}", keep >= 0.8)
    shared = [bench.embed(p, threads=2) for p in map(bench.find, ("scallop_120k.glb", "nefertiti_280k.ply")) if p]
    worst = max([m for pair in measured for m in pair] + shared, key=lambda m: m["peak_rss_bytes"] / m["triangles"])
    peak = worst["peak_rss_bytes"] / worst["triangles"]
    report.goal("peak memory of the process above 100,000 triangles, mesh, file and libraries included",
                "250 bytes per triangle", f"{peak:.0f} ({worst['mesh']}, {worst['triangles']} triangles)", peak <= 250)


def determinism(bench, report, folder):
    path = bench.find("armadillo_29k.obj") or pathlib.Path(bench.samples[0])
    seen = {}
    for method, file in (("newton", path), ("kernel-sampling", bench.find("spot.obj") or bench.samples[0])):
        for threads in (1, 2, 3, 8, 2, 8, 1):
            m = bench.embed(file, threads=threads, method=method, out=folder)
            sphere = pathlib.Path(folder) / f"{m['mesh']}.sphere.ply"
            seen.setdefault(method, []).append(hashlib.sha256(sphere.read_bytes()).hexdigest())
    same = all(len(set(hashes)) == 1 for hashes in seen.values())
    report.goal("the same bytes for 1, 2, 3 and 8 threads, run after run (both methods)", "yes", "yes" if same else "no", same)


def threads_table(bench, report, repeat):
    path = bench.find("koala_100k.obj") or bench.find("spot.obj") or pathlib.Path(bench.samples[0])
    measured = [bench.embed(path, threads=n, repeat=repeat) for n in (1, 2, 4, 8) if n <= 2 * (os.cpu_count() or 1)]
    report.add("## Newton: scaling with threads", f"{path.stem}; {os.cpu_count()} processors.")
    report.table(["threads", "seconds", "triangles a minute", "speed-up"],
                 [(m["threads"], f"{m['seconds']['total']:.3f}", rate(m["triangles_per_minute"]),
                   f"{m['triangles_per_minute'] / measured[0]['triangles_per_minute']:.2f}") for m in measured])


def adversarial(bench, report):
    run = subprocess.run([str(bench.bin / "embed-adversarial"), "50", "1", "6000"], capture_output=True, text=True)
    report.add("## Adversarial meshes", "`embed-adversarial 50 1 6000`; `tests/long.sh adversarial` runs 1,000.",
               "```\n" + run.stdout.strip() + "\n```")
    report.goal("50 adversarial meshes certified", "50", run.stdout.split()[0] if run.returncode == 0 else "fewer", run.returncode == 0)


def stored_adversarial(report):
    """Adds the stored result for 1,000 meshes, which take too long for this report; tests/long.sh adversarial writes it."""
    stored = ROOT / "docs/bench/adversarial-1000.txt"
    if stored.exists():
        text = stored.read_text().strip()
        report.add("The last run of 1,000 by `tests/long.sh adversarial` (docs/bench/adversarial-1000.txt):",
                   "```\n" + text + "\n```")
        report.goal("1,000 adversarial meshes certified (stored)", "1000", text.split()[0],
                    text.startswith("1000 of 1000 "))


def certificate_tests(bench, report):
    """Runs the unit tests that compare the certificate with exact rational arithmetic."""
    names, failed = [], 0
    for program in ("test_certify", "test_orient"):
        if (bench.bin / program).exists():
            run = subprocess.run([str(bench.bin / program)], capture_output=True, text=True)
            text = run.stdout + run.stderr
            names += [f"{program}: {l.split('] ')[1].strip()}" for l in text.splitlines() if l.startswith("[       OK ]")]
            failed += run.returncode != 0
    if names or failed:
        report.add("## The certificate", "Against exact rational arithmetic (tests/unit/support_exact.c); all passed:" if
                   not failed else "A TEST FAILED; passed:", "\n".join(f"- {n}" for n in names))
        report.goal("certificate tests: flipped, degenerate, doubly wrapped, nearly flat, against exact rationals",
                    "all pass", f"{len(names)} pass" + (", one program fails" if failed else ""), not failed)


def globe_with_poles(path, valence):
    ring = [(math.cos(2 * math.pi * i / valence), math.sin(2 * math.pi * i / valence)) for i in range(valence)]
    with open(path, "w") as f:
        f.write("v 0 0 1\nv 0 0 -1\n" + "".join(f"v {x:.9f} {y:.9f} {0.1 * x * y:.9f}\n" for x, y in ring))
        f.write("".join(f"f 1 {i + 3} {(i + 1) % valence + 3}\nf 2 {(i + 1) % valence + 3} {i + 3}\n"
                        for i in range(valence)))


def cancels(bench, report, folder):
    pole = pathlib.Path(folder) / "pole_200k.obj"
    globe_with_poles(pole, 200000)
    runs = [("newton", p) for p in (bench.find("nefertiti_280k.ply"), pole) if p]
    runs += [("kernel-sampling", p) for p in (bench.find("shrec393.off"), bench.find("spheretext.obj")) if p]
    rows = []
    for method, path in runs:
        rows += bench.lines_of("bench-cancel", "--method", method, "--threads", 1, "--cancels", 8, path)
    report.add("## Cancelling", "`bench-cancel` cancels each embedding at 8 moments spread over the run; one thread.")
    report.table(["mesh", "triangles", "method", "whole run, s", "mean delay, ms", "longest, ms", "longest, processor ms"],
                 [(m["mesh"], m["triangles"], m["method"], m["seconds"], m["mean_ms"], m["longest_ms"],
                   m["longest_cpu_ms"]) for m in rows])
    if rows:
        worst = max(m["longest_ms"] for m in rows)
        report.goal("a cancelled embedding stops within", "100 ms", f"{worst:.0f} ms", worst <= 100)


def machine():
    model = "unknown processor"
    try:
        model = next(l.split(":", 1)[1].strip() for l in open("/proc/cpuinfo") if l.startswith("model name"))
        flags = next(l for l in open("/proc/cpuinfo") if l.startswith("flags"))
        model += ", AVX-512" if " avx512f" in flags else ", AVX2" if " avx2" in flags else ""
    except (OSError, StopIteration):
        pass
    return f"{model}, {os.cpu_count()} processors, {platform.system()}; load average at the start {os.getloadavg()[0]:.1f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--bin", default=ROOT / "build/bin")
    parser.add_argument("--meshes", default=ROOT.parent / "shared/meshes")
    parser.add_argument("--out", default=ROOT / "docs")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="no sizes above 500,000 triangles")
    options = parser.parse_args()
    bench, report = Bench(options), Report(options.out)
    head = ("# The embedding, measured\n\nWritten by `tests/bench/report.py`. A mesh's rate is 60 · triangles / (total − "
            f"reading).\n\nMachine: {machine()}.\n")
    folder = tempfile.mkdtemp(prefix="orb-report-")
    try:
        measured = paper_table(bench, report)
        paper_goals(bench, report, measured)
        whole_collection(bench, report)
        fig13(bench, report)
        fig16(bench, report)
        fig18(report, measured)
        methods(bench, report, options.repeat)
        newton_goals(bench, report, options.repeat)
        threads_table(bench, report, options.repeat)
        scaling(bench, report, options.repeat, folder, options.quick)
        determinism(bench, report, folder)
        certificate_tests(bench, report)
        cancels(bench, report, folder)
        adversarial(bench, report)
        stored_adversarial(report)
    finally:
        shutil.rmtree(folder)
    report.write(head)


if __name__ == "__main__":
    main()
