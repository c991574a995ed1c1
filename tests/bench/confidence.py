#!/usr/bin/env python3
"""Fits the confidence in a match, and prints and draws how often matches of a confidence are right: the tables of
docs/bench-confidence.md, and docs/bench/reliability.svg.

    tests/bench/confidence.py [--fit FILE.json ...] [--report FILE.json ... [--svg FILE.svg]]
    tests/bench/confidence.py --page --svg docs/bench/reliability.svg

Every FILE is what tests/bench/correspond.py wrote by --json, measured without landmarks. --fit fits the weights by
logistic regression to the drawn pairs of FITTED and to other pairs of the half `choose`, and prints them. --report
counts the pairs by the confidence that the version has given them, those that are fitted to by themselves. Parts, whose
confidence is a constant, are left out of the fit and counted by themselves. --svg draws the bins of the tables that
--report prints, or, with --page, those that are printed in docs/bench-confidence.md. Standard library only.
"""
import argparse
import json
import math
import pathlib
import re
import statistics

import svg

RIGHT = 10  # mean error up to which a pair is right, as in correspond.py
CLEAR = 0.5  # ORB_FIND_CLEAR
FITTED = ("drawn 17", "drawn 19", "drawn 29")  # sets that the weights are fitted to; maps were chosen on 17 and 19
RIDGE = 0.02  # weak: a weight of 5 costs as much as a quarter of one pair that is fully wrong
ROUNDS = 60
PAGE = pathlib.Path(__file__).parents[2] / "docs/bench-confidence.md"
CERTAIN = 1.96  # standard deviations of a normal distribution that 95 % of it lie within
NAMES = ("that the weights were not fitted to", "that they were fitted to")
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


def bins_of(pairs):
    """The bins that have pairs: (lowest confidence, highest, pairs, mean confidence, right ones). The mean is rounded as
    the table prints it, so that the diagram of a page is that of its pairs."""
    for low, high in BINS:
        found = [(right, confidence) for _, right, confidence, *_ in pairs if low <= confidence < high]
        if found:
            mean = round(statistics.mean(c for _, c in found), 2)
            yield low, min(high, 1), len(found), mean, sum(r for r, _ in found)


HEAD = "| confidence | pairs | mean confidence | right |\n|---|---|---|---|"
ROW = re.compile(r"\| ([\d.]+) to ([\d.]+) \| (\d+) \| ([\d.]+) \| (\d+) \(\d+ %\) \|$", re.M)


def table(bins):
    return "\n".join([HEAD] + [f"| {low:g} to {high:g} | {count} | {mean:.2f} | {right} ({100 * right / count:.0f} %) |"
                               for low, high, count, mean, right in bins])


def read_page(page):
    """The bins of each table of confidences on a page, in their order."""
    return [[(float(low), float(high), int(count), float(mean), int(right))
             for low, high, count, mean, right in ROW.findall(part.split("\n\n")[0])]
            for part in page.split(HEAD)[1:]]


def interval(right, count):
    """Between these lies the share of right pairs with a probability of 95 % (Wilson, J. Am. Stat. Assoc. 22, 1927)."""
    share, spread = right / count, CERTAIN ** 2 / count
    half = CERTAIN * math.sqrt(share * (1 - share) / count + spread / count / 4)
    return tuple((share + spread / 2 + sign * half) / (1 + spread) for sign in (-1, 1))


def draw(tables):
    """The reliability diagram of (name, bins)."""
    series = [(f"{sum(b[2] for b in bins)} pairs {name}",
               [(mean, right / count, interval(right, count), count) for _, _, count, mean, right in bins])
              for name, bins in tables]
    return svg.shares(series, "confidence, mean of the bin", "share of right matches")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fit", nargs="+", default=[], metavar="FILE")
    parser.add_argument("--report", nargs="+", default=[], metavar="FILE")
    parser.add_argument("--svg", metavar="FILE.svg")
    parser.add_argument("--page", action="store_true", help="draw the tables of docs/bench-confidence.md")
    options = parser.parse_args()
    chosen = [pair for pair in read(options.fit) if pair[4] and not pair[3]]
    if chosen:
        constant, clear, bend, energy = fit(chosen)
        wrong = sum(not right for _, right, *_ in chosen)
        print(f"fitted to {len(chosen)} pairs, {wrong} of them wrong: odds = {constant:.2f} + {clear:.2f} clear "
              f"− {-bend:.2f} bend − {-energy:.2f} ln(energy)")
    reported = read(options.report)
    drawn = list(zip(NAMES, read_page(PAGE.read_text(encoding="utf-8")))) if options.page else []
    for is_fitted, name in enumerate(NAMES):
        pairs = [pair for pair in reported if pair[4] == is_fitted and not pair[3]]
        parts = [pair for pair in reported if pair[4] == is_fitted and pair[3]]
        if pairs:
            error = statistics.mean((right - confidence) ** 2 for _, right, confidence, *_ in pairs)
            wrong = sum(not pair[1] for pair in pairs)
            bins = list(bins_of(pairs))
            print(f"\n{len(pairs)} pairs {name}, {wrong} wrong, mean squared error {error:.3f}\n\n{table(bins)}")
            drawn += [] if options.page else [(name, bins)]
        if parts:
            print(f"\nparts: {sum(p[1] for p in parts)} of {len(parts)} right")
    if options.svg:
        pathlib.Path(options.svg).write_text(draw(drawn), encoding="utf-8")


if __name__ == "__main__":
    main()
