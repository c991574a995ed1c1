// Compressed answers: which coding a client gets, that the bytes are the same, and how ETags and ranges tell codings apart.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import http from 'node:http';
import path from 'node:path';
import test from 'node:test';
import { gunzipSync } from 'node:zlib';
import { daemon, samples, slow } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const unpack = {
  gzip: (bytes) => gunzipSync(bytes),
  zstd: (bytes) => execFileSync('zstd', ['-d', '-q', '-c'], { input: bytes, maxBuffer: 1 << 28 }),
};

/** The bytes on the wire: fetch() unpacks them. */
const send = (d, target, headers = {}, method = 'GET', body) =>
  new Promise((resolve, reject) => {
    const r = http.request(new URL(target, d.url), { method, headers }, (reply) => {
      const parts = [];
      reply
        .on('data', (part) => parts.push(part))
        .on('end', () => resolve({ status: reply.statusCode, headers: reply.headers, bytes: Buffer.concat(parts) }));
    });
    r.on('error', reject).end(body);
  });
const accept = (coding, more) => ({ 'accept-encoding': coding, ...more });

async function made(d) {
  const ids = [];
  for (const name of ['dog.obj', 'giraffe.off']) ids.push((await d.mesh(path.join(samples, name))).id);
  const supermesh = await d.made('/v1/supermeshes', {
    shapes: ids.map((mesh) => ({ mesh })),
    align: { method: 'rotate' },
    remesh: { tolerance: 0.02 },
  });
  return { ids, supermesh, morph: `/v1/morph.glb?shapes=${ids}&align=rotate&tolerance=0.02` };
}

