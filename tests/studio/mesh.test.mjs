// Checks the studio's own readers and measures with small files and straightforward computations.
import { before, test } from 'node:test';
import assert from 'node:assert/strict';
import { createRequire } from 'node:module';
import { readFile, mkdtemp } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { writeGlb } from '../scenario/support/glb_write.mjs';
import { ball } from '../scenario/support/shapes.mjs';
import { root, sample } from './support.mjs';

let mesh;
before(async () => {
  const require = createRequire(join(root, 'client/web/package.json'));
  const { build } = require('esbuild');
  const out = join(await mkdtemp(join(tmpdir(), 'orbmorph-mesh-')), 'mesh.mjs');
  await build({
    stdin: {
      contents: [
        'parse',
        'geometry',
        'bvh',
        'morph',
        'distortion',
        'symmetry',
        'repairs',
        'refusal',
        'marks',
        'trouble',
        'dress',
        'others',
        'mended',
        'meshopt',
      ]
        .map((name) => `export * from './${name}.ts';`)
        .concat(`export { count, relative } from '../words.ts';`)
        .join('\n'),
      resolveDir: join(root, 'client/web/src/mesh'),
      loader: 'ts',
    },
    bundle: true,
    external: ['three/*'],
    format: 'esm',
    target: 'node18',
    outfile: out,
  });
  mesh = await import(pathToFileURL(out));
});

const text = (string) => new TextEncoder().encode(string).buffer;
const file = async (path) => {
  const bytes = await readFile(path);
  return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
};
const TETRAHEDRON = [
  [0, 0, 0],
  [1, 0, 0],
  [0, 1, 0],
  [0, 0, 1],
];
const FACES = [
  [0, 2, 1],
  [0, 1, 3],
  [1, 2, 3],
  [0, 3, 2],
];

test('OBJ: numbers, slashes, negative indices, polygons, comments, line ends', () => {
  const raw = mesh.parseMesh(
    text(
      '# a comment\r\nv 0 0 0\r\nv 1e0 .0 -0\r\nv 0 1. 0\nv 1 1 0 1.0\nv 0 0 +2.5e-1\nvn 0 0 1\nf 1/1/1 2//1 4 3\nf -1 -5 -4\nf 1 2 \\\n 5\n',
    ),
  );
  assert.equal(raw.format, 'obj');
  assert.deepEqual([...raw.positions], [0, 0, 0, 1, 0, -0, 0, 1, 0, 1, 1, 0, 0, 0, 0.25]);
  assert.deepEqual([...raw.corners], [0, 1, 3, 0, 3, 2, 4, 0, 1, 0, 1, 4]);
});

test('OFF: counts on the first line or the next, comments, colours after faces', () => {
  for (const head of ['OFF\n# c\n4 4 6\n', 'OFF 4 4 6\n', 'OFF\n4 4 0\n']) {
    const raw = mesh.parseMesh(
      text(
        head +
          TETRAHEDRON.map((p) => p.join(' ')).join('\n') +
          '\n' +
          FACES.map((f) => `3 ${f.join(' ')} 255 0 0`).join('\n'),
      ),
    );
    assert.deepEqual([...raw.corners], FACES.flat());
    assert.deepEqual([...raw.positions], TETRAHEDRON.flat());
  }
});

test('PLY: text, binary in both orders, other properties and elements', () => {
  const header = (format) =>
    `ply\nformat ${format} 1.0\ncomment c\nelement vertex 4\nproperty uchar red\nproperty double x\nproperty float y\nproperty float z\nelement face 4\nproperty list uchar int vertex_indices\nproperty uchar flag\nend_header\n`;
  const ascii = mesh.parseMesh(
    text(
      header('ascii') +
        TETRAHEDRON.map((p) => `7 ${p.join(' ')}`).join('\n') +
        '\n' +
        FACES.map((f) => `3 ${f.join(' ')} 9`).join('\n') +
        '\n',
    ),
  );
  assert.deepEqual([...ascii.corners], FACES.flat());
  for (const little of [true, false]) {
    const head = new TextEncoder().encode(header(little ? 'binary_little_endian' : 'binary_big_endian'));
    const data = new DataView(new ArrayBuffer(4 * 17 + 4 * 14));
    let at = 0;
    for (const p of TETRAHEDRON) {
      data.setUint8(at, 7);
      data.setFloat64(at + 1, p[0], little);
      data.setFloat32(at + 9, p[1], little);
      data.setFloat32(at + 13, p[2], little);
      at += 17;
    }
    for (const f of FACES) {
      data.setUint8(at, 3);
      f.forEach((v, k) => data.setInt32(at + 1 + 4 * k, v, little));
      data.setUint8(at + 13, 9);
      at += 14;
    }
    const whole = new Uint8Array(head.length + data.byteLength);
    whole.set(head);
    whole.set(new Uint8Array(data.buffer), head.length);
    const raw = mesh.parseMesh(whole.buffer);
    assert.deepEqual([...raw.positions], TETRAHEDRON.flat());
    assert.deepEqual([...raw.corners], FACES.flat());
    assert.deepEqual([...raw.properties.get('red')], [7, 7, 7, 7]);
  }
});

