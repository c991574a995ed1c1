// Compares two daemons alternately, so that other load of the machine affects both alike.
//
//   node tests/bench/beside.mjs OLD NEW [ROUNDS [PART OF A NAME…]]
//
// OLD and NEW are programs orbmorphd. For each kind of request it prints the processor time of the daemon with its
// processes, which other load hardly changes, and the wall time: the median of the rounds, and NEW by OLD. Parts of names
// choose kinds: upload.
import { spawnSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync } from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { Daemon } from '../scenario/support/daemon.mjs';
import * as shapes from '../scenario/support/shapes.mjs';

const [old, fresh, count = '5', ...some] = process.argv.slice(2);
const scratch = mkdtempSync(path.join(os.tmpdir(), 'orbmorph-beside-'));
const median = (list) => list.toSorted((a, b) => a - b)[Math.floor(list.length / 2)];

/** Processor time in ms of a process, its threads, and its descendants, including those that have ended. */
function processorMs(pid) {
  const rows = new Map();
  for (const name of readdirSync('/proc').filter((n) => /^\d+$/.test(n)))
    try {
      const fields = readFileSync(`/proc/${name}/stat`, 'latin1').split(') ').pop().split(' ');
      const ticks = fields.slice(11, 15).reduce((sum, n) => sum + Number(n), 0);
      rows.set(Number(name), { parent: Number(fields[1]), ticks });
    } catch {} // it has ended
  const isOf = (at) => at === pid || (rows.has(at) && at > 1 && isOf(rows.get(at).parent));
  return [...rows].filter(([at]) => isOf(at)).reduce((sum, [, { ticks }]) => sum + 10 * ticks, 0);
}

let number = 0;
/** A mesh that no daemon has seen: a ball, from a cube of n by n squares a side. */
function ball(n) {
  number++;
  const [positions, triangles, known] = [[], [], new Map()];
  const vertex = (p) => {
    const key = p.join();
    if (!known.has(key)) {
      known.set(key, positions.length);
      const q = p.map((x) => Math.tan((Math.PI / 4) * ((2 * x) / n - 1)));
      positions.push(q.map((x, k) => (x / Math.hypot(...q)) * (k ? 1 : 1 + 1e-5 * number)));
    }
    return known.get(key);
  };
  for (const axis of [0, 1, 2])
    for (const side of [0, n])
      for (let i = 0; i < n * n; i++) {
        const square = [0, 1, n + 2, n + 1].map((k) => {
          const at = i + Math.floor(i / n) + k; // of (n + 1)² corners
          return vertex([side, at % (n + 1), Math.floor(at / (n + 1))].map((_, c, p) => p[(c - axis + 3) % 3]));
        });
        const [p, q, r, s] = side ? square : square.toReversed();
        triangles.push([p, q, r], [p, r, s]);
      }
  return shapes.binaryPly({ positions, triangles });
}
/** Sends meshes, one after another. They are generated beforehand, so that the time is the daemon's. */
const uploads = (n, times) => ({
  prepare: () => Array.from({ length: times }, () => ball(n)),
  run: async (d, _, bodies) => {
    for (const body of bodies) {
      const reply = await d.upload(body);
      if (reply.status !== 201) throw new Error(reply.bytes.toString());
    }
    return times;
  },
});
const wrk = (url) => {
  const { stdout, error } = spawnSync('wrk', ['-t2', '-c32', '-d2', url], { encoding: 'utf8' });
  if (error) throw new Error(`wrk cannot be run (Debian package wrk): ${error.message}`);
  return Number(/(\d+) requests in/.exec(stdout)[1]);
};
const kinds = {
  'GET a job': { run: (d, at) => wrk(d.url + at.job) },
  'GET an asset': { run: (d, at) => wrk(d.url + at.asset) },
  'upload of 31 KB': uploads(10, 200),
  'upload of 0.5 MB': uploads(41, 60),
  'upload of 5 MB': uploads(129, 8),
  'upload and embedding of 1,200 triangles': {
    prepare: () => Array.from({ length: 40 }, () => ball(10)),
    run: async (d, _, bodies) => {
      for (const body of bodies) await d.made('/v1/embeddings', { mesh: (await d.upload(body)).json.id });
      return bodies.length;
    },
  },
};

async function start(program, name) {
  const d = new Daemon(path.join(scratch, name), ['--workers', '2']);
  d.program = [program];
  await d.start();
  const ids = [];
  for (const shape of [shapes.egg(4), shapes.bean(4)]) ids.push((await d.upload(shapes.obj(shape))).json.id);
  // 8bbd71c creates the folders of objects at its start, later versions create each with its first object: create them
  // now, before the measurement begins.
  const objects = path.join(scratch, name, 'objects');
  for (const kind of readdirSync(objects))
    for (let i = 0; i < 256; i++)
      mkdirSync(path.join(objects, kind, i.toString(16).padStart(2, '0')), { recursive: true, mode: 0o700 });
  for (let i = 0; i < 1000; i++) await d.upload(`# ${i}\n${shapes.tetrahedron}`);
  const made = await d.make('/v1/supermeshes', {
    shapes: ids.map((mesh) => ({ mesh })),
    align: { method: 'rotate' },
    remesh: { method: 'subdivision', tolerance: 1e-5, max_triangles: 20000 },
  });
  const { json } = await d.get('/v1/jobs', { query: { limit: 1 } });
  return { d, at: { job: json.jobs[0].url, asset: made.resource.asset }, cost: {}, wall: {} };
}

const both = [await start(old, 'old'), await start(fresh, 'new')];
for (const { d, at } of both) console.log(`asset: ${(await d.get(at.asset)).bytes.length} bytes`);
const chosen = Object.keys(kinds).filter((kind) => !some.length || some.some((part) => kind.includes(part)));
for (let round = 0; round < Number(count); round++)
  for (const kind of chosen)
    for (const one of round % 2 ? both.toReversed() : both) {
      const prepared = kinds[kind].prepare?.();
      const [before, began] = [processorMs(one.d.child.pid), performance.now()];
      const done = await kinds[kind].run(one.d, one.at, prepared);
      (one.wall[kind] ??= []).push((performance.now() - began) / done);
      (one.cost[kind] ??= []).push((processorMs(one.d.child.pid) - before) / done);
    }
console.log(
  '| request | processor ms, old | new | ratio | wall ms, old | new | ratio |\n|---|---|---|---|---|---|---|',
);
for (const kind of chosen) {
  const row = ['cost', 'wall'].flatMap((what) => {
    const [a, b] = both.map((one) => median(one[what][kind]));
    return [a.toPrecision(3), b.toPrecision(3), (b / a).toFixed(2)];
  });
  console.log(`| ${kind} | ${row.join(' | ')} |`);
}
for (const { d } of both) await d.stop();
rmSync(scratch, { recursive: true, force: true });
