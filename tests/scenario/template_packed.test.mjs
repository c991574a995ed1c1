// The remesh method "template" if the document's positions are quantized or sparse: they stay unchanged, and the
// targets are 32-bit floats beside them. Those of a compressed document are decompressed, with the values that
// independent decoders read.
import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import test from 'node:test';
import validator from 'gltf-validator';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { daemon } from './support/daemon.mjs';
import { farthest } from './support/distance.mjs';
import { draco, encoder, undraco } from './support/draco.mjs';
import { parseGlb } from './support/glb.mjs';
import { writeGlb } from './support/glb_write.mjs';
import * as shapes from './support/shapes.mjs';

const binaryOf = (glb) => glb.subarray(28 + glb.readUInt32LE(12));
const jsonOf = (glb) => JSON.parse(glb.toString('utf8', 20, 20 + glb.readUInt32LE(12)));
const target = shapes.bean(3);
const UNPACKED = [['compression', '']];

/** The asset with `file` as the template. */
async function assetOf(d, file, dropped = [], query = {}) {
  const first = await d.upload(file, { name: 'egg', ...query });
  assert.equal(first.status, 201, JSON.stringify(first.json));
  const second = (await d.upload(shapes.obj(target), { name: 'bean' })).json;
  const made = await d.made('/v1/supermeshes', {
    shapes: [{ mesh: first.json.id }, { mesh: second.id }],
    landmarks: 'auto',
    remesh: { method: 'template' },
    asset: { fit: 'none', animation: 'none' },
  });
  assert.deepEqual(
    made.dropped.map(({ what, where }) => [what, where]),
    dropped,
  );
  const asset = (await d.get(made.asset)).bytes;
  const { issues } = await validator.validateBytes(asset, { maxIssues: 100 });
  assert.equal(issues.numErrors, 0, JSON.stringify(issues.messages));
  const old = binaryOf(file).subarray(0, jsonOf(file).buffers[0].byteLength);
  assert.ok(binaryOf(asset).subarray(0, old.length).equals(old), 'the bytes of the upload stay');
  return asset;
}

/** The same; the asset must have everything in the file. */
async function templateOf(d, file, query) {
  const asset = await assetOf(d, file, [], query);
  const [before, after] = [jsonOf(file), jsonOf(asset)];
  assert.deepEqual(after.accessors.slice(0, before.accessors.length), before.accessors);
  assert.deepEqual(after.bufferViews.slice(0, before.bufferViews.length), before.bufferViews);
  assert.deepEqual(after.nodes, before.nodes);
  for (const name of ['extensionsUsed', 'extensionsRequired']) assert.deepEqual(after[name], before[name]);
  const [was, is] = [before, after].map((gltf) => gltf.meshes[0].primitives[0]);
  assert.deepEqual([is.attributes, is.indices, is.extensions], [was.attributes, was.indices, was.extensions]);
  return asset;
}

/** Asserts that base and last target, moved by the node, lie on the target's surface. `base`: 3 per vertex, decoded. */
function assertOnTarget(asset, base) {
  const { gltf, read } = parseGlb(asset);
  const { translation = [0, 0, 0], rotation, scale = [1, 1, 1] } = gltf.nodes.find((node) => node.mesh === 0);
  assert.equal(rotation, undefined);
  const move = read(gltf.meshes[0].primitives[0].targets.at(-1).POSITION);
  assert.equal(move.length, base.length);
  const points = Array.from({ length: base.length / 3 }, (_, v) =>
    [0, 1, 2].map((k) => translation[k] + scale[k] * (base[3 * v + k] + move[3 * v + k])),
  );
  const off = farthest(points, target.positions.flat(), target.triangles.flat());
  assert.ok(off < 3e-6, `${off}`);
}

