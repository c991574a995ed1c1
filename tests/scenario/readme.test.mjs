// Runs the shell lines of the documents against a real daemon, and checks their links.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { existsSync } from 'node:fs';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { documents, place, shellLines } from './support/documents.mjs';
import { daemon, patience, root, samples, slow } from './support/daemon.mjs';
import { morphOf, parseGlb } from './support/glb.mjs';

/** The files that a document's lines must leave behind, and the output that they must print. */
const expected = {
  'README.md': async (at, out) => {
    for (const name of ['morph.glb', 'dog-giraffe.glb'])
      assert.deepEqual(morphOf(await readFile(path.join(at, name))).names, ['giraffe']);
    assert.match(out, /giraffe\.off: healthy: closed/);
    assert.match(out, /glTF/);
    assert.match(out, /^event: ?succeeded/m);
  },
  'docs/cookbook.md': async (at, out) => {
    assert.deepEqual(morphOf(await readFile(path.join(at, 'morph.glb'))).names, ['giraffe']);
    const dressed = parseGlb(await readFile(path.join(at, 'dressed.glb')));
    assert.equal((dressed.gltf ?? dressed).images.length, 1);
    for (const line of [
      /"type": "\/problems\/not-closed"/,
      /helps: orbmorph upload --repair fill_holes open\.obj/,
      /^succeeded: \/v1\/supermeshes\//m,
      /^event: ?succeeded/m,
      /^cancelled$/m,
      /^304$/m,
      /^\/problems\/unauthorized$/m,
    ])
      assert.match(out, line);
  },
  'docs/tutorial.md': async (at) =>
    assert.deepEqual(morphOf(await readFile(path.join(at, 'morph.glb'))).names, ['elephant']),
};

for (const file of await documents()) {
  let lines = await shellLines(file);
  if (!lines) continue;
  // The cookbook makes dozens of morphs, which takes minutes with sanitizers; other tests use its routes as well.
  const skip = slow && file === 'docs/cookbook.md' && 'run in the release build';
  test(`every line of ${file} works`, { skip }, async (t) => {
    const d = await daemon(t);
    const { at, env } = await place(t, d);
    // The longest wait that a request may ask for is a minute; results that take longer with sanitizers are computed
    // beforehand.
    if (slow && file === 'README.md') {
      const shapes = [await d.mesh(path.join(samples, 'dog.obj')), await d.mesh(path.join(samples, 'giraffe.off'))];
      const { landmarks } = JSON.parse(await readFile(path.join(samples, 'dog-giraffe.json'), 'utf8'));
      await d.made('/v1/supermeshes', { shapes: shapes.map(({ id, name }) => ({ mesh: id, name })), landmarks });
    }
    // Landmarks that the tutorial writes by hand are vertices of the files in the tree; coarser animals have their own
    // landmarks.
    if (process.env.ORB_SAMPLES && file === 'docs/tutorial.md') {
      const written = lines;
      lines = lines.replace(
        /^cat > landmarks\.json <<'END'\n[\s\S]*?^END$/m,
        'cp tests/samples/dog-elephant.json landmarks.json',
      );
      assert.notEqual(lines, written);
    }
    const run = spawnSync('bash', ['-euo', 'pipefail', '-c', lines.replaceAll('http://127.0.0.1:8080', d.url)], {
      cwd: at,
      env,
      encoding: 'utf8',
      timeout: 1_500_000 * patience,
    });
    assert.equal(run.status, 0, `${file}\n${run.stdout}\n${run.stderr}`);
    await expected[file]?.(at, run.stdout);
  });
}

test('the documents with executable lines exist', async () => {
  for (const file of Object.keys(expected)) assert.ok(await shellLines(file), file);
});

test('links and pictures exist', async () => {
  for (const file of await documents()) {
    const text = await readFile(path.join(root, file), 'utf8');
    for (const [, target] of text.replace(/^```[\s\S]*?^```$/gm, '').matchAll(/\]\(([^)]+)\)/g)) {
      if (/^(https?:|#)/.test(target)) continue;
      assert.ok(existsSync(path.resolve(root, path.dirname(file), target.split('#')[0])), `${file}: ${target}`);
    }
  }
});
