// Meshes that are refused, and the buttons that mend them.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { rigged } from '../samples/rigged.mjs';
import { apart, ball, grating, obj, torus, withoutFace } from '../scenario/support/shapes.mjs';
import { browser, daemon } from './started.mjs';
import { countPixels } from './pictures.mjs';
import { button, defaultShown, json, openPage, sample, settled, until } from './support.mjs';

const red = (page) => countPixels(page, '.pane-view', (r, g, b) => r > 180 && g < 110 && b < 110);
const digits = (text) => Number(text.replace(/\D/g, ''));

/** Opens a mesh that is refused, and waits until its faults are drawn. */
async function refused(page, name, surface) {
  const file = { name: `${name}.obj`, mimeType: 'text/plain', buffer: Buffer.from(obj(surface)) };
  await page.locator('input[type=file]').first().setInputFiles([file]);
  await page.locator('.card.refused').waitFor();
  await until(() => page.getByText('Shown in red on the model.').count(), 'the fault is drawn');
  await settled(page);
  assert.ok((await red(page)) > 20, 'red is drawn');
}

/** Waits until the mesh is accepted, and checks that page and picture show the mended one. Returns it. */
async function mended(page, name) {
  await page.locator('.card.ready').waitFor();
  const mesh = (await json(daemon.url, '/v1/meshes?limit=100')).meshes.find((m) => m.name === name);
  await until(
    async () =>
      digits((await page.locator('.caption').innerText()).split('triangles')[0].replace(name, '')) === mesh.triangles,
    `${mesh.triangles} triangles are shown`,
  );
  const [vertices, triangles] = (await page.locator('.card .facts').first().innerText()).split('·').map(digits);
  assert.deepEqual([vertices, triangles], [mesh.vertices, mesh.triangles]);
  assert.equal(triangles, 2 * vertices - 4, 'a sphere');
  await settled(page);
  assert.equal(await red(page), 0, 'no red is left');
  return mesh;
}

/** Neutral pixels are background: the share of the middle of the picture that shows none. */
const filled = (page) => countPixels(page, '.pane-view', (r, g, b) => r - b > 25 && r > g);

test('one button closes all handles, also those that the list does not show', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  // bars that get wider, so the loops differ in length
  const surface = grating(36, 28, ([x, y, z]) => [x * (1 + 0.12 * x), y, z]);
  await refused(page, 'grating', surface);
  const alert = page.getByRole('alert');
  assert.match(await alert.innerText(), /Genus 1\D008\./);
  const listed = page.getByRole('list', { name: 'Handles' });
  assert.match(await listed.innerText(), /1\D003 more$/);
  await page.getByRole('button', { name: /^Show all 1\D008 handles$/ }).click();
  assert.equal(await listed.getByRole('listitem').count(), 1008);
  assert.ok(await listed.evaluate((list) => list.scrollHeight > list.clientHeight && list.clientHeight < 300));
  await button(page, 'Show fewer').click();
  assert.equal(await listed.getByRole('listitem').count(), 6);
  const before = await filled(page);
  assert.equal(await alert.getByRole('button').count(), 2);
  await button(page, /^Close all 1\D008 handles$/).click();
  const mesh = await mended(page, 'grating');
  assert.equal(mesh.repairs.filter(({ kind, count }) => kind === 'close_handles' && count > 0).length, 1008);
  assert.notEqual(await filled(page), before, 'the picture is that of the mended mesh');
  await done();
});

test('holes and handles of one mesh are mended by a button each', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const { positions, triangles } = grating(2, 2);
  await refused(page, 'worn', { positions, triangles: triangles.slice(2) });
  await button(page, 'Fill the holes').click();
  await until(() => button(page, 'Close all 4 handles along the red loops').count(), 'the handles');
  await settled(page);
  assert.ok((await red(page)) > 20, 'their loops are drawn');
  await button(page, 'Close all 4 handles along the red loops').click();
  const mesh = await mended(page, 'worn');
  assert.deepEqual(
    ['fill_holes', 'close_handles'].map((kind) => mesh.repairs.some((r) => r.kind === kind && r.count > 0)),
    [true, true],
  );
  await done();
});

