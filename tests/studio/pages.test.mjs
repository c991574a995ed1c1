// Checks every page: no request to other origins, a strict policy, named controls, keys, no drawing at rest.
import { before, test } from 'node:test';
import assert from 'node:assert/strict';
import { createRequire } from 'node:module';
import { readFile } from 'node:fs/promises';
import { browser, daemon } from './started.mjs';
import { difference, shot } from './pictures.mjs';
import { addFiles, counted, button, defaultShown, openPage, sample, settled, until } from './support.mjs';
import { ball, obj, torus } from '../scenario/support/shapes.mjs';

let axe;
before(async () => {
  axe = await readFile(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
});

/** Serious and critical findings of axe. `evaluate` is exempt from the page's policy, so the policy stays as it is. */
async function findings(page) {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ['violations'] }));
  return violations
    .filter((v) => v.impact === 'serious' || v.impact === 'critical')
    .map(
      (v) =>
        `${v.id}: ${v.nodes
          .map((n) => `${n.html.slice(0, 120)} ${n.any[0]?.message ?? ''}`)
          .slice(0, 3)
          .join(' | ')}`,
    );
}

test('/docs renders the API document', async (t) => {
  const document = await (await fetch(`${daemon.url}/openapi.json`)).json();
  const page = await browser.newPage();
  t.after(() => page.close());
  const errors = [];
  page.on('pageerror', (error) => errors.push(String(error)));
  await page.goto(`${daemon.url}/docs#listSupermeshes`);
  await page.waitForSelector('#listSupermeshes[open]');
  const shown = await page.evaluate(() => ({
    operations: [...globalThis.document.querySelectorAll('summary:has(.method)')].map((s) => [
      s.querySelector('.method').textContent.toLowerCase(),
      s.querySelector('code').textContent,
    ]),
    open: globalThis.document.querySelector('#listSupermeshes').innerText,
    dead: [...globalThis.document.querySelectorAll('a[href^="#"]')]
      .map((a) => a.hash.slice(1))
      .filter((name) => !globalThis.document.getElementById(name)),
    missing: globalThis.document.body.textContent.match(/undefined|\[object/g),
  }));
  const operations = Object.entries(document.paths).flatMap(([path, item]) =>
    Object.keys(item)
      .filter((key) => item[key].responses)
      .map((method) => [method, path]),
  );
  assert.deepEqual(shown.operations.map(String).sort(), operations.map(String).sort());
  for (const text of ['id_prefix', 'full, summary; default: full', 'SupermeshSummaryPage', '"view" must be full'])
    assert.ok(shown.open.includes(text), text);
  assert.deepEqual([shown.dead, shown.missing, errors], [[], null, []]);
  // A link to a schema opens it.
  await page.click('#listSupermeshes a[href="#SupermeshSummaryPage"]');
  await page.waitForSelector('#SupermeshSummaryPage[open]');
  assert.deepEqual(await findings(page), []);
});

test('the files have types, validators and a policy without unsafe-inline', async () => {
  const page = await fetch(`${daemon.url}/`);
  assert.equal(page.status, 200);
  assert.match(page.headers.get('content-type'), /^text\/html/);
  const policy = page.headers.get('content-security-policy');
  assert.match(policy, /default-src 'self'/);
  assert.doesNotMatch(policy, /unsafe-inline|unsafe-eval|https?:|\*/);
  const html = await page.text();
  assert.doesNotMatch(html, /<script(?![^>]*\bsrc=)|\son[a-z]+=|\sstyle=/, 'nothing inline');
  for (const [, path] of html.matchAll(/(?:src|href)="\.?(\/[^"]+)"/g)) {
    const file = await fetch(daemon.url + path);
    assert.equal(file.status, 200, path);
    const etag = file.headers.get('etag');
    assert.match(etag, /^"[^"]+"$/, path);
    const again = await fetch(daemon.url + path, { headers: { 'If-None-Match': etag } });
    assert.equal(again.status, 304, path);
    const type = file.headers.get('content-type');
    if (path.endsWith('.js')) assert.match(type, /javascript/);
    if (path.endsWith('.css')) assert.match(type, /css/);
    if (path.startsWith('/assets/')) assert.match(file.headers.get('cache-control'), /immutable/);
  }
  assert.equal((await fetch(`${daemon.url}/assets/none.js`)).status, 404);
  assert.equal((await fetch(`${daemon.url}/no/such/page`)).status, 404);
});

test('the licences of bundled packages are served', async () => {
  const file = await fetch(`${daemon.url}/licenses.txt`);
  assert.equal(file.status, 200);
  assert.match(file.headers.get('content-type'), /^text\/plain/);
  const text = await file.text();
  for (const words of [
    'The orbmorph authors',
    'three.js authors',
    'Jason Miller',
    'Inter Project Authors',
    'SIL OPEN FONT LICENSE',
    'The Draco Authors',
    'Apache License',
  ])
    assert.ok(text.includes(words), words);
});

