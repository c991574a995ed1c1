// Runs mixed work for ORB_SOAK_SECONDS (600) and checks that memory, descriptors and threads do not grow.
//
// First, 700 small jobs fill the list of finished jobs that the service keeps. The first fifth of the time warms up the
// caches and the allocator. After that, the least-squares line through one sample per second may rise by at most a
// tenth of the level. When all clients are gone, no kind of descriptor may have more open than at the beginning. The
// exception is the catalogue's log: the number of connections is constant, but each opens the log with its first read.
// Exit status 1 otherwise.
import { mkdtempSync, readdirSync, readFileSync, readlinkSync, rmSync } from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { setTimeout as sleep } from 'node:timers/promises';
import { Daemon } from '../scenario/support/daemon.mjs';
import * as shapes from '../scenario/support/shapes.mjs';

const seconds = Number(process.env.ORB_SOAK_SECONDS ?? 600);
const data = mkdtempSync(path.join(os.tmpdir(), 'orbmorph-soak-'));
const d = await new Daemon(data, ['--workers', '2', '--derived-bytes', '20M'], {}).start();
const proc = `/proc/${d.child.pid}`;
const sample = () => {
  const status = readFileSync(`${proc}/status`, 'utf8');
  return {
    memory: Number(/VmRSS:\s+(\d+)/.exec(status)[1]) / 1024,
    threads: Number(/Threads:\s+(\d+)/.exec(status)[1]),
    descriptors: readdirSync(`${proc}/fd`).length,
  };
};

/** Counts the open descriptors of the daemon: files by name, sockets and others by kind. */
function open() {
  const kinds = {};
  for (const fd of readdirSync(`${proc}/fd`)) {
    let what;
    try {
      what = readlinkSync(`${proc}/fd/${fd}`)
        .replace(data, '')
        .replace(/:\[\d+\]$/, '');
    } catch (error) {
      if (error.code === 'ENOENT') continue; // closed after readdir
      throw error;
    }
    kinds[what] = (kinds[what] ?? 0) + 1;
  }
  return kinds;
}

const counts = {};
const count = (what) => (counts[what] = (counts[what] ?? 0) + 1);
let stop = false;
let number = 0;
const mesh = () => {
  const n = ++number;
  const levels = 1 + (n % 4);
  return shapes.obj(
    shapes.ball(levels, ([x, y, z]) => [x * (1 + 0.1 * Math.sin(n)), y + 0.1 * Math.sin(3 * x), z + 1e-4 * n]),
  );
};

/** One client: uploads, jobs, waits, streams, downloads, errors, cancels, aborted requests, deletions, in sequence. */
async function caller() {
  while (!stop) {
    const [a, b] = [(await d.upload(mesh(), { name: 'a' })).json, (await d.upload(mesh(), { name: 'b' })).json];
    const embedding = await d.make('/v1/embeddings', { mesh: a.id });
    count(embedding.resource ? 'embeddings' : 'embeddings that failed');
    const reply = await d.post('/v1/supermeshes', {
      shapes: [{ mesh: a.id }, { mesh: b.id }],
      align: { method: 'rotate' },
      remesh: { method: number % 2 ? 'overlay' : 'adaptive' },
    });
    if (number % 5 === 0 && reply.status === 202) {
      await d.delete(reply.json.url);
      count('cancelled');
    } else if (reply.status === 202) {
      const events = await d.get(`${reply.json.url}/events`);
      count(/^event: succeeded/m.test(events.bytes.toString()) ? 'supermeshes' : 'failed supermeshes');
      const asset = await d.get(
        `/v1/supermeshes/${(await d.get(reply.json.url)).json.result?.split('/').pop()}/asset.glb`,
      );
      count(asset.status === 200 ? 'assets' : 'assets that are gone');
    }
    await d.upload('this is not a mesh', { name: 'x' });
    await d.post('/v1/embeddings', '{"mesh":', {});
    await d.get('/v1/meshes', { query: { limit: 50 } });
    await d.get('/metrics');
    await d.upload(Buffer.alloc(200_000, 'v 0 0 0\n'), { name: 'y' });
    await d
      .get(reply.json.url ?? '/v1/jobs', { query: { wait: 5 }, signal: AbortSignal.timeout(20) })
      .catch(() => count('aborted waits'));
    await d.delete(`/v1/meshes/${a.id}`);
    await d.delete(`/v1/meshes/${b.id}`);
    count('rounds');
  }
}

const first = sample();
const at_first = open();
const samples = [];
let warm = 700;
await Promise.all(
  Array.from({ length: 8 }, async () => {
    for (; warm > 0; warm--) {
      const small = shapes.obj(shapes.ball(1, ([x, y, z]) => [x, y, z + 1e-4 * ++number]));
      const { json } = await d.upload(small, { name: 'w' });
      await d.made('/v1/embeddings', { mesh: json.id });
      await d.delete(json.url);
    }
  }),
);
const callers = Array.from({ length: 4 }, caller);
for (const began = Date.now(); Date.now() - began < seconds * 1000; ) {
  await sleep(1000);
  samples.push({ at: (Date.now() - began) / 1000, ...sample() });
}
stop = true;
const failed = (await Promise.allSettled(callers)).filter((result) => result.status === 'rejected');
const idle = ['--', ...failed.map((result) => String(result.reason))];
await sleep(35_000); // idle connections close after 30 s
const last = sample();
const at_last = open();
const { code } = await d.stop();
rmSync(data, { recursive: true, force: true });

const closed = Object.entries(at_last).every(
  ([what, n]) => n <= (what === '/catalogue.sqlite-wal' ? at_first['/catalogue.sqlite'] : (at_first[what] ?? 0)),
);
let bad = failed.length > 0 || code !== 0;
console.log(
  `${seconds} s: ${Object.entries(counts)
    .map(([what, n]) => `${n} ${what}`)
    .join(', ')}; the daemon ended with ${code}`,
);
for (const what of ['memory', 'descriptors', 'threads']) {
  const rest = samples.filter((s) => s.at > seconds / 5);
  const n = rest.length;
  const mean = rest.reduce((sum, s) => sum + s[what], 0) / n;
  const at = rest.reduce((sum, s) => sum + s.at, 0) / n;
  const slope =
    rest.reduce((sum, s) => sum + (s.at - at) * (s[what] - mean), 0) /
    rest.reduce((sum, s) => sum + (s.at - at) ** 2, 0);
  const rise = slope * (rest.at(-1).at - rest[0].at);
  const flat = rise <= Math.max(0.1 * mean, what === 'memory' ? 5 : 2);
  const back = { memory: true, threads: last.threads <= first.threads, descriptors: closed }[what];
  bad ||= !flat || !back;
  console.log(
    `${what}: ${first[what].toFixed(0)} at first, ${mean.toFixed(1)} on average, from ${Math.min(...rest.map((s) => s[what])).toFixed(0)} to ${Math.max(...rest.map((s) => s[what])).toFixed(0)}, rise ${rise.toFixed(1)}, ${last[what].toFixed(0)} when idle again${flat && back ? '' : ' NOT FLAT'}`,
  );
}
if (!closed) console.log(`open at first ${JSON.stringify(at_first)}\nwhen idle again ${JSON.stringify(at_last)}`);
if (idle.length > 1) console.log(idle.join('\n'));
process.exit(bad ? 1 : 0);
