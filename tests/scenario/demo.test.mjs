// deploy/demo.sh as a newcomer calls it: from another folder, with blanks in file names.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { chmod, copyFile, mkdir, mkdtemp, readFile, readdir, rm, stat, symlink, writeFile } from 'node:fs/promises';
import { connect, createServer } from 'node:net';
import { tmpdir } from 'node:os';
import path from 'node:path';
import test from 'node:test';
import validator from 'gltf-validator';
import { binaries, root, samples } from './support/daemon.mjs';

const skip =
  path.resolve(binaries.daemon) === path.join(root, 'build/bin/orbmorphd') ? false : 'it builds the release only';

function demo(args, { cwd, script = path.join(root, 'deploy/demo.sh'), env = {} }) {
  return new Promise((resolve) => {
    const child = spawn('bash', [script, ...args], {
      cwd,
      env: { ...process.env, ...env },
      stdio: ['ignore', 'pipe', 'pipe'],
    });
    let out = '';
    let err = '';
    child.stdout.on('data', (chunk) => (out += chunk));
    child.stderr.on('data', (chunk) => (err += chunk));
    child.on('close', (code) => resolve({ code, out, err }));
  });
}

const found = (out, name) => new RegExp(`^${name}: +(\\S+)$`, 'm').exec(out)?.[1];

async function clean(file) {
  const report = await validator.validateBytes(new Uint8Array(await readFile(file)));
  assert.equal(
    report.issues.numErrors + report.issues.numWarnings,
    0,
    JSON.stringify(report.issues.messages.slice(0, 3)),
  );
}

test('the demo morphs the samples', { skip }, async () => {
  const { code, out, err } = await demo([], { cwd: '/' });
  assert.equal(code, 0, err);
  await clean(found(out, 'GLB'));
  assert.match(await readFile(found(out, 'Report'), 'utf8'), /^# Morph of dog, giraffe/);
  assert.equal(JSON.parse(await readFile(found(out, 'JSON'), 'utf8')).certificate.landmarks_exact, true);
  assert.match(out, /^morphing dog\.obj and 1 more at http/m, 'it says what it does');
});

test('the demo takes files as arguments', { skip }, async (t) => {
  const cwd = await mkdtemp(path.join(tmpdir(), 'orbmorph demo '));
  t.after(() => rm(cwd, { recursive: true, force: true }));
  await mkdir(path.join(cwd, 'sub dir'));
  await copyFile(path.join(samples, 'dog.obj'), path.join(cwd, 'my dog.obj'));
  await copyFile(path.join(samples, 'elephant.ply'), path.join(cwd, 'sub dir/élé phant.ply'));
  await symlink(path.join(root, 'deploy/demo.sh'), path.join(cwd, 'demo link'));
  const temporary = path.join(cwd, 'temporary');
  await mkdir(temporary);
  const { code, out, err } = await demo(['my dog.obj', 'sub dir/élé phant.ply'], {
    cwd,
    script: 'demo link',
    env: { TMPDIR: temporary },
  });
  assert.equal(code, 0, err);
  await clean(found(out, 'GLB'));
  assert.ok((await stat(found(out, 'Report'))).size > 0);
  assert.deepEqual(await readdir(temporary), [], 'no temporary folder stays');
  const bad = await demo(['my dog.obj', 'nowhere.obj'], { cwd });
  assert.equal(bad.code, 2);
  assert.match(bad.err, /nowhere\.obj/);
});

/** Whether something listens at the port of all examples. */
const isTaken = () =>
  new Promise((resolve) => {
    const socket = connect(8080, '127.0.0.1', () => {
      socket.destroy();
      resolve(true);
    });
    socket.on('error', () => resolve(false));
  });

test('the demo says what the build does, and prefers port 8080', { skip }, async (t) => {
  // a build that takes six seconds, as Ninja reports it
  const tools = await mkdtemp(path.join(tmpdir(), 'orbmorph-tools-'));
  t.after(() => rm(tools, { recursive: true, force: true }));
  await writeFile(path.join(tools, 'cmake'), '#!/bin/sh\necho "[3/7] Building C object a.o"\nexec sleep 6\n');
  await chmod(path.join(tools, 'cmake'), 0o755);
  const taken = await isTaken();
  const { code, out, err } = await demo([], { cwd: '/', env: { PATH: `${tools}:${process.env.PATH}` } });
  assert.equal(code, 0, err);
  assert.match(out, /^building in .*\n {2}building: 3 of 7 \(\d+ s\)$/m);
  const port = Number(/^morphing .* at http:\/\/127\.0\.0\.1:(\d+)$/m.exec(out)[1]);
  if (!taken && port !== 8080) assert.ok(await isTaken(), `port ${port}, and 8080 was free`);
  // if it is taken, any other port
  const holder = createServer();
  await new Promise((resolve) => holder.on('error', resolve).listen(8080, '127.0.0.1', resolve));
  t.after(() => holder.close());
  const other = await demo([], { cwd: '/' });
  assert.equal(other.code, 0, other.err);
  assert.match(other.out, /^morphing .* at http:\/\/127\.0\.0\.1:(?!8080$)\d+$/m);
});

test('the demo can leave the daemon running', { skip }, async () => {
  const { code, out, err } = await demo(['--serve'], { cwd: tmpdir() });
  assert.equal(code, 0, err);
  const [, url, data, pid] = /^Server: (http\S+) \(its data in (\S+); stop it with: kill (\d+)\)$/m.exec(out);
  try {
    assert.equal((await fetch(new URL('/readyz', url))).status, 200);
  } finally {
    process.kill(Number(pid));
    await rm(data, { recursive: true, force: true });
  }
});
