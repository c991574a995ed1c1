// Alignments are kept: requests with other members "remesh" and "asset" need no new alignment, and the bytes are the
// same.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { readdir, readFile, truncate, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { binaries, daemon } from './support/daemon.mjs';
import { bean, egg, obj } from './support/shapes.mjs';

// The octahedron that both balls are made from; one place lies within a triangle, so that pinning has to split it.
const landmarks = [
  ...[0, 1, 2, 3, 4, 5].map((v) => ({ name: `tip ${v}`, at: [{ vertex: v }, { vertex: v }] })),
  {
    name: 'inside',
    at: [
      { triangle: 7, barycentric: [0.5, 0.25, 0.25] },
      { triangle: 9, barycentric: [0.2, 0.6, 0.2] },
    ],
  },
];
const fast = (method) => ({ method, options: { preset: 'fast' } });

async function upload(d) {
  const replies = [await d.upload(obj(egg(3))), await d.upload(obj(bean(3)))];
  return replies.map((reply, i) => ({ mesh: reply.json.id, name: `body ${i}` }));
}

/** The bytes that callers download. */
async function files(d, supermesh) {
  const names = ['asset.glb', 'places', 'spheres/0.ply', 'spheres/1.ply'];
  const all = {};
  for (const name of names) {
    const reply = await d.get(`${supermesh.url}/${name}`);
    assert.equal(reply.status, 200, name);
    all[name] = reply.bytes;
  }
  const quantized = await d.get(supermesh.asset, { query: { profile: 'quantized' } });
  assert.equal(quantized.status, 200);
  return { ...all, quantized: quantized.bytes };
}

const report = ({ energy, landmarks, certificate, shapes, pairs }) => ({
  energy,
  landmarks,
  certificate,
  shapes,
  pairs,
});

async function keptFiles(data) {
  const root = path.join(data, 'objects', 'alignment');
  const names = await readdir(root, { recursive: true });
  return names.filter((name) => name.length > 60).map((name) => path.join(root, name));
}

for (const [what, align, marks] of [
  ['found landmarks', fast('auto'), 'auto'],
  ['pinned landmarks', fast('pin'), landmarks],
]) {
  test(`${what}: other methods, tolerances and fits use the alignment of the first request`, async (t) => {
    const d = await daemon(t);
    const shapes = await upload(d);
    const base = { shapes, landmarks: marks, align };
    const first = await d.made('/v1/supermeshes', { ...base, remesh: { method: 'adaptive', tolerance: 0.01 } });
    assert.ok(first.timings_ms.align > 0);
    const others = [
      { remesh: { method: 'adaptive', tolerance: 0.02 }, asset: { fit: 'none' } },
      { remesh: { method: 'subdivision' }, asset: { path: 'rigid', normals: false } },
    ];
    const fresh = await daemon(t);
    await upload(fresh);
    for (const members of others) {
      const kept = await d.made('/v1/supermeshes', { ...base, ...members });
      assert.equal(kept.timings_ms.align, 0, JSON.stringify(members));
    }
    const [kept, computed] = [
      await d.made('/v1/supermeshes', { ...base, ...others[0] }),
      await fresh.made('/v1/supermeshes', { ...base, ...others[0] }),
    ];
    assert.ok(computed.timings_ms.align > 0);
    assert.equal(kept.id, computed.id);
    assert.deepEqual(report(kept), report(computed));
    const [a, b] = [await files(d, kept), await files(fresh, computed)];
    for (const name of Object.keys(a)) assert.ok(a[name].equals(b[name]), name);
    assert.equal((await keptFiles(d.data)).length, 1);
  });
}

test('landmarks, their places and the options of alignment and embedding make another alignment; names and confidences do not', async (t) => {
  const d = await daemon(t);
  const shapes = await upload(d);
  const marks = landmarks.slice(0, 5);
  const base = { shapes, landmarks: marks, align: fast('rotate'), remesh: { tolerance: 0.02 } };
  const align = async (members) => (await d.made('/v1/supermeshes', { ...base, ...members })).timings_ms.align;
  assert.ok((await align({})) > 0);
  assert.ok((await align({ landmarks: marks.slice(1) })) > 0);
  assert.ok((await align({ align: fast('rbf') })) > 0);
  assert.ok((await align({ shapes: [...shapes].reverse(), landmarks: 'auto' })) > 0);
  assert.ok((await align({ embedding: { options: { energy_weight: 0.5 } } })) > 0);
  assert.equal(await align({ landmarks: marks.map((mark) => ({ ...mark, confidence: 0.5 })) }), 0);
  assert.equal(await align({ shapes: shapes.map((s, i) => ({ ...s, name: `other ${i}` })) }), 0);
  assert.equal(await align({ landmarks: marks.map((l, i) => ({ ...l, name: `mark ${i}` })) }), 0);
});

test('a kept alignment survives kill -9, and one that is damaged or lost is computed again', async (t) => {
  const d = await daemon(t);
  const shapes = await upload(d);
  const make = (tolerance) =>
    d.made('/v1/supermeshes', { shapes, landmarks, align: fast('rotate'), remesh: { tolerance } });
  const restart = async () => {
    await d.stop('SIGKILL');
    await d.start();
  };
  assert.ok((await make(0.02)).timings_ms.align > 0);
  await restart();
  assert.equal((await make(0.021)).timings_ms.align, 0);
  const [file] = await keptFiles(d.data);
  const bytes = await readFile(file);
  for (const damage of [
    () => truncate(file, bytes.length - 1),
    () => writeFile(file, Buffer.concat([bytes.subarray(0, 200), Buffer.from([bytes[200] ^ 1]), bytes.subarray(201)])),
    () => writeFile(file, ''),
  ]) {
    await damage();
    const again = await make(0.022 + Math.random() / 1000);
    assert.ok(again.timings_ms.align > 0);
    assert.ok((await readFile(file)).equals(bytes), 'the same bytes are kept again');
  }
  assert.equal((await make(0.024)).timings_ms.align, 0);
});

test('--check-data verifies kept alignments, and --gc keeps them', async (t) => {
  const d = await daemon(t);
  const shapes = await upload(d);
  await d.made('/v1/supermeshes', { shapes, landmarks, align: fast('rotate'), remesh: { tolerance: 0.02 } });
  const [file] = await keptFiles(d.data);
  await d.stop();
  const run = (flag) => spawnSync(binaries.daemon, [flag, '--data', d.data], { encoding: 'utf8' });
  assert.match((await run('--check-data')).stdout, / 0 wrong, 0 objects without a row/);
  assert.equal((await run('--gc')).status, 0);
  await writeFile(file, 'damage');
  const damaged = await run('--check-data');
  assert.equal(damaged.status, 1);
  assert.match(damaged.stdout, /alignment [0-9a-f]{64}: its object \(6 bytes\) does not match its hash/);
  await d.start();
});
