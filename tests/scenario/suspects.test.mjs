// Misplaced landmarks are named, with a place nearer to the true one; true landmarks are not named.
import assert from 'node:assert/strict';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { folder, run } from './support/cli.mjs';
import { daemon, samples } from './support/daemon.mjs';
import { apart, diagonalOf, placed, readOff, vertexBeside } from './support/misplaced.mjs';

const MOVED = [0, 17]; // the nose, the root of the tail
test('a landmark moved by 0.15 of the diagonal is named, and the true ones are not', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const at = await folder(t);
  const [dog, giraffe, file] = ['dog.obj', 'giraffe.off', 'dog-giraffe.json'].map((name) => path.join(samples, name));
  const { landmarks } = JSON.parse(await readFile(file, 'utf8'));
  const mesh = readOff(await readFile(giraffe, 'utf8'));
  const diagonal = diagonalOf(mesh);
  const [marks, report] = ['marks.json', 'report.json'].map((name) => path.join(at, name));
  const morph = async (list) => {
    await writeFile(marks, JSON.stringify({ landmarks: list }));
    const options = ['--landmarks', marks, '-t', '0.02', '-o', path.join(at, 'out.glb'), '--report', report];
    const done = await run(['morph', dog, giraffe, ...options], { env });
    assert.equal(done.code, 0, done.err);
    const { suspects, landmarks: met } = JSON.parse(await readFile(report, 'utf8'));
    const shares = met.map(({ share }) => share);
    assert.ok(Math.abs(shares.reduce((sum, share) => sum + share) - 1) < 1e-6, `${shares} are all of the distortion`);
    return { said: done.out, suspects, shares };
  };
  const clean = await morph(landmarks);
  assert.deepEqual(clean.suspects, []);
  assert.doesNotMatch(clean.said, /misplaced/);
  for (const moved of MOVED) {
    const truth = placed(mesh, landmarks[moved].at[1]);
    const vertex = vertexBeside(mesh, landmarks, moved);
    const changed = landmarks.map((l, i) => (i === moved ? { ...l, at: [l.at[0], { vertex }] } : l));
    const { said, suspects, shares } = await morph(changed);
    const label = landmarks[moved].name;
    assert.deepEqual(
      suspects.map(({ landmark, name, shape }) => [landmark, name, shape]),
      [[moved, label, 1]],
    );
    const [{ at: meant, share, distance_relative: distance }] = suspects;
    assert.ok(share > 1 / landmarks.length && share <= 1, `${label}: ${share}`); // more than its part
    assert.equal(shares[moved], share);
    const given = mesh.positions[vertex];
    assert.ok(Math.abs(apart(placed(mesh, meant), given) / diagonal - distance) < 1e-6);
    const left = apart(placed(mesh, meant), truth) / apart(given, truth);
    assert.ok(left < 1, `${label} would be nearer to its true place: ${left}`);
    assert.match(said, new RegExp(`The landmark ${label} may be misplaced: \\d+ % of the distortion`));
  }
});
