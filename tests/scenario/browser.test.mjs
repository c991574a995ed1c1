// The browser as an attacker: what a page of another site can send to a daemon that needs no token. fetch() sets Host
// and Origin itself, so this test writes the requests by hand, as a browser would send them for such a page.
import assert from 'node:assert/strict';
import http from 'node:http';
import net from 'node:net';
import { networkInterfaces } from 'node:os';
import test from 'node:test';
import { assertProblem, daemon } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const evil = 'https://attacker.example';

/** Like d.request, but with any headers. */
const send = (d, method, target, headers = {}, body) =>
  new Promise((resolve, reject) => {
    const r = http.request(new URL(target, d.url), { method, headers }, (reply) => {
      const parts = [];
      reply
        .on('data', (part) => parts.push(part))
        .on('end', () => {
          const bytes = Buffer.concat(parts);
          const type = reply.headers['content-type'] ?? '';
          const json = /json/.test(type) && bytes.length ? JSON.parse(bytes) : undefined;
          resolve({ status: reply.statusCode, headers: reply.headers, type, bytes, json });
        });
    });
    r.on('error', reject).end(body);
  });

/** The status line for a request as it is written. */
const raw = (d, text) =>
  new Promise((resolve, reject) => {
    const { hostname, port } = new URL(d.url);
    let reply = '';
    net
      .connect(Number(port), hostname, function () {
        this.write(text);
      })
      .on('data', (part) => (reply += part))
      .on('error', reject)
      .on('close', () => resolve(reply));
  });

const ROUTES = [
  ['GET', '/v1/meshes'],
  ['POST', '/v1/meshes'],
  ['GET', `/v1/meshes/${'0'.repeat(64)}`],
  ['DELETE', `/v1/meshes/${'0'.repeat(64)}`],
  ['GET', '/v1/jobs'],
  ['POST', '/v1/supermeshes'],
  ['GET', '/metrics'],
];

test('a page whose name resolves to loopback can neither read nor change anything', async (t) => {
  const d = await daemon(t);
  const { port } = new URL(d.url);
  const mesh = (await d.upload(shapes.tetrahedron)).json;
  const before = (await d.get('/v1/meshes')).json.meshes.length;
  const hosts = [
    'attacker.example',
    `attacker.example:${port}`,
    'localhost.attacker.example',
    'localhost@attacker.example',
    '127.0.0.1.attacker.example',
    '127.0.0.1:8080:80',
    '10.0.0.1',
    '[::1',
    '[::2]',
    ':80',
  ];
  for (const host of hosts)
    for (const [method, target] of [...ROUTES, ['GET', '/'], ['GET', '/openapi.json'], ['OPTIONS', '/v1/meshes']])
      assertProblem(
        await send(d, method, target, { host }, method === 'POST' ? shapes.cube : undefined),
        403,
        'foreign-host',
        `${host} ${method} ${target}`,
      );
  assert.equal((await send(d, 'GET', mesh.url, { host: evil.slice(8) })).json.host, evil.slice(8));
  assert.equal((await d.get('/v1/meshes')).json.meshes.length, before);
  // The target in absolute form names the host, whatever Host says.
  const absolute = await raw(
    d,
    `GET http://attacker.example/v1/meshes HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n`,
  );
  assert.match(absolute, /^HTTP\/1\.1 403 [\s\S]*foreign-host/);
  assert.match(await raw(d, 'GET /v1/meshes HTTP/1.1\r\nHost:\r\nConnection: close\r\n\r\n'), /^HTTP\/1\.1 403/);
  for (const target of ['/livez', '/readyz'])
    assert.equal((await send(d, 'GET', target, { host: 'balancer.internal' })).status, 200, target);
});

