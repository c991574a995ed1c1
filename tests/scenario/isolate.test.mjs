// Meshes are read and jobs run in processes of their own: if one dies, only its own work is lost, and if one hangs, it
// delays nothing else. A process stopped with SIGSTOP plays a reader or a job that never ends.
import assert from 'node:assert/strict';
import { execFile, spawn } from 'node:child_process';
import { readdirSync, readFileSync, readlinkSync } from 'node:fs';
import { mkdtemp, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import test from 'node:test';
import { promisify } from 'node:util';
import { assertProblem, binaries, daemon, endless, patience, slow, until } from './support/daemon.mjs';
import { children, workers } from './support/processes.mjs';
import { preload } from './support/preload.mjs';
import * as shapes from './support/shapes.mjs';

const run = promisify(execFile);
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const wobble = (n, levels) => shapes.ball(levels, ([x, y, z]) => [x * (1 + 0.1 * Math.sin(n)), y, z + 0.001 * n]);

const status = (pid, name) =>
  new RegExp(`^${name}:\\s+(\\d+)`, 'm').exec(readFileSync(`/proc/${pid}/status`, 'latin1'))?.[1];

/** Only the processes of jobs: a process that has read files stays for a while, for more files of its tenant. */
const only = (d, count) => until(() => workers(d).length === count && workers(d), `${count} processes that work`, 60);
const one = async (d) => (await only(d, 1))[0];
const running = (d, job) => until(async () => (await d.get(job.url)).json.stage === 'embed', 'the job runs', 120);

async function slowJob(d, n) {
  const { json: mesh } = await d.upload(shapes.binaryPly(wobble(n, 5)), { name: `slow${n}` });
  const reply = await d.post('/v1/embeddings', { mesh: mesh.id, ...endless });
  assert.equal(reply.status, 202, reply.bytes.toString());
  return { mesh, job: reply.json };
}

test('a job runs confined', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1', '--isolate', slow ? 'on' : 'strict', '--job-memory', '512M'] });
  const { job } = await slowJob(d, 1);
  await running(d, job);
  const pid = await one(d);
  const files = readdirSync(`/proc/${pid}/fd`)
    .filter((fd) => !slow || fd !== '2') // with sanitizers, the daemon's log
    .map((fd) => readlinkSync(`/proc/${pid}/fd/${fd}`));
  assert.equal(files.filter((to) => to.startsWith('socket:')).length, 1, `only its channel: ${files}`);
  for (const to of files) assert.doesNotMatch(to, /catalogue|lock|\/tmp\/put-/, `${files}`);
  if (!slow) {
    assert.ok(!files.includes(readlinkSync(`/proc/${d.child.pid}/fd/2`)), `not the log: ${files}`);
    assert.equal(status(pid, 'Seccomp'), '2');
    assert.equal(status(pid, 'NoNewPrivs'), '1');
    const limits = readFileSync(`/proc/${pid}/limits`, 'latin1');
    const memory = Number(/^Max address space\s+(\d+)/m.exec(limits)[1]);
    assert.ok(memory > 512 << 20 && memory < (512 + 1024) * 2 ** 20, limits);
    assert.match(limits, /^Max cpu time\s+\d+/m);
  }
  assert.equal((await d.delete(job.url)).status, 200);
  await until(() => workers(d).length === 0, 'cancelling ends the process', 10);
});

