// Requests that are invalid in every way that HTTP and JSON allow.
import assert from 'node:assert/strict';
import net from 'node:net';
import path from 'node:path';
import test from 'node:test';
import { daemon, samples, assertProblem, patience } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

/** Sends bytes unchanged; resolves to everything received until the connection closes. */
function raw(d, text, { wait = 60_000 } = {}) {
  const { hostname, port } = new URL(d.url);
  return new Promise((resolve, reject) => {
    let out = '';
    const socket = net.connect(Number(port), hostname, () => socket.write(text));
    socket.setTimeout(wait * patience, () => socket.destroy());
    socket.on('data', (chunk) => (out += chunk.toString('latin1')));
    socket.on('close', () => resolve(out));
    socket.on('error', (error) => (out ? resolve(out) : reject(error)));
  });
}
const statusOf = (text) => Number(/^HTTP\/1\.[01] (\d+)/.exec(text)?.[1]);

test('a query of very many parameters gets one clear answer', async (t) => {
  const d = await daemon(t);
  for (const count of [129, 250, 1000]) {
    const query = Array.from({ length: count }, (_, i) => `a${i}=1`).join('&');
    const reply = await raw(d, `GET /v1/meshes?${query} HTTP/1.1\r\nHost: localhost\r\n\r\n`);
    assert.equal(statusOf(reply), 414, `${count}: ${reply}`);
    assert.equal(reply.split('HTTP/1.1 ').length, 2, reply);
    assert.match(reply, /"type":"\/problems\/uri-too-long"/);
  }
  assert.equal((await d.get('/livez')).status, 200);
});

test('a query or headers of any length get one answer at once', async (t) => {
  const d = await daemon(t);
  const ask = (query, headers = '') =>
    raw(d, `GET /v1/meshes?${query} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n${headers}\r\n`, {
      wait: 5000,
    });
  const answers = async (reply, status, type, what) => {
    assert.equal(reply.split('HTTP/1.1 ').length, 2, `${what}: ${reply}`);
    assert.equal(statusOf(reply), status, `${what}: ${reply}`);
    if (type) assert.match(reply, new RegExp(`"type":"/problems/${type}"`), what);
  };
  // Sizes around the 16 KB of a connection's memory, and far beyond.
  for (const size of [1000, 10_000]) await answers(await ask(`a=${'x'.repeat(size)}`), 400, 'bad-query', size);
  for (const size of [10_400, 12_000, 15_000, 16_000, 16_250])
    await answers(await ask(`a=${'x'.repeat(size)}`), 414, 'uri-too-long', size);
  for (const size of [16_400, 17_000, 70_000]) await answers(await ask(`a=${'x'.repeat(size)}`), 414, null, size);
  for (const count of [60, 100, 127]) {
    const query = Array.from({ length: count }, (_, i) => `a${i}=${'y'.repeat(100)}`).join('&');
    await answers(await ask(query), ...(count < 100 ? [400, 'bad-query'] : [414, 'uri-too-long']), `${count} of 100`);
  }
  for (const size of [8000, 13_000])
    await answers(await ask('limit=1', `X-Long: ${'z'.repeat(size)}\r\n`), 200, null, `header of ${size}`);
  for (const size of [14_500, 15_500, 16_000])
    await answers(
      await ask('limit=1', `X-Long: ${'z'.repeat(size)}\r\n`),
      431,
      'headers-too-large',
      `header of ${size}`,
    );
  for (const size of [16_200, 17_000, 40_000])
    await answers(await ask('limit=1', `X-Long: ${'z'.repeat(size)}\r\n`), 431, null, `header of ${size}`);
  await answers(
    await ask(`a=${'x'.repeat(9000)}`, `X-Long: ${'z'.repeat(6000)}\r\n`),
    431,
    'headers-too-large',
    'both',
  );
  assert.equal((await d.get('/livez')).status, 200);
});

test('headers of very many short lines or cookies get one answer, however many there are', async (t) => {
  const d = await daemon(t);
  const ask = (lines) =>
    raw(d, `GET /v1/meshes HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n${lines}\r\n`, { wait: 5000 });
  const kinds = {
    'empty lines': (n) => 'X:\r\n'.repeat(n),
    'lines of 26 bytes': (n) => `X-Short: ${'y'.repeat(15)}\r\n`.repeat(n),
    'lines of 50 bytes': (n) => `X-Short: ${'y'.repeat(39)}\r\n`.repeat(n),
    'cookies of 6 bytes': (n) => `Cookie: ${'ab=cd;'.repeat(n)}\r\n`,
    'cookies of 40 bytes': (n) => `Cookie: ${`ab=${'c'.repeat(36)};`.repeat(n)}\r\n`,
  };
  for (const [what, make] of Object.entries(kinds)) {
    const seen = new Set();
    // Each number near the one that fills the 16 KB of a connection.
    for (let n = 60; n <= 260; n++) {
      const reply = await ask(make(n));
      assert.equal(reply.split('HTTP/1.1 ').length, 2, `${n} ${what}: ${reply}`);
      seen.add(statusOf(reply));
    }
    assert.deepEqual([...seen], [200, 431], what);
  }
});

