// The command line with a real daemon: its output, its files and its exit status.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { createHash } from 'node:crypto';
import { copyFile, mkdir, readdir, readFile, rm, stat, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { folder, quoted, run, runProgram } from './support/cli.mjs';
import { binaries, daemon, endless, samples, until } from './support/daemon.mjs';
import { morphOf } from './support/glb.mjs';
import * as shapes from './support/shapes.mjs';

const dog = path.join(samples, 'dog.obj');
const giraffe = path.join(samples, 'giraffe.off');
const landmarks = path.join(samples, 'dog-giraffe.json');
const waits = async (d) => (await d.get('/readyz?verbose')).json.waiting_connections > 0;
/** Starts a job that keeps the only worker busy; returns the job. */
async function occupy(d) {
  const { json: mesh } = await d.upload(
    shapes.binaryPly(shapes.ball(5, ([x, y, z]) => [x, y * (1.2 + 0.2 * Math.sin(9 * x)), z])),
  );
  return (await d.post('/v1/embeddings', { mesh: mesh.id, ...endless })).json;
}

/** The id of a mesh that is uploaded without options. */
const meshId = (text) => createHash('sha256').update(text).update('\0repair=safe').digest('hex');

test('wrong usage exits with 2 and explains the error', async () => {
  for (const args of [
    [],
    ['fly'],
    ['morph', 'one'],
    ['morph', '--bend', 'a', 'b'],
    ['upload'],
    ['job'],
    ['morph', 'a', 'b', '--landmarks'],
    ['morph', 'a', 'b', '--json=yes'],
    ['ls', 'shoes'],
    ['get', 'x', '--part', 'wing'],
    ['get', 'x', '--profile', 'meshopt'],
    ['get', 'x', '--part', 'asset', '--profile', 'draco'],
    ['morph', dog, giraffe, '--profile', 'draco'],
    ['completions', 'tcsh'],
    ['morph', dog, giraffe, '--tolerance', 'much'],
    ['morph', dog, giraffe, '--max-triangles', '1e4'],
    ['morph', dog, giraffe, '--set', 'x'],
    ['morph', dog, giraffe, '--set', `${'a.'.repeat(70)}b=1`],
    ['morph', dog, giraffe, '--set', `a=${'['.repeat(70)}${']'.repeat(70)}`],
    ['morph', dog, giraffe, '-o', '/nowhere/out.glb'],
    ['morph', dog, giraffe, '--report', '/nowhere/report.md'],
    ['upload', '/nowhere/mesh.obj'],
    ['morph', dog, giraffe, '--landmarks', '/nowhere.json'],
    ['upload', '--name', 'n', dog, giraffe],
    ['morph', dog, giraffe, '--align', 'bend'],
    ['morph', dog, giraffe, '--remesh', 'magic'],
    ['morph', dog, giraffe, '--fit', 'none,rigid'],
    ['morph', dog, giraffe, '--path', ''],
    ['morph', dog, giraffe, '--transfer', 'skin'],
    ['morph', dog, giraffe, '--transfer', '2:skin'],
    ['morph', dog, giraffe, '--transfer', '1:skin,'],
    ['morph', dog, giraffe, '--transfer', '1:texture:8'],
    ['morph', dog, giraffe, '--animation', 'loop'],
    ['morph', dog, giraffe, '--repair', 'safe,magic'],
    ['morph', dog, giraffe, '--tolerance', '2'],
    ['morph', dog, '/nowhere/mesh.obj'],
    ['morph', dog, path.dirname(dog)],
    ['morph', dog, giraffe, '-o', path.dirname(dog)],
    ['morph', dog, giraffe, dog, '-l', landmarks, '-o', '/dev/null'],
    ['embed', dog, '--method', 'magic'],
    ['embed', dog, '--set', 'x'],
    ['embed', dog, '-o', '/nowhere/out.ply'],
    ['upload', dog, '--format', 'fbx'],
    ['upload', dog, '/nowhere/mesh.obj'],
    ['ls', '--state', 'lost'],
    ['get', '0'.repeat(64), '-o', '/nowhere/x'],
    ['morph', dog, giraffe, '-o', 'x.gltf'],
    ['merge', dog, giraffe, '-o', 'a.jpg'],
    ['morph', dog, giraffe, '--report', 'report.html'],
    ['embed', dog, '-o', 'sphere.obj'],
    ['get', '0'.repeat(64), '--part', 'asset', '-o', 'a.ply'],
    ['view', 'out.glb', '-o', 'a.jpg'],
    ['view', 'out.glb', '--up', 'w'],
    ['morph', dog, giraffe, '--align', 'pin'],
    ['morph', dog, giraffe, '-t', '500%'],
    ['morph', dog, giraffe, '-t', '%'],
    ['studio', '/nowhere/mesh.obj'],
  ]) {
    const { code, err, out } = await run(args, { env: { ORBMORPH_SERVER: 'http://127.0.0.1:9' } });
    assert.equal(code, 2, `${args}: ${code} ${err}`);
    assert.ok(err.length > 0 && out === '', `${args}`);
  }
  for (const [args, why] of [
    [['--foo'], /^orbmorph: unknown option '--foo'\n/],
    [['morph', dog, giraffe, landmarks], /dog-giraffe.json has landmarks, not a mesh: .* --landmarks /],
    [['morph', dog, giraffe, '--transfer', '5:skin'], /there is no shape 5; the files are shapes 0 to 1/],
    [['morph', dog, giraffe, '--transfer', '1:texture:8'], /whole number from 16 to 8192/],
    [['sign', '/v1/morph.glb?shapes=a,b', '--key', 'web:f00d'], /--expires is missing/],
    [['sign', 'http://x/y?expires=3', '--key', 'web:f00d'], /adds the parameters key and expires/],
    [['sign', 'http://x/y?signature=3', '--key', 'web:f00d'], /signed already/],
    [['get', '0'.repeat(64), '-o', 'x.glb'], /x\.json; add --part asset/],
    [['get', `/v1/supermeshes/${'0'.repeat(64)}/places`, '-o', 'p.json'], /p\.bin$/m],
  ]) {
    const { code, err } = await run(args, { env: { ORBMORPH_SERVER: 'http://127.0.0.1:9' } });
    assert.equal(code, 2, err);
    assert.match(err, why);
  }
  const help = await run(['--help']);
  assert.equal(help.code, 0);
  for (const name of ['morph', 'upload', 'embed', 'merge', 'job', 'ls', 'get', 'rm', 'doctor', 'view', 'studio']) {
    assert.match(help.out, new RegExp(`^  ${name} `, 'm'));
    assert.equal((await run([name, '--help'])).code, 0);
  }
  assert.match((await run(['--version'])).out, /^orbmorph \d+\.\d+\.\d+\n$/);
});

test('an unreachable daemon exits with 3', async () => {
  for (const args of [['ls'], ['upload', dog], ['morph', dog, giraffe]]) {
    const { code, err } = await run(['--server', 'http://127.0.0.1:9', ...args]);
    assert.equal(code, 3, err);
    assert.match(err, /127\.0\.0\.1:9/);
  }
  assert.equal((await run(['ls'], { env: { ORBMORPH_SERVER: 'gopher://127.0.0.1' } })).code, 3);
});

test('morph uploads, merges and downloads', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const at = await folder(t);
  const out = path.join(at, 'a morph.glb');
  const md = path.join(at, 'report.md');
  const json = path.join(at, 'report.json');
  const done = await run(['morph', dog, giraffe, '--landmarks', landmarks, '-o', out, '--report', md], { env });
  assert.equal(done.code, 0, done.err);
  assert.match(done.out, /landmarks, exact/);
  assert.equal(done.err.includes('\r'), false, 'no progress bar without a terminal');
  const morph = morphOf(await readFile(out));
  assert.deepEqual(morph.names, ['giraffe']);
  const report = await readFile(md, 'utf8');
  assert.match(report, /^# Morph of dog, giraffe/);
  assert.match(report, /\| nose \|/);
  assert.doesNotMatch(report, /nan|\?/i);

  const again = await run(['morph', dog, giraffe, '-l', landmarks, '-o', out, '--report', json, '--json', '-q'], {
    env,
  });
  assert.equal(again.code, 0, again.err);
  assert.equal(again.err, '', 'quiet is quiet');
  assert.deepEqual(JSON.parse(again.out), JSON.parse(await readFile(json, 'utf8')));
  assert.equal(JSON.parse(again.out).certificate.closed, true);
  assert.deepEqual(
    (await readdir(at)).sort(),
    ['a morph.glb', 'report.json', 'report.md'],
    'no temporary files remain',
  );

  const piped = await run(['morph', dog, giraffe, '-l', landmarks, '-q', '-o', '-'], { env });
  assert.ok(piped.bytes.equals(await readFile(out)), 'the asset on standard output');
  const named = await run(['morph', dog, giraffe, '-l', landmarks, '-q'], { env, cwd: at });
  assert.equal(named.code, 0, named.err);
  assert.ok((await readdir(at)).includes('dog-giraffe.glb'));
});

test('step by step: upload, ls, embed, merge, job, get, rm', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const at = await folder(t);
  await mkdir(path.join(at, 'in'));
  await copyFile(dog, path.join(at, 'in/dog.obj'));
  await copyFile(giraffe, path.join(at, 'in/giraffe.off'));
  const uploaded = await run(['upload', 'in/*', '--json'], { env, cwd: at });
  assert.equal(uploaded.code, 0, uploaded.err);
  const meshes = uploaded.out
    .trim()
    .split('\n')
    .map((line) => JSON.parse(line));
  assert.deepEqual(
    meshes.map((m) => m.name),
    ['dog', 'giraffe'],
    'the program expands a quoted pattern',
  );
  const list = await run(['ls'], { env });
  for (const m of meshes) assert.ok(list.out.includes(m.id));
  const embedded = await run(['embed', meshes[0].id, '-o', path.join(at, 'sphere.ply')], { env });
  assert.equal(embedded.code, 0, embedded.err);
  assert.match(embedded.out, /valid, 0 flipped, degree 1/);
  assert.match(
    (await readFile(path.join(at, 'sphere.ply'))).toString('latin1', 0, 40),
    /^ply\nformat binary_little_endian/,
  );
  const sent = await run(
    ['merge', meshes[0].id, meshes[1].id, '-l', landmarks, '--no-wait', '--json', '--set', 'asset.animation=none'],
    { env },
  );
  assert.equal(sent.code, 0, sent.err);
  const job = JSON.parse(sent.out);
  const waited = await run(['job', '--wait', job.id, '--json'], { env });
  assert.equal(waited.code, 0, waited.err);
  const ended = JSON.parse(waited.out);
  assert.equal(ended.state, 'succeeded');
  const id = ended.result.split('/').at(-1);
  assert.match((await run(['get', id], { env })).out, /closed, genus 0/);
  const asset = await run(['get', id, '--part', 'asset', '-o', path.join(at, 'x.glb')], { env });
  assert.equal(asset.code, 0, asset.err);
  assert.equal(morphOf(await readFile(path.join(at, 'x.glb'))).gltf.animations, undefined, '--set reached the daemon');
  for (const [tail, name] of [
    ['places', 'p.bin'],
    ['asset.glb', 'z.glb'],
    ['spheres/1.ply', 'y.ply'],
  ]) {
    const saved = await run(['get', `/v1/supermeshes/${id}/${tail}`, '-o', path.join(at, name)], { env });
    assert.equal(saved.code, 0, saved.err);
    const { bytes } = await d.get(`/v1/supermeshes/${id}/${tail}`);
    assert.ok(bytes.equals(await readFile(path.join(at, name))), tail);
  }
  for (const [operand, part, why] of [
    [meshes[0].id, 'asset', /asset is for supermeshes; this is one of the meshes, whose data is --part file/],
    [`/v1/supermeshes/${id}`, 'file', /file is for meshes; this is one of the supermeshes, whose data is --part asset/],
  ]) {
    const { code, err } = await run(['get', operand, '--part', part], { env });
    assert.equal(code, 1, err);
    assert.match(err, why);
  }
  const packed = await run(['get', id, '--part', 'asset', '--profile', 'meshopt'], { env });
  assert.ok(packed.bytes.equals((await d.get(`/v1/supermeshes/${id}/asset.glb?profile=meshopt`)).bytes), packed.err);
  const made = path.join(at, 'q.glb');
  const again = await run(
    [
      'merge',
      meshes[0].id,
      meshes[1].id,
      '-l',
      landmarks,
      '--set',
      'asset.animation=none',
      '--profile',
      'quantized',
      '-o',
      made,
    ],
    { env },
  );
  assert.equal(again.code, 0, again.err);
  const quantized = await readFile(made);
  assert.ok(quantized.equals((await d.get(`/v1/supermeshes/${id}/asset.glb?profile=quantized`)).bytes));
  const drawn = await run(['view', made, '-o', path.join(at, 'q.png')]);
  assert.deepEqual([drawn.code, /KHR_mesh_quantization.*--profile float/.test(drawn.err)], [2, true], drawn.err);
  const file = await run(['get', meshes[0].id, '--part', 'file'], { env });
  assert.ok(file.bytes.equals(await readFile(dog)));
  assert.match((await run(['ls', 'jobs', '--state', 'succeeded'], { env })).out, /supermesh/);
  assert.equal((await run(['rm', id], { env })).code, 0);
  const gone = await run(['get', id], { env });
  assert.equal(gone.code, 1);
  assert.match(gone.err, /not-found/);
  for (const [args, why] of [
    [['get', '0000'], /no id begins with these digits/],
    [['rm', '0'.repeat(64)], /has this id/],
    [['job', 'nonsense'], /has this id/],
  ]) {
    const { code, err } = await run(args, { env });
    assert.equal(code, 1, err);
    assert.match(err, why);
  }
  assert.equal(JSON.parse((await run(['get', id, '--json'], { env })).err).type, '/problems/not-found');
});

