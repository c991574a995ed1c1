// Two shapes on one icosphere: as OBJ files, and merged as a GLB with one morph target.

const GOLDEN = (1 + Math.sqrt(5)) / 2;
const CORNERS = [
  [-1, GOLDEN, 0],
  [1, GOLDEN, 0],
  [-1, -GOLDEN, 0],
  [1, -GOLDEN, 0],
  [0, -1, GOLDEN],
  [0, 1, GOLDEN],
  [0, -1, -GOLDEN],
  [0, 1, -GOLDEN],
  [GOLDEN, 0, -1],
  [GOLDEN, 0, 1],
  [-GOLDEN, 0, -1],
  [-GOLDEN, 0, 1],
];
const SIDES =
  '0 11 5, 0 5 1, 0 1 7, 0 7 10, 0 10 11, 1 5 9, 5 11 4, 11 10 2, 10 7 6, 7 1 8, 3 9 4, 3 4 2, 3 2 6, 3 6 8, 3 8 9, 4 9 5, 2 4 11, 6 2 10, 8 6 7, 9 8 1'
    .split(', ')
    .map((side) => side.split(' ').map(Number));

/** A sphere of 20·parts² triangles: each edge of an icosahedron has so many parts. */
export function icosphere(parts) {
  const points = [];
  const faces = [];
  const known = new Map();
  /** The number of a point of a side, which its neighbours may have added. */
  const numberOf = ([a, b, c], j, k) => {
    const weighted = [
      [a, parts - j - k],
      [b, j],
      [c, k],
    ].filter(([, weight]) => weight > 0);
    const key = weighted
      .sort(([v], [w]) => v - w)
      .flat()
      .join(' ');
    if (!known.has(key)) {
      const p = [0, 1, 2].map((axis) => weighted.reduce((sum, [v, weight]) => sum + weight * CORNERS[v][axis], 0));
      known.set(key, known.size);
      points.push(...p.map((x) => x / Math.hypot(...p)));
    }
    return known.get(key);
  };
  for (const side of SIDES)
    for (let j = 0; j < parts; j++)
      for (let k = 0; k < parts - j; k++) {
        const [here, right, up] = [numberOf(side, j, k), numberOf(side, j + 1, k), numberOf(side, j, k + 1)];
        faces.push(here, right, up);
        if (j + k < parts - 1) faces.push(right, numberOf(side, j + 1, k + 1), up);
      }
  return { points: Float64Array.from(points), faces: Uint32Array.from(faces) };
}

const RADII = [
  (x, y) => 1 + 0.35 * Math.sin(5 * x) * Math.cos(4 * y),
  (_x, y, z) => 1 + 0.5 * Math.max(0, y) ** 4 + 0.3 * Math.cos(6 * z),
];

function placed({ points }, radius) {
  const out = new Float32Array(points.length);
  for (let i = 0; i < points.length; i += 3) {
    const r = radius(points[i], points[i + 1], points[i + 2]);
    for (let k = 0; k < 3; k++) out[i + k] = points[i + k] * r;
  }
  return out;
}

/** The two files. */
export function objFiles(sphere) {
  return RADII.map((radius) => {
    const p = placed(sphere, radius);
    const lines = [];
    for (let i = 0; i < p.length; i += 3)
      lines.push(`v ${p[i].toFixed(6)} ${p[i + 1].toFixed(6)} ${p[i + 2].toFixed(6)}`);
    for (let f = 0; f < sphere.faces.length; f += 3)
      lines.push(`f ${sphere.faces[f] + 1} ${sphere.faces[f + 1] + 1} ${sphere.faces[f + 2] + 1}`);
    return Buffer.from(`${lines.join('\n')}\n`);
  });
}

function normalsOf(p, faces) {
  const n = new Float32Array(p.length);
  for (let f = 0; f < faces.length; f += 3) {
    const [a, b, c] = [3 * faces[f], 3 * faces[f + 1], 3 * faces[f + 2]];
    const ux = p[b] - p[a];
    const uy = p[b + 1] - p[a + 1];
    const uz = p[b + 2] - p[a + 2];
    const vx = p[c] - p[a];
    const vy = p[c + 1] - p[a + 1];
    const vz = p[c + 2] - p[a + 2];
    for (const q of [a, b, c]) {
      n[q] += uy * vz - uz * vy;
      n[q + 1] += uz * vx - ux * vz;
      n[q + 2] += ux * vy - uy * vx;
    }
  }
  for (let i = 0; i < n.length; i += 3) {
    const l = Math.hypot(n[i], n[i + 1], n[i + 2]);
    for (let k = 0; k < 3; k++) n[i + k] /= l;
  }
  return n;
}

export function glb(sphere) {
  const places = RADII.map((radius) => placed(sphere, radius));
  const normals = places.map((p) => normalsOf(p, sphere.faces));
  const bufferViews = [];
  const accessors = [];
  const pieces = [];
  let size = 0;
  const add = (array, type, componentType) => {
    const piece = Buffer.from(array.buffer);
    bufferViews.push({ buffer: 0, byteOffset: size, byteLength: piece.length });
    const width = type === 'VEC3' ? 3 : 1;
    accessors.push({
      bufferView: bufferViews.length - 1,
      componentType,
      count: array.length / width,
      type,
      ...(width === 3 && { min: [-2, -2, -2], max: [2, 2, 2] }),
    });
    pieces.push(piece);
    size += piece.length;
    return accessors.length - 1;
  };
  const minus = (a, b) => a.map((x, i) => x - b[i]);
  const attributes = { POSITION: add(places[0], 'VEC3', 5126), NORMAL: add(normals[0], 'VEC3', 5126) };
  const indices = add(sphere.faces, 'SCALAR', 5125);
  const targets = [
    {
      POSITION: add(minus(places[1], places[0]), 'VEC3', 5126),
      NORMAL: add(minus(normals[1], normals[0]), 'VEC3', 5126),
    },
  ];
  let json = JSON.stringify({
    asset: { version: '2.0' },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes, indices, targets }], weights: [0], extras: { targetNames: ['b'] } }],
    accessors,
    bufferViews,
    buffers: [{ byteLength: size }],
  });
  json += ' '.repeat((4 - (json.length % 4)) % 4);
  const head = Buffer.alloc(20);
  [0x46546c67, 2, 28 + json.length + size, json.length, 0x4e4f534a].forEach((x, i) => head.writeUInt32LE(x, 4 * i));
  const second = Buffer.alloc(8);
  second.writeUInt32LE(size, 0);
  second.writeUInt32LE(0x4e4942, 4);
  return Buffer.concat([head, Buffer.from(json), second, ...pieces]);
}
