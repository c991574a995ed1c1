// The scrub in the background: the damage that it finds in the data folder, where it reports it, and how the daemon
// repairs it; lost+found.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import {
  existsSync,
  mkdirSync,
  readdirSync,
  readFileSync,
  rmSync,
  statSync,
  truncateSync,
  utimesSync,
  writeFileSync,
} from 'node:fs';
import path from 'node:path';
import test from 'node:test';
import { folder, runProgram } from './support/cli.mjs';
import { assertProblem, binaries, daemon, until } from './support/daemon.mjs';
import { flip, object } from './support/objects.mjs';
import * as shapes from './support/shapes.mjs';

const run = (...args) => runProgram(binaries.daemon, args);
const mesh = (k) => shapes.obj(shapes.ball(1, ([x, y, z]) => [x + k, y, z]));
const fast = ['--scrub-rate', '1G', '--scrub-seconds', '1'];

const integrity = async (d) => (await d.get('/readyz?verbose')).json.integrity;
const metric = async (d, name) =>
  Number(new RegExp(`^${name} (\\S+)$`, 'm').exec((await d.get('/metrics')).bytes.toString())[1]);

/** Waits until a whole round has run from now on, and returns what it found. */
async function round(d) {
  const { scrubs } = await integrity(d);
  await until(async () => (await integrity(d)).scrubs >= scrubs + 2, 'two rounds of the scrub');
  return integrity(d);
}

test('the scrub finds and reports damage to files that nobody requests, and it can be repaired', async (t) => {
  const d = await daemon(t, { args: fast });
  const texts = [shapes.obj(shapes.egg(2)), shapes.obj(shapes.bean(2))];
  const meshes = [(await d.upload(texts[0])).json, (await d.upload(texts[1])).json];
  const request = { shapes: meshes.map(({ id }) => ({ mesh: id })), align: { method: 'rotate' } };
  const morph = await d.made('/v1/supermeshes', request);
  const [embedding] = (await d.get('/v1/embeddings')).json.embeddings;
  const urls = [morph.asset, `${morph.url}/places`, `${morph.url}/spheres/1.ply`, embedding.sphere];
  const right = [];
  for (const url of urls) right.push((await d.get(url)).bytes);
  let found = await round(d);
  assert.deepEqual(found, { ...found, catalogue: 'ok', quarantined: 0, missing: 0, unreadable: 0, without_row: 0 });
  assert.ok(found.scrubbed_objects >= 2 + 2 + 3, JSON.stringify(found)); // meshes, embeddings, parts of the morph

  // A mesh: only its owner has its file, so it stays missing until the owner sends it again.
  flip(object(d.data, 'mesh', meshes[0].id));
  found = await round(d);
  assert.deepEqual([found.quarantined, found.missing], [1, 1]);
  assert.equal(await metric(d, 'orbmorph_objects_missing'), 1);
  assert.equal(await metric(d, 'orbmorph_objects_quarantined_total'), 1);
  assert.match(
    d.log,
    /"level":"error","message":"scrub: its object is missing or was moved to quarantine; .*"id":"[0-9a-f]{64}"/,
  );
  assert.equal((await d.upload(texts[0])).status, 200);
  assert.equal((await d.get(`${meshes[0].url}/file`)).bytes.toString(), texts[0]);

  // Results of jobs: the row is deleted with the damaged object, so the same request computes it again.
  let wrong = 1;
  for (const kind of ['asset', 'places', 'spheres']) {
    flip(object(d.data, kind, morph.id));
    await until(async () => (await d.get(morph.url)).status === 404, `${kind} is found`);
    await d.made('/v1/supermeshes', request);
    for (const [i, url] of urls.entries()) assert.deepEqual((await d.get(url)).bytes, right[i], `${kind}: ${url}`);
    assert.equal((await integrity(d)).quarantined, ++wrong);
  }
  flip(object(d.data, 'sphere', embedding.id));
  await until(async () => (await d.get(embedding.url)).status === 404, 'the sphere is found');
  await d.made('/v1/embeddings', { mesh: embedding.mesh });
  assert.deepEqual((await d.get(embedding.sphere)).bytes, right[3]);
  found = await round(d);
  assert.deepEqual([found.quarantined, found.missing, found.without_row], [wrong + 1, 0, 0]);
  assert.equal(readdirSync(path.join(d.data, 'quarantine')).length, wrong + 1);
});

