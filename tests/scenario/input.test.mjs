// Files as people have them: compressed and quantized glTF, and files of other kinds, which the refusal names.
import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import { readFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import path from 'node:path';
import test from 'node:test';
import { assertProblem, daemon, root, samples } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const near = (a, b, part, what) => assert.ok(Math.abs(a - b) <= part * Math.abs(b), `${what}: ${a}, expected ${b}`);

test('quantized and meshopt-compressed glTF are read: the mesh is that of the plain asset', async (t) => {
  const d = await daemon(t);
  const [a, b] = await Promise.all([d.mesh(path.join(samples, 'dog.obj')), d.mesh(path.join(samples, 'elephant.ply'))]);
  const made = await d.made('/v1/supermeshes', {
    shapes: [{ mesh: a.id }, { mesh: b.id }],
    align: { method: 'rotate' },
    remesh: { tolerance: 0.01 },
  });
  const upload = async (profile) => {
    const bytes = Buffer.from(await (await fetch(`${d.url}${made.asset}?profile=${profile}`)).arrayBuffer());
    const reply = await d.upload(bytes);
    assert.equal(reply.status, 201, JSON.stringify(reply.json));
    return { bytes, ...reply.json };
  };
  const [plain, quantized, packed] = [await upload('float'), await upload('quantized'), await upload('meshopt')];
  for (const mesh of [quantized, packed]) {
    assert.deepEqual([mesh.triangles, mesh.topology], [plain.triangles, plain.topology]);
    near(mesh.volume, plain.volume, 1e-3, 'volume');
    near(mesh.area, plain.area, 1e-3, 'area');
  }
  // every byte of the compressed data that is damaged gives a mesh or a problem
  for (let at = 100; at < packed.bytes.length; at += Math.ceil(packed.bytes.length / 40)) {
    const damaged = Buffer.from(packed.bytes);
    damaged[at] ^= 0x5a;
    assert.ok([200, 201, 400, 413, 422].includes((await d.upload(damaged)).status), `byte ${at}`);
  }
});

const encoder = path.join(root, 'client/web/node_modules/three/examples/jsm/libs/draco/draco_encoder.js');

/** A GLB of one primitive that Draco has compressed, with Google's encoder. */
async function draco({ positions, triangles }) {
  // three is a package of modules, this file is not one
  const loaded = { exports: {} };
  const run = new Function('module', 'exports', 'require', '__filename', '__dirname', await readFile(encoder, 'utf8'));
  run(loaded, loaded.exports, createRequire(import.meta.url), encoder, path.dirname(encoder));
  const module = loaded.exports(); // no await: it is a thenable that resolves to itself
  const made = new module.Encoder();
  const mesh = new module.Mesh();
  const builder = new module.MeshBuilder();
  builder.AddFacesToMesh(mesh, triangles.length, new Uint32Array(triangles.flat()));
  const id = builder.AddFloatAttributeToMesh(
    mesh,
    module.POSITION,
    positions.length,
    3,
    new Float32Array(positions.flat()),
  );
  made.SetAttributeQuantization(module.POSITION, 14);
  const out = new module.DracoInt8Array();
  const length = made.EncodeMeshToDracoBuffer(mesh, out);
  const bytes = Buffer.from(Array.from({ length }, (_, i) => out.GetValue(i) & 255));
  const range = (pick) => [0, 1, 2].map((k) => pick(...positions.map((p) => p[k])));
  const json = {
    asset: { version: '2.0' },
    extensionsUsed: ['KHR_draco_mesh_compression'],
    extensionsRequired: ['KHR_draco_mesh_compression'],
    buffers: [{ byteLength: length }],
    bufferViews: [{ buffer: 0, byteLength: length }],
    accessors: [
      { componentType: 5126, type: 'VEC3', count: positions.length, min: range(Math.min), max: range(Math.max) },
      { componentType: 5125, type: 'SCALAR', count: 3 * triangles.length },
    ],
    meshes: [
      {
        primitives: [
          {
            attributes: { POSITION: 0 },
            indices: 1,
            extensions: { KHR_draco_mesh_compression: { bufferView: 0, attributes: { POSITION: id } } },
          },
        ],
      },
    ],
    nodes: [{ mesh: 0, scale: [2, 2, 2] }],
    scenes: [{ nodes: [0] }],
    scene: 0,
  };
  const pad = (b, fill) => Buffer.concat([b, Buffer.alloc((4 - (b.length % 4)) % 4, fill)]);
  const chunk = (type, b) => {
    const head = Buffer.alloc(8);
    head.writeUInt32LE(b.length);
    head.writeUInt32LE(type, 4);
    return Buffer.concat([head, b]);
  };
  const body = Buffer.concat([
    chunk(0x4e4f534a, pad(Buffer.from(JSON.stringify(json)), ' ')),
    chunk(0x004e4942, pad(bytes, 0)),
  ]);
  const head = Buffer.alloc(12);
  head.write('glTF');
  head.writeUInt32LE(2, 4);
  head.writeUInt32LE(12 + body.length, 8);
  return {
    glb: Buffer.concat([head, body]),
    at: 12 + 8 + pad(Buffer.from(JSON.stringify(json)), ' ').length + 8,
    length,
  };
}

test('Draco-compressed glTF is read, and damaged data is refused', { skip: !existsSync(encoder) }, async (t) => {
  const d = await daemon(t);
  const egg = shapes.egg();
  const plain = (await d.upload(shapes.obj(egg))).json;
  const { glb, at, length } = await draco(egg);
  const { status, json } = await d.upload(glb);
  assert.equal(status, 201, JSON.stringify(json));
  assert.deepEqual([json.format, json.triangles, json.topology], ['glb', egg.triangles.length, plain.topology]);
  near(json.volume, 8 * plain.volume, 2e-3, 'volume, twice as large each way');
  near(json.bounds.max[0], 2 * plain.bounds.max[0], 2e-3, 'size');
  for (let k = 0; k < 30; k++) {
    const damaged = Buffer.from(glb);
    damaged[at + Math.floor((k * length) / 30)] ^= 0xa5;
    assert.ok([200, 201, 400, 413, 422].includes((await d.upload(damaged)).status), `damage ${k}`);
  }
  assertProblem(await d.upload(glb.subarray(0, at + length / 2)), 400, 'malformed-mesh');
});

test('files of other kinds are refused by name, with advice', async (t) => {
  const d = await daemon(t);
  const kinds = [
    ['Kaydara FBX Binary  \0\x1a\0', /FBX file.*export it as glTF/],
    ['BLENDER-v300RENDH', /Blender file.*glTF/],
    ['PK\x03\x04\x14\0\x06\0', /ZIP archive.*3MF/],
    ['ISO-10303-21;\nHEADER;', /STEP file/],
    ['<?xml version="1.0"?>\n<COLLADA xmlns="x">', /Collada file/],
    ['<!doctype html>\n<html lang="en">', /web page/],
    ['\x89PNG\r\n\x1a\n', /PNG picture/],
  ];
  for (const [text, expected] of kinds) {
    const reply = await d.upload(Buffer.from(text, 'latin1'));
    assertProblem(reply, 415, 'unknown-format', text);
    assert.match(reply.json.detail, expected);
  }
  assert.equal((await d.upload(await readFile(path.join(samples, 'elephant.ply')))).status, 201);
});