test('a process that dies takes its own job, and after three deaths that job is refused until it is cleared', async (t) => {
  const d = await daemon(t, { args: ['--workers', '2'] });
  const bad = await slowJob(d, 1);
  await running(d, bad.job);
  const poison = await one(d);
  const other = await slowJob(d, 2);
  await running(d, other.job);
  await only(d, 2);
  const signals = ['SIGSEGV', 'SIGBUS', 'SIGABRT'];
  let pid = poison;
  for (let death = 1; death <= 3; death++) {
    const before = workers(d).filter((each) => each !== pid);
    process.kill(pid, signals[death - 1]);
    if (death === 3) break;
    await until(
      async () => {
        const now = (await d.get(bad.job.url)).json;
        return now.attempt === death + 1 && now.stage === 'embed';
      },
      'the job runs again',
      60,
    );
    [pid] = workers(d).filter((each) => !before.includes(each));
  }
  const end = await d.ended((await d.get(bad.job.url)).json);
  assert.equal(end.state, 'failed');
  assert.equal(end.problem.type, '/problems/job-crashed');
  assert.match(end.problem.detail, /died 3 times.*signal 6/);
  const kept = (await d.get(other.job.url)).json;
  assert.deepEqual([kept.state, kept.attempt], ['running', 1], 'the other job went on');
  assertProblem(await d.post('/v1/embeddings', { mesh: bad.mesh.id, ...endless }), 500, 'job-crashed');
  const admin = async (...args) => (await run(binaries.daemon, ['crash', ...args, '--data', d.data])).stdout;
  assert.match(await admin('list'), new RegExp(`^[0-9a-f]{64} crashes=3 refused mesh=${bad.mesh.id} tenant= last=`));
  await admin('clear', bad.mesh.id.slice(0, 20));
  assert.equal(await admin('list'), '');
  const again = await d.post('/v1/embeddings', { mesh: bad.mesh.id, ...endless });
  assert.equal(again.status, 202);
  for (const job of [again.json, other.job]) assert.equal((await d.delete(job.url)).status, 200);
});

test('a process that dies while it checks a file leaves a record, and after three deaths the file is refused', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on', '--workers', '2'] });
  const command = async (...args) => (await run(binaries.daemon, [...args, '--data', d.data])).stdout;
  const bearer = async (name) => ({
    headers: { authorization: `Bearer ${(await command('token', 'add', name, '--scope', 'read,write')).trim()}` },
  });
  const [evil, other] = [await bearer('evil'), await bearer('other')];
  const file = Buffer.from(shapes.binaryPly(wobble(7, 6)));
  /**
   * Uploads the file and kills the process that checks it. If the check ends before the signal arrives, deletes the
   * mesh and tries again.
   */
  async function killed(signal) {
    for (;;) {
      const asked = d.post('/v1/meshes', file, evil);
      for (let over = false; !over; ) {
        for (const pid of workers(d)) {
          try {
            process.kill(pid, signal);
          } catch (error) {
            assert.equal(error.code, 'ESRCH');
          }
        }
        over = await Promise.race([asked.then(() => true), sleep(1)]);
      }
      const reply = await asked;
      if (reply.status !== 201) return reply;
      assert.equal((await d.delete(reply.json.url, evil)).status, 204);
    }
  }
  assertProblem(await killed('SIGSEGV'), 500, 'job-crashed');
  const listed = () => until(async () => (await command('crash', 'list')).trim(), 'a record', 30);
  assert.match(await listed(), /^([0-9a-f]{64}) crashes=1 mesh=\1 tenant=evil last=/);
  for (const signal of ['SIGBUS', 'SIGABRT']) assertProblem(await killed(signal), 500, 'job-crashed');
  await until(async () => / crashes=3 refused /.test(await listed()), 'three are counted', 30);
  const refused = await d.post('/v1/meshes', file, evil);
  assertProblem(refused, 500, 'job-crashed');
  assert.match(refused.json.detail, /until the operator clears/);
  assert.equal((await d.post('/v1/meshes', Buffer.from(shapes.tetrahedron), other)).status, 201, 'another file');
  await command('crash', 'clear', 'evil');

  // The kernel's signal where memory is short counts as well: a file may need it each time.
  for (let death = 1; death <= 3; death++) assertProblem(await killed('SIGKILL'), 500, 'job-crashed');
  await until(async () => / crashes=3 refused /.test(await listed()), 'three are counted', 30);
  assertProblem(await d.post('/v1/meshes', file, evil), 500, 'job-crashed');
  await command('crash', 'clear', 'evil');
  assert.equal((await d.post('/v1/meshes', file, evil)).status, 201);
});

test('jobs that run when the daemon ends do not count as crashed', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1'] });
  const { job } = await slowJob(d, 1);
  for (let death = 1; death <= 4; death++) {
    await running(d, job);
    const pid = await one(d);
    d.child.kill('SIGKILL');
    await d.exited;
    await until(() => !children(pid) || !readdirSync('/proc').includes(String(pid)), 'its process ends with it', 10);
    await d.start();
  }
  const now = (await d.get(job.url)).json;
  assert.ok(['queued', 'running'].includes(now.state), JSON.stringify(now));
  assert.equal((await d.delete(job.url)).status, 200);
});