test('PLY: colours of eight and of sixteen bits, and as floats, are the same colours', () => {
  const dyed = (type, names, of) =>
    mesh.parseMesh(
      text(
        `ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n${names
          .map((name) => `property ${type} ${name}\n`)
          .join('')}element face 4\nproperty list uchar int vertex_indices\nend_header\n${TETRAHEDRON.map(
          (p) => `${p.join(' ')} ${[0, 51, 255].map(of).join(' ')}\n`,
        ).join('')}${FACES.map((f) => `3 ${f.join(' ')}\n`).join('')}`,
      ),
    ).dress.dye;
  const rgb = ['red', 'green', 'blue'];
  const eight = dyed('uchar', rgb, (x) => x);
  // IEC 61966-2-1: 0.2 of sRGB is ((0.2 + 0.055) / 1.055) ^ 2.4 of linear light
  [0, ((0.2 + 0.055) / 1.055) ** 2.4, 1].forEach((x, k) =>
    assert.ok(Math.abs(eight[k] - x) < 1e-6, `${eight[k]}, ${x}`),
  );
  const same = (other, what) => other.forEach((x, i) => assert.ok(Math.abs(x - eight[i]) < 1e-6, `${what}: ${x}`));
  same(
    dyed('ushort', rgb, (x) => 257 * x),
    'sixteen bits',
  );
  same(
    dyed('float', rgb, (x) => x / 255),
    'floats',
  );
  same(
    dyed('float', rgb, (x) => x),
    'bytes as floats',
  );
  same(
    dyed(
      'uchar',
      rgb.map((name) => `diffuse_${name}`),
      (x) => x,
    ),
    'diffuse_red',
  );
});

test('glTF: primitives that look the same share a cover and an image', () => {
  const glb = (edit) =>
    writeGlb({
      positions: TETRAHEDRON,
      uv: TETRAHEDRON.map(([u, v]) => [u, v]),
      triangles: FACES,
      image: Buffer.from('not decoded here'),
      edit: (gltf) => {
        const [first] = gltf.meshes[0].primitives;
        gltf.meshes[0].primitives = Array.from({ length: 40 }, () => ({ ...first }));
        edit(gltf);
      },
    });
  const dressOf = (edit) => {
    const bytes = glb(edit);
    return mesh.parseMesh(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength)).dress;
  };
  const alike = dressOf(() => {});
  assert.equal(alike.covers.length, 1);
  assert.equal(alike.images.length, 1);
  const two = dressOf((gltf) => {
    const red = structuredClone(gltf.materials[0]);
    red.pbrMetallicRoughness.baseColorFactor = [1, 0, 0, 1];
    const number = gltf.materials.push(red) - 1;
    for (let i = 1; i < 40; i += 2) gltf.meshes[0].primitives[i].material = number;
  });
  assert.equal(two.covers.length, 2);
  assert.equal(two.images.length, 1);
  assert.deepEqual(
    [...two.cover.filter((_, v) => v % 4 === 0)],
    Array.from({ length: 40 }, (_, i) => i % 2),
  );
});

test('a vertex of many looks is split once for each, in time that grows with their number', () => {
  const looks = 3000;
  // a fan: the drawn vertex 0 is its centre, at which every triangle has texture coordinates of its own
  const corners = new Uint32Array(3 * looks);
  const index = new Uint32Array(3 * looks);
  const uv = new Float32Array(2 * 3 * looks);
  for (let t = 0; t < looks; t++)
    for (let c = 0; c < 3; c++) {
      corners[3 * t + c] = 3 * t + c;
      index[3 * t + c] = c ? 1 + ((t + c) % looks) : 0;
      uv.set(c ? [2, index[3 * t + c]] : [t >> 1, 3], 2 * (3 * t + c)); // neighbours share a look
    }
  let reads = 0;
  const counted = new Proxy(uv, {
    get: (array, key) => {
      reads++;
      const value = array[key];
      return typeof value === 'function' ? value.bind(array) : value;
    },
  });
  const dress = { uv: counted, dye: null, cover: new Uint16Array(3 * looks), covers: [], images: [] };
  const { from, skin } = mesh.splitByLook(dress, corners, index, 1 + looks);
  assert.equal(from.length, 1 + looks + looks / 2 - 1);
  assert.ok(
    index.every((at, c) => skin.uv[2 * at] === uv[2 * c] && skin.uv[2 * at + 1] === uv[2 * c + 1]),
    'every corner keeps its look',
  );
  assert.ok(reads < 30 * corners.length, `${reads} reads for ${corners.length} corners`);
});

test('STL: corner k of facet i is vertex 3i + k, in text and binary', () => {
  const solid =
    'solid s\n' +
    FACES.map(
      (f) =>
        `facet normal 0 0 0\nouter loop\n${f.map((v) => `vertex ${TETRAHEDRON[v].join(' ')}`).join('\n')}\nendloop\nendfacet\n`,
    ).join('') +
    'endsolid s\n';
  const binary = new DataView(new ArrayBuffer(84 + 50 * 4));
  binary.setUint32(80, 4, true);
  FACES.forEach((f, i) =>
    f.forEach((v, c) =>
      TETRAHEDRON[v].forEach((x, k) => binary.setFloat32(84 + 50 * i + 12 + 12 * c + 4 * k, x, true)),
    ),
  );
  for (const raw of [mesh.parseMesh(text(solid)), mesh.parseMesh(binary.buffer)]) {
    assert.equal(raw.format, 'stl');
    assert.deepEqual(
      [...raw.positions],
      FACES.flat().flatMap((v) => TETRAHEDRON[v]),
    );
    assert.deepEqual([...raw.corners], [...Array(12).keys()]);
  }
  const display = mesh.buildDisplay(mesh.parseMesh(binary.buffer));
  assert.equal(new Set(display.edges).size > 0, true);
  assert.equal(mesh.defectiveEdges(mesh.parseMesh(binary.buffer), true).length, 0, 'closed once welded');
  assert.equal(mesh.defectiveEdges(mesh.parseMesh(binary.buffer), false).length, 24, 'every edge open in the file');
});

