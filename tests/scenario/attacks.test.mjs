// Attacks on the service while another tenant uploads small meshes and has them embedded: that tenant is answered within
// 2 s, all processes together stay within job-memory and 300 MB, the attack ends, and it costs no more time than
// docs/limits.md allows for its bytes.
//
// ORB_ATTACKS=all makes the files larger and repeats each attack from several connections at once.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import net from 'node:net';
import test from 'node:test';
import { promisify } from 'node:util';
import { gzipSync } from 'node:zlib';
import * as attacks from './support/attacks.mjs';
import { binaries, daemon, endless, patience, slow, until } from './support/daemon.mjs';
import { busy, megabytes, ownMegabytes, ownSeconds, workers, workSeconds } from './support/processes.mjs';
import { wideDraco } from './support/draco.mjs';
import * as shapes from './support/shapes.mjs';

const all = process.env.ORB_ATTACKS === 'all';
const JOB_MEMORY = 128;
const SECONDS_A_BYTE = 2e-6; // docs/limits.md
const SECONDS_OF_LISTING = 4; // the loops of 2,400 handles: docs/limits.md
const SECONDS_OF_OTHER = 0.1; // an upload and an embedding of the other tenant
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

async function bearer(d, name) {
  const { stdout } = await promisify(execFile)(binaries.daemon, [
    'token',
    'add',
    name,
    '--scope',
    'read,write',
    '--data',
    d.data,
  ]);
  return { authorization: `Bearer ${stdout.trim()}` };
}

let made = 0;
/** The work of the other tenant: an upload and its embedding. Returns the milliseconds until both exist. */
async function small(d, headers) {
  const began = performance.now();
  const n = ++made;
  const text = shapes.obj(shapes.ball(1, ([x, y, z]) => [x * (1 + 0.1 * Math.sin(n)), y, z + 0.001 * n]));
  const mesh = await d.post('/v1/meshes', Buffer.from(text), { headers });
  assert.equal(mesh.status, 201, mesh.bytes.toString());
  const reply = await d.post('/v1/embeddings', { mesh: mesh.json.id }, { headers: { ...headers, prefer: 'wait=20' } });
  assert.ok([200, 201, 202].includes(reply.status), reply.bytes.toString());
  if (reply.status === 202) {
    const job = await d.get(reply.json.url, { headers, query: { wait: 20 } });
    assert.equal(job.json.state ?? 'succeeded', 'succeeded', job.bytes.toString());
  }
  return performance.now() - began;
}

/** Runs an attack beside the other tenant. attack: resolves when it has ended; to the bytes that readers got. memory:
 * what counts, see megabytes(). */
async function beside(t, d, headers, attack, memory = []) {
  let over = false;
  let most = 0;
  const times = [];
  const [before, atFirst] = [workSeconds(d), busy()];
  const watch = (async () => {
    while (!over) {
      most = Math.max(most, megabytes(d, ...memory));
      await sleep(20);
    }
  })();
  const other = (async () => {
    do {
      times.push(await small(d, headers));
      await sleep(100);
    } while (!over);
  })();
  const began = performance.now();
  let bytes;
  try {
    bytes = await attack();
  } finally {
    over = true;
    await other;
    await watch;
  }
  const seconds = (performance.now() - began) / 1000;
  const worked = workSeconds(d) - before;
  const slowdown = Math.max(atFirst, busy());
  const slowest = Math.max(...times);
  t.diagnostic(
    `${seconds.toFixed(1)} s, ${worked.toFixed(2)} s of processor time for ${bytes} bytes; ${most.toFixed(0)} MB; the ` +
      `other tenant waited ${slowest.toFixed(0)} ms at most, ${times.length} times; a thread alone was slowed down by ${slowdown.toFixed(1)}`,
  );
  assert.ok(slowest < 2000 * slowdown * patience * (slow ? 10 : 1), `the other tenant waited ${slowest} ms`);
  if (!slow) {
    assert.ok(most <= JOB_MEMORY + 300, `${most} MB`);
    const allowed = SECONDS_A_BYTE * bytes + SECONDS_OF_OTHER * times.length + 0.5;
    assert.ok(worked <= allowed * patience, `${worked} s of processor time, ${allowed} were allowed`);
  }
}

