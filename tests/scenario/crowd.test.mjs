// 64 clients at once while jobs run: all responses are right, and none waits for a computation.
import assert from 'node:assert/strict';
import test from 'node:test';
import { daemon, endless } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const shape = (seed, levels) =>
  shapes.ball(levels, ([x, y, z]) => [
    x * (1 + 0.3 * Math.sin(3 * y + seed)),
    (1 + (seed % 5) / 10) * y,
    z + 0.1 * Math.sin(6 * x + seed),
  ]);

test('64 clients submit and poll while jobs run', async (t) => {
  const d = await daemon(t, { args: ['--workers', '2'] });
  // One job keeps a worker to the end, the jobs of the clients the other.
  const { json: large } = await d.upload(shapes.binaryPly(shape(1000, 6)), { name: 'large' });
  const long = await d.post('/v1/embeddings', { mesh: large.id, ...endless });
  assert.equal(long.status, 202);
  const waits = [];
  const timed = async (promise) => {
    const began = performance.now();
    const reply = await promise;
    waits.push(performance.now() - began);
    return reply;
  };

  const clients = await Promise.all(
    Array.from({ length: 64 }, async (_, i) => {
      const seed = i % 16; // four clients ask for each thing
      const upload = await timed(d.upload(shapes.obj(shape(seed, 2)), { name: `c${seed}` }));
      assert.ok([200, 201].includes(upload.status), upload.bytes.toString());
      const reply = await timed(d.post('/v1/embeddings', { mesh: upload.json.id }));
      assert.ok([200, 202].includes(reply.status), reply.bytes.toString());
      for (let k = 0; k < 5; k++) {
        const poll = await timed(d.get(reply.json.url));
        assert.equal(poll.status, 200);
        assert.equal((await timed(d.get(upload.json.url))).json.id, upload.json.id);
      }
      return { seed, mesh: upload.json, reply };
    }),
  );
  waits.sort((a, b) => a - b);
  const p99 = waits[Math.floor(0.99 * waits.length)];
  t.diagnostic(`${waits.length} requests, median ${waits[waits.length >> 1].toFixed(1)} ms, p99 ${p99.toFixed(1)} ms`);
  assert.equal((await d.get(long.json.url)).json.state, 'running');

  const embeddings = new Map();
  for (const { seed, mesh, reply } of clients) {
    const result = reply.status === 200 ? reply.json : (await d.get((await d.ended(reply.json)).result)).json;
    assert.equal(result.mesh, mesh.id);
    assert.equal(result.certificate.valid, true);
    if (embeddings.has(seed)) assert.equal(result.id, embeddings.get(seed), 'equal requests name equal results');
    embeddings.set(seed, result.id);
  }
  assert.equal(new Set(embeddings.values()).size, 16);
  assert.equal((await d.delete(long.json.url)).status, 200);
});
