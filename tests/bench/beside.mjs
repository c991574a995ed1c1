// Compares two daemons, in turns, so that other load of the machine meets both alike.
//
//   node tests/bench/beside.mjs OLD NEW [ROUNDS]
//
// OLD and NEW are programs orbmorphd. For each kind of request it prints the processor time of the daemon with its
// processes, which other load hardly changes, and the wall time: the median of the rounds, and NEW by OLD.
import { spawnSync } from 'node:child_process';
import { mkdtempSync, readdirSync, readFileSync, rmSync } from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { Daemon } from '../scenario/support/daemon.mjs';
import * as shapes from '../scenario/support/shapes.mjs';

const [old, fresh, count = '5'] = process.argv.slice(2);
const scratch = mkdtempSync(path.join(os.tmpdir(), 'orbmorph-beside-'));
const median = (list) => list.toSorted((a, b) => a - b)[Math.floor(list.length / 2)];

/** Processor time in ms of a process, its threads, and its descendants, those that have ended included. */
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
/** A mesh that no daemon has seen. */
const ball = (levels) => {
  number++;
  return shapes.binaryPly(shapes.ball(levels, ([x, y, z]) => [x * (1 + 1e-5 * number), y, z]));
};
async function upload(d, levels, times) {
  for (let i = 0; i < times; i++) {
    const reply = await d.upload(ball(levels));
    if (reply.status !== 201) throw new Error(reply.bytes.toString());
  }
  return times;
}
const wrk = (url) => {
  const { stdout } = spawnSync('wrk', ['-t2', '-c32', '-d2', url], { encoding: 'utf8' });
  return Number(/(\d+) requests in/.exec(stdout)[1]);
};
const kinds = {
  'GET a job': (d, at) => wrk(d.url + at.job),
  'GET an asset': (d, at) => wrk(d.url + at.asset),
  'upload of 32 KB': (d) => upload(d, 3, 40),
  'upload of 0.5 MB': (d) => upload(d, 5, 12),
  'upload of 8 MB': (d) => upload(d, 7, 3),
  'embedding of 1,280 triangles': async (d) => {
    for (let i = 0; i < 20; i++) await d.made('/v1/embeddings', { mesh: (await d.upload(ball(3))).json.id });
    return 20;
  },
};

async function start(program, name) {
  const d = new Daemon(path.join(scratch, name), ['--workers', '2']);
  d.program = [program];
  await d.start();
  const ids = [];
  for (const shape of [shapes.egg(4), shapes.bean(4)]) ids.push((await d.upload(shapes.obj(shape))).json.id);
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
for (let round = 0; round < Number(count); round++)
  for (const kind of Object.keys(kinds))
    for (const one of round % 2 ? both.toReversed() : both) {
      const [before, began] = [processorMs(one.d.child.pid), performance.now()];
      const done = await kinds[kind](one.d, one.at);
      (one.wall[kind] ??= []).push((performance.now() - began) / done);
      (one.cost[kind] ??= []).push((processorMs(one.d.child.pid) - before) / done);
    }
console.log(
  '| request | processor ms, old | new | ratio | wall ms, old | new | ratio |\n|---|---|---|---|---|---|---|',
);
for (const kind of Object.keys(kinds)) {
  const row = ['cost', 'wall'].flatMap((what) => {
    const [a, b] = both.map((one) => median(one[what][kind]));
    return [a.toPrecision(3), b.toPrecision(3), (b / a).toFixed(2)];
  });
  console.log(`| ${kind} | ${row.join(' | ')} |`);
}
for (const { d } of both) await d.stop();
rmSync(scratch, { recursive: true, force: true });
