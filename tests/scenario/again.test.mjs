// A request with corrected landmarks begins where an earlier alignment ended: the same limbs, and the landmarks meet.
import assert from 'node:assert/strict';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { folder } from './support/cli.mjs';
import { assertProblem, daemon, samples } from './support/daemon.mjs';

test('corrected landmarks begin where the search ended', async (t) => {
  const d = await daemon(t);
  const meshes = [await d.mesh(path.join(samples, 'dog.obj')), await d.mesh(path.join(samples, 'giraffe.off'))];
  const shapes = meshes.map(({ id }) => ({ mesh: id }));
  const remesh = { tolerance: 0.02 };
  const make = async (request) => {
    const { resource, problem } = await d.make('/v1/supermeshes', { shapes, remesh, ...request });
    assert.ok(resource, JSON.stringify(problem));
    return resource;
  };
  const found = await make({ landmarks: 'auto' });
  assert.match(found.alignment, /^[0-9a-f]{64}$/);
  assert.equal(found.start_followed, undefined);

  // the third landmark lies at another corner of its triangle on the giraffe
  const landmarks = found.landmarks.map(({ name, at }) => ({ name, at }));
  const { triangle, barycentric } = landmarks[2].at[1];
  landmarks[2].at = [landmarks[2].at[0], { triangle, barycentric: [barycentric[1], barycentric[2], barycentric[0]] }];
  const align = { start: found.alignment };
  const again = await make({ landmarks, align });
  assert.equal(again.start_followed, true);
  assert.notEqual(again.alignment, found.alignment);
  assert.deepEqual(again.request.align.start, found.alignment);
  assert.equal(again.certificate.landmarks_exact, true);
  assert.equal(again.landmarks.length, landmarks.length);
  for (const { vertex, residual_relative: residual } of again.landmarks)
    assert.ok(vertex >= 0 && Math.max(...residual) < 1e-9);
  assert.ok(again.energy - 1 < 1.1 * (found.energy - 1), `${found.energy} ${again.energy}`);
  assert.equal((await make(again.request)).id, again.id, 'the request of the answer is the same request');
  const finer = await make({ landmarks, align, remesh: { tolerance: 0.01 } });
  assert.equal(finer.timings_ms.align, 0, 'its alignment is kept, too');
  assert.equal(finer.alignment, again.alignment);

  // two limbs that change places lead away from it
  const swapped = landmarks.map(({ name, at }, i) => ({ name, at: [at[0], landmarks[[1, 0][i] ?? i].at[1]] }));
  const { resource: anew, problem } = await d.make('/v1/supermeshes', { shapes, remesh, landmarks: swapped, align });
  assert.equal(anew?.start_followed, false, JSON.stringify(problem));

  const unknown = { start: 'ab'.repeat(32) };
  const gone = await d.make('/v1/supermeshes', { shapes, remesh, landmarks, align: unknown });
  assert.equal(gone.problem.type, '/problems/bad-option');
  assert.equal(gone.problem.member, 'start');
  assert.match(gone.problem.detail, /no longer kept.*Leave "start" out/s);
  const turned = await d.make('/v1/supermeshes', { shapes: [shapes[1], shapes[0]], remesh, landmarks, align });
  assert.equal(turned.problem.member, 'start', 'it is of another order');
  // a shape of the same connectivity is another shape
  const bent = (await readFile(path.join(samples, 'giraffe.off'), 'utf8')).replace(
    /^(\S+) (\S+) (\S+)$/gm,
    (line, x, y, z) => (Number.isInteger(+x) ? line : `${x} ${1.1 * y} ${z}`),
  );
  const file = path.join(await folder(t), 'taller.off');
  await writeFile(file, bent);
  const taller = await d.mesh(file);
  const other = { shapes: [shapes[0], { mesh: taller.id }], remesh, landmarks, align };
  assert.equal((await d.make('/v1/supermeshes', other)).problem.member, 'start', 'it is of another shape');
  for (const request of [
    { landmarks: 'auto', align },
    { landmarks, align: { start: 'nose' } },
    { landmarks, align: { ...align, method: 'rotate' } },
  ])
    assertProblem(await d.post('/v1/supermeshes', { shapes, ...request }), 422, 'invalid-request');
});