test('a job that hangs ends at its time limit', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1', '--job-seconds', String(4 * patience)] });
  const { job } = await slowJob(d, 1);
  process.kill(await one(d), 'SIGSTOP');
  const end = await d.ended((await d.get(job.url)).json, { seconds: 60 });
  assert.equal(end.problem?.type, '/problems/timeout', JSON.stringify(end));
  assert.equal(workers(d).length, 0);
});

test('a check that hangs delays nobody, and ends with its client, at check-seconds, and with the service', async (t) => {
  const d = await daemon(t, { args: ['--workers', '2', '--check-seconds', String(6 * patience)] });
  const file = Buffer.from(shapes.binaryPly(wobble(3, 6)));
  /** Stops a worker. Returns false if it has ended meanwhile. */
  function stopped(pid) {
    try {
      return process.kill(pid, 'SIGSTOP');
    } catch (error) {
      assert.equal(error.code, 'ESRCH');
      return false;
    }
  }
  /** Uploads a file whose check is stopped as soon as it begins. */
  async function hang(signal) {
    await until(() => workers(d).length === 0, 'processes that wait for more small files end', 20);
    for (let n = 0; ; n++) {
      const bytes = Buffer.concat([file, Buffer.from(' '.repeat(n))]);
      const reply = d.post('/v1/meshes', bytes, { signal }).catch((error) => error);
      for (let over = false; !over; ) {
        const [pid] = workers(d);
        if (pid && stopped(pid)) {
          const ended = await Promise.race([reply.then(() => true), sleep(300)]);
          if (!ended) return { pid, reply };
        }
        over = await Promise.race([reply.then(() => true), sleep(1)]);
      }
    }
  }
  const client = new AbortController();
  const first = await hang(client.signal);
  const began = Date.now();
  assert.equal((await d.upload(shapes.tetrahedron)).status, 201);
  assert.ok(Date.now() - began < 2000 * patience, 'another upload is answered');
  client.abort();
  await first.reply;
  await until(() => !workers(d).includes(first.pid), 'the check ends with its client', 4);

  const second = await hang();
  assertProblem(await second.reply, 503, 'timeout');

  const third = await hang();
  const asked = Date.now();
  d.child.kill('SIGTERM');
  await third.reply;
  assert.equal((await d.exited).code, 0, d.log);
  assert.ok(Date.now() - asked < 5000 * patience, `it took ${Date.now() - asked} ms to stop`);
  const { stdout } = await run(binaries.daemon, ['crash', 'list', '--data', d.data]);
  assert.equal(stdout, '', 'what the service ends is no crash of the file');
});

/** Returns whether the process got the signal; false if it has ended. */
function told(pid, signal) {
  try {
    return process.kill(pid, signal);
  } catch (error) {
    assert.equal(error.code, 'ESRCH');
    return false;
  }
}

/**
 * Asks for a profile of an asset, and sends a signal to the process that makes it. If the process has sent the profile
 * before the signal arrives, deletes the supermesh, makes it again and tries again.
 */
async function convert(d, ids, signal, options) {
  for (let tries = 0; tries < 20; tries++) {
    const morph = await d.get(`/v1/morph.glb?shapes=${ids}&align=rotate&remesh=overlay&wait=60`);
    assert.equal(morph.status, 200, morph.bytes.toString());
    const url = /\/v1\/supermeshes\/\w+/.exec(morph.headers.get('link'))[0];
    await until(() => workers(d).length === 0, 'other processes end', 20);
    const reply = d.get(`${url}/asset.glb?profile=meshopt`, options).catch((error) => error);
    for (let over = false; !over; ) {
      const [pid] = workers(d);
      if (pid && told(pid, signal)) {
        const hangs = signal === 'SIGSTOP' && !(await Promise.race([reply.then(() => true), sleep(300)]));
        const died = signal !== 'SIGSTOP' && (await reply).status !== 200;
        if (hangs || died) return { url, pid, reply };
      }
      over = await Promise.race([reply.then(() => true), sleep(1)]);
    }
    assert.equal((await reply).status, 200, (await reply).bytes.toString());
    assert.equal((await d.delete(url)).status, 204);
  }
  return assert.fail('no process was seen that makes the profile');
}

