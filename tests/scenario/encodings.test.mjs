// Compressed bodies: gzip and zstd, complete, broken, and decompression bombs.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFile, readdir } from 'node:fs/promises';
import net from 'node:net';
import path from 'node:path';
import test from 'node:test';
import { promisify } from 'node:util';
import zlib from 'node:zlib';
import { assertProblem, daemon, patience, samples } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const gzip = promisify(zlib.gzip);
const zstd = (bytes, ...options) =>
  execFileSync('zstd', ['-q', '-c', ...options], { input: bytes, maxBuffer: 1 << 28 });
const send = (d, coding, body, query, target = '/v1/meshes') =>
  d.post(target, body, {
    query,
    headers: { 'content-encoding': coding, 'content-type': target === '/v1/meshes' ? 'model/obj' : 'application/json' },
  });
const memory = async (d) =>
  Number(/VmHWM:\s+(\d+) kB/.exec(await readFile(`/proc/${d.child.pid}/status`, 'utf8'))[1]) * 1024;

/** A zstd frame of RLE blocks: n·128 KB of zeros in 4 n bytes (RFC 8878, 3.1.1). */
function zstdZeros(blocks) {
  const head = Buffer.from([0x28, 0xb5, 0x2f, 0xfd, 0x00, 0x38]); // a window of 128 KB, no checksum
  const body = Buffer.alloc(4 * blocks);
  for (let i = 0; i < blocks; i++)
    body.writeUInt32LE(((0x20000 << 3) | (1 << 1) | (i === blocks - 1 ? 1 : 0)) >>> 0, 4 * i);
  return Buffer.concat([head, body]);
}

/** A frame of zstd 0.7, older than the RFC: libzstd still reads it. */
function frameOf07(bytes) {
  return Buffer.concat([
    Buffer.from([0x27, 0xb5, 0x2f, 0xfd, 0x20, bytes.length, 0x40, 0, bytes.length]),
    bytes,
    Buffer.from([0xc0, 0, 0]),
  ]);
}

/** A frame to skip (RFC 8878, 3.1.2). */
const skipped = Buffer.from([0x5a, 0x2a, 0x4d, 0x18, 3, 0, 0, 0, 1, 2, 3]);

test('compressed uploads and requests equal plain ones', async (t) => {
  const d = await daemon(t);
  const bytes = await readFile(path.join(samples, 'dog.obj'));
  const plain = await d.upload(bytes, { name: 'dog' });
  assert.equal(plain.status, 201);
  const half = bytes.length >> 1;
  const members = await Promise.all([gzip(bytes.subarray(0, half)), gzip(bytes.subarray(half))]);
  const forms = {
    gzip: [await gzip(bytes), Buffer.concat(members)],
    'x-gzip': [await gzip(bytes, { level: 1 })],
    identity: [bytes],
    zstd: [
      zstd(bytes),
      zstd(bytes, '-19'),
      Buffer.concat([zstd(bytes.subarray(0, half)), skipped, zstd(bytes.subarray(half))]),
    ],
  };
  for (const [coding, bodies] of Object.entries(forms))
    for (const body of bodies) {
      const reply = await send(d, coding, body, { name: 'dog' });
      assert.equal(reply.status, 200, `${coding}: ${reply.bytes}`);
      assert.deepEqual(reply.json, plain.json);
    }
  const other = await gzip(await readFile(path.join(samples, 'giraffe.off')));
  const fresh = await send(d, 'GZIP', other, { name: 'giraffe' });
  assert.equal(fresh.status, 201);
  assert.equal(
    fresh.json.bytes,
    (await readFile(path.join(samples, 'giraffe.off'))).length,
    'the size is that of the file',
  );
  const request = JSON.stringify({ mesh: plain.json.id });
  const { json: job } = await send(d, 'zstd', zstd(Buffer.from(request)), {}, '/v1/embeddings');
  assert.equal((await d.ended(job)).state, 'succeeded');
  assert.equal((await send(d, 'gzip', await gzip(request), {}, '/v1/embeddings')).status, 200);
});