test('glTF: accessors of all primitives one after another, after node transforms', () => {
  const positions = Buffer.from(Float32Array.from(TETRAHEDRON.flat()).buffer);
  const indices = Buffer.from(Uint16Array.from(FACES.flat()).buffer);
  const data = Buffer.concat([positions, indices]).toString('base64');
  const json = {
    asset: { version: '2.0' },
    scenes: [{ nodes: [0] }],
    nodes: [
      { children: [1], translation: [10, 0, 0] },
      { mesh: 0, scale: [2, 2, 2] },
    ],
    meshes: [
      {
        primitives: [
          { attributes: { POSITION: 0 }, indices: 1 },
          { attributes: { POSITION: 0 }, indices: 1, mode: 1 },
          { attributes: { POSITION: 0 }, indices: 1 },
        ],
      },
    ],
    accessors: [
      { bufferView: 0, componentType: 5126, count: 4, type: 'VEC3' },
      { bufferView: 1, componentType: 5123, count: 12, type: 'SCALAR' },
    ],
    bufferViews: [
      { buffer: 0, byteLength: 48 },
      { buffer: 0, byteOffset: 48, byteLength: 24 },
    ],
    buffers: [{ byteLength: 72, uri: `data:application/octet-stream;base64,${data}` }],
  };
  const raw = mesh.parseMesh(text(JSON.stringify(json)));
  assert.deepEqual(
    [...raw.positions.slice(0, 12)],
    TETRAHEDRON.flatMap(([x, y, z]) => [10 + 2 * x, 2 * y, 2 * z]),
  );
  assert.deepEqual([...raw.corners], [...FACES.flat(), ...FACES.flat().map((v) => v + 4)]);
});

test('glTF: strips and fans, sparse and quantized accessors', () => {
  // the tetrahedron as a strip that repeats a vertex, as a fan and a triangle, and as triangles without indices
  const lists = [
    [0, 2, 1, 3, 0, 0, 2],
    [0, 2, 1, 3, 2],
    [1, 2, 3],
  ];
  const integers = Int16Array.from([...TETRAHEDRON.flat().map((x) => 32767 * x), ...Array(12).fill(0)]);
  const values = Float32Array.from(TETRAHEDRON.slice(1).flat());
  const parts = [integers, Uint16Array.from([1, 2, 3, 0]), values, ...lists.map((l) => Uint16Array.from([...l, 0]))];
  const blocks = parts.map((list) => Buffer.from(list.buffer));
  let at = 0;
  const bufferViews = blocks.map(({ length }) => ({
    buffer: 0,
    byteOffset: (at += length) - length,
    byteLength: length,
  }));
  const sparse = { count: 3, indices: { bufferView: 1, componentType: 5123 }, values: { bufferView: 2 } };
  const json = {
    asset: { version: '2.0' },
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [
      {
        primitives: [
          { attributes: { POSITION: 0 }, indices: 2, mode: 5 },
          { attributes: { POSITION: 1 }, indices: 3, mode: 6 },
          { attributes: { POSITION: 1 }, indices: 4 },
          { attributes: { POSITION: 0 }, mode: 1 },
        ],
      },
    ],
    accessors: [
      { bufferView: 0, componentType: 5122, normalized: true, count: 4, type: 'VEC3' },
      { componentType: 5126, count: 4, type: 'VEC3', sparse },
      ...lists.map((l, i) => ({ bufferView: 3 + i, componentType: 5123, count: l.length, type: 'SCALAR' })),
    ],
    bufferViews,
    buffers: [
      { byteLength: at, uri: `data:application/octet-stream;base64,${Buffer.concat(blocks).toString('base64')}` },
    ],
  };
  const raw = mesh.parseMesh(text(JSON.stringify(json)));
  assert.deepEqual(
    [...raw.positions],
    [0, 1, 2].flatMap(() => TETRAHEDRON.flat()),
  );
  const found = [];
  for (let i = 0; i < raw.corners.length; i += 3) found.push([...raw.corners.subarray(i, i + 3)]);
  assert.deepEqual(found, [
    [0, 2, 1],
    [2, 3, 1],
    [1, 3, 0],
    [6, 5, 4],
    [5, 7, 4],
    [7, 6, 4],
    [9, 10, 11],
  ]);
});

test('what cannot be drawn is omitted, and invalid files do not throw', () => {
  const raw = mesh.parseMesh(text('v 0 0 0\nv 1 0 0\nv nan 1 0\nv 0 1 0\nf 1 2 4\nf 1 2 3\nf 1 2 9\n'));
  assert.deepEqual([...raw.corners], [0, 1, 3]);
  assert.equal(mesh.parseMesh(text('Dear Sir or Madam')).corners.length, 0);
  assert.equal(mesh.parseMesh(new ArrayBuffer(0)).corners.length, 0);
});

