// Compares the API document with the daemon's answers: it must contain every status, header and member.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { readFile } from 'node:fs/promises';
import http from 'node:http';
import path from 'node:path';
import test from 'node:test';
import { promisify } from 'node:util';
import { gzipSync } from 'node:zlib';
import { binaries, daemon, endless, root, samples, until } from './support/daemon.mjs';
import { document, resolve, validate, VERBS } from './support/openapi.mjs';
import { origin } from './support/origin.mjs';
import * as shapes from './support/shapes.mjs';

// Headers of HTTP itself.
const PLAIN = [
  'content-type',
  'content-length',
  'date',
  'connection',
  'keep-alive',
  'transfer-encoding',
  'x-content-type-options',
];

// Each operation and status that a test of this file has seen.
const seen = new Set();

/** Checks an answer against the document's description of the operation, and records that it was seen. */
function hold(reply, method, target) {
  const what = `${method} ${target}: ${reply.status} ${reply.type}`;
  const entry = document.paths[target][method.toLowerCase()].responses[reply.status];
  assert.ok(entry, `${what} is not in the document: ${reply.bytes.toString().slice(0, 300)}`);
  const described = resolve(entry);
  const names = Object.keys(described.headers ?? {}).map((name) => name.toLowerCase());
  for (const [name] of reply.headers)
    assert.ok(PLAIN.includes(name) || names.includes(name), `${what}: the header ${name} is not in the document`);
  for (const [name, header] of Object.entries(described.headers ?? {})) {
    const value = reply.headers.get(name);
    const { schema } = resolve(header);
    if (value !== null) validate(schema, schema.type === 'integer' ? Number(value) : value, `${what}: ${name}`);
  }
  if (!described.content) {
    assert.equal(reply.bytes.length, 0, what);
  } else {
    const media = described.content[reply.type.split(';')[0]];
    assert.ok(media, `${what}: this type is not in the document`);
    if (reply.json !== undefined) validate(media.schema, reply.json, what);
  }
  seen.add(`${method} ${target} ${reply.status}`);
  return reply;
}

/** Requests to a daemon, each answer of which is checked against the document. */
function held(d) {
  const ask = async (method, target, { id, k = 0, body, query, headers } = {}) =>
    hold(
      await d.request(method, target.replace(/\{k\}/, k).replace(/\{\w+\}/, id), { body, query, headers }),
      method,
      target,
    );
  const upload = (bytes, query) => ask('POST', '/v1/meshes', { body: Buffer.from(bytes), query });
  return { ask, upload };
}

/** A request that fetch cannot make: no Content-Length on POST, or a body on GET. */
function bare(d, method, target, headers, body) {
  return new Promise((done, reject) => {
    const r = http.request(new URL(target, d.url), { method, headers }, (answer) => {
      const parts = [];
      answer.on('data', (part) => parts.push(part));
      answer.on('end', () => {
        const bytes = Buffer.concat(parts);
        done({
          status: answer.statusCode,
          type: answer.headers['content-type'] ?? '',
          bytes,
          headers: new Headers(Object.entries(answer.headers)),
          json: JSON.parse(bytes),
        });
      });
    });
    r.useChunkedEncodingByDefault = false;
    r.on('error', reject);
    r.end(body);
  });
}