test('a process that dies while it makes a profile leaves a record, and one that hangs ends with its client and the service', async (t) => {
  const d = await daemon(t, { args: ['--workers', '2'] });
  const meshes = [];
  for (const n of [1, 2]) meshes.push((await d.upload(shapes.binaryPly(wobble(n, 5)))).json.id);
  const ids = meshes.join(',');
  const admin = async (...args) => (await run(binaries.daemon, ['crash', ...args, '--data', d.data])).stdout;
  let url;
  for (const signal of ['SIGSEGV', 'SIGKILL', 'SIGABRT']) {
    const one = await convert(d, ids, signal);
    url = one.url;
    assertProblem(await one.reply, 500, 'job-crashed');
  }
  const id = url.split('/').pop();
  const refused = new RegExp(`^[0-9a-f]{64} crashes=3 refused mesh=${id} tenant= last=`);
  await until(async () => refused.test(await admin('list')), 'three are counted', 30);
  const again = await d.get(`${url}/asset.glb?profile=meshopt`);
  assertProblem(again, 500, 'job-crashed');
  assert.match(again.json.detail, /Three processes/);
  assert.equal((await d.get(`${url}/asset.glb`)).status, 200, 'the asset itself is served');
  assert.equal((await d.get(`${url}/asset.glb?profile=quantized`)).status, 200, 'and other profiles are made');
  await admin('clear', id);

  const client = new AbortController();
  const first = await convert(d, ids, 'SIGSTOP', { signal: client.signal });
  client.abort();
  await first.reply;
  await until(() => !workers(d).includes(first.pid), 'the process ends with its client', 4);
  assert.equal(await admin('list'), '', 'which is no crash');

  const second = await convert(d, ids, 'SIGSTOP');
  const asked = Date.now();
  d.child.kill('SIGTERM');
  await second.reply;
  assert.equal((await d.exited).code, 0, d.log);
  assert.ok(Date.now() - asked < 5000 * patience, `it took ${Date.now() - asked} ms to stop`);
});

test('one process reads small files of one tenant, and none of another', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on', '--workers', '2', '--job-memory', '1G'] });
  const command = async (...args) => (await run(binaries.daemon, [...args, '--data', d.data])).stdout;
  const tenants = [];
  for (const name of ['one', 'two']) {
    const token = (await command('token', 'add', name, '--scope', 'read,write')).trim();
    tenants.push({ headers: { authorization: `Bearer ${token}` } });
  }
  let number = 0;
  const upload = async (as) => {
    const reply = await d.post('/v1/meshes', Buffer.from(shapes.binaryPly(wobble(++number, 2))), as);
    assert.equal(reply.status, 201, reply.bytes.toString());
    return reply;
  };
  /** Uploads until exactly one process remains: the one that reads the files of this tenant. */
  const reader = async (as) => {
    for (;;) {
      await upload(as);
      const [pid, more] = workers(d);
      if (pid && !more) return pid;
      await until(() => workers(d).length === 0, 'idle processes end', 20);
    }
  };
  await until(
    async () => {
      const first = await reader(tenants[0]);
      await upload(tenants[0]);
      return workers(d).length === 1 && workers(d)[0] === first;
    },
    'a process reads a second file',
    60,
  );
  await until(
    async () => {
      const first = await reader(tenants[0]);
      await upload(tenants[1]);
      return workers(d).length === 2 && workers(d).includes(first);
    },
    'the other tenant has a process of its own',
    60,
  );
  await until(() => workers(d).length === 0, 'idle processes end', 20);

  // The process dies during the second file, perhaps because of the first: the second is read again, and no file is
  // blamed.
  await until(
    async () => {
      const pid = await reader(tenants[0]);
      if (!told(pid, 'SIGSTOP')) return false;
      const reply = upload(tenants[0]);
      await sleep(50);
      told(pid, 'SIGABRT'); // sanitizers turn others into an exit
      told(pid, 'SIGCONT');
      await reply;
      return /a process that checked several meshes.* was killed by signal 6/.test(d.log);
    },
    'a process dies with its second file',
    60,
  );
  assert.equal(await command('crash', 'list'), '');
});