test('a morph by URL whose asset or embedding was damaged is computed again within the request', async (t) => {
  const d = await daemon(t, { args: ['--scrub-rate', '0'] });
  const meshes = [];
  for (const shape of [shapes.egg(2), shapes.bean(2)]) meshes.push((await d.upload(shapes.obj(shape))).json.id);
  const url = `/v1/morph.glb?shapes=${meshes}&align=rotate`;
  const right = new Map();
  for (const query of ['', '&profile=quantized', '&profile=meshopt']) {
    const reply = await d.get(url + query);
    assert.equal(reply.status, 200, reply.bytes.toString());
    right.set(query, reply.bytes);
  }
  const { supermeshes } = (await d.get('/v1/supermeshes')).json;
  const { id } = supermeshes[0];
  assert.deepEqual((await integrity(d)).scrubs, 0, 'off');
  for (const [query, bytes] of right) {
    await d.stop();
    flip(object(d.data, 'asset', id));
    if (query) rmSync(object(d.data, query.split('=')[1], id), { force: true });
    await d.start();
    const reply = await d.get(url + query);
    assert.equal(reply.status, 200, `${query}: ${reply.bytes}`);
    assert.deepEqual(reply.bytes, bytes, query);
  }
  // The job that needs a damaged embedding computes it again.
  const [embedding] = (await d.get('/v1/embeddings')).json.embeddings;
  flip(object(d.data, 'sphere', embedding.id));
  assert.equal((await d.get(`${url}&tolerance=0.01`)).status, 200);
  assert.equal((await integrity(d)).quarantined, 2, '1 in the last start, and the embedding');
});

test('a catalogue that is damaged while the daemon runs makes /readyz answer 503', async (t) => {
  const d = await daemon(t, { args: fast });
  for (let k = 0; k < 30; k++) assert.equal((await d.upload(mesh(k))).status, 201);
  await d.stop(); // everything is in the file, nothing in the WAL
  await d.start();
  assert.equal((await d.get('/readyz')).status, 200);
  const file = path.join(d.data, 'catalogue.sqlite');
  const bytes = readFileSync(file);
  const page = bytes.readUInt16BE(16);
  const row = bytes.lastIndexOf('"vertices":');
  const start = row - (row % page);
  bytes.fill(0xa5, start, start + 64);
  writeFileSync(file, bytes);
  await until(async () => (await d.get('/readyz')).status === 503, 'the scrub finds it');
  assertProblem(await d.get('/readyz'), 503, 'unavailable');
  assert.match((await d.get('/readyz')).json.detail, /catalogue is damaged/);
  assert.equal(await metric(d, 'orbmorph_catalogue_damaged'), 1);
  const told = d.log.match(/the catalogue is damaged: .* restore a backup/g); // by the scrub, a statement, or both
  assert.ok(told.length === 1 || told.length === 2, d.log);
});

test('without the scrub, a request that meets a damaged page of the catalogue makes /readyz answer 503', async (t) => {
  const d = await daemon(t, { args: ['--scrub-rate', '0'] });
  for (let k = 0; k < 100; k++) assert.equal((await d.upload(mesh(k))).status, 201);
  await d.stop();
  await d.start();
  assert.equal((await d.get('/readyz')).status, 200);
  const file = path.join(d.data, 'catalogue.sqlite');
  const bytes = readFileSync(file);
  bytes.fill(0xa5, 4 * bytes.readUInt16BE(16)); // the pages from the fifth on
  writeFileSync(file, bytes);
  const reply = await d.upload(mesh(100));
  assert.equal(reply.status, 500, 'the upload meets a damaged page');
  assertProblem(await d.get('/readyz'), 503, 'unavailable');
  assert.match((await d.get('/readyz')).json.detail, /catalogue is damaged/);
  assert.equal(await metric(d, 'orbmorph_catalogue_damaged'), 1);
  assert.equal(d.log.match(/the catalogue is damaged: .* restore a backup/g)?.length, 1, d.log);
});