test('the daemon answers to its own names', async (t) => {
  const d = await daemon(t, { args: ['--hosts', 'morph.example.org, build.example:8443, [2001:db8::7]'] });
  const { port } = new URL(d.url);
  for (const host of [
    'localhost',
    `localhost:${port}`,
    'LocalHost:1',
    '127.0.0.1',
    `127.1.2.3:${port}`,
    '[::1]:80',
    'morph.example.org',
    'MORPH.example.org:443',
    'build.example:8443',
    '[2001:DB8::7]:8080',
  ])
    assert.equal((await send(d, 'GET', '/v1/meshes', { host })).status, 200, host);
  for (const host of ['build.example', 'build.example:80', 'x.morph.example.org', 'morph.example.or'])
    assertProblem(await send(d, 'GET', '/v1/meshes', { host }), 403, 'foreign-host', host);
  assert.match(await raw(d, 'GET /v1/meshes HTTP/1.0\r\n\r\n'), /^HTTP\/1\.1 200/, 'HTTP/1.0 names no host');
  const any = await daemon(t, { args: ['--hosts', '*'] });
  assert.equal((await send(any, 'GET', '/v1/meshes', { host: 'attacker.example' })).status, 200);
});

test('a daemon on all addresses answers to the one that is asked', async (t) => {
  const d = await daemon(t, { args: ['--listen', '0.0.0.0:0', '--auth', 'off'] });
  const { port } = new URL(d.url);
  const address = Object.values(networkInterfaces())
    .flat()
    .find((a) => a.family === 'IPv4' && !a.internal)?.address;
  const at = { url: `http://${address ?? '127.0.0.1'}:${port}` };
  assert.equal((await send(at, 'GET', '/v1/meshes')).status, 200);
  assertProblem(await send(at, 'GET', '/v1/meshes', { host: '192.0.2.1' }), 403, 'foreign-host');
});

test('a page of another origin has no effect, with and without a preflight', async (t) => {
  const d = await daemon(t);
  const { port } = new URL(d.url);
  const mesh = (await d.upload(shapes.tetrahedron)).json;
  const origins = [evil, 'null', `http://localhost:${Number(port) + 1}`, `http://127.0.0.1:${port}.attacker.example`];
  for (const origin of origins) {
    for (const [method, target] of ROUTES) {
      const body = method === 'POST' ? shapes.cube : undefined;
      const reply = await send(d, method, target, { origin, 'content-type': 'text/plain' }, body);
      assertProblem(reply, 403, 'foreign-origin', `${origin} ${method} ${target}`);
      assert.equal(reply.json.origin, origin);
    }
    const preflight = await send(d, 'OPTIONS', mesh.url, { origin, 'access-control-request-method': 'DELETE' });
    assert.equal(preflight.headers['access-control-allow-origin'], undefined, origin);
  }
  assert.equal((await d.get(mesh.url)).status, 200, 'it is still there');
  assert.equal((await d.get('/v1/meshes')).json.meshes.length, 1, 'nothing came with it');
  // The studio is a page of the daemon itself.
  const own = await send(d, 'POST', '/v1/meshes?name=own', { origin: d.url }, shapes.cube);
  assert.equal(own.status, 201, own.bytes.toString());
});

test('an element of a foreign page does not make the daemon work', async (t) => {
  const d = await daemon(t);
  const site = { 'sec-fetch-site': 'cross-site' };
  assertProblem(await send(d, 'GET', '/v1/meshes', { ...site, 'sec-fetch-mode': 'no-cors' }), 403, 'foreign-origin');
  // A link that a user follows is a navigation; an address that the user types has no site.
  for (const headers of [
    { ...site, 'sec-fetch-mode': 'navigate' },
    { 'sec-fetch-site': 'none', 'sec-fetch-mode': 'navigate' },
    { 'sec-fetch-site': 'same-origin', 'sec-fetch-mode': 'cors' },
  ])
    assert.equal((await send(d, 'GET', '/v1/meshes', headers)).status, 200, JSON.stringify(headers));
});