for (const what of ['landlock', 'seccomp'])
  test(`where ${what} is missing a line says so, and isolate = strict does not start`, {
    skip: !process.env.ORB_WITHOUT && 'ORB_WITHOUT names no program',
  }, async (t) => {
    const data = await mkdtemp(path.join(tmpdir(), 'orbmorph-test-'));
    t.after(() => rm(data, { recursive: true, force: true }));
    const start = (isolate) => {
      const args = [
        what,
        binaries.daemon,
        '--listen',
        '127.0.0.1:0',
        '--data',
        path.join(data, isolate),
        '--isolate',
        isolate,
      ];
      const child = spawn(process.env.ORB_WITHOUT, args, { stdio: ['ignore', 'pipe', 'pipe'] });
      const end = { text: '', code: new Promise((resolve) => child.once('exit', resolve)), child };
      for (const stream of [child.stdout, child.stderr]) stream.on('data', (chunk) => (end.text += chunk));
      t.after(() => child.kill('SIGKILL'));
      return end;
    };
    const strict = start('strict');
    assert.notEqual(await strict.code, 0, 'it refuses to start');
    assert.match(strict.text, new RegExp(`${what}.* missing here: .*isolate = strict does not start without`));
    const on = start('on');
    const [, url] = await until(() => /listening on (http:\S+)/.exec(on.text), 'it starts', 30);
    assert.match(on.text, new RegExp(`${what}.* missing here: the processes of jobs are limited, but less confined`));
    const reply = await fetch(`${url}/v1/meshes`, { method: 'POST', body: shapes.tetrahedron });
    assert.equal(reply.status, 201, await reply.text());
    on.child.kill('SIGTERM');
    assert.equal(await on.code, 0, on.text);
  });

/** A daemon whose processes cannot be confined while `fails(true)`. */
async function unconfinable(t, isolate) {
  const preloaded = preload([process.env.ORB_UNCONFINED_LIBRARY]);
  const folder = await mkdtemp(path.join(tmpdir(), 'orbmorph-test-'));
  const file = path.join(folder, 'fails');
  t.after(preloaded.remove);
  t.after(() => rm(folder, { recursive: true, force: true }));
  const d = await daemon(t, {
    args: ['--isolate', isolate, '--workers', '1'],
    env: { LD_PRELOAD: preloaded.value, ORB_UNCONFINED: file },
  });
  const fails = async (wanted) => {
    await (wanted ? writeFile(file, '') : rm(file, { force: true }));
    await until(() => workers(d).length === 0, 'processes that were forked before have ended', 20);
  };
  return { d, fails };
}
const preloads = { skip: !process.env.ORB_UNCONFINED_LIBRARY && 'ORB_UNCONFINED_LIBRARY names no library' };

test(
  'isolate = strict runs nothing in a process that cannot be confined, also while the daemon runs',
  preloads,
  async (t) => {
    const { d, fails } = await unconfinable(t, 'strict');
    const { json: mesh, status: code } = await d.upload(shapes.obj(shapes.egg(2)));
    assert.equal(code, 201);
    const line = /"level":"error"[^\n]*seccomp missing here[^\n]*isolate = strict does no work without/g;
    const lines = () => d.log.match(line)?.length ?? 0;
    const refused = (problem) => {
      assert.equal(problem.type, '/problems/internal');
      assert.match(problem.detail, /could not be confined, as isolate = strict demands/);
    };
    /** An upload of a small and of a larger file, and a job: none is done. */
    async function nothing() {
      for (const levels of [1, 6]) {
        const before = lines();
        const reply = await d.upload(shapes.binaryPly(wobble(lines(), levels)));
        assert.equal(reply.status, 500, reply.bytes.toString());
        refused(reply.json);
        await until(() => lines() > before, 'the log says so', 10);
      }
      const job = await d.ended((await d.post('/v1/embeddings', { mesh: mesh.id })).json);
      assert.equal(job.state, 'failed');
      refused(job.problem);
    }
    await fails(true);
    await nothing();
    process.kill(children(d.child.pid)[0], 'SIGKILL');
    await nothing();
    assert.deepEqual(children(d.child.pid), [], 'a new one that cannot confine is not kept');
    await fails(false);
    assert.equal((await d.made('/v1/embeddings', { mesh: mesh.id })).certificate.valid, true);
    const { stdout } = await run(binaries.daemon, ['crash', 'list', '--data', d.data]);
    assert.equal(stdout, '', 'which is no crash of the work');
  },
);