test('meshes whose rows a cut WAL lost are reported, and --gc keeps their files for lost-days', async (t) => {
  const d = await daemon(t, { args: fast });
  const texts = Array.from({ length: 20 }, (_, k) => mesh(k));
  const ids = [];
  for (const text of texts) ids.push((await d.upload(text)).json.id);
  await d.stop('SIGKILL');
  const wal = path.join(d.data, 'catalogue.sqlite-wal');
  truncateSync(wal, Math.floor(statSync(wal).size * 0.6));
  await d.start();
  const left = (await d.get('/v1/meshes?limit=500')).json.meshes.map(({ id }) => id);
  const lost = ids.filter((id) => !left.includes(id));
  assert.ok(lost.length > 0 && left.length > 0, `${lost.length} are lost, ${left.length} left`);
  const found = await round(d);
  assert.deepEqual([found.without_row, found.missing, found.quarantined], [lost.length, 0, 0]);
  assert.equal(await metric(d, 'orbmorph_objects_without_row'), lost.length);
  assert.match(d.log, new RegExp(`"level":"warn".*scrub: ${lost.length} stored files have no row in the catalogue`));

  // Sending one mesh again repairs that mesh.
  assert.equal((await d.upload(texts[ids.indexOf(lost[0])])).status, 201);
  assert.equal((await round(d)).without_row, lost.length - 1);
  await d.stop();
  const check = await run('--check-data', '--data', d.data);
  assert.equal(check.code, 0);
  assert.match(check.out, new RegExp(` ${lost.length - 1} objects without a row .*\n.*the catalogue has lost rows`));
  const aside = (id) => path.join(d.data, 'lost+found', `mesh-${id}`);
  for (let turn = 0; turn < 2; turn++) {
    assert.equal((await run('--gc', '--data', d.data)).code, 0);
    for (const id of lost.slice(1)) assert.equal(readFileSync(aside(id), 'utf8'), texts[ids.indexOf(id)]);
  }
  assert.equal(existsSync(object(d.data, 'mesh', lost[1])), false);

  // Files that have been there for longer than lost-days are deleted, and no sooner.
  const day = 86400;
  const age = (id, days) => utimesSync(aside(id), Date.now() / 1000 - days * day, Date.now() / 1000 - days * day);
  age(lost[1], 3.1);
  age(lost[2], 2.9);
  const gc = await run('--gc', '--data', d.data, '--lost-days', '3');
  assert.match(gc.out, /^deleted 1 files that were in lost\+found for 3 days$/m);
  assert.deepEqual([existsSync(aside(lost[1])), existsSync(aside(lost[2]))], [false, true]);
});

test('a backup that begins while --gc runs waits for it', async (t) => {
  const d = await daemon(t);
  const place = await folder(t);
  const { id } = (await d.upload(mesh(0))).json;
  await d.stop();
  const many = 3000;
  const shard = path.join(d.data, 'objects/mesh/ab');
  mkdirSync(shard, { recursive: true });
  for (let k = 0; k < many; k++) writeFileSync(path.join(shard, `ab${String(k).padStart(62, '0')}`), 'left behind');
  const gc = spawn(binaries.daemon, ['--gc', '--data', d.data], { stdio: 'ignore' });
  const ended = new Promise((done) => gc.once('exit', done));
  const aside = path.join(d.data, 'lost+found');
  while (!existsSync(aside)); // it has begun to move files
  gc.kill('SIGSTOP');
  const left = readdirSync(shard).length;
  assert.ok(left > 0, 'stopped too late');
  const backup = spawn(binaries.daemon, ['backup', path.join(place, 'backup'), '--data', d.data]);
  let out = '';
  backup.stdout.on('data', (bytes) => (out += bytes));
  const taken = new Promise((done) => backup.once('exit', done));
  await until(() => /waiting for a deletion/.test(out), 'the backup waits');
  gc.kill('SIGCONT');
  assert.deepEqual([await ended, await taken], [0, 0], out);
  assert.equal(readdirSync(aside).length, many, 'all that has no row was moved');
  assert.match((await run('--check-data', '--data', d.data)).out, / 0 objects without a row/);
  assert.ok(existsSync(path.join(place, 'backup/objects/mesh', id.slice(0, 2), id)));
});
