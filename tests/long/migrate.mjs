// Kills orbmorphd migrate at ORB_KILLS (200) random moments, on all four ways between SQLite and PostgreSQL, files and
// S3. After each kill no daemon starts on the target; in the end all data exist there. ORB_SEED chooses the moments.
// Runs under tests/tools/with_postgresql.sh and tests/tools/with_s3.sh.
import assert from 'node:assert/strict';
import { execFileSync, spawn, spawnSync } from 'node:child_process';
import { mkdtemp, rm } from 'node:fs/promises';
import os from 'node:os';
import path from 'node:path';
import { Daemon } from '../scenario/support/daemon.mjs';
import * as shapes from '../scenario/support/shapes.mjs';

const kills = Number(process.env.ORB_KILLS ?? 200);
const [MESHES, PATIENCE, SLOWEST_MS] = [150, 15, 1200]; // PATIENCE: kills of one migration before it may end
const program = process.env.ORB_DAEMON;
let seed = Number(process.env.ORB_SEED ?? 1);
function random() {
  seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
  return seed / 2 ** 32;
}

const top = await mkdtemp(path.join(os.tmpdir(), 'orbmorph-migrate-'));
function place(name, postgresql, inS3) {
  const data = path.join(top, name);
  const catalogue = postgresql ? execFileSync(process.env.ORB_NEW_CATALOGUE, [data], { encoding: 'utf8' }) : 'sqlite';
  const objects = inS3 ? `s3://objects/${path.basename(top)}-${name}?endpoint=${process.env.ORB_S3}` : 'files';
  return ['data', data, 'catalogue', catalogue, 'objects', objects];
}
const options = (at, before = '--') => at.map((word, i) => (i % 2 ? word : before + word));
const check = (at) => spawnSync(program, ['--check-data', ...options(at)], { encoding: 'utf8' });

/** Runs it, and kills it after a while; resolves to {end, out}. */
async function migrate(from, to, ms) {
  const child = spawn(program, ['migrate', ...options(from, '--from-'), ...options(to)]);
  const ended = new Promise((done) => child.once('close', (code, signal) => done(code ?? signal)));
  let out = '';
  child.stdout.on('data', (chunk) => (out += chunk));
  child.stderr.on('data', (chunk) => (out += chunk));
  const timer = setTimeout(() => child.kill('SIGKILL'), ms);
  const end = await ended;
  clearTimeout(timer);
  return { end, out };
}

let from = place('0', false, false);
const d = new Daemon(from[1], [], {});
d.program = [program];
await d.start();
for (let k = 0; k < MESHES; k++) {
  const shape = ([x, y, z]) => [x * (1 + 0.3 * Math.sin(5 * y + k)), 1.5 * y, z];
  assert.equal((await d.upload(shapes.obj(shapes.ball(1, shape)))).status, 201);
}
const uploads = (await d.get('/v1/meshes?limit=500')).json.meshes.slice(0, 2);
await d.made('/v1/supermeshes', { shapes: uploads.map(({ id }) => ({ mesh: id })), align: { method: 'rotate' } });
await d.stop();
const whole = check(from).stdout;
assert.match(whole, /: 0 wrong, 0 objects without a row/);

let [done, moves, refused] = [0, 0, 0];
for (let round = 1; done < kills; round++) {
  const to = place(String(round), round % 4 === 1 || round % 4 === 2, round % 4 === 1 || round % 4 === 3);
  for (let tried = 0; ; tried++) {
    const { end, out } = await migrate(from, to, tried < PATIENCE ? random() ** 2 * SLOWEST_MS : 600_000);
    if (end !== 'SIGKILL') {
      // A kill may have come after the last step.
      assert.ok(end === 0 || (end === 78 && /whole copy of this deployment already/.test(out)), `${end}: ${out}`);
      break;
    }
    done++;
    if (!/^(copying|going on)$/m.test(out)) continue; // the run may have written nothing so far
    const { status, stdout, stderr } = check(to);
    assert.ok((status === 78 && /in part/.test(stderr)) || (status === 0 && stdout === whole), stdout + stderr);
    refused += status === 78;
  }
  assert.equal(check(to).stdout, whole);
  moves++;
  from = to;
}
console.log(`${done} kills in ${moves} moves; ${refused} times a half was refused; all rows and objects are there`);
await rm(top, { recursive: true });
