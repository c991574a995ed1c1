// Lists: supermeshes by mesh and by name, their summaries, and entries by the first digits of their id.
import assert from 'node:assert/strict';
import test from 'node:test';
import { runProgram } from './support/cli.mjs';
import { assertProblem, binaries, daemon } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const forms = { egg: shapes.egg(2), bean: shapes.bean(2), ball: shapes.ball(2) };

/** Uploads the shapes, and merges the pairs: [form, form, name, name]. */
async function fill(d, pairs, headers = {}) {
  const meshes = {};
  for (const [name, form] of Object.entries(forms)) {
    const reply = await d.post('/v1/meshes', Buffer.from(shapes.obj(form)), { headers, query: { name } });
    meshes[name] = reply.json.id;
  }
  const ids = [];
  for (const [a, b, ...names] of pairs) {
    const body = {
      shapes: [a, b].map((form, k) => ({ mesh: meshes[form], ...(names[k] && { name: names[k] }) })),
      align: { method: 'rotate' },
      remesh: { tolerance: 0.05 },
    };
    const reply = await d.post('/v1/supermeshes', body, { headers, query: { wait: 60 } });
    assert.equal(reply.status, 200, reply.bytes.toString());
    ids.push(reply.json.id);
  }
  return { meshes, ids };
}

const pairs = [
  ['egg', 'bean'],
  ['bean', 'egg'],
  ['egg', 'ball', 'Käse "x"', 'ball'],
  ['ball', 'bean', 'egg', 'bean'],
  ['egg', 'egg', 'one', 'two'],
];
/** The numbers of the pairs that have a shape of this form and one of this name, newest first. */
const expected = (form, name) =>
  pairs
    .map(([a, b, ...names], number) => ({ number, forms: [a, b], names: [names[0] ?? a, names[1] ?? b] }))
    .filter((p) => (!form || p.forms.includes(form)) && (!name || p.names.includes(name)))
    .map(({ number }) => number)
    .reverse();

test('supermeshes are listed by mesh and by name', async (t) => {
  const d = await daemon(t);
  const { meshes, ids } = await fill(d, pairs);
  const list = async (query) => {
    const found = [];
    for (let token; ; ) {
      const reply = await d.get('/v1/supermeshes', { query: { ...query, ...(token && { page_token: token }) } });
      assert.equal(reply.status, 200, reply.bytes.toString());
      found.push(...reply.json.supermeshes);
      token = reply.json.next_page_token;
      if (!token) return found;
      assert.equal(reply.json.supermeshes.length, Number(query.limit), 'a page before the last is full');
    }
  };
  for (const form of [undefined, 'egg', 'bean', 'ball'])
    for (const name of [undefined, 'egg', 'bean', 'Käse "x"', 'two', 'absent'])
      for (const limit of [1, 2, 100]) {
        const query = { limit, ...(form && { mesh: meshes[form] }), ...(name && { name }) };
        const found = await list(query);
        assert.deepEqual(
          found.map(({ id }) => ids.indexOf(id)),
          expected(form, name),
          JSON.stringify(query),
        );
      }
  assert.deepEqual(await list({ mesh: '0'.repeat(64) }), []);

  // A summary is the description without report and request.
  const whole = await list({});
  const short = await list({ view: 'summary', limit: 2 });
  assert.deepEqual(await list({ view: 'full' }), whole);
  assert.deepEqual(
    short,
    whole.map(({ id, url, asset, asset_bytes, vertices, triangles, shapes: all, engine, created }) => ({
      id,
      url,
      asset,
      asset_bytes,
      vertices,
      triangles,
      shapes: all.map(({ mesh, name }) => ({ mesh, name })),
      engine,
      created,
    })),
  );
  assert.deepEqual(
    (await list({ view: 'summary', name: 'two', mesh: meshes.egg })).map(({ id }) => id),
    [ids[4]],
  );

  // A deleted supermesh also leaves these lists.
  assert.equal((await d.delete(`/v1/supermeshes/${ids[4]}`)).status, 204);
  assert.deepEqual(await list({ name: 'two' }), []);
  assert.equal((await list({ mesh: meshes.egg })).length, 3);
  await d.stop();
  const { code, out, err } = await runProgram(binaries.daemon, ['--check-data', '--data', d.data]);
  assert.equal(code, 0, out + err);

  await d.start();
  for (const query of [
    { view: 'short' },
    { mesh: meshes.egg.slice(1) },
    { mesh: meshes.egg.toUpperCase() },
    { name: 'x'.repeat(128) },
    { id_prefix: 'xyz' },
    { id_prefix: '0'.repeat(65) },
  ])
    assertProblem(await d.get('/v1/supermeshes', { query }), 400, 'bad-query', JSON.stringify(query));
  assertProblem(await d.get('/v1/meshes', { query: { mesh: meshes.egg } }), 400, 'bad-query');
});

