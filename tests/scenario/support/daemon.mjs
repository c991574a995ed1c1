// Starts a real daemon on a free port with its own data folder, and talks to it.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { setMaxListeners } from 'node:events';
import { readFileSync } from 'node:fs';
import { mkdtemp, rm, readFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { fileURLToPath } from 'node:url';

export const root = path.resolve(path.dirname(fileURLToPath(import.meta.url)), '../../..');
// Coarser animals with sanitizers, under the same names.
export const samples = process.env.ORB_SAMPLES ?? path.join(root, 'tests/samples');
export const binaries = {
  daemon: process.env.ORBMORPHD ?? path.join(root, 'build/bin/orbmorphd'),
  client: process.env.ORBMORPH ?? path.join(root, 'build/bin/orbmorph'),
};
// A build with sanitizers is several times slower; there long tests do less.
export const slow = process.env.ORB_SLOW === '1';
// Factor by which tests wait longer than usual: under memcheck, or on a busy machine.
export const patience = Number(process.env.ORB_TEST_PATIENCE ?? 1);
assert.ok(patience >= 1, 'ORB_TEST_PATIENCE is a factor of at least 1');
// Milliseconds that a test pauses after each response: finds tests that depend on seeing a job before it ends.
const dawdle = Number(process.env.ORB_TEST_DAWDLE ?? 0);
assert.ok(dawdle >= 0, 'ORB_TEST_DAWDLE is in milliseconds');

// fetch() compiles its HTTP parser while it holds its first connection. If the server dies meanwhile, undici 6.24 (in
// Node 20.20) misses the end of the connection, and the promise never settles. So the first request goes to a server
// that does not die.
const first = createServer((_, response) => response.setHeader('connection', 'close').end());
await new Promise((resolve) => first.listen(0, '127.0.0.1', resolve));
await (await fetch(`http://127.0.0.1:${first.address().port}/`)).arrayBuffer();
await new Promise((resolve) => first.close(resolve));

/**
 * An embedding that takes a minute of processor time for 2,000 triangles, and four times as long for four times as many:
 * thousands of samples a triangle, and a global optimisation to the last bit after every few vertices. With 8,000
 * triangles it keeps a worker until it is cancelled.
 */
export const endless = {
  method: 'kernel-sampling',
  options: { step: 0.01, growth: 1.01, first_optimization: 1, displacement_threshold: 1e-15, max_iterations: 1000000 },
};

/** Repeats `check` until its result is true, and returns that result. Fails after `seconds`. */
export async function until(check, what, seconds = 300) {
  for (const end = Date.now() + 1000 * seconds * patience; ; await new Promise((done) => setTimeout(done, 20))) {
    const value = await check();
    if (value) return value;
    assert.ok(Date.now() < end, `not within ${seconds * patience} s: ${what}`);
  }
}

const START_MS = patience * (slow ? 300_000 : 120_000);
const STOP_MS = START_MS;
const OVER_MS = 5000; // from the daemon's end to that of its requests, which a closed connection ends at once

export class Daemon {
  constructor(data, args, env) {
    Object.assign(this, { data, args, env, log: '', out: '', asking: 0 });
  }

  async start() {
    const began = Date.now();
    this.out = '';
    const [program, ...before] = this.program ?? [binaries.daemon];
    const child = spawn(program, [...before, '--listen', '127.0.0.1:0', '--data', this.data, ...this.args], {
      stdio: ['ignore', 'pipe', 'pipe'],
      env: { ...process.env, ...this.env },
    });
    this.child = child;
    this.exited = new Promise((resolve) => child.once('exit', (code, signal) => resolve({ code, signal })));
    // A busy undici misses the end of a connection once in many hundred deaths of a server, and then waits forever.
    const over = new AbortController();
    setMaxListeners(0, over.signal); // each request in flight has one
    this.over = over;
    this.exited.then(() => {
      const timer = setTimeout(() => over.abort(new Error('the daemon has ended')), OVER_MS);
      if (!this.asking) timer.unref(); // nobody waits for it
    });
    child.stderr.on('data', (chunk) => (this.log = (this.log + chunk).slice(-200_000)));
    this.url = await new Promise((resolve, reject) => {
      const fail = (why) => {
        clearTimeout(timer);
        reject(new Error(`the daemon did not start: ${why}\n${this.log}`));
      };
      const timer = setTimeout(() => fail('no line in time'), START_MS);
      child.once('error', (error) => fail(error.message));
      child.once('exit', (code, signal) => fail(`exit ${code ?? signal}`));
      child.stdout.on('data', (chunk) => {
        this.out += chunk;
        const line =
          /^orbmorphd (?:listening on (http:\/\/\S+)|works(?: without a port|; metrics on (http:\/\/\S+)))\n/m.exec(
            this.out,
          );
        if (line) {
          clearTimeout(timer);
          resolve(line[1] ?? line[2]);
        }
      });
    });
    this.start_ms = Date.now() - began;
    this.start_cpu_ms = this.cpuMs();
    return this;
  }

  /** Processor time of all its threads so far. */
  cpuMs() {
    const fields = readFileSync(`/proc/${this.child.pid}/stat`, 'latin1').split(') ').pop().split(' ');
    return 10 * (Number(fields[11]) + Number(fields[12])); // user and system, in ticks of 1/100 s
  }

  /** Ends it with a signal; resolves to {code, signal}. */
  async stop(signal = 'SIGTERM') {
    if (this.child.exitCode === null && this.child.signalCode === null) this.child.kill(signal);
    return this.exited;
  }

  /** fetch() that ends with the daemon. */
  async ask(url, { signal, ...init }) {
    const alive = this.over?.signal;
    this.asking++;
    try {
      const response = await fetch(url, {
        ...init,
        signal: signal && alive ? AbortSignal.any([signal, alive]) : (signal ?? alive),
      });
      return { response, bytes: Buffer.from(await response.arrayBuffer()) };
    } finally {
      this.asking--;
    }
  }

  /** Waits until each of several nodes knows a new token. They answer in turn and learn of it by a notice. */
  async known(options) {
    let known = 0;
    await until(async () => {
      known = (await this.get('/v1/jobs', options)).status === 401 ? 0 : known + 1;
      return known >= Number(process.env.ORB_NODES);
    }, 'all nodes know the token');
    return options;
  }

  /** The same for a resource that was deleted. A single daemon must know at once, so there this waits for nothing. */
  async gone(url, options) {
    if (!process.env.ORB_NODES) return;
    let gone = 0;
    await until(async () => {
      gone = (await this.get(url, options)).status === 404 ? gone + 1 : 0;
      return gone >= Number(process.env.ORB_NODES);
    }, 'all nodes know that it is deleted');
  }

  async request(method, target, { body, headers, query, signal } = {}) {
    const url = new URL(target, this.url);
    for (const [name, value] of Object.entries(query ?? {})) url.searchParams.set(name, value);
    // A test that computed for a long time has not yet seen that the daemon closed an idle connection: lets fetch() see
    // it.
    for (let turn = 0; turn < 2; turn++) await new Promise(setImmediate);
    const isJson = body !== undefined && !(body instanceof Uint8Array) && typeof body !== 'string';
    const { response, bytes } = await this.ask(url, {
      method,
      signal,
      body: isJson ? JSON.stringify(body) : body,
      // fetch() would ask for compressed answers, with other ETags and lengths; a test that wants them says so.
      headers: { 'accept-encoding': 'identity', ...(isJson ? { 'content-type': 'application/json' } : {}), ...headers },
    });
    const type = response.headers.get('content-type') ?? '';
    const json = /json/.test(type) && bytes.length ? JSON.parse(bytes.toString()) : undefined;
    if (dawdle) await new Promise((done) => setTimeout(done, dawdle));
    return { status: response.status, headers: response.headers, type, bytes, json };
  }

  get(target, options) {
    return this.request('GET', target, options);
  }

  post(target, body, options) {
    return this.request('POST', target, { body, ...options });
  }

  delete(target, options) {
    return this.request('DELETE', target, options);
  }

  upload(bytes, query = {}) {
    return this.post('/v1/meshes', typeof bytes === 'string' ? Buffer.from(bytes) : bytes, { query });
  }

  async uploadFile(file, query = {}) {
    return this.upload(await readFile(file), { name: path.parse(file).name, ...query });
  }

  /** Uploads a file that must be accepted; resolves to the mesh. */
  async mesh(file, query) {
    const reply = await this.uploadFile(file, query);
    assert.ok([200, 201].includes(reply.status), `${file}: ${reply.status} ${reply.bytes}`);
    return reply.json;
  }

  /** Waits for the end of a job. */
  async ended(job, { seconds = slow ? 3600 : 900 } = {}) {
    const until = Date.now() + 1000 * seconds * patience;
    while (!['succeeded', 'failed', 'cancelled'].includes(job.state)) {
      assert.ok(Date.now() < until, `job ${job.id} has not ended: ${JSON.stringify(job)}`);
      const reply = await this.get(job.url, { query: { wait: 20 } });
      assert.equal(reply.status, 200, reply.bytes.toString());
      job = reply.json;
    }
    return job;
  }

  /** Posts a request for a derived resource and waits; resolves to {status, resource, job}, or {status, problem}. */
  async make(target, body) {
    const reply = await this.post(target, body);
    if (reply.status === 200) return { status: 200, resource: reply.json };
    if (reply.status !== 202) return { status: reply.status, problem: reply.json };
    const job = await this.ended(reply.json);
    if (job.state !== 'succeeded') return { status: 202, job, problem: job.problem };
    const made = await this.get(job.result);
    assert.equal(made.status, 200, made.bytes.toString());
    return { status: 202, job, resource: made.json };
  }

  async made(target, body) {
    const result = await this.make(target, body);
    assert.ok(result.resource, `refused: ${JSON.stringify(result.problem)}`);
    return result.resource;
  }
}

/**
 * Starts a daemon; when the test ends, it is stopped and its data is deleted. program: the command that starts it, with
 * arguments.
 */
export async function daemon(t, { args = [], env = {}, program } = {}) {
  const data = await mkdtemp(path.join(tmpdir(), 'orbmorph-test-'));
  const made = Object.assign(new Daemon(data, args, env), { program });
  t.after(async () => {
    if (made.child) {
      const killer = setTimeout(() => made.child.kill('SIGKILL'), STOP_MS);
      const { code, signal } = await made.stop();
      clearTimeout(killer);
      await rm(data, { recursive: true, force: true });
      assert.ok(made.killed || code === 0, `the daemon ended with ${code ?? signal}\n${made.log}`);
    }
  });
  return made.start();
}

/** A problem document of the given type and status. */
export function assertProblem(reply, status, type, what = '') {
  const text = `${what} ${reply.status} ${reply.bytes.toString().slice(0, 500)}`;
  assert.equal(reply.status, status, text);
  assert.equal(reply.type.split(';')[0], 'application/problem+json', text);
  assert.equal(reply.json.type, `/problems/${type}`, text);
  assert.equal(reply.json.status, status, text);
  for (const member of ['title', 'detail']) {
    assert.equal(typeof reply.json[member], 'string', text);
    assert.ok(reply.json[member].length > 0, text);
  }
  if (type === 'bad-query') assert.equal(typeof reply.json.parameter, 'string', text);
}
