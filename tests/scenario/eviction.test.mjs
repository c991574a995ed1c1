// Derived objects beyond derived-bytes leave while the daemon runs, by their last use; uploads stay.
import assert from 'node:assert/strict';
import test from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { daemon } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const statuses = async (d, urls) => Promise.all(urls.map(async (url) => (await d.request('HEAD', url)).status));
const stored = async (d, kind) => (await d.get(`/v1/${kind}`, { query: { limit: 1000 } })).json[kind];

test('the least used embeddings leave, uploads never', async (t) => {
  // A sphere of 8·4^4 triangles takes about 80 kB as PLY: some 13 of them are a megabyte.
  const d = await daemon(t, { args: ['--derived-bytes', '1M'] });
  const meshes = [], embeddings = [];
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
  const until = Date.now() + 60_000;
  let list;
  do {
    await sleep(500);
    list = await stored(d, 'embeddings');
    assert.ok(Date.now() < until, 'nothing was evicted');
  } while (list.length === embeddings.length);
  await sleep(1500);
  const left = new Set((await stored(d, 'embeddings')).map((e) => e.url));
  assert.ok(left.size >= 8 && left.size < 15, `${left.size} are left`);
  for (const i of [0, 1, ...embeddings.keys()].filter((i) => i < 2 || i >= 15)) assert.ok(left.has(embeddings[i]), `${i} was used`);
  for (const i of [2, 3, 4]) {
    assert.ok(!left.has(embeddings[i]), `${i} was not used`);
    assert.equal((await d.get(embeddings[i])).status, 404);
    assert.equal((await d.get(`${embeddings[i]}/sphere.ply`)).status, 404);
  }
  assert.deepEqual(new Set(await statuses(d, meshes)), new Set([200]));
  // What left can be made again.
  const mesh = meshes[2].split('/').at(-1);
  assert.equal((await d.made('/v1/embeddings', { mesh })).url, embeddings[2]);
});
