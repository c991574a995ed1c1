// "transfer": base colour textures of later shapes, baked into the texture coordinates of the first one.
import assert from 'node:assert/strict';
import test from 'node:test';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
import { rigged } from '../samples/rigged.mjs';
import { daemon } from './support/daemon.mjs';
import { writeGlb } from './support/glb_write.mjs';
import { readPng, writePng } from './support/png.mjs';
import * as shapes from './support/shapes.mjs';
import { assetOf, inCharts, shown, uploaded } from './support/transferred.mjs';

const asset = { fit: 'none', animation: 'none' };
const SIDE = 128; // of the texture of the bean

/** Where a point of the bean lies in its texture, which paints this: red is u, green is v. */
const spot = ([x, y]) => [0.5 + 0.3 * x, 0.45 + 0.3 * y];
const paint = (x, y) => [Math.round((255 * (x + 0.5)) / SIDE), Math.round((255 * (y + 0.5)) / SIDE), 60];

const painted = (more = {}) => {
  const bean = shapes.bean(3);
  return writeGlb({ ...bean, uv: bean.positions.map(spot), image: writePng(SIDE, SIDE, paint), wrap: 33071, ...more });
};

/** A ball with two charts side by side, which meet at x = 0. */
function unwrapped() {
  const egg = shapes.egg(3);
  return inCharts(egg, (v, east) => {
    const [x, y, z] = egg.points[v];
    const round = Math.acos(Math.min(1, Math.abs(x))) / (Math.PI / 2); // 1 at the seam
    const wide = Math.hypot(y, z) || 1;
    return [(east ? 0.74 : 0.26) + (0.22 * round * y) / wide, 0.5 + (0.42 * round * z) / wide];
  });
}

/** The picture of a material, and its colour at texture coordinates, blended as viewers do. */
function pictureOf(bytes, gltf, material) {
  const { index } = gltf.materials[material].pbrMetallicRoughness.baseColorTexture;
  const { bufferView, mimeType } = gltf.images[gltf.textures[index].source];
  assert.equal(mimeType, 'image/png');
  const { byteOffset = 0, byteLength } = gltf.bufferViews[bufferView];
  const from = 28 + bytes.readUInt32LE(12) + byteOffset;
  const { width, height, frames } = readPng(bytes.subarray(from, from + byteLength));
  const at = (u, v) => {
    const [x, y] = [u * width - 0.5, v * height - 0.5];
    const [x0, y0] = [Math.floor(x), Math.floor(y)];
    return [0, 1, 2].map((c) => {
      let sum = 0;
      for (let k = 0; k < 4; k++) {
        const [i, j] = [x0 + (k & 1), y0 + (k >> 1)];
        const weight = (k & 1 ? x - x0 : 1 - x + x0) * (k >> 1 ? y - y0 : 1 - y + y0);
        sum += weight * frames[0][3 * (((j + height) % height) * width + ((i + width) % width)) + c];
      }
      return sum;
    });
  };
  return { width, height, at, pixels: frames[0] };
}

/** The material that a variant gives a primitive. */
const chosen = (primitive, variant) =>
  primitive.extensions.KHR_materials_variants.mappings.find(({ variants }) => variants.includes(variant)).material;

/** Asserts that the picture shows the bean's colours at the corners and at the middles of all triangles of the part. */
function assertBaked(part, picture, most, what) {
  const places = shown(part);
  for (let i = 0; i < part.indices.length; i += 3) {
    const corners = part.indices.slice(i, i + 3);
    const uv = corners.map((v) => part.TEXCOORD_0.slice(2 * v, 2 * v + 2));
    const mean = (list) => list[0].map((_, k) => list.reduce((sum, p) => sum + p[k] / list.length, 0));
    const points = corners.map((v) => places[v]);
    for (const [p, [u, v]] of [...points.map((p, k) => [p, uv[k]]), [mean(points), mean(uv)]]) {
      const want = spot(p).map((x) => 255 * x);
      const is = picture.at(u, v);
      const off = Math.max(Math.abs(want[0] - is[0]), Math.abs(want[1] - is[1]), Math.abs(is[2] - 60));
      assert.ok(off < most, `${what}: ${is} is not ${want} at ${u}, ${v}`);
    }
  }
}