async function start(t, ...args) {
  const d = await daemon(t, {
    args: ['--auth', 'on', '--workers', '2', '--job-memory', `${JOB_MEMORY}M`, '--check-seconds', '30', ...args],
  });
  return { d, evil: await bearer(d, 'evil'), other: await bearer(d, 'other') };
}

const files = [
  ['accessors that overlap, compressed', 'no-memory', () => attacks.overlappingAccessors((all ? 64 : 16) << 20), true],
  ['positions that collide', 'not-closed', () => attacks.collidingPositions(all ? 40_000 : 16_000)],
  [
    'names of materials that collide',
    all ? 'too-large' : 'degenerate',
    () => attacks.collidingNames(all ? 180_000 : 60_000),
  ],
  ['two thousand primitives on one accessor', 'too-large', () => attacks.sharedIndices()],
  [
    'a polygon of millions of corners',
    all ? 'no-memory' : 'not-manifold',
    () => attacks.hugePolygon(all ? 5_000_000 : 800_000),
  ],
  [
    'primitives that have one Draco mesh with wide attributes',
    'too-large',
    async () => attacks.sharedDraco(await wideDraco(10_000, 120, 4)),
  ],
  ['a Draco mesh of 2^27 faces that break edges', 'too-large', () => attacks.sharedDraco(attacks.manyFaces(1), 1)],
  ['a Draco mesh of 2^27 faces that are listed', 'too-large', () => attacks.sharedDraco(attacks.manyFaces(0), 1)],
  [
    'a Draco mesh with a table of millions of symbols',
    slow ? 'malformed-mesh' : 'no-memory', // sanitizers have an operator new of their own, which counts nothing
    () => attacks.sharedDraco(attacks.symbolTable(1 << 18), 1),
  ],
  ['a mesh of a long name that many nodes show', 'too-large', () => attacks.longName()],
];
test('files that are made to cost much', async (t) => {
  const { d, evil, other } = await start(t);
  for (const [name, refused, make, packed] of files) {
    await t.test(name, async (t) => {
      const file = await make();
      const body = packed ? gzipSync(file) : file;
      const headers = { ...evil, ...(packed && { 'content-encoding': 'gzip' }) };
      const upload = async () => {
        const reply = await d.post('/v1/meshes', body, { headers });
        assert.equal(reply.json?.type, `/problems/${refused}`, `${reply.status} ${reply.bytes}`);
      };
      const times = all ? 4 : 2;
      await beside(t, d, other, async () => {
        await Promise.all(Array.from({ length: times }, upload));
        return times * file.length;
      });
    });
  }
});

test('the loops of a refusal are listed in bounded time where vertices have many edges', async (t) => {
  const { d, evil, other } = await start(t);
  const file = attacks.soup();
  const query = { repair: 'split_nonmanifold,fill_holes,largest_component' };
  await beside(t, d, other, async () => {
    const reply = await d.post('/v1/meshes', file, { headers: evil, query });
    assert.equal(reply.json?.type, '/problems/not-genus-zero', `${reply.status} ${reply.bytes}`);
    assert.ok(reply.json.loops.length > 0);
    return file.length + SECONDS_OF_LISTING / SECONDS_A_BYTE;
  });
});

