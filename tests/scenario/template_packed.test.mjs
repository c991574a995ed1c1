// The remesh method "template" where the document's own positions are quantized, sparse or compressed: they stay as they
// are, and the targets are 32-bit floats beside them, in the coordinates that a reader decodes.
import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import test from 'node:test';
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

/** The asset with `file` as the template; all that the file has must be in it. */
async function templateOf(d, file) {
  const first = await d.upload(file, { name: 'egg' });
  assert.equal(first.status, 201, JSON.stringify(first.json));
  const second = (await d.upload(shapes.obj(target), { name: 'bean' })).json;
  const made = await d.made('/v1/supermeshes', {
    shapes: [{ mesh: first.json.id }, { mesh: second.id }],
    landmarks: 'auto',
    remesh: { method: 'template' },
    asset: { fit: 'none', animation: 'none' },
  });
  assert.deepEqual(made.dropped, []);
  const asset = (await d.get(made.asset)).bytes;
  const [before, after] = [jsonOf(file), jsonOf(asset)];
  const old = binaryOf(file).subarray(0, before.buffers[0].byteLength);
  assert.ok(binaryOf(asset).subarray(0, old.length).equals(old), 'the bytes of the upload stay');
  assert.deepEqual(after.accessors.slice(0, before.accessors.length), before.accessors);
  assert.deepEqual(after.bufferViews.slice(0, before.bufferViews.length), before.bufferViews);
  assert.deepEqual(after.nodes, before.nodes);
  for (const name of ['extensionsUsed', 'extensionsRequired']) assert.deepEqual(after[name], before[name]);
  const [was, is] = [before, after].map((gltf) => gltf.meshes[0].primitives[0]);
  assert.deepEqual([is.attributes, is.indices, is.extensions], [was.attributes, was.indices, was.extensions]);
  return asset;
}

/** That base and last target, moved by the node, lie on the target's surface. `base`: 3 a vertex, as decoded. */
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
      for (const key of ['min', 'max'])
        gltf.accessors[0][key] = gltf.accessors[0][key].map((x) => Math.fround(1.1 * x));
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
  const asset = await templateOf(d, (await d.get(`${made.asset}?profile=meshopt`)).bytes);
  const { gltf } = parseGlb(asset);
  const accessor = gltf.accessors[gltf.meshes[0].primitives[0].attributes.POSITION];
  const view = gltf.bufferViews[accessor.bufferView].extensions.EXT_meshopt_compression;
  assert.equal(accessor.componentType, 5123);
  assert.ok(!accessor.normalized);
  assert.equal(gltf.meshes[0].primitives[0].targets.length, 2, 'the old target and the new one');
  await MeshoptDecoder.ready;
  const decoded = new Uint8Array(view.count * view.byteStride);
  const source = binaryOf(asset).subarray(view.byteOffset ?? 0, (view.byteOffset ?? 0) + view.byteLength);
  MeshoptDecoder.decodeGltfBuffer(decoded, view.count, view.byteStride, source, view.mode, view.filter);
  const words = new Uint16Array(decoded.buffer);
  const base = Array.from({ length: accessor.count }, (_, v) =>
    [0, 1, 2].map((k) => words[((accessor.byteOffset ?? 0) + v * view.byteStride) / 2 + k]),
  );
  assertOnTarget(asset, base.flat());
});

test('positions compressed by Draco', { skip: !existsSync(encoder) }, async (t) => {
  const d = await daemon(t);
  const egg = shapes.egg(3);
  const { glb } = await draco({ ...egg, positions: egg.positions.map((p) => p.map((x) => x / 2)) });
  const asset = await templateOf(d, glb);
  const { gltf } = parseGlb(asset);
  const { bufferView, attributes } = gltf.meshes[0].primitives[0].extensions.KHR_draco_mesh_compression;
  const { byteOffset = 0, byteLength } = gltf.bufferViews[bufferView];
  const { positions } = await undraco(
    binaryOf(asset).subarray(byteOffset, byteOffset + byteLength),
    attributes.POSITION,
  );
  assertOnTarget(asset, positions);
});