test('every answer that can be compressed is the same in every coding', async (t) => {
  const d = await daemon(t);
  const { ids, supermesh, morph } = await made(d);
  const [embedding] = (await d.get('/v1/embeddings')).json.embeddings;
  for (const target of [
    supermesh.asset,
    morph,
    `${supermesh.url}/spheres/0.ply`,
    `${supermesh.url}/spheres/1.ply`,
    embedding.sphere,
    supermesh.url,
    '/v1/supermeshes',
    '/v1/embeddings',
    '/openapi.json',
    '/docs.js',
    '/metrics',
  ]) {
    const plain = await send(d, target, accept('identity'));
    assert.equal(plain.status, 200, target);
    assert.equal(plain.headers['content-encoding'], undefined);
    assert.match(plain.headers.vary, /Accept-Encoding/, target);
    for (const coding of ['gzip', 'zstd']) {
      const first = await send(d, target, accept(coding));
      assert.equal(first.headers['content-encoding'], coding, target);
      assert.equal(first.headers['content-type'], plain.headers['content-type']);
      assert.equal(first.headers['content-disposition'], plain.headers['content-disposition']);
      assert.equal(Number(first.headers['content-length']), first.bytes.length);
      assert.match(first.headers.vary, /Accept-Encoding/);
      assert.ok(first.bytes.length < plain.bytes.length, `${target} ${coding}`);
      if (target !== '/metrics') assert.ok(unpack[coding](first.bytes).equals(plain.bytes), `${target} ${coding}`);
      if (!plain.headers.etag) continue;
      assert.equal(first.headers.etag, plain.headers.etag.replace(/"$/, `-${coding}"`), target);
      const again = await send(d, target, accept(coding));
      assert.ok(again.bytes.equals(first.bytes), 'the same bytes for the same tag');
      const head = await send(d, target, accept(coding), 'HEAD');
      assert.deepEqual(
        [head.status, head.headers['content-length'], head.headers.etag],
        [200, String(first.bytes.length), first.headers.etag],
      );
      const same = await send(d, target, accept(coding, { 'if-none-match': first.headers.etag }));
      assert.deepEqual([same.status, same.headers.etag, same.bytes.length], [304, first.headers.etag, 0], target);
      assert.match(same.headers.vary, /Accept-Encoding/);
      const other = await send(d, target, accept(coding, { 'if-none-match': plain.headers.etag }));
      assert.equal(other.status, 200, 'the tag of another coding is not this one');
    }
  }
  // Uploaded files and places are not compressed.
  for (const target of [`/v1/meshes/${ids[0]}/file`, `${supermesh.url}/places`]) {
    const reply = await send(d, target, accept('gzip, zstd'));
    assert.deepEqual([reply.status, reply.headers['content-encoding']], [200, undefined]);
  }
});

test('ranges are of the bytes that are not compressed', async (t) => {
  const d = await daemon(t);
  const { supermesh } = await made(d);
  const plain = await send(d, supermesh.asset, accept('identity'));
  const packed = await send(d, supermesh.asset, accept('gzip'));
  const part = await send(d, supermesh.asset, accept('gzip', { range: 'bytes=0-3' }));
  assert.deepEqual(
    [part.status, part.bytes.toString(), part.headers['content-encoding'], part.headers.etag],
    [206, 'glTF', undefined, plain.headers.etag],
  );
  for (const [tag, status] of [
    [plain.headers.etag, 206],
    [packed.headers.etag, 200],
  ]) {
    const reply = await send(d, supermesh.asset, accept('gzip', { range: 'bytes=4-7', 'if-range': tag }));
    assert.equal(reply.status, status, `${tag}: bytes of two codings are never put together`);
    if (status === 200) assert.ok(reply.bytes.equals(plain.bytes));
  }
});

test('a client gets what it prefers', async (t) => {
  const d = await daemon(t);
  const { supermesh } = await made(d);
  for (const [header, coding] of [
    ['gzip', 'gzip'],
    ['x-gzip', 'gzip'],
    ['GZIP', 'gzip'],
    ['gzip, deflate, br, zstd', 'zstd'],
    ['gzip;q=1.0, zstd;q=0.9', 'gzip'],
    ['gzip ; q=0.5 , zstd ; q=0.501', 'zstd'],
    ['*', 'zstd'],
    ['zstd;q=0, *;q=0.5', 'gzip'],
    ['gzip;q=0', undefined],
    ['gzip;q=0.4, identity;q=0.5', undefined],
    ['identity;q=0, gzip;q=0.1', 'gzip'],
    ['br, deflate', undefined],
    ['', undefined],
    ['gzipped, zstandard', undefined],
    ['gzip;q=x', undefined],
    [',, ;;, gzip', 'gzip'],
  ])
    for (const target of [supermesh.asset, supermesh.url, '/openapi.json', '/v1/supermeshes'])
      assert.equal((await send(d, target, accept(header))).headers['content-encoding'], coding, `${target} ${header}`);
  assert.equal((await send(d, supermesh.asset)).headers['content-encoding'], undefined);
});

test('conditions that change something take the tag of any coding', async (t) => {
  const d = await daemon(t);
  const { url } = (await d.upload(shapes.obj(shapes.egg(2)))).json;
  const e = await d.made('/v1/embeddings', { mesh: url.split('/').pop() });
  const packed = await send(d, e.url, accept('gzip'));
  assert.equal(packed.headers['content-encoding'], 'gzip');
  const stranger = packed.headers.etag.replace('-gzip', 'x-gzip');
  assert.equal((await send(d, e.url, { 'if-match': stranger }, 'DELETE')).status, 412);
  assert.equal((await send(d, e.url, { 'if-none-match': packed.headers.etag }, 'DELETE')).status, 412);
  assert.equal((await send(d, e.url, { 'if-match': packed.headers.etag }, 'DELETE')).status, 204);
});

test('small answers, and a daemon without room for them, are not compressed', async (t) => {
  const d = await daemon(t);
  const small = await send(d, '/v1/meshes', accept('gzip'));
  assert.deepEqual([small.headers['content-encoding'], small.headers.vary], [undefined, undefined]);
  const off = await daemon(t, { args: ['--encoded-bytes', '0'] });
  assert.equal((await send(off, '/openapi.json', accept('gzip'))).headers['content-encoding'], undefined);
  // If the cache has little room, answers are dropped and compressed again.
  const tight = await daemon(t, { args: ['--encoded-bytes', '1K'] });
  for (let i = 0; i < 3; i++)
    for (const target of ['/openapi.json', '/docs.js']) {
      const reply = await send(tight, target, accept('gzip'));
      assert.equal(reply.headers['content-encoding'], 'gzip');
      gunzipSync(reply.bytes);
    }
});

test('an asset from memory is the same answer as from its file', async (t) => {
  const daemons = [await daemon(t), await daemon(t, { args: ['--encoded-bytes', '0'] })];
  const answers = [];
  for (const d of daemons) {
    const { supermesh, morph } = await made(d);
    const seen = [];
    for (const target of [morph, supermesh.asset])
      for (let turn = 0; turn < 2; turn++)
        for (const [headers, method] of [
          [{}, 'GET'],
          [{}, 'HEAD'],
          [{ range: 'bytes=4-99' }, 'GET'],
          [{ 'if-none-match': '*' }, 'GET'],
        ]) {
          const reply = await send(d, target, headers, method);
          for (const name of ['date', 'x-request-id']) delete reply.headers[name];
          seen.push(reply);
        }
    answers.push(seen);
    // Headers appear once: a repeated one would be joined here.
    assert.equal(seen[0].headers['content-type'], 'model/gltf-binary');
    assert.equal(seen[0].headers.vary, 'Accept-Encoding');
    assert.equal(seen[0].bytes.length, supermesh.asset_bytes);
  }
  for (const [i, reply] of answers[0].entries()) {
    assert.deepEqual(reply.headers, answers[1][i].headers);
    assert.equal(reply.status, answers[1][i].status);
    assert.ok(reply.bytes.equals(answers[1][i].bytes));
  }
});

test('an asset is compressed once, for many clients at a time', async (t) => {
  const d = await daemon(t);
  const { supermesh } = await made(d);
  const replies = await Promise.all(
    Array.from({ length: 40 }, (_, i) => send(d, supermesh.asset, accept(i % 2 ? 'gzip' : 'zstd'))),
  );
  for (const [i, reply] of replies.entries()) assert.ok(reply.bytes.equals(replies[i % 2].bytes));
  const before = d.cpuMs();
  for (let i = 0; i < 100; i++) await send(d, supermesh.asset, accept('gzip'));
  assert.ok(
    d.cpuMs() - before < (slow ? 10_000 : 500),
    `${d.cpuMs() - before} ms of processor time for a hundred answers`,
  );
});
