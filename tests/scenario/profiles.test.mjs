// Profiles of an asset: the first request makes one from the stored asset, on both routes. It is kept with the
// supermesh, counts for its bytes, and is deleted with it.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { existsSync, rmSync, statSync, truncateSync } from 'node:fs';
import path from 'node:path';
import test from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { signUrl } from '../../client/js/src/index.js';
import { runProgram } from './support/cli.mjs';
import { assertProblem, binaries, daemon, until } from './support/daemon.mjs';
import { object } from './support/objects.mjs';
import * as shapes from './support/shapes.mjs';

async function pair(d, levels = 3) {
  const ids = [];
  for (const [name, mesh] of Object.entries({ egg: shapes.egg(levels), bean: shapes.bean(levels) }))
    ids.push((await d.upload(shapes.obj(mesh), { name })).json.id);
  return ids.join(',');
}
const recipe = (ids) => `/v1/morph.glb?shapes=${ids}&tolerance=0.01&align=rotate`;
const idOf = (reply) => /supermeshes\/(\w+)/.exec(reply.headers.get('link'))[1];
const made = (d, profile) => d.log.split(`profile ${profile} made`).length - 1;
const stored = async (d) =>
  Number(/^orbmorph_stored_bytes (\S+)$/m.exec((await d.get('/metrics')).bytes.toString())[1]);

test('both routes serve each profile, which is made once', async (t) => {
  const d = await daemon(t);
  const url = recipe(await pair(d));
  const float = await d.get(url);
  const id = idOf(float);
  const description = (await d.get(`/v1/supermeshes/${id}`)).json;
  const { quantized: fine, meshopt: coarse, ...most } = description.profiles;
  for (const { quantization_relative: off, normal_degrees: turned } of [fine, coarse, most])
    assert.ok(off > 0 && off < 1e-4 && turned > 0 && turned < 1);
  assert.ok(3.5 * fine.quantization_relative < coarse.quantization_relative);
  assert.equal(most.quantization_relative, coarse.quantization_relative);
  const tags = new Set([float.headers.get('etag')]);
  const full = float.bytes.length;
  for (const profile of ['quantized', 'meshopt']) {
    const before = await stored(d);
    const asset = `/v1/supermeshes/${id}/asset.glb?profile=${profile}`;
    const many = await Promise.all(
      Array.from({ length: 24 }, (_, i) =>
        i % 3 ? d.get(i % 2 ? asset : `${url}&profile=${profile}`) : d.request('HEAD', asset),
      ),
    );
    const whole = await d.get(asset);
    const etag = `"${createHash('sha256').update(whole.bytes).digest('hex').slice(0, 32)}"`;
    for (const reply of [...many, whole]) {
      assert.deepEqual([reply.status, reply.type], [200, 'model/gltf-binary']);
      assert.equal(reply.headers.get('etag'), etag);
      assert.equal(reply.headers.get('cache-control'), 'public, max-age=31536000, immutable');
      assert.equal(reply.headers.get('content-length'), String(whole.bytes.length));
      assert.match(reply.headers.get('content-disposition'), /egg-bean\.glb/);
      assert.ok(reply.bytes.length === 0 || reply.bytes.equals(whole.bytes));
    }
    assert.equal(made(d, profile), 1, 'one request makes it');
    const share = whole.bytes.length / full;
    assert.ok(share < (profile === 'meshopt' ? 0.63 : 0.8), `${profile}: ${share}`);
    assert.equal(await stored(d), before + whole.bytes.length, 'its bytes count');
    assert.equal(statSync(object(d.data, profile, id)).size, whole.bytes.length);
    tags.add(etag);
    // Ranges and conditions.
    const part = await d.get(`${url}&profile=${profile}`, { headers: { range: 'bytes=0-3' } });
    assert.deepEqual([part.status, part.bytes.toString()], [206, 'glTF']);
    assert.equal(part.headers.get('content-range'), `bytes 0-3/${whole.bytes.length}`);
    assert.match(part.headers.get('link'), /rel="describedby"/);
    assert.equal((await d.get(asset, { headers: { 'if-none-match': etag } })).status, 304);
    assert.equal((await d.get(asset, { headers: { 'if-none-match': float.headers.get('etag') } })).status, 200);
  }
  assert.equal(tags.size, 3);
  assert.ok((await d.get(`/v1/supermeshes/${id}/asset.glb?profile=float`)).bytes.equals(float.bytes));
  assertProblem(await d.get(`${url}&profile=draco`), 400, 'bad-query');
  const refused = await d.get(`/v1/supermeshes/${id}/asset.glb?profile=`);
  assertProblem(refused, 400, 'bad-query');
  assert.equal(refused.json.parameter, 'profile');

  // A profile survives the process, and the daemon makes nothing again.
  const bytes = (await d.get(`${url}&profile=meshopt`)).bytes;
  await d.stop();
  const check = () => spawnSync(binaries.daemon, ['--check-data', '--data', d.data], { encoding: 'utf8' });
  assert.match(check().stdout, / 0 wrong, 0 objects without a row/);
  await d.start();
  const times = made(d, 'meshopt');
  assert.ok((await d.get(`${url}&profile=meshopt`)).bytes.equals(bytes));
  assert.equal(made(d, 'meshopt'), times);

  // The daemon makes a lost file again, and finds damage.
  rmSync(object(d.data, 'meshopt', id));
  assert.ok((await d.get(`${url}&profile=meshopt`)).bytes.equals(bytes));
  rmSync(object(d.data, 'meshopt', id));
  assert.ok((await d.get(`/v1/supermeshes/${id}/asset.glb?profile=meshopt`)).bytes.equals(bytes));
  await d.stop();
  truncateSync(object(d.data, 'quantized', id), 1000);
  const found = check();
  assert.equal(found.status, 1);
  assert.match(found.stdout, /its profile "quantized" \(1000 bytes\) does not match its hash/);
  await d.start();

  // Profiles are deleted with the supermesh.
  assert.equal((await d.delete(`/v1/supermeshes/${id}`)).status, 204);
  for (const profile of ['quantized', 'meshopt']) {
    assert.ok(!existsSync(object(d.data, profile, id)));
    assertProblem(await d.get(`/v1/supermeshes/${id}/asset.glb?profile=${profile}`), 404, 'not-found');
  }
});