test('a refused mesh says why, shows the rim in red, and can be repaired', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  // the dog without its first 40 faces
  let left = 40;
  const text = (await readFile(sample('dog.obj'), 'utf8'))
    .split('\n')
    .filter((line) => !(line.startsWith('f ') && left-- > 0))
    .join('\n');
  await page
    .locator('input[type=file]')
    .first()
    .setInputFiles({ name: 'open.obj', mimeType: 'text/plain', buffer: Buffer.from(text) });
  await page.locator('.card.refused').waitFor();
  const said = await page.getByRole('alert').innerText();
  assert.match(said, /3 holes\. “Fill the holes” covers each with a patch/);
  assert.doesNotMatch(said, /repair=/, 'it is about buttons, not about requests');
  await until(() => page.getByText('Shown in red on the model.').count(), 'the rim is found');
  // the lines are drawn over the surface, so the rim is visible from any side
  await settled(page);
  assert.ok((await countPixels(page, '.stage-area', (r, g, b) => r > 180 && g < 110 && b < 110)) > 20, 'red is drawn');
  await button(page, 'Fill the holes').click();
  await until(() => page.locator('.card.ready').count(), 'it is repaired');
  assert.equal(await page.locator('.card.refused').count(), 0);
  await settled(page);
  assert.equal(await countPixels(page, '.stage-area', (r, g, b) => r > 180 && g < 110 && b < 110), 0, 'no red is left');
  await done();
});

test('loose pieces are shown in red, and the largest can be kept', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const text = await readFile(sample('dog.obj'), 'utf8');
  const known = text.split('\n').filter((line) => line.startsWith('v '));
  const [x, y, z] = [0, 1, 2].map((k) => Math.max(...known.map((line) => Number(line.split(/\s+/)[k + 1]))));
  const size = 0.2 * y;
  const corners = [
    [0, 0, 0],
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ].map((c) => `v ${[x, y, z].map((at, k) => at + size * (c[k] - 0.5)).join(' ')}`);
  const faces = [
    [1, 3, 2],
    [1, 2, 4],
    [2, 3, 4],
    [1, 4, 3],
  ].map((f) => `f ${f.map((v) => v + known.length).join(' ')}`);
  const both = [...known, ...corners, ...text.split('\n').filter((line) => line.startsWith('f ')), ...faces].join('\n');
  await page
    .locator('input[type=file]')
    .first()
    .setInputFiles({ name: 'two.obj', mimeType: 'text/plain', buffer: Buffer.from(`${both}\n`) });
  await page.locator('.card.refused').waitFor();
  await until(() => page.getByText('Shown in red on the model.').count(), 'the loose piece is found');
  await settled(page);
  assert.ok((await countPixels(page, '.stage-area', (r, g, b) => r > 150 && g < 110 && b < 110)) > 50, 'red is drawn');
  await button(page, 'Keep the largest piece').click();
  await until(() => page.locator('.card.ready').count(), 'it is repaired');
  await done();
});

test('pieces of one name are told apart by their nodes, and each can be kept', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const file = { name: 'body.glb', mimeType: 'model/gltf-binary', buffer: rigged().bytes };
  await page.locator('input[type=file]').first().setInputFiles(file);
  await page.locator('.card.refused').waitFor();
  assert.deepEqual(await page.getByRole('alert').getByRole('button').allInnerTexts(), [
    'Keep the largest piece',
    'Keep “left eye” (4 triangles)',
    'Keep “right eye” (4 triangles)',
  ]);
  await button(page, 'Keep “right eye” (4 triangles)').click();
  const mesh = await mended(page, 'body');
  assert.equal(mesh.triangles, 4);
  await done();
});

test('of a closed body in open clothes the body can be kept', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await refused(page, 'dressed', apart(withoutFace(ball(2)), ball(1)));
  assert.deepEqual(await page.getByRole('alert').getByRole('button').allInnerTexts(), [
    'Fill the holes',
    'Keep the largest piece',
    'Keep piece 1 (32 triangles)',
  ]);
  await button(page, 'Keep piece 1 (32 triangles)').click();
  assert.equal((await mended(page, 'dressed')).triangles, 32);
  await done();
});

