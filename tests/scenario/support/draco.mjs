// Draco-compressed glTF, by Google's encoder and decoder in the form that three has.
import { readFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import path from 'node:path';
import { root } from './daemon.mjs';

const folder = path.join(root, 'client/web/node_modules/three/examples/jsm/libs/draco');

export const encoder = path.join(folder, 'draco_encoder.js');

async function load(file) {
  // three is a package of modules, this file is not one
  const loaded = { exports: {} };
  const run = new Function('module', 'exports', 'require', '__filename', '__dirname', await readFile(file, 'utf8'));
  run(loaded, loaded.exports, createRequire(import.meta.url), file, path.dirname(file));
  // wrapped, as it is a thenable that resolves to itself
  return new Promise((resolve) => loaded.exports({ onModuleLoaded: (module) => resolve({ module }) }));
}

function encoded(module, made, mesh) {
  const out = new module.DracoInt8Array();
  const length = made.EncodeMeshToDracoBuffer(mesh, out);
  return Buffer.from(Array.from({ length }, (_, i) => out.GetValue(i) & 255));
}

/**
 * A GLB of one primitive compressed with Google's Draco encoder. colors: four bytes per vertex. sets: attributes by
 * name, {rows, componentType, normalized} with floats, bytes or 16-bit numbers. method: of the encoder. edit(json)
 * changes the document.
 */
export async function draco({ positions, triangles, colors, sets = {}, method = 'EDGEBREAKER', edit = () => {} }) {
  const { module } = await load(encoder);
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
  const ids = { POSITION: id };
  if (colors) {
    const bytes = new Uint8Array(colors.flat());
    ids.COLOR_0 = builder.AddUInt8Attribute(mesh, module.COLOR, positions.length, 4, bytes);
  }
  for (const [name, { rows, componentType }] of Object.entries(sets)) {
    const [add, Values] = {
      5121: ['AddUInt8Attribute', Uint8Array],
      5123: ['AddUInt16Attribute', Uint16Array],
      5126: ['AddFloatAttributeToMesh', Float32Array],
    }[componentType];
    const kind = name.startsWith('TEXCOORD') ? module.TEX_COORD : module.GENERIC;
    ids[name] = builder[add](mesh, kind, rows.length, rows[0].length, new Values(rows.flat()));
  }
  made.SetEncodingMethod(module[`MESH_${method}_ENCODING`]);
  made.SetAttributeQuantization(module.POSITION, 14);
  const bytes = encoded(module, made, mesh);
  const { length } = bytes;
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
      ...(colors ? [{ componentType: 5121, normalized: true, type: 'VEC4', count: positions.length }] : []),
    ],
    meshes: [
      {
        primitives: [
          {
            attributes: { POSITION: 0, ...(colors && { COLOR_0: 2 }) },
            indices: 1,
            extensions: { KHR_draco_mesh_compression: { bufferView: 0, attributes: ids } },
          },
        ],
      },
    ],
    nodes: [{ mesh: 0, scale: [2, 2, 2] }],
    scenes: [{ nodes: [0] }],
    scene: 0,
  };
  const [{ attributes }] = json.meshes[0].primitives;
  for (const [name, { rows, ...accessor }] of Object.entries(sets))
    attributes[name] = json.accessors.push({ ...accessor, type: `VEC${rows[0].length}`, count: rows.length }) - 1;
  edit(json);
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

/** Draco's bytes of a mesh of so many points and wide attributes, each of which has one value that differs: each attribute
 * takes some thirty bytes, however many points and components it has. */
export async function wideDraco(points, components, attributes) {
  const { module } = await load(encoder);
  const made = new module.Encoder();
  const mesh = new module.Mesh();
  const builder = new module.MeshBuilder();
  builder.AddFacesToMesh(
    mesh,
    Math.ceil(points / 3),
    new Uint32Array(3 * Math.ceil(points / 3)).map((_, i) => i % 3),
  );
  builder.AddFloatAttributeToMesh(
    mesh,
    module.POSITION,
    points,
    3,
    new Float32Array(3 * points).map((_, i) => i),
  );
  for (let i = 0; i < attributes; i++) {
    const values = new Int32Array(points * components);
    values[5 * components] = 1;
    builder.AddInt32Attribute(mesh, module.GENERIC, points, components, values);
  }
  made.SetEncodingMethod(module.MESH_SEQUENTIAL_ENCODING);
  made.SetAttributeQuantization(module.POSITION, 16);
  return encoded(module, made, mesh);
}

/** The positions that a decoder reads, 3 per vertex, and the triangles. */
export async function undraco(bytes, id) {
  const { module } = await load(path.join(folder, 'draco_decoder.js'));
  const decoder = new module.Decoder();
  const buffer = new module.DecoderBuffer();
  buffer.Init(new Int8Array(bytes), bytes.length);
  const mesh = new module.Mesh();
  decoder.DecodeBufferToMesh(buffer, mesh);
  const values = new module.DracoFloat32Array();
  decoder.GetAttributeFloatForAllPoints(mesh, decoder.GetAttributeByUniqueId(mesh, id), values);
  const positions = Array.from({ length: 3 * mesh.num_points() }, (_, i) => values.GetValue(i));
  const face = new module.DracoInt32Array();
  const triangles = Array.from({ length: mesh.num_faces() }, (_, t) => {
    decoder.GetFaceFromMesh(mesh, t, face);
    return [0, 1, 2].map((k) => face.GetValue(k));
  });
  return { positions, triangles };
}
