// Parts of the scenario "faults": the board that tells the interposer what to fail (tests/faults/interpose.c), and a
// client that sends a fixed sequence of requests and notes what the daemon accepted.
import assert from 'node:assert/strict';
import { closeSync, openSync, readSync, writeFileSync, writeSync } from 'node:fs';
import path from 'node:path';
import { gzipSync } from 'node:zlib';
import * as shapes from './shapes.mjs';

export const kinds = ['alloc', 'write', 'fsync', 'rename', 'folder', 'open', 'thread', 'sqlite'];
/** Kinds with thousands of calls: they fail at the first call of each site, the others at each call. */
export const by_site = ['alloc', 'folder', 'sqlite'];
const modes = { once: 1, ever: 2 };
const at = { mode: 0, kind: 4, wanted: 8, met: 12, passed: 16 };
const sizes = { board: 20, sites: 8 * 65536 };

/** The list of sites that have failed, shared by daemons that run at the same time. */
export function makeSites(file) {
  writeFileSync(file, Buffer.alloc(sizes.sites));
  return file;
}

/** struct board: a file that daemons map, one after the other. */
export class Board {
  constructor(folder) {
    this.file = path.join(folder, 'board');
    this.fd = openSync(this.file, 'w+');
    writeSync(this.fd, Buffer.alloc(sizes.board), 0, sizes.board, 0);
  }
  set(field, value) {
    const bytes = Buffer.alloc(4);
    bytes.writeUInt32LE(value);
    writeSync(this.fd, bytes, 0, 4, at[field]);
  }
  get(field) {
    const bytes = Buffer.alloc(4);
    readSync(this.fd, bytes, 0, 4, at[field]);
    return bytes.readUInt32LE();
  }
  /** Makes call number `wanted` fail; 0: the first call at a new site. */
  arm(kind, mode, wanted) {
    this.disarm();
    this.set('kind', kinds.indexOf(kind));
    this.set('wanted', wanted);
    this.set('met', 0);
    this.set('passed', 0);
    this.set('mode', modes[mode]);
  }
  disarm() {
    this.set('mode', 0);
    return this.get('met') === 1;
  }
  close() {
    closeSync(this.fd);
  }
}

/** A client that records what the daemon accepted. If `calm`, every request must succeed. */
export class Caller {
  meshes = [];
  jobs = [];
  seen = 0; // the number of jobs that have ended
  made = 0;
  constructor(d, patience) {
    Object.assign(this, { d, patience });
  }

  /** Returns the reply, or null if the connection broke or the response is an error. */
  async ask(calm, method, target, options = {}) {
    let reply;
    try {
      reply = await this.d.request(method, target, { signal: AbortSignal.timeout(this.patience), ...options });
    } catch (error) {
      if (error.name === 'TimeoutError' && !options.signal) throw new Error(`no answer in time to ${method} ${target}`);
      assert.ok(!calm, `${method} ${target}: ${error.cause ?? error}`);
      return null;
    }
    if (reply.status >= 400) {
      assert.equal(reply.type, 'application/problem+json', `${method} ${target}: ${reply.status}`);
      assert.equal(reply.json.status, reply.status);
      assert.ok(!calm, `${method} ${target}: ${reply.bytes}`);
      return null;
    }
    return reply;
  }

  newMesh() {
    const k = ++this.made;
    return Buffer.from(shapes.obj(shapes.ball(1, ([x, y, z]) => [x * (1 + 0.1 * Math.sin(k)), y, z + 1e-3 * k])));
  }

  async upload(calm, body, options = {}) {
    const reply = await this.ask(calm, 'POST', '/v1/meshes', { body, query: { name: 'm' }, ...options });
    if (reply) this.meshes.push(reply.json.url);
    return reply?.json;
  }

  /** Requests a resource and waits for its job. Returns the URL of the resource on success. */
  async make(calm, target, body) {
    const reply = await this.ask(calm, 'POST', target, { body });
    if (!reply) return null;
    if (reply.status === 200) return reply.json.url;
    this.jobs.push(reply.json.url);
    if (calm) {
      const end = await this.d.ended(reply.json);
      assert.equal(end.state, 'succeeded', JSON.stringify(end));
      return end.result;
    }
    const job = await this.ask(calm, 'GET', reply.json.url, { query: { wait: 3 } });
    const over = ['succeeded', 'failed'].includes(job?.json.state);
    await this.ask(calm, 'GET', `${reply.json.url}/events`, over ? {} : { signal: AbortSignal.timeout(300) });
    return job?.json.result;
  }

  /** Makes meshes, an embedding and a supermesh, and reads everything about them. */
  async sequence(calm) {
    const a = await this.upload(calm, this.newMesh());
    const b = await this.upload(calm, gzipSync(this.newMesh()), { headers: { 'content-encoding': 'gzip' } });
    const mesh = a ?? b;
    await this.ask(calm, 'GET', '/v1/meshes', { query: { limit: 2 } });
    if (!mesh) return;
    const embedding = await this.make(calm, '/v1/embeddings', { mesh: mesh.id });
    if (embedding) await this.ask(calm, 'GET', `${embedding}/sphere.ply`);
    const supermesh = await this.make(calm, '/v1/supermeshes', {
      shapes: [{ mesh: mesh.id }, { mesh: (b ?? mesh).id }],
      align: { method: 'rotate' },
      remesh: { method: 'overlay' },
    });
    if (supermesh) {
      const asset = await this.ask(calm, 'GET', `${supermesh}/asset.glb`);
      await this.ask(calm, 'GET', `${supermesh}/asset.glb`, { headers: { range: 'bytes=0-99' } });
      await this.ask(calm, 'GET', supermesh);
      await this.ask(calm, 'GET', `${supermesh}/places`);
      if (asset) await this.upload(calm, asset.bytes);
    }
    await this.ask(calm, 'GET', '/v1/jobs');
    await this.ask(calm, 'GET', '/metrics');
    if (embedding) await this.ask(calm, 'DELETE', embedding);
  }

  /** A brief check: uploads a mesh, runs a job, and lists both. */
  async glance() {
    const mesh = await this.upload(true, this.newMesh());
    await this.make(true, '/v1/embeddings', { mesh: mesh.id });
    await this.ask(true, 'GET', '/v1/meshes', { query: { limit: 2 } });
  }

  /** Without faults: everything that the daemon accepted exists. Checks meshes of earlier phases only if `all`. */
  async audit(all) {
    for (const url of this.jobs.slice(all ? 0 : this.seen)) {
      const reply = await this.d.get(url);
      assert.equal(reply.status, 200, `the accepted job ${url} is lost: ${reply.bytes}`);
      const end = await this.d.ended(reply.json);
      assert.ok(end.state === 'succeeded' || (end.state === 'failed' && end.problem.detail), JSON.stringify(end));
    }
    this.seen = this.jobs.length;
    for (const url of all ? this.meshes : this.meshes.slice(-3))
      assert.equal((await this.d.get(`${url}/file`)).status, 200, `the accepted mesh ${url} is lost`);
  }
}
