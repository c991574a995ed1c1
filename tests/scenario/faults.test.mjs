// Injects faults: makes the daemon's allocations, writes, fsyncs, renames, folder changes, opens, SQLite calls and
// thread starts fail, one call ("once") or all calls from one on ("ever"), while it starts, answers a fixed sequence of
// requests, restarts with its data, and stops. Every time it must give an answer, an error response or a clean stop;
// it must never crash or hang. Afterwards, without faults, it must work again and have lost nothing that it accepted.
//
// ORB_FAULT_RUNS is the number of faults (48; 21 with sanitizers), a sample. "all" continues for each kind and both
// modes until a run in which no call fails. It numbers the calls 1, 2, 3 …; kinds with thousands of calls it takes by
// call site, the chain of the seven innermost callers. "few" omits the allocations. ORB_FAULT_KINDS (default: all) is a
// comma-separated list of kinds; ORB_FAULT_SEED (1) selects the sample; ORB_FAULT_PARALLEL is the number of daemons at
// once. Unless TMPDIR is set, the data is in memory, which saves the time of real fsyncs.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { existsSync, mkdirSync } from 'node:fs';
import { mkdtemp, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import test from 'node:test';
import { promisify } from 'node:util';
import { binaries, Daemon, patience, slow } from './support/daemon.mjs';
import * as faults from './support/faults.mjs';
import { preload } from './support/preload.mjs';

const library = process.env.ORB_INTERPOSE;
const sanitizer = process.env.ORB_INTERPOSE_BEFORE;
const wanted = process.env.ORB_FAULT_RUNS ?? (slow ? '21' : '48');
const all = !(Number(wanted) > 0);
const side_by_side = Number(process.env.ORB_FAULT_PARALLEL ?? (all ? 6 : 3)); // the daemons wait more than they compute
const longest = 200_000 * patience; // milliseconds to wait for an answer or an exit
// A sanitizer has its own allocator: the interposer sees allocations only if it is preloaded before the sanitizer.
const asked = !slow || sanitizer;
const kinds = (process.env.ORB_FAULT_KINDS ?? faults.kinds.join(','))
  .split(',')
  .filter((kind) => kind !== 'alloc' || (wanted !== 'few' && asked));
const seed = Number(process.env.ORB_FAULT_SEED ?? 1);
const arguments_ = ['--workers', '1', '--io-threads', '1', '--drain-seconds', '2', '--max-connections', '64'];
const base = !process.env.TMPDIR && existsSync('/dev/shm') ? '/dev/shm' : tmpdir();
const run = promisify(execFile);

/** A data folder, its daemon with the interposer, and the board that controls the faults. */
class Place {
  constructor(folder, sites, preloaded) {
    mkdirSync(folder);
    Object.assign(this, { sites, preloaded });
    this.board = new faults.Board(folder);
    this.folder = folder;
    this.lives = this.stops = 0;
    this.fresh();
  }
  fresh() {
    this.data = path.join(this.folder, `data-${++this.lives}`);
    this.d = new Daemon(this.data, arguments_, {
      LD_PRELOAD: this.preloaded,
      ORB_FAIL_BOARD: this.board.file,
      ORB_FAIL_SITES: this.sites,
    });
    this.caller = new faults.Caller(this.d, longest);
  }
  get alive() {
    return this.d.child && this.d.child.exitCode === null && this.d.child.signalCode === null;
  }

  /** Waits until the daemon exits. It must exit with a status; a signal fails the test. */
  async stopped(how) {
    const timer = setTimeout(() => this.d.child.kill('SIGABRT'), longest);
    const { code, signal } = await this.d.exited;
    clearTimeout(timer);
    if (slow) await new Promise((resolve) => setTimeout(resolve, 20)); // lets the end of its log arrive
    assert.doesNotMatch(this.d.log, /(Address|Leak|Undefined\w*)Sanitizer|runtime error:/, how);
    assert.equal(signal, null, `${how}: it ${signal === 'SIGABRT' ? 'aborted or hung' : 'died'}: ${signal}`);
    return code;
  }
  async stop(how) {
    if (this.alive) this.d.child.kill('SIGTERM');
    return this.stopped(how);
  }

  /** Starts the daemon on its data without faults; everything must work. */
  async revive() {
    this.board.disarm();
    this.d.log = '';
    await this.d.start();
    await this.caller.audit(true);
  }

  /** Stops the daemon and checks the data folder: nothing is lost, nothing is torn. Then begins a new folder. */
  async finish() {
    if (!this.alive) await this.revive();
    assert.equal(await this.stop('without faults'), 0);
    const { stdout } = await run(binaries.daemon, ['--check-data', '--data', this.data]);
    assert.match(stdout, / 0 wrong/);
    await rm(this.data, { recursive: true, force: true });
    this.fresh();
  }

  async close() {
    await this.abandon();
    this.board.close();
  }

  /** Kills the daemon, deletes its data and begins a new folder. */
  async abandon() {
    this.board.disarm();
    if (this.alive) {
      this.d.child.kill('SIGKILL');
      await this.d.exited;
    }
    await rm(this.data, { recursive: true, force: true });
    this.fresh();
  }
}

/** Each calls `arm` at the right moment and leaves a place that works; returns whether a call failed. */
const phases = {
  /** Starts the daemon, on an empty folder or on existing data. */
  async start(place, arm) {
    arm();
    try {
      await place.d.start();
    } catch {
      const met = place.board.disarm();
      if (place.alive) place.d.child.kill('SIGTERM'); // it runs, but the line that says so was lost
      assert.notEqual(await place.stopped('at its start'), 0, 'a start that failed must say so');
      await place.revive();
      return met;
    }
    const met = place.board.disarm();
    await place.caller.audit(true);
    return met;
  },
  async work(place, arm) {
    if (!place.alive) await place.revive();
    arm();
    await place.caller.sequence(false);
    const met = place.board.disarm();
    if (!place.alive) {
      await place.stopped('while it ran');
      place.stops++;
      await place.revive();
    }
    await place.caller.audit(false);
    return met;
  },
  async stop(place, arm) {
    if (!place.alive) await place.revive();
    arm();
    await place.stop('while it stopped');
    const met = place.board.disarm();
    await place.revive();
    return met;
  },
};
const beginnings = {
  first: (place) => place.abandon(),
  again: async (place) => {
    if (!place.alive) await place.revive();
    if (!place.caller.jobs.length) await place.caller.sequence(true);
    const mesh = await place.caller.upload(true, place.caller.newMesh());
    await place.caller
      .ask(true, 'POST', '/v1/embeddings', { body: { mesh: mesh.id } })
      .then((reply) => place.caller.jobs.push(reply.json.url));
    place.d.child.kill('SIGKILL'); // with an accepted job that may be running
    await place.d.exited;
  },
  work: async () => {},
  stop: async () => {},
};
const phase_of = { first: phases.start, again: phases.start, work: phases.work, stop: phases.stop };

class Runner {
  planned = 0;
  faults = 0;
  failed = [];
  told = {};

  /** Injects one fault; returns whether it happened. */
  async one(place, when, kind, mode, number) {
    this.planned++;
    const what = `${kind} ${number ? `#${number}` : 'at a new site'} ${mode} (${when})`;
    try {
      await beginnings[when](place);
      const met = await phase_of[when](place, () => place.board.arm(kind, mode, number));
      if (met) {
        this.faults++;
        this.told[`${kind} ${when}`] = (this.told[`${kind} ${when}`] ?? 0) + 1;
        // It must work again. A brief check does for a repeated start, and for nine of ten faults by call site.
        const brief = when !== 'work' || (faults.by_site.includes(kind) && this.faults % 10 !== 0);
        await (brief ? place.caller.glance() : place.caller.sequence(true));
        if (this.faults % 100 === 0 && all)
          console.error(`${this.faults} faults, ${this.failed.length} failed; at ${what}`);
      }
      return met;
    } catch (error) {
      this.failed.push(`${what}: ${error.message}`);
      console.error(`${what}: ${error.message}\n${place.d.log.slice(-6000)}`);
      await place.abandon();
      return true;
    }
  }

  /** Injects faults on all places in parallel until no new call fails. */
  async exhaust(places, kind, mode) {
    const sites = faults.by_site.includes(kind);
    for (const when of Object.keys(phase_of)) {
      const needed = sites && when !== 'first' ? 2 * places.length : 1; // not every run passes every site
      let next = 1;
      let clean = 0;
      const work = async (place) => {
        while (clean < needed) {
          const n = next++;
          clean = (await this.one(place, when, kind, mode, sites ? 0 : n)) ? 0 : clean + 1;
          if (n % 40 === 0) await this.end(place, `${kind} ${mode} (${when})`);
        }
        await this.end(place, `${kind} ${mode} (${when})`);
      };
      await Promise.all(places.map(work));
    }
  }

  /** Injects `count` faults over the phases, at a stride with a seeded start, alternately once and ever. */
  async sample(place, kind, count) {
    const start = (seed * 0.6180339887498949) % 1;
    for (const [when, share] of [
      ['first', 1],
      ['again', 1],
      ['work', Math.max(1, count - 3)],
      ['stop', 1],
    ]) {
      await beginnings[when](place);
      await phase_of[when](place, () => place.board.arm(kind, 'once', 0xffffffff));
      const calls = place.board.get('passed');
      for (let i = 0; i < share && i < calls; i++) {
        // A run may make fewer calls than the one that counted them: then an earlier call fails instead.
        let number = 1 + Math.floor(((i + start) * calls) / share);
        while (!(await this.one(place, when, kind, (i + seed) % 2 ? 'once' : 'ever', number)) && number > 1) {
          number = Math.floor((number + 1) / 2);
          this.planned--;
        }
      }
    }
    await this.end(place, kind);
  }

  async end(place, what) {
    try {
      await place.finish();
    } catch (error) {
      this.failed.push(`the end of ${what}: ${error.message}`);
      console.error(`the end of ${what}: ${error.message}\n${place.d.log.slice(-6000)}`);
      await place.abandon();
    }
  }
}

const skip = library ? false : 'ORB_INTERPOSE names no library';
test('a failing call gives an error response, not a crash', { skip }, async (t) => {
  const runner = new Runner();
  const folder = await mkdtemp(path.join(base, 'orbmorph-fault-'));
  const preloaded = preload([library, sanitizer].filter(Boolean));
  const places = Array.from(
    { length: side_by_side },
    (_, i) => new Place(path.join(folder, `${i}`), path.join(folder, 'sites'), preloaded.value),
  );
  const tasks = kinds.flatMap((kind) => (all ? ['once', 'ever'] : ['']).map((mode) => [kind, mode]));
  try {
    for (const [kind, mode] of all ? tasks : []) {
      faults.makeSites(path.join(folder, 'sites'));
      await runner.exhaust(places, kind, mode);
    }
    faults.makeSites(path.join(folder, 'sites'));
    const sample = async (place) => {
      for (let task; !all && (task = tasks.shift()); )
        await runner.sample(place, task[0], Math.ceil(Number(wanted) / kinds.length));
    };
    await Promise.all(places.map(sample));
  } finally {
    for (const place of places) await place.close();
    preloaded.remove();
    await rm(folder, { recursive: true, force: true });
  }
  const stops = places.reduce((sum, place) => sum + place.stops, 0);
  t.diagnostic(
    `${runner.faults} faults, ${runner.failed.length} failed; the daemon stopped by itself ${stops} times while it ran`,
  );
  for (const kind of kinds)
    t.diagnostic(
      `${kind}: ${Object.keys(phase_of)
        .map((when) => `${runner.told[`${kind} ${when}`] ?? 0} ${when}`)
        .join(', ')}`,
    );
  assert.deepEqual(
    runner.failed.map((message) => message.split('\n')[0]),
    [],
  );
  assert.ok(
    runner.faults > 0 && (all || runner.faults >= 0.8 * runner.planned),
    `only ${runner.faults} of ${runner.planned} faults were met`,
  );
});
