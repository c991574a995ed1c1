// Throughput of small jobs with 1, 2 and 4 working nodes, and the cost of a job for the database: the figures of
// docs/cluster.md.
//
//   ORB_POSTGRESQL_OPTIONS='-c shared_preload_libraries=pg_stat_statements' \
//     tests/tools/with_postgresql.sh tests/tools/with_s3.sh node tests/bench/scaling.mjs
//
// All nodes are on this machine, so a cgroup holds each that works to a share of a core, ORB_SHARE (0.4), as `CPUQuota` of systemd
// does; this takes root and a cgroup file system. That says something only if the cores are not busy otherwise; the column "got" is
// what the nodes really had, and says whether they waited for the database and S3 instead. ORB_KIND is what is asked ORB_JOBS (200)
// times for each number of nodes, ORB_NODES (1,2,4): "embedding" (the default) of 20,480 triangles, "morph" of two embedded
// shapes of 1,280 each, or "rotate", the same with align.method rotate. Each ORB_LEVEL less than 5 (3 for morphs) has a quarter of these
// triangles. Each node has ORB_WORKERS (1) workers. ORB_DAEMON names the daemon, TMPDIR where the nodes have their folders. Beside other
// work, `chrt -f 1` before the command gives the stores their time first; the nodes that are measured drop that priority. A number of nodes
// that ORB_NODES names several times is measured as often, and medians follow the table; they then decide the exit status.
//
// "ms a job" is processor time, whose sum bounds what the cores can do; "rest" is the node that serves and this program. "others" is
// what programs had that have nothing to do with it. With ORB_STATEMENTS=1 the statements that ran most follow.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, readdirSync, readFileSync, rmdirSync, writeFileSync } from 'node:fs';
import { mkdtemp, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { Daemon } from '../scenario/support/daemon.mjs';
import * as shapes from '../scenario/support/shapes.mjs';

const program = process.env.ORB_DAEMON;
assert.ok(
  program && process.env.ORB_POSTGRESQL && process.env.ORB_S3,
  'to be run by with_postgresql.sh and with_s3.sh',
);
const share = Number(process.env.ORB_SHARE ?? 0.4);
const jobs = Number(process.env.ORB_JOBS ?? 200);
const kind = process.env.ORB_KIND ?? 'embedding';
const level = Number(process.env.ORB_LEVEL ?? (kind === 'embedding' ? 5 : 3));
const counts = (process.env.ORB_NODES ?? '1,2,4').split(',').map(Number);
const PERIOD = 10_000; // µs; a longer one would pause a node within its requests to the database, where others wait for it
const GOALS = new Map([
  [2, 1.8],
  [4, 3.4],
]);

/** A node and its descendants: the processes of its jobs, whose time is added to their parent when they end. */
function members(root) {
  const below = new Map();
  for (const pid of readdirSync('/proc').filter((name) => /^\d+$/.test(name))) {
    try {
      const fields = readFileSync(`/proc/${pid}/stat`, 'latin1').split(') ').pop().split(' ').map(Number);
      below.set(fields[1], [...(below.get(fields[1]) ?? []), { pid: Number(pid), ticks: fields.slice(11, 15) }]);
    } catch {} // it has just ended
  }
  const all = [...below.values()].flat().filter(({ pid }) => pid === root);
  for (let i = 0; i < all.length; i++) all.push(...(below.get(all[i].pid) ?? []));
  return all;
}

/** A cgroup that limits its processes to the share: its file of processes, and a function that removes it. */
function held(name) {
  const first = existsSync('/sys/fs/cgroup/cgroup.controllers');
  const group = path.join(first ? '/sys/fs/cgroup' : '/sys/fs/cgroup/cpu', name);
  mkdirSync(group);
  const quota = Math.round(share * PERIOD);
  // A node that waited for a core in one period may use the rest of its share in the next: on average it gets no more.
  // The weight is for machines with other work: a node should get its share there as well.
  if (first) {
    writeFileSync(path.join(group, 'cpu.max'), `${quota} ${PERIOD}`);
    writeFileSync(path.join(group, 'cpu.max.burst'), `${quota}`);
    writeFileSync(path.join(group, 'cpu.weight'), '8000');
  } else {
    writeFileSync(path.join(group, 'cpu.cfs_period_us'), `${PERIOD}`);
    writeFileSync(path.join(group, 'cpu.cfs_quota_us'), `${quota}`);
    writeFileSync(path.join(group, 'cpu.cfs_burst_us'), `${quota}`);
    writeFileSync(path.join(group, 'cpu.shares'), '81920');
  }
  return { processes: path.join(group, 'cgroup.procs'), remove: () => rmdirSync(group) };
}

/** Seconds of processor time that a node and its jobs have had. */
function cpu(root) {
  let ticks = 0;
  for (const { ticks: own } of members(root)) for (const some of own) ticks += some;
  return ticks / 100;
}

function sql(catalogue, text) {
  return execFileSync('psql', ['-X', '-qAt', '-v', 'ON_ERROR_STOP=1', '-d', catalogue, '-c', text], {
    encoding: 'utf8',
  }).trim();
}

/** The work of the server so far: statements except for those of this program, transactions, rows, bytes of WAL. */
function cost(catalogue) {
  const text = sql(
    catalogue,
    'SELECT pg_stat_force_next_flush(),' +
      " (SELECT sum(calls) FROM public.pg_stat_statements WHERE query NOT LIKE '%/* bench */%')," +
      " xact_commit, tup_inserted+tup_updated+tup_deleted, pg_current_wal_lsn()-'0/0'" +
      ' FROM pg_stat_database WHERE datname=current_database() /* bench */',
  );
  return text.split('|').slice(1).map(Number);
}

const stores = path.dirname(process.env.ORB_S3_START);

/** Seconds of processor time of the S3 server, which may be several processes. */
function s3() {
  const cluster = path.join(stores, 'data/cluster');
  const more = existsSync(cluster) ? readFileSync(cluster, 'utf8').trim().split('\n').map(Number) : [];
  return [Number(process.env.ORB_S3_PID), ...more].reduce((sum, pid) => sum + cpu(pid), 0);
}

/** How many requests radosgw has logged; Swift logs none. */
function requests() {
  const log = path.join(stores, 'data/client.log');
  return existsSync(log) ? readFileSync(log, 'latin1').split(' HTTP/1.1" ').length - 1 : 0;
}

/** Seconds that the cores of this machine have been busy. */
function busy() {
  const [, user, nice, system, , , irq, soft] = readFileSync('/proc/stat', 'latin1')
    .split('\n')[0]
    .split(/ +/)
    .map(Number);
  return (user + nice + system + irq + soft) / 100;
}

/** The process of the server, whose children are its connections. */
function postmaster(catalogue) {
  const [pid] = sql(catalogue, "SELECT pid FROM pg_stat_activity WHERE backend_type='checkpointer' /* bench */").split(
    ' ',
  );
  return Number(readFileSync(`/proc/${pid}/stat`, 'latin1').split(') ').pop().split(' ')[1]);
}

const upload = async (node, i) => {
  const bump = ([x, y, z]) => [x * (1 + 0.3 * Math.sin(i)), y, z + 0.0001 * i];
  return (await node.upload(shapes.obj(shapes.ball(level, bump)))).json.id;
};

/** Asks for the jobs, each for something else. */
async function ask(serve, start) {
  const accepted = async (target, body) => assert.equal((await serve.post(target, body)).status, 202);
  if (kind === 'embedding') {
    for (let i = 0; i < jobs; i++) await accepted('/v1/embeddings', { mesh: await upload(serve, i) });
    return;
  }
  const helper = await start([], '--role', 'work');
  const meshes = [];
  while ((meshes.length * (meshes.length - 1)) / 2 < jobs) {
    meshes.push(await upload(serve, meshes.length));
    await serve.made('/v1/embeddings', { mesh: meshes.at(-1) });
  }
  await helper.stop();
  const pairs = meshes.flatMap((one, i) => meshes.slice(0, i).map((other) => [one, other]));
  for (const pair of pairs.slice(0, jobs))
    await accepted('/v1/supermeshes', {
      shapes: pair.map((mesh) => ({ mesh })),
      ...(kind === 'rotate' ? { align: { method: 'rotate' } } : {}),
    });
}

/** The statements that were run most, for those who want to make them fewer (ORB_STATEMENTS=1). */
const top = () =>
  sql(
    process.env.ORB_POSTGRESQL,
    `SELECT round(calls/${jobs}.0, 2), round(total_exec_time::numeric/${jobs}, 3), left(regexp_replace(query, '\\s+', ' ', 'g'), 150)` +
      " FROM public.pg_stat_statements WHERE query NOT LIKE '%/* bench */%' ORDER BY calls DESC LIMIT 45 /* bench */",
  );

let measured = 0;

async function measure(count) {
  const name = `scaling${process.pid}-${measured++}`;
  const catalogue = execFileSync(process.env.ORB_NEW_CATALOGUE, [name], { encoding: 'utf8' });
  const shared = ['--catalogue', catalogue, '--objects', `s3://objects/${name}?endpoint=${process.env.ORB_S3}`];
  const nodes = [];
  const start = async (before, ...more) => {
    const data = await mkdtemp(path.join(tmpdir(), 'orbmorph-scaling-'));
    const node = new Daemon(data, [...shared, '--scrub-rate', '0', '--log-format', 'text', ...more], {});
    node.program = [...before, program];
    nodes.push(node);
    return node.start();
  };
  const groups = [];
  try {
    const serve = await start([], '--role', 'serve');
    await ask(serve, start);
    sql(process.env.ORB_POSTGRESQL, 'SELECT public.pg_stat_statements_reset() /* bench */');
    const works = [];
    for (let i = 0; i < count; i++) {
      groups.push(held(`orbmorph-${name}-${i}`));
      const enter = ['chrt', '-o', '0', '/bin/sh', '-c', `echo $$ >${groups[i].processes} && exec "$0" "$@"`];
      works.push(await start(enter, '--role', 'work', '--workers', process.env.ORB_WORKERS ?? '1'));
    }
    const roots = works.map(({ child }) => child.pid);
    const server = postmaster(catalogue);
    // Seconds of the nodes, PostgreSQL, S3, all that this program started (the node that serves, psql), and the machine.
    const spent = () => {
      const had = roots.map(cpu);
      const sum = had.reduce((one, other) => one + other, 0);
      return { had, seconds: [sum, cpu(server), s3(), cpu(process.pid) - sum, busy()], at: Date.now() };
    };
    // The database knows when the last job ended: asking it more often would take time from the nodes.
    const ended = () =>
      sql(
        catalogue,
        `SELECT count(*), max(finished) FROM job WHERE state=2 AND kind=${kind === 'embedding' ? 0 : 1} /* bench */`,
      ).split('|');
    const before = cost(catalogue);
    const asked = requests();
    const started = spent();
    const began = Date.now();
    const first = Number(ended()[0]);
    while (Number(ended()[0]) < jobs) await new Promise((done) => setTimeout(done, 1000));
    const end = spent();
    const wall = (end.at - started.at) / 1000;
    const done = jobs - first;
    const used = end.seconds.map((value, i) => value - started.seconds[i]);
    return {
      rate: (1000 * done) / (Number(ended()[1]) - began),
      got: end.had.map((value, i) => (value - started.had[i]) / wall),
      each: [...cost(catalogue).map((value, i) => (value - before[i]) / done), (requests() - asked) / done],
      ms: used.slice(0, 4).map((seconds) => (1000 * seconds) / done),
      others: (used[4] - used[0] - used[1] - used[2] - used[3]) / wall,
    };
  } finally {
    for (const node of nodes) {
      if (node.child) await node.stop();
      await rm(node.data, { recursive: true, force: true });
    }
    for (const { remove } of groups) remove();
  }
}

console.log(
  '| nodes | jobs a second | times one | got, of a core | others, of a core | ms a job: nodes | PostgreSQL | S3 | rest | statements a job | transactions | rows | WAL | S3 requests |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|',
);
sql(process.env.ORB_POSTGRESQL, 'CREATE EXTENSION IF NOT EXISTS pg_stat_statements');
const rates = new Map(counts.map((count) => [count, []]));
const median = (values) => {
  const sorted = values.toSorted((a, b) => a - b);
  return (sorted[(sorted.length - 1) >> 1] + sorted[sorted.length >> 1]) / 2;
};
const times = (count) => median(rates.get(count)) / median(rates.get(counts[0]));
for (const count of counts) {
  const { rate, got, each, ms, others } = await measure(count);
  rates.get(count).push(rate);
  const [statements, transactions, rows, wal, s3s] = each.map((value) => value.toFixed(value < 10 ? 1 : 0));
  const shares = got.map((value) => value.toFixed(2)).join(' ');
  console.log(
    `| ${count} | ${rate.toFixed(2)} | ${(rate / rates.get(counts[0]).at(-1)).toFixed(2)} | ${shares} | ${others.toFixed(2)} | ${ms.map((value) => value.toFixed(1)).join(' | ')} | ${statements} | ${transactions} | ${rows} | ${wal} B | ${s3s} |`,
  );
  if (process.env.ORB_STATEMENTS) console.log(top());
}
if (rates.size < counts.length) {
  console.log('\n| nodes | median of jobs a second | times one |\n|---|---|---|');
  for (const [count, all] of rates)
    console.log(`| ${count} | ${median(all).toFixed(2)} | ${times(count).toFixed(2)} |`);
}
process.exitCode = [...rates.keys()].some((count) => times(count) < (GOALS.get(count) ?? 0)) ? 1 : 0;
