// Starts one daemon and calls every route and kind of job with the smallest meshes. Written for memcheck, under which
// the scenarios take hours. Exits with the daemon's status, or with 1 if an answer is wrong.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import zlib from 'node:zlib';
import { writeGlb } from '../scenario/support/glb_write.mjs';
import { run } from '../scenario/support/cli.mjs';
import { Daemon, binaries } from '../scenario/support/daemon.mjs';
import * as shapes from '../scenario/support/shapes.mjs';

const data = mkdtempSync(path.join(os.tmpdir(), 'orbmorph-walk-'));
const d = await new Daemon(data, ['--workers', '2', '--cors', 'https://a.example'], {}).start();
const WAIT = { headers: { prefer: 'wait=60' } };
const step = (what) => console.log(`${new Date().toISOString().slice(11, 19)} ${what}`);
const is = async (status, reply) => {
  const got = await reply;
  assert.ok(
    [status].flat().includes(got.status),
    `${got.status}, not ${status}: ${got.bytes.toString().slice(0, 300)}`,
  );
  return got;
};

async function meshes() {
  step('every format, coding and repair; what is not a mesh');
  const egg = shapes.egg(1);
  const bean = shapes.bean(1);
  const kinds = {};
  const [first, second] = [shapes.obj(egg), shapes.off(bean)];
  kinds.egg = (await is(201, d.upload(first, { name: 'egg' }))).json;
  kinds.bean = (await is(201, d.upload(second, { name: 'bean', format: 'off' }))).json;
  await is(201, d.upload(shapes.binaryPly(egg)));
  await is(201, d.upload(shapes.binaryStl(bean)));
  const uv = egg.positions.map((p) => [p[0], p[1]]);
  kinds.glb = (await is(201, d.upload(writeGlb({ ...egg, uv, factor: [1, 0.5, 0, 1] })))).json;
  await is([200, 201], d.upload(shapes.obj(shapes.soup(bean)), { repair: 'safe' }));
  await is([200, 201], d.upload(shapes.obj(shapes.withoutFace(egg)), { repair: 'safe,fill_holes' }));
  await is(
    [200, 201],
    d.upload(shapes.obj(shapes.apart(shapes.egg(2), shapes.bean(1))), { repair: 'safe,largest_component' }),
  );
  for (const [coding, body] of [
    ['gzip', zlib.gzipSync(first)],
    ['zstd', execFileSync('zstd', ['-q', '-c'], { input: first })],
  ]) {
    const headers = { 'content-encoding': coding };
    await is(200, d.post('/v1/meshes', body, { headers, query: { name: 'egg' } }));
    await is(400, d.post('/v1/meshes', body.subarray(0, body.length - 5), { headers }));
  }
  for (const bad of [shapes.torus(6, 5), shapes.withoutFace(egg), shapes.reversed(egg, (i) => i === 3)])
    await is(422, d.upload(shapes.obj(bad), { repair: 'none' }));
  for (const text of ['', 'no mesh', 'v 1 2\nf 1 1 1\n', 'OFF\n1 1 1\n', 'ply\n', 'glTF\x02'])
    await is([400, 415, 422], d.upload(text));
  return kinds;
}

async function jobs({ egg, bean, glb }) {
  const made = [];
  for (const method of ['newton', 'kernel-sampling']) {
    step(`an embedding by ${method}`);
    made.push(await d.made('/v1/embeddings', { mesh: egg.id, method }));
  }
  const at = (landmarks) => landmarks.map((v) => ({ at: [{ vertex: v }, { vertex: v }] }));
  const landmarks = { pin: at([0, 1, 2, 4]), rbf: at([0, 2, 3, 5]), rotate: at([0, 4]), auto: 'auto' };
  const remeshes = ['adaptive', 'overlay', 'subdivision', 'convex-hull', 'template'];
  for (const [i, method] of Object.keys(landmarks).entries()) {
    step(`a supermesh: ${method}, ${remeshes[i]}`);
    made.push(
      await d.made('/v1/supermeshes', {
        shapes: [
          { mesh: i % 2 ? glb.id : egg.id, name: 'a' },
          { mesh: bean.id, name: 'b' },
        ],
        landmarks: landmarks[method],
        align: { method },
        remesh: { method: remeshes[i] },
        asset: { path: i % 2 ? 'rigid' : 'linear', fit: ['none', 'rigid', 'similarity', 'none'][i] },
      }),
    );
  }
  step('one that is cancelled, one that is wrong');
  const reply = await is(202, d.post('/v1/embeddings', { mesh: bean.id, options: { preset: 'quality' } }));
  const events = d.get(`${reply.json.url}/events`);
  await is([200, 202, 204, 409], d.delete(reply.json.url));
  await events;
  await is(400, d.post('/v1/embeddings', '{"mesh":', { headers: { 'content-type': 'application/json' } }));
  await is([400, 404, 422], d.post('/v1/embeddings', { mesh: '0'.repeat(64) }));
  await is(
    [400, 422],
    d.post('/v1/supermeshes', {
      shapes: [{ mesh: egg.id }, { mesh: bean.id }],
      landmarks: [{ at: [{ vertex: 1e6 }, { vertex: 0 }] }],
    }),
  );
  await is(200, d.post('/v1/embeddings', { mesh: egg.id }, WAIT));
  return made;
}

