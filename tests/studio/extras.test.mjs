// Carries over what a later shape has besides its surface, and its materials.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
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
  const offers = page.getByRole('group', { name: 'From the other shapes' });
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
  assert.equal(await offers.count(), 0, 'the first shape gives its own');
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