test('broken and unknown codings are refused', async (t) => {
  const d = await daemon(t);
  const text = shapes.obj(shapes.egg(3));
  const packed = await gzip(text);
  const frames = zstd(Buffer.from(text));
  const old = frameOf07(Buffer.from('OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n'));
  const flipped = (bytes, at) => Buffer.from(bytes.map((b, i) => (i === at ? b ^ 0x55 : b)));
  for (const [coding, body] of [
    ['gzip', Buffer.from(text)],
    ['gzip', packed.subarray(0, -1)],
    ['gzip', packed.subarray(0, 5)],
    ['gzip', flipped(packed, packed.length - 6)],
    ['gzip', Buffer.concat([packed, Buffer.from('more')])],
    ['gzip', frames],
    ['gzip', zlib.deflateSync(text)],
    ['zstd', Buffer.from(text)],
    ['zstd', frames.subarray(0, -1)],
    ['zstd', flipped(frames, frames.length - 2)],
    ['zstd', Buffer.concat([frames, Buffer.from('rest')])],
    ['zstd', packed],
    ['zstd', old],
    ['zstd', Buffer.concat([frames, old])],
  ])
    for (const target of ['/v1/meshes', '/v1/embeddings']) {
      const reply = await send(d, coding, body, {}, target);
      assertProblem(reply, 400, 'malformed-encoding', `${coding} ${body.subarray(0, 8).toString('hex')}`);
      assert.ok(reply.json.offset >= 0 && reply.json.offset <= body.length);
    }
  const wide = await send(d, 'zstd', zstd(Buffer.from(text.repeat(2000)), '--long=27', '--no-content-size'), {});
  assertProblem(wide, 400, 'malformed-encoding');
  assert.match(wide.json.detail, /8 MB/);
  for (const coding of ['br', 'deflate', 'gzip, gzip', 'zstd, gzip', 'compress', '*']) {
    const reply = await send(d, coding, packed, {});
    assertProblem(reply, 415, 'unsupported-encoding', coding);
    assert.equal(reply.headers.get('accept-encoding'), 'gzip, zstd');
  }
  assert.equal((await send(d, 'gzip', packed, {})).status, 201, 'and goes on');
});

test('limits apply to the decompressed size', async (t) => {
  const d = await daemon(t, { args: ['--max-body', '100K', '--max-json', '2K'] });
  const text = `${shapes.tetrahedron}${'# padding 0123456789\n'.repeat(6000)}`;
  for (const body of [await gzip(text), zstd(Buffer.from(text))]) {
    const reply = await send(d, body[0] === 0x1f ? 'gzip' : 'zstd', body, {});
    assertProblem(reply, 413, 'too-large');
    assert.match(reply.json.detail, /decompressed body has more than 102400 bytes/);
    assert.equal(reply.json.limit, 102400);
  }
  assertProblem(await send(d, 'gzip', await gzip(' '.repeat(3000)), {}, '/v1/embeddings'), 413, 'too-large');
  assert.deepEqual(await readdir(path.join(d.data, 'tmp')), [], 'nothing is left');
});

test('decompression bombs are refused early', async (t) => {
  const d = await daemon(t);
  assert.equal((await d.get('/livez')).status, 200);
  const gigabyte = [];
  const packer = zlib.createGzip({ level: 9 });
  packer.on('data', (part) => gigabyte.push(part));
  const zeros = Buffer.alloc(1 << 24);
  for (let i = 0; i < 64; i++) await new Promise((done) => packer.write(zeros, done));
  await new Promise((done) => packer.end(done));
  const before = await memory(d);
  for (const [coding, body] of [
    ['gzip', Buffer.concat(gigabyte)],
    ['zstd', zstdZeros(8192)],
  ])
    for (const target of ['/v1/meshes', '/v1/embeddings']) {
      const reply = await send(d, coding, body, {}, target);
      assertProblem(reply, 413, 'too-large', `${coding} ${target}`);
      if (target === '/v1/meshes') {
        assert.equal(reply.json.ratio_limit, 200);
        assert.match(reply.json.detail, /decompresses to more than 200 times its size/);
      }
    }
  assert.ok((await memory(d)) - before < 16 << 20, `${(await memory(d)) - before} bytes more`);
  assert.deepEqual(await readdir(path.join(d.data, 'tmp')), []);
  // Honest repetition within the first megabyte is not a bomb.
  assert.equal((await send(d, 'gzip', await gzip(`${shapes.tetrahedron}${'#\n'.repeat(400_000)}`), {})).status, 201);
});

test('decoders share a budget of memory', async (t) => {
  const d = await daemon(t, { args: ['--decode-memory', '1M'] });
  const { hostname, port } = new URL(d.url);
  const large = zstd(Buffer.from(shapes.obj(shapes.egg(6)).repeat(4)), '-19', '--no-content-size'); // a window of 8 MB
  assertProblem(await send(d, 'zstd', large, {}), 503, 'unavailable');
  // Uploads that have begun hold their memory until they end.
  const open = [];
  t.after(() => open.forEach((socket) => socket.destroy()));
  const begin = await gzip(shapes.obj(shapes.egg(4)));
  for (let i = 0; i < 40; i++) {
    const socket = net.connect(Number(port), hostname);
    open.push(socket);
    await new Promise((done) =>
      socket
        .on('error', () => {})
        .write(
          `POST /v1/meshes HTTP/1.1\r\nHost: localhost\r\nContent-Encoding: gzip\r\nContent-Length: ${begin.length}\r\n\r\n`,
          done,
        ),
    );
    socket.write(begin.subarray(0, 100));
  }
  const end = Date.now() + 120_000 * patience;
  let reply;
  do reply = await send(d, 'gzip', begin, {});
  while (reply.status !== 503 && Date.now() < end);
  assertProblem(reply, 503, 'unavailable');
  assert.ok(reply.headers.get('retry-after'));
  open.splice(0).forEach((socket) => socket.destroy());
  do reply = await send(d, 'gzip', begin, {});
  while (reply.status === 503 && Date.now() < end + 120_000 * patience);
  assert.ok([200, 201].includes(reply.status));
});