test('the samples are closed, and their geometry is that of the files', async () => {
  for (const [name, triangles] of [
    ['dog.obj', 5600],
    ['giraffe.off', null],
    ['elephant.ply', 5400],
  ]) {
    const raw = mesh.parseMesh(await file(sample(name)));
    if (triangles) assert.equal(raw.corners.length / 3, triangles);
    assert.equal(mesh.defectiveEdges(raw, false).length, 0, name);
    const display = mesh.buildDisplay(raw);
    assert.equal(mesh.edgesOf(raw.corners).length / 2, (raw.corners.length / 3) * 1.5, 'edges = 3/2 triangles');
    let far = 0;
    for (let i = 0; i < display.position.length; i += 3)
      far = Math.max(far, Math.hypot(display.position[i], display.position[i + 1], display.position[i + 2]));
    assert.ok(far <= 1.0001 && far > 0.5, `${name} fills the unit ball: ${far}`);
    for (let i = 0; i < display.normal.length; i += 3)
      assert.ok(Math.abs(Math.hypot(display.normal[i], display.normal[i + 1], display.normal[i + 2]) - 1) < 1e-4);
  }
});

test('a cube keeps its edges, a sphere has none', () => {
  const cube =
    'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nf 1 5 8 4\n';
  assert.equal(mesh.buildDisplay(mesh.parseMesh(text(cube))).position.length / 3, 24);
  assert.equal(mesh.buildDisplay(mesh.parseMesh(text(cube)), 180).position.length / 3, 8);
});

test('rays and nearest points agree with a search through all triangles', async () => {
  const raw = mesh.parseMesh(await file(sample('dog.obj')));
  const { positions: p, corners } = raw;
  const tree = new mesh.Bvh(p, corners);
  const { center, radius } = mesh.frameOf(p, corners);
  let seed = 7;
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647 - 0.5;
  const at = (v) => [p[3 * v], p[3 * v + 1], p[3 * v + 2]];
  const sub = (a, b) => a.map((x, k) => x - b[k]);
  const dot = (a, b) => a.reduce((s, x, k) => s + x * b[k], 0);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const segment = (x, a, b) => {
    const d = sub(b, a);
    const s = Math.max(0, Math.min(1, dot(sub(x, a), d) / (dot(d, d) || 1)));
    return Math.hypot(
      ...sub(
        x,
        a.map((y, k) => y + s * d[k]),
      ),
    );
  };
  const toTriangle = (x, a, b, c) => {
    const n = cross(sub(b, a), sub(c, a));
    const inside =
      dot(cross(sub(b, a), sub(x, a)), n) >= 0 &&
      dot(cross(sub(c, b), sub(x, b)), n) >= 0 &&
      dot(cross(sub(a, c), sub(x, c)), n) >= 0;
    const flat = Math.abs(dot(sub(x, a), n)) / Math.hypot(...n);
    return inside ? flat : Math.min(segment(x, a, b), segment(x, b, c), segment(x, c, a));
  };
  let hits = 0;
  for (let round = 0; round < 60; round++) {
    const x = center.map((c) => c + 2 * radius * random());
    let least = Infinity;
    for (let t = 0; t < corners.length; t += 3)
      least = Math.min(least, toTriangle(x, at(corners[t]), at(corners[t + 1]), at(corners[t + 2])));
    const found = tree.closest(...x);
    assert.ok(Math.abs(found.t - least) < 1e-9 * radius + 1e-12, `${found.t} and ${least}`);

    const o = center.map((c) => c + 4 * radius * random());
    const d = sub(
      center.map((c) => c + 0.6 * radius * random()),
      o,
    );
    let first = Infinity;
    for (let t = 0; t < corners.length; t += 3) {
      const [a, b, c] = [at(corners[t]), at(corners[t + 1]), at(corners[t + 2])];
      const n = cross(sub(b, a), sub(c, a));
      const s = dot(sub(a, o), n) / dot(d, n);
      const y = o.map((v, k) => v + s * d[k]);
      if (
        s > 0 &&
        s < first &&
        dot(cross(sub(b, a), sub(y, a)), n) >= 0 &&
        dot(cross(sub(c, b), sub(y, b)), n) >= 0 &&
        dot(cross(sub(a, c), sub(y, c)), n) >= 0
      )
        first = s;
    }
    const hit = tree.ray(...o, ...d);
    assert.equal(hit === null, first === Infinity);
    if (hit) {
      hits++;
      assert.ok(Math.abs(hit.t - first) < 1e-9, `${hit.t} and ${first}`);
    }
  }
  assert.ok(hits > 10, 'some rays hit');
});

test('distortion: an isometry has none, a stretch by known factors is found', () => {
  // a plane grid mapped by (x, y) -> (3x, y): both areas are scaled equal, so sigma = sqrt(3) and 1 / sqrt(3)
  const x = Float64Array.from([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0]);
  const corners = Uint32Array.from([0, 1, 2, 0, 2, 3]);
  const same = mesh.triangleDistortion(
    x,
    x.map((v) => 5 * v),
    corners,
  );
  const stretched = mesh.triangleDistortion(
    x,
    x.map((v, i) => (i % 3 === 0 ? 3 * v : v)),
    corners,
  );
  for (let t = 0; t < 2; t++) {
    assert.ok(Math.abs(same.sigma1[t] - 1) < 1e-6 && Math.abs(same.sigma2[t] - 1) < 1e-6);
    assert.ok(Math.abs(stretched.sigma1[t] - Math.sqrt(3)) < 1e-9);
    assert.ok(Math.abs(stretched.sigma2[t] - 1 / Math.sqrt(3)) < 1e-9);
  }
  // legs 1 and 1: circumradius sqrt(2)/2, inradius (2 - sqrt(2))/2
  assert.ok(Math.abs(same.aspect[0] - Math.SQRT1_2 / (2 - Math.SQRT2)) < 1e-9);
});

