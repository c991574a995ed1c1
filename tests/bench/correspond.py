#!/usr/bin/env python3
"""Measures maps against dense truth, and writes docs/bench-correspond.md.

    tests/bench/correspond.py [--bin build/bin] [--base DIR-OR-REVISION] [--set people,animals,real] [--half choose|report|all]
                              [--seeds N,…] [--given 0,8] [--preset default] [--change none,swapped,turned,refined,noisy] [--changed-given 0] [--sample K] [--pairs A-B,…] [--jobs 1]
                              [--store DIR] [--fresh] [--out FILE.md] [--json FILE.json]

Sets: `people` are the pairs of MESHES/posed, `animals` those that `orbmorph-posed` generates, `real` those of
docs/bench-truth.md, `drawn` 84 pairs of animals of other kinds for each seed, `parts` 81 heads and busts, `plans` spiders,
beetles, hands, birds, lizards, fish and centaurs, `drawn-plans` 28 pairs of these for each seed, `apes` 48 people with the
proportions of an ape and other people. Every pair belongs to the half that constants may be chosen on (`choose`) or to the half
that is only reported. --given 0 finds the correspondence (`auto`); --given N pins the first N true places with the preset.
--base measures another version beside this one: its folder of programs, or a revision to build. --sample K takes K
pairs of each set, spread evenly. --change measures after changes that should not matter as well: first and second
shape swapped, the second one rotated and its vertices and triangles shuffled, its triangles cut into four, its vertices moved at random.

Every result is a file in the store, by version, pair and options: an interrupted run continues, and a finished one is
printed again at once. --fresh measures again. The version is the hash of the program, so a new build has new results.

`orbmorph-bench truth` gives distances in space only, so each place is stated with four different targets: the four
distances yield the image, and the error is measured along the surface. Any version's program will do. Standard library
only.
"""
import argparse
import concurrent.futures
import functools
import hashlib
import itertools
import json
import math
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

import correspond_changes
import correspond_pairs
from correspond_pairs import PLACES
from first_answer import ROOT, build_base
from surface import Surface, cross, dot, minus

RIGHT = 10
GIVEN_MOST = 24  # landmarks: however few are given, the same places are measured, those after this many
FORMAT = 3  # the version of the files in the store: after a change everything is measured
THIN = (0, 0.005, 0.01)  # shares of the surface in patches that are thin halfway
MORE_LANDMARKS = 1.05  # a pair with more landmarks is no worse if its mean error is at most this times as large
KIND_COLUMNS = ["set", "kind", "version", "given", "pairs", "mean", "% diagonal"]
CURVE = (1, 2, 3, 4, 5, 7.5, 10, 15, 20, 30, 50)
PAIR_COLUMNS = ["set", "pair", "kind", "half", "version", "given", "mean", "median", "95 %", "right", "% diagonal",
                "energy", "confidence", "thin %", "CPU s"]
SUM_COLUMNS = ["set", "half", "version", "given", "pairs", "failed", "mean", "median", "right", "95 %", "% diagonal",
               "energy", "CPU s", "median"]


def anchors(points):
    """Four of the points that span a large tetrahedron."""
    chosen = [0, max(range(len(points)), key=lambda i: math.dist(points[i], points[0]))]
    a, b = (points[i] for i in chosen)
    chosen.append(max(range(len(points)), key=lambda i: math.hypot(*cross(minus(b, a), minus(points[i], a)))))
    normal = cross(minus(b, a), minus(points[chosen[2]], a))
    chosen.append(max(range(len(points)), key=lambda i: abs(dot(normal, minus(points[i], a)))))
    return chosen


def solve(points, distances):
    """The point at these distances from four points: the differences of the squares are linear in it."""
    rows = [tuple(2 * (q - p) for p, q in zip(points[0], point)) for point in points[1:]]
    right = [distances[0] ** 2 - d * d + dot(p, p) - dot(points[0], points[0])
             for p, d in zip(points[1:], distances[1:])]
    determinant = dot(rows[0], cross(rows[1], rows[2]))
    sides = [cross(rows[1], rows[2]), cross(rows[2], rows[0]), cross(rows[0], rows[1])]
    return tuple(sum(r * side[k] for r, side in zip(right, sides)) / determinant for k in range(3))


