// With a daemon that requires tokens, the studio asks for one, keeps it for the tab and says what it does not permit.
import { after, before, test } from 'node:test';
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { readFile } from 'node:fs/promises';
import { promisify } from 'node:util';
import {
  addFiles,
  counted,
  button,
  defaultShown,
  openPage,
  sample,
  startBrowser,
  startDaemon,
  until,
} from './support.mjs';

let daemon;
let browser;
const token = {};
before(async () => {
  daemon = await startDaemon({ args: ['--auth', 'on'], keep: true });
  await daemon.stop();
  for (const scope of ['read', 'read,write']) {
    const { stdout } = await promisify(execFile)(daemon.program, [
      'token',
      'add',
      scope.replace(',', '-'),
      '--scope',
      scope,
      '--data',
      daemon.data,
    ]);
    token[scope] = stdout.trim();
  }
  daemon = await startDaemon({ args: ['--auth', 'on'], data: daemon.data });
  browser = await startBrowser();
});
after(async () => {
  await browser?.close();
  await daemon?.stop();
});

const enterToken = async (page, secret) => {
  await page.locator('dialog input[name=token]').fill(secret);
  await button(page, 'Continue').click();
};

test('without a token the page asks for one, and rejects an unknown one', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await page.getByRole('dialog', { name: 'This daemon requires a token' }).waitFor();
  await enterToken(page, 'f'.repeat(64));
  await page.getByText('The daemon does not know this token.').waitFor();
  await page.keyboard.press('Escape');
  assert.ok(await page.getByRole('dialog').isVisible(), 'the dialog cannot be dismissed');
  await done();
});

test('the dialog appears even if the daemon answers before the first frame', async () => {
  const context = await browser.newContext();
  const page = await context.newPage();
  await page.addInitScript(() => {
    const late = globalThis.setTimeout;
    globalThis.setTimeout = (call, ms = 0, ...rest) => late(call, ms + 3000, ...rest);
    globalThis.requestAnimationFrame = (call) => late(() => call(performance.now()), 3000);
  });
  await page.goto(daemon.url);
  await page.getByRole('dialog', { name: 'This daemon requires a token' }).waitFor();
  await context.close();
});

test('with a token everything works; the token stays in the tab and out of URLs', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const addresses = [];
  page.on('request', (request) => addresses.push(request.url()));
  await enterToken(page, token['read,write']);
  await counted(page.getByRole('dialog'), 0, 'the dialog is gone');
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  await button(page, /^Morph 2 shapes$/).click();
  await until(() => button(page, 'Pause').count(), 'the morph plays');
  await defaultShown(page);
  await button(page, 'Pause').click();
  const [download] = await Promise.all([
    page.waitForEvent('download'),
    page.getByRole('link', { name: 'Download GLB' }).click(),
  ]);
  assert.equal((await readFile(await download.path())).toString('latin1', 0, 4), 'glTF');
  await button(page, 'Use it').click();
  assert.match(
    await page.getByRole('region', { name: 'curl: code' }).textContent(),
    /Authorization: Bearer \$ORBMORPH_TOKEN/,
  );
  await page.reload();
  await until(() => button(page, 'Play').count(), 'a reload does not ask again');
  assert.equal(await page.getByRole('dialog').count(), 0);
  assert.ok(addresses.every((url) => !url.includes(token['read,write'])));
  assert.ok(!page.url().includes(token['read,write']));
  await done();

  const other = await openPage(browser, daemon.url);
  await other.page.getByRole('dialog', { name: 'This daemon requires a token' }).waitFor();
  await other.done();
});

test('a token that may only read gets an explanation', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await enterToken(page, token.read);
  await counted(page.getByRole('dialog'), 0, 'the dialog is gone');
  await page
    .locator('input[type=file]')
    .first()
    .setInputFiles([sample('dog.obj')]);
  await page.getByText('The token lacks the scope “write”').waitFor();
  await button(page, 'Token', { exact: true }).click();
  await enterToken(page, token['read,write']);
  await counted(page.getByRole('dialog'), 0, 'another token is taken');
  await button(page, 'Try again').click();
  await page.locator('.card.ready').waitFor();
  await done();
});