test('nothing is uploaded before the options were checked and the output was tried', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const at = await folder(t);
  await writeFile(path.join(at, 'one.json'), '[{"at":[{"vertex":1}]}]');
  for (const more of [
    ['--align', 'bend'],
    ['--tolerance', '7'],
    ['--set', 'x'],
    ['-l', path.join(at, 'one.json')],
    ['-o', path.join(at, 'none/out.glb')],
    ['-o', at],
    ['--report', path.join(at, 'none/report.md')],
    [path.join(at, 'none.obj')],
  ]) {
    const { code, err } = await run(['morph', dog, giraffe, ...more], { env, cwd: at });
    assert.equal(code, 2, `${more}: ${err}`);
  }
  // what only the daemon knows
  await writeFile(path.join(at, 'bent.json'), '[{"at":[{"vertex":1},{"vertex":-1}]}]');
  for (const [more, why] of [
    [['--set', 'remesh.colour=1'], /unknown-member: There is no member "colour"/],
    [['--set', 'asset.holes=maybe'], /bad-option: "holes" in "asset" must be/],
    [['--transfer', '1:fur'], /invalid-request: "what" of entry 0 of "transfer"/],
    [['-l', path.join(at, 'bent.json')], /landmarks/],
  ]) {
    const { code, err } = await run(['morph', dog, giraffe, ...more], { env, cwd: at });
    assert.equal(code, 1, `${more}: ${err}`);
    assert.match(err, why);
  }
  await rm(path.join(at, 'bent.json'));
  assert.equal((await run(['embed', dog, '-o', path.join(at, 'none/x.ply')], { env })).code, 2);
  assert.deepEqual((await d.get('/v1/meshes')).json.meshes, []);
  assert.deepEqual(await readdir(at), ['one.json'], 'trying leaves nothing behind');
  // An existing output keeps its bytes until the new ones are complete; a device is written to and stays a device.
  const kept = path.join(at, 'kept.glb');
  await writeFile(kept, 'old');
  const ring = path.join(at, 'ring.obj');
  await writeFile(ring, shapes.obj(shapes.torus()));
  assert.equal((await run(['morph', dog, ring, '-o', kept], { env })).code, 1);
  assert.equal(await readFile(kept, 'utf8'), 'old');
  const get = [binaries.client, 'get', (await d.mesh(dog)).id, '--part', 'file', '-o', '/dev/stdout'].map(quoted);
  const device = await runProgram('sh', ['-c', `${get.join(' ')} | cat`], { env });
  assert.equal(device.code, 0, device.err);
  assert.ok(device.bytes.equals(await readFile(dog)));
  assert.ok((await stat('/dev/null')).isCharacterDevice());
});

