import { test } from 'node:test';
import assert from 'node:assert/strict';
import { mkdtemp, writeFile, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import orbmorph, { CorsError, Orbmorph, ProblemError, UnreachableError } from '../src/index.js';
import { readEvents } from '../src/events.js';
import { startDaemon } from './support/daemon.mjs';

const using = (options, body) => async (t) => {
  const daemon = await startDaemon(options);
  t.after(() => daemon.stop());
  await body(daemon, new Orbmorph({ server: daemon.url }), t);
};
const bytes = (text) => new TextEncoder().encode(text);

test(
  'morph uploads, merges, waits and fetches',
  using({}, async (daemon) => {
    const steps = [];
    const landmarks = [{ name: 'nose', at: [{ vertex: 1 }, { vertex: 2 }] }];
    const result = await orbmorph.morph([new Blob(['a']), { source: bytes('bb'), name: 'cow' }], {
      server: daemon.url,
      landmarks,
      remesh: { tolerance: 0.01 },
      repair: ['safe', 'fill_holes'],
      onProgress: (step) => steps.push(step),
    });
    assert.deepEqual(
      daemon.seen.uploads.map((u) => [u.name, u.repair, u.bytes]),
      [
        ['mesh', 'safe,fill_holes', 1],
        ['cow', 'safe,fill_holes', 2],
      ],
    );
    assert.deepEqual(result.request.landmarks, landmarks);
    assert.equal(result.request.shapes[1].name, 'cow');
    assert.equal(result.request.align, undefined);
    assert.equal(result.meshes.length, 2);
    assert.equal(result.assetUrl, `${daemon.url}/v1/supermeshes/1/asset.glb`);
    assert.equal(Buffer.from(await result.glb()).toString(), 'glTF');
    assert.ok(steps.some((s) => s.step === 'upload' && s.progress === 1));
    const merging = steps.filter((s) => s.step === 'merge').map((s) => s.progress);
    assert.deepEqual(merging, [...merging].sort());
    assert.equal(merging.at(-1), 1);
  }),
);

test(
  'in Node, a path is read and names the mesh',
  using({}, async (daemon, client) => {
    const folder = await mkdtemp(join(tmpdir(), 'orbmorph-js-'));
    await writeFile(join(folder, 'horse.obj'), 'v 0 0 0');
    const mesh = await client.uploadMesh(join(folder, 'horse.obj'));
    await rm(folder, { recursive: true });
    assert.equal(mesh.name, 'horse');
    assert.equal(daemon.seen.uploads[0].bytes, 7);
  }),
);

test(
  'upload progress reaches the full size',
  using({}, async (daemon, client) => {
    const seen = [];
    await client.uploadMesh(new Uint8Array(700_000), {
      name: 'big',
      onProgress: (sent, total) => seen.push([sent, total]),
    });
    assert.ok(seen.length >= 3);
    assert.deepEqual(seen.at(-1), [700_000, 700_000]);
    assert.equal(daemon.seen.uploads[0].bytes, 700_000);
  }),
);

test(
  'a refused request throws a ProblemError with its details',
  using({}, async (_daemon, client) => {
    await assert.rejects(client.uploadMesh(bytes('open')), (error) => {
      assert.ok(error instanceof ProblemError);
      assert.equal(error.kind, 'not-closed');
      assert.equal(error.status, 422);
      assert.deepEqual(error.problem.boundary_edges, [[0, 1]]);
      assert.equal(error.message, 'It is not-closed.');
      return true;
    });
  }),
);

test(
  'a failed job throws its problem',
  using({}, async (_daemon, client) => {
    await assert.rejects(
      client.merge({ shapes: [], fail: true }),
      (error) => error instanceof ProblemError && error.kind === 'bad-landmarks',
    );
  }),
);

test(
  'a broken event stream resumes after the last event',
  using({ breakStream: true, jobSteps: 4 }, async (daemon, client) => {
    const result = await client.merge({ shapes: [] });
    assert.equal(result.id, '1');
    assert.equal(daemon.seen.lastEventIds[0], undefined);
    assert.equal(daemon.seen.lastEventIds[1], '1');
  }),
);

test(
  'the client polls if there are no events',
  using({ noEvents: true }, async (daemon, client) => {
    assert.equal((await client.merge({ shapes: [] })).id, '1');
    assert.ok(daemon.seen.requests.some((request) => request.query === '?wait=20'));
    await assert.rejects(client.watchJob({ id: '77' }), ProblemError);
  }),
);

test(
  'abort cancels the job',
  using({ jobSteps: 1e6 }, async (daemon, client) => {
    const abort = new AbortController();
    const running = client.merge(
      { shapes: [] },
      { signal: abort.signal, onProgress: () => setTimeout(() => abort.abort(), 60) },
    );
    await assert.rejects(running, { name: 'AbortError' });
    assert.equal(daemon.jobs.get('1').state, 'cancelled');
  }),
);

test(
  'an abort before the answer to the request cancels the job that the answer names',
  using({ jobSteps: 1e6 }, async (daemon) => {
    const abort = new AbortController();
    const fetch = async (url, init) => {
      const answer = await globalThis.fetch(url, init);
      if (init?.method === 'POST') abort.abort();
      return answer;
    };
    const client = new Orbmorph({ server: daemon.url, fetch });
    await assert.rejects(client.merge({ shapes: [] }, { signal: abort.signal }), { name: 'AbortError' });
    assert.equal(daemon.jobs.get('1').state, 'cancelled');
  }),
);

test('an abort does not wait long for an answer that never comes', async () => {
  const abort = new AbortController();
  const fetch = (_url, { signal }) =>
    new Promise((_resolve, reject) => {
      signal.addEventListener('abort', () => reject(signal.reason));
      abort.abort();
    });
  const client = new Orbmorph({ server: 'http://silent', fetch });
  const since = Date.now();
  await assert.rejects(client.merge({ shapes: [] }, { signal: abort.signal }), { name: 'AbortError' });
  assert.ok(Date.now() - since < 60_000);
});

test(
  'abort with detach keeps the job running',
  using({ jobSteps: 1e6 }, async (daemon, client) => {
    const abort = new AbortController();
    await assert.rejects(
      client.merge(
        { shapes: [] },
        { signal: abort.signal, detach: true, onProgress: ({ state }) => state === 'running' && abort.abort() },
      ),
      { name: 'AbortError' },
    );
    assert.equal(daemon.jobs.get('1').state, 'running');
  }),
);

test(
  'a list continues on its next pages',
  using({}, async (_daemon, client) => {
    for (const text of ['a', 'b', 'c']) await client.uploadMesh(bytes(text), { name: text });
    const names = [];
    for await (const mesh of client.list('meshes')) names.push(mesh.name);
    assert.deepEqual(names, ['a', 'b', 'c']);
  }),
);

test(
  'every request carries the token',
  using({ token: 'secret' }, async (daemon) => {
    const client = new Orbmorph({ server: daemon.url, token: 'secret' });
    assert.equal((await client.uploadMesh(bytes('a'))).name, 'mesh');
    await assert.rejects(new Orbmorph({ server: daemon.url }).getMesh('x'), (error) => error.status === 401);
  }),
);

test('an unreachable daemon throws UnreachableError', async () => {
  await assert.rejects(new Orbmorph({ server: 'http://127.0.0.1:9' }).getMesh('x'), UnreachableError);
});

test('events: line ends, comments and multi-line data, split anywhere', async () => {
  const text = ': hello\r\n\r\nid: 7\r\nevent: progress\ndata: a\ndata:b\n\ndata: {"ü":1}\n\n';
  const all = new TextEncoder().encode(text);
  for (const size of [1, 2, 3, 7, 100]) {
    const body = new ReadableStream({
      start(controller) {
        for (let i = 0; i < all.length; i += size) controller.enqueue(all.slice(i, i + size));
        controller.close();
      },
    });
    const events = [];
    for await (const event of readEvents(body)) events.push(event);
    assert.deepEqual(events, [
      { event: 'progress', data: 'a\nb', id: '7' },
      { event: 'message', data: '{"ü":1}', id: '7' },
    ]);
  }
});

/** Answers a list of [status, headers, body] one after another, and counts. */
function answering(list) {
  const asked = [];
  const fetch = async (url, init) => {
    const [status, headers, body = {}] = list[Math.min(asked.length, list.length - 1)];
    asked.push({ url, init });
    return new Response(JSON.stringify(body), { status, headers });
  };
  return { asked, fetch };
}
const busy = (status, name, headers = {}) => [status, headers, { type: `/problems/${name}`, status, detail: 'Busy.' }];

test('what the daemon is too busy for is asked for again, as often and as late as it says', async () => {
  const { asked, fetch } = answering([
    busy(503, 'unavailable', { 'Retry-After': '0' }),
    busy(429, 'queue-full', { 'Retry-After': '1' }),
    [200, {}, { id: 'x' }],
  ]);
  const client = new Orbmorph({ server: 'http://busy', fetch });
  const began = Date.now();
  assert.deepEqual(await client.getMesh('x'), { id: 'x' });
  assert.equal(asked.length, 3);
  assert.ok(Date.now() - began >= 1200, 'a quarter of a second, then the second that the daemon asked for');

  const full = answering([busy(503, 'unavailable', { 'X-Request-Id': 'abc', 'Retry-After': '0' })]);
  const error = await new Orbmorph({ server: 'http://busy', fetch: full.fetch, retries: 1 })
    .getMesh('x')
    .catch((e) => e);
  assert.ok(error instanceof ProblemError);
  assert.deepEqual([full.asked.length, error.retryAfter, error.requestId], [2, 0, 'abc']);

  for (const once of [
    busy(429, 'quota-exceeded', { 'Retry-After': '1' }),
    busy(503, 'not-ready', { 'Retry-After': '3600' }),
    busy(500, 'internal'),
    busy(404, 'not-found'),
  ]) {
    const { asked: times, fetch: refusing } = answering([once]);
    await assert.rejects(new Orbmorph({ server: 'http://busy', fetch: refusing }).getMesh('x'), ProblemError);
    assert.equal(times.length, 1, once[2].type);
  }
  const stop = new AbortController();
  const never = answering([busy(503, 'unavailable', { 'Retry-After': '30' })]);
  const waiting = new Orbmorph({ server: 'http://busy', fetch: never.fetch }).getMesh('x', { signal: stop.signal });
  setTimeout(() => stop.abort(), 50);
  await assert.rejects(waiting, { name: 'AbortError' });
});

test('an upload is repeated as well', async () => {
  const { asked, fetch } = answering([busy(503, 'unavailable', { 'Retry-After': '0' }), [201, {}, { id: 'x' }]]);
  const mesh = await new Orbmorph({ server: 'http://busy', fetch }).uploadMesh(bytes('v 0 0 0'));
  assert.deepEqual([mesh.id, asked.length], ['x', 2]);
});

test('a daemon that does not let the page in is told apart from one that is unreachable', async (t) => {
  t.after(() => delete globalThis.location);
  globalThis.location = { origin: 'https://page.example', protocol: 'https:' };
  const failing = (livez) => async (url, init) => {
    if (livez && url.endsWith('/livez') && init.mode === 'no-cors') return new Response('', { status: 200 });
    throw new TypeError('Failed to fetch');
  };
  const there = await new Orbmorph({ server: 'http://there', fetch: failing(true) }).getMesh('x').catch((e) => e);
  assert.ok(there instanceof CorsError && there instanceof UnreachableError);
  assert.match(there.message, /--cors https:\/\/page\.example/);
  const away = await new Orbmorph({ server: 'http://away', fetch: failing(false) }).getMesh('x').catch((e) => e);
  assert.ok(away instanceof UnreachableError && !(away instanceof CorsError));
});

test(
  'an asset in a profile',
  using({}, async (daemon, client) => {
    const text = async (options) => Buffer.from(await client.asset('1', options)).toString();
    assert.deepEqual([await text(), await text({ profile: 'meshopt' })], ['glTF', 'glTF?profile=meshopt']);
    const url = client.morphUrl({ shapes: ['a', 'b'], profile: 'quantized' });
    assert.equal(url, `${daemon.url}/v1/morph.glb?shapes=a,b&profile=quantized`);
  }),
);

test('the URL of a recipe', () => {
  const url = new Orbmorph({ server: 'http://x' }).morphUrl({
    shapes: ['a', 'b'],
    names: ['x & y', 'ü'],
    tolerance: 0.01,
    fit: undefined,
  });
  assert.equal(url, 'http://x/v1/morph.glb?shapes=a,b&names=x%20%26%20y,%C3%BC&tolerance=0.01');
});
