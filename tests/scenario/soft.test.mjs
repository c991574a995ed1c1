// A soft landmark ends where its spring and the energy of the map balance. A true landmark that is moved costs energy, so
// with less weight it lies farther from its place and the map has less energy; the other landmarks stay exact.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { assertProblem, daemon, samples } from './support/daemon.mjs';

const MOVED = 17; // the root of the tail
const apart = (p, q) => Math.hypot(...p.map((x, k) => x - q[k]));

/** The vertices of an OFF file. */
function readPoints(text) {
  const numbers = text.split(/\s+/).slice(1).map(Number);
  return Array.from({ length: numbers[0] }, (_, v) => numbers.slice(3 + 3 * v, 6 + 3 * v));
}

test('a soft landmark gives way where the map is better for it', async (t) => {
  const d = await daemon(t);
  const { landmarks } = JSON.parse(await readFile(path.join(samples, 'dog-giraffe.json'), 'utf8'));
  const file = path.join(samples, 'giraffe.off');
  const points = readPoints(await readFile(file, 'utf8'));
  const meshes = [await d.mesh(path.join(samples, 'dog.obj')), await d.mesh(file)];
  const [low, high] = [Math.min, Math.max].map((f) => [0, 1, 2].map((k) => f(...points.map((p) => p[k]))));
  const taken = landmarks.map((l) => l.at[1].vertex);
  const off = points.map((p, v) =>
    taken.includes(v) ? Infinity : Math.abs(apart(p, points[taken[MOVED]]) / apart(low, high) - 0.15),
  );
  const wrong = off.indexOf(Math.min(...off));
  const request = (weight, options) => ({
    shapes: meshes.map(({ id }) => ({ mesh: id })),
    landmarks: landmarks.map((l, i) => (i === MOVED ? { ...l, at: [l.at[0], { vertex: wrong }], weight } : l)),
    remesh: { tolerance: 0.02 },
    ...options,
  });
  const merge = async (weight) => {
    const { resource, problem } = await d.make('/v1/supermeshes', request(weight));
    assert.ok(resource, JSON.stringify(problem));
    const soft = resource.landmarks[MOVED];
    assert.equal(resource.certificate.landmarks_exact, true);
    for (const one of resource.landmarks) {
      if (one === soft && weight < 1) continue;
      assert.ok(one.vertex >= 0 && Math.max(...one.residual_relative) < 1e-9, one.name);
      assert.equal(one.weight, undefined);
    }
    return { id: resource.id, energy: resource.energy, soft, far: soft.residual_relative.reduce((sum, x) => sum + x) };
  };
  const pinned = await merge(1);
  const firm = await merge(0.8);
  const loose = await merge(0.1);
  assert.equal(firm.soft.weight, 0.8);
  assert.equal(loose.soft.vertex, -1);
  assert.ok(0 < firm.far && firm.far < loose.far, `${firm.far} ${loose.far}`);
  assert.ok(pinned.energy > firm.energy && firm.energy > loose.energy, JSON.stringify([pinned, firm, loose]));
  assert.equal((await merge(undefined)).id, pinned.id, 'a weight of 1 is the default');

  for (const weight of [0, 1.5, 'much'])
    assertProblem(await d.post('/v1/supermeshes', request(weight)), 422, 'bad-option');
  const rotated = await d.make('/v1/supermeshes', request(0.5, { align: { method: 'rotate' } }));
  assert.match(rotated.problem.detail, /weight below 1, which only the method pin accepts/);
});
