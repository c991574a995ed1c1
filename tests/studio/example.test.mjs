// The example page of the JavaScript client turns two files into a moving morph.
import { after, before, test } from 'node:test';
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { join } from 'node:path';
import { browser, daemon } from './started.mjs';
import { difference, shot } from './pictures.mjs';
import { openPage, root, sample, until } from './support.mjs';

let server;
let url;
before(async () => {
  server = spawn(process.execPath, [join(root, 'client/js/example/serve.mjs')], {
    env: { ...process.env, ORBMORPH_SERVER: daemon.url, PORT: '0' },
    stdio: ['ignore', 'pipe', 'inherit'],
  });
  url = await new Promise((resolve) => server.stdout.on('data', (text) => resolve(String(text).match(/http:\S+/)[0])));
});
after(async () => {
  server?.kill();
});

test('the example plays a morph of two files', async () => {
  const { page, done } = await openPage(browser, url, { viewport: { width: 640, height: 480 } });
  await page.locator('#files').setInputFiles([sample('dog.obj'), sample('giraffe.off')]);
  await page.getByRole('button', { name: 'Morph' }).click();
  await until(
    () =>
      page
        .locator('#status')
        .innerText()
        .then((text) => /\d+ triangles for dog, giraffe/.test(text)),
    'the morph is there',
  );
  const first = await shot(page);
  await until(async () => (await difference(browser, first, await shot(page))) > 0.005, 'it moves');
  await done();
});

test('nothing outside the folders is served', async () => {
  for (const path of ['/../package.json', '/three/../../../package.json', '/%2e%2e/package.json', '/serve.txt'])
    assert.equal((await fetch(url + path)).status, 404);
});
