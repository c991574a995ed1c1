// Conditional requests (entity tags, also over several header lines and for DELETE), ranges, preferences.
import assert from 'node:assert/strict';
import http from 'node:http';
import path from 'node:path';
import test from 'node:test';
import { assertProblem, daemon, samples } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

/** fetch joins the lines of a header; here each line stays separate. */
function lines(d, method, target, headers, body) {
  return new Promise((done, reject) => {
    const r = http.request(new URL(target, d.url), { method, headers }, (answer) => {
      const parts = [];
      answer.on('data', (part) => parts.push(part));
      answer.on('end', () => done({ status: answer.statusCode, headers: answer.headers, bytes: Buffer.concat(parts) }));
    });
    r.on('error', reject);
    r.end(body);
  });
}

test('a request whose condition fails deletes and returns nothing', async (t) => {
  const d = await daemon(t);
  const mesh = await d.mesh(path.join(samples, 'dog.obj'));
  const embedding = await d.made('/v1/embeddings', { mesh: mesh.id });
  for (const { url } of [mesh, embedding]) {
    const etag = (await d.get(url)).headers.get('etag');
    for (const headers of [
      { 'if-match': '"other"' },
      { 'if-match': `W/${etag}` },
      { 'if-none-match': etag },
      { 'if-none-match': '*' },
      { 'if-match': etag, 'if-none-match': `"other", W/${etag}` },
    ]) {
      assertProblem(await d.delete(url, { headers }), 412, 'precondition-failed', JSON.stringify(headers));
      assert.equal((await d.get(url)).status, 200, 'it is still there');
    }
    for (const match of ['"other"', `W/${etag}`])
      assertProblem(await d.get(url, { headers: { 'if-match': match } }), 412, 'precondition-failed');
    for (const match of [etag, '*', `"other", ${etag}`])
      assert.equal((await d.get(url, { headers: { 'if-match': match } })).status, 200);
    assert.equal((await d.get(url, { headers: { 'if-match': etag, 'if-none-match': etag } })).status, 304);
    assert.equal(
      (await d.delete(url, { headers: { 'if-match': `"other", ${etag}`, 'if-none-match': '"other"' } })).status,
      204,
    );
    assertProblem(await d.delete(url, { headers: { 'if-match': etag } }), 404, 'not-found');
  }
});

test('a list of tags may span several header lines', async (t) => {
  const d = await daemon(t);
  const { url } = await d.mesh(path.join(samples, 'dog.obj'));
  for (const target of [url, `${url}/file`]) {
    const { etag } = (await lines(d, 'GET', target, {})).headers;
    assert.equal((await lines(d, 'GET', target, { 'if-match': ['"a"', '"b"', etag] })).status, 200);
    assert.equal((await lines(d, 'GET', target, { 'if-match': ['"a"', '"b"'] })).status, 412);
    assert.equal((await lines(d, 'GET', target, { 'if-none-match': ['"a"', etag] })).status, 304);
  }
  // A list of two codings is not equal to its first entry.
  const twice = await lines(
    d,
    'POST',
    '/v1/meshes',
    { 'content-encoding': ['identity', 'gzip'], 'content-length': 4 },
    'abcd',
  );
  assert.equal(twice.status, 415);
  assert.equal(JSON.parse(twice.bytes).type, '/problems/unsupported-encoding');
});

test('an invalid query of an upload is refused before its body is sent', async (t) => {
  const d = await daemon(t);
  for (const query of ['repair=glue', 'format=doc', 'name=', 'name=%01', `name=${'x'.repeat(128)}`]) {
    const told = await new Promise((done, reject) => {
      const r = http.request(new URL(`/v1/meshes?${query}`, d.url), {
        method: 'POST',
        headers: { expect: '100-continue', 'content-length': 1_000_000 },
      });
      r.on('continue', () => done('send it'));
      r.on('response', (answer) => done(answer.statusCode));
      r.on('error', reject);
      r.on('close', () => done('closed'));
      r.flushHeaders();
      t.after(() => r.destroy());
    });
    assert.ok([400, 422].includes(told), `${query}: ${told}`);
  }
});

test('the unit of a range is case-insensitive', async (t) => {
  const d = await daemon(t);
  const { url, bytes } = await d.mesh(path.join(samples, 'dog.obj'));
  for (const unit of ['bytes', 'Bytes', 'BYTES']) {
    const part = await d.get(`${url}/file`, { headers: { range: `${unit}=0-9` } });
    assert.deepEqual(
      [part.status, part.bytes.length, part.headers.get('content-range')],
      [206, 10, `bytes 0-9/${bytes}`],
    );
  }
});

test('a preference is recognised anywhere in Prefer, and nothing else is taken for one', async (t) => {
  const d = await daemon(t);
  const { id } = (await d.upload(shapes.obj(shapes.egg(2)))).json;
  const { url } = (await d.post('/v1/embeddings', { mesh: id })).json;
  await d.get(url, { query: { wait: 60 } });
  const applied = async (prefer) => (await lines(d, 'GET', url, { prefer })).headers['preference-applied'];
  for (const prefer of [
    ['respond-async', 'wait=7'],
    'wait="7"',
    'wait = 7',
    'WAIT=7',
    'respond-async; x=1, wait=7; y="a,b"',
    'x="\\",wait=9", wait=7',
    'wait=7, wait=9',
    ['wait=7', 'wait=9'],
    'handling=lenient,,wait=7',
  ])
    assert.equal(await applied(prefer), 'wait=7', String(prefer));
  for (const prefer of [
    'x="wait=7"',
    'x="a, wait=7"',
    'return=minimal; wait=7',
    'wait',
    'wait=',
    'wait=-7',
    'wait=7s',
    'wait=soon',
    'wait=inf',
    'wait=nan',
    'await=7',
    'waits=7',
    'wait=0',
    '"',
    ';=,',
    'wait="',
    '=',
  ])
    assert.equal(await applied(prefer), undefined, prefer);
  assert.equal(await applied('wait=1000000000'), 'wait=60');
});