async function reads(kinds, made) {
  step('every read: whole, in part, on condition, not there');
  for (const mesh of Object.values(kinds)) await is(200, d.get(`${mesh.url}/file`));
  for (const resource of made) {
    const supermesh = resource.url.includes('supermeshes');
    const got = await is(200, d.get(resource.url));
    await is(304, d.get(resource.url, { headers: { 'if-none-match': got.headers.get('etag') } }));
    for (const part of supermesh ? ['asset.glb', 'places', 'spheres/0.ply', 'spheres/1.ply'] : ['sphere.ply']) {
      const file = `${resource.url}/${part}`;
      const whole = await is(200, d.get(file));
      const part_of = await is(
        206,
        d.get(file, { headers: { range: 'bytes=10-19', 'if-range': whole.headers.get('etag') } }),
      );
      assert.deepEqual(part_of.bytes, whole.bytes.subarray(10, 20));
      await is(416, d.get(file, { headers: { range: 'bytes=999999999-' } }));
      await is(200, d.request('HEAD', file));
    }
    if (supermesh) await is(404, d.get(`${resource.url}/spheres/7.ply`));
  }
  for (const list of ['meshes', 'embeddings', 'supermeshes', 'jobs']) {
    const page = await is(200, d.get(`/v1/${list}`, { query: { limit: 2 } }));
    if (page.json.next_page_token)
      await is(200, d.get(`/v1/${list}`, { query: { limit: 2, page_token: page.json.next_page_token } }));
    await is(400, d.get(`/v1/${list}`, { query: { limit: 'x' } }));
  }
  for (const job of (await d.get('/v1/jobs')).json.jobs) {
    await is(200, d.get(job.url, { query: { wait: 1 } }));
    const all = await is(200, d.get(`${job.url}/events`));
    assert.match(all.bytes.toString(), /^event: ?(succeeded|failed|cancelled)/m);
    await is([200, 204], d.get(`${job.url}/events`, { headers: { 'last-event-id': '1' } }));
  }
  for (const page of ['/livez', '/readyz?verbose', '/metrics', '/openapi.json', '/docs', '/', '/problems/not-closed'])
    await is([200, 308, 302], d.get(page));
  await is(404, d.get('/nothing'));
  await is(405, d.request('PUT', '/v1/meshes'));
  await is(
    204,
    d.request('OPTIONS', '/v1/meshes', {
      headers: { origin: 'https://a.example', 'access-control-request-method': 'POST' },
    }),
  );
}

async function commands(kinds, made) {
  step('the command line');
  const env = { ORBMORPH_SERVER: d.url };
  for (const args of [
    ['ls'],
    ['ls', '--json'],
    ['get', made.at(-1).url],
    ['embed', kinds.egg.id],
    ['doctor'],
    ['completions', 'bash'],
    ['--help'],
    ['nothing'],
  ])
    step(`${args.join(' ')}: ${(await run(args, { env })).code}`);
  const out = path.join(data, 'walk.glb');
  const png = path.join(data, 'walk.png');
  const morph = await run(
    ['morph', kinds.egg.id, kinds.bean.id, '--align', 'rotate', '-o', out, '--report', path.join(data, 'walk.md')],
    { env },
  );
  assert.equal(morph.code, 0, morph.err);
  for (const more of [[], ['--frames', '3', '--wire']]) {
    const view = await run(['view', out, '-o', png, '--size', '32', ...more], { env });
    assert.equal(view.code, 0, view.err);
  }
  for (const args of [
    ['token', 'add', 'walker', '--scope', 'read'],
    ['token', 'list'],
    ['token', 'remove', 'walker'],
  ])
    execFileSync(binaries.daemon, [...args, '--data', data]);
}

async function removals(kinds, made) {
  step('deletions, SIGHUP, the end; the data again');
  for (const resource of [...made, ...Object.values(kinds)]) await is(204, d.delete(resource.url));
  await is(404, d.get(made[0].url));
  d.child.kill('SIGHUP');
  await is(200, d.get('/livez'));
  const { code } = await d.stop();
  assert.equal(code, 0, d.log);
  for (const action of ['--check-data', '--gc']) execFileSync(binaries.daemon, [action, '--data', data]);
}

try {
  const kinds = await meshes();
  const made = await jobs(kinds);
  await reads(kinds, made);
  await commands(kinds, made);
  await removals(kinds, made);
  step('done');
} finally {
  d.child.kill('SIGKILL');
  rmSync(data, { recursive: true, force: true });
}
