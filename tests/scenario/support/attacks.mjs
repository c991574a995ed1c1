// Files that are made to cost much: small, but expensive for a reader without bounds (docs/limits.md).
import { randomBytes } from 'node:crypto';

const MASK = (1n << 64n) - 1n;
/** The inverse of an odd number modulo 2^64. */
function inverse(odd) {
  let x = odd;
  for (let i = 0; i < 6; i++) x = (x * ((2n - odd * x) & MASK)) & MASK;
  return x;
}

/** Binary PLY of loose triangles whose positions collide in an unkeyed mix of their coordinates, ^ and * and >> 32. */
export function collidingPositions(triangles = 16_000) {
  const m = 0xff51afd7ed558ccdn;
  const [back, lastBack] = [inverse(m), inverse(0xc4ceb9fe1a85ec53n)];
  const view = new DataView(new ArrayBuffer(8));
  let seed = 88172645463325252n;
  const random = () => {
    seed ^= (seed << 13n) & MASK;
    seed ^= seed >> 7n;
    seed ^= (seed << 17n) & MASK;
    return seed;
  };
  const third = (x, y) => {
    let hash = 0x9e3779b97f4a7c15n;
    for (const value of [x, y]) {
      view.setFloat64(0, value);
      hash = ((hash ^ view.getBigUint64(0)) * m) & MASK;
      hash ^= hash >> 32n;
    }
    for (;;) {
      let wanted = ((random() & ~0xffffff00000n & MASK) * lastBack) & MASK;
      wanted ^= wanted >> 32n;
      view.setBigUint64(0, ((wanted * back) & MASK) ^ hash);
      const z = view.getFloat64(0);
      if (z > 1e-30 && z < 1e29) return z;
    }
  };
  const head = Buffer.from(
    `ply\nformat binary_little_endian 1.0\nelement vertex ${3 * triangles}\nproperty double x\nproperty double y\n` +
      `property double z\nelement face ${triangles}\nproperty list uchar int vertex_indices\nend_header\n`,
  );
  const body = Buffer.alloc(3 * triangles * 24 + triangles * 13);
  for (let v = 0; v < 3 * triangles; v++) {
    const y = v * 7919;
    [v, y, third(v, y)].forEach((value, k) => {
      body.writeDoubleLE(value, 24 * v + 8 * k);
    });
  }
  for (let f = 0, at = 72 * triangles; f < triangles; f++, at += 13) {
    body.writeUInt8(3, at);
    for (let k = 0; k < 3; k++) body.writeInt32LE(3 * f + k, at + 1 + 4 * k);
  }
  return Buffer.concat([head, body]);
}

/** OBJ with many materials whose names collide in FNV-1a modulo 2^17. */
export function collidingNames(count = 60_000) {
  const [prime, mask] = [16777619, (1 << 17) - 1];
  const back = Number(inverse(BigInt(prime)) & BigInt(mask));
  const letters = (s) => [33 + Math.floor(s / 8836), 33 + (Math.floor(s / 94) % 94), 33 + (s % 94)];
  const suffix = new Int32Array(mask + 1).fill(-1);
  for (let s = 0; s < 94 ** 3; s++) {
    let h = 0;
    for (const letter of letters(s).reverse()) h = (Math.imul(h, back) & mask) ^ letter;
    suffix[h] = s;
  }
  const lines = ['v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n'];
  for (let i = 0; i < count; i++) {
    for (let more = 97, s = -1; s < 0; more++) {
      const name = `${String.fromCharCode(more)}${i}`;
      let h = 2166136261 | 0;
      for (let k = 0; k < name.length; k++) h = Math.imul(h ^ name.charCodeAt(k), prime);
      s = suffix[h & mask];
      if (s >= 0) lines.push(`usemtl ${name}${String.fromCharCode(...letters(s))}\nf 1 2 3\n`);
    }
  }
  return Buffer.from(lines.join(''));
}

function glb(json, binary) {
  const text = Buffer.from(JSON.stringify(json));
  const padded = Buffer.concat([text, Buffer.alloc(-text.length & 3, ' ')]);
  const head = Buffer.alloc(20);
  [0x46546c67, 2, 28 + padded.length + binary.length, padded.length, 0x4e4f534a].forEach((n, i) => {
    head.writeUInt32LE(n, 4 * i);
  });
  const chunk = Buffer.alloc(8);
  chunk.writeUInt32LE(binary.length, 0);
  chunk.writeUInt32LE(0x004e4942, 4);
  return Buffer.concat([head, padded, chunk, binary]);
}

/** GLB whose attributes are all read from the same bytes, each element one byte after the other. */
export function overlappingAccessors(bytes = 32 << 20) {
  const binary = Buffer.alloc(bytes);
  for (let i = 0; i < bytes; i += 150) binary[i] = Math.imul(i, 2654435761) >>> 24; // compresses to about 1/60
  const view = { bufferView: 0, componentType: 5121, count: bytes - 4 };
  return glb(
    {
      asset: { version: '2.0' },
      buffers: [{ byteLength: bytes }],
      bufferViews: [{ buffer: 0, byteLength: bytes, byteStride: 1 }],
      accessors: ['VEC3', 'VEC4', 'VEC2'].map((type) => ({ ...view, type })),
      meshes: [{ primitives: [{ attributes: { POSITION: 0, NORMAL: 0, COLOR_0: 1, TEXCOORD_0: 2 } }] }],
    },
    binary,
  );
}