test('ids may be given by their first digits', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const at = await folder(t);
  const a = await d.mesh(dog);
  const b = await d.mesh(giraffe);
  const ask = (...args) => run(args, { env, cwd: at });
  const seen = async (digits, ...args) => JSON.parse((await ask(...args, digits, '--json')).out).id;
  assert.equal(await seen(a.id.slice(0, 8), 'get'), a.id);
  const glb = path.join(at, 'out.glb');
  const made = await ask('morph', a.id.slice(0, 10), b.id.slice(0, 10), '-l', landmarks, '-o', glb);
  assert.equal(made.code, 0, made.err);
  const [supermesh] = (await d.get('/v1/supermeshes')).json.supermeshes;
  assert.equal(await seen(supermesh.id.slice(0, 12), 'get'), supermesh.id);
  const asset = await ask('get', supermesh.id.slice(0, 12), '--part', 'asset');
  assert.ok(asset.bytes.equals(await readFile(glb)));
  const [job] = (await d.get('/v1/jobs')).json.jobs;
  assert.equal(await seen(job.id.slice(0, 8), 'job'), job.id);
  const embedded = await ask('embed', a.id.slice(0, 10), '--json');
  assert.equal(JSON.parse(embedded.out).mesh, a.id);

  // A file of that name is the file.
  await copyFile(giraffe, path.join(at, a.id.slice(0, 8)));
  assert.equal(JSON.parse((await ask('embed', a.id.slice(0, 8), '--json')).out).mesh, b.id);

  // Several entries begin with the same four digits: the message lists them, and nothing is deleted.
  const twins = [];
  for (let i = 0, heads = new Map(); twins.length === 0; i++) {
    const text = `OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 ${i + 1}\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n`;
    const head = meshId(text).slice(0, 4);
    if (heads.has(head)) twins.push(heads.get(head), text);
    heads.set(head, text);
  }
  const ids = [];
  for (const [i, text] of twins.entries()) ids.push((await d.upload(text, { name: `twin${i}` })).json.id);
  assert.equal(ids[0].slice(0, 4), ids[1].slice(0, 4));
  for (const command of ['get', 'rm', 'embed']) {
    const { code, out, err } = await ask(command, ids[0].slice(0, 4));
    assert.equal(code, 1, err);
    assert.equal(out, '');
    for (const [i, id] of ids.entries()) assert.match(err, new RegExp(`${id} +mesh twin${i}`), command);
  }
  assert.equal((await d.get(`/v1/meshes/${ids[0]}`)).status, 200);
  const unique = [...ids[0]].findIndex((digit, i) => digit !== ids[1][i]) + 1;
  assert.equal((await ask('rm', ids[0].slice(0, unique))).code, 0);
  assert.equal((await d.get(`/v1/meshes/${ids[0]}`)).status, 404);
  assert.equal((await d.get(`/v1/meshes/${ids[1]}`)).status, 200);
  const none = await ask('get', '0123456789');
  assert.equal(none.code, 1);
  assert.match(none.err, /0123456789: not-found/);
  assert.equal((await ask('get', 'abc')).code, 1, 'three digits are too few');
});