test('the path through the shapes follows the keyframes', () => {
  const path = {
    times: Float32Array.of(0, 0.5, 1),
    weights: [Float32Array.of(0, 0), Float32Array.of(1, 0), Float32Array.of(0, 1)],
  };
  assert.deepEqual(mesh.weightsAt(path, 0), [0, 0]);
  assert.deepEqual(mesh.weightsAt(path, 0.25), [0.5, 0]);
  assert.deepEqual(mesh.weightsAt(path, 0.5), [1, 0]);
  assert.deepEqual(mesh.weightsAt(path, 0.75), [0.5, 0.5]);
  assert.deepEqual(mesh.weightsAt(path, 1), [0, 1]);
  assert.deepEqual(mesh.weightsAt({ times: Float32Array.of(0), weights: [new Float32Array(0)] }, 0.3), []);
});

test('the path contains the in-betweens of a curved path, but no rests', () => {
  const [zero, b, c, p, q] = [
    [0, 0, 0, 0],
    [1, 0, 0, 0],
    [0, 1, 0, 0],
    [0, 0, 1, 0],
    [0, 0, 0, 1],
  ].map((w) => Float32Array.from(w));
  const path = mesh.pathOf([zero, zero, p, b, b, q, c, c, q, b], [zero, b, c]);
  assert.deepEqual([...path.times], [0, 0.25, 0.5, 0.75, 1]);
  assert.deepEqual(path.weights, [zero, p, b, q, c]);
  assert.deepEqual([...mesh.pathOf([], [zero, b, c]).times], [0, 0.5, 1]);
});

/** The rotation by `angle` around (1, 2, 3), as rows (Rodrigues). */
function turned(angle) {
  const [x, y, z] = [1, 2, 3].map((k) => k / Math.hypot(1, 2, 3));
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const cross = [
    [0, -z, y],
    [z, 0, -x],
    [-y, x, 0],
  ];
  return cross.map((row, i) => row.map((a, j) => (i === j ? c : 0) + s * a + (1 - c) * [x, y, z][i] * [x, y, z][j]));
}

test('the plane of symmetry is found however the shape lies, and only where it is clear', async () => {
  const search = ({ positions, corners }) =>
    mesh.symmetryOf({ positions, corners }, new mesh.Bvh(positions, corners), mesh.frameOf(positions, corners).radius);
  const flat = ({ positions, triangles }) => ({
    positions: Float64Array.from(positions.flat()),
    corners: Uint32Array.from(triangles.flat()),
  });
  // a body that is symmetric in z = 0; its sides have nothing else in common
  const body = flat(ball(3, ([x, y, z]) => [1.6 * x + 0.4 * z * z, y + 0.5 * x * x, (0.7 + 0.25 * x - 0.2 * y) * z]));
  for (const angle of [0, 0.4, 1.1]) {
    const rotation = turned(angle);
    const positions = body.positions.slice();
    for (let i = 0; i < positions.length; i += 3)
      for (let k = 0; k < 3; k++)
        positions[i + k] = 5 + rotation[k].reduce((sum, r, c) => sum + r * body.positions[i + c], 0);
    const { normal, offset } = search({ positions, corners: body.corners });
    const expected = rotation.map((row) => row[2]);
    const cosine = normal.reduce((sum, x, k) => sum + x * expected[k], 0);
    assert.ok(Math.abs(cosine) > 0.99999, `turned by ${angle}: ${normal}, ${expected}`);
    const across = 5 * expected.reduce((sum, x) => sum + x, 0); // the plane of the body goes through 0
    assert.ok(Math.abs(offset * Math.sign(cosine) - across) < 0.002, `${offset}, ${across}`);
  }
  assert.equal(search(flat(ball(3))), null, 'a ball has too many planes');
  assert.equal(search(flat(ball(3, ([x, y, z]) => [1.7 * x, 1.3 * y, z]))), null, 'an ellipsoid has three');
  const bent = ball(3, ([x, y, z]) => [x + 0.4 * y * z, y + 0.5 * x * z * z, z + 0.3 * x * x]);
  assert.equal(search(flat(bent)), null, 'this has none');
});

test('repairs add up; a piece replaces the largest, and a size another size', () => {
  const cases = [
    ['safe', 'safe,fill_holes', 'safe,fill_holes'],
    ['safe,split_nonmanifold', 'safe,largest_component', 'split_nonmanifold,safe,largest_component'],
    ['safe,largest_component', 'safe,part:2', 'safe,part:2'],
    ['safe,part:a, b', 'safe,fill_holes', 'safe,fill_holes,part:a, b'],
    ['safe,part:2', 'safe,largest_component', 'safe,largest_component'],
    ['safe,close_handles', 'safe,close_handles:0.2', 'safe,close_handles:0.2'],
    ['none', 'safe', 'safe'],
    ['safe', 'none', 'none'],
  ];
  for (const [list, more, expected] of cases) assert.equal(mesh.withRepairs(list, more), expected);
});

