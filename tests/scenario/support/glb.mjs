// A reader of binary glTF that is written against the specification only, and facts of the morph in it.
import assert from 'node:assert/strict';

const components = {
  5120: Int8Array,
  5121: Uint8Array,
  5122: Int16Array,
  5123: Uint16Array,
  5125: Uint32Array,
  5126: Float32Array,
};
const widths = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4, MAT4: 16 };

export function parseGlb(bytes) {
  assert.equal(bytes.toString('latin1', 0, 4), 'glTF');
  assert.equal(bytes.readUInt32LE(4), 2);
  assert.equal(bytes.readUInt32LE(8), bytes.length);
  const jsonLength = bytes.readUInt32LE(12);
  const gltf = JSON.parse(bytes.toString('utf8', 20, 20 + jsonLength));
  const bin = bytes.subarray(28 + jsonLength);
  const view = (index, offset, type, count) => {
    const v = gltf.bufferViews[index];
    const start = (v.byteOffset ?? 0) + (offset ?? 0);
    return new components[type](
      new Uint8Array(bin.subarray(start, start + count * components[type].BYTES_PER_ELEMENT)).buffer,
    );
  };
  const read = (index) => {
    const a = gltf.accessors[index];
    const width = widths[a.type];
    const v = a.bufferView === undefined ? null : gltf.bufferViews[a.bufferView];
    assert.ok(!v?.byteStride || v.byteStride === width * components[a.componentType].BYTES_PER_ELEMENT, 'interleaved');
    const out = v
      ? view(a.bufferView, a.byteOffset, a.componentType, a.count * width)
      : new components[a.componentType](a.count * width);
    if (a.sparse) {
      const at = view(
        a.sparse.indices.bufferView,
        a.sparse.indices.byteOffset,
        a.sparse.indices.componentType,
        a.sparse.count,
      );
      const values = view(
        a.sparse.values.bufferView,
        a.sparse.values.byteOffset,
        a.componentType,
        a.sparse.count * width,
      );
      at.forEach((vertex, i) => out.set(values.subarray(i * width, (i + 1) * width), vertex * width));
    }
    return out;
  };
  return { gltf, read };
}

/** The shapes of a morph: positions of each, as float32 sums of base and target, and the triangles. */
export function morphOf(bytes) {
  const { gltf, read } = parseGlb(bytes);
  assert.equal(gltf.meshes.length, 1);
  const shapes = [];
  const triangles = [];
  const deltas = [];
  const append = (lists, k, values) => {
    lists[k] ??= [];
    for (const x of values) lists[k].push(x);
  };
  let first = 0;
  for (const primitive of gltf.meshes[0].primitives) {
    const base = read(primitive.attributes.POSITION);
    append(shapes, 0, base);
    (primitive.targets ?? []).forEach((target, k) => {
      const delta = read(target.POSITION);
      append(
        shapes,
        k + 1,
        delta.map((d, i) => base[i] + d),
      );
      append(deltas, k, delta);
    });
    for (const v of read(primitive.indices)) triangles.push(v + first);
    first += base.length / 3;
  }
  return {
    gltf,
    read,
    shapes,
    deltas,
    triangles,
    names: gltf.meshes[0].extras?.targetNames,
    count: shapes[0].length / 3,
  };
}

/** Welds vertices that are the same in every shape, then counts: {vertices, triangles, closed, genus, weld}. */
export function topologyOf({ shapes, deltas, triangles, count }) {
  const known = new Map();
  const weld = new Int32Array(count);
  for (let v = 0; v < count; v++) {
    const key = [shapes[0], ...deltas].map((s) => `${s[3 * v]},${s[3 * v + 1]},${s[3 * v + 2]}`).join(';');
    if (!known.has(key)) known.set(key, known.size);
    weld[v] = known.get(key);
  }
  const edges = new Set();
  let doubled = 0;
  for (let t = 0; t < triangles.length; t += 3)
    for (let k = 0; k < 3; k++) {
      const a = weld[triangles[t + k]];
      const b = weld[triangles[t + ((k + 1) % 3)]];
      const key = a * known.size + b;
      if (edges.has(key) || a === b) doubled++;
      edges.add(key);
    }
  let open = 0;
  for (const key of edges) {
    const a = Math.floor(key / known.size);
    const b = key % known.size;
    if (!edges.has(b * known.size + a)) open++;
  }
  const v = known.size;
  const f = triangles.length / 3;
  return { vertices: v, triangles: f, closed: open === 0 && doubled === 0, euler: v - edges.size / 2 + f, weld };
}

/** The vertex of the asset at these positions on all shapes, to float32; −1 if there is none. */
export function vertexAt({ shapes, count }, places) {
  let best = -1;
  let least = Infinity;
  for (let v = 0; v < count; v++) {
    let worst = 0;
    places.forEach((p, s) => p.forEach((x, k) => (worst = Math.max(worst, Math.abs(shapes[s][3 * v + k] - x)))));
    if (worst < least) [least, best] = [worst, v];
  }
  const size = Math.max(...places.flat().map(Math.abs), 1e-30);
  const scale = shapes.reduce((m, s) => s.reduce((n, x) => Math.max(n, Math.abs(x)), m), size);
  return least <= 4e-7 * scale ? best : -1;
}