test('isolate = on says once that processes can no longer be confined, and goes on', preloads, async (t) => {
  const { d, fails } = await unconfinable(t, 'on');
  const warned = () => d.log.match(/"level":"warn"[^\n]*seccomp missing here[^\n]*/g)?.length ?? 0;
  await fails(true);
  assert.equal((await d.upload(shapes.tetrahedron)).status, 201);
  await until(() => warned() === 1, 'the log says so', 10);
  process.kill(children(d.child.pid)[0], 'SIGKILL');
  assert.equal((await d.upload(shapes.binaryPly(wobble(1, 2)))).status, 201);
  assert.equal(warned(), 1);
});

test('a job that needs more than its share of the memory runs again with all of it', async (t) => {
  for (const isolate of ['on', 'off']) {
    const d = await daemon(t, { args: ['--job-memory', '4M', '--isolate', isolate] });
    const ids = [];
    for (const k of [1, 2]) {
      const text = shapes.obj(shapes.ball(3, ([x, y, z]) => [x * (1 + 0.1 * Math.sin(3 * y + k)), y, z]));
      ids.push((await d.upload(text)).json.id);
    }
    const wish = {
      shapes: ids.map((mesh) => ({ mesh })),
      align: { method: 'rotate' },
      remesh: { method: 'adaptive', tolerance: 1e-6 },
    };
    const job = await d.ended((await d.post('/v1/supermeshes', wish)).json);
    assert.equal(job.state, 'succeeded', JSON.stringify(job.problem));
    assert.equal(job.attempt, 1, 'the attempt does not count');
    assert.match(
      d.log,
      new RegExp(`job ${job.id} needs more than its share of the memory and runs again with all of it`),
    );
    const small = await d.ended(
      (await d.post('/v1/embeddings', { mesh: (await d.upload(shapes.tetrahedron)).json.id })).json,
    );
    assert.equal(small.state, 'succeeded');
    assert.doesNotMatch(d.log, new RegExp(`job ${small.id} needs more`));
  }
});

test('within the service, as isolate = off asks, no process is forked', async (t) => {
  const d = await daemon(t, { args: ['--isolate', 'off'] });
  const { json: mesh } = await d.upload(shapes.tetrahedron);
  assert.equal((await d.made('/v1/embeddings', { mesh: mesh.id })).certificate.valid, true);
  assert.deepEqual(children(d.child.pid), []);
});

test('the end of the process that forks blames no job: all run again at once', async (t) => {
  const d = await daemon(t, { args: ['--workers', '2'] });
  const jobs = [(await slowJob(d, 1)).job, (await slowJob(d, 2)).job];
  for (let attempt = 1; attempt <= 3; attempt++) {
    await until(
      async () => {
        const now = await Promise.all(jobs.map(async (job) => (await d.get(job.url)).json));
        return now.every((job) => job.stage === 'embed' && job.attempt === attempt);
      },
      'both jobs run',
      60,
    );
    if (attempt < 3) process.kill(children(d.child.pid)[0], 'SIGKILL');
  }
  assert.match(d.log, /the process of the job ended with the process that forks them all/);
  const { stdout } = await run(binaries.daemon, ['crash', 'list', '--data', d.data]);
  assert.equal(stdout, '');
  for (const job of jobs) assert.equal((await d.delete(job.url)).status, 200);
});

test('the process that forks is started again', async (t) => {
  const d = await daemon(t);
  const [zygote] = children(d.child.pid);
  process.kill(zygote, 'SIGKILL');
  const { status: code, json: mesh } = await d.upload(shapes.tetrahedron);
  assert.equal(code, 201);
  assert.equal((await d.made('/v1/embeddings', { mesh: mesh.id })).certificate.valid, true);
  assert.equal(children(d.child.pid).length, 1);
});
