// deploy/demo.sh as a newcomer calls it: from another folder, with blanks in file names.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { copyFile, mkdir, mkdtemp, readFile, readdir, rm, stat, symlink } from 'node:fs/promises';
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
