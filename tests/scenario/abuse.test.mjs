// Hostile clients: each gets the right status, learns nothing, and does not harm the service.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import net from 'node:net';
import { tmpdir } from 'node:os';
import path from 'node:path';
import test from 'node:test';
import { gzipSync, createGzip } from 'node:zlib';
import { Daemon, assertProblem, binaries, daemon, patience, slow, until } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

/** Sends bytes unchanged; resolves to everything received until the other side closes or some seconds have passed. */
function raw(d, bytes, seconds = 60) {
  return new Promise((resolve) => {
    const { hostname, port } = new URL(d.url);
    const socket = net.connect(Number(port), hostname, () => socket.write(bytes));
    let text = '';
    socket.on('data', (chunk) => (text += chunk.toString('latin1')));
    socket.on('error', () => {});
    socket.on('close', () => resolve(text));
    setTimeout(() => socket.destroy(), seconds * 1000 * patience).unref();
  });
}
const statusOf = (text) => Number(/^HTTP\/1\.1 (\d+)/.exec(text)?.[1] ?? 0);

async function well(d) {
  assert.equal((await d.get('/livez')).status, 200);
  assert.equal((await d.get('/readyz')).status, 200);
  const mesh = await d.upload(shapes.obj(shapes.egg(1)), { name: 'well' });
  assert.ok([200, 201].includes(mesh.status), mesh.bytes.toString());
}
const descriptors = (d) =>
  Number(execFileSync('sh', ['-c', `ls /proc/${d.child.pid}/fd | wc -l`], { encoding: 'utf8' }));
const memory = (d) =>
  Number(/VmHWM:\s+(\d+)/.exec(execFileSync('cat', [`/proc/${d.child.pid}/status`], { encoding: 'utf8' }))[1]) / 1024;

test('floods of headers', async (t) => {
  const d = await daemon(t);
  const many = Array.from({ length: 20_000 }, (_, i) => `X-${i}: y\r\n`).join('');
  for (const bytes of [
    `GET /livez HTTP/1.1\r\nHost: localhost\r\n${many}\r\n`,
    `GET /livez HTTP/1.1\r\nHost: localhost\r\nX-Long: ${'a'.repeat(1 << 20)}\r\n\r\n`,
    `GET /${'a'.repeat(1 << 20)} HTTP/1.1\r\nHost: localhost\r\n\r\n`,
    `GET /livez?${'a=b&'.repeat(1 << 18)} HTTP/1.1\r\nHost: localhost\r\n\r\n`,
    `${'A'.repeat(1 << 20)} /livez HTTP/1.1\r\nHost: localhost\r\n\r\n`,
  ]) {
    const text = await raw(d, bytes);
    assert.ok(text === '' || (statusOf(text) >= 400 && statusOf(text) < 500), text.slice(0, 200));
  }
  const before = descriptors(d);
  await Promise.all(Array.from({ length: 200 }, () => raw(d, `GET /livez HTTP/1.1\r\nHost: localhost\r\n${many}`)));
  await well(d);
  await until(() => descriptors(d) < before + 20, 'connections are given back');
});

test('hostile paths and ids', async (t) => {
  const d = await daemon(t);
  const hex = 'a'.repeat(64);
  for (const target of [
    '/v1/meshes/../../etc/passwd',
    '/v1/meshes/..%2f..%2f..%2fetc%2fpasswd',
    '/../lock',
    '/%2e%2e/%2e%2e/etc/passwd',
    `/v1/meshes/${hex.slice(2)}..`,
    `/v1/meshes/${hex}%00`,
    `/v1/meshes/${hex}/`,
    `/v1/meshes/${hex}/file/..`,
    `/v1/meshes/${hex.toUpperCase()}`,
    `/v1/meshes/${'%61'.repeat(63)}`,
    `/v1//meshes/${hex}`,
    `/v1/meshes/%`,
    `/v1/meshes/${hex}%0d%0aX-Evil:1`,
    '/v1/jobs/../../../lock',
    '/catalogue.sqlite',
    '//etc/passwd',
    '/v1/meshes/‮x',
    `/v1/supermeshes/${hex}/../../../catalogue.sqlite`,
    `/problems/../../lock`,
  ]) {
    const text = await raw(d, Buffer.from(`GET ${target} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n`));
    assert.ok([400, 404].includes(statusOf(text)) || text === '', `${target}: ${text.slice(0, 100)}`);
    assert.ok(!/root:|SQLite format|X-Evil: ?1\r\n/.test(text), `${target}: ${text.slice(0, 500)}`);
  }
  await well(d);
});

