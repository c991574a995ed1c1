// The wall clock jumps back or ahead by an hour while the daemon runs, as happens when machines boot.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import net from 'node:net';
import test from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { promisify } from 'node:util';
import { binaries, daemon, endless, patience } from './support/daemon.mjs';
import { preload } from './support/preload.mjs';
import { pause } from './support/processes.mjs';
import * as shapes from './support/shapes.mjs';

const library = process.env.ORB_CLOCK;

test('waits end and slow clients are disconnected even if the clock is set back', {
  skip: library ? false : 'ORB_CLOCK names no library',
}, async (t) => {
  const ahead = 8000; // by then the job is under way, on a busy machine too
  const preloaded = preload([library]);
  t.after(preloaded.remove);
  const d = await daemon(t, {
    args: ['--workers', '1', '--header-seconds', '1'],
    env: { LD_PRELOAD: preloaded.value, ORB_CLOCK_AHEAD_MS: String(ahead) },
  });
  const { id } = (await d.upload(shapes.binaryPly(shapes.ball(5)))).json;
  const job = (await d.post('/v1/embeddings', { mesh: id, ...endless })).json;
  const early = Date.parse(job.created);
  await pause(d, job);
  await sleep(ahead + 1000);
  assert.ok(early > Date.now() + 3_000_000, 'the clock was ahead');
  const late = await d.upload(shapes.tetrahedron);
  assert.ok(Date.parse(late.json.created) < Date.now() + 60_000, 'and is right now');
  const waited = await d.get(job.url, { query: { wait: 1 }, signal: AbortSignal.timeout(60_000 * patience) });
  assert.deepEqual([waited.status, waited.json.state], [200, 'running']);
  const closed = await new Promise((done, reject) => {
    const { hostname, port } = new URL(d.url);
    const socket = net.connect(Number(port), hostname, () => socket.write('GET /livez HTTP/1.1\r\nHost: h\r\n'));
    // before the library's own 30 s
    socket.setTimeout(28_000, () => {
      socket.destroy();
      reject(new Error('it was not closed'));
    });
    socket.on('close', () => done(true));
    socket.on('error', () => done(true));
    socket.resume();
  });
  assert.ok(closed);
  const { uptime_seconds: up } = (await d.get('/readyz?verbose')).json;
  assert.ok(up >= ahead / 1000 && up < 3000, `it has run for ${up} s`);
  assert.equal((await d.delete(job.url)).status, 200);
});

test('a clock that is set ahead ends tokens, and no job and no wait', {
  skip: library ? false : 'ORB_CLOCK names no library',
}, async (t) => {
  const preloaded = preload([library]);
  t.after(preloaded.remove);
  const slow = (ms) => ({ LD_PRELOAD: preloaded.value, ORB_CLOCK_OFF: '-3600', ORB_CLOCK_AHEAD_MS: String(ms) });
  const d = await daemon(t, {
    args: ['--auth', 'on', '--workers', '1', '--job-seconds', '1800', '--idle-seconds', '1800'],
    env: slow(8000), // by then the job is under way, on a busy machine too
  });
  const token = async (name, ...more) => {
    const words = ['token', 'add', name, '--scope', 'read,write', '--tenant', 'web', ...more, '--data', d.data];
    const { stdout } = await promisify(execFile)(binaries.daemon, words, {
      env: { ...process.env, ...slow(600_000) }, // of the daemon's time
    });
    return { headers: { authorization: `Bearer ${stdout.trim()}` } };
  };
  const [own, brief] = [await token('own'), await token('brief', '--expires', '30m')];
  const { id } = (await d.post('/v1/meshes', shapes.binaryPly(shapes.ball(5)), own)).json;
  const job = (await d.post('/v1/embeddings', { mesh: id, ...endless }, brief)).json;
  assert.ok(Date.parse(job.created) < Date.now() - 3_000_000, 'the clock was behind');
  const seconds = 12; // the jump is within them
  const waiting = d.get(job.url, { ...own, query: { wait: seconds } });
  const resume = await pause(d, job, own);
  const waited = await waiting;
  assert.deepEqual([waited.status, waited.json.state], [200, 'running'], waited.bytes.toString());
  const late = await d.post('/v1/meshes', Buffer.from(shapes.tetrahedron), own);
  assert.ok(Date.parse(late.json.created) > Date.now() - 60_000, 'and is right now');
  assert.equal((await d.get(job.url, brief)).status, 401, 'its half hour is over by the clock');
  resume();
  await sleep(1000); // its process checks its own limit, too
  const now = (await d.get(job.url, own)).json;
  assert.deepEqual([now.state, now.attempt], ['running', 1], 'its limit counts the time that it has run');
  assert.equal((await d.delete(job.url, own)).status, 200);
});
