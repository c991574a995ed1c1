#!/usr/bin/env python3
"""Tests the measuring of maps: correspond_test.py BIN. The truth of two poses of one body, changes, and images."""
import math
import pathlib
import random
import statistics
import subprocess
import sys
import tempfile
import unittest

import apes
import correspond
import correspond_changes
import correspond_pairs
from surface import Surface

BODIES = ("cat-stand", "cat-turn")


class Correspond(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        path = pathlib.Path(cls.folder.name)
        program = pathlib.Path(sys.argv[1], "orbmorph-posed")
        subprocess.run([program, path], check=True)
        subprocess.run([program, path, *BODIES], check=True, stdout=subprocess.DEVNULL)
        cls.surfaces = [Surface(path / f"{body}.obj") for body in BODIES]
        cls.places = correspond_pairs.places_of(path, *(surface.file.name for surface in cls.surfaces))

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_a_seed_draws_the_same_pairs_of_all_kinds(self):
        rows = correspond_pairs.drawn(17)
        self.assertEqual(rows, correspond_pairs.drawn(17))
        self.assertNotEqual(rows, correspond_pairs.drawn(18))
        kinds = [frozenset(name.split("-")[0] for name in row[:2]) for row in rows]
        self.assertEqual({len(both) for both in kinds}, {2})
        self.assertEqual({kinds.count(both) for both in kinds}, {4})
        self.assertEqual(len(set(kinds)), 21)

    def test_a_seed_draws_pairs_of_other_plans_too(self):
        listed = [("hand-stand.obj", "hand-stout-grip.obj", ""), ("fish-swim.obj", "fish-dart.obj", "")]
        rows = correspond_pairs.drawn_plans(listed, 1)
        self.assertEqual(rows, correspond_pairs.drawn_plans(listed, 1))
        self.assertNotEqual(rows, correspond_pairs.drawn_plans(listed, 2))
        self.assertEqual([row[0].split("-")[0] for row in rows], 4 * ["fish"] + 4 * ["hand"])
        for row in rows:
            poses = {name.removesuffix(".obj").split("-")[-1] for name in row[:2]}
            self.assertEqual(poses, {"swim", "dart"} if row[0].startswith("fish") else {"stand", "grip"})

    def test_an_ape_keeps_its_triangles_and_changes_its_limbs(self):
        """With a cat for a person: its forelegs are the arms, its hind legs the legs."""
        cat, limbs = self.surfaces[0], {}
        for vertex in range(len(cat.positions)):
            x, y, z = cat.positions[vertex]
            limbs.setdefault((x > 0, z > 0), []).append((y, vertex))
        feet = [min(corner)[1] for corner in limbs.values()]
        self.assertEqual(len(set(feet)), 4)
        top = max(range(len(cat.positions)), key=lambda v: cat.positions[v][1])
        parts = dict(enumerate(["arm.L", "leg.L", "arm.R", "leg.R"][:len(feet)] + ["torso"]))
        of, truth = {}, {}
        for sample, vertex in enumerate([*feet, top]):
            truth[sample] = correspond_pairs.vertex_place(cat, vertex, of)
        positions, triangles = apes.ape_of(cat.file, truth, parts)
        self.assertEqual(triangles, cat.triangles)
        for sample, vertex in enumerate(feet):
            near = [v for v in range(len(positions)) if math.dist(cat.positions[v], cat.positions[vertex]) < 0.03 * cat.diagonal]
            spread = [max(math.dist(at[v], at[vertex]) for v in near) for at in (cat.positions, positions)]
            self.assertAlmostEqual(spread[1] / spread[0], apes.SCALES[parts[sample].split(".")[0]], delta=0.1)

    def test_apes_are_paired_with_other_people(self):
        files = ["ada-run.obj", "ben-sit.off", "cora-run.obj", "cora-sit.obj"]
        rows = apes.pairs(files)
        self.assertEqual(rows, apes.pairs(reversed(files)))
        self.assertEqual(len(rows), 2 * len(files))
        self.assertTrue(all(first.removeprefix("ape-").split("-")[0] != second.split("-")[0] for first, second, _ in rows))

    def test_bodies_are_closed_and_of_their_own_triangles(self):
        for surface in self.surfaces:
            edges = {(t[k], t[(k + 1) % 3]) for t in surface.triangles for k in range(3)}
            self.assertEqual(len(edges), 3 * len(surface.triangles))
            self.assertTrue(all((b, a) in edges for a, b in edges))
            self.assertEqual(len(surface.triangles), 2 * len(surface.positions) - 4)
        self.assertNotEqual(*(len(surface.triangles) for surface in self.surfaces))

    def test_lengths_between_true_places_are_those_of_the_other_pose(self):
        """Skinning bends a surface, and changes lengths along it little."""
        self.assertGreater(len(self.places), 300)
        draw, ratios = random.Random(1), []
        for _ in range(60):
            p, q = draw.sample(self.places, 2)
            lengths = [surface.length(p[s], surface.position(q[s])) for s, surface in enumerate(self.surfaces)]
            scaled = [length / math.sqrt(surface.area) for length, surface in zip(lengths, self.surfaces)]
            if scaled[0] > 0.3:
                ratios.append(scaled[1] / scaled[0])
        self.assertGreater(len(ratios), 40)
        self.assertLess(max(abs(math.log(r)) for r in ratios), 0.35)
        self.assertLess(abs(math.log(statistics.median(ratios))), 0.05)

    def test_right_and_left_are_not_exchanged(self):
        """The determinant of nose, tail, right and left ear's places has one sign in both poses."""
        signs = []
        for s, surface in enumerate(self.surfaces):
            nose, _, _, _, _, tail, right, left = (surface.position(place[s]) for place in self.places[:8])
            rows = [[b - a for a, b in zip(tail, p)] for p in (nose, right, left)]
            signs.append(correspond.dot(rows[0], correspond.cross(rows[1], rows[2])) > 0)
        self.assertEqual(*signs)

    def test_changes_keep_places(self):
        first, second = self.surfaces
        for name in ("turned", "refined"):
            a, b, places = correspond_changes.change(name, first, second, self.places, second.file.parent)
            self.assertIs(a, first)
            self.assertAlmostEqual(b.area / second.area, 1, 5)
            for (_, before, _), (_, after, _) in zip(self.places[:40], places[:40]):
                distances = [[math.dist(surface.position(x), surface.position(y[1])) for y in other[40:60]]
                             for surface, x, other in ((second, before, self.places), (b, after, places))]
                for d, e in zip(*distances):
                    self.assertAlmostEqual(d / second.diagonal, e / second.diagonal, 5)
        self.assertEqual(len(b.triangles), 4 * len(second.triangles))
        a, b, places = correspond_changes.change("swapped", first, second, self.places, None)
        self.assertEqual((a, b, places[3][:2]), (second, first, self.places[3][1::-1]))

    def test_noise_moves_vertices_by_a_fifth_of_an_edge(self):
        first, second = self.surfaces
        _, noisy, places = correspond_changes.change("noisy", first, second, self.places, second.file.parent)
        edges = [math.dist(*(second.positions[t[i]] for i in (k, k - 1))) for t in second.triangles for k in range(3)]
        moved = [x - y for p, q in zip(noisy.positions, second.positions) for x, y in zip(p, q)]
        self.assertAlmostEqual(statistics.pstdev(moved) / statistics.mean(edges), correspond_changes.NOISE, 2)
        self.assertEqual(noisy.triangles, second.triangles)
        self.assertEqual(places, self.places)

    def test_images_follow_from_four_distances(self):
        points = [self.surfaces[0].position(place[0]) for place in self.places[:80]]
        chosen = [points[i] for i in correspond.anchors(points)]
        for point in points:
            self.assertLess(math.dist(point, correspond.solve(chosen, [math.dist(point, c) for c in chosen])), 1e-6)

    def test_a_map_is_measured(self):
        """The program maps a body to itself almost exactly."""
        pair = correspond_pairs.Pair("animals", "self", "", "choose", self.surfaces[0].file, self.surfaces[0].file,
                                     lambda: [(a, a, part) for a, _, part in self.places])
        options = type("Options", (), {"preset": "fast", "threads": 1, "limit": 600, "store": pathlib.Path(self.folder.name)})
        result = correspond.measure(pathlib.Path(sys.argv[1], "orbmorph-bench"), pair, 8, "none", options)
        self.assertNotIn("failed", result)
        self.assertEqual(len(result["errors"]), 250)
        self.assertLess(statistics.mean(result["errors"]), 0.2)
        self.assertGreater(result["cpu"], 0.1)

    def test_more_landmarks_and_warnings_are_counted(self):
        def result(error, thin=0, warned=0):
            return {"errors": [error], "halfway": {"thin_fraction": thin}, "warned": {"thin": warned}}

        pairs = [correspond_pairs.Pair("animals", name, "", "choose", None, None, None) for name in "ab"]
        results = [(pairs[0], "now", 0, result(2)), (pairs[1], "now", 0, result(2, thin=0.02)),
                   (pairs[0], "now", 8, result(2.09)), (pairs[1], "now", 8, {"failed": "", "cpu": 1}),
                   (pairs[0], "now", 24, result(3, thin=0.007, warned=0.01)), (pairs[1], "now", 24, result(1))]
        self.assertEqual(correspond.landmark_rows(results),
                         [["now", "0", "8", "2", "1"], ["now", "0", "24", "2", "1"], ["now", "8", "24", "2", "1"]])
        self.assertEqual(correspond.warning_rows(results), [["now", "more than 0.0 %", "2", "1"], ["now", "more than 0.5 %", "2", "1"],
                                                            ["now", "more than 1.0 %", "1", "0"]])

    def test_pairs_are_summed_up_by_their_kind(self):
        def pair(name, kind):
            return correspond_pairs.Pair("people", name, kind, "choose", None, None, None)

        def result(*errors):
            return {"errors": errors, "diagonal": [error / 2 for error in errors]}

        one, two, other = pair("a", "same person"), pair("b", "same person"), pair("c", "other person")
        results = [(one, "now", 8, result(1, 2)), (two, "now", 8, result(4)), (other, "now", 8, result(6)),
                   (one, "now, turned", 8, result(50)), (two, "now", 24, {"failed": "", "cpu": 1})]
        self.assertEqual(correspond.kind_rows(results),
                         [["people", "other person", "now", "8", "1", "6.0", "3.00"],
                          ["people", "same person", "now", "8", "2", "2.8", "1.38"]])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
