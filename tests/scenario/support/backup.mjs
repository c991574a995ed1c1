// Parts of the scenario "backup": a load that notes what the daemon acknowledged and when, and programs that are
// stopped or killed at a known moment.
import assert from 'node:assert/strict';
import { spawn, spawnSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { readFileSync, renameSync } from 'node:fs';
import { setImmediate as turn, setTimeout as sleep } from 'node:timers/promises';
import { binaries, patience, until } from './daemon.mjs';
import * as shapes from './shapes.mjs';

export const mesh = (k) => shapes.obj(shapes.ball(2, ([x, y, z]) => [x * (1 + 0.3 * Math.sin(5 * y + k)), 1.5 * y, z]));
export const sha256 = (bytes) => createHash('sha256').update(bytes).digest('hex');
const now = () => performance.now();

/** Puts a FIFO in the place of a file: a program that opens it waits there. Returns what puts the file back. */
export function trap(file, aside) {
  renameSync(file, aside);
  assert.equal(spawnSync('mkfifo', [file]).status, 0);
  return () => renameSync(aside, file);
}

/** Makes the two below, and ends them when the test ends: before the daemons of a test that calls this first. */
export function watching(t) {
  const all = [];
  t.after(() => {
    for (const one of all) one.halt();
  });
  const keep = (one) => {
    all.push(one);
    return one;
  };
  return { run: (...args) => keep(new Watched(...args)), load: (d) => keep(new Load(d)) };
}

/** A process of orbmorphd that is watched at every turn of the event loop. */
class Watched {
  constructor(...args) {
    this.since = now();
    this.child = spawn(binaries.daemon, args, { stdio: ['ignore', 'pipe', 'pipe'] });
    this.text = '';
    for (const stream of [this.child.stdout, this.child.stderr]) stream.on('data', (chunk) => (this.text += chunk));
    this.ended = new Promise((done) => this.child.once('close', (code, signal) => done(code ?? signal)));
  }
  halt() {
    this.child.kill('SIGKILL');
  }
  /** Sends a signal as soon as `check` holds. False: the process ended before. */
  async signal(name, check) {
    for (const end = now() + 120_000 * patience; !check(); await turn()) {
      if (this.child.exitCode !== null) return false;
      assert.ok(now() < end, `not in time: ${check}\n${this.text}`);
    }
    return this.child.kill(name);
  }
  /** Stops the process where `check` holds. False: it was too fast, and ended or will end. */
  async stop(check) {
    const state = () => /\) (.)/.exec(readFileSync(`/proc/${this.child.pid}/stat`, 'latin1'))[1];
    if (!(await this.signal('SIGSTOP', check))) return false;
    while (this.child.exitCode === null && !'TZ'.includes(state())) await turn();
    if (this.child.exitCode === null && state() === 'T' && check()) return true;
    this.child.kill('SIGCONT');
    return false;
  }
}

/** Uploads, deletes and jobs, over deaths of the daemon as well, but while it `rests`. */
class Load {
  meshes = new Map(); // url → {sha, since, asked, gone}: when it was acknowledged, its deletion requested and acknowledged
  jobs = new Map(); // url → {since, state, ended}
  spheres = new Map(); // url → SHA-256
  deleted = 0;
  made = 0;
  rests = false;

  constructor(d) {
    this.d = d;
    this.busy = true;
    this.loops = [this.#loop(this.#files), this.#loop(this.#results)];
  }
  halt() {
    this.busy = false;
  }
  async end() {
    this.halt();
    await Promise.all(this.loops);
    if (this.failed) throw this.failed;
  }
  /** Waits until the load has made `check` true; fails with the load. */
  until(check, what) {
    return until(() => {
      if (this.failed) throw this.failed;
      return check();
    }, what);
  }

  async #loop(round) {
    for (let k = 0; this.busy; k++) {
      try {
        await round.call(this, k);
      } catch (error) {
        if (error instanceof assert.AssertionError) this.failed ??= error; // a wrong answer, not a broken connection
      }
      do await sleep(60);
      while (this.rests && this.busy);
    }
  }

  async upload(text) {
    const reply = await this.d.upload(text);
    assert.equal(reply.status, 201, reply.bytes.toString());
    this.meshes.set(reply.json.url, { sha: sha256(text), since: now(), asked: Infinity, gone: Infinity });
    return reply.json;
  }
  async delete(url) {
    const one = this.meshes.get(url);
    one.asked = now();
    const reply = await this.d.delete(url);
    assert.equal(reply.status, 204, reply.bytes.toString());
    one.gone = now();
    this.deleted++;
  }

  #first; // of the files that stay until the next one has come
  async #files(k) {
    const { url } = await this.upload(mesh(1000 + k));
    if (k % 3) return;
    const first = this.#first;
    this.#first = url; // now: a deletion without an answer may have happened, and is not requested again
    if (first) await this.delete(first);
  }
  /** An embedding of 80 kB. */
  async #results(k) {
    const { id } = await this.upload(shapes.obj(shapes.ball(4, ([x, y, z]) => [x, y, z * (1 + k / 500)])));
    const { status, json, bytes } = await this.d.post('/v1/embeddings', { mesh: id });
    assert.equal(status, 202, bytes.toString());
    const job = { since: now(), ended: Infinity };
    this.jobs.set(json.url, job);
    const { state, result } = await this.d.ended(json);
    assert.equal(state, 'succeeded');
    Object.assign(job, { state, ended: now() });
    this.made++;
    const sphere = await this.d.get(`${result}/sphere.ply`);
    if (sphere.status === 200) this.spheres.set(`${result}/sphere.ply`, sha256(sphere.bytes));
  }

  /** A daemon on what was restored of a backup, made from `since` to `done`, has all that it must have. */
  async check(d, { since, done }) {
    assert.equal((await d.get('/readyz')).status, 200);
    let must = 0;
    for (const [url, one] of this.meshes) {
      const { status, bytes } = await d.get(`${url}/file`);
      const stays = one.since < since && one.asked > done;
      must += stays;
      if (stays) assert.equal(status, 200, `${url} is lost`);
      else if (one.gone < since) assert.equal(status, 404, `${url} is back`);
      if (status === 200) assert.equal(sha256(bytes), one.sha, `${url} has other bytes`);
      else assert.equal(status, 404, `${url}: ${bytes}`);
    }
    for (const [url, one] of this.jobs) {
      if (one.since > since) continue;
      const { status, json } = await d.get(url);
      assert.equal(status, 200, `${url} is lost`);
      if (one.ended < since) assert.equal(json.state, one.state, url);
      else assert.ok(['queued', 'running', 'succeeded'].includes(json.state), `${url}: ${json.state}`);
    }
    for (const { sphere } of (await d.get('/v1/embeddings?limit=500')).json.embeddings) {
      const { status, bytes } = await d.get(sphere);
      assert.equal(status, 200, `${sphere}: ${bytes}`);
      if (this.spheres.has(sphere)) assert.equal(sha256(bytes), this.spheres.get(sphere), sphere);
    }
    return must;
  }
}
