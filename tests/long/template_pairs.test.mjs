// The method "template" on every real pair with its landmarks: each vertex of the target is on the other shape, and the
// stated error is at least that of an independent measure, in both directions.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import test from 'node:test';
import { daemon } from '../scenario/support/daemon.mjs';
import { farthest } from '../scenario/support/distance.mjs';
import { morphOf } from '../scenario/support/glb.mjs';
import * as real from '../scenario/support/real.mjs';
import * as shapes from '../scenario/support/shapes.mjs';
import { samples, surface } from './nearest.mjs';

const MORE = 200_000; // points at random, beside vertices and middles
const FLOAT = 1e-6; // of the diagonal: the rounding to float32

const worstOf = (points, distance) => points.reduce((worst, p) => Math.max(worst, distance(p)), 0);

test('the tree of boxes measures what all triangles do', () => {
  const [egg, bean] = [shapes.egg(3), shapes.bean(3)];
  const flat = [bean.positions.flat(), bean.triangles.flat()];
  const distance = surface(...flat);
  for (const p of egg.positions) assert.ok(Math.abs(distance(p) - farthest([p], ...flat)) < 1e-15);
});

test('pairs of real meshes', { skip: real.there ? false : 'no real meshes' }, async (t) => {
  const d = await daemon(t);
  for (const pair of real.pairs())
    await t.test(pair.name, async (u) => {
      const list = [];
      for (const file of pair.files) list.push({ mesh: (await d.mesh(file)).id });
      const made = await d.made('/v1/supermeshes', {
        shapes: list,
        landmarks: pair.landmarks,
        remesh: { method: 'template' },
        asset: { fit: 'none', normals: false },
      });
      const [first, target] = await Promise.all(
        pair.files.map(async (file) => shapes.parse(await readFile(file, 'utf8'))),
      );
      const morph = morphOf((await d.get(made.asset)).bytes);
      const own = first.positions.length;
      assert.deepEqual(morph.shapes[0].slice(0, 3 * own), first.positions.flat().map(Math.fround));
      const corners = first.triangles.flat();
      assert.equal(morph.triangles.length, corners.length);
      morph.triangles.forEach((v, i) => {
        assert.ok(v === corners[i] || v >= own, `corner ${i}: only a seam of texture coordinates has copies`);
        for (const positions of morph.shapes)
          for (const k of [0, 1, 2]) assert.equal(positions[3 * v + k], positions[3 * corners[i] + k]);
      });
      const wanted = [target.positions.flat(), target.triangles.flat()];
      const { hausdorff_relative: stated, hausdorff_proved, diagonal } = made.shapes[1];
      const size = Math.hypot(
        ...[0, 1, 2].map((k) => {
          const values = target.triangles.flat().map((v) => target.positions[v][k]);
          return values.reduce((a, b) => Math.max(a, b)) - values.reduce((a, b) => Math.min(a, b));
        }),
      );
      assert.ok(Math.abs(diagonal / size - 1) < 1e-6);
      const [toTarget, toMade] = [surface(...wanted), surface(morph.shapes[1], morph.triangles)];
      const vertices = Array.from({ length: morph.count }, (_, v) => [0, 1, 2].map((k) => morph.shapes[1][3 * v + k]));
      const off = worstOf(vertices, toTarget) / size;
      const there = worstOf(samples(morph.shapes[1], morph.triangles, MORE), toTarget) / size;
      const back = worstOf(samples(...wanted, MORE), toMade) / size;
      u.diagnostic(
        `vertices off by ${off.toExponential(1)}; stated ${(100 * stated).toFixed(3)} %, measured ` +
          `${(100 * there).toFixed(3)} % and ${(100 * back).toFixed(3)} %; ${made.pairs[0].inverted_count} inverted`,
      );
      assert.ok(off <= FLOAT, `a vertex is off by ${off}`);
      assert.equal(hausdorff_proved, true);
      assert.ok(Math.max(there, back) <= stated + FLOAT, `measured ${there} and ${back}, stated ${stated}`);
    });
});
