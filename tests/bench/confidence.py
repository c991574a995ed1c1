#!/usr/bin/env python3
"""Fits the confidence in a match, and prints how often matches of a confidence are right: the tables of
docs/bench-confidence.md.

    tests/bench/confidence.py [--fit FILE.json ...] [--report FILE.json ...]

Every FILE is what tests/bench/correspond.py wrote by --json, measured without landmarks. --fit fits the weights by
logistic regression to the drawn pairs of FITTED and to other pairs of the half `choose`, and prints them. --report
counts the pairs by the confidence that the version has given them, those that are fitted to by themselves. Parts, whose
confidence is a constant, are left out of the fit and counted by themselves. Standard library only.
"""
import argparse
import json
import math
import pathlib
import statistics

RIGHT = 10  # mean error up to which a pair is right, as in correspond.py
CLEAR = 0.5  # ORB_FIND_CLEAR
FITTED = ("drawn 17", "drawn 19", "drawn 29")  # sets that the weights are fitted to; maps were chosen on 17 and 19
RIDGE = 0.02  # weak: a weight of 5 costs as much as a quarter of one pair that is fully wrong
ROUNDS = 60
BINS = ((0, 0.2), (0.2, 0.5), (0.5, 0.8), (0.8, 0.95), (0.95, 1.001))


def read(files):
    """The pairs of results: (features, right, confidence, is a part, is fitted to). A pair counts once."""
    pairs = {}
    for file in files:
        for r in json.loads(pathlib.Path(file).read_text(encoding="utf-8"))["pairs"]:
            match = r.get("match")
            is_measured = str(r["given"]) == "0" and r["version"] == "now" and "errors" in r
            if is_measured and r["set"] != "real" and match:
                features = (1, min(match["clear"], CLEAR), match["bend"], math.log(max(1, r["energy"])))
                is_fitted = r["set"] in FITTED if r["set"].startswith("drawn") else r["half"] == "choose"
                pairs[r["set"], r["pair"]] = (features, statistics.mean(r["errors"]) <= RIGHT, match["confidence"],
                                              match.get("part", False), is_fitted)
    return list(pairs.values())


def solve(matrix):
    """Solves a linear system, given as rows with the right side last, by Gauss–Jordan elimination."""
    n = len(matrix)
    for i in range(n):
        pivot = max(range(i, n), key=lambda row: abs(matrix[row][i]))
        matrix[i], matrix[pivot] = matrix[pivot], matrix[i]
        for row in range(n):
            if row != i:
                factor = matrix[row][i] / matrix[i][i]
                matrix[row] = [a - factor * b for a, b in zip(matrix[row], matrix[i])]
    return [matrix[i][n] / matrix[i][i] for i in range(n)]


def fit(pairs):
    """The weights of least regularised log loss, by Newton's method. The constant is not regularised."""
    n = len(pairs[0][0])
    weights = [0.0] * n
    for _ in range(ROUNDS):
        system = [[RIDGE * (i == j > 0) for j in range(n)] + [-RIDGE * weights[i] * (i > 0)] for i in range(n)]
        for features, right, *_ in pairs:
            odds = max(-30, min(30, sum(a * b for a, b in zip(weights, features))))
            chance = 1 / (1 + math.exp(-odds))
            for i in range(n):
                system[i][n] += (right - chance) * features[i]
                for j in range(n):
                    system[i][j] += chance * (1 - chance) * features[i] * features[j]
        weights = [a + b for a, b in zip(weights, solve(system))]
    return weights


def table(pairs):
    lines = ["| confidence | pairs | mean confidence | right |", "|---|---|---|---|"]
    for low, high in BINS:
        found = [(right, confidence) for _, right, confidence, *_ in pairs if low <= confidence < high]
        if found:
            right = sum(r for r, _ in found)
            lines.append(f"| {low:g} to {min(high, 1):g} | {len(found)} | {statistics.mean(c for _, c in found):.2f} | "
                         f"{right} ({100 * right / len(found):.0f} %) |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fit", nargs="+", default=[], metavar="FILE")
    parser.add_argument("--report", nargs="+", default=[], metavar="FILE")
    options = parser.parse_args()
    chosen = [pair for pair in read(options.fit) if pair[4] and not pair[3]]
    if chosen:
        constant, clear, bend, energy = fit(chosen)
        wrong = sum(not right for _, right, *_ in chosen)
        print(f"fitted to {len(chosen)} pairs, {wrong} of them wrong: odds = {constant:.2f} + {clear:.2f} clear "
              f"− {-bend:.2f} bend − {-energy:.2f} ln(energy)")
    reported = read(options.report)
    for is_fitted, name in ((False, "that the weights were not fitted to"), (True, "that they were fitted to")):
        pairs = [pair for pair in reported if pair[4] == is_fitted and not pair[3]]
        parts = [pair for pair in reported if pair[4] == is_fitted and pair[3]]
        if pairs:
            error = statistics.mean((right - confidence) ** 2 for _, right, confidence, *_ in pairs)
            wrong = sum(not pair[1] for pair in pairs)
            print(f"\n{len(pairs)} pairs {name}, {wrong} wrong, mean squared error {error:.3f}\n\n{table(pairs)}")
        if parts:
            print(f"\nparts: {sum(p[1] for p in parts)} of {len(parts)} right")


if __name__ == "__main__":
    main()
