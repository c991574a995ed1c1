// A supermesh warns where its map is bad, and says where; the client and its report do the same.
import assert from 'node:assert/strict';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { folder, run } from './support/cli.mjs';
import { daemon } from './support/daemon.mjs';
import { morphOf } from './support/glb.mjs';
import { ball, egg, obj } from './support/shapes.mjs';

const corners = [
  [1, 1, 1],
  [1, -1, -1],
  [-1, 1, -1],
  [-1, -1, 1],
];
// The corners of a tetrahedron, and the same four scaled to a tenth around the first.
const near = corners.map((p) => p.map((x, k) => corners[0][k] + 0.05 * (x - corners[0][k])));
const landmarks = (to) => corners.map((p, i) => ({ name: `corner ${i}`, at: [{ point: p }, { point: to[i] }] }));
const unit = (p) => p.map((x) => x / Math.hypot(...p));

test('a map that draws a surface together is warned of, with the place', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const at = await folder(t);
  const files = ['ball.obj', 'egg.obj', 'marks.json', 'morph.glb', 'report.md'].map((name) => path.join(at, name));
  await writeFile(files[0], obj(ball(4)));
  await writeFile(files[1], obj(egg(4)));
  await writeFile(files[2], JSON.stringify({ landmarks: landmarks(near.map(unit)) }));
  const options = ['--landmarks', files[2], '-o', files[3], '--report', files[4], '-t', '0.01', '--fit', 'none'];
  const done = await run(['morph', files[0], files[1], ...options], { env });
  assert.equal(done.code, 0, done.err);
  const [{ url }] = (await d.get('/v1/supermeshes')).json.supermeshes;
  const made = (await d.get(url)).json;
  // The figures of the report without the warning: the 99th percentile by area is above 20.
  assert.ok(made.pairs[0].distortion.symmetric_dirichlet.p99 > 20);
  const [warning] = made.warnings;
  assert.deepEqual([warning.kind, warning.a, warning.b], ['stretched', 0, 1]);
  assert.ok(warning.share > 0.01 && warning.share <= 1);
  assert.ok(warning.parts.length >= 1 && warning.parts.length <= 4);
  // The triangles are in the asset, inside the balls.
  const { shapes, count } = morphOf((await d.get(made.asset)).bytes);
  assert.ok(count > 0 && shapes.length === 2);
  for (const part of warning.parts) {
    assert.ok(part.share > 0 && part.share <= warning.share + 1e-9);
    assert.deepEqual(
      part.at.map(({ shape }) => shape),
      [0, 1],
    );
    for (const { centre, radius } of part.at) assert.ok(Math.hypot(...centre) < 1.6 && radius > 0 && radius < 3);
    assert.ok(part.triangles.length >= 1 && part.triangles.length <= 32);
    for (const three of part.triangles) for (const v of three) assert.ok(v >= 0 && v < made.vertices);
  }
  for (const text of [done.out, await readFile(files[4], 'utf8')]) {
    assert.match(text, /From ball to egg, [\d.]+ % of the surface is stretched badly \(energy above 20\); look around/);
  }
});

test('a good map has no warning', async (t) => {
  const d = await daemon(t);
  const replies = [await d.upload(obj(ball(3))), await d.upload(obj(egg(3)))];
  const shapes = replies.map((reply, i) => ({ mesh: reply.json.id, name: `body ${i}` }));
  const made = await d.made('/v1/supermeshes', { shapes, landmarks: landmarks(corners), remesh: { tolerance: 0.01 } });
  assert.ok(made.pairs[0].distortion.symmetric_dirichlet.p99 < 20);
  assert.deepEqual(made.warnings, []);
});

/** A ball with a limb along x that is bent about z, the more the farther out. Angles in radians. */
const limbed = (bend) =>
  obj(
    ball(5, ([x, y, z]) => {
      const out = 1.6 * Math.exp(-25 * (1 - x));
      const [c, s] = [Math.cos(bend * out), Math.sin(bend * out)];
      const [u, v] = [x * (1 + out), y * (1 + 0.2 * out)];
      return [u * c - v * s, u * s + v * c, z];
    }),
  );

test('a limb that is rotated far gets thin on the straight path, and the client names what helps', async (t) => {
  const d = await daemon(t);
  const at = await folder(t);
  const files = ['up.obj', 'down.obj', 'marks.json', 'morph.glb'].map((name) => path.join(at, name));
  await writeFile(files[0], limbed(0.7));
  await writeFile(files[1], limbed(-0.7));
  const sides = [
    [0, 1, 0],
    [0, -1, 0],
    [0, 0, 1],
    [0, 0, -1],
    [-1, 0, 0],
  ];
  const marks = sides.map((point, i) => ({ name: `side ${i}`, at: [{ point }, { point }] }));
  await writeFile(
    files[2],
    JSON.stringify({ landmarks: [...marks, { name: 'tip', at: [{ vertex: 0 }, { vertex: 0 }] }] }),
  );
  const morph = async (way) => {
    const options = ['--landmarks', files[2], '-o', files[3], '-t', '0.005', '--fit', 'none', '--path', way];
    const { code, out, err } = await run(['morph', files[0], files[1], ...options], {
      env: { ORBMORPH_SERVER: d.url },
    });
    assert.equal(code, 0, err);
    return out;
  };
  assert.match(await morph('linear'), /of the surface gets thin halfway, .* A landmark there helps .*, --path rigid/);
  assert.doesNotMatch(await morph('rigid'), /gets thin/);
  const made = (await d.get('/v1/supermeshes')).json.supermeshes.map(
    async ({ url }) => (await d.get(url)).json.warnings,
  );
  for (const warnings of await Promise.all(made))
    assert.deepEqual(
      warnings.map(({ kind }) => kind),
      ['thin'],
    );
});
