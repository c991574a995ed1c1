// Carries over what a later shape has besides its surface, and its materials.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { rigged } from '../samples/rigged.mjs';
import { parseGlb } from '../scenario/support/glb.mjs';
import { writeGlb } from '../scenario/support/glb_write.mjs';
import { writePng } from '../scenario/support/png.mjs';
import { ball, obj } from '../scenario/support/shapes.mjs';
import { browser, daemon } from './started.mjs';
import { countPixels, difference, shot } from './pictures.mjs';
import { addFiles, button, defaultShown, json, openPage, settled, until } from './support.mjs';

/** Texture coordinates by a projection; the picture has one colour, so front and back may share texels. */
const charts = ({ positions }) => positions.map(([x, y]) => [0.5 + 0.2 * x, 0.5 + 0.2 * y]);
const painted = (surface, color, more = {}) =>
  writeGlb({ ...surface, uv: charts(surface), image: writePng(8, 8, () => color), ...more });

/** Adds a skin of one joint, which moves all vertices. */
const skinned = (count) => (gltf, push) => {
  const add = (array, componentType, type) =>
    gltf.accessors.push({
      bufferView: push(Buffer.from(array.buffer)),
      componentType,
      count: array.length / 4,
      type,
    }) - 1;
  const weights = new Float32Array(4 * count).map((_, i) => (i % 4 ? 0 : 1));
  const { attributes } = gltf.meshes[0].primitives[0];
  attributes.JOINTS_0 = add(new Uint8Array(4 * count), 5121, 'VEC4');
  attributes.WEIGHTS_0 = add(weights, 5126, 'VEC4');
  gltf.nodes = [{ mesh: 0, skin: 0 }, { name: 'bone' }];
  gltf.scenes[0].nodes = [0, 1];
  gltf.skins = [{ joints: [1] }];
};

const red = (page, view = '.pane-view') => countPixels(page, view, (r, g, b) => r > 90 && g < r / 2 && b < r / 2);
const blue = (page, view = '.pane-view') => countPixels(page, view, (r, g, b) => b > 90 && r < b / 2 && g < b / 2);

/** Downloads the page of the shown morph, and opens it. */
async function assertPage(page, check) {
  await button(page, 'Use it').click();
  const waiting = page.waitForEvent('download');
  await page.getByRole('region', { name: 'Take it away' }).getByRole('button', { name: 'Web page' }).click();
  const file = await waiting;
  const folder = mkdtempSync(join(tmpdir(), 'orbmorph-page-'));
  await file.saveAs(join(folder, 'page.html'));
  const other = await browser.newPage({ viewport: { width: 500, height: 400 } });
  await other.goto(pathToFileURL(join(folder, 'page.html')).href);
  await other.locator('body[data-ready]').waitFor();
  await check(other);
  await other.close();
  rmSync(folder, { recursive: true });
  await page.keyboard.press('Escape');
}

