#!/usr/bin/env python3
"""Tests the tables and the diagram of confidence.py: docs/bench/reliability.svg shows the tables of its page, the diagram
of a report shows the bins that it prints, and the intervals are those of Wilson's paper.

    tests/bench/confidence_test.py
"""
import io
import json
import pathlib
import re
import sys
import tempfile
import unittest
import xml.etree.ElementTree as xml
from contextlib import redirect_stdout

sys.dont_write_bytecode = True  # no __pycache__ beside the sources
import confidence
import svg


def drawn(text):
    """The points of a diagram, (confidence, share right) by how many pairs they have, and its other texts."""
    root = xml.fromstring(text)
    texts = ["".join(element.itertext()) for element in root.iter("{http://www.w3.org/2000/svg}text")]
    points = []
    for found in re.finditer(r'<circle cx="([\d.]+)" cy="([\d.]+)".*?<text [^>]*>(\d+)</text>', text):
        x, y = float(found[1]), float(found[2])
        points.append((int(found[3]), (x - svg.LEFT) / (svg.WIDTH - svg.LEFT - svg.RIGHT),
                       1.08 * (svg.HEIGHT - svg.BOTTOM - y) / (svg.HEIGHT - svg.TOP - svg.BOTTOM)))
    return points, texts


def run(*arguments):
    out, sys.argv = io.StringIO(), ["confidence.py", *map(str, arguments)]
    with redirect_stdout(out):
        confidence.main()
    return out.getvalue()


class Confidence(unittest.TestCase):
    def check(self, text, tables):
        points, texts = drawn(text)
        rows = [row for bins in tables for row in bins]
        self.assertEqual([point[0] for point in points], [count for _, _, count, _, _ in rows])
        for (_, x, y), (_, _, count, mean, right) in zip(points, rows):
            self.assertAlmostEqual(x, mean, delta=0.002)
            self.assertAlmostEqual(y, right / count, delta=0.002)
        for bins in tables:
            total = sum(count for _, _, count, _, _ in bins)
            self.assertTrue(any(one.startswith(f"{total} pairs ") for one in texts), texts)

    def test_page(self):
        page = confidence.PAGE.read_text(encoding="utf-8")
        tables = confidence.read_page(page)
        self.assertEqual(len(tables), 2)
        for bins in tables:  # the page says the sums, too
            total, right = (sum(row[k] for row in bins) for k in (2, 4))
            self.assertRegex(page, rf"(?m)^{total} pairs that .*, {total - right} wrong")
        text = (confidence.PAGE.parent / "bench/reliability.svg").read_text(encoding="utf-8")
        self.check(text, tables)
        self.assertIn("](bench/reliability.svg)", page)
        with tempfile.TemporaryDirectory() as folder:
            again = pathlib.Path(folder) / "again.svg"
            run("--page", "--svg", again)
            self.assertEqual(again.read_text(encoding="utf-8"), text, "draw it again: see the end of the page")

    def test_report(self):
        pairs = []
        for i in range(60):
            match = {"clear": 0.1, "bend": 0.2, "confidence": (i % 20) / 19}
            pairs.append({"set": "drawn 17" if i % 3 else "drawn 23", "pair": str(i), "half": "", "given": 0,
                          "version": "now", "energy": 1.1, "match": match, "errors": [5 if i % 7 else 15]})
        with tempfile.TemporaryDirectory() as folder:
            file, picture = (pathlib.Path(folder) / name for name in ("pairs.json", "picture.svg"))
            file.write_text(json.dumps({"pairs": pairs}), encoding="utf-8")
            printed = run("--report", file, "--svg", picture)
            tables = confidence.read_page(printed)
            self.assertEqual([sum(row[2] for row in bins) for bins in tables], [20, 40])
            self.assertEqual(sum(row[4] for bins in tables for row in bins), 51)
            self.check(picture.read_text(encoding="utf-8"), tables)

    def test_interval(self):
        # the ends p of the interval solve (share - p)^2 = z^2 p (1 - p) / count
        for right, count in ((0, 6), (1, 8), (15, 23), (176, 177), (9, 9)):
            for p in confidence.interval(right, count):
                self.assertAlmostEqual((right / count - p) ** 2, 1.96 ** 2 * p * (1 - p) / count)


if __name__ == "__main__":
    unittest.main()