/** GLB whose primitives all name one accessor of indices. */
export function sharedIndices(indices = 2 << 20, primitives = 2000) {
  return glb(
    {
      asset: { version: '2.0' },
      buffers: [{ byteLength: indices }],
      bufferViews: [{ buffer: 0, byteLength: indices }],
      accessors: [
        { bufferView: 0, componentType: 5121, type: 'SCALAR', count: indices },
        { bufferView: 0, componentType: 5126, type: 'VEC3', count: 4 },
      ],
      meshes: [{ primitives: Array(primitives).fill({ mode: 5, indices: 0, attributes: { POSITION: 1 } }) }],
    },
    Buffer.alloc(indices),
  );
}

/** GLB with many primitives that have one compressed mesh. */
export function sharedDraco(bytes, primitives = 200) {
  const extensions = { KHR_draco_mesh_compression: { bufferView: 0, attributes: {} } };
  return glb(
    {
      asset: { version: '2.0' },
      buffers: [{ byteLength: bytes.length }],
      bufferViews: [{ buffer: 0, byteLength: bytes.length }],
      accessors: [{ componentType: 5125, count: 3, type: 'SCALAR' }],
      meshes: [{ primitives: Array(primitives).fill({ attributes: {}, indices: 0, extensions }) }],
    },
    bytes,
  );
}

/** Draco's bytes of a mesh that says it has 2^27 faces, by the method that breaks edges (1) or lists faces (0). */
export function manyFaces(method) {
  const faces = [0x80, 0x80, 0x80, 0x40]; // 2^27 in groups of seven bits, the lowest first
  const rest = method ? [0, 3, ...faces, 0, 1] : [...faces, 3, 0];
  return Buffer.concat([Buffer.from('DRACO'), Buffer.from([2, 2, 1, method, 0, 0, ...rest]), Buffer.alloc(64)]);
}

/** Draco's bytes of a tetrahedron whose values are said to be coded with 64 symbols for each of so many bytes: their table
 * has 12 bytes a symbol. That it is not valid shows only once it is filled. */
export function symbolTable(bytes) {
  const corners = [0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2];
  const positions = [1, 1, 0, 5, 3, 0, 0, 1, 0xfe, 1, 1, 18]; // integers that are not predicted, in one table
  const symbols = [];
  for (let rest = 64 * bytes; rest > 0; rest >>>= 7) symbols.push((rest & 127) | (rest > 127 ? 128 : 0));
  const head = [2, 2, 1, 0, 0, 0, 4, 4, 1, ...corners, ...positions, ...symbols];
  return Buffer.concat([Buffer.from('DRACO'), Buffer.from(head), Buffer.alloc(bytes, 0xff)]);
}

/** glTF with one mesh of a long name, which many nodes show. */
export function longName(length = 1_000_000, nodes = 90_000) {
  const mesh = { name: 'x'.repeat(length), primitives: [] };
  return Buffer.from(
    JSON.stringify({ asset: { version: '2.0' }, meshes: [mesh], nodes: Array(nodes).fill({ mesh: 0 }) }),
  );
}

/** OBJ with few vertices and many triangles: once it is split and filled, a surface with thousands of handles whose
 * vertices have hundreds of edges. */
export function soup(triangles = 100_000, vertices = 400) {
  let seed = 1;
  const random = (most) => {
    seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
    return Math.floor((seed / 2 ** 32) * most);
  };
  const lines = Array.from({ length: vertices }, () => `v ${random(1000)} ${random(1000)} ${random(1000)}\n`);
  while (lines.length < vertices + triangles) {
    const corners = [0, 1, 2].map(() => 1 + random(vertices));
    if (new Set(corners).size === 3) lines.push(`f ${corners.join(' ')}\n`);
  }
  return Buffer.from(lines.join(''));
}

/** OBJ with one polygon: a star that runs around many times. */
export function hugePolygon(corners = 5_000_000) {
  const star = 'v 3 0 0\nv 1 1 0\nv 0 3 0\nv -1 1 0\nv -3 0 0\nv -1 -1 0\nv 0 -3 0\nv 1 -1 0\nf';
  return Buffer.from(`${star}${' 1 2 3 4 5 6 7 8'.repeat(corners / 8)}\n`);
}

/** An OBJ file with so many megabytes of comments, which compress well, but not beyond max-ratio. */
export function padded(megabytes, obj) {
  const line = () => `# ${randomBytes(64).toString('hex')}${'x'.repeat(16_253)}\n`;
  return Buffer.from(obj + Array.from({ length: 64 * megabytes }, line).join(''));
}