for (const colorScheme of ['light', 'dark'])
  test(`axe finds nothing serious, ${colorScheme}`, async () => {
    const { page, done } = await openPage(browser, daemon.url, { colorScheme });
    const found = { empty: await findings(page) };
    await button(page, 'Help and keys').click();
    found.help = await findings(page);
    await button(page, 'Close').click();
    const ring = { name: 'ring.obj', mimeType: 'text/plain', buffer: Buffer.from(obj(torus())) };
    await page.locator('input[type=file]').first().setInputFiles([ring]);
    await page.locator('.card.refused').waitFor();
    found.refused = await findings(page);
    await button(page, 'Remove ring').click();
    await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
    await page.getByText('Options', { exact: true }).click();
    found.shapes = await findings(page);
    await button(page, 'Landmarks').click();
    await page.getByLabel('Landmark file').setInputFiles(sample('dog-giraffe.json'));
    await page.locator('.marks li').first().waitFor();
    found.landmarks = await findings(page);
    await button(page, /^Morph 2 shapes$/).click();
    await until(() => button(page, 'Pause').count(), 'the morph plays');
    await defaultShown(page);
    await button(page, 'Pause').click();
    found.morph = await findings(page);
    for (const view of ['Side by side', 'Stretch']) {
      await button(page, view, { exact: true }).click();
      if (view === 'Stretch') await until(() => page.getByText(/^99 % of it below/).count(), 'it is measured');
      else await page.locator('.pane-view').last().press('Enter');
      found[view] = await findings(page);
    }
    await button(page, 'Use it').click();
    found.share = await findings(page);
    await button(page, 'Close').click();
    await button(page, 'On the server', { exact: true }).click();
    await button(page, 'Add dog').first().waitFor();
    found.server = await findings(page);
    await button(page, 'Close').click();
    await button(page, 'Spheres').click();
    await counted(page.getByText('Certified one to one'), 2, 'spheres');
    found.spheres = await findings(page);
    const dead = await openPage(browser, daemon.url, { colorScheme, hash: `#m=${'0'.repeat(64)}` });
    await dead.page.getByRole('alert').waitFor();
    found.dead = await findings(dead.page);
    await dead.done();
    assert.deepEqual(found, Object.fromEntries(Object.keys(found).map((key) => [key, []])));
    await done();
  });

test('every control has a name', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  await page.getByText('Options', { exact: true }).click();
  for (const tab of ['Shapes', 'Landmarks', 'Spheres']) {
    await button(page, tab, { exact: true }).click();
    const snapshot = await page.locator('body').ariaSnapshot();
    const nameless = snapshot
      .split('\n')
      .filter((line) =>
        /^\s*- (button|link|slider|switch|checkbox|textbox|combobox|spinbutton|application)\s*:?\s*(\[[^\]]*\])?$/.test(
          line,
        ),
      );
    assert.deepEqual(nameless, [], `${tab}:\n${snapshot}`);
  }
  await done();
});

test('keys rotate the view and change the page; at rest nothing is drawn', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  await settled(page);
  const still = await shot(page.locator('.stage-area'));
  const frames = await page.evaluate(() => {
    let count = 0;
    document.querySelector('.stage').addEventListener('drawn', () => count++);
    return new Promise((resolve) => setTimeout(() => resolve(count), 700));
  });
  assert.equal(frames, 0, 'no drawing while nothing changes');
  await page.locator('.pane-view').first().focus();
  for (let i = 0; i < 6; i++) await page.keyboard.press('ArrowLeft');
  await settled(page);
  const rotated = await shot(page.locator('.stage-area'));
  assert.ok((await difference(browser, still, rotated)) > 0.01, 'the view has rotated');
  await page.keyboard.press('0');
  await settled(page);
  // now with the focus ring; little else may differ
  assert.ok(
    (await difference(browser, still, await shot(page.locator('.stage-area')))) < 0.01,
    'the view is as at first',
  );
  await page.keyboard.press('2');
  await page.getByRole('heading', { name: 'Landmarks' }).waitFor();
  await page.keyboard.press('1');
  await page.getByRole('heading', { name: 'Shapes', exact: true }).waitFor();
  await done();
});

test('a small screen holds everything without scrolling sideways', async () => {
  const { page, done } = await openPage(browser, daemon.url, {
    viewport: { width: 360, height: 740 },
    hasTouch: true,
    isMobile: true,
  });
  const fits = () => page.evaluate(() => document.documentElement.scrollWidth <= innerWidth);
  assert.ok(await fits());
  const named = async (name, path) => ({ name, mimeType: 'text/plain', buffer: await readFile(sample(path)) });
  const long = 'A_character_with_a_rather_long_name_low_poly_v2';
  await addFiles(page, await named('Body low poly.obj', 'dog.obj'), await named(`${long}.off`, 'giraffe.off'));
  const inside = async (name) => {
    const { x, width } = await button(page, name).boundingBox();
    return x >= 0 && x + width <= 360;
  };
  assert.ok(await inside(`Remove ${long}`));
  for (const tab of ['Shapes', 'Landmarks', 'Spheres']) {
    await button(page, tab, { exact: true }).click();
    assert.ok(await fits(), tab);
    assert.ok(
      await button(page, /^Morph/)
        .last()
        .isVisible(),
      tab,
    );
  }
  await button(page, /^Morph 2 shapes$/).click();
  await defaultShown(page);
  assert.ok(await fits(), 'the morph');
  assert.ok(await inside(`Show ${long}`));
  assert.ok((await page.locator('.transport').boundingBox()).height < 80, 'names are on one line');
  await page.setViewportSize({ width: 740, height: 360 });
  await button(page, 'Shapes', { exact: true }).click();
  assert.ok(await fits(), 'in landscape');
  const settings = await page.locator('.inspector .scroll').boundingBox();
  assert.ok(
    settings.height > 120 && settings.y + settings.height <= 360,
    `settings can be read on its side: ${JSON.stringify(settings)}`,
  );
  // more shapes than the daemon morphs at once
  const buffer = Buffer.from(obj(ball(1)));
  const more = Array.from({ length: 15 }, (_, i) => ({ name: `ball${i}.obj`, mimeType: 'text/plain', buffer }));
  await page.locator('input[type=file]').first().setInputFiles(more);
  await counted(page.locator('.card.ready'), 17, 'the shapes are uploaded');
  assert.ok(await button(page, 'Morph 17 shapes').isDisabled());
  await page.getByText('At most 16 shapes morph at once. Remove one of them.').waitFor({ state: 'attached' });
  await done();
});