test('JSON that is deep, wide or strange', async (t) => {
  const d = await daemon(t);
  for (const body of [
    '['.repeat(100_000),
    '{"a":'.repeat(100_000),
    `${'['.repeat(33)}${']'.repeat(33)}`,
    `[${'0,'.repeat(400_000)}0]`,
    `{"mesh":"${'a'.repeat(64)}","options":{"preset":"${'x'.repeat(100_000)}"}}`,
    `{${Array.from({ length: 50_000 }, (_, i) => `"k${i}":0`)}}`,
    '{"mesh":1e999}',
    '{"mesh":"\\ud800"}',
    '\u0000',
    '{"mesh":"a","mesh":"b"}',
    '{"__proto__":{}}',
  ]) {
    const before = d.cpuMs();
    const reply = await d.request('POST', '/v1/embeddings', { body, headers: { 'content-type': 'application/json' } });
    assert.ok([400, 404, 413, 422].includes(reply.status), `${body.slice(0, 40)}: ${reply.status} ${reply.bytes}`);
    assert.equal(reply.type, 'application/problem+json');
    assert.ok(reply.bytes.length < 4000, 'the refusal does not send it all back');
    assert.ok(
      d.cpuMs() - before < (slow ? 15_000 : 3000),
      `${d.cpuMs() - before} ms of processor time for ${body.slice(0, 40)}`,
    );
  }
  await well(d);
});

test('a gigabyte of zeros, compressed', async (t) => {
  const d = await daemon(t, { args: ['--max-body', '64M'] });
  const zeros = await new Promise((resolve) => {
    const chunks = [];
    const gzip = createGzip({ level: 9 });
    const part = Buffer.alloc(1 << 20);
    gzip.on('data', (chunk) => chunks.push(chunk)).on('end', () => resolve(Buffer.concat(chunks)));
    let left = 1024;
    const more = () => {
      while (left > 0)
        if (!gzip.write(part, () => {}) && left-- > 0) return gzip.once('drain', more);
        else left--;
      gzip.end();
    };
    more();
  });
  assert.ok(zeros.length < 2 << 20);
  const before = memory(d);
  for (const target of ['/v1/meshes', '/v1/embeddings']) {
    const reply = await d.request('POST', target, {
      body: zeros,
      headers: { 'content-encoding': 'gzip', 'content-type': 'application/json' },
    });
    assert.ok([400, 413].includes(reply.status), `${reply.status} ${reply.bytes}`);
    assert.equal(reply.type, 'application/problem+json');
  }
  // A bomb inside a bomb has one layer too many.
  const twice = await d.request('POST', '/v1/meshes', {
    body: gzipSync(zeros),
    headers: { 'content-encoding': 'gzip, gzip' },
  });
  assert.ok([400, 413, 415].includes(twice.status), `${twice.status}`);
  assert.ok(memory(d) - before < (slow ? 600 : 100), `${before} MB before, ${memory(d)} MB at most`);
  await well(d);
});

test('wrong tokens, and what a token sees', async (t) => {
  const data = mkdtempSync(path.join(tmpdir(), 'orbmorph-abuse-'));
  t.after(() => rmSync(data, { recursive: true, force: true }));
  const add = (name, scope) => {
    const text = execFileSync(binaries.daemon, ['token', 'add', name, '--scope', scope, '--data', data], {
      encoding: 'utf8',
    });
    return /[0-9a-f]{64}/.exec(text)[0];
  };
  const reader = add('reader', 'read');
  const writer = add('writer', 'read,write');
  const d = await new Daemon(data, ['--auth', 'on'], {}).start();
  t.after(() => d.stop());
  const as = (token) => ({ authorization: `Bearer ${token}` });
  const flipped = (reader[0] === '0' ? '1' : '0') + reader.slice(1);
  const answers = new Set();
  for (const authorization of [
    undefined,
    '',
    'Bearer',
    'Bearer ',
    `Bearer ${flipped}`,
    `Bearer ${reader.slice(1)}`,
    `Bearer ${reader}0`,
    `Basic ${reader}`,
    reader,
    `Bearer ${'a'.repeat(5000)}`,
    `Bearer ' OR 1=1 --`,
  ]) {
    const reply = await d.get('/v1/meshes', { headers: authorization === undefined ? {} : { authorization } });
    assertProblem(reply, 401, 'unauthorized', String(authorization));
    assert.match(reply.headers.get('www-authenticate') ?? '', /^Bearer/);
    answers.add(reply.bytes.toString());
  }
  assert.equal(answers.size, 1, 'all wrong tokens get the same response');
  const upload = (token) =>
    d.post('/v1/meshes', Buffer.from(shapes.cube), { headers: as(token), query: { name: 'secret' } });
  assertProblem(await upload(reader), 403, 'forbidden');
  assert.equal((await upload(writer)).status, 201);
  for (const token of [reader, flipped]) {
    const reply = await d.delete(`/v1/meshes/${'a'.repeat(64)}`, { headers: as(token) });
    assertProblem(reply, token === reader ? 403 : 401, token === reader ? 'forbidden' : 'unauthorized');
  }
  // Without a token, no answer shows whether a thing exists.
  const there = (await (await upload(writer)).json).id;
  const [known, unknown] = [await d.get(`/v1/meshes/${there}`), await d.get(`/v1/meshes/${'b'.repeat(64)}`)];
  assert.equal(known.status, 401);
  assert.deepEqual(known.bytes, unknown.bytes);
  assert.ok(!d.log.includes(reader) && !d.log.includes(writer), 'tokens are not in the log');
  assert.equal((await d.get('/livez')).status, 200);
});
