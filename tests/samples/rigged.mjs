// A rigged character as exporters write it, made against the glTF 2.0 specification: a body closed across the seams of
// its texture coordinates and of its two materials, 20 joints, a normal map, an animation of the joints and of a morph
// target, eyes that are meshes of their own, a camera, extras and an extension that nobody knows.
import { writePng } from '../scenario/support/png.mjs';

const COLUMNS = 24;
const ROWS = 17;
const JOINTS = 20;
const HEIGHT = 2;

/** The body: rings of vertices from the lower pole to the upper one, the first column again at the end. */
function grid() {
  const vertices = [];
  for (let r = 0; r <= ROWS; r++)
    for (let c = 0; c <= COLUMNS; c++) {
      const up = (Math.PI * r) / ROWS;
      const round = (2 * Math.PI * (c % COLUMNS)) / COLUMNS;
      const pole = r === 0 || r === ROWS;
      const wide = pole ? 0 : Math.sin(up);
      const normal = [wide * Math.cos(round), pole ? (r ? 1 : -1) : -Math.cos(up), wide * Math.sin(round)];
      vertices.push({
        position: [0.6 * normal[0], (HEIGHT / 2) * (1 + normal[1]), 0.45 * normal[2]],
        normal,
        tangent: [-Math.sin(round), 0, Math.cos(round), 1],
        uv: [c / COLUMNS, 1 - r / ROWS],
      });
    }
  return vertices;
}

/** The triangles of the rows from `first` to before `end`, and the vertices that they use. */
function band(vertices, first, end) {
  const used = vertices.slice(first * (COLUMNS + 1), (end + 1) * (COLUMNS + 1));
  const triangles = [];
  for (let r = first; r < end; r++)
    for (let c = 0; c < COLUMNS; c++) {
      const at = (r - first) * (COLUMNS + 1) + c;
      const above = at + COLUMNS + 1;
      if (r > 0) triangles.push([at, above, at + 1]);
      if (r < ROWS - 1) triangles.push([at + 1, above, above + 1]);
    }
  return { vertices: used, triangles };
}

