// Real meshes as templates: vertices, their order, corners and attributes stay, bit for bit. This test has its own
// readers, and the Khronos validator reports nothing that it does not report for the upload. ORB_TEMPLATE_MOST: the
// largest mesh, in triangles; tests/long.sh takes all of them.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import test from 'node:test';
import validator from 'gltf-validator';
import { daemon } from './support/daemon.mjs';
import { morphOf, parseGlb } from './support/glb.mjs';
import * as real from './support/real.mjs';
import * as shapes from './support/shapes.mjs';

const most = Number(process.env.ORB_TEMPLATE_MOST ?? 6000);
const triple = (i) => [3 * i, 3 * i + 1, 3 * i + 2];

function readObj(text) {
  const lists = { v: [], vt: [], vn: [] };
  const faces = [];
  for (const line of text.split('\n')) {
    const [kind, ...words] = line.trim().split(/\s+/);
    lists[kind]?.push(words.map(Number));
    const pick = (word) => word.split('/').map((at, i) => Number(at) + (at < 0 ? Object.values(lists)[i].length : -1));
    if (kind === 'f') faces.push(words.map(pick));
  }
  return { positions: lists.v, faces, lists };
}

/**
 * The corners of the triangles that polygons are cut into: those of each polygon follow one another, and what they do
 * not share is its outline.
 */
function cutCorners({ positions, faces }, triangles, at) {
  const out = [];
  for (const face of faces) {
    const cut = triangles.slice(out.length, out.length + 3 * (face.length - 2));
    const is = (v, corner) =>
      v === corner || (v >= positions.length && triple(v).every((i, k) => at[i] === at[3 * corner + k]));
    const numbers = cut.map((v) => face.findIndex(([corner]) => is(v, corner)));
    assert.ok(!numbers.includes(-1), `a corner of another polygon than ${face.map(([v]) => v)}`);
    const edges = numbers.map((a, i) => [a, numbers[i - (i % 3) + ((i + 1) % 3)]]);
    const outline = edges.filter(([a, b]) => !edges.some(([c, d]) => c === b && d === a));
    assert.deepEqual(outline.map(([a]) => a).sort(), [...face.keys()].sort());
    for (const [a, b] of outline) assert.equal(b, (a + 1) % face.length);
    out.push(...numbers.map((number) => face[number]));
  }
  return out;
}

/** Adds to an OBJ file the corners of its triangles, and their texture coordinates and normals. */
function withCorners(file, triangles, at) {
  const corners = cutCorners(file, triangles, at);
  const [uv, normals] = ['vt', 'vn'].map(
    (kind, i) =>
      file.lists[kind].length > 0 && { values: file.lists[kind], of: corners.map((corner) => corner[i + 1]) },
  );
  return { ...file, corners: corners.map(([v]) => v), uv, normals };
}

function readStl(bytes) {
  const count = bytes.readUInt32LE(80);
  const positions =
    bytes.length === 84 + 50 * count
      ? Array.from({ length: 3 * count }, (_, i) =>
          [0, 4, 8].map((k) => bytes.readFloatLE(84 + 50 * Math.floor(i / 3) + 12 + 12 * (i % 3) + k)),
        )
      : [...bytes.toString().matchAll(/vertex\s+(\S+)\s+(\S+)\s+(\S+)/g)].map((found) => found.slice(1).map(Number));
  return { positions, corners: positions.map((_, i) => i) };
}