test('a repaired mesh: triangles of the file keep its look, patches are plain', () => {
  const { positions, triangles } = ball(1);
  const image = Buffer.from('not decoded here');
  // every triangle has vertices of its own, as along seams; the first two are missing
  const corners = triangles.slice(2).flat();
  const raw = {
    format: 'glb',
    positions: Float64Array.from(corners.flatMap((v) => positions[v])),
    corners: Uint32Array.from(corners.keys()),
    dress: {
      uv: Float32Array.from(corners.flatMap((_, i) => [i, -i])),
      dye: null,
      cover: Uint16Array.from(corners, (_, i) => (i < 30 ? 0 : 1)),
      covers: [0, 1].map((n) => ({ base: [n, 0, 0], image: n - 1, wrap: [10497, 10497], cutoff: 0 })),
      images: [image],
    },
  };
  // the daemon's mesh: welded, some triangles begin with another corner, and a patch with its own vertex
  const middle = positions.length;
  const [[a, b, c]] = triangles;
  const repaired = {
    format: 'ply',
    positions: Float64Array.from([...positions, [9, 9, 9]].flat()),
    corners: Uint32Array.from(
      [...triangles.slice(2).map(([p, q, r], i) => (i % 2 ? [q, r, p] : [p, q, r])), [a, b, middle], [a, b, c]].flat(),
    ),
    properties: new Map([
      ['source', Float64Array.from([...positions.keys()].map((v) => corners.indexOf(v)).concat(-1))],
    ]),
  };
  const { raw: made, added } = mesh.mendedMesh(repaired, raw);
  assert.equal(added, corners.length);
  const kept = triangles.length - 2;
  for (let t = 0; t < kept + 2; t++)
    for (let k = 0; k < 3; k++) {
      const v = made.corners[3 * t + k];
      const at = [...made.positions.subarray(3 * v, 3 * v + 3)];
      const from = repaired.corners[3 * t + k];
      assert.deepEqual(at, [...repaired.positions.subarray(3 * from, 3 * from + 3)]);
      if (t < kept) assert.equal(v, 3 * t + ((t % 2 ? k + 1 : k) % 3), 'the corner of the file');
      else assert.ok(v >= added && made.dress.covers[made.dress.cover[v]].image === -1, 'plain');
      assert.equal(made.dress.uv[2 * v], t < kept ? v : 0);
    }
  assert.equal(made.dress.cover[made.corners[0]], 0);
  assert.equal(made.dress.cover[made.corners[3 * kept - 1]], 1);
  assert.deepEqual(made.dress.images, [image]);
  // for a file that only the daemon can read, the page knows only the numbers
  assert.equal(mesh.mendedMesh(repaired, undefined).raw.dress, undefined);
});

test('a kept document: the new targets, in the scene, then those that it had, and the meshes that stay', () => {
  const ways = FACES.map((_, v) => [v, 0, 1]);
  const glb = writeGlb({
    positions: TETRAHEDRON,
    normals: TETRAHEDRON.map(() => [0, 0, 1]),
    triangles: FACES,
    moves: ways,
    edit: (gltf) => {
      const [body] = gltf.meshes;
      const [primitive] = body.primitives;
      primitive.targets.unshift({ POSITION: primitive.attributes.POSITION });
      body.extras = { targetNames: ['smile', 'other'], firstShape: 1 };
      gltf.meshes.unshift({ primitives: [{ attributes: primitive.attributes, indices: primitive.indices }] });
      gltf.nodes = [
        { mesh: 1, scale: [-2, 1, 1], translation: [0, 5, 0], weights: [0.25, 0] },
        { mesh: 0, translation: [9, 0, 0] },
        { mesh: 0, scale: [3, 3, 3] },
      ];
      gltf.scenes = [{ nodes: [0, 1, 2] }];
    },
  });
  const bytes = glb.buffer.slice(glb.byteOffset, glb.byteOffset + glb.length);
  const { names, targets, extras, moving, vertices, triangles, position, index, frame, normal } = mesh.decodeMorph(
    bytes,
    2,
  );
  assert.deepEqual([vertices, triangles], [4, 4]);
  assert.deepEqual(names, ['other', 'smile']);
  assert.equal(targets.length, 2);
  assert.deepEqual(extras, [{ name: 'smile', at: 1, target: 0, weight: 0.25 }]);
  const close = (a, b) => {
    assert.equal(a.length, b.length);
    assert.ok(
      [...a].every((x, i) => Math.abs(x - b[i]) < 1e-5),
      `${[...a]} ${b}`,
    );
  };
  assert.deepEqual(moving, { vertices: 4, corners: 12 });
  const scene = (values) => values.map((x, i) => x * frame.radius + frame.center[i % 3]);
  close(
    scene(position),
    [
      ...TETRAHEDRON.map(([x, y, z]) => [-2 * x, y + 5, z]),
      ...TETRAHEDRON.map(([x, y, z]) => [x + 9, y, z]),
      ...TETRAHEDRON.map((p) => p.map((x) => 3 * x)),
    ].flat(),
  );
  close(
    targets[0].position.map((x) => x * frame.radius),
    [...ways.map(([x, y, z]) => [-2 * x, y, z]), ...new Array(8).fill([0, 0, 0])].flat(),
  );
  assert.deepEqual(
    [...index],
    [
      ...FACES.map(([a, b, c]) => [a, c, b]),
      ...FACES.map((t) => t.map((v) => v + 4)),
      ...FACES.map((t) => t.map((v) => v + 8)),
    ].flat(),
    'a mirror turns the triangles',
  );
  close(normal, new Array(12).fill([0, 0, 1]).flat());
});