/** @returns {{bytes: Buffer, surface: {positions: number[][], triangles: number[][]}}} the GLB, and its closed surface */
/** edit: changes the document before it is written. */
export function rigged({ edit = () => {} } = {}) {
  const parts = [];
  const gltf = {
    asset: { version: '2.0', generator: 'a modelling program', copyright: 'nobody' },
    extensionsUsed: ['VENDOR_notes'],
    extensions: { VENDOR_notes: { kept: [1, 0.1, 1e-7, 'ä"\\'] } },
    extras: { precise: 0.1234567890123456, list: [true, null] },
    scene: 0,
    scenes: [{ name: 'stage', nodes: [0, 1, 2, 23] }],
    bufferViews: [],
    accessors: [],
  };
  const view = (bytes, more = {}) => {
    const byteOffset = parts.reduce((n, p) => n + p.length, 0);
    parts.push(bytes, Buffer.alloc((4 - (bytes.length % 4)) % 4));
    return gltf.bufferViews.push({ buffer: 0, byteOffset, byteLength: bytes.length, ...more }) - 1;
  };
  const list = (values, type, componentType, { bounded, attribute } = {}) => {
    const kind = { 5121: Uint8Array, 5123: Uint16Array, 5126: Float32Array }[componentType];
    const array = kind.from(values.flat());
    const accessor = { componentType, count: values.length, type };
    accessor.bufferView = view(Buffer.from(array.buffer), attribute === false ? {} : { target: attribute ?? 34962 });
    if (bounded) {
      const width = array.length / values.length;
      const column = (k) => values.map((_, i) => array[i * width + k]);
      accessor.min = Array.from({ length: width }, (_, k) => Math.min(...column(k)));
      accessor.max = Array.from({ length: width }, (_, k) => Math.max(...column(k)));
    }
    return gltf.accessors.push(accessor) - 1;
  };
  const floats = (values, more) => list(values, `VEC${values[0].length}`, 5126, more);
  const numbers = (values, bounded) => list(values, 'SCALAR', 5126, { attribute: false, bounded });

  const jointAt = (y) => Math.min(JOINTS - 1.001, Math.max(0, (y / HEIGHT) * (JOINTS - 1)));
  const primitive = ({ vertices, triangles }, material) => {
    const at = vertices.map((v) => jointAt(v.position[1]));
    const shift = (v) => (v.position[1] > 1.4 ? [0, 0.05 * (v.position[1] - 1.4), 0] : [0, 0, 0]);
    return {
      attributes: {
        POSITION: floats(
          vertices.map((v) => v.position),
          { bounded: true },
        ),
        NORMAL: floats(vertices.map((v) => v.normal.map((x) => x / Math.hypot(...v.normal)))),
        TANGENT: floats(vertices.map((v) => v.tangent)),
        TEXCOORD_0: floats(vertices.map((v) => v.uv)),
        TEXCOORD_1: floats(vertices.map((v) => v.uv.map((x) => x / 2))),
        JOINTS_0: list(
          at.map((x) => [Math.floor(x), x % 1 ? Math.floor(x) + 1 : 0, 0, 0]),
          'VEC4',
          5121,
        ),
        WEIGHTS_0: floats(at.map((x) => [Math.fround(1 - (x % 1)), 1 - Math.fround(1 - (x % 1)), 0, 0])),
      },
      indices: list(
        triangles.flat().map((v) => [v]),
        'SCALAR',
        5123,
        { attribute: 34963 },
      ),
      material,
      targets: [{ POSITION: floats(vertices.map(shift), { bounded: true }) }],
    };
  };
  const all = grid();
  const half = Math.floor(ROWS / 2);
  const bands = [band(all, 0, half), band(all, half, ROWS)];
  const eye = {
    attributes: {
      POSITION: floats(
        [
          [1, 1, 1],
          [-1, -1, 1],
          [-1, 1, -1],
          [1, -1, -1],
        ],
        { bounded: true },
      ),
    },
    indices: list(
      [0, 1, 3, 0, 2, 1, 0, 3, 2, 1, 2, 3].map((v) => [v]),
      'SCALAR',
      5123,
      { attribute: 34963 },
    ),
  };
  gltf.meshes = [
    { name: 'eye', primitives: [eye] },
    {
      name: 'Body',
      primitives: bands.map(primitive),
      weights: [0.25],
      extras: { targetNames: ['smile'], author: 'someone' },
    },
  ];
  const pixels = (rgb) => writePng(4, 4, () => rgb);
  gltf.images = [
    { name: 'bumps', bufferView: view(pixels([128, 128, 255])), mimeType: 'image/png' },
    { name: 'skin', bufferView: view(pixels([230, 180, 150])), mimeType: 'image/png' },
  ];
  gltf.samplers = [{ magFilter: 9729, minFilter: 9987, wrapS: 33071 }];
  gltf.textures = [
    { source: 0, sampler: 0 },
    { source: 1, sampler: 0 },
  ];
  gltf.materials = [
    { name: 'trousers', pbrMetallicRoughness: { baseColorFactor: [0.2, 0.3, 0.6, 1], roughnessFactor: 0.9 } },
    {
      name: 'skin',
      pbrMetallicRoughness: { baseColorTexture: { index: 1 }, metallicFactor: 0 },
      normalTexture: { index: 0, scale: 0.5 },
    },
  ];
  gltf.cameras = [{ type: 'perspective', perspective: { yfov: 0.8, znear: 0.1 } }];
  const spacing = HEIGHT / (JOINTS - 1);
  const joint = (j) => ({
    name: `joint ${j}`,
    translation: [0, j ? spacing : 0, 0],
    ...(j + 1 < JOINTS ? { children: [j + 4] } : {}),
  });
  gltf.nodes = [
    { name: 'body', mesh: 1, skin: 0 },
    { name: 'left eye', mesh: 0, translation: [0.15, 1.7, 0.5], scale: [0.05, 0.05, 0.05] },
    { name: 'right eye', mesh: 0, translation: [-0.15, 1.7, 0.5], scale: [0.05, 0.05, 0.05] },
    ...Array.from({ length: JOINTS }, (_, j) => joint(j)),
    { name: 'view', camera: 0, translation: [0, 1, 5], extras: { shot: 3 } },
  ];
  gltf.scenes[0].nodes = [0, 1, 2, 3, 23];
  const inverse = Array.from({ length: JOINTS }, (_, j) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -j * spacing, 0, 1]);
  gltf.skins = [
    {
      joints: Array.from({ length: JOINTS }, (_, j) => j + 3),
      skeleton: 3,
      inverseBindMatrices: list(inverse, 'MAT4', 5126, { attribute: false }),
    },
  ];
  const turn = (angle) => [0, 0, Math.sin(angle / 2), Math.cos(angle / 2)];
  const input = numbers([[0], [0.5], [1]], true);
  gltf.animations = [
    {
      name: 'wave',
      channels: [
        { sampler: 0, target: { node: 12, path: 'rotation' } },
        { sampler: 1, target: { node: 0, path: 'weights' } },
      ],
      samplers: [
        { input, output: list([turn(0), turn(0.6), turn(0)], 'VEC4', 5126, { attribute: false }) },
        { input, output: numbers([[0], [0.75], [0.25]]), interpolation: 'STEP' },
      ],
    },
  ];

  const bin = Buffer.concat(parts);
  gltf.buffers = [{ byteLength: bin.length }];
  edit(gltf);
  const text = Buffer.from(JSON.stringify(gltf));
  const json = Buffer.concat([text, Buffer.alloc((4 - (text.length % 4)) % 4, ' ')]);
  const head = Buffer.alloc(20);
  const second = Buffer.alloc(8);
  head.write('glTF');
  [2, 28 + json.length + bin.length, json.length].forEach((n, i) => head.writeUInt32LE(n, 4 + 4 * i));
  head.write('JSON', 16);
  second.writeUInt32LE(bin.length, 0);
  second.write('BIN\0', 4, 'latin1');
  let first = 0;
  const triangles = bands.flatMap((b) => {
    const from = first;
    first += b.vertices.length;
    return b.triangles.map((t) => t.map((v) => v + from));
  });
  return {
    bytes: Buffer.concat([head, json, second, bin]),
    surface: { positions: bands.flatMap((b) => b.vertices.map((v) => v.position.map(Math.fround))), triangles },
  };
}
