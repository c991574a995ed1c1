// The studio shows compressed glTF with its materials, like the uncompressed file.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { draco } from '../scenario/support/draco.mjs';
import { writeGlb } from '../scenario/support/glb_write.mjs';
import { writePng } from '../scenario/support/png.mjs';
import { ball, obj } from '../scenario/support/shapes.mjs';
import { browser, daemon } from './started.mjs';
import { countPixels, difference, shot } from './pictures.mjs';
import { addFiles, button, counted, json, openPage, settled } from './support.mjs';

const egg = ball(3, ([x, y, z]) => [x, 1.3 * y, z]);
/** Red below, blue above: by texture coordinates from the height. */
const uv = egg.positions.map(([x, y]) => [0.5 + 0.2 * x, 0.5 - 0.3 * y]);
const image = writePng(8, 8, (_x, y) => (y < 4 ? [20, 40, 230] : [230, 30, 20]));

/** The texture of a document without one. */
const painted = (gltf) => {
  gltf.images = [{ uri: `data:image/png;base64,${image.toString('base64')}` }];
  gltf.textures = [{ source: 0 }];
  gltf.materials = [{ pbrMetallicRoughness: { baseColorTexture: { index: 0 }, metallicFactor: 0 } }];
  gltf.meshes[0].primitives[0].material = 0;
};
const packedByDraco = async (surface) =>
  (await draco({ ...surface, sets: { TEXCOORD_0: { rows: uv, componentType: 5126 } }, edit: painted })).glb;

/** The egg in a morph that the daemon compresses: positions, texture coordinates and indices, all of them quantized. */
async function packedByMeshopt(plain) {
  const send = (body) => json(daemon.url, '/v1/meshes', { method: 'POST', body });
  const shapes = [(await send(plain)).id, (await send(obj(ball(2)))).id];
  const query = `shapes=${shapes}&align=rotate&remesh=overlay&profile=meshopt&wait=1`;
  const reply = await fetch(`${daemon.url}/v1/morph.glb?${query}`);
  assert.equal(reply.status, 200);
  return Buffer.from(await reply.arrayBuffer());
}

const red = (page) => countPixels(page, '.pane-view', (r, g, b) => r > 90 && g < r / 2 && b < r / 2);
const blue = (page) => countPixels(page, '.pane-view', (r, g, b) => b > 90 && r < b / 2 && g < b / 2);
const asFile = (name, buffer) => ({ name: `${name}.glb`, mimeType: 'model/gltf-binary', buffer });

/** A picture of a single file, after the studio has opened it. */
async function drawn(name, glb, look) {
  const { page, done } = await openPage(browser, daemon.url);
  const loaded = [];
  page.on('request', (request) => loaded.push(new URL(request.url()).pathname));
  await addFiles(page, asFile(name, glb));
  await look(page, () => loaded.some((path) => /draco/.test(path)));
  const picture = await shot(page.locator('.pane-view').first());
  await done();
  return picture;
}

async function assertBoth(page, what) {
  const [lower, upper] = [await red(page), await blue(page)];
  assert.ok(lower > 1000 && upper > 1000, `${what}: ${lower} red pixels, ${upper} blue`);
}

test('textures of files that Draco or meshoptimizer has compressed are shown', async () => {
  const plain = writeGlb({ ...egg, uv, image });
  const expected = await drawn('plain', plain, async (page, hasDecoder) => {
    await assertBoth(page, 'plain');
    assert.equal(hasDecoder(), false, 'a plain file needs no decoder');
  });
  const files = { draco: await packedByDraco(egg), meshopt: await packedByMeshopt(plain) };
  for (const [name, glb] of Object.entries(files)) {
    const picture = await drawn(name, glb, async (page, hasDecoder) => {
      await assertBoth(page, name);
      assert.equal(hasDecoder(), name === 'draco');
    });
    const off = await difference(browser, expected, picture);
    assert.ok(off < 0.01, `${name} looks as the plain file does: ${off} of the picture differs`);
  }
});

test('a compressed file keeps its texture after a repair', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const glb = await packedByDraco({ ...egg, triangles: egg.triangles.slice(1) });
  await page
    .locator('input[type=file]')
    .first()
    .setInputFiles([asFile('open', glb)]);
  await button(page, 'Fill the holes').click();
  await page.locator('.card.ready').waitFor();
  await counted(page.getByText('reading…'), 0, 'the shape is read');
  await settled(page);
  await assertBoth(page, 'after the repair');
  await done();
});