test('entries are listed by the first digits of their id', async (t) => {
  const d = await daemon(t);
  await fill(d, pairs.slice(0, 2));
  for (const kind of ['meshes', 'embeddings', 'supermeshes', 'jobs']) {
    const all = (await d.get(`/v1/${kind}`)).json[kind];
    assert.ok(all.length >= 2, kind);
    const of = async (id_prefix, more) =>
      (await d.get(`/v1/${kind}`, { query: { id_prefix, ...more } })).json[kind].map(({ id }) => id);
    for (const { id } of all)
      for (const digits of [1, 2, 6, id.length])
        assert.deepEqual(
          await of(id.slice(0, digits)),
          all.map((entry) => entry.id).filter((other) => other.startsWith(id.slice(0, digits))),
          `${kind} ${digits}`,
        );
    assert.deepEqual(await of('f'.repeat(30)), []);
    if (kind === 'supermeshes') assert.deepEqual(await of(all[0].id.slice(0, 12), { name: 'egg' }), [all[0].id]);
    if (kind === 'jobs') assert.deepEqual(await of(all[0].id.slice(0, 12), { state: 'failed' }), []);
  }
});

test('a tenant finds only its own', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on'] });
  const add = async (name, scope = 'read,write') => {
    const { out } = await runProgram(binaries.daemon, ['token', 'add', name, '--scope', scope, '--data', d.data]);
    return { authorization: `Bearer ${out.trim()}` };
  };
  const [ann, bob, root] = [await add('ann'), await add('bob'), await add('root', 'admin')];
  const hers = await fill(d, pairs.slice(0, 2), ann);
  const his = await fill(d, [pairs[1], pairs[2]], bob);
  assert.equal(hers.ids[1], his.ids[0]);
  const list = async (headers, query) =>
    (await d.get('/v1/supermeshes', { headers, query })).json.supermeshes.map(({ id }) => id);
  const mesh = hers.meshes.egg;
  assert.deepEqual(await list(ann, { mesh }), [hers.ids[1], hers.ids[0]]);
  assert.deepEqual(await list(bob, { mesh }), [his.ids[1], his.ids[0]]);
  assert.deepEqual(await list(bob, { mesh, name: 'bean' }), [his.ids[0]]);
  assert.deepEqual(await list(ann, { id_prefix: his.ids[1].slice(0, 20) }), []);
  assert.deepEqual(await list(bob, { id_prefix: his.ids[1].slice(0, 20) }), [his.ids[1]]);
  assert.equal((await list(root, { mesh })).length, 3);
  const [job] = (await d.get('/v1/jobs', { headers: bob })).json.jobs;
  const jobs = async (headers) =>
    (await d.get('/v1/jobs', { headers, query: { id_prefix: job.id.slice(0, 16) } })).json.jobs.length;
  assert.deepEqual([await jobs(ann), await jobs(bob), await jobs(root)], [0, 1, 1]);
  // An owner that gives a supermesh up no longer finds it; the other still does.
  assert.equal((await d.delete(`/v1/supermeshes/${his.ids[0]}`, { headers: bob })).status, 204);
  assert.deepEqual(await list(bob, { mesh }), [his.ids[1]]);
  assert.deepEqual(await list(ann, { mesh }), [hers.ids[1], hers.ids[0]]);
});