test('looks: the variants of a document, and its own materials if no variant has them', () => {
  const glb = (mappings) =>
    writeGlb({
      positions: TETRAHEDRON,
      triangles: FACES,
      moves: TETRAHEDRON,
      edit: (gltf) => {
        gltf.materials = ['blue', 'red'].map((name) => ({ name }));
        gltf.extensions = { KHR_materials_variants: { variants: [{ name: 'day' }, { name: 'night' }] } };
        Object.assign(gltf.meshes[0].primitives[0], {
          material: 0,
          extensions: { KHR_materials_variants: { mappings } },
        });
      },
    });
  const looks = (mappings) => {
    const file = glb(mappings);
    return mesh.decodeMorph(file.buffer.slice(file.byteOffset, file.byteOffset + file.length), 2).looks;
  };
  const variants = [
    { name: 'day', variant: 0 },
    { name: 'night', variant: 1 },
  ];
  assert.deepEqual(looks([{ material: 1, variants: [1] }]), variants, 'day has the own material');
  assert.deepEqual(looks([{ material: 0, variants: [0] }]), variants);
  assert.deepEqual(looks([{ material: 1, variants: [0, 1] }]), [{ name: 'As in the file', variant: -1 }, ...variants]);
});

test('another match: it flips if limbs change sides, and neither stay nor trade with head or tail', () => {
  const names = ['head', 'tail', 'left front limb', 'right front limb', 'left hind limb', 'right hind limb', 'auto 7'];
  const found = names.map((_, i) => [
    [10 * i, 0, 0],
    [10 * i, 5, 0],
  ]);
  const sides = names.map(mesh.sideOf);
  assert.deepEqual(sides, [0, 0, -1, 1, -1, 1, NaN]);
  /** The match that maps each of these landmarks of the first shape to that of the second. */
  const match = (pairs) => {
    const places = pairs.map(([a, b]) => [found[a][0], found[b][1]]);
    const { flips, swaps } = mesh.otherOf(found, places, sides, [30, 30]);
    return { flips, swaps: swaps.map(({ from, to }) => [from, to]) };
  };
  const twin = [
    [2, 3],
    [3, 2],
    [4, 5],
    [5, 4],
  ];
  assert.deepEqual(match([[0, 0], [1, 1], ...twin]), { flips: true, swaps: twin });
  assert.equal(match([...twin, [6, 2]]).flips, true, 'a landmark whose side is unknown says nothing');
  assert.equal(
    match([
      [2, 3],
      [3, 2],
      [0, 4],
    ]).flips,
    false,
    'the head goes to a limb',
  );
  assert.equal(
    match([
      [2, 3],
      [3, 2],
      [4, 4],
    ]).flips,
    false,
    'a hind limb keeps its side',
  );
  assert.equal(match([[2, 3]]).flips, false, 'one limb is a mistake at one pair');
  assert.equal(
    match([
      [2, 4],
      [3, 5],
      [4, 2],
      [5, 3],
    ]).flips,
    false,
    'front to back',
  );
});

test('meshopt: streams are decoded as meshoptimizer decodes them, and damaged ones end', async () => {
  // @types/three has it as a dependency
  const { MeshoptEncoder, MeshoptDecoder } = createRequire(join(root, 'client/web/package.json'))('meshoptimizer');
  await Promise.all([MeshoptEncoder.ready, MeshoptDecoder.ready]);
  let seed = 1;
  const random = (below) => (seed = (seed * 48271) % 2147483647) % below;
  const bytesOf = (list) => new Uint8Array(list.buffer);
  const streams = [];
  const attributes = (rows, count, byteStride, filter) =>
    streams.push([
      { mode: 'ATTRIBUTES', count, byteStride, filter },
      MeshoptEncoder.encodeVertexBuffer(rows, count, byteStride),
    ]);
  // noise: how many bits the steps need
  for (const stride of [4, 12, 64, 256])
    for (const count of [1, 16, 17, 257, 1000])
      for (const noise of [1, 3, 9, 40, 256]) {
        const rows = new Uint8Array(stride * count);
        for (let i = 0; i < rows.length; i++) rows[i] = (rows[i - stride] ?? 7) + random(noise);
        attributes(rows, count, stride);
      }
  const floats = Float32Array.from({ length: 3000 }, () => (random(2001) - 1000) / 2 ** random(20));
  attributes(MeshoptEncoder.encodeFilterExp(floats, 1000, 12, 15), 1000, 12, 'EXPONENTIAL');
  const { triangles } = ball(4);
  const orders = [triangles, triangles.toSorted?.(() => random(3) - 1) ?? [...triangles].reverse()];
  const lists = [...orders.map((order) => order.flat()), Array.from({ length: 300 }, () => random(2 ** 31))];
  for (const list of lists)
    for (const Type of Math.max(...list) < 65536 ? [Uint16Array, Uint32Array] : [Uint32Array]) {
      const [bytes, count, byteStride] = [bytesOf(Type.from(list)), list.length, Type.BYTES_PER_ELEMENT];
      const { encodeIndexBuffer, encodeIndexSequence } = MeshoptEncoder;
      streams.push([{ mode: 'TRIANGLES', count, byteStride }, encodeIndexBuffer(bytes, count, byteStride)]);
      streams.push([{ mode: 'INDICES', count, byteStride }, encodeIndexSequence(bytes, count, byteStride)]);
    }
  for (const [view, bytes] of streams) {
    const expected = new Uint8Array(view.count * view.byteStride);
    MeshoptDecoder.decodeGltfBuffer(expected, view.count, view.byteStride, bytes, view.mode, view.filter);
    assert.ok(Buffer.from(mesh.unpackView(view, bytes)).equals(Buffer.from(expected)), JSON.stringify(view));
    for (let at = 0; at < bytes.length; at += Math.ceil(bytes.length / 5))
      assert.throws(() => mesh.unpackView(view, bytes.subarray(0, at)), /damaged/, `${at} bytes`);
  }
  assert.throws(() => mesh.unpackView({ mode: 'INDICES', count: 1e9, byteStride: 4 }, streams[0][1]), /damaged/);
});