test('the check of such a file ends with its client, and with the service', async (t) => {
  const { d, evil } = await start(t);
  const upload = (n, signal) =>
    d.post('/v1/meshes', attacks.sharedIndices(2 << 20, 2000 + n), { headers: evil, signal }).catch((error) => error);
  const client = new AbortController();
  const asked = [0, 1].map((n) => upload(n, client.signal));
  await sleep(300);
  client.abort();
  await Promise.all(asked);
  await sleep(2000 * patience);
  const spent = () => workSeconds(d) + ownSeconds(d);
  const before = spent();
  await sleep(3000);
  assert.ok(spent() - before < 0.3, `${spent() - before} s of processor time after the clients were gone`);
  const last = [2, 3].map((n) => upload(n));
  await sleep(300);
  const told = performance.now();
  d.child.kill('SIGTERM');
  await Promise.all(last);
  assert.equal((await d.exited).code, 0, d.log);
  const seconds = (performance.now() - told) / 1000;
  assert.ok(seconds < 5 * patience * busy(), `it took ${seconds} s to stop`);
});

test('a large file of few triangles in two jobs at once', async (t) => {
  const { d, evil, other } = await start(t);
  const file = attacks.padded(all ? 480 : 240, shapes.obj(shapes.ball(2)));
  const headers = { ...evil, 'content-encoding': 'gzip' };
  const mesh = await d.post('/v1/meshes', gzipSync(file, { level: 1 }), { headers });
  assert.equal(mesh.status, 201, mesh.bytes.toString());
  const embed = async (method) => {
    const reply = await d.post('/v1/embeddings', { mesh: mesh.json.id, method }, { headers: evil });
    assert.equal(reply.status, 202, reply.bytes.toString());
    const job = await d.get(reply.json.url, { headers: evil, query: { wait: 60 } });
    assert.equal(job.json.state ?? 'succeeded', 'succeeded', job.bytes.toString());
  };
  // Pages of files do not count: the kernel drops them when memory is short.
  const memory = ['_Anon', '_Shmem'];
  await beside(
    t,
    d,
    other,
    async () => {
      await Promise.all(['newton', 'kernel-sampling'].map(embed));
      return 2 * file.length;
    },
    memory,
  );
});

test('jobs without an end', async (t) => {
  const { d, evil, other } = await start(t, '--job-seconds', '3');
  await beside(t, d, other, async () => {
    const jobs = [];
    for (let i = 0; i < 6; i++) {
      const text = shapes.binaryPly(shapes.ball(slow ? 5 : 6, ([x, y, z]) => [x * (1 + 0.01 * i), y, z]));
      const mesh = await d.post('/v1/meshes', Buffer.from(text), { headers: evil });
      assert.equal(mesh.status, 201, mesh.bytes.toString());
      const job = await d.post('/v1/embeddings', { mesh: mesh.json.id, ...endless }, { headers: evil });
      assert.equal(job.status, 202, job.bytes.toString());
      jobs.push(job.json);
    }
    const states = async () =>
      (await Promise.all(jobs.map((job) => d.get(job.url, { headers: evil })))).map(({ json }) => json.state);
    await until(
      async () => (await states()).filter((state) => state === 'failed').length >= (all ? 6 : 2),
      'the ends',
      60,
    );
    for (const job of jobs) await d.delete(job.url, { headers: evil });
    return Number.POSITIVE_INFINITY; // jobs are bounded by their seconds, not by bytes
  });
});

test('jobs whose processes die', async (t) => {
  const { d, evil, other } = await start(t);
  const text = shapes.binaryPly(shapes.ball(slow ? 5 : 6));
  const mesh = await d.post('/v1/meshes', Buffer.from(text), { headers: evil });
  const submit = () => d.post('/v1/embeddings', { mesh: mesh.json.id, ...endless }, { headers: evil });
  const job = (await submit()).json;
  const now = async () => (await d.get(job.url, { headers: evil })).json;
  let end;
  let pid;
  await beside(t, d, other, async () => {
    for (let death = 1; death <= 3; death++) {
      await until(async () => (await now()).attempt === death && (await now()).stage === 'embed', 'it runs', 60);
      // The processes of the other tenant end within a second: the process that stays is this job's.
      const there = workers(d);
      await sleep(1000);
      [pid] = workers(d).filter((each) => there.includes(each));
      process.kill(pid, 'SIGSEGV');
    }
    await until(async () => (end = await now()).finished, 'it fails', 60);
    return Number.POSITIVE_INFINITY;
  });
  assert.equal(end.problem.type, '/problems/job-crashed');
  assert.equal((await submit()).status, 500, 'the same work is refused');
});