def run_child(command, limit):
    """Standard output, CPU seconds of the process with its threads, and None or why it failed."""
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as complaint:
        child = subprocess.Popen(["timeout", "--signal=KILL", str(limit), *command], stdout=out, stderr=complaint)
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        complaint.seek(0)
        failed = (complaint.read().strip() or f"exit status {child.returncode}") if child.returncode else None
        return out.read(), usage.ru_utime + usage.ru_stime, failed


@functools.lru_cache(maxsize=24)
def surface_of(file):
    return Surface(file)


def measure(program, pair, given, change, options):
    """What is stored of one map."""
    first, second = surface_of(pair.first), surface_of(pair.second)
    first, second, places = correspond_changes.change(change, first, second, pair.places(), options.store / "changed")
    if len(places) <= given:
        return None  # nothing is left to measure at
    first_measured = GIVEN_MOST if len(places) > GIVEN_MOST else given
    places = places[:given] + spread(places[max(given, first_measured):], PLACES)
    targets = [second.position(place[1]) for place in places]
    chosen = anchors(targets)
    at = [[{"triangle": p[0], "barycentric": list(p[1])} for p in place[:2]] for place in places]
    held = range(given, len(places))
    marks = [{"name": str(i), "at": at[i]} for i in range(given)]
    marks += [{"name": f"{i} {k}", "at": [at[i][0], at[k][1]]} for i in held for k in chosen]
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        json.dump(marks, file)
        file.flush()
        method = options.preset if given else "auto"
        text, cpu, failed = run_child([program, "truth", "--threads", str(options.threads), "--methods", method,
                                       "--given", str(given), "--landmarks", file.name, first.file, second.file],
                                      options.limit)
    if failed:
        return {"failed": failed, "cpu": cpu}
    line = json.loads(text)
    distances = [d * second.diagonal / 100 for d in line["held_out"]]
    points = [targets[k] for k in chosen]
    images = [solve(points, distances[4 * i:4 * i + 4]) for i in range(len(held))]
    scale = 100 / math.sqrt(second.area)
    return {"errors": [round(scale * second.length(places[i][1], image), 3) for i, image in zip(held, images)],
            "diagonal": [round(100 * math.dist(targets[i], image) / second.diagonal, 3)
                         for i, image in zip(held, images)],
            "parts": [places[i][2] for i in held], "cpu": round(cpu, 2), "energy": line["energy"],
            "confidence": line.get("confidence"), "match": line.get("match"), "halfway": line["halfway_fitted"],
            "warned": line.get("warned")}


