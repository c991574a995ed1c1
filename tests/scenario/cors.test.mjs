// Calls from pages of other origins, as browsers make them (Fetch, "HTTP-network-or-cache fetch" and "CORS protocol").
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import http from 'node:http';
import path from 'node:path';
import test from 'node:test';
import { daemon, root } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const ours = 'https://studio.example.org';
const also = 'http://localhost:5173';
const other = 'https://example.com';
const listed = (text) => (text ?? '').toLowerCase().split(/\s*,\s*/);

/** Like d.request, but with headers that fetch() would not send. */
const send = (d, method, target, headers = {}, body) =>
  new Promise((resolve, reject) => {
    const r = http.request(new URL(target, d.url), { method, headers }, (reply) =>
      reply.resume().on('end', () => resolve({ status: reply.statusCode, headers: reply.headers })),
    );
    r.on('error', reject).end(body);
  });
const preflight = (d, origin, method, headers, target = '/v1/meshes') =>
  send(d, 'OPTIONS', target, {
    origin,
    'access-control-request-method': method,
    'access-control-request-headers': headers,
  });
const granted = (reply) => Object.keys(reply.headers).filter((name) => name.startsWith('access-control-'));

test('named origins may call, others may not', async (t) => {
  const d = await daemon(t, { args: ['--cors', `${ours}, ${also}`] });
  const upload = (origin) => send(d, 'POST', '/v1/meshes', origin ? { origin } : {}, shapes.tetrahedron);
  for (const origin of [ours, also]) {
    const reply = await upload(origin);
    assert.ok([200, 201].includes(reply.status));
    assert.equal(reply.headers['access-control-allow-origin'], origin);
    // Problems can be read as well as results.
    const missing = await send(d, 'GET', '/v1/nothing', { origin });
    assert.deepEqual([missing.status, missing.headers['access-control-allow-origin']], [404, origin]);
  }
  for (const origin of [other, `${ours}.evil.example`, ours.slice(0, -1), `${ours}, ${also}`, 'null', undefined]) {
    const reply = await upload(origin);
    assert.equal(reply.status, origin ? 403 : 200, 'a program that is not a browser sends no Origin');
    assert.deepEqual(granted(reply), [], String(origin));
    assert.deepEqual(
      granted(
        await send(d, 'OPTIONS', '/v1/meshes', origin ? { origin, 'access-control-request-method': 'POST' } : {}),
      ),
      [],
      String(origin),
    );
  }
  for (const origin of [ours, other, undefined])
    assert.ok(
      listed((await send(d, 'GET', '/v1/meshes', origin ? { origin } : {})).headers.vary).includes('origin'),
      'a shared cache keeps them apart',
    );
});

test('any origin', async (t) => {
  const d = await daemon(t, { args: ['--cors', '*', '--auth', 'on'] });
  const reply = await send(d, 'GET', '/v1/meshes', { origin: other });
  assert.deepEqual(
    [reply.status, reply.headers['access-control-allow-origin']],
    [401, '*'],
    'a page can read why it was refused',
  );
  assert.equal(
    reply.headers['access-control-allow-credentials'],
    undefined,
    'tokens come in a header, never from a cookie',
  );
  assert.equal((await preflight(d, other, 'DELETE', 'authorization')).status, 204, 'a preflight carries no token');
});

test('none by default', async (t) => {
  const d = await daemon(t);
  for (const method of ['GET', 'OPTIONS'])
    assert.deepEqual(
      granted(await send(d, method, '/v1/meshes', { origin: ours, 'access-control-request-method': 'POST' })),
      [],
    );
});

test('pages may send and read every header of the description', async (t) => {
  const d = await daemon(t, { args: ['--cors', ours] });
  const document = JSON.parse(await readFile(path.join(root, 'api/openapi.json'), 'utf8'));
  const wanted = new Set(['Authorization', 'Content-Type']);
  const replied = new Set();
  const walk = (value) => {
    if (!value || typeof value !== 'object') return;
    if (value.in === 'header') wanted.add(value.name);
    if (value.headers && !Array.isArray(value.headers)) Object.keys(value.headers).forEach((name) => replied.add(name));
    Object.values(value).forEach(walk);
  };
  walk({ ...document, webhooks: undefined }); // the daemon itself sends those requests
  const names = [...wanted].map((name) => name.toLowerCase());
  assert.ok(names.includes('prefer') && names.includes('range') && replied.has('ETag'));
  const { url } = (await d.upload(shapes.tetrahedron)).json;
  for (const [method, target] of [
    ['POST', '/v1/meshes'],
    ['DELETE', url],
    ['GET', `${url}/file`],
    ['HEAD', url],
  ]) {
    const reply = await preflight(d, ours, method, names.join(','), target);
    assert.equal(reply.status, 204, target);
    assert.equal(reply.headers['access-control-allow-origin'], ours);
    assert.ok(listed(reply.headers['access-control-allow-methods']).includes(method.toLowerCase()), method);
    for (const name of names)
      assert.ok(listed(reply.headers['access-control-allow-headers']).includes(name), `${name} may be sent`);
    assert.ok(Number(reply.headers['access-control-max-age']) > 0);
  }
  // Scripts may always read Cache-Control; the other headers are for browsers and proxies.
  const exposed = listed(
    (await send(d, 'GET', '/v1/meshes', { origin: ours })).headers['access-control-expose-headers'],
  );
  for (const name of replied)
    if (!['Cache-Control', 'Content-Security-Policy', 'X-Accel-Buffering', 'Vary', 'Content-Encoding'].includes(name))
      assert.ok(exposed.includes(name.toLowerCase()), `${name} is exposed`);
});