test('the document and the daemon know the same paths and methods', async (t) => {
  const d = await daemon(t);
  const table = await readFile(path.join(root, 'api/routes.h'), 'utf8');
  const routes = [...table.matchAll(/ROUTE\(ROUTE_\w+, "(\w+)", "([^"]+)"/g)].map((m) => `${m[1]} ${m[2]}`).sort();
  const described = Object.entries(document.paths)
    .flatMap(([target, item]) => VERBS.filter((v) => item[v]).map((v) => `${v.toUpperCase()} ${target}`))
    .sort();
  assert.ok(routes.length > 20);
  assert.deepEqual(described, routes);
  for (const [target, item] of Object.entries(document.paths)) {
    const at = target.replace('{id}', '0'.repeat(64)).replace('{job}', '0'.repeat(32)).replace('{k}', '0');
    const wanted = VERBS.filter((v) => item[v]).flatMap((v) => (v === 'get' ? ['GET', 'HEAD'] : [v.toUpperCase()]));
    const options = await d.request('OPTIONS', at);
    assert.equal(options.status, 204, target);
    assert.deepEqual(options.headers.get('allow').split(', ').sort(), [...wanted, 'OPTIONS'].sort(), target);
    for (const method of ['POST', 'PUT', 'PATCH', 'DELETE'].filter((m) => !wanted.includes(m))) {
      const reply = await d.request(method, at);
      assert.equal(reply.status, 405, `${method} ${target}`);
      validate({ $ref: '#/components/schemas/ProblemMethodNotAllowed' }, reply.json, `${method} ${target}`);
    }
  }
  validate({ $ref: '#/components/schemas/ProblemNotFound' }, (await d.get('/nothing')).json, '/nothing');
});

test('answers about meshes', async (t) => {
  const d = await daemon(t);
  const { ask, upload } = held(d);
  const { obj, ball } = shapes;
  const m = ball(2);
  for (const file of ['dog.obj', 'giraffe.off', 'elephant.ply']) {
    const bytes = await readFile(path.join(samples, file));
    const first = await upload(bytes, { name: file });
    assert.equal(first.status, 201);
    assert.equal(first.headers.get('location'), first.json.url);
    assert.equal((await upload(bytes, { name: file })).status, 200);
    const id = first.json.id;
    const etag = (await ask('GET', '/v1/meshes/{id}', { id })).headers.get('etag');
    assert.equal((await ask('GET', '/v1/meshes/{id}', { id, headers: { 'if-none-match': etag } })).status, 304);
    for (const method of ['GET', 'DELETE'])
      assert.equal((await ask(method, '/v1/meshes/{id}', { id, headers: { 'if-match': '"x"' } })).status, 412);
    const whole = await ask('GET', '/v1/meshes/{id}/file', { id });
    assert.ok(whole.bytes.equals(bytes));
    for (const [headers, status] of [
      [{ range: 'bytes=0-9' }, 206],
      [{ range: `bytes=${bytes.length}-` }, 416],
      [{ 'if-match': '"other"' }, 412],
      [{ 'if-match': `W/${whole.headers.get('etag')}` }, 412],
      [{ 'if-match': whole.headers.get('etag') }, 200],
      [{ 'if-none-match': whole.headers.get('etag') }, 304],
    ])
      assert.equal((await ask('GET', '/v1/meshes/{id}/file', { id, headers })).status, status);
  }
  const page = await ask('GET', '/v1/meshes', { query: { limit: 1 } });
  assert.equal(
    (await ask('GET', '/v1/meshes', { query: { limit: 1, page_token: page.json.next_page_token } })).json.meshes.length,
    1,
  );
  await ask('GET', '/v1/meshes', { query: { limit: 'x' } });

  const two = obj(shapes.apart(ball(1), m));
  const hole = obj(shapes.withoutFace(m));
  const along = obj({
    positions: [
      [0, 0, 0],
      [1, 0, 0],
      [0, 1, 0],
      [0, 0, 1],
      [0, -1, 0],
    ],
    triangles: [
      [0, 1, 2],
      [1, 0, 3],
      [0, 1, 4],
    ],
  });
  const edits = [
    [obj(shapes.soup(m))],
    [shapes.cube],
    [hole, { repair: 'fill_holes' }],
    [two, { repair: 'largest_component' }],
    [two, { part: 1 }],
    [obj(shapes.torus()), { repair: 'close_handles', handle_size: 1 }],
    [obj(shapes.reversed(m, (i) => i % 3 === 0))],
    [obj(shapes.reversed(m))],
    [`${obj(m)}v 9 9 9\nf 1 1 2\n`],
  ];
  for (const [text, query] of edits) {
    const reply = await upload(text, query);
    assert.equal(reply.status, 201, reply.bytes.toString());
  }
  const refusals = [
    ['not-closed', hole],
    ['not-connected', two],
    ['not-genus-zero', obj(shapes.torus())],
    ['not-manifold', along],
    ['not-orientable', obj(shapes.reversed(m, (i) => i === 5)), { repair: 'none' }],
    ['not-finite', obj(m).replace('v 1 0 0', 'v nan 0 0')],
    ['degenerate', 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 3 2 1\n'],
    ['malformed-mesh', 'OFF\n4 4 0\n0 0 0\n'],
    ['malformed-mesh', shapes.binaryPly(m).subarray(0, 400)],
    ['unknown-format', Buffer.from([0, 1, 2, 3, 255, 254, 7, 9])],
    ['bad-query', obj(m), { repair: 'magic' }],
  ];
  for (const [name, bytes, query] of refusals)
    assert.equal((await upload(bytes, query)).json.type, `/problems/${name}`);
  const encoded = hold(
    await bare(d, 'POST', '/v1/meshes', { 'content-encoding': 'br', 'content-length': 10 }),
    'POST',
    '/v1/meshes',
  );
  assert.equal(encoded.status, 415);
  const coded = (body) => ask('POST', '/v1/meshes', { body, headers: { 'content-encoding': 'gzip' } });
  assert.equal((await coded(gzipSync(shapes.tetrahedron))).status, 201);
  assert.equal((await coded(Buffer.from('plain'))).json.type, '/problems/malformed-encoding');
  assert.equal((await coded(gzipSync(Buffer.alloc(3_000_000)))).json.type, '/problems/too-large');
  assert.equal(hold(await bare(d, 'POST', '/v1/meshes', {}), 'POST', '/v1/meshes').status, 411);
  const { id } = (await upload(shapes.tetrahedron)).json;
  assert.equal((await ask('DELETE', '/v1/meshes/{id}', { id })).status, 204);
  for (const [method, target] of [
    ['DELETE', '/v1/meshes/{id}'],
    ['GET', '/v1/meshes/{id}'],
    ['GET', '/v1/meshes/{id}/file'],
  ])
    assert.equal((await ask(method, target, { id })).status, 404);
});

test('answers about meshes from a URL, and about webhooks', async (t) => {
  const mesh = shapes.obj(shapes.egg(1));
  const files = { '/egg.obj': mesh, '/open.obj': shapes.obj(shapes.withoutFace(shapes.egg(1))) };
  const { url, requests } = await origin(t, (request, response) => {
    response.statusCode = request.url in files || request.method === 'POST' ? 200 : 404;
    response.end(files[request.url]);
  });
  const listed = ['--fetch-allow', '127.0.0.1', '--webhook-allow', '127.0.0.1'];
  const d = await daemon(t, { args: listed });
  const { ask } = held(d);
  const end = async (reply) => {
    assert.equal(reply.status, 202, reply.bytes.toString());
    let job = reply.json;
    while (job.finished === null) job = (await ask('GET', '/v1/jobs/{job}', { id: job.id, query: { wait: 20 } })).json;
    return job;
  };
  const post = (body, headers) => ask('POST', '/v1/meshes', { body, headers });
  const job = await end(await post({ url: `${url}/egg.obj`, name: 'egg', webhook: { url: `${url}/hook` } }));
  assert.equal(job.state, 'succeeded');
  for (const name of ['open.obj', 'none.obj', '%20'])
    assert.equal((await end(await post({ url: `${url}/${name}` }))).state, 'failed');
  assert.equal((await post({ url: `${url}/egg.obj` }, { prefer: 'wait=60' })).status, 200);
  assert.equal((await post({ url: 'https://10.0.0.1/' })).status, 403);
  assert.equal((await post({ link: url })).status, 422);
  assert.equal((await post({ url: 'nowhere' })).status, 422);
  assert.equal(
    (await ask('POST', '/v1/meshes', { body: '{', headers: { 'content-type': 'application/json' } })).status,
    400,
  );
  const id = job.result.split('/').pop();
  const webhook = { url: 'https://10.0.0.1/' };
  assert.equal((await ask('POST', '/v1/embeddings', { body: { mesh: id, webhook } })).status, 403);
  const both = [{ mesh: id }, { mesh: id }];
  assert.equal((await ask('POST', '/v1/supermeshes', { body: { shapes: both, webhook } })).status, 403);

  await until(() => requests.some((r) => r.method === 'POST'), 'the message');
  const { body, headers } = requests.find((r) => r.method === 'POST');
  const sent = document.webhooks.jobEnded.post;
  validate(sent.requestBody.content['application/json'].schema, JSON.parse(body), 'message');
  for (const { name, schema, example } of sent.parameters) {
    validate(schema, headers[name], name);
    validate(schema, example, name);
  }
  await until(async () => {
    const { json } = await ask('GET', '/v1/jobs/{job}/deliveries', { id: job.id });
    return json.deliveries[0].state === 'delivered';
  }, 'the delivery');
  const again = (more) => ask('POST', '/v1/jobs/{job}/deliveries/{k}/retry', { id: job.id, ...more });
  assert.equal((await again({ k: 1 })).status, 202);
  assert.equal((await again({ k: 2 })).status, 404);
  const unknown = { id: '0'.repeat(32) };
  assert.equal((await ask('GET', '/v1/jobs/{job}/deliveries', unknown)).status, 404);
});

test('answers about embeddings, supermeshes and jobs', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1'] });
  const { ask } = held(d);
  const meshes = [];
  for (const file of ['dog.obj', 'giraffe.off', 'elephant.ply']) meshes.push(await d.mesh(path.join(samples, file)));
  const small = [];
  for (const make of [shapes.egg, shapes.bean]) small.push((await d.upload(shapes.obj(make(2)))).json);
  const landmarks = JSON.parse(await readFile(path.join(samples, 'dog-giraffe.json'), 'utf8')).landmarks;
  const of = (...list) => list.map((mesh) => ({ mesh: mesh.id }));
  const create = (kind, body, more) => ask('POST', `/v1/${kind}`, { body, ...more });
  const end = async (reply) => {
    let job = reply.json;
    while (job.finished === null) job = (await ask('GET', '/v1/jobs/{job}', { id: job.id, query: { wait: 20 } })).json;
    return job;
  };
  const pair = of(...small);
  const three = [0, 1, 2].map((k) => ({ at: [{ point: [1 - k, k, 0] }, { vertex: k }] }));

  const wanted = [
    ['embeddings', { mesh: meshes[0].id }],
    ['embeddings', { mesh: small[0].id, method: 'kernel-sampling', options: { growth: 1.5 } }],
    ['embeddings', { mesh: meshes[1].id, options: { preset: 'quality', energy_weight: 0.5 } }],
    [
      'supermeshes',
      { shapes: of(meshes[0], meshes[1]), landmarks, remesh: { max_triangles: 8000 }, asset: { fit: 'similarity' } },
    ],
    ['supermeshes', { shapes: pair }],
    ['supermeshes', { shapes: pair, align: { method: 'rotate' }, embedding: { options: { preset: 'fast' } } }],
    [
      'supermeshes',
      { shapes: pair, remesh: { method: 'overlay' }, asset: { animation: 'none', normals: false, path: 'rigid' } },
    ],
    ['supermeshes', { shapes: pair, remesh: { method: 'subdivision', tolerance: 0.01 } }],
    ['supermeshes', { shapes: pair, remesh: { method: 'convex-hull' } }],
    [
      'supermeshes',
      {
        shapes: pair,
        landmarks: three,
        align: { method: 'rbf', options: { steps: 5, one_way: true, radius: 0.5, preset: 'fast' } },
      },
    ],
  ];
  for (const [kind, body] of wanted) {
    const sent = await create(kind, body);
    if (sent.json.type === '/problems/unsupported-method') continue; // of a build without it
    assert.equal(sent.status, 202, sent.bytes.toString());
    assert.equal(sent.headers.get('location'), sent.json.url);
    assert.ok(sent.headers.get('retry-after'));
    const job = await end(sent);
    const what = JSON.stringify(body).slice(0, 300);
    const events = await ask('GET', '/v1/jobs/{job}/events', { id: job.id });
    for (const [, data] of events.bytes.toString().matchAll(/^data: (.*)$/gm))
      validate({ $ref: '#/components/schemas/Job' }, JSON.parse(data), `event of ${what}`);
    if (!body.align?.options) assert.equal(job.state, 'succeeded', `${what} ${JSON.stringify(job.problem)}`);
    if (job.state !== 'succeeded') continue;
    const made = await create(kind, body, { query: { wait: 1 } });
    assert.equal(made.status, 200);
    const { id } = made.json;
    assert.equal((await ask('GET', `/v1/${kind}/{id}`, { id })).status, 200);
    assert.equal((await ask('GET', `/v1/${kind}/{id}`, { id, headers: { 'if-none-match': '*' } })).status, 304);
    for (const method of ['GET', 'DELETE'])
      assert.equal((await ask(method, `/v1/${kind}/{id}`, { id, headers: { 'if-match': '"x"' } })).status, 412);
    const files = kind === 'embeddings' ? ['sphere.ply'] : ['asset.glb', 'places', 'spheres/{k}.ply'];
    for (const file of files.map((name) => `/v1/${kind}/{id}/${name}`))
      for (const [headers, status] of [
        [{}, 200],
        [{ range: 'bytes=0-9' }, 206],
        [{ range: 'bytes=999999999-' }, 416],
        [{ 'if-match': '"x"' }, 412],
        [{ 'if-none-match': '*' }, 304],
      ])
        assert.equal((await ask('GET', file, { id, headers })).status, status);
    if (kind === 'supermeshes') {
      for (const [profile, status] of [
        ['meshopt', 200],
        ['draco', 400],
      ])
        assert.equal((await ask('GET', '/v1/supermeshes/{id}/asset.glb', { id, query: { profile } })).status, status);
      assert.equal((await create(kind, made.json.request)).json.id, id, 'the request of the answer names the same');
    }
  }

  const [kept] = wanted[0].slice(1);
  const none = '0'.repeat(64);
  const refusals = [
    ['embeddings', 'not-found', { mesh: none }],
    ['embeddings', 'bad-option', { ...kept, options: { growth: 0 } }],
    ['embeddings', 'unknown-member', { ...kept, colour: 1 }],
    ['embeddings', 'invalid-request', []],
    ['embeddings', 'malformed-json', Buffer.from('{')],
    ['supermeshes', 'invalid-request', { shapes: [] }],
    ['supermeshes', 'not-found', { shapes: of(small[0], { id: none }) }],
    ['supermeshes', 'bad-landmarks', { shapes: pair, align: { method: 'pin' } }],
    ['supermeshes', 'bad-landmarks', { shapes: pair, landmarks: [{ at: [{ vertex: 0 }, { vertex: 999999 }] }] }],
    ['supermeshes', 'bad-landmarks', { shapes: pair, landmarks: [{ at: [{ vertex: 0 }, { vertex: 0.5 }] }] }],
    ['supermeshes', 'unknown-member', { shapes: pair, remesh: { tolerence: 1 } }],
    ['supermeshes', 'unknown-member', { shapes: pair, align: { options: { seed: 3 } } }],
    ['supermeshes', 'malformed-json', Buffer.from('')],
  ];
  for (const [kind, name, body] of refusals)
    assert.equal((await create(kind, body)).json.type, `/problems/${name}`, JSON.stringify(body).slice(0, 200));
  assert.equal((await create('embeddings', kept, { query: { wait: 'long' } })).status, 400);
  // Refused because of its headers: the body is never sent, since the connection closes.
  const large = await bare(d, 'POST', '/v1/embeddings', { 'content-length': 1_100_000 });
  assert.equal(hold(large, 'POST', '/v1/embeddings').json.type, '/problems/too-large');
  const clash = await create('supermeshes', {
    shapes: pair,
    landmarks: [{ at: [{ vertex: 0 }, { vertex: 0 }] }, { at: [{ vertex: 0 }, { vertex: 1 }] }],
  });
  const failed = clash.status === 202 ? await end(clash) : { problem: clash.json };
  assert.equal(failed.problem.type, '/problems/bad-landmarks');

  // One worker: the second waits, and holds its mesh, until it is cancelled.
  const long = await create('supermeshes', { shapes: of(...meshes), embedding: endless, asset: { colors: true } });
  const queued = await create('embeddings', {
    mesh: meshes[2].id,
    method: 'kernel-sampling',
    options: { ...endless.options, growth: 1.02 },
  });
  assert.equal((await ask('DELETE', '/v1/meshes/{id}', { id: meshes[2].id })).status, 409);
  assert.equal((await ask('GET', '/v1/jobs', { query: { limit: 2 } })).json.jobs.length, 2);
  for (const { json } of [queued, long])
    assert.equal((await ask('DELETE', '/v1/jobs/{job}', { id: json.id })).status, 200);
  assert.equal((await ask('GET', '/v1/jobs', { query: { state: 'cancelled' } })).status, 200);
  assert.equal((await ask('GET', '/v1/jobs', { query: { state: 'lost' } })).status, 400);
  const done = (await ask('GET', '/v1/jobs', { query: { state: 'succeeded' } })).json.jobs[0];
  assert.equal((await ask('DELETE', '/v1/jobs/{job}', { id: done.id })).status, 409);
  for (const [method, target] of [
    ['GET', '/v1/jobs/{job}'],
    ['DELETE', '/v1/jobs/{job}'],
    ['GET', '/v1/jobs/{job}/events'],
  ])
    assert.equal((await ask(method, target, { id: '0'.repeat(32) })).status, 404);
  for (const kind of ['embeddings', 'supermeshes']) {
    const { json } = await ask('GET', `/v1/${kind}`, { query: { limit: 2 } });
    assert.equal(json[kind].length, 2);
    assert.equal((await ask('DELETE', `/v1/${kind}/{id}`, { id: json[kind][0].id })).status, 204);
    for (const method of ['GET', 'DELETE'])
      assert.equal((await ask(method, `/v1/${kind}/{id}`, { id: json[kind][0].id })).status, 404);
  }
});

test('answers about landmarks and morphs by URL', async (t) => {
  const d = await daemon(t);
  const { ask, upload } = held(d);
  const ids = [];
  for (const shape of [shapes.egg(2), shapes.bean(2)]) ids.push((await upload(shapes.obj(shape))).json.id);
  const at = [{ vertex: 0 }, { vertex: 0 }];
  const body = { landmarks: [{ at }, { at: [{ point: [0, 0, 1] }, { triangle: 3, barycentric: [1, 0, 0] }] }] };
  const { id } = (await ask('POST', '/v1/landmarks', { body })).json;
  assert.equal((await ask('POST', '/v1/landmarks', { body })).status, 200);
  const { headers } = await ask('GET', '/v1/landmarks/{id}', { id });
  const etag = headers.get('etag');
  assert.equal((await ask('GET', '/v1/landmarks/{id}', { id, headers: { 'if-none-match': etag } })).status, 304);
  assert.equal((await ask('GET', '/v1/landmarks', { query: { limit: 1 } })).json.landmarks.length, 1);
  for (const broken of [[], { landmark: [] }, [{ at: [] }]])
    assert.equal((await ask('POST', '/v1/landmarks', { body: broken })).status, 422);
  const shared = { shapes: ids.join(), align: 'rotate', tolerance: 0.05 };
  const morph = (query, more) => ask('GET', '/v1/morph.glb', { query: { ...shared, ...query }, ...more });
  assert.equal((await morph({ wait: 0 })).status, 503);
  const made = await morph();
  assert.equal(made.status, 200);
  for (const [more, status] of [
    [{ range: 'bytes=0-9' }, 206],
    [{ 'if-none-match': made.headers.get('etag') }, 304],
    [{ 'if-match': '"other"' }, 412],
    [{ range: 'bytes=999999999-' }, 416],
  ])
    assert.equal((await morph({}, { headers: more })).status, status);
  for (const [query, status] of [
    [{ shapes: ids[0] }, 400],
    [{ shapes: `${ids[0]},${'0'.repeat(64)}` }, 404],
    [{ landmarks: '0'.repeat(64) }, 404],
    [{ profile: 'quantized' }, 200],
    [{ profile: 'zip' }, 400],
    [{ tolerance: 7 }, 422],
    [{ remesh: 'none' }, 422],
  ])
    assert.equal((await morph(query)).status, status);
  assert.equal((await ask('DELETE', '/v1/landmarks/{id}', { id })).status, 204);
  assert.equal((await ask('DELETE', '/v1/landmarks/{id}', { id })).status, 404);
});

test('answers about the daemon itself', async (t) => {
  const d = await daemon(t);
  const { ask } = held(d);
  for (const target of ['/livez', '/readyz', '/metrics', '/docs', '/', '/v1/usage'])
    assert.equal((await ask('GET', target)).status, 200);
  assert.deepEqual((await ask('GET', '/openapi.json')).json, document);
  assert.equal((await ask('GET', '/v1/usage', { query: { limit: 0 } })).status, 400);
  assert.ok('workers' in (await ask('GET', '/readyz', { query: { verbose: '' } })).json);
  const refused = hold(await bare(d, 'GET', '/livez', { 'content-length': 2 }, 'ab'), 'GET', '/livez');
  assert.equal(refused.json.type, '/problems/bad-request');
});

test('a full disk is answered as described', async (t) => {
  const d = await daemon(t, { args: ['--disk-reserve', '65536G'] });
  assert.equal((await held(d).upload(shapes.tetrahedron)).status, 507);
});

test('answers to callers without the right token', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on'] });
  await d.stop();
  const make = async (name, scope, ...more) => {
    const { stdout } = await promisify(execFile)(binaries.daemon, [
      'token',
      'add',
      name,
      '--scope',
      scope,
      ...more,
      '--data',
      d.data,
    ]);
    return { authorization: `Bearer ${stdout.trim()}` };
  };
  const read = await make('read', 'read');
  const write = await make('write', 'write', '--quota', '9');
  await d.start();
  const { ask } = held(d);
  for (const [target, item] of Object.entries(document.paths))
    for (const verb of VERBS.filter((v) => item[v])) {
      const id = target.includes('{job}') ? '0'.repeat(32) : '0'.repeat(64);
      const body = item[verb].requestBody ? Buffer.from('{}') : undefined;
      const guarded = item[verb].security.length > 0;
      const scope = /scope (\w+)/.exec(item[verb].description)?.[1];
      assert.equal((await ask(verb.toUpperCase(), target, { id, body })).status === 401, guarded, `${verb} ${target}`);
      for (const [name, headers] of [
        ['read', read],
        ['write', write],
      ]) {
        const reply = await ask(verb.toUpperCase(), target, { id, body, headers });
        assert.equal(
          reply.status === 403,
          guarded && scope !== undefined && scope !== name,
          `${verb} ${target} ${name}`,
        );
      }
    }
  const over = await ask('POST', '/v1/meshes', { body: Buffer.from(shapes.tetrahedron), headers: write });
  assert.equal(over.json.type, '/problems/quota-exceeded');
});

test('every status below 400 was seen above', () => {
  // The events of a job answer 204 only after the daemon has forgotten the job.
  // 307 needs objects in S3: s3.test.mjs.
  const rare = [
    'GET /v1/jobs/{job}/events 204',
    'GET / 304',
    'GET /v1/supermeshes/{id}/asset.glb 307',
    'GET /v1/morph.glb 307',
  ];
  for (const [target, item] of Object.entries(document.paths))
    for (const verb of VERBS.filter((v) => item[v]))
      for (const status of Object.keys(item[verb].responses).filter((s) => s < 400)) {
        const answer = `${verb.toUpperCase()} ${target} ${status}`;
        assert.ok(seen.has(answer) || rare.includes(answer), `${answer} was not tried`);
      }
});