/** ASCII, three corners per face. */
function readOff(text) {
  const words = text.replace(/#.*$/gm, '').trim().split(/\s+/).slice(1).map(Number);
  const [vertices, faces] = words;
  const positions = Array.from({ length: vertices }, (_, v) => triple(v).map((i) => words[3 + i]));
  const lists = Array.from({ length: faces }, (_, t) =>
    words.slice(3 + 3 * vertices + 4 * t, 7 + 3 * vertices + 4 * t),
  );
  assert.ok(lists.every(([corners]) => corners === 3));
  return { positions, corners: lists.flatMap((list) => list.slice(1)) };
}

/** Binary: three floats per vertex, then lists of three 32-bit integers. */
function readPly(bytes) {
  const start = bytes.indexOf('end_header\n') + 11;
  const head = bytes.toString('latin1', 0, start);
  assert.match(head, /binary_little_endian[\s\S]*property float x\nproperty float y\nproperty float z\nelement face/);
  assert.match(head, /property list uchar int \w+\nend_header\n$/);
  const count = (name) => Number(new RegExp(`element ${name} (\\d+)`).exec(head)[1]);
  const positions = Array.from({ length: count('vertex') }, (_, v) =>
    triple(v).map((i) => bytes.readFloatLE(start + 4 * i)),
  );
  const lists = start + 12 * positions.length;
  const corners = Array.from({ length: 3 * count('face') }, (_, i) => {
    const list = lists + 13 * Math.floor(i / 3);
    assert.equal(bytes[list], 3);
    return bytes.readInt32LE(list + 1 + 4 * (i % 3));
  });
  return { positions, corners };
}

/** One primitive. Its attributes are compared as bytes. */
function readGlb(bytes) {
  const { gltf, read } = parseGlb(bytes);
  const { attributes, indices } = gltf.meshes[0].primitives[0];
  const flat = read(attributes.POSITION);
  const positions = Array.from({ length: flat.length / 3 }, (_, v) => triple(v).map((i) => flat[i]));
  const kept = Object.entries(attributes).map(([name, accessor]) => [name, read(accessor)]);
  return { positions, corners: [...read(indices)], kept };
}

/** Errors and warnings of the Khronos validator. */
async function complaints(glb) {
  const { issues } = await validator.validateBytes(new Uint8Array(glb), { maxIssues: 1000 });
  return issues.messages.filter((m) => m.severity < 2).map((m) => `${m.code} at ${m.pointer}`);
}

const readers = {
  glb: readGlb,
  obj: (bytes) => readObj(bytes.toString()),
  off: (bytes) => readOff(bytes.toString()),
  ply: readPly,
  stl: readStl,
};

for (const row of real.rows('good').filter((one) => Number(one.f) <= most))
  test(row.name, async (t) => {
    const d = await daemon(t);
    const bytes = await readFile(row.file);
    let file = readers[row.format](bytes);
    const first = await d.upload(bytes, { name: 'first' });
    assert.equal(first.status, 201, JSON.stringify(first.json));
    const second = (await d.upload(shapes.obj(shapes.egg(3)), { name: 'egg' })).json;
    const made = await d.made('/v1/supermeshes', {
      shapes: [{ mesh: first.json.id }, { mesh: second.id }],
      align: { method: 'rotate' },
      remesh: { method: 'template' },
      asset: { fit: 'none' },
    });
    const asset = (await d.get(made.asset)).bytes;
    const known = row.format === 'glb' ? await complaints(bytes) : [];
    assert.deepEqual(
      (await complaints(asset)).filter((one) => !known.includes(one)),
      [],
    );
    const { shapes: at, deltas, triangles, gltf, read, count } = morphOf(asset);
    assert.equal(gltf.meshes[0].primitives.length, 1);
    const { attributes } = gltf.meshes[0].primitives[0];
    const own = file.positions.length;
    for (const [name, values] of file.kept ?? []) assert.deepEqual(read(attributes[name]), values, name);
    assert.ok(
      Buffer.from(Float32Array.from(file.positions.flat()).buffer).equals(
        Buffer.from(Float32Array.from(at[0].slice(0, 3 * own)).buffer),
      ),
    );
    if (file.faces) file = withCorners(file, triangles, at[0]);
    assert.equal(triangles.length, file.corners.length);
    const values = new Set();
    const [uv, normals] = [file.uv && read(attributes.TEXCOORD_0), file.normals && read(attributes.NORMAL)];
    triangles.forEach((v, i) => {
      const corner = file.corners[i];
      assert.ok(v === corner || v >= own, `corner ${i}`);
      for (const k of [0, 1, 2]) {
        assert.equal(at[0][3 * v + k], at[0][3 * corner + k]);
        assert.equal(deltas[0][3 * v + k], deltas[0][3 * corner + k], 'a seam moves alike');
      }
      const key = [corner];
      if (uv) {
        const [a, b] = file.uv.values[file.uv.of[i]].map(Math.fround);
        assert.ok(uv[2 * v] === a && Math.abs(uv[2 * v + 1] - (1 - b)) < 1e-6, `texture coordinates of corner ${i}`);
        key.push(a, b);
      }
      if (normals) {
        const normal = file.normals.values[file.normals.of[i]];
        const length = Math.hypot(...normal);
        normal.forEach((x, k) => assert.ok(Math.abs(normals[3 * v + k] - x / length) < 1e-5, `normal of corner ${i}`));
        key.push(...normal.map(Math.fround));
      }
      values.add(key.join());
    });
    assert.ok(
      count <= Math.max(own, values.size + own - new Set(file.corners).size),
      'a copy for each further value, no more',
    );
  });
