// Clients that are slow on purpose, never read or never stop sending; and addresses that exceed their limits.
import assert from 'node:assert/strict';
import net from 'node:net';
import test from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { assertProblem, daemon, endless, patience, until } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

/** A plain connection: the bytes received so far, and its end. */
function connect(d, t) {
  const { hostname, port } = new URL(d.url);
  const c = { text: '', bytes: 0, closed: false, socket: net.connect(Number(port), hostname) };
  c.ended = new Promise((resolve) => c.socket.on('close', () => resolve((c.closed = true))));
  c.socket.on('error', (error) => (c.error = error));
  c.socket.on('data', (part) => {
    c.bytes += part.length;
    if (c.text.length < 5000) c.text += part.toString('latin1');
  });
  t.after(() => c.socket.destroy());
  return c;
}
const within = (promise, what) =>
  Promise.race([
    promise,
    sleep(120_000 * patience, null, { ref: false }).then(() => assert.fail(`not in time: ${what}`)),
  ]);
const HURRY = ['--header-seconds', '1', '--slow-seconds', '1', '--min-rate', '1000'];

test('slow headers and bodies', async (t) => {
  const d = await daemon(t, { args: HURRY });
  const patient = await daemon(t, { args: ['--slow-seconds', '3', '--min-rate', '100'] });
  const trickle = async (c, head, letter) => {
    c.socket.write(head);
    while (!c.closed) {
      c.socket.write(letter);
      await sleep(100);
    }
  };
  const slow = [connect(d, t), connect(d, t), connect(d, t), connect(d, t)];
  const all = Promise.all([
    trickle(slow[0], 'GET /livez HTTP/1.1\r\nHost: localhost\r\nX-Long: ', 'a'),
    trickle(slow[1], 'G', 'E'),
    trickle(slow[2], 'POST /v1/meshes HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000000\r\n\r\n', '#'),
    trickle(
      slow[3],
      'POST /v1/embeddings HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n',
      '1\r\n \r\n',
    ),
  ]);
  // Slow, but not too slow: 4 kB/s over more than two checks, where 100 bytes would suffice.
  const fine = connect(patient, t);
  const text = `${shapes.tetrahedron}${'#'.repeat(27_000)}\n`;
  const began = Date.now();
  fine.socket.write(
    `POST /v1/meshes HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Length: ${text.length}\r\n\r\n`,
  );
  for (let at = 0; at < text.length; await sleep(100)) {
    const due = Math.min(text.length, 4 * (Date.now() - began));
    fine.socket.write(text.slice(at, due));
    at = due;
  }
  await within(fine.ended, 'an answer');
  assert.match(fine.text, /^HTTP\/1\.1 201 /);
  await within(all, 'all are closed');
  assert.equal((await d.get('/livez')).status, 200);
});

test('clients that leave in the middle of a body give back what they hold', async (t) => {
  const d = await daemon(t, { args: ['--idle-seconds', '3600', '--min-rate', '0', '--limits', 'off'] });
  const open = async () => Number(/^orbmorph_connections (\d+)$/m.exec((await d.get('/metrics')).bytes.toString())[1]);
  const head = 'POST /v1/meshes HTTP/1.1\r\nHost: localhost\r\nContent-Length: 10000000\r\n\r\n';
  const half = Buffer.alloc(3 << 20, '# words\n');
  const gone = Array.from({ length: 100 }, () => connect(d, t));
  await Promise.all(
    gone.map(({ socket }) => new Promise((sent) => socket.write(Buffer.concat([Buffer.from(head), half]), sent))),
  );
  for (const { socket } of gone) socket.destroy();
  await until(async () => (await open()) < 5, 'they are closed', 60);
});

test('responses that nobody reads, and clients that wait', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1'] });
  const size = 60_000_000;
  const head = `${shapes.tetrahedron}`;
  const { url } = (await d.upload(head + `#${'-'.repeat(99_998)}\n`.repeat(Math.ceil((size - head.length) / 100_000))))
    .json;
  const { id } = (
    await d.upload(shapes.binaryPly(shapes.ball(5, ([x, y, z]) => [x * (1 + 0.3 * Math.sin(7 * y)), 1.5 * y, z])))
  ).json;
  await d.stop();
  d.args.push(...HURRY); // for the rest of the test, which is slow on purpose
  await d.start();
  const stuck = connect(d, t);
  stuck.socket.pause();
  stuck.socket.write(`GET ${url}/file HTTP/1.1\r\nHost: localhost\r\n\r\n`);
  // A stream, a poll and a kept connection that are silent for as long do not count as slow.
  const jobs = [];
  for (const area of [2, 3])
    jobs.push(
      (await d.post('/v1/embeddings', { mesh: id, ...endless, options: { ...endless.options, area_exponent: area } }))
        .json,
    );
  const stream = connect(d, t);
  const kept = connect(d, t);
  stream.socket.write(`GET ${jobs[1].url}/events HTTP/1.1\r\nHost: localhost\r\n\r\n`);
  kept.socket.write('GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n');
  const polled = await d.get(jobs[1].url, { query: { wait: 5 } });
  assert.equal(polled.status, 200);
  assert.equal(polled.json.state, 'queued', 'the first keeps the worker');
  assert.ok(!stream.closed && /retry: 2000/.test(stream.text), 'the stream is still there');
  kept.socket.write('GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n');
  await until(() => /200 OK[\s\S]*200 OK/.test(kept.text), 'an answer on the connection that was kept');
  stuck.socket.resume();
  await within(stuck.ended, 'the stuck one is closed');
  assert.ok(stuck.bytes < size, `${stuck.bytes} bytes`);
  for (const job of jobs) await d.delete(job.url);
});

