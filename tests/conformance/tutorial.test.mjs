// Follows docs/tutorial.md: runs its commands, saves its page unchanged and opens it in headless Chromium.
// ORB_PICTURES=1 renders the pictures of the tutorial again.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import fs from 'node:fs';
import path from 'node:path';
import test from 'node:test';
import { daemon, root } from '../scenario/support/daemon.mjs';
import { blocks, place, shellLines } from '../scenario/support/documents.mjs';
import { readPng } from '../scenario/support/png.mjs';
import { need, npmFile, serve, startBrowser } from './pages.mjs';

need('three');

/** The share of pixels that differ noticeably. */
function difference(a, b) {
  let count = 0;
  for (let i = 0; i < a.length; i += 3) count += Math.max(...[0, 1, 2].map((c) => Math.abs(a[i + c] - b[i + c]))) > 24;
  return count / (a.length / 3);
}

test('the tutorial ends with a page that morphs', async (t) => {
  const d = await daemon(t);
  const { at, env } = await place(t, d);
  const run = spawnSync(
    'bash',
    ['-euo', 'pipefail', '-c', (await shellLines('docs/tutorial.md')).replaceAll('http://127.0.0.1:8080', d.url)],
    { cwd: at, env, encoding: 'utf8', timeout: 900_000 },
  );
  assert.equal(run.status, 0, `${run.stdout}\n${run.stderr}`);
  const text = fs.readFileSync(path.join(root, 'docs/tutorial.md'), 'utf8');
  const [said] = blocks(text, 'text');
  assert.ok(run.stdout.startsWith(said), `the doctor says\n${run.stdout}`);
  const [page_html] = blocks(text, 'html');
  fs.writeFileSync(path.join(at, 'page/index.html'), page_html);

  // The npm packages of the tests, at the paths where a reader installs them.
  const server = await serve((where) =>
    where.startsWith('/node_modules/')
      ? npmFile(where.slice(14))
      : path.join(at, 'page', where === '/' ? 'index.html' : where),
  );
  t.after(() => server.close());
  const url = `http://127.0.0.1:${server.port}/`;
  const browser = await startBrowser();
  t.after(() => browser.close());
  const page = await browser.newPage({ viewport: { width: 640, height: 400 } });
  const faults = [];
  page.on('pageerror', (error) => faults.push(String(error)));
  page.on(
    'console',
    (message) => message.type() === 'error' && !/favicon/.test(message.location().url) && faults.push(message.text()),
  );
  page.on(
    'request',
    (request) => new URL(request.url()).origin === new URL(url).origin || faults.push(`outside: ${request.url()}`),
  );
  await page.goto(url);
  await page.waitForFunction(
    () =>
      document.querySelector('canvas')?.width > 300 &&
      performance.getEntriesByName(new URL('morph.glb', location).href).length > 0,
    null,
    { timeout: 180_000 },
  );

  const shot = async (value) => {
    await page.evaluate((v) => {
      const amount = document.querySelector('#amount');
      amount.value = v;
      amount.dispatchEvent(new Event('input'));
    }, value);
    await page.waitForTimeout(700);
    return page.screenshot();
  };
  let dog;
  let shown = 0;
  for (let i = 0; i < 30 && shown < 0.02; i++) {
    dog = await shot(0);
    const {
      frames: [rgb],
    } = readPng(dog);
    shown = difference(rgb, Buffer.from(Array.from({ length: rgb.length }, (_, k) => rgb[k % 3])));
  }
  assert.ok(shown > 0.02, 'an animal is visible');
  const half = await shot(0.5);
  const elephant = await shot(1);
  assert.ok(difference(readPng(dog).frames[0], readPng(elephant).frames[0]) > 0.03, 'the shapes differ');
  assert.ok(difference(readPng(dog).frames[0], readPng(half).frames[0]) > 0.01, 'and between them is another');
  assert.deepEqual(faults, []);

  if (process.env.ORB_PICTURES) {
    fs.writeFileSync(path.join(root, 'docs/tutorial.png'), half);
    spawnSync('orbmorph', ['view', 'morph.glb', '-o', path.join(root, 'docs/tutorial-sheet.png'), '--size', '200'], {
      cwd: at,
      env,
    });
  }
  const kept = readPng(fs.readFileSync(path.join(root, 'docs/tutorial.png')));
  assert.ok(
    difference(kept.frames[0], readPng(half).frames[0]) < 0.05,
    'docs/tutorial.png is stale: run with ORB_PICTURES=1',
  );
});
