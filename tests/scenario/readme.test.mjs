// The shell lines of the documents run as they stand, against a real daemon; its links lead somewhere.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { existsSync } from 'node:fs';
import { mkdtemp, readFile, readdir, rm, symlink } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import test from 'node:test';
import { daemon, root } from './support/daemon.mjs';

const documents = async () => ['README.md', 'CONTRIBUTING.md', ...(await readdir(path.join(root, 'docs'))).filter((f) => f.endsWith('.md')).map((f) => `docs/${f}`)];

test('every curl line of the documents works', async (t) => {
  const d = await daemon(t);
  const at = await mkdtemp(path.join(tmpdir(), 'orbmorph-readme-'));
  t.after(() => rm(at, { recursive: true, force: true }));
  await symlink(path.join(root, 'tests'), path.join(at, 'tests'));
  let ran = 0;
  for (const file of await documents()) {
    const text = await readFile(path.join(root, file), 'utf8');
    const blocks = [...text.matchAll(/^```sh\n([^]*?)^```$/gm)].map((m) => m[1]);
    if (!blocks.length) continue;
    const script = blocks.join('\n').replaceAll('http://127.0.0.1:8080', d.url).replaceAll('curl -sS', 'curl -sS --fail-with-body');
    const run = spawnSync('bash', ['-euo', 'pipefail', '-c', script], { cwd: at, encoding: 'utf8', timeout: 240_000 });
    assert.equal(run.status, 0, `${file}\n${run.stdout}\n${run.stderr}`);
    ran += blocks.length;
    if (file === 'README.md') {
      assert.equal((await readFile(path.join(at, 'dog-giraffe.glb'))).toString('latin1', 0, 4), 'glTF');
      assert.match(run.stdout, /glTF/);
      assert.match(run.stdout, /^event: ?succeeded/m);
    }
  }
  assert.ok(ran >= 5);
});

test('links and pictures are there', async () => {
  for (const file of await documents()) {
    const text = await readFile(path.join(root, file), 'utf8');
    for (const [, target] of text.matchAll(/\]\(([^)]+)\)/g)) {
      if (/^(https?:|#)/.test(target)) continue;
      assert.ok(existsSync(path.resolve(root, path.dirname(file), target.split('#')[0])), `${file}: ${target}`);
    }
  }
});