test('unknown paths, unknown ids, wrong methods', async (t) => {
  const d = await daemon(t);
  for (const target of [
    '/nothing',
    '/v1',
    '/v1/',
    '/v1/meshes/',
    '/v1/mesh',
    '/v2/meshes',
    `/v1/meshes/${'0'.repeat(64)}`,
    '/v1/meshes/abc',
    `/v1/embeddings/${'0'.repeat(64)}/sphere.ply`,
    '/v1/jobs/1',
    '/v1/jobs/1/events',
    '/%00',
    '/..%2f..%2fetc/passwd',
  ])
    assertProblem(await d.get(target), 404, 'not-found', target);
  for (const [method, target, allowed] of [
    ['PUT', '/v1/meshes', ['GET', 'POST']],
    ['PATCH', `/v1/meshes/${'0'.repeat(64)}`, ['GET', 'DELETE']],
    ['DELETE', '/v1/embeddings', ['GET', 'POST']],
    ['POST', '/livez', ['GET']],
    ['DELETE', '/readyz', ['GET']],
  ]) {
    const reply = await d.request(method, target);
    assertProblem(reply, 405, 'method-not-allowed', `${method} ${target}`);
    const allow = (reply.headers.get('allow') ?? '').split(/, */);
    for (const name of allowed) assert.ok(allow.includes(name), `${method} ${target}: Allow: ${allow}`);
    assert.ok(!allow.includes(method));
  }
});