test('behind a proxy the page has the name of the proxy', async (t) => {
  const d = await daemon(t, { args: ['--hosts', 'morph.example.org', '--cors', 'https://app.example.org'] });
  for (const [host, origin, status] of [
    ['morph.example.org', 'https://morph.example.org', 200],
    ['127.0.0.1:8080', 'https://morph.example.org', 200],
    ['morph.example.org', 'https://app.example.org', 200],
    ['morph.example.org', 'https://app.example.org.attacker.example', 403],
    ['morph.example.org', 'ftp://morph.example.org', 403],
  ])
    assert.equal((await send(d, 'GET', '/v1/meshes', { host, origin })).status, status, `${host} ${origin}`);
});

test('with tokens, neither names nor origins are checked', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on'] });
  const reply = await send(d, 'GET', '/v1/meshes', { host: 'morph.example.org', origin: evil });
  assertProblem(reply, 401, 'unauthorized');
});

test('unknown parameters of a query are refused by name, on every route', async (t) => {
  const d = await daemon(t);
  const mesh = (await d.upload(shapes.tetrahedron)).json;
  const refused = await d.post('/v1/meshes?repare=fill_holes', Buffer.from(shapes.tetrahedron));
  assertProblem(refused, 400, 'bad-query');
  assert.equal(refused.json.parameter, 'repare');
  assert.match(refused.json.detail, /"repare".*name, format, repair/);
  const { json: document } = await d.get('/openapi.json');
  const ids = { id: mesh.id, job: '0'.repeat(32), k: 0 };
  const resolve = (o) => (o.$ref ? document.components.parameters[o.$ref.split('/').pop()] : o);
  for (const [target, item] of Object.entries(document.paths))
    for (const verb of ['get', 'post', 'delete'].filter((v) => item[v])) {
      if (['/', '/docs'].includes(target)) continue;
      const at = target.replace(/\{(\w+)\}/g, (_, name) => ids[name]);
      const ask = (query) =>
        d.request(verb.toUpperCase(), `${at}?${query}`, { body: item[verb].requestBody && Buffer.from('{}') });
      const reply = await ask('vertices=1');
      assertProblem(reply, 400, 'bad-query', `${verb} ${target}`);
      assert.equal(reply.json.parameter, 'vertices');
      // Parameters in the document are accepted, once each and with a value.
      for (const p of (item[verb].parameters ?? []).map(resolve).filter((p) => p.in === 'query')) {
        if (p.name === 'signature') continue; // an invalid one is refused before the query is read
        const twice = await ask(`${p.name}=1&${p.name}=1`);
        assertProblem(twice, 400, 'bad-query', `${verb} ${target} ${p.name}`);
        assert.match(twice.json.detail, /given twice/);
        if (p.name !== 'verbose') assert.match((await ask(p.name)).json.detail, /needs a value/, `${target} ${p.name}`);
      }
    }
  assert.equal((await d.get(mesh.url)).status, 200, 'a DELETE with a parameter that it does not know deletes nothing');
  for (const target of ['/?utm_source=x', '/docs?x', '/v1/meshes?', '/v1/meshes?limit=1&', '/readyz?verbose'])
    assert.equal((await d.get(target)).status, 200, target);
});

test('a form is told what to send instead', async (t) => {
  const d = await daemon(t);
  const form = new FormData();
  form.set('file', new Blob([shapes.tetrahedron]), 'tetrahedron.obj');
  for (const [target, says] of [
    ['/v1/meshes', /curl --data-binary @FILE/],
    ['/v1/supermeshes', /Send the JSON as the body/],
    ['/v1/embeddings', /Content-Type: application\/json/],
  ]) {
    const response = await fetch(new URL(target, d.url), { method: 'POST', body: form });
    const problem = await response.json();
    assert.deepEqual([response.status, problem.type], [415, '/problems/unsupported-media-type'], target);
    assert.match(problem.detail, says);
  }
});