test('landmark files: an array, an object with one, and plain vertex numbers', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1'] });
  const before = await occupy(d);
  const env = { ORBMORPH_SERVER: d.url };
  const at = await folder(t);
  const file = path.join(at, 'l.json');
  const places = JSON.parse(await readFile(landmarks, 'utf8'))
    .landmarks.slice(0, 4)
    .map((l) => ({ at: l.at }));
  const jobs = new Set();
  for (const list of [places, { landmarks: places }, places.map((l) => l.at.map((p) => p.vertex))]) {
    await writeFile(file, JSON.stringify(list));
    const sent = await run(['merge', dog, giraffe, '-l', file, '--no-wait', '--json', '-q'], { env });
    assert.equal(sent.code, 0, sent.err);
    jobs.add(JSON.parse(sent.out).id);
  }
  assert.equal(jobs.size, 1, 'all three make the same request');
  for (const job of [...jobs, before.id]) assert.equal((await run(['job', '--cancel', job], { env })).code, 0);
  for (const wrong of ['{"landmarks": 3}', '7', '[{"at": ', '']) {
    await writeFile(file, wrong);
    const { code, err } = await run(['merge', dog, giraffe, '-l', file], { env });
    assert.equal(code, 2, err);
    assert.match(err, /l\.json/);
  }
});

test('a refused request exits with 1 and prints the problem on standard error', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const at = await folder(t);
  const open = path.join(at, 'open.obj');
  const two = path.join(at, 'two.obj');
  const ring = path.join(at, 'ring.obj');
  const reversed = path.join(at, 'reversed.obj');
  await writeFile(open, shapes.obj(shapes.withoutFace(shapes.ball(2))));
  await writeFile(two, shapes.obj(shapes.apart(shapes.ball(2), shapes.ball(1))));
  await writeFile(ring, shapes.obj(shapes.torus()));
  await writeFile(reversed, shapes.obj(shapes.reversed(shapes.ball(2))));
  const refused = await run(['upload', open], { env });
  assert.equal(refused.code, 1);
  assert.equal(refused.out, '');
  assert.match(refused.err, /not-closed/);
  assert.match(refused.err, /boundary_edges/);
  const asJson = await run(['upload', open, '--json'], { env });
  assert.equal(asJson.code, 1);
  assert.equal(JSON.parse(asJson.err).type, '/problems/not-closed');
  assert.equal((await run(['upload', open, '--repair', 'fill_holes'], { env })).code, 0);
  const morph = await run(['morph', dog, ring, '-o', path.join(at, 'never.glb')], { env });
  assert.equal(morph.code, 1);
  assert.match(morph.err, /not-genus-zero/);
  assert.ok(!(await readdir(at)).includes('never.glb'));
  const pin = await run(['morph', dog, giraffe, '--set', 'align.method=pin', '-o', path.join(at, 'never.glb')], {
    env,
  });
  assert.equal(pin.code, 1);
  assert.match(pin.err, /bad-landmarks/);

  const healthy = await run(['doctor', dog], { env });
  assert.equal(healthy.code, 0, healthy.err);
  assert.match(healthy.out, /healthy/);
  assert.equal((await run(['ls'], { env })).out.includes('dog'), true, 'doctor keeps meshes that were there before');
  const sick = await run(['doctor', open, two, ring, reversed], { env });
  assert.equal(sick.code, 1);
  assert.match(sick.out, /--repair fill_holes/);
  assert.match(sick.out, /--repair largest_component/);
  assert.match(sick.out, /handles/);
  assert.match(sick.out, /turn-inside-out/);
  assert.equal((await run(['ls'], { env })).out.includes('reversed'), false, 'doctor deletes the meshes it added');
});

