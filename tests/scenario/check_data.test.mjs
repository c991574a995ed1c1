// Damage to a data folder: what --check-data finds and prints, and what the service does about it.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { copyFileSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import test from 'node:test';
import { assertProblem, binaries, daemon, samples } from './support/daemon.mjs';

test('a lost file is reported, and uploading the mesh again restores it', async (t) => {
  const d = await daemon(t);
  const file = path.join(samples, 'dog.obj');
  const mesh = await d.mesh(file);
  const embedding = await d.made('/v1/embeddings', { mesh: mesh.id });
  const object = (kind, id) => path.join(d.data, 'objects', kind, id.slice(0, 2), id);
  const lost = async (url) => {
    const reply = await d.get(url);
    assertProblem(reply, 500, 'internal');
    assert.match(reply.json.detail, /lost this file. DELETE the resource/);
  };
  for (const cut of [false, true]) {
    rmSync(object('mesh', mesh.id));
    await lost(`${mesh.url}/file`);
    if (cut) writeFileSync(object('mesh', mesh.id), 'v 0 0 0\n');
    assert.equal((await d.uploadFile(file)).status, 200);
    assert.deepEqual((await d.get(`${mesh.url}/file`)).bytes, readFileSync(file));
  }
  rmSync(object('sphere', embedding.id));
  await lost(embedding.sphere);
  await d.stop();
  await d.start(); // nothing is in memory
  await lost(embedding.sphere);
  assert.equal((await d.delete(embedding.url)).status, 204);
  assertProblem(await d.get(embedding.sphere), 404, 'not-found');
  await d.made('/v1/embeddings', { mesh: mesh.id });
  assert.equal((await d.get(embedding.sphere)).status, 200);
});

test('damage to any object, and to any kind of row, is found', async (t) => {
  const d = await daemon(t);
  const [a, b] = [await d.mesh(path.join(samples, 'dog.obj')), await d.mesh(path.join(samples, 'giraffe.off'))];
  const { asset } = await d.made('/v1/supermeshes', {
    shapes: [{ mesh: a.id }, { mesh: b.id }],
    align: { method: 'rotate' },
    remesh: { max_triangles: 4000 },
  });
  for (const profile of ['quantized', 'meshopt'])
    assert.equal((await d.get(`${asset}?profile=${profile}`)).status, 200);
  assert.equal((await d.stop()).code, 0, d.log);
  const check = () => spawnSync(binaries.daemon, ['--check-data', '--data', d.data], { encoding: 'utf8' });
  const clean = (what) =>
    assert.deepEqual([check().status, / 0 wrong, 0 objects without a row/.test(check().stdout)], [0, true], what);
  clean('as it was left');

  const objects = path.join(d.data, 'objects');
  const files = readdirSync(objects).flatMap((kind) =>
    readdirSync(path.join(objects, kind)).flatMap((shard) =>
      readdirSync(path.join(objects, kind, shard)).map((name) => [kind, path.join(objects, kind, shard, name)]),
    ),
  );
  assert.deepEqual([...new Set(files.map(([kind]) => kind))].sort(), [
    'alignment',
    'asset',
    'mesh',
    'meshopt',
    'places',
    'quantized',
    'sphere',
    'spheres',
  ]);
  const found = (what) => {
    const { status, stdout } = check();
    assert.equal(status, 1, `${what}\n${stdout}`);
    assert.match(stdout, /: 1 wrong/, `${what}\n${stdout}`);
    assert.match(stdout, /start the daemon, DELETE the resources named above/, what);
  };
  for (const [kind, file] of files) {
    const bytes = readFileSync(file);
    const bad = Buffer.from(bytes);
    bad[bytes.length >> 1] ^= 1;
    for (const [what, make] of [
      ['a bit', () => writeFileSync(file, bad)],
      ['its end', () => writeFileSync(file, bytes.subarray(0, -1))],
      ['all of it', () => rmSync(file)],
    ]) {
      make();
      found(`${kind}: ${what}`);
    }
    writeFileSync(file, bytes);
  }
  clean('put right again');

  const catalogue = path.join(d.data, 'catalogue.sqlite');
  const kept = `${d.data}.kept`;
  t.after(() => rmSync(kept, { force: true }));
  copyFileSync(catalogue, kept);
  for (const sql of [
    'DELETE FROM resource WHERE kind=2',
    'DELETE FROM owner WHERE kind=0',
    "UPDATE resource SET json='{}' WHERE kind=1",
    'UPDATE resource SET json=substr(json, 2) WHERE kind=0',
    'UPDATE job SET state=7',
    "UPDATE job SET request='zz'",
    'DELETE FROM secret',
    'UPDATE tenant SET bytes=bytes+1',
  ]) {
    const made = spawnSync('sqlite3', [catalogue, sql], { encoding: 'utf8' });
    assert.equal(made.status, 0, `${sql}: ${made.stderr ?? made.error}`);
    found(sql);
    for (const more of ['-wal', '-shm']) rmSync(catalogue + more, { force: true });
    copyFileSync(kept, catalogue);
  }
  clean('put right again');
});