const area = (uv, triangles) =>
  triangles.reduce((sum, t) => {
    const [a, b, c] = t.map((v) => uv[v]);
    return sum + Math.abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2;
  }, 0);

for (const method of ['adaptive', 'overlay', 'subdivision', 'convex-hull', 'template'])
  test(`${method}: a baked texture`, async (t) => {
    const d = await daemon(t);
    const egg = unwrapped();
    const image = writePng(4, 4, () => [0, 0, 255]);
    const base = await uploaded(d, writeGlb({ ...egg, image }), { name: 'egg' });
    const bean = await uploaded(d, painted(), { name: 'bean' });
    const remesh = { method, tolerance: 0.002 };
    const transfer = [{ from: 1, what: 'texture', resolution: 256 }];
    const made = await d.made('/v1/supermeshes', { shapes: [base, bean], remesh, asset, transfer });
    assert.deepEqual(made.transferred, [{ from: 1, what: 'texture', as: 'bean', resolution: 256 }]);
    assert.deepEqual(
      made.dropped.filter(({ what }) => /texture/.test(what)),
      [],
    );
    const { gltf, all, bytes } = await assetOf(d, made);
    assert.ok(gltf.extensionsUsed.includes('KHR_materials_variants'));
    assert.deepEqual(gltf.extensions.KHR_materials_variants.variants, [{ name: 'egg' }, { name: 'bean' }]);
    const [part] = all;
    assert.equal(chosen(part.primitive, 0), part.primitive.material);
    const picture = pictureOf(bytes, gltf, chosen(part.primitive, 1));
    assert.deepEqual([picture.width, picture.height], [256, 256]);
    assertBaked(part, picture, method === 'overlay' ? 4 : 6, method);
    const scene = await new GLTFLoader()
      .parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), '')
      .catch((e) => e);
    assert.ok(scene.scene || /self|createImageBitmap|document|URL/.test(`${scene}`), `${scene}`);
  });

test('by itself a picture gets as many texels as the texture has', async (t) => {
  const d = await daemon(t);
  const egg = unwrapped();
  const base = await uploaded(d, writeGlb(egg), { name: 'egg' });
  const bean = await uploaded(d, painted(), { name: 'bean' });
  const remesh = { method: 'template' };
  const transfer = [{ from: 1, what: 'texture' }];
  const made = await d.made('/v1/supermeshes', { shapes: [base, bean], remesh, asset, transfer });
  const { positions, triangles } = shapes.bean(3);
  const texels = SIDE ** 2 * area(positions.map(spot), triangles);
  const wanted = 0.95 * Math.sqrt(texels / area(egg.uv, egg.triangles));
  assert.equal(made.transferred[0].resolution, 2 ** Math.ceil(Math.log2(wanted)));
});

test('factors, colours of vertices and alpha are baked in; the rest of the picture is the mean', async (t) => {
  const d = await daemon(t);
  const base = await uploaded(d, writeGlb(unwrapped()), { name: 'egg' });
  const half = 188; // sRGB of 0.5 in linear light, nearly
  const colors = shapes.bean(3).positions.map(() => [1, 0.5, 1]);
  const edit = (gltf) => (gltf.materials[0].pbrMetallicRoughness.roughnessFactor = 0.25);
  const image = writePng(2, 2, () => [255, 255, 255]);
  const bean = await uploaded(d, painted({ image, colors, factor: [0.5, 1, 0, 1], edit }), { name: 'bean' });
  const transfer = [{ from: 1, what: 'texture', resolution: 64 }];
  const made = await d.made('/v1/supermeshes', { shapes: [base, bean], asset, transfer });
  const { gltf, all, bytes } = await assetOf(d, made);
  const material = chosen(all[0].primitive, 1);
  assert.equal(gltf.materials[material].pbrMetallicRoughness.roughnessFactor, 0.25);
  const { pixels } = pictureOf(bytes, gltf, material);
  assert.equal(pixels.length, 3 * 64 * 64);
  pixels.forEach((x, i) => assert.ok(Math.abs(x - [half, half, 0][i % 3]) <= 1, `${x} at ${i}`));
});

