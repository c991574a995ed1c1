// The running daemon evicts derived objects beyond derived-bytes, least recently used first. Uploads stay.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { readdir, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { promisify } from 'node:util';
import { binaries, daemon, endless, until } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const statuses = async (d, urls) => Promise.all(urls.map(async (url) => (await d.request('HEAD', url)).status));
const bytes = async (d) => Number(/^orbmorph_stored_bytes (\S+)$/m.exec((await d.get('/metrics')).bytes.toString())[1]);
const uploaded = async (d, urls) =>
  (await Promise.all(urls.map(async (url) => (await d.get(`${url}/file`)).bytes.length))).reduce((a, b) => a + b);
const stored = async (d, kind) => (await d.get(`/v1/${kind}`, { query: { limit: 1000 } })).json[kind];

test('the least recently used embeddings are evicted, uploads never', async (t) => {
  // A sphere of 8·4^4 triangles takes about 80 kB as PLY: some 13 of them are a megabyte.
  const d = await daemon(t, { args: ['--derived-bytes', '1M'] });
  const meshes = [];
  const embeddings = [];
  const add = async () => {
    const i = meshes.length;
    const mesh = (await d.upload(shapes.obj(shapes.ball(4, ([x, y, z]) => [x, y, z * (1 + i / 50)])))).json;
    meshes.push(mesh.url);
    embeddings.push((await d.made('/v1/embeddings', { mesh: mesh.id })).url);
  };
  for (let i = 0; i < 8; i++) await add();
  assert.deepEqual(new Set(await statuses(d, embeddings)), new Set([200]), 'within the budget all stay');
  await sleep(2100); // instants of use are stored in whole seconds
  assert.equal((await d.get(`${embeddings[0]}/sphere.ply`)).status, 200);
  assert.equal((await d.get(embeddings[1])).status, 200);
  for (let i = 0; i < 10; i++) await add();
  const uploads = await uploaded(d, meshes);
  await until(async () => (await bytes(d)) - uploads <= 1 << 20, 'what is beyond the budget is evicted');
  const left = new Set((await stored(d, 'embeddings')).map((e) => e.url));
  assert.ok(left.size >= 8 && left.size < 15, `${left.size} are left`);
  for (const i of [0, 1, ...embeddings.keys()].filter((i) => i < 2 || i >= 15))
    assert.ok(left.has(embeddings[i]), `${i} was used`);
  for (const i of [2, 3, 4]) {
    assert.ok(!left.has(embeddings[i]), `${i} was not used`);
    assert.equal((await d.get(embeddings[i])).status, 404);
    assert.equal((await d.get(`${embeddings[i]}/sphere.ply`)).status, 404);
  }
  assert.deepEqual(new Set(await statuses(d, meshes)), new Set([200]));
  // Evicted results can be made again.
  const mesh = meshes[2].split('/').at(-1);
  assert.equal((await d.made('/v1/embeddings', { mesh })).url, embeddings[2]);
});

test('a derived object that is evicted while a job needs it is computed again', async (t) => {
  const d = await daemon(t, { args: ['--workers', '2', '--derived-bytes', '1M'] });
  const meshes = [];
  for (let i = 0; i < 6; i++)
    meshes.push((await d.upload(shapes.obj(shapes.ball(3, ([x, y, z]) => [x, y * (1 + i / 7), z])))).json.id);
  // Slowly enough to make the removed results again, on any machine.
  const began = Date.now();
  await d.made('/v1/embeddings', { mesh: meshes[0] });
  const pause = Math.max(20, 2 * (Date.now() - began));
  let going = true;
  let removed = 0;
  const remover = (async () => {
    while (going) {
      for (const kind of ['embeddings', 'supermeshes'])
        for (const { url } of await stored(d, kind)) removed += (await d.delete(url)).status === 204;
      await sleep(pause);
    }
  })();
  for (let round = 0; round < 3 || removed <= 20; round++) {
    const wanted = meshes.map((mesh, i) => ({
      shapes: [{ mesh }, { mesh: meshes[(i + 1 + (round % 5)) % meshes.length] }],
      align: { method: 'rotate' },
      remesh: { method: 'overlay' },
    }));
    const ends = await Promise.all(
      wanted.map((body) =>
        d.post('/v1/supermeshes', body).then((r) => (r.status === 202 ? d.ended(r.json) : { state: 'succeeded' })),
      ),
    );
    for (const end of ends) assert.equal(end.state, 'succeeded', JSON.stringify(end.problem));
  }
  going = false;
  await remover;
  // Every entry of the lists exists and is complete; entries that the budget evicts meanwhile are no longer in the
  // list.
  for (const [kind, file] of [
    ['embeddings', 'sphere.ply'],
    ['supermeshes', 'asset.glb'],
  ])
    for (const { url } of await stored(d, kind)) {
      const { status } = await d.get(`${url}/${file}`);
      if (status !== 200)
        assert.ok(status === 404 && !(await stored(d, kind)).some((one) => one.url === url), `${url}: ${status}`);
    }
  await d.stop();
  const { stdout } = await promisify(execFile)(binaries.daemon, ['--check-data', '--data', d.data]);
  assert.match(stdout, /: 0 wrong/, stdout);
  await d.start();
});