/** Connections that send bodies of JSON, with as many values as fit or as are read, and stop before the end. */
async function stalledBodies(d, headers, count) {
  const { hostname, port } = new URL(d.url);
  const bodies = [`[${'1,'.repeat(499_000)}`, `[${'1.23456,'.repeat(124_750)}`];
  const head =
    `POST /v1/supermeshes HTTP/1.1\r\nHost: localhost\r\nAuthorization: ${headers.authorization}\r\n` +
    `Content-Type: application/json\r\nContent-Length: ${bodies[0].length + 2}\r\n\r\n`;
  const bytes = bodies.map((body) => Buffer.from(head + body));
  const all = [];
  for (let i = 0; i < count; i++) {
    const one = { socket: net.connect(Number(port), hostname), answer: '' };
    one.socket.on('error', () => {}).on('data', (chunk) => (one.answer += chunk.toString('latin1')));
    await new Promise((resolve) => one.socket.write(bytes[i % 2], resolve));
    all.push(one);
  }
  return all;
}

test('bodies of JSON that stall, and end all at once, beside jobs', async (t) => {
  const { d, evil, other } = await start(t, '--limits', 'off', '--min-rate', '0', '--idle-seconds', '300');
  await small(d, other);
  const before = ownMegabytes(d);
  await beside(t, d, other, async () => {
    for (let i = 0; i < 2; i++) {
      const text = shapes.binaryPly(shapes.ball(slow ? 5 : 6, ([x, y, z]) => [x * (1 + 0.01 * i), y, z]));
      const mesh = await d.post('/v1/meshes', Buffer.from(text), { headers: evil });
      const job = await d.post('/v1/embeddings', { mesh: mesh.json.id, ...endless }, { headers: evil });
      assert.equal(job.status, 202, job.bytes.toString());
    }
    const bodies = await stalledBodies(d, evil, all ? 600 : 300);
    const name = Buffer.alloc(300_000, 'x');
    const large = await d.post('/v1/landmarks', `{"landmarks":"${name}"}`, {
      headers: { ...other, 'content-type': 'application/json' },
    });
    assert.equal(large.status, 422, `the body of another tenant is read: ${large.bytes.toString().slice(0, 300)}`);
    for (const { socket } of bodies) socket.write('1]');
    await until(() => bodies.every(({ answer }) => answer.includes('\r\n\r\n')), 'the answers', 60);
    const refused = bodies.filter(({ answer }) => answer.startsWith('HTTP/1.1 503 '));
    for (const { answer } of refused) assert.match(answer, /\r\nRetry-After: \d+\r\n/);
    for (const { answer } of bodies) assert.match(answer, /^HTTP\/1\.1 (503|413|422) /, answer.slice(0, 300));
    assert.ok(refused.length > bodies.length / 2 && refused.length < bodies.length, `${refused.length} refused`);
    for (const { socket } of bodies) socket.destroy();
    return Number.POSITIVE_INFINITY; // jobs are bounded by their seconds, not by bytes
  });
  // A heap keeps at most what is free at its end, and pieces between what lives.
  if (!slow) await until(() => ownMegabytes(d) < before + 25, 'the memory goes back to the system', 10);
});

/** Opens connections that send these bytes and then nothing. */
async function stalled(d, bytes, count) {
  const { hostname, port } = new URL(d.url);
  const sockets = [];
  for (let i = 0; i < count; i++) {
    const socket = net.connect({ port: Number(port), host: hostname });
    socket.on('error', () => {});
    sockets.push(socket);
    const sent = new Promise((resolve) => socket.write(bytes, resolve));
    if (i % 20 === 0) await sent;
  }
  return sockets;
}

/** What a socket receives until it is closed. */
const answerOf = (socket) =>
  new Promise((resolve) => {
    let text = '';
    socket.on('data', (chunk) => (text += chunk.toString('latin1')));
    socket.on('close', () => resolve(text));
  });

