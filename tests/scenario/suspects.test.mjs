// Misplaced landmarks are named, with a place nearer to the true one; true landmarks are not named.
import assert from 'node:assert/strict';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { folder, run } from './support/cli.mjs';
import { daemon, samples } from './support/daemon.mjs';

const MOVED = [0, 17]; // the nose, the root of the tail
const apart = (p, q) => Math.hypot(...p.map((x, k) => x - q[k]));

function readOff(text) {
  const numbers = text.split(/\s+/).slice(1).map(Number);
  const [vertices, faces] = numbers;
  const row = (at, size) => numbers.slice(at, at + size);
  return {
    positions: Array.from({ length: vertices }, (_, v) => row(3 + 3 * v, 3)),
    triangles: Array.from({ length: faces }, (_, t) => row(3 + 3 * vertices + 4 * t + 1, 3)),
  };
}

function placed({ positions, triangles }, at) {
  if (at.point) return at.point;
  if (at.vertex !== undefined) return positions[at.vertex];
  const corners = triangles[at.triangle].map((v) => positions[v]);
  return [0, 1, 2].map((k) => corners.reduce((sum, p, i) => sum + at.barycentric[i] * p[k], 0));
}

test('a landmark moved by 0.15 of the diagonal is named, and the true ones are not', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const at = await folder(t);
  const [dog, giraffe, file] = ['dog.obj', 'giraffe.off', 'dog-giraffe.json'].map((name) => path.join(samples, name));
  const { landmarks } = JSON.parse(await readFile(file, 'utf8'));
  const mesh = readOff(await readFile(giraffe, 'utf8'));
  const ends = [Math.min, Math.max].map((f) => [0, 1, 2].map((k) => f(...mesh.positions.map((p) => p[k]))));
  const diagonal = apart(...ends);
  const [marks, report] = ['marks.json', 'report.json'].map((name) => path.join(at, name));
  const morph = async (list) => {
    await writeFile(marks, JSON.stringify({ landmarks: list }));
    const options = ['--landmarks', marks, '-t', '0.02', '-o', path.join(at, 'out.glb'), '--report', report];
    const done = await run(['morph', dog, giraffe, ...options], { env });
    assert.equal(done.code, 0, done.err);
    return { said: done.out, suspects: JSON.parse(await readFile(report, 'utf8')).suspects };
  };
  const clean = await morph(landmarks);
  assert.deepEqual(clean.suspects, []);
  assert.doesNotMatch(clean.said, /misplaced/);
  for (const moved of MOVED) {
    const truth = placed(mesh, landmarks[moved].at[1]);
    // The vertex whose distance from the true place is nearest to 0.15 of the diagonal, and that is not another landmark.
    const taken = new Set(landmarks.map((l) => l.at[1].vertex));
    const off = mesh.positions.map((p, v) => (taken.has(v) ? Infinity : Math.abs(apart(p, truth) / diagonal - 0.15)));
    const vertex = off.indexOf(Math.min(...off));
    assert.ok(off[vertex] < 0.01);
    const changed = landmarks.map((l, i) => (i === moved ? { ...l, at: [l.at[0], { vertex }] } : l));
    const { said, suspects } = await morph(changed);
    const label = landmarks[moved].name;
    assert.deepEqual(
      suspects.map(({ landmark, name, shape }) => [landmark, name, shape]),
      [[moved, label, 1]],
    );
    const [{ at: meant, share, distance_relative: distance }] = suspects;
    assert.ok(share > 1 / landmarks.length && share <= 1, `${label}: ${share}`); // more than its part
    const given = mesh.positions[vertex];
    assert.ok(Math.abs(apart(placed(mesh, meant), given) / diagonal - distance) < 1e-6);
    const left = apart(placed(mesh, meant), truth) / apart(given, truth);
    assert.ok(left < 1, `${label} would be nearer to its true place: ${left}`);
    assert.match(said, new RegExp(`The landmark ${label} may be misplaced: \\d+ % of the distortion`));
  }
});