test('a wait survives a restart of the daemon', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1'] });
  const { port } = new URL(d.url);
  const before = await occupy(d);
  const { json: mesh } = await d.upload(shapes.obj(shapes.egg(3)));
  const waiting = run(['embed', mesh.id], { env: { ORBMORPH_SERVER: d.url } });
  await until(() => waits(d), 'the program waits');
  d.killed = true;
  await d.stop('SIGKILL');
  d.args.push('--listen', `127.0.0.1:${port}`); // the last --listen wins
  await d.start();
  d.killed = false;
  assert.equal((await d.delete(before.url)).status, 200);
  const { code, out, err } = await waiting;
  assert.equal(code, 0, err);
  assert.match(out, /0 flipped/);
});

test('an interrupted wait prints how to continue', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1'] });
  const before = await occupy(d);
  const { json: mesh } = await d.upload(shapes.obj(shapes.egg(3)));
  const child = spawn(binaries.client, ['embed', mesh.id, '--method', 'kernel-sampling'], {
    env: { ...process.env, ORBMORPH_SERVER: d.url },
    stdio: ['ignore', 'pipe', 'pipe'],
  });
  let err = '';
  child.stderr.on('data', (chunk) => (err += chunk));
  const ended = new Promise((resolve) => child.on('exit', (code, signal) => resolve(signal ?? code)));
  await until(() => waits(d), 'the program waits');
  const job = (await d.get('/v1/jobs')).json.jobs.find(({ id }) => id !== before.id);
  child.kill('SIGINT');
  assert.equal(await ended, 'SIGINT');
  const [, url] = err.match(/orbmorph job --wait (\/v1\/jobs\/\w+)/);
  assert.equal(url, job.url);
  const cancelled = await run(['job', '--cancel', url], { env: { ORBMORPH_SERVER: d.url } });
  assert.equal(cancelled.code, 0, cancelled.err);
  assert.equal((await d.delete(before.url)).status, 200);
});