def spread(places, count):
    """At most `count` of the places, evenly over the list."""
    return places if len(places) <= count else [places[i * len(places) // count] for i in range(count)]


def stored(program, version, pair, given, change, options):
    """The result of one map, from the store if it is there."""
    kind = f"{given}-{options.preset if given else 'auto'}{'' if change == 'none' else '-' + change}"
    pair.make()
    inputs = hashlib.sha256(b"".join([str(FORMAT).encode(), pair.first.read_bytes(), pair.second.read_bytes()]))
    file = options.store / version / f"{pair.set}-{pair.name}-{kind}-{inputs.hexdigest()[:8]}.json"
    if file.exists() and not options.fresh:
        return json.loads(file.read_text())
    result = measure(program, pair, given, change, options)
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_suffix(".part")
    part.write_text(json.dumps(result))
    part.rename(file)
    return result


def quantile(values, share):
    return sorted(values)[min(len(values) - 1, int(len(values) * share))]


def number(value, digits=1):
    return "–" if value is None or value != value else f"{value:.{digits}f}"


def pair_row(pair, name, given, r):
    head = [pair.set, pair.name, pair.kind, pair.half, name, str(given)]
    if "failed" in r:
        return head + ["failed"] + ["–"] * 7 + [number(r["cpu"])]
    mean = statistics.mean(r["errors"])
    return head + [number(mean), number(statistics.median(r["errors"])), number(quantile(r["errors"], 0.95)),
                   "yes" if mean <= RIGHT else "no", number(statistics.mean(r["diagonal"]), 2), number(r["energy"], 2),
                   number(r["confidence"], 2), number(100 * r["halfway"]["thin_fraction"]), number(r["cpu"])]


def sum_row(head, results):
    good = [r for r in results if "failed" not in r]
    cpu = [r["cpu"] for r in results]
    head = head + [str(len(results)), str(len(results) - len(good))]
    if not good:
        return head + ["–"] * 6 + [number(statistics.mean(cpu)), number(statistics.median(cpu))]
    means = [statistics.mean(r["errors"]) for r in good]
    right = sum(m <= RIGHT for m in means)
    return head + [number(statistics.mean(means)), number(statistics.median(means)),
                   f"{right} ({100 * right / len(results):.0f} %)",
                   number(quantile([e for r in good for e in r["errors"]], 0.95)),
                   number(statistics.mean(statistics.mean(r["diagonal"]) for r in good), 2),
                   number(statistics.median(r["energy"] for r in good), 3), number(statistics.mean(cpu)),
                   number(statistics.median(cpu))]


def curve_row(head, results):
    """A pair that failed has no place within any limit."""
    good = [r["errors"] for r in results if "failed" not in r]
    return head + [f"{100 * sum(sum(e <= x for e in errors) / len(errors) for errors in good) / len(results):.0f}"
                   for x in CURVE]


def table(columns, rows):
    lines = ["| " + " | ".join(row) + " |" for row in [columns] + rows]
    return "\n".join([lines[0], "|" + "---|" * len(columns)] + lines[1:]) + "\n"


def groups(results):
    """Results by set, half, version and number of landmarks; each set once more as a whole, and all sets together."""
    found = {}
    for pair, name, given, result in results:
        for key in ((pair.set, pair.half), (pair.set, "both"), ("all", pair.half), ("all", "both")):
            found.setdefault((*key, name, str(given)), []).append(result)
    halves = {(key[0], key[2], key[3]): set() for key in found}
    for key in found:
        halves[key[0], key[2], key[3]].add(key[1])
    sets = {key[0] for key in found}
    return {key: found[key] for key in sorted(found, key=lambda k: (k[0] == "all", k[0], k[1] == "both", k[1], k[3]))
            if not (key[0] == "all" and len(sets) == 2)
            and not (key[1] == "both" and len(halves[key[0], key[2], key[3]]) == 2)}


def kind_rows(results):
    """Pairs by their kind: a person in two poses is another task than two people, or a giraffe and an elephant."""
    found = {}
    for pair, name, given, result in results:
        if ", " not in name and "failed" not in result:
            found.setdefault((pair.set, pair.kind, name, given), []).append(result)
    return [[*key[:3], str(key[3]), str(len(value)),
             number(statistics.mean(statistics.mean(r["errors"]) for r in value)),
             number(statistics.mean(statistics.mean(r["diagonal"]) for r in value), 2)]
            for key, value in sorted(found.items())]


def confidence_rows(results):
    """Of the maps whose confidence lies in a range: how many are right. Versions without a confidence of the match have
    the mean of the found landmarks."""
    rows = []
    for name in dict.fromkeys(r[1] for r in results):
        good = [r[3] for r in results if r[1] == name and r[2] == 0 and "failed" not in r[3]]
        pairs = [((r.get("match") or r)["confidence"], statistics.mean(r["errors"]) <= RIGHT) for r in good]
        known = [pair for pair in pairs if pair[0] is not None]
        for low in range(0, 10):
            inside = [right for value, right in known if low / 10 <= value < low / 10 + 0.1 or value == 1 and low == 9]
            if inside:
                rows.append([name, f"{low / 10:.1f}–{low / 10 + 0.1:.1f}", str(len(inside)), str(sum(inside))])
    return rows


def warning_rows(results):
    """Of the maps with patches that are thin halfway: how many have a warning that says where."""
    rows = []
    for name in dict.fromkeys(r[1] for r in results):
        good = [r[3] for r in results if r[1] == name and "failed" not in r[3] and r[3].get("warned")]
        for least in THIN:
            thin = [r for r in good if r["halfway"]["thin_fraction"] > least]
            if thin:
                warned = sum(r["warned"]["thin"] > 0 for r in thin)
                rows.append([name, f"more than {100 * least:.1f} %", str(len(thin)), str(warned)])
    return rows


def landmark_rows(results):
    """From few landmarks to more: how many pairs have about as little error with more. A failure has the most."""
    means = {}
    for pair, name, given, result in results:
        error = math.inf if "failed" in result else statistics.mean(result["errors"])
        means.setdefault(name, {}).setdefault(given, {})[pair.set, pair.name] = error
    rows = []
    for name, by_given in means.items():
        for few, more in itertools.combinations(sorted(by_given), 2):
            both = [(value, by_given[more][key]) for key, value in by_given[few].items() if key in by_given[more]]
            kept = sum(after <= MORE_LANDMARKS * before and after < math.inf for before, after in both)
            rows.append([name, str(few), str(more), str(len(both)), str(kept)])
    return rows


def is_right(result):
    return "failed" not in result and statistics.mean(result["errors"]) <= RIGHT


def verdict_rows(results):
    """How many pairs have the verdict of the unchanged pair, and how many are right in both."""
    plain = {(r[0].name, r[1], r[2]): is_right(r[3]) for r in results}
    rows = {}
    for pair, name, given, result in results:
        before = plain.get((pair.name, name.split(", ")[0], given))
        if ", " in name and before is not None:
            rows.setdefault((name, str(given)), []).append((before, is_right(result)))
    return [[*key, str(len(value)), str(sum(a == b for a, b in value)), str(sum(a and b for a, b in value))]
            for key, value in rows.items()]


def report(results):
    head = (ROOT / "tests/bench/correspond_head.md").read_text()
    found = groups(results)
    text = head + "\n## Summary\n\n" + table(SUM_COLUMNS, [sum_row(list(k), v) for k, v in found.items()])
    text += "\n## Curve\n\nThe share of the places, in %, with an error of at most:\n\n"
    text += table(["set", "half", "version", "given"] + [str(x) for x in CURVE],
                  [curve_row(list(k), v) for k, v in found.items()])
    text += "\n## Kinds\n\n" + table(KIND_COLUMNS, kind_rows(results))
    confidence = confidence_rows(results)
    if confidence:
        text += "\n## Confidence\n\n" + table(["version", "confidence", "pairs", "right"], confidence)
    more = landmark_rows(results)
    if more:
        text += "\n## More landmarks\n\n" + table(["version", "given", "more", "pairs", "no worse"], more)
    warnings = warning_rows(results)
    if warnings:
        text += "\n## Warnings\n\n" + table(["version", "thin", "maps", "with a warning"], warnings)
    verdicts = verdict_rows(results)
    if verdicts:
        text += "\n## Changes\n\n" + table(["version", "given", "pairs", "same verdict", "right in both"], verdicts)
    return text + "\n## Pairs\n\n" + table(PAIR_COLUMNS, [pair_row(*r) for r in results])


def as_json(results):
    return {"pairs": [dict(zip(["set", "pair", "kind", "half", "version", "given"], pair_row(*r)[:6]), **r[3],
                           **({} if "failed" in r[3] else {"mean": statistics.mean(r[3]["errors"])}))
                      for r in results],
            "summary": [dict(zip(["set", "half", "version", "given"], k)) | {
                "pairs": len(v), "means": [statistics.mean(r["errors"]) for r in v if "failed" not in r],
                "curve": dict(zip(map(str, CURVE), curve_row([], v)))} for k, v in groups(results).items()]}


def list_pairs(options):
    meshes, wanted = pathlib.Path(options.meshes), options.set.split(",")
    sets = {"people": correspond_pairs.posed(meshes),
            "animals": correspond_pairs.animals(options.bin / "orbmorph-posed", options.store),
            "drawn": correspond_pairs.animals(options.bin / "orbmorph-posed", options.store, map(int, options.seeds.split(","))),
            "apes": correspond_pairs.ape_pairs(meshes, options.store),
            "parts": correspond_pairs.animals(options.bin / "orbmorph-posed", options.store, of_parts=True),
            "plans": correspond_pairs.animals(options.bin / "orbmorph-posed", options.store, of_plans=True),
            "drawn-plans": correspond_pairs.animals(options.bin / "orbmorph-posed", options.store,
                                                    list(map(int, options.seeds.split(","))), of_plans=True),
            "real": correspond_pairs.real(meshes, surface_of)}
    unknown = set(wanted) - set(sets)
    if unknown:
        sys.exit(f"correspond.py: there is no set '{unknown.pop()}'")
    chosen = []
    for name in wanted:
        pairs = [p for p in sets[name] if options.half in (p.half, "all")]
        if options.pairs:
            pairs = [p for p in pairs if p.name in options.pairs.split(",")]
        chosen += spread(pairs, options.sample or len(pairs)) if pairs else []
    return chosen


def version_of(folder):
    return hashlib.sha256((folder / "orbmorph-bench").read_bytes()).hexdigest()[:12]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "build/bin")
    parser.add_argument("--base", help="a folder of programs, or a revision")
    parser.add_argument("--meshes", default=ROOT / "../shared/meshes")
    parser.add_argument("--set", default="people,animals,real")
    parser.add_argument("--seeds", default="23", help="of the sets `drawn` and `drawn-plans`, with commas")
    parser.add_argument("--half", choices=("choose", "report", "all"), default="all")
    parser.add_argument("--given", default="0", help="numbers with commas")
    parser.add_argument("--preset", choices=("fast", "default", "quality"), default="default")
    parser.add_argument("--sample", type=int, help="so many pairs of each set")
    parser.add_argument("--pairs", help="names with commas")
    parser.add_argument("--change", default="none", help="names with commas")
    parser.add_argument("--changed-given", help="of --given, those with which changes are measured (default: all)")
    parser.add_argument("--list", action="store_true", help="print the pairs and end")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="maps at once")
    parser.add_argument("--limit", type=int, default=900, help="wall seconds that a map may take")
    parser.add_argument("--store", type=pathlib.Path, default=ROOT / "build/correspond")
    parser.add_argument("--fresh", action="store_true")
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--json", type=pathlib.Path)
    options = parser.parse_args()
    pairs = list_pairs(options)
    if not pairs:
        sys.exit("correspond.py: there is no such pair")
    if options.list:
        for pair in pairs:
            print(pair.set, pair.half, pair.name, pair.kind, sep="\t")
        return
    programs = {"now": options.bin}
    if options.base:
        is_folder = pathlib.Path(options.base, "orbmorph-bench").exists()
        programs = {"before": pathlib.Path(options.base) if is_folder else build_base(options.base)} | programs
    versions = {name: version_of(folder) for name, folder in programs.items()}
    changes = options.change.split(",")
    if set(changes) - {"none", "swapped", *correspond_changes.CHANGES}:
        sys.exit("correspond.py: --change: none, swapped, " + ", ".join(correspond_changes.CHANGES))
    changed = (options.changed_given or options.given).split(",")
    work = [(pair, name, int(n), change) for pair in pairs for n in options.given.split(",") for name in programs
            for change in changes if change == "none" or n in changed]

    def one(item):
        pair, name, given, change = item
        return stored(programs[name] / "orbmorph-bench", versions[name], pair, given, change, options)

    results = []
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for (pair, name, given, change), result in zip(work, pool.map(one, work)):
            if result:
                results.append((pair, name if change == "none" else f"{name}, {change}", given, result))
                print("  ".join(pair_row(*results[-1])), flush=True)
    text = report(results)
    print("\n" + text[text.index("## Summary"):text.index("## Pairs")])
    if options.out:
        options.out.write_text(text)
    if options.json:
        options.json.write_text(json.dumps(as_json(results)))


if __name__ == "__main__":
    main()