test('a refusal reaches clients that send everything before they read', async (t) => {
  const d = await daemon(t, { args: ['--max-body', '1M'] });
  const block = Buffer.alloc(64 * 1024, '#');
  for (const [what, framing, megabytes] of [
    ['a length', `Content-Length: ${20 << 20}`, 20],
    ['an unknown coding', `Content-Encoding: br\r\nContent-Length: ${1 << 20}`, 1],
    ['chunks', 'Transfer-Encoding: chunked', 20],
    ['endless chunks', 'Transfer-Encoding: chunked', 80],
  ]) {
    const c = connect(d, t);
    const chunked = /chunked/.test(framing);
    c.socket.pause();
    c.socket.write(`POST /v1/meshes HTTP/1.1\r\nHost: localhost\r\n${framing}\r\n\r\n`);
    for (let sent = 0; sent < megabytes * 16 && !c.closed; sent++) {
      const part = chunked ? Buffer.concat([Buffer.from('10000\r\n'), block, Buffer.from('\r\n')]) : block;
      await within(new Promise((done) => c.socket.write(part, done)), `${what}: the server takes it`);
    }
    if (chunked) c.socket.write('0\r\n\r\n');
    await sleep(200);
    c.socket.resume();
    await within(c.ended, `${what}: the end`);
    assert.match(c.text, what === 'an unknown coding' ? /^HTTP\/1\.1 415 / : /^HTTP\/1\.1 413 /, `${what}: ${c.error}`);
    assert.match(c.text, /"status":4\d\d/, what);
  }
  assert.equal((await d.upload(shapes.tetrahedron)).status, 201);
});

test('limits of requests and connections for an address', async (t) => {
  const free = await daemon(t);
  assert.equal((await free.get('/v1/meshes')).headers.get('ratelimit'), null, 'on loopback there is no limit');
  const d = await daemon(t, {
    args: ['--limits', 'all', '--requests-per-second', '2', '--connections-per-address', '20'],
  });
  const first = await d.get('/v1/meshes');
  assert.equal(first.status, 200);
  assert.equal(first.headers.get('ratelimit-policy'), '"requests";q=20;w=10');
  assert.match(first.headers.get('ratelimit'), /^"requests";r=(19|20);t=\d+$/);
  const dozen = () => Promise.all(Array.from({ length: 12 }, () => d.get('/v1/meshes'))); // at once: no machine takes six seconds for them
  const reply = await until(async () => (await dozen()).find(({ status }) => status !== 200), 'too many');
  assertProblem(reply, 429, 'too-many-requests');
  assert.ok(Number(reply.headers.get('retry-after')) >= 1);
  assert.match(reply.headers.get('ratelimit'), /^"requests";r=0;t=\d+$/);
  for (let i = 0; i < 50; i++)
    for (const target of ['/livez', '/readyz']) assert.equal((await d.get(target)).status, 200);
  await until(async () => (await d.get('/v1/meshes')).status === 200, 'the bucket fills again');

  const many = Array.from({ length: 40 }, () => connect(d, t));
  await Promise.all(many.map((c) => new Promise((done) => c.socket.on('connect', done))));
  await until(async () => {
    const late = connect(d, t);
    late.socket.write('GET /v1/meshes HTTP/1.1\r\nHost: localhost\r\n\r\n');
    await Promise.race([late.ended, sleep(2000)]); // answered: it arrived before some of the others were seen
    return late.closed && /^HTTP\/1\.1 429 [\s\S]*more than 20 open connections/.test(late.text);
  }, 'refused and closed');
  const alive = connect(d, t);
  alive.socket.write('GET /livez HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n');
  await within(alive.ended, 'health checks always get a response');
  assert.match(alive.text, /^HTTP\/1\.1 200 /);
  many.forEach((c) => c.socket.destroy());
  await until(async () => (await d.get('/v1/meshes')).status === 200, 'those that went are forgotten');
});
