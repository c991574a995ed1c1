// A catalogue in PostgreSQL: what the daemon refuses at its start, and what happens when the database goes away. Runs
// under tests/tools/with_postgresql.sh. The other scenarios run there in the same way as with SQLite.
import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import { existsSync } from 'node:fs';
import { mkdtemp, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import test from 'node:test';
import { assertProblem, Daemon, daemon, samples } from './support/daemon.mjs';
import { tetrahedron } from './support/shapes.mjs';

const server = process.env.ORB_POSTGRESQL;
const program = process.env.ORB_DAEMON; // starts a daemon without its own catalogue
assert.ok(server && program, 'to be run by tests/tools/with_postgresql.sh');

const sql = (text, url = server) =>
  execFileSync('psql', ['-X', '-qAt', '-v', 'ON_ERROR_STOP=1', '-d', url, '-c', text], { encoding: 'utf8' }).trim();
const catalogue = (data) => execFileSync(process.env.ORB_NEW_CATALOGUE, [data], { encoding: 'utf8' });
const schema = (url) => /search_path%3D(\w+)/.exec(url)[1];

async function folder(t) {
  const data = await mkdtemp(path.join(tmpdir(), 'orbmorph-test-'));
  t.after(() => rm(data, { recursive: true, force: true }));
  return data;
}

const start = (data, url, ...args) =>
  spawnSync(program, ['--listen', '127.0.0.1:0', '--data', data, '--catalogue', url, '--log-format', 'text', ...args], {
    encoding: 'utf8',
    timeout: 60_000,
  });

function refused(result, why) {
  assert.equal(result.status, 78, result.stderr);
  assert.match(result.stderr, why);
  assert.equal(result.stdout, '');
}

const tables = (url) =>
  Number(sql(`SELECT count(*) FROM information_schema.tables WHERE table_schema='${schema(url)}'`));

test('a wrong password, a missing database and a read-only one are refused, and nothing is written', async (t) => {
  const data = await folder(t);
  const url = catalogue(data);
  sql("CREATE ROLE guarded LOGIN PASSWORD 'right'");
  const guarded = url.replace('user=orbmorph', 'user=guarded');
  refused(start(data, `${guarded}&password=wrong`), /password authentication failed/);
  assert.doesNotMatch(start(data, `${guarded}&password=wrong`).stderr, /password=wrong/);
  refused(start(data, `${guarded}&password=right`), /no schema that the user may use/);
  sql(`GRANT USAGE ON SCHEMA ${schema(url)} TO guarded`);
  refused(start(data, `${guarded}&password=right`), /permission denied/);
  refused(start(data, url.replace('/postgres?', '/nowhere?')), /database "nowhere" does not exist/);
  refused(start(data, `${url}%20-cdefault_transaction_read_only%3Don`), /read-only/);
  assert.equal(tables(url), 0);
  assert.ok(!existsSync(path.join(data, 'catalogue.postgresql')));
  assert.ok(!existsSync(path.join(data, 'catalogue.sqlite')));
});

test('a server that is unreachable is not a wrong configuration', async (t) => {
  const result = start(await folder(t), 'postgresql:///x?host=/nowhere');
  assert.equal(result.status, 1, result.stderr);
  assert.match(result.stderr, /\/nowhere/);
});

test('a schema of a newer program is refused and stays', async (t) => {
  const data = await folder(t);
  const d = await new Daemon(data, [], {}).start();
  await d.stop();
  const url = catalogue(data);
  sql(`UPDATE ${schema(url)}.catalogue SET schema=999`);
  const holder = sql(`SELECT holder FROM ${schema(url)}.catalogue`);
  refused(start(data, url), /schema 999.*install a newer version/);
  assert.equal(sql(`SELECT schema, holder FROM ${schema(url)}.catalogue`), `999|${holder}`);
});

test('a data folder and a catalogue stay together', async (t) => {
  const d = await daemon(t);
  const other = await folder(t);
  const running = start(other, catalogue(d.data));
  assert.equal(running.status, 1, running.stderr);
  assert.match(running.stderr, /another orbmorphd uses it/);
  assert.equal((await d.upload(tetrahedron)).status, 201);
  await d.stop();

  refused(start(d.data, 'sqlite'), /is in PostgreSQL/);
  refused(start(d.data, catalogue(other)), /belong to another catalogue/);
  const plain = await folder(t);
  spawnSync(program, ['token', 'add', 'x', '--scope', 'read', '--data', plain]); // makes a catalogue in SQLite
  refused(start(plain, catalogue(plain)), /catalogue in SQLite/);
  for (const command of ['backup', 'restore']) {
    const copy = spawnSync(program, [command, other, '--data', d.data, '--catalogue', catalogue(d.data)], {
      encoding: 'utf8',
    });
    assert.equal(copy.status, 2);
    assert.match(copy.stderr, /pg_dump/);
  }
  await d.start();
  assert.equal((await d.get('/v1/meshes')).json.meshes.length, 1);
});

test('connections that were cut are made again; a catalogue that another daemon used meanwhile is left alone', async (t) => {
  const d = await daemon(t);
  const { id } = await d.mesh(path.join(samples, 'dog.obj'));
  const url = catalogue(d.data);
  const cut = () =>
    sql("SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE application_name='orbmorphd'");
  assert.ok(Number(cut()) > 1);
  assert.equal((await d.upload(tetrahedron)).status, 201);
  assert.ok(Number(cut()) > 0);
  assert.equal((await d.get(`/v1/meshes/${id}`)).status, 200);
  assert.equal((await d.made('/v1/embeddings', { mesh: id })).mesh, id);

  sql(`UPDATE ${schema(url)}.catalogue SET holder=holder+1`);
  cut();
  const reply = await d.upload(Buffer.from(`${tetrahedron}# other\n`));
  assertProblem(reply, 500, 'internal');
  assert.match(d.log, /another orbmorphd has used it meanwhile/);
});