test('thousands of small bodies that stall, then of long targets', { skip: slow }, async (t) => {
  const [connections, budget, pool] = [3000, 4, 16 / 1024]; // megabytes
  const { d, evil, other } = await start(
    t,
    ...['--limits', 'off', '--min-rate', '0', '--idle-seconds', '300', '--header-seconds', '300'],
    ...['--request-memory', `${budget}M`, '--encoded-bytes', '0', '--decode-memory', '1M'],
  );
  await small(d, other);
  const before = ownMegabytes(d);
  const head = `Host: localhost\r\nAuthorization: ${evil.authorization}\r\nContent-Type: application/json\r\n`;
  const body = `[${'1,'.repeat(5999)}1`; // lacks 5 bytes
  const floods = [
    [`POST /v1/supermeshes HTTP/1.1\r\n${head}Content-Length: ${body.length + 5}\r\n\r\n${body}`, ',1,1]'],
    [`POST /v1/supermeshes?${'x'.repeat(10_000)} HTTP/1.1\r\n${head}X-More: `, ''],
  ];
  for (const [bytes, rest] of floods) {
    await beside(t, d, other, async () => {
      const sockets = await stalled(d, Buffer.from(bytes), connections);
      const most = connections * (pool + 3 / 1024) + budget + 8;
      const used = ownMegabytes(d) - before;
      t.diagnostic(`${used.toFixed(0)} MB more for ${connections} connections; ${most.toFixed(0)} are allowed`);
      assert.ok(used < most, `${used} MB`);
      const last = sockets.slice(-20);
      const answers = last.map(answerOf);
      if (rest) for (const socket of last) socket.write(rest);
      for (const answer of await Promise.all(answers)) {
        assert.match(answer, /^HTTP\/1\.1 503 /, answer.slice(0, 300));
        assert.match(answer, /\r\nRetry-After: \d+\r\n/);
      }
      for (const socket of sockets) socket.destroy();
      return Number.POSITIVE_INFINITY; // nothing is read
    });
    await until(() => ownMegabytes(d) < before + 15, 'the memory goes back to the system', 10);
  }
});

test('requests that two servers could understand differently', async (t) => {
  const { d, other } = await start(t);
  const { hostname, port } = new URL(d.url);
  const raw = (bytes) =>
    new Promise((resolve) => {
      const socket = net.connect(Number(port), hostname, () => socket.end(bytes));
      let text = '';
      socket.on('data', (chunk) => (text += chunk.toString('latin1')));
      socket.on('error', () => {});
      socket.on('close', () => resolve(text));
    });
  const query = Array.from({ length: 250 }, (_, i) => `a${i}=b`).join('&');
  const heads = [
    `GET /v1/meshes?${query} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n`,
    ...['-1', '+2', '0x2', '2, 2', '2\0', '99999999999999999999'].map(
      (length) => `POST /v1/embeddings HTTP/1.1\r\nHost: localhost\r\nContent-Length: ${length}\r\n\r\n{}`,
    ),
  ];
  await beside(t, d, other, async () => {
    for (const head of heads) {
      const text = await raw(head);
      assert.equal(text.match(/^HTTP\/1\.1 \d/gm)?.length, 1, `${head.slice(0, 120)}: ${text}`);
      assert.match(text, /^HTTP\/1\.1 4\d\d/);
    }
    return 0;
  });
});

test('uploads in a row do not hold up the checks of another tenant', async (t) => {
  const { d, evil, other } = await start(t);
  const file = attacks.hugePolygon(300_000);
  await beside(t, d, other, async () => {
    await Promise.all(
      Array.from({ length: all ? 40 : 8 }, (_, n) =>
        d.post('/v1/meshes', Buffer.concat([file, Buffer.from('\n'.repeat(n))]), { headers: evil }),
      ),
    );
    return Number.POSITIVE_INFINITY;
  });
});