test('a recipe in a profile computes the morph that nobody has', async (t) => {
  const d = await daemon(t);
  const url = recipe(await pair(d, 2));
  const small = await d.get(`${url}&profile=meshopt`);
  assert.equal(small.status, 200, small.bytes.toString());
  assert.match(small.headers.get('link'), /rel="describedby"/);
  const float = await d.get(url);
  assert.equal(idOf(float), idOf(small), 'a profile is not part of the id');
  assert.equal((await d.get('/v1/jobs')).json.jobs.length, 1);
  assert.ok(small.bytes.length < float.bytes.length);
});

test('profiles count for the budget of derived objects', async (t) => {
  const d = await daemon(t);
  const ids = await pair(d, 5); // more than a megabyte of derived objects, the least budget
  const uploaded = await stored(d);
  const id = idOf(await d.get(recipe(ids)));
  const budget = (await stored(d)) - uploaded + 1000;
  await d.stop();
  d.args.push('--derived-bytes', String(budget));
  await d.start();
  const embeddings = async () => (await d.get('/v1/embeddings')).json.embeddings.length;
  await sleep(2500);
  assert.equal(await embeddings(), 2, 'all of it fits');
  const quantized = await d.get(`/v1/supermeshes/${id}/asset.glb?profile=quantized`);
  assert.equal(quantized.status, 200);
  assert.ok(quantized.bytes.length > 1000);
  await until(async () => (await stored(d)) - uploaded <= budget, 'what is beyond the budget is evicted');
  assert.equal(await embeddings(), 1, 'what was used longest ago');
});

test('the work of a profile counts for the key that requested it', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on'] });
  const admin = async (...words) => {
    const ran = await runProgram(binaries.daemon, [...words, '--data', d.data]);
    assert.equal(ran.code, 0, ran.err);
    return ran.out.trim();
  };
  const headers = { authorization: `Bearer ${await admin('token', 'add', 'shop', '--scope', 'read,write')}` };
  const ids = [];
  for (const shape of [shapes.egg(2), shapes.bean(2)])
    ids.push((await d.request('POST', '/v1/meshes', { body: Buffer.from(shapes.obj(shape)), headers })).json.id);
  const [key, secret] = (await admin('key', 'add', 'web', '--tenant', 'shop', '--cpu-seconds-per-day', '600')).split(
    ':',
  );
  const signed = (profile) => signUrl(`${recipe(ids)}&profile=${profile}`, { key, secret, expires: '1h' });
  const first = await d.get(await signed('quantized'));
  assert.equal(first.status, 200, first.bytes.toString());
  assert.match(first.headers.get('cache-control'), /^public, max-age=3\d{3}$/);
  await d.stop();
  const spent = `UPDATE signing_key SET day=${Math.floor(Date.now() / 86400_000)}, used_ms=600000`;
  assert.equal(spawnSync('sqlite3', [path.join(d.data, 'catalogue.sqlite'), spent]).status, 0);
  await d.start();
  assertProblem(await d.get(await signed('meshopt')), 429, 'quota-exceeded');
  assert.equal((await d.get(await signed('quantized'))).status, 200, 'what exists is still served');
  // Another tenant does not see it.
  const other = { authorization: `Bearer ${await admin('token', 'add', 'other', '--scope', 'read,write')}` };
  const asset = `/v1/supermeshes/${idOf(first)}/asset.glb?profile=quantized`;
  assertProblem(await d.get(asset, { headers: other }), 404, 'not-found');
  const own = await d.get(asset, { headers });
  assert.deepEqual([own.status, own.headers.get('cache-control')], [200, 'private, max-age=31536000, immutable']);
});