test('health, metrics and the description', async (t) => {
  const d = await daemon(t);
  assert.equal((await d.get('/livez')).status, 200);
  assert.equal((await d.get('/readyz')).status, 200);
  const metrics = await d.get('/metrics');
  assert.equal(metrics.status, 200);
  assert.match(metrics.bytes.toString(), /^# TYPE \w+ (counter|gauge|histogram)$/m);
  const openapi = await d.get('/openapi.json');
  assert.equal(openapi.status, 200);
  assert.match(openapi.json.openapi, /^3\.1/);
});

test('invalid JSON', async (t) => {
  const d = await daemon(t);
  const mesh = await d.mesh(path.join(samples, 'dog.obj'));
  const body = JSON.stringify({ mesh: mesh.id });
  const deep = '['.repeat(5000) + ']'.repeat(5000);
  for (const text of [
    '',
    '{',
    '{"mesh":',
    `${body} x`,
    `${body}${body}`,
    '{"mesh":1e999}',
    '{"mesh":NaN}',
    "{'mesh':1}",
    '{"a":1,}',
    deep,
    '\ufeff' + '{',
  ]) {
    const reply = await d.post('/v1/embeddings', text, { headers: { 'content-type': 'application/json' } });
    assertProblem(reply, 400, 'malformed-json', text.slice(0, 40));
  }
  const invalid = Buffer.concat([Buffer.from('{"mesh":"'), Buffer.from([0xff, 0xfe]), Buffer.from('"}')]);
  assertProblem(
    await d.post('/v1/embeddings', invalid, { headers: { 'content-type': 'application/json' } }),
    400,
    'malformed-json',
  );
  for (const text of ['[]', '3', 'null', '"x"', 'true']) {
    const reply = await d.post('/v1/embeddings', text, { headers: { 'content-type': 'application/json' } });
    assert.ok([400, 422].includes(reply.status), `${text}: ${reply.status}`);
  }
  const twice = await d.post('/v1/embeddings', `{"mesh":"${'0'.repeat(64)}","mesh":"${mesh.id}"}`);
  assert.ok(twice.status >= 200 && twice.status < 500);
  const large = await d.post('/v1/embeddings', `{"mesh":"${'x'.repeat(1_100_000)}"}`);
  assert.equal(large.status, 413);
});

test('a body that is too large is refused before it is read', async (t) => {
  const d = await daemon(t);
  const { hostname, port } = new URL(d.url);
  const reply = await raw(
    d,
    `POST /v1/meshes?name=big HTTP/1.1\r\nHost: ${hostname}:${port}\r\nContent-Length: ${600 * 1024 * 1024}\r\nExpect: 100-continue\r\n\r\n`,
  );
  assert.equal(statusOf(reply), 413, reply.slice(0, 300));
  assert.match(reply, /too-large/);
  const sent = await raw(
    d,
    `POST /v1/meshes?name=big HTTP/1.1\r\nHost: ${hostname}:${port}\r\nContent-Length: ${600 * 1024 * 1024}\r\n\r\nv 0 0 0\n`,
  );
  assert.equal(statusOf(sent), 413, sent.slice(0, 300));
});

test('a body needs a length, or chunks', async (t) => {
  const d = await daemon(t);
  const { host } = new URL(d.url);
  const none = await raw(d, `POST /v1/meshes HTTP/1.1\r\nHost: ${host}\r\nConnection: close\r\n\r\n`);
  assert.equal(statusOf(none), 411, none.slice(0, 300));
  const text = shapes.tetrahedron;
  const chunks = text
    .match(/[\s\S]{1,17}/g)
    .map((c) => `${c.length.toString(16)}\r\n${c}\r\n`)
    .join('');
  const chunked = await raw(
    d,
    `POST /v1/meshes?name=t HTTP/1.1\r\nHost: ${host}\r\nTransfer-Encoding: chunked\r\nConnection: close\r\n\r\n${chunks}0\r\n\r\n`,
  );
  assert.equal(statusOf(chunked), 201, chunked.slice(0, 300));
});

test('ambiguous requests are refused', async (t) => {
  const d = await daemon(t);
  const { host } = new URL(d.url);
  const bad = {
    'two lengths': `POST /v1/embeddings HTTP/1.1\r\nHost: ${host}\r\nContent-Length: 2\r\nContent-Length: 3\r\n\r\n{}`,
    'length and chunks': `POST /v1/embeddings HTTP/1.1\r\nHost: ${host}\r\nContent-Length: 2\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n`,
    'no host': 'GET /livez HTTP/1.1\r\n\r\n',
    'two hosts': `GET /livez HTTP/1.1\r\nHost: ${host}\r\nHost: other\r\n\r\n`,
    'an unknown coding': `POST /v1/embeddings HTTP/1.1\r\nHost: ${host}\r\nTransfer-Encoding: gzip, chunked\r\n\r\n0\r\n\r\n`,
    'a body where none belongs': `GET /v1/meshes HTTP/1.1\r\nHost: ${host}\r\nContent-Length: 5\r\n\r\nhello`,
  };
  // A target in absolute form is the path behind it (RFC 9112 section 3.2.2).
  for (const [target, status] of [
    [`http://${host}/v1/meshes?limit=1`, 200],
    [`HTTP://${host}`, 200],
    [`http://${host}/nothing`, 404],
    ['http://other/nothing', 403],
  ])
    assert.equal(
      statusOf(await raw(d, `GET ${target} HTTP/1.1\r\nHost: ${host}\r\nConnection: close\r\n\r\n`)),
      status,
      target,
    );
  for (const [what, text] of Object.entries(bad)) {
    const reply = await raw(d, text);
    assert.ok([400, 413, 501].includes(statusOf(reply)), `${what}: ${reply.slice(0, 200)}`);
  }
  assert.equal((await d.get('/livez')).status, 200);
});

test('a length that is not a number gets one answer, and the connection ends', async (t) => {
  const d = await daemon(t);
  const { host } = new URL(d.url);
  for (const length of ['-1', '+2', '0x2', '2, 2', ' ', '9'.repeat(25)])
    for (const what of ['POST /v1/embeddings', 'GET /livez']) {
      const reply = await raw(d, `${what} HTTP/1.1\r\nHost: ${host}\r\nContent-Length: ${length}\r\n\r\n{}`);
      assert.ok([400, 413].includes(statusOf(reply)), `${length}: ${reply.slice(0, 200)}`);
      assert.equal(reply.split('HTTP/1.1').length, 2, `${length}: ${reply}`);
      const [head, body] = reply.split('\r\n\r\n');
      assert.match(head, /Connection: close/i);
      assert.equal(Number(head.match(/Content-Length: (\d+)/i)[1]), Buffer.byteLength(body));
    }
});

test('a header with a NUL gets one answer, and the connection ends', async (t) => {
  const d = await daemon(t);
  const { host } = new URL(d.url);
  const bad = ['Content-Length: 2\0', 'Content-Length: 2\x000', 'Content-Length: 2\0 \0', 'X-Note: a\0b', 'X-Note: \0'];
  for (const line of bad)
    for (const lines of [`Host: ${host}\r\n${line}`, `${line}\r\nHost: ${host}`])
      for (const what of ['POST /v1/embeddings', 'GET /livez']) {
        const reply = await raw(d, `${what} HTTP/1.1\r\n${lines}\r\n\r\n{}`);
        const title = JSON.stringify([what, lines, reply]);
        assert.equal(statusOf(reply), 400, title);
        assert.equal(reply.split('HTTP/1.1').length, 2, title);
        assert.match(reply, /^Connection: close\r$/im, title);
      }
  // What looks alike is served: empty values, bare line feeds, folded headers.
  const folded = 'X-Note: a\r\n b\r\n  c';
  for (const lines of [
    `Host: ${host}\r\nX-Note:`,
    `X-Note:\nHost: ${host}\nX: y`,
    `${folded}\r\nHost: ${host}`,
    `Host: ${host}\r\n${folded}`,
  ]) {
    const reply = await raw(d, `GET /livez HTTP/1.1\r\nConnection: close\r\n${lines}\r\n\r\n`);
    assert.equal(statusOf(reply), 200, JSON.stringify([lines, reply]));
  }
});