test('landmark files: as exported, and pairs of vertices as the command line takes them', () => {
  const at = [{ vertex: 1 }, { point: [0, 0.5, 1] }];
  for (const text of [JSON.stringify([{ at }]), JSON.stringify({ landmarks: [{ at }] })])
    assert.deepEqual(mesh.marksOf(mesh.listIn(text), 2, 'l.json'), [{ at }]);
  assert.deepEqual(mesh.marksOf(mesh.listIn('[[1,2],[3,4]]'), 2, 'l.json'), [
    { at: [{ vertex: 1 }, { vertex: 2 }] },
    { at: [{ vertex: 3 }, { vertex: 4 }] },
  ]);
  assert.equal(mesh.marksOf(mesh.listIn('[[1,2]]'), 3, 'l.json').length, 1, 'the third shape may follow');
  for (const text of ['', 'null', '{"asset":{"version":"2.0"}}', '[1'])
    assert.equal(mesh.listIn(text), null, `no landmarks in ${text}`);
  for (const [list, why] of [
    [[], /l\.json has no landmarks\.$/],
    [[[1, 2, 3]], /l\.json has landmarks for 3 shapes, and only 2 are here\./],
    [
      [
        [1, 2],
        ['a', 'b'],
      ],
      /entry 2/,
    ],
    [[{ name: 'nose' }], /entry 1/],
    [[null], /entry 1/],
    [[{ at: [{ triangle: 1 }, { vertex: 2 }] }], /entry 1/],
  ])
    assert.throws(() => mesh.marksOf(list, 2, 'l.json'), why);
});

test('trouble with landmarks is told in the numbers and names of the page', () => {
  const here = [0, 0, 0];
  const there = [1, 0, 0];
  const marks = {
    names: ['1', '2 (nose)', '4'],
    shapes: ['dog', 'giraffe'],
    places: [
      [here, there],
      [there, here],
      [here, here],
    ],
  };
  const says = (landmarks, shape) => mesh.landmarkTrouble({ landmarks, shape }, marks);
  assert.equal(
    says([0, 1, 2], 0),
    'Landmarks 1 and 4 are at one place on dog, but not on every shape. Move or delete one of them.',
  );
  assert.match(says([0, 1], 1), /^Landmarks 1 and 2 \(nose\) do not fit together on giraffe/);
  assert.match(says([1], 1), /^Landmark 2 \(nose\) cannot be where it is on giraffe/);
  assert.match(says([1]), /^Landmark 2 \(nose\) cannot be where it is while/);
  assert.equal(says([7], 0), null);
  assert.equal(says(undefined, 0), null);
});

test('refusals say what the buttons do, and count all pieces', () => {
  const refusal = (kind, members) => ({ type: `/problems/${kind}`, detail: 'send it with repair=…', ...members });
  const said = (problem, tried) => mesh.sentenceFor(problem, mesh.repairsFor(problem, tried));
  const parts = [3, 2].map((triangles, part) => ({ part, triangles }));
  const many = refusal('not-connected', { component_count: 250, components: [3, 2], parts });
  assert.match(said(many), /^The mesh has 250 pieces/);
  assert.deepEqual(mesh.piecesOf(many), { total: 250, listed: 2 });
  assert.match(said(refusal('not-closed', { boundary_loops: 1 })), /1 hole\. “Fill the holes” covers it/);
  assert.match(said(refusal('not-genus-zero', { genus: 2, loop_lengths_relative: [0.1, 0.2] })), /2 handles/);
  const crowded = refusal('not-manifold', { edge_count: 1 });
  assert.match(said(crowded), /^1 edge belongs to more than two faces\. “Split it there”/);
  assert.equal(said(crowded, 'safe,split_nonmanifold'), crowded.detail, 'it was tried: there is no button');
  assert.equal(said(refusal('malformed-mesh', {})), 'send it with repair=…');
});

test('numbers: groups of three, and rounding is no error', () => {
  assert.equal(mesh.count(1234567), '1\u202f234\u202f567');
  assert.deepEqual([0, 1e-13, 1e-3, 2.5e-6, null].map(mesh.relative), ['0 %', '0 %', '0.10 %', '2.5e-4 %', '–']);
});
