// A mesh that the morph keeps unchanged, and a shape for which it has too few triangles.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { ball, obj } from '../scenario/support/shapes.mjs';
import { browser, daemon } from './started.mjs';
import { countPixels } from './pictures.mjs';
import { addFiles, adopt, button, defaultShown, json, openPage, settled, until } from './support.mjs';

const hot = (r, g, b) => r > 130 && r > 2 * g && r > 1.5 * b;

test('where a kept mesh is too coarse is said, and shown on it', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  // a blister on the side of the camera, on a body that the mesh can follow everywhere else
  const blistered = ball(5, (p) => {
    const far = (p[0] - 0.55) ** 2 + (p[1] - 0.3) ** 2 + (p[2] - 0.78) ** 2;
    return p.map((x) => x * (1 + 0.35 * Math.exp(-far / 0.01)));
  });
  const file = (name, body) => ({ name: `${name}.obj`, mimeType: 'text/plain', buffer: Buffer.from(obj(body)) });
  await addFiles(page, file('globe', ball(3)), file('blister', blistered));
  await page.getByRole('switch', { name: 'Keep the mesh of globe' }).click();
  await page.getByText('Options', { exact: true }).click();
  await page.getByLabel('Matching').selectOption('rotate');
  await button(page, 'Morph 2 shapes').click();
  await until(() => button(page, 'Pause').count(), 'the morph plays');
  await defaultShown(page);
  const link = await page.getByRole('link', { name: 'Download GLB' }).getAttribute('href');
  const { shapes } = await json(daemon.url, `/v1/supermeshes/${link.match(/[0-9a-f]{64}/)[0]}`);
  const { count, errors_relative: errors } = shapes[1].coarse;
  const said = await page.getByRole('list', { name: 'Where the mesh is too coarse' }).innerText();
  assert.match(said, new RegExp(`^The mesh of globe is too coarse for blister: ${count} of its triangles`));
  await button(page, 'Show where').click();
  await until(async () => (await page.locator('.pane .legend').count()) === 2, 'both are measured');
  await settled(page);
  assert.equal(await button(page, 'Show where').count(), 0);
  const pane = page.locator('.pane').nth(1);
  assert.match(await pane.locator('.legend').innerText(), /how far blister is from the mesh of globe, shown/);
  // the daemon and the page measure at different samples of the same two surfaces
  const largest = Number((await pane.locator('.caption').innerText()).match(/largest ([\d.]+) %/)[1]) / 100;
  assert.ok(largest > 0.5 * errors[0] && largest < 1.5 * errors[0], `${largest}, reported ${errors[0]}`);
  await adopt(page, '.legend { visibility: hidden !important; }'); // it is red, too
  const red = await countPixels(page, '.pane:nth-child(2) .pane-view', hot);
  const blue = await countPixels(page, '.pane:nth-child(2) .pane-view', (r, g, b) => b > r + 15 && b > g && r < 70);
  assert.ok(red > 50 && blue > 10 * red, `red where it is missed, blue elsewhere: ${red}, ${blue}`);
  // the mesh itself differs only by rounding
  assert.ok((await countPixels(page, '.pane:nth-child(1) .pane-view', hot)) < 20);
  await done();
});
