// Compares docs/troubleshooting.md with the daemon: a section for every problem, its page at the problem's type, and in
// each section the facts that the daemon's answers have.
import assert from 'node:assert/strict';
import http from 'node:http';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { gzipSync } from 'node:zlib';
import { runProgram } from './support/cli.mjs';
import { binaries, daemon, endless, root, samples } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const text = await readFile(path.join(root, 'docs/troubleshooting.md'), 'utf8');
const sections = new Map(
  [...text.matchAll(/^## (\S+)\n([\s\S]*?)(?=^#|$(?![\s\S]))/gm)].map((m) => [m[1], m[2].trim()]),
);
const table = (await readFile(path.join(root, 'api/problem.c'), 'utf8')).match(/table\[\] = \{\n([\s\S]*?)\n\};/)[1];
const names = [...table.matchAll(/\{"([a-z-]+)", \d{3}, /g)].map((m) => m[1]);

test('there is a section for every problem, and none for others', async () => {
  assert.ok(names.length > 35);
  assert.deepEqual([...sections.keys()].sort(), [...names].sort());
  const document = await readFile(path.join(root, 'api/openapi.json'), 'utf8');
  for (const [, name] of document.matchAll(/"\/problems\/([a-z-]+)"/g)) assert.ok(sections.has(name), name);
  for (const [name, section] of sections)
    assert.ok(section.split('\n\n').length >= 2, `${name}: what it means, and what helps`);
});

test('the type of every problem leads to its section', async (t) => {
  const d = await daemon(t);
  for (const [name, section] of sections) {
    const reply = await d.get(`/problems/${name}`);
    assert.equal(reply.status, 200, name);
    assert.equal(reply.type, 'text/html; charset=utf-8');
    const shown = reply.bytes
      .toString()
      .replace(/<[^>]+>/g, '')
      .replaceAll('&lt;', '<')
      .replaceAll('&gt;', '>')
      .replaceAll('&amp;', '&');
    assert.match(shown, new RegExp(`orbmorph: ${name}\\n`));
    for (const [, other] of section.matchAll(/\]\(#([a-z-]+)\)/g))
      assert.ok(reply.bytes.includes(`<a href="/problems/${other}">`), `${name} links to ${other}`);
    for (const line of section.split('\n').filter((l) => l && !/[`*[]/.test(l)))
      assert.ok(shown.includes(line), `${name}: ${line}`);
    for (const other of sections.keys())
      assert.ok(!shown.includes(`## ${other}`), `${name} ends where ${other} begins`);
  }
  assert.equal((await d.get('/problems/none-such')).status, 404);
});

/** A request that fetch refuses to send. */
function bare(url, method, target, headers, body) {
  return new Promise((done, reject) => {
    const r = http.request(new URL(target, url), { method, headers }, (answer) => {
      const parts = [];
      answer.on('data', (part) => parts.push(part));
      answer.on('end', () => done({ status: answer.statusCode, json: JSON.parse(Buffer.concat(parts)) }));
    });
    r.useChunkedEncodingByDefault = false;
    r.on('error', reject);
    r.end(body);
  });
}

test('sections name the facts that answers have', async (t) => {
  const own = ['--fetch-allow', '127.0.0.1'];
  const d = await daemon(t, { args: ['--max-body', '300K', '--queue-limit', '1', '--workers', '1', ...own] });
  const { obj, ball } = shapes;
  const met = new Set();
  const missing = [];
  const meets = (type, reply) => {
    const problem = reply.json.problem ?? reply.json;
    assert.equal(problem.type, `/problems/${type}`, JSON.stringify(problem).slice(0, 400));
    for (const member of Object.keys(problem).filter(
      (k) => !['type', 'title', 'status', 'detail', 'instance'].includes(k),
    ))
      if (!sections.get(type).includes(`\`${member}\``)) missing.push(`${type}: ${member}`);
    met.add(type);
  };
  const upload = async (type, bytes, query, headers) =>
    meets(type, await d.post('/v1/meshes', Buffer.from(bytes), { query, headers }));
  const m = ball(2);
  await upload('unknown-format', 'no mesh at all');
  await upload('malformed-mesh', 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n');
  await upload('not-finite', obj(m).replace(/^v \S+/m, 'v nan'));
  await upload('not-closed', obj(shapes.withoutFace(m)));
  await upload('not-connected', obj(shapes.apart(ball(2), ball(1))));
  await upload('not-genus-zero', obj(shapes.torus()));
  const twice = { ...m, triangles: [...m.triangles, [m.triangles[0][0], m.triangles[0][1], m.triangles.at(-1)[2]]] };
  await upload('not-manifold', obj(twice));
  const reversed = { ...m, triangles: m.triangles.map((f, i) => (i ? f : [f[1], f[0], f[2]])) };
  await upload('not-orientable', obj(reversed), { repair: 'none' });
  await upload('degenerate', 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 3 2 1\n');
  await upload('too-large', Buffer.alloc(400_000, 'v'));
  await upload('bad-query', obj(m), { repair: 'magic' });
  await upload('malformed-encoding', 'no gzip', {}, { 'content-encoding': 'gzip' });
  await upload('unsupported-encoding', gzipSync('x'), {}, { 'content-encoding': 'br' });
  meets('length-required', await bare(d.url, 'POST', '/v1/meshes', {}));
  meets('bad-request', await bare(d.url, 'GET', '/livez', { 'content-length': '2' }, 'xx'));
  meets('method-not-allowed', await d.request('PUT', '/v1/meshes'));
  meets('foreign-host', await bare(d.url, 'GET', '/v1/meshes', { host: 'attacker.example' }));
  meets('foreign-origin', await bare(d.url, 'GET', '/v1/meshes', { origin: 'https://attacker.example' }));
  await upload('unsupported-media-type', '--x', {}, { 'content-type': 'multipart/form-data; boundary=x' });
  await upload('bad-query', obj(m), { repare: 'safe' });
  meets('not-found', await d.get(`/v1/meshes/${'0'.repeat(64)}`));
  meets('forbidden-address', await d.post('/v1/meshes', { url: 'https://10.0.0.1/' }));
  const lost = await d.post('/v1/meshes', { url: `${d.url}/v1/meshes/${'0'.repeat(64)}/file` });
  meets('fetch-failed', { json: (await d.ended(lost.json)).problem });

  const a = await d.mesh(path.join(samples, 'dog.obj'));
  const b = await d.mesh(path.join(samples, 'giraffe.off'));
  const both = { shapes: [{ mesh: a.id }, { mesh: b.id }] };
  const place = (i) => ({ vertex: i });
  const merge = async (type, body) => meets(type, await d.post('/v1/supermeshes', body));
  await merge('bad-landmarks', { ...both, landmarks: [{ at: [place(10), place(1e6)] }] });
  await merge('bad-option', { ...both, remesh: { tolerance: -1 } });
  await merge('unknown-member', { ...both, tolerance: 0.1 });
  await merge('invalid-request', { shapes: 'dog' });
  meets(
    'malformed-json',
    await d.post('/v1/supermeshes', Buffer.from('{"shapes": ['), { headers: { 'content-type': 'application/json' } }),
  );
  meets('precondition-failed', await d.get(`${a.url}/file`, { headers: { 'if-match': '"other"' } }));
  meets('range-not-satisfiable', await d.get(`${a.url}/file`, { headers: { range: 'bytes=99999999-' } }));

  // A long job, and the requests that are refused while it runs.
  const body = { mesh: a.id, ...endless };
  const job = await d.post('/v1/embeddings', body);
  assert.equal(job.status, 202);
  meets('queue-full', await d.post('/v1/embeddings', { mesh: b.id }));
  meets('in-use', await d.delete(a.url));
  assert.ok([200, 202].includes((await d.delete(job.json.url)).status));
  const ended = await d.ended(job.json);
  if (ended.problem) meets('cancelled', { json: ended.problem });
  const short = await d.ended((await d.post('/v1/embeddings', { mesh: b.id })).json);
  meets('job-ended', await d.delete(short.url));

  const two = { ...both, landmarks: [{ at: [place(100), place(100)] }, { at: [place(100), place(2000)] }] };
  const contradiction = await d.make('/v1/supermeshes', two);
  meets('bad-landmarks', { json: contradiction.problem });

  assert.deepEqual(missing, [], 'facts that a section does not name');
  const rest = [...sections.keys()].filter((name) => !met.has(name));
  const elsewhere = [
    'bad-header',
    'unauthorized',
    'forbidden',
    'quota-exceeded',
    'bad-signature',
    'expired-signature',
    'not-ready',
    'too-many-requests',
    'unsupported-method',
    'cancelled',
    'unavailable',
    'storage-full',
    'read-only', // scenario.read_only
    'timeout',
    'no-memory',
    'not-certified',
    'corrupt',
    'crashed',
    'job-crashed', // scenario.isolate provokes it
    'uri-too-long', // scenario.requests
    'headers-too-large', // there, too
    'internal',
  ];
  assert.deepEqual(
    rest.filter((name) => !elsewhere.includes(name)),
    [],
  );
});

test('sections about tokens', async (t) => {
  const first = await daemon(t, { args: ['--auth', 'on'] });
  const reply = await first.get('/v1/meshes');
  assert.equal(reply.json.type, '/problems/unauthorized');
  await first.stop();
  const made = await runProgram(binaries.daemon, [
    'token',
    'add',
    'reader',
    '--scope',
    'read',
    '--quota',
    '1000',
    '--data',
    first.data,
  ]);
  assert.equal(made.code, 0, made.err);
  await first.start();
  const headers = {
    authorization: `Bearer ${made.out
      .trim()
      .split(/\s+/)
      .find((w) => w.length > 20)}`,
  };
  assert.equal((await first.get('/v1/meshes', { headers })).status, 200);
  const refused = await first.post('/v1/meshes', Buffer.from('x'), { headers });
  assert.equal(refused.json.type, '/problems/forbidden');
  for (const problem of [reply.json, refused.json])
    for (const member of Object.keys(problem).filter((k) => !['type', 'title', 'status', 'detail'].includes(k)))
      assert.ok(sections.get(problem.type.split('/').at(-1)).includes(`\`${member}\``), member);
});

test('details read as sentences, with numbers as people write them', async (t) => {
  const d = await daemon(t);
  const { id } = (await d.upload(shapes.obj(shapes.egg(2)))).json;
  const two = { shapes: [{ mesh: id }, { mesh: id }] };
  for (const [target, body, detail] of [
    ['/v1/embeddings', [], 'The request must be a JSON object.'],
    [
      '/v1/supermeshes',
      { ...two, remesh: { tolerance: 0 } },
      '"tolerance" in "remesh" must be a number from 1e-09 to 1.',
    ],
    [
      '/v1/supermeshes',
      { ...two, remesh: { max_triangles: 0.5 } },
      '"max_triangles" in "remesh" must be a whole number from 0 to 100000000.',
    ],
    [
      '/v1/supermeshes',
      { ...two, remesh: { max_triangles: 3 } },
      '"max_triangles" in "remesh" must be at least 4, as many as a tetrahedron has, or 0 for no limit.',
    ],
    [
      '/v1/supermeshes',
      { ...two, landmarks: [{ at: [{ vertex: 0 }] }] },
      'Landmark 0: "at" must list one place for each of the 2 shapes.',
    ],
    [
      '/v1/supermeshes',
      { ...two, landmarks: [{ at: [{ vertex: 0 }, { vertex: -1 }] }] },
      /^Landmark 0, shape 1: .*\.$/,
    ],
  ]) {
    const reply = await d.post(target, body);
    assert.equal(reply.status, 422);
    if (typeof detail === 'string') assert.equal(reply.json.detail, detail);
    else assert.match(reply.json.detail, detail);
  }
});
