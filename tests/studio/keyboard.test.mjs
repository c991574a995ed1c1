// The way from the empty page to a file on disk without a pointer. At no time is the focus lost to the page's body.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { browser, daemon } from './started.mjs';
import { openPage, sample, settled, until } from './support.mjs';

/** The role and name of the focused element, as a screen reader would say them; null on the body. */
const focused = (page) =>
  page.evaluate(() => {
    const at = document.activeElement;
    if (!at || at === document.body) return null;
    return at.getAttribute('aria-label') ?? at.closest('label')?.innerText ?? at.innerText.trim();
  });

/** Presses Tab until the focus is on an element of that name. */
async function tabTo(page, name) {
  const passed = [];
  for (let i = 0; i < 80; i++) {
    const at = await focused(page);
    if (at !== null && name.test(at)) return;
    passed.push(at);
    await page.keyboard.press('Tab');
  }
  assert.fail(`no Tab leads to ${name}; it leads to ${JSON.stringify(passed)}`);
}

/** Records from now on where the focus was before it fell to the body, at the ends of frames. */
const watchFocus = (page) =>
  page.evaluate(() => {
    globalThis.lostFrom = [];
    let last = '';
    const look = () => {
      const at = document.activeElement;
      // beyond the last element, Tab leaves the page
      if (at && at !== document.body) last = at.getAttribute('aria-label') ?? at.innerText ?? at.tagName;
      else if (last && document.hasFocus() && !globalThis.tabbing) {
        globalThis.lostFrom.push(last);
        last = '';
      }
      requestAnimationFrame(() => setTimeout(look));
    };
    addEventListener('keydown', ({ key }) => (globalThis.tabbing = key === 'Tab'), true);
    look();
  });

test('upload, landmarks, morph and export by the keyboard alone', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const kept = async (what) => assert.notEqual(await focused(page), null, `the focus is lost after ${what}`);
  // early: a dialog that opens before the browser has handed over the focus is lost
  const choosing = page.waitForEvent('filechooser');
  await tabTo(page, /^Choose files$/);
  await watchFocus(page);
  await page.keyboard.press('Enter');
  await (await choosing).setFiles([sample('dog.obj'), sample('giraffe.off')]);
  await until(async () => (await page.locator('.card.ready').count()) === 2, 'both shapes are uploaded');
  await kept('the upload');

  // a landmark at the centre of each view, moved and deleted
  await tabTo(page, /^Landmarks$/);
  await page.keyboard.press('Enter');
  for (const name of [/^dog, landmarks/, /^giraffe, landmarks/]) {
    await tabTo(page, name);
    const before = await page.locator('.marker:not(.still)').count();
    await page.keyboard.press('Enter');
    await until(async () => (await page.locator('.marker:not(.still)').count()) === before + 1, 'a landmark is set');
  }
  await tabTo(page, /^Landmark 1 on giraffe/);
  await settled(page);
  const marker = page.locator('.marker:not(.still)').last();
  const from = await marker.boundingBox();
  for (let i = 0; i < 3; i++) {
    const { x } = await marker.boundingBox();
    await page.keyboard.press('ArrowRight');
    await until(async () => (await marker.boundingBox()).x > x + 2, 'the marker moves');
    await settled(page);
  }
  const to = await marker.boundingBox();
  assert.ok(Math.abs(to.x - from.x - 18) < 6 && Math.abs(to.y - from.y) < 4, `${from.x} to ${to.x}`);
  await page.keyboard.press('Delete');
  await until(async () => (await page.locator('.marks li').count()) === 0, 'it is deleted');
  await kept('deleting the landmark');

  await tabTo(page, /^Morph 2 shapes$/);
  await page.keyboard.press('Enter');
  await kept('starting the morph');
  await until(() => page.getByText('Shown: the default morph.').count(), 'the default morph');
  await kept('the morph');
  await tabTo(page, /^Use it$/);
  await page.keyboard.press('Enter');
  // a Tab before the dialog opens would still move the focus to which the dialog returns it
  await until(async () => (await page.locator('dialog[open]').count()) === 1, 'the drawer opens');
  await tabTo(page, /^GLB$/);
  const saving = page.waitForEvent('download');
  await page.keyboard.press('Enter');
  const download = await saving;
  assert.equal(download.suggestedFilename(), 'dog-giraffe.glb');
  assert.equal((await readFile(await download.path())).toString('latin1', 0, 4), 'glTF');
  await page.keyboard.press('Escape');
  await until(async () => (await page.locator('dialog').count()) === 0, 'the drawer closes');
  assert.equal(await focused(page), 'Use it');

  // the focused element disappears
  await tabTo(page, /^Shapes$/);
  await page.keyboard.press('Enter');
  await tabTo(page, /^Remove giraffe$/);
  await page.keyboard.press('Enter');
  await until(async () => (await page.locator('.card').count()) === 1, 'the shape is removed');
  await kept('removing a shape');
  await tabTo(page, /^Remove dog$/);
  await page.keyboard.press('Enter');
  await until(async () => (await page.locator('.card').count()) === 0, 'no shape is left');
  await kept('removing the last shape');
  assert.deepEqual(await page.evaluate(() => globalThis.lostFrom), []);
  await done();
});