test('a kept document gets a picture for each of its materials, and a second variant', async (t) => {
  const d = await daemon(t);
  const body = await uploaded(d, rigged().bytes, { name: 'body', repair: 'largest_component' });
  const bean = await uploaded(d, painted(), { name: 'bean' });
  const plain = await uploaded(d, painted({ image: writePng(2, 2, () => [10, 200, 30]) }), { name: 'bean' });
  const transfer = [1, 2].map((from) => ({ from, what: 'texture', resolution: 256 }));
  const remesh = { method: 'template' };
  const made = await d.made('/v1/supermeshes', { shapes: [body, bean, plain], remesh, asset, transfer });
  assert.deepEqual(
    made.transferred.map((one) => one.as),
    ['bean', 'bean (2)'],
  );
  const { gltf, all, bytes } = await assetOf(d, made);
  assert.deepEqual(
    gltf.extensions.KHR_materials_variants.variants.map(({ name }) => name),
    ['body', 'bean', 'bean (2)'],
  );
  const parts = all.filter(({ primitive }) => primitive.extensions);
  assert.equal(parts.length, 2);
  for (const [p, part] of parts.entries()) {
    assert.equal(chosen(part.primitive, 0), part.primitive.material);
    const picture = pictureOf(bytes, gltf, chosen(part.primitive, 2));
    assert.deepEqual([...picture.pixels.subarray(0, 3)], [10, 200, 30]);
    assert.ok(chosen(part.primitive, 1) !== chosen(parts[1 - p].primitive, 1));
  }
});

test('a texture that cannot be baked is refused', async (t) => {
  const d = await daemon(t);
  const bare = await uploaded(d, shapes.obj(shapes.egg(2)), { name: 'egg' });
  const egg = await uploaded(d, writeGlb(unwrapped()), { name: 'unwrapped' });
  const bean = await uploaded(d, painted(), { name: 'bean' });
  const named = (gltf) => {
    gltf.materials[0].name = 'peel';
  };
  const image = writePng(8, 8, paint);
  image[image.indexOf('IDAT') + 20] ^= 255;
  const broken = await uploaded(d, painted({ image, edit: named }), { name: 'broken' });
  const transfer = [{ from: 1, what: 'texture' }];
  const elements = [{ where: 'materials[0]', name: 'peel' }];
  for (const [pair, why, members] of [
    [[bare, bean], /texture coordinates of the first shape, which has none/, { shape: 0 }],
    [[egg, bare], /shape 1, which has no base colour texture/, { shape: 1 }],
    [[egg, broken], /base colour of material 0 cannot be decoded/, { shape: 1, elements }],
  ]) {
    const { problem } = await d.make('/v1/supermeshes', { shapes: pair, asset, transfer });
    assert.equal(problem?.type, '/problems/bad-option');
    assert.match(problem.detail, why);
    const { shape, transfer: entry, elements: parts } = problem;
    assert.deepEqual({ shape, entry, parts }, { entry: 0, parts: members.elements, shape: members.shape });
  }
  const { timings_ms } = await d.made('/v1/supermeshes', { shapes: [egg, broken], asset });
  assert.ok(timings_ms.align > 0, 'the alignment was not computed for what is refused');
});

test('charts that lie on each other are reported', async (t) => {
  const d = await daemon(t);
  const egg = unwrapped();
  const uv = egg.uv.map(([u, v]) => [u % 0.5, v]);
  const base = await uploaded(d, writeGlb({ ...egg, uv }), { name: 'egg' });
  const bean = await uploaded(d, painted(), { name: 'bean' });
  const transfer = [{ from: 1, what: 'texture', resolution: 64 }];
  const made = await d.made('/v1/supermeshes', { shapes: [base, bean], asset, transfer });
  const [entry] = made.dropped.filter(({ what }) => what === 'texture');
  assert.equal(entry.where, 'shapes[1]');
  assert.match(entry.why, /share texels/);
});