test('quantized positions', async (t) => {
  const d = await daemon(t);
  const egg = shapes.egg(3);
  const whole = egg.positions.map((p) => p.map((x) => Math.round(20000 * x)));
  const file = writeGlb({
    ...egg,
    edit(gltf, push) {
      const bufferView = push(Buffer.from(new Int16Array(whole.flatMap((p) => [...p, 0])).buffer));
      gltf.bufferViews[bufferView].byteStride = 8;
      const range = (pick) => [0, 1, 2].map((k) => pick(...whole.map((p) => p[k])));
      const [min, max] = [range(Math.min), range(Math.max)];
      gltf.accessors[0] = { bufferView, componentType: 5122, count: whole.length, type: 'VEC3', min, max };
      gltf.nodes[0].scale = [5e-5, 5e-5, 5e-5];
      gltf.extensionsUsed = gltf.extensionsRequired = ['KHR_mesh_quantization'];
    },
  });
  assertOnTarget(await templateOf(d, file), whole.flat());
});

test('sparse positions', async (t) => {
  const d = await daemon(t);
  const egg = shapes.egg(3);
  const some = egg.positions.map((_, v) => v).filter((v) => v % 5 === 0);
  const file = writeGlb({
    ...egg,
    edit(gltf, push) {
      const values = some.flatMap((v) => egg.positions[v].map((x) => 1.1 * x));
      gltf.accessors[0].sparse = {
        count: some.length,
        indices: { bufferView: push(Buffer.from(new Uint16Array(some).buffer)), componentType: 5123 },
        values: { bufferView: push(Buffer.from(new Float32Array(values).buffer)) },
      };
      const places = egg.positions.map((p, v) => (some.includes(v) ? p.map((x) => Math.fround(1.1 * x)) : p));
      for (const key of ['min', 'max'])
        gltf.accessors[0][key] = [0, 1, 2].map((k) => Math.fround(Math[key](...places.map((p) => p[k]))));
    },
  });
  const asset = await templateOf(d, file);
  const base = parseGlb(asset).read(0);
  for (const v of some) assert.equal(base[3 * v], Math.fround(1.1 * egg.positions[v][0]));
  assertOnTarget(asset, base);
});

test('positions compressed by meshoptimizer', async (t) => {
  const d = await daemon(t);
  const ids = [];
  for (const mesh of [shapes.egg(3), shapes.ball(3)]) ids.push((await d.upload(shapes.obj(mesh))).json.id);
  const made = await d.made('/v1/supermeshes', {
    shapes: ids.map((mesh) => ({ mesh })),
    align: { method: 'rotate' },
    remesh: { tolerance: 0.01 },
    asset: { animation: 'none' },
  });
  const file = (await d.get(`${made.asset}?profile=meshopt`)).bytes;
  const asset = await assetOf(d, file, UNPACKED);
  const { gltf, read } = parseGlb(asset);
  assert.deepEqual(gltf.extensionsRequired, ['KHR_mesh_quantization']);
  assert.equal(gltf.buffers.length, 1, 'no fallback');
  assert.doesNotMatch(JSON.stringify(gltf), /EXT_meshopt_compression/);
  const [primitive] = gltf.meshes[0].primitives;
  assert.equal(primitive.targets.length, 2, 'the old target and the new one');

  const packed = jsonOf(file);
  await MeshoptDecoder.ready;
  /** The bytes of an accessor of the upload, decoded, and the places of its elements. */
  const decoded = (index) => {
    const accessor = packed.accessors[index];
    const view = packed.bufferViews[accessor.bufferView].extensions.EXT_meshopt_compression;
    const bytes = new Uint8Array(view.count * view.byteStride);
    const from = view.byteOffset ?? 0;
    const source = binaryOf(file).subarray(from, from + view.byteLength);
    MeshoptDecoder.decodeGltfBuffer(bytes, view.count, view.byteStride, source, view.mode, view.filter);
    return { bytes, accessor, stride: view.byteStride };
  };
  const { bytes, accessor, stride } = decoded(packed.meshes[0].primitives[0].attributes.POSITION);
  assert.equal(accessor.componentType, 5123);
  assert.ok(!accessor.normalized);
  const words = new Uint16Array(bytes.buffer);
  const base = Array.from({ length: accessor.count }, (_, v) =>
    [0, 1, 2].map((k) => words[((accessor.byteOffset ?? 0) + v * stride) / 2 + k]),
  );
  const { POSITION } = primitive.attributes;
  const view = gltf.bufferViews[gltf.accessors[POSITION].bufferView];
  const lying = binaryOf(asset).subarray(view.byteOffset, view.byteOffset + view.byteLength);
  const plain = new Uint16Array(new Uint8Array(lying).buffer);
  assert.deepEqual([...plain], [...words], 'the decoded bytes');
  const indices = decoded(packed.meshes[0].primitives[0].indices);
  const Type = indices.accessor.componentType === 5123 ? Uint16Array : Uint32Array;
  assert.deepEqual([...read(primitive.indices)], [...new Type(indices.bytes.buffer)]);
  assertOnTarget(asset, base.flat());
});