test('a skin, targets and a texture of the second shape are taken by a tick each, and looks are chosen', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const file = (name, buffer, mimeType = 'model/gltf-binary') => ({ name, mimeType, buffer });
  const [egg, bean] = [ball(2, ([x, y, z]) => [x, 1.2 * y, z]), ball(2, ([x, y, z]) => [x + 0.2 * y * y, y, z])];
  const moves = bean.positions.map(([, y]) => [0, y > 0 ? 0.1 : 0, 0]);
  await addFiles(
    page,
    file('egg.glb', painted(egg, [20, 40, 230])),
    file('bean.glb', painted(bean, [230, 30, 20], { moves, edit: skinned(bean.positions.length) })),
    file('plain.obj', Buffer.from(obj(ball(2))), 'text/plain'),
  );
  const offers = page.getByRole('group', { name: 'Besides the surfaces' });
  assert.deepEqual(await offers.locator('label').allInnerTexts(), [
    'Take the skin of bean',
    'Take the texture coordinates of bean',
    'Take the morph targets of bean',
    'Take the texture of bean, as a second look',
  ]);
  await button(page, 'Remove plain').click();
  for (const name of ['skin of bean', 'morph targets of bean', 'texture of bean, as a second look'])
    await offers.getByLabel(`Take the ${name}`).check();

  await button(page, 'Morph 2 shapes').click();
  await defaultShown(page);
  const link = await page.getByRole('link', { name: 'Download GLB' }).getAttribute('href');
  const [id] = link.match(/[0-9a-f]{64}/);
  const { request, transferred } = await json(daemon.url, `/v1/supermeshes/${id}`);
  assert.deepEqual(
    request.transfer,
    ['skin', 'targets', 'texture'].map((what) => ({ from: 1, what })),
  );
  assert.deepEqual(transferred.map(({ what }) => what).sort(), ['skin', 'targets', 'texture']);

  await button(page, 'Pause').click();
  const looks = page.getByRole('group', { name: 'Look' });
  assert.deepEqual(await looks.getByRole('button').allInnerTexts(), ['egg', 'bean']);
  await settled(page);
  assert.ok((await blue(page)) > 1000 && (await red(page)) === 0, "the first shape's own");
  await looks.getByRole('button', { name: 'bean' }).click();
  await looks.getByRole('button', { name: 'bean', pressed: true }).waitFor();
  await settled(page);
  assert.ok((await red(page)) > 1000 && (await blue(page)) === 0, 'the texture of the second shape');

  const targets = page.getByRole('group', { name: 'Targets of the files' });
  assert.deepEqual(await targets.locator('label').allInnerTexts(), ['target 0']);
  const before = await shot(page.locator('.pane-view').first());
  await targets.getByRole('slider').fill('1');
  await settled(page);
  const after = await shot(page.locator('.pane-view').first());
  assert.ok((await difference(browser, before, after)) > 0.005, 'the target moves the shape where the morph stands');
  await assertPage(page, (other) => until(async () => (await red(other, 'canvas')) > 1000, 'the page has the look'));

  await until(
    () =>
      /[#&]e=1(&|$)/.test(page.url()) &&
      /[#&]x=1:skin,1:targets,1:texture(&|$)/.test(page.url()) &&
      /[#&]look=1(&|$)/.test(page.url()),
    'URL',
  );
  await page.reload();
  await looks.getByRole('button', { name: 'bean', pressed: true }).waitFor();
  await settled(page);
  assert.ok((await red(page)) > 1000, 'a link shows the same look');
  assert.equal(await targets.getByRole('slider').inputValue(), '1', 'and the same target');
  await button(page, 'Shapes').click();
  const ticked = await offers.locator('label:has(input:checked)').allInnerTexts();
  assert.deepEqual(ticked, [
    'Take the skin of bean',
    'Take the morph targets of bean',
    'Take the texture of bean, as a second look',
  ]);
  await button(page, 'Remove egg').click();
  assert.deepEqual(
    await offers.locator('label').allInnerTexts(),
    ['Keep the skin of bean', 'Keep the morph targets of bean'],
    'the first shape gives its own materials',
  );
  await done();
});

test('the size of baked pictures is chosen, and is in the URL', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const file = (name, buffer) => ({ name, mimeType: 'model/gltf-binary', buffer });
  const [egg, bean] = [ball(2, ([x, y, z]) => [x, 1.3 * y, z]), ball(2, ([x, y, z]) => [x + 0.3 * y * y, y, z])];
  await addFiles(page, file('egg.glb', painted(egg, [20, 40, 230])), file('bean.glb', painted(bean, [230, 30, 20])));
  const size = page.getByLabel('Size of the pictures');
  assert.equal(await size.count(), 0, 'no picture is taken yet');
  await page.getByLabel('Take the texture of bean, as a second look').check();
  await size.selectOption('512');
  await until(() => /[#&]o=[^&]*,512(&|$)/.test(page.url()), 'URL');
  await page.reload();
  await page.locator('.card.ready').nth(1).waitFor();
  assert.equal(await size.inputValue(), '512');
  await button(page, 'Morph 2 shapes').click();
  await defaultShown(page);
  const [id] = (await page.getByRole('link', { name: 'Download GLB' }).getAttribute('href')).match(/[0-9a-f]{64}/);
  const { request, transferred } = await json(daemon.url, `/v1/supermeshes/${id}`);
  assert.deepEqual(request.transfer, [{ from: 1, what: 'texture', resolution: 512 }]);
  assert.equal(transferred[0].resolution, 512);
  const glb = Buffer.from(await (await fetch(`${daemon.url}/v1/supermeshes/${id}/asset.glb`)).arrayBuffer());
  const { gltf } = parseGlb(glb);
  const start = 28 + glb.readUInt32LE(12);
  const widths = gltf.images.map(({ bufferView }) => {
    const { byteOffset = 0 } = gltf.bufferViews[bufferView];
    return glb.readUInt32BE(start + byteOffset + 16); // IHDR of a PNG
  });
  assert.ok(widths.includes(512), `${widths}`);
  await done();
});

test('a new mesh keeps the skin and the targets of the first shape on request', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const egg = ball(2, ([x, y, z]) => [x, 1.2 * y, z]);
  const moves = egg.positions.map(([, y]) => [0, y > 0 ? 0.1 : 0, 0]);
  const glb = painted(egg, [20, 40, 230], { moves, edit: skinned(egg.positions.length) });
  await addFiles(
    page,
    { name: 'egg.glb', mimeType: 'model/gltf-binary', buffer: glb },
    {
      name: 'bean.obj',
      mimeType: 'text/plain',
      buffer: Buffer.from(obj(ball(2, ([x, y, z]) => [x + 0.3 * y * y, y, z]))),
    },
  );
  const offers = page.getByRole('group', { name: 'Besides the surfaces' });
  const keep = page.getByRole('switch', { name: 'Keep the mesh of egg' });
  await keep.click();
  assert.equal(await offers.count(), 0, 'a kept mesh has everything');
  await keep.click();
  assert.deepEqual(await offers.locator('label').allInnerTexts(), [
    'Keep the skin of egg',
    'Keep the morph targets of egg',
  ]);
  await offers.getByLabel('Keep the skin of egg').check();
  await offers.getByLabel('Keep the morph targets of egg').check();
  await until(() => /[#&]x=0:skin,0:targets(&|$)/.test(page.url()), 'URL');
  await button(page, 'Morph 2 shapes').click();
  await defaultShown(page);
  const [id] = (await page.getByRole('link', { name: 'Download GLB' }).getAttribute('href')).match(/[0-9a-f]{64}/);
  const { transferred, dropped } = await json(daemon.url, `/v1/supermeshes/${id}`);
  assert.deepEqual(
    transferred.map(({ from, what }) => `${from}:${what}`),
    ['0:skin', '0:targets'],
  );
  assert.deepEqual(dropped, [], 'the asset has all that the files have');
  await done();
});

test('the parts of a kept document that are its surface are named, and no others move', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const { bytes } = rigged();
  await page
    .locator('input[type=file]')
    .first()
    .setInputFiles([
      { name: 'body.glb', mimeType: 'model/gltf-binary', buffer: bytes },
      { name: 'ball.obj', mimeType: 'text/plain', buffer: Buffer.from(obj(ball(3, ([x, y, z]) => [x, 2 * y, z]))) },
    ]);
  await button(page, 'Keep the largest piece').click();
  await page.locator('.card.ready').nth(1).waitFor();
  const meshes = page.getByRole('group', { name: 'Meshes of the closed surface' });
  assert.equal(await meshes.count(), 0, 'a new mesh has no parts');
  await page.getByRole('switch', { name: 'Keep the mesh of body' }).click();
  await page.getByText('The closed surface: what was uploaded').click();
  const names = parseGlb(bytes).gltf.meshes.map(({ name }, i) => `Mesh ${i}, “${name}”`);
  assert.deepEqual(await meshes.locator('label').allInnerTexts(), names);
  const [wrong, right] = [names.findIndex((n) => /eye/.test(n)), names.findIndex((n) => /Body/.test(n))];

  await meshes.getByRole('checkbox').nth(wrong).check();
  await button(page, 'Morph 2 shapes').click();
  const alert = page.getByRole('alert');
  await alert.waitFor();
  assert.match(await alert.innerText(), /surface/, 'the eyes are no part of the surface');
  await page.getByText('The closed surface: 1 named part').waitFor();
  await meshes.getByRole('checkbox').nth(wrong).uncheck();
  await meshes.getByRole('checkbox').nth(right).check();
  await until(() => decodeURIComponent(page.url()).includes(`&s={"meshes":[${right}]}`), 'URL');
  await page.reload();
  await page.getByText('The closed surface: 1 named part').click();
  assert.equal(await meshes.getByRole('checkbox').nth(right).isChecked(), true);
  await button(page, 'Morph 2 shapes').click();
  await defaultShown(page);
  const [id] = (await page.getByRole('link', { name: 'Download GLB' }).getAttribute('href')).match(/[0-9a-f]{64}/);
  const { request } = await json(daemon.url, `/v1/supermeshes/${id}`);
  assert.deepEqual(request.template, { meshes: [right], nodes: [] });
  await done();
});

/** Makes the surface red, and its lower half blue strips: one for each triangle, joined by repeated vertices. */
const striped =
  ({ positions, triangles }) =>
  (gltf, push) => {
    const isLow = (t) => positions[t[0]][1] < 0;
    const strip = triangles.filter(isLow).flatMap(([a, b, c], i) => (i ? [a, a, b, c, c, c] : [a, b, c, c, c]));
    const add = (list) =>
      gltf.accessors.push({
        bufferView: push(Buffer.from(Uint16Array.from(list).buffer)),
        componentType: 5123,
        count: list.length,
        type: 'SCALAR',
      }) - 1;
    const [{ attributes }] = gltf.meshes[0].primitives;
    const paint = (baseColorFactor) => ({ pbrMetallicRoughness: { baseColorFactor } });
    gltf.materials = [paint([0.9, 0.05, 0.05, 1]), paint([0.05, 0.1, 0.9, 1])];
    gltf.meshes[0].primitives = [
      { attributes, indices: add(triangles.filter((t) => !isLow(t)).flat()), material: 0 },
      { attributes, indices: add(strip), mode: 5, material: 1 },
    ];
  };

test('strips of a glTF are shown: of the file, of the document that is kept, and on its page', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const surface = ball(3, ([x, y, z]) => [x, 1.3 * y, z]);
  const glb = writeGlb({ ...surface, edit: striped(surface) });
  await addFiles(
    page,
    { name: 'egg.glb', mimeType: 'model/gltf-binary', buffer: glb },
    {
      name: 'bean.obj',
      mimeType: 'text/plain',
      buffer: Buffer.from(obj(ball(3, ([x, y, z]) => [x + 0.2 * y * y, y, z]))),
    },
  );
  assert.match(await page.locator('.caption').first().innerText(), /512 triangles/);
  assert.ok((await red(page)) > 1000 && (await blue(page)) > 1000, 'the file');
  await page.getByRole('switch', { name: 'Keep the mesh of egg' }).click();
  await button(page, 'Morph 2 shapes').click();
  await defaultShown(page);
  await button(page, 'Pause').click();
  await settled(page);
  assert.ok((await red(page)) > 1000 && (await blue(page)) > 1000, 'the document');
  await assertPage(page, (other) =>
    until(async () => (await red(other, 'canvas')) > 1000 && (await blue(other, 'canvas')) > 1000, 'the page'),
  );
  await done();
});