// With several nodes, --gc may run beside them, and the objects are in the bucket: scenario.s3.
const one = { skip: process.env.ORB_NODES && 'the test looks at the files of one data folder' };

test('--gc removes derived objects beyond the budget and what no row names, and nothing else', one, async (t) => {
  // If there is a budget, each use is recorded, however far the budget is from its limit.
  const d = await daemon(t, { args: ['--derived-bytes', '1G'] });
  const gc = (...args) => promisify(execFile)(binaries.daemon, ['--gc', '--data', d.data, ...args]);
  const check = async () => (await promisify(execFile)(binaries.daemon, ['--check-data', '--data', d.data])).stdout;
  await assert.rejects(gc(), { code: 1 }, 'not while the daemon has the folder');
  const meshes = [];
  const made = [];
  for (let i = 0; i < 18; i++) {
    const mesh = (await d.upload(shapes.obj(shapes.ball(4, ([x, y, z]) => [x, y, z * (1 + i / 50)])))).json;
    meshes.push(mesh.url);
    made.push((await d.made('/v1/embeddings', { mesh: mesh.id })).url);
  }
  const pair = [];
  for (const shape of [shapes.egg(2), shapes.bean(2)]) {
    const mesh = (await d.upload(shapes.obj(shape))).json;
    meshes.push(mesh.url);
    pair.push({ mesh: mesh.id });
  }
  const merged = (
    await d.made('/v1/supermeshes', { shapes: pair, align: { method: 'rotate' }, remesh: { method: 'overlay' } })
  ).url;
  await d.stop();

  // Without a budget, everything with a row stays.
  await gc();
  assert.match(await check(), / 0 wrong, 0 objects without a row/);
  await d.start();
  assert.deepEqual(new Set(await statuses(d, [...meshes, ...made, merged])), new Set([200]));
  await sleep(2100); // instants of use are stored in whole seconds
  for (const url of [`${made[0]}/sphere.ply`, made[1], merged]) assert.equal((await d.get(url)).status, 200);
  await d.stop();

  // An object that a crash left between publishing and commit, beside an object with a row.
  const files = (await readdir(path.join(d.data, 'objects'), { recursive: true, withFileTypes: true })).filter((f) =>
    f.isFile(),
  );
  const example = files.find((f) => /[0-9a-f]{60,}/.test(f.name));
  assert.ok(example, files.map((f) => f.name).join());
  const twin = path.join(
    example.path,
    example.name.replace(/[0-9a-f]{8}(?=[^0-9a-f]|$)/, (c) => (c === '00000000' ? '11111111' : '00000000')),
  );
  await writeFile(twin, 'left behind');
  assert.match(await check(), / 0 wrong, 1 objects without a row/);
  const { stdout } = await gc('--derived-bytes', '1M');
  assert.match(stdout, /^moved object \S+ \(11 bytes\), which has no row, to lost\+found$/m);
  assert.match(await check(), / 0 wrong, 0 objects without a row/);

  await d.start();
  assert.deepEqual(new Set(await statuses(d, meshes)), new Set([200]), 'uploads stay');
  const left = await statuses(d, made);
  const kept = left.filter((status) => status === 200).length;
  assert.ok(kept >= 2 && kept < 16, `${kept} of 18 are left`);
  assert.deepEqual([left[0], left[1], (await statuses(d, [merged]))[0]], [200, 200, 200], 'what was used last stays');
  assert.deepEqual(new Set(left.slice(2, 4)), new Set([404]), 'what was not used for longest is gone');
  const derived = (await bytes(d)) - (await uploaded(d, meshes));
  assert.ok(derived <= 1 << 20, `${derived} bytes are derived`);
});

test('ended jobs beyond keep-jobs are deleted; unfinished jobs and all results stay', async (t) => {
  const d = await daemon(t, { args: ['--keep-jobs', '3', '--workers', '1'] });
  const jobs = async () => (await d.get('/v1/jobs')).json.jobs.map(({ state }) => state);
  const mesh = async (level, i) =>
    (await d.upload(shapes.obj(shapes.ball(level, ([x, y, z]) => [x, y, z * (1 + i / 50)])))).json.id;
  const made = [];
  for (let i = 0; i < 6; i++) made.push((await d.made('/v1/embeddings', { mesh: await mesh(2, i) })).url);
  const running = (await d.post('/v1/embeddings', { mesh: await mesh(5, 7), ...endless })).json;
  await until(async () => (await jobs()).length <= 4, 'ended jobs are forgotten');
  assert.equal((await jobs()).filter((state) => state === 'succeeded').length, 3);
  assert.deepEqual(new Set(await statuses(d, made)), new Set([200]));
  await d.delete(running.url);
  await d.stop('SIGTERM');
  const { stdout } = await promisify(execFile)(binaries.daemon, ['--gc', '--data', d.data, '--keep-jobs', '1']);
  assert.match(stdout, /deleted [23] ended jobs/);
  await d.start();
  assert.equal((await jobs()).length, 1);
  assert.deepEqual(new Set(await statuses(d, made)), new Set([200]));
});