test('positions compressed by Draco', { skip: !existsSync(encoder) }, async (t) => {
  const d = await daemon(t);
  const egg = shapes.egg(3);
  const colors = egg.positions.map((_, v) => [v % 256, v >> 8, 255 - (v % 256), 255]);
  const { glb } = await draco({ ...egg, colors, positions: egg.positions.map((p) => p.map((x) => x / 2)) });
  const asset = await assetOf(d, glb, UNPACKED);
  const { gltf, read } = parseGlb(asset);
  const before = jsonOf(glb);
  assert.doesNotMatch(JSON.stringify(gltf), /KHR_draco_mesh_compression/);
  const { bufferView, attributes } = before.meshes[0].primitives[0].extensions.KHR_draco_mesh_compression;
  const { byteOffset = 0, byteLength } = before.bufferViews[bufferView];
  const { positions } = await undraco(
    binaryOf(asset).subarray(byteOffset, byteOffset + byteLength),
    attributes.POSITION,
  );
  const [primitive] = gltf.meshes[0].primitives;
  assert.deepEqual([...read(primitive.attributes.POSITION)], [...positions], 'the values that Draco decodes');
  assert.equal(read(primitive.indices).length, 3 * egg.triangles.length);
  const { componentType, normalized } = gltf.accessors[primitive.attributes.COLOR_0];
  assert.deepEqual([componentType, normalized], [5121, true]);
  const bytes = read(primitive.attributes.COLOR_0);
  const rows = (list) => list.map((color) => color.join(' ')).sort(); // Draco sorts the vertices
  assert.deepEqual(rows(colors.map((_, v) => [...bytes.slice(4 * v, 4 * v + 4)])), rows(colors));
  assertOnTarget(asset, positions);
});

test('a compressed mesh that is not on the surface stays compressed', { skip: !existsSync(encoder) }, async (t) => {
  const d = await daemon(t);
  const egg = shapes.egg(2);
  const { glb } = await draco(egg);
  const [hat, bin] = [jsonOf(glb), binaryOf(glb)];
  const file = writeGlb({
    ...shapes.egg(3),
    edit(gltf, push) {
      const view = push(bin.subarray(0, hat.buffers[0].byteLength));
      const base = gltf.accessors.length;
      gltf.accessors.push(...hat.accessors);
      const [primitive] = hat.meshes[0].primitives;
      const moved = Object.fromEntries(Object.entries(primitive.attributes).map(([name, i]) => [name, base + i]));
      primitive.extensions.KHR_draco_mesh_compression.bufferView = view;
      gltf.meshes.push({ primitives: [{ ...primitive, attributes: moved, indices: base + primitive.indices }] });
      gltf.nodes.push({ name: 'hat', mesh: 1, translation: [0, 9, 0] });
      gltf.scenes[0].nodes.push(gltf.nodes.length - 1);
      gltf.extensionsUsed = gltf.extensionsRequired = ['KHR_draco_mesh_compression'];
    },
  });
  const asset = await templateOf(d, file, { repair: 'largest_component' });
  assert.ok(jsonOf(asset).meshes[1].primitives[0].extensions.KHR_draco_mesh_compression);
});
