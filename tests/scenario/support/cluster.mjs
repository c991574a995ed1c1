// Several nodes on one catalogue in PostgreSQL and one bucket of S3, under tests/tools/with_postgresql.sh and with_s3.sh.
import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import { mkdtemp, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { Daemon, patience, until } from './daemon.mjs';

const program = process.env.ORB_DAEMON; // starts a daemon with its own catalogue and objects
assert.ok(
  program && process.env.ORB_POSTGRESQL && process.env.ORB_S3,
  'to be run by with_postgresql.sh and with_s3.sh',
);
export const LEASE = 4; // seconds; a busy machine must not pause a node for so long
const OBJECTS = 0x6f726d + 4; // SQL_LOCK_OBJECTS of server/store/sql.h

/** Nodes that share a catalogue and a bucket. */
export class Cluster {
  static count = 0;
  nodes = [];

  constructor(t) {
    const name = `cluster${process.pid}-${++Cluster.count}`;
    this.catalogue = execFileSync(process.env.ORB_NEW_CATALOGUE, [name], { encoding: 'utf8' });
    this.bucket = `s3://objects/${name}?endpoint=${process.env.ORB_S3}`;
    this.objects = this.bucket; // the address for nodes
    t.after(() => this.end());
  }

  async node(...more) {
    const data = await mkdtemp(path.join(tmpdir(), 'orbmorph-test-'));
    const shared = ['--catalogue', this.catalogue, '--objects', this.objects, '--lease-seconds', `${LEASE}`];
    const made = new Daemon(data, [...shared, '--workers', '2', '--log-format', 'text', ...more], {});
    made.program = [program];
    this.nodes.push(made);
    return made.start();
  }

  async end() {
    for (const node of this.nodes) {
      node.child?.kill('SIGCONT');
      const killer = setTimeout(() => node.child?.kill('SIGKILL'), 60_000 * patience);
      const { code, signal } = await node.stop();
      clearTimeout(killer);
      await rm(node.data, { recursive: true, force: true });
      assert.ok(node.killed || code === 0, `a node ended with ${code ?? signal}\n${node.log}`);
    }
  }

  sql(text) {
    return execFileSync('psql', ['-X', '-qAt', '-v', 'ON_ERROR_STOP=1', '-d', this.catalogue], {
      input: text,
      encoding: 'utf8',
    }).trim();
  }

  /** The node that runs a job. */
  async runner(job) {
    const name = await until(
      () => this.sql(`SELECT node FROM job WHERE id='${job.id}' AND state=1`),
      'the job runs',
      60,
    );
    return this.nodes.find((node) => node.log.includes(`node ${name}`));
  }

  cut() {
    this.sql("SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE application_name='orbmorphd'");
  }

  /** Cuts the connections that hold or wait for the lock of objects (server/store/object_lock.h). */
  cutLock() {
    return this.sql(
      `SELECT count(pg_terminate_backend(pid, 10000)) FROM pg_locks WHERE locktype='advisory' AND objsubid=2 AND classid=${OBJECTS}`,
    );
  }

  /** Every row has its object, and every object its row, except for the latest uploads of a node that died. */
  async check() {
    const data = await mkdtemp(path.join(tmpdir(), 'orbmorph-test-'));
    const args = ['--check-data', '--data', data, '--catalogue', this.catalogue, '--objects', this.bucket];
    const found = spawnSync(program, args, { encoding: 'utf8', timeout: 120_000 * patience });
    await rm(data, { recursive: true });
    assert.equal(found.status, 0, found.stdout + found.stderr);
    return found.stdout;
  }
}