test('of many pieces all can be shown, in a list that scrolls, and each can be kept', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const surface = Array.from({ length: 104 }, (_, i) => ball(i < 103 ? 1 : 2)).reduce((all, one, i) =>
    apart(all, one, 3 * i),
  );
  const file = { name: 'beads.obj', mimeType: 'text/plain', buffer: Buffer.from(obj(surface)) };
  await page.locator('input[type=file]').first().setInputFiles(file);
  await page.locator('.card.refused').waitFor();
  const mends = page.getByRole('group', { name: 'Repairs of beads' });
  assert.equal(await mends.getByRole('button').count(), 5);
  assert.match(await page.getByRole('alert').innerText(), /The mesh has 104 pieces[\s\S]*\n104 pieces\./);
  await button(page, 'Show the largest 100 of 104 pieces').click();
  assert.equal(await mends.getByRole('button').count(), 100);
  const { scroll, seen } = await mends.evaluate((list) => ({ scroll: list.scrollHeight, seen: list.clientHeight }));
  assert.ok(scroll > seen && seen < 300, `${scroll} px in ${seen}`);
  await button(page, 'Show fewer').click();
  assert.equal(await mends.getByRole('button').count(), 5);
  await button(page, 'Show the largest 100 of 104 pieces').click();
  await button(page, 'Keep piece 23 (32 triangles)').click();
  const mesh = await mended(page, 'beads');
  assert.equal(mesh.triangles, 32);
  await done();
});

test('a repaired file keeps its materials', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const file = { name: 'body.glb', mimeType: 'model/gltf-binary', buffer: rigged().bytes };
  await page.locator('input[type=file]').first().setInputFiles(file);
  const blue = () => countPixels(page, '.pane-view', (r, g, b) => b > r + 30 && b > g + 20);
  await button(page, 'Keep the largest piece').click();
  await mended(page, 'body');
  assert.ok((await blue()) > 2000, 'the lower half of the body is blue');
  await done();
});

test('the loop around a handle is shown in red, and the handle can be closed', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const file = { name: 'ring.obj', mimeType: 'text/plain', buffer: Buffer.from(obj(torus())) };
  await page.locator('input[type=file]').first().setInputFiles(file);
  await page.locator('.card.refused').waitFor();
  await until(() => page.getByText('Shown in red on the model.').count(), 'the loop is found');
  await settled(page);
  assert.ok((await countPixels(page, '.stage-area', (r, g, b) => r > 180 && g < 110 && b < 110)) > 20, 'red is drawn');
  assert.match(
    await page.getByRole('list', { name: 'Handles' }).innerText(),
    /^Handle 1: its loop is \d+ % of the diagonal/,
  );
  await button(page, 'Close the handle along the red loop').click();
  await until(() => page.locator('.card.ready').count(), 'it is repaired');
  await done();
});

/** A ball without the cap where y is below `bottom`, stretched. */
function bust(bottom, stretch) {
  const { positions, triangles } = ball(3, ([x, y, z]) => [x, stretch * y, 0.8 * z]);
  return { positions, triangles: triangles.filter((t) => t.some((v) => positions[v][1] > stretch * bottom)) };
}

test('two open shapes are mended, and morph from rim to rim', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const files = [bust(-0.8, 1.3), bust(-0.6, 1.5)].map((mesh, i) => ({
    name: `bust${i}.obj`,
    mimeType: 'text/plain',
    buffer: Buffer.from(obj(mesh)),
  }));
  await page.locator('input[type=file]').first().setInputFiles(files);
  await page.getByText('Repair or replace the refused shapes first.').waitFor();
  await button(page, 'Fill the holes').first().click();
  await page.getByText('Repair or replace the refused shape first.').waitFor();
  await button(page, 'Fill the holes').click();
  await button(page, /^Morph 2 shapes$/).click();
  await defaultShown(page);
  await page.getByText('A hole corresponds').click();
  assert.match(
    await page.locator('details', { hasText: 'A hole corresponds' }).innerText(),
    /bust1 rim of hole 1 to rim of hole 1/,
  );
  assert.equal(await page.getByText('Not in the asset').count(), 0);
  assert.match(await page.locator('tr', { hasText: 'Closed, genus' }).innerText(), /open at 1 hole, 0/);
  await done();
});