test('a terminal shows progress', async (t) => {
  const d = await daemon(t);
  const at = await folder(t);
  const line = [binaries.client, 'morph', dog, giraffe, '-l', landmarks, '-o', path.join(at, 'o.glb')]
    .map(quoted)
    .join(' ');
  const child = spawn('script', ['-qec', line, '/dev/null'], {
    env: { ...process.env, ORBMORPH_SERVER: d.url, TERM: 'xterm' },
    stdio: ['ignore', 'pipe', 'inherit'],
  });
  let out = '';
  child.stdout.on('data', (chunk) => (out += chunk));
  const code = await new Promise((resolve) => child.on('close', resolve));
  assert.equal(code, 0, out);
  assert.match(out, /upload dog +\[#+\.*\] +\d+ %/);
  assert.match(out, /download +\[#/);
});

test('view draws a picture of a morph', async (t) => {
  const d = await daemon(t);
  const at = await folder(t);
  await run(['morph', dog, giraffe, '-l', landmarks, '-o', 'o.glb', '-q'], {
    env: { ORBMORPH_SERVER: d.url },
    cwd: at,
  });
  const { code, err } = await run(['view', 'o.glb', '-o', 'o.png', '--poses', '3', '--size', '64'], { cwd: at });
  assert.equal(code, 0, err);
  const png = await readFile(path.join(at, 'o.png'));
  assert.equal(png.toString('latin1', 1, 4), 'PNG');
  assert.deepEqual([png.readUInt32BE(16), png.readUInt32BE(20)], [192, 64]);
  assert.equal((await run(['view', dog], { cwd: at })).code, 2);
});

test('a tolerance may be a percentage', async (t) => {
  const d = await daemon(t);
  const at = await folder(t);
  const args = ['--json', '-q', '-o', path.join(at, 'x.glb'), '-l', landmarks];
  const env = { ORBMORPH_SERVER: d.url };
  const { code, out, err } = await run(['morph', dog, giraffe, '-t', '5%', ...args], { env });
  assert.equal(code, 0, err);
  assert.equal(JSON.parse(out).request.remesh.tolerance, 0.05);
});

test('a size of handles that is none is refused before anything is sent', async () => {
  const env = { ORBMORPH_SERVER: 'http://127.0.0.1:1' }; // no one listens there
  for (const size of ['big', '0', '-1', '11', 'nan', '0.1x', '']) {
    const { code, err } = await run(['upload', dog, '--repair', 'close_handles', '--handle-size', size], { env });
    assert.equal(code, 2, `${size}: ${err}`);
    assert.match(err, /--handle-size takes a number from 0\.000001 to 10/);
  }
});

test('a report warns of what is worse than asked, and only of that', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const at = await folder(t);
  const [report, tall, marks] = ['report.md', 'tall.obj', 'marks.json'].map((name) => path.join(at, name));
  // A dog that is a fifth taller: the map to it is good, although the dog has few triangles.
  const taller = (line) => line.replace(/^v (\S+) (\S+)/, (_, x, y) => `v ${x} ${1.2 * y}`);
  await writeFile(tall, (await readFile(dog, 'utf8')).split('\n').map(taller).join('\n'));
  const list = JSON.parse(await readFile(landmarks, 'utf8')).landmarks;
  await writeFile(marks, JSON.stringify({ landmarks: list.map((l) => ({ ...l, at: [l.at[0], l.at[0]] })) }));
  const morph = async (...args) => {
    const made = await run(['morph', dog, tall, '-l', marks, '-o', path.join(at, 'x.glb'), ...args], { env });
    assert.equal(made.code, 0, made.err);
    return made.out;
  };
  assert.doesNotMatch(await morph('--report', report), /warning/);
  assert.doesNotMatch(await readFile(report, 'utf8'), /## Warnings/);
  assert.match(
    await morph('-n', '100', '--report', report),
    /warning: The morph differs .*: dog by up to [\d.]+ %, tall by/,
  );
  assert.match(await readFile(report, 'utf8'), /## Warnings\n\n(.*\n)*\* The morph differs .* \(tolerance 0\.1 %\)/);
});

test('only landmarks of weight 1 are called exact; of soft ones the client says how far they are off', async (t) => {
  const d = await daemon(t);
  const at = await folder(t);
  const list = JSON.parse(await readFile(landmarks, 'utf8')).landmarks;
  const limp = list.findIndex((l) => l.name === 'tail root');
  const above = list.findIndex((l) => l.name === 'tail, above');
  list[limp].at[1] = list[above].at[1]; // not its place, so that the map is better where it gives way
  list.splice(above, 1);
  const said = async (weightOf) => {
    const marks = list.map((l, i) => ({ ...l, weight: weightOf(i) }));
    await writeFile(path.join(at, 'marks.json'), JSON.stringify(marks));
    const args = ['morph', dog, giraffe, '-l', 'marks.json', '-t', '0.02', '-o', 'x.glb'];
    const env = { ORBMORPH_SERVER: d.url };
    const done = await run([...args, '--report', 'r.md'], { env, cwd: at });
    assert.equal(done.code, 0, done.err);
    const json = await run([...args, '--json', '-q'], { env, cwd: at });
    const report = await readFile(path.join(at, 'r.md'), 'utf8');
    return { out: done.out, report, supermesh: JSON.parse(json.out) };
  };
  const off = (text) => Number(text.match(/up to ([\d.]+) % of the diagonal from/)[1]) / 100;
  const near = (x, y) => assert.ok(Math.abs(x - y) <= 0.01 * y, `${x} ${y}`);

  const one = await said((i) => (list[i].name === 'tail root' ? 0.3 : 1));
  const soft = one.supermesh.landmarks.find((l) => l.name === 'tail root');
  assert.equal(one.supermesh.certificate.landmarks_exact, true, 'the others are');
  assert.match(one.out, /^ {2}19 landmarks, exact \(distance at most \S+ %\); 1 soft landmark, up to .* its place$/m);
  assert.match(one.report, /^19 landmarks coincide exactly\. 1 soft landmark stays up to .* from its place\.$/m);
  assert.match(one.report, /^\| tail root \(weight 0\.3\) \| /m);
  for (const text of [one.out, one.report]) near(off(text), Math.max(...soft.residual_relative));

  const two = await said((i) => (/^(tail root|belly)$/.test(list[i].name) ? 0.2 : 1));
  assert.match(two.out, /^ {2}18 landmarks, exact \(.*\); 2 soft landmarks, up to .* from their places$/m);
  assert.match(two.report, /^18 landmarks coincide exactly\. 2 soft landmarks stay up to .* from their places\.$/m);

  const all = await said(() => 0.9);
  assert.match(all.out, /^ {2}20 soft landmarks, .* their places$/m);
  assert.match(all.report, /^20 soft landmarks stay .* their places\.$/m);
  for (const text of [all.out, all.report]) assert.doesNotMatch(text, /exact/);
});

test('a report in Markdown says how the fit moved a shape, and takes any name and ending', async (t) => {
  const d = await daemon(t);
  const at = await folder(t);
  // centimetres with z up
  const big = (line) => line.replace(/^v (\S+) (\S+) (\S+)/, (_, x, y, z) => `v ${100 * x} ${-100 * z} ${100 * y}`);
  await writeFile(path.join(at, 'dog|cm.obj'), (await readFile(dog, 'utf8')).split('\n').map(big).join('\n'));
  const list = JSON.parse(await readFile(landmarks, 'utf8')).landmarks;
  const marks = list.map((l) => ({ ...l, name: `${l.name}|`, at: [l.at[0], l.at[0]] }));
  await writeFile(path.join(at, 'marks.json'), JSON.stringify(marks));
  const args = ['morph', dog, 'dog|cm.obj', '-l', 'marks.json', '-o', 'x.glb', '--report', 'r.MD'];
  const { code, out, err } = await run(args, { env: { ORBMORPH_SERVER: d.url }, cwd: at });
  assert.equal(code, 0, err);
  const moved = /moved onto the first shape: scaled by 0\.01, rotated by 90°, moved by [\d.]+ diagonals; its y axis/;
  assert.match(out, moved);
  const report = await readFile(path.join(at, 'r.MD'), 'utf8');
  assert.match(report, /^# Morph of dog, dog\\\|cm\n/);
  assert.match(
    report.split('\n').find((line) => line.startsWith('* dog')),
    moved,
  );
  // unescaped bars end cells: each row has as many as the head of its table
  for (const table of report.split('\n\n').filter((part) => part.startsWith('| '))) {
    const bars = table
      .split('\n')
      .filter((line) => line.startsWith('|'))
      .map((line) => line.match(/(?<!\\)\|/g).length);
    assert.equal(new Set(bars).size, 1, table);
  }
  assert.doesNotMatch(report + out, /e-1\d %/, 'rounding is no distance');
});

test('studio says what to do where no browser opens, and with a file that is refused', async (t) => {
  const at = await folder(t);
  const child = spawn(binaries.client, ['studio', '--data', path.join(at, 'data')], {
    env: { PATH: at, BROWSER: path.join(at, 'none') },
    stdio: ['ignore', 'ignore', 'pipe'],
  });
  t.after(() => child.kill('SIGKILL'));
  let err = '';
  child.stderr.on('data', (chunk) => (err += chunk));
  await until(() => /open the address above yourself/.test(err), 'the note');
  const ended = new Promise((resolve) => child.on('exit', resolve));
  child.kill('SIGINT');
  assert.equal(await ended, 0);
  assert.doesNotMatch(err, /"level"/, 'the log of the daemon stays out of the terminal');
  const ring = path.join(at, 'ring.obj');
  await writeFile(ring, shapes.obj(shapes.torus()));
  const refused = await run(['studio', '--no-open', '--data', path.join(at, 'data'), ring], {});
  assert.equal(refused.code, 1, refused.err);
  assert.match(refused.err, /not-genus-zero[\s\S]*start it without this file, and drop the file on its page/);
  assert.doesNotMatch(refused.err, /"level"/);
});

test('studio starts a daemon of its own on a free port, uploads files and opens the browser', async (t) => {
  const at = await folder(t);
  const seen = path.join(at, 'seen');
  const browser = path.join(at, 'browser');
  await writeFile(browser, `#!/bin/sh\necho "$1" > ${quoted(seen)}.part && mv ${quoted(seen)}.part ${quoted(seen)}\n`, {
    mode: 0o755,
  });
  const child = spawn(binaries.client, ['studio', '--data', path.join(at, 'data'), dog], {
    env: { ...process.env, BROWSER: browser },
    stdio: ['ignore', 'pipe', 'inherit'],
  });
  t.after(() => child.kill('SIGKILL'));
  let out = '';
  child.stdout.on('data', (chunk) => (out += chunk));
  await until(() => out.includes('\n') && stat(seen).catch(() => null), 'the browser');
  const url = out.trim();
  assert.equal((await readFile(seen, 'utf8')).trim(), url);
  const [, address, id] = url.match(/^(http:\/\/127\.0\.0\.1:\d+)\/#m=([0-9a-f]{64})$/);
  assert.match(await (await fetch(`${address}/`)).text(), /<title>/);
  assert.equal((await (await fetch(`${address}/v1/meshes/${id}`)).json()).name, 'dog');
  const ended = new Promise((resolve) => child.on('exit', (code, signal) => resolve(code ?? signal)));
  child.kill('SIGINT');
  assert.equal(await ended, 0);
  await assert.rejects(fetch(`${address}/livez`), 'its daemon is gone, too');
});

test('doctor says what a repair would leave, and calls none helpful that takes most of the mesh', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const at = await folder(t);
  const crumb = path.join(at, 'crumb.obj');
  const herd = path.join(at, 'herd.obj');
  await writeFile(crumb, shapes.obj(shapes.apart(shapes.ball(3), shapes.ball(1))));
  const three = shapes.apart(shapes.ball(2), shapes.apart(shapes.ball(2), shapes.ball(2), 20), 10);
  await writeFile(herd, shapes.obj(three));
  const helps = await run(['doctor', crumb], { env });
  assert.equal(helps.code, 1);
  assert.match(
    helps.out,
    /helps: orbmorph upload --repair largest_component .*\n {2}left: 512 triangles; the file has 544/,
  );
  const worse = await run(['doctor', herd], { env });
  assert.doesNotMatch(worse.out, /helps/);
  assert.match(worse.out, /largest_component keeps only 128 of 384 triangles \(33 %\)/);
  assert.match(helps.out, /part 0: 512 triangles.*\n {2}part 1: 32 triangles/);
  const other = await run(['upload', crumb, '--take-part', '1'], { env });
  assert.equal(other.code, 0, other.err);
  assert.match(other.out, /32 triangles\n {2}repaired: part \(1\)/);
});

test('a cloud of points is not called damaged only', async (t) => {
  const d = await daemon(t);
  const cloud = path.join(await folder(t), 'cloud.ply');
  const head = ['ply', 'format ascii 1.0', 'element vertex 1', ...['x', 'y', 'z'].map((k) => `property float ${k}`)];
  await writeFile(cloud, [...head, 'end_header', '0 0 0', ''].join('\n'));
  const { code, out, err } = await run(['doctor', cloud], { env: { ORBMORPH_SERVER: d.url } });
  assert.equal(code, 1);
  assert.match(err, /holds no faces/);
  assert.match(out, /of a cloud of points, make a surface first/);
});

test('doctor lists the faults behind the first, and the size of handles that closes them', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const at = await folder(t);
  const [mess, rest, fan] = ['mess', 'rest', 'fan'].map((name) => path.join(at, `${name}.obj`));
  await writeFile(mess, shapes.obj(shapes.apart(shapes.withoutFace(shapes.torus(24, 12)), shapes.ball(1))));
  await writeFile(rest, shapes.obj(shapes.apart(shapes.torus(24, 12), shapes.withoutFace(shapes.ball(1)))));
  await writeFile(fan, 'v 0 0 0\nv 0 0 1\nv 1 0 0\nv 0 1 0\nv -1 -1 0\nf 1 2 3\nf 1 2 4\nf 1 2 5\n');

  const sick = await run(['doctor', mess], { env });
  assert.equal(sick.code, 1);
  assert.match(sick.err, /not-closed: .* 3 edges in 1 boundary loop/);
  assert.match(
    sick.out,
    /with --repair fill_holes: not-connected: .*\n {2}part 0: 576 triangles.*\n {2}part 1: 32 triangles/,
  );
  assert.match(
    sick.out,
    /with --repair largest_component,fill_holes: not-genus-zero: .*\n {2}handle: a loop of 12 vertices/,
  );
  const cure = sick.out.match(/helps: orbmorph (upload --repair \S+ --handle-size [\d.]+) /);
  assert.ok(cure, sick.out);
  assert.match(cure[1], /largest_component,fill_holes,close_handles/);
  // The tube of the torus is a ring of regular polygons of 12 corners: a cut adds two of them.
  const { positions } = shapes.torus(24, 12);
  const ring = positions.slice(0, 12);
  const centre = [0, 1, 2].map((k) => ring.reduce((sum, p) => sum + p[k], 0) / 12);
  const radius = Math.hypot(...ring[0].map((x, k) => x - centre[k]));
  const patches = 2 * 6 * radius ** 2 * Math.sin(Math.PI / 6);
  const left = await run([...cure[1].split(' '), mess, '--json'], { env });
  assert.equal(left.code, 0, left.err);
  const mesh = JSON.parse(left.out);
  const said = Number(sick.out.match(/patches over the handles are ([\d.]+) % of the area/)[1]);
  assert.ok(Math.abs(said / 100 / (patches / mesh.area) - 1) < 0.06, `${said} %, ${patches / mesh.area}`);
  assert.match(sick.out, new RegExp(`left: ${mesh.triangles} triangles; the file has 607`));

  const spared = await run(['doctor', rest], { env });
  assert.match(
    spared.out,
    /helps: orbmorph upload --repair largest_component,close_handles --handle-size/,
    'the hole is on the piece that is left out',
  );

  const open = await run(['doctor', fan], { env });
  assert.match(open.out, /split_nonmanifold: not-closed: .*\n {2}open edges: \[\d,\d\]/);
  assert.match(open.out, /None of the daemon's repairs fixes this mesh/);
  assert.doesNotMatch(open.out, /helps/);
  assert.equal((await run(['ls', '-q'], { env })).out.includes('rest'), false, 'doctor deletes all that it uploaded');
});

test('a part may be taken of one file only', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const at = await folder(t);
  const [a, b] = ['a', 'b'].map((name) => path.join(at, `${name}.obj`));
  const named = (...objects) => {
    let first = 1;
    return objects
      .map(([name, { positions, triangles }], i) => {
        const text = `o ${name}\n${positions.map(([x, y, z]) => `v ${x + 10 * i} ${y} ${z}\n`).join('')}${triangles
          .map((f) => `f ${f.map((v) => v + first).join(' ')}\n`)
          .join('')}`;
        first += positions.length;
        return text;
      })
      .join('');
  };
  await writeFile(a, named(['Body', shapes.ball(3)], ['Eye', shapes.ball(1)], ['1:Tail', shapes.ball(2)]));
  await writeFile(b, named(['Torso', shapes.ball(2)], ['Head', shapes.ball(1)]));
  const triangles = async (...args) => {
    const { code, out, err } = await run(['upload', '--json', ...args], { env });
    return code
      ? err
      : out
          .trim()
          .split('\n')
          .map((line) => JSON.parse(line).triangles);
  };
  assert.deepEqual(await triangles(a, b, '--take-part', '1'), [128, 32], 'the plain form is for all files');
  assert.deepEqual(await triangles(a, b, '--take-part', '0:Eye', '--take-part=1:Head'), [32, 32]);
  assert.deepEqual(await triangles(a, b, '--take-part', '0', '--take-part', '1:1'), [512, 32], 'else the plain one');
  assert.deepEqual(await triangles(a, '--take-part', '0:1:Tail'), [128], 'a name with a number and a colon');
  assert.match(await triangles(a, '--take-part', '1:Tail'), /is for file 1, but the files are 0 to 0/);
  assert.match(await triangles(a, b, '--take-part', '0', '--take-part', '1:Eye'), /no part of the name \\"Eye\\"/);
  const { json } = await d.upload(shapes.obj(shapes.egg(2)));
  const stored = await run(['merge', a, json.id, '--take-part', '1:0'], { env });
  assert.equal(stored.code, 2);
  assert.match(stored.err, /is a mesh that the daemon has already/);
});

test('doctor splits edges of three faces', async (t) => {
  const d = await daemon(t);
  const wall = path.join(await folder(t), 'wall.obj');
  await writeFile(
    wall,
    'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0 0 -1\nf 1 2 4\nf 2 3 4\nf 3 1 4\nf 2 1 5\nf 3 2 5\nf 1 3 5\nf 1 3 2\n',
  );
  const sick = await run(['doctor', wall], { env: { ORBMORPH_SERVER: d.url } });
  assert.equal(sick.code, 1);
  assert.match(
    sick.out,
    /helps: orbmorph upload --repair split_nonmanifold,largest_component .*\n {2}left: 6 triangles; the file has 7/,
  );
  const fan = path.join(path.dirname(wall), 'fan.obj');
  await writeFile(fan, 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0 -1 0\nf 1 2 3\nf 1 2 4\nf 1 2 5\n');
  const split = await run(['doctor', fan], { env: { ORBMORPH_SERVER: d.url } });
  assert.match(split.out, /^ {2}part 0: 1 triangle {2}$/m);
});

test('doctor lists handles, and upload closes them', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const ring = path.join(await folder(t), 'ring.obj');
  await writeFile(ring, shapes.obj(shapes.torus()));
  const sick = await run(['doctor', ring], { env });
  assert.equal(sick.code, 1);
  const found = sick.out.match(/handle: a loop of (\d+) vertices, ([\d.]+) of the diagonal, at vertex \d+/);
  assert.ok(found, sick.out);
  const size = String(Number(found[2]) * 1.1);
  const closed = await run(['upload', ring, '--repair', 'close_handles', '--handle-size', size], { env });
  assert.equal(closed.code, 0, closed.err);
  assert.match(closed.out, new RegExp(`repaired: close_handles \\(cut along a loop of ${found[1]} vertices`));
});
