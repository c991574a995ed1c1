// Small meshes made by hand, good and bad, as text of OBJ files.
import { deflateRawSync } from 'node:zlib';

export const tetrahedron = 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n';

export const cube =
  'v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n' +
  'f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n';

export function obj({ positions, triangles }) {
  return (
    positions.map((p) => `v ${p.join(' ')}\n`).join('') +
    triangles.map((t) => `f ${t.map((v) => v + 1).join(' ')}\n`).join('')
  );
}

/** A sphere of 8·4^levels triangles, its points moved by `shape`. */
export function ball(levels = 3, shape = (p) => p) {
  let triangles = [
    [0, 2, 4],
    [2, 1, 4],
    [1, 3, 4],
    [3, 0, 4],
    [2, 0, 5],
    [1, 2, 5],
    [3, 1, 5],
    [0, 3, 5],
  ];
  const points = [
    [1, 0, 0],
    [-1, 0, 0],
    [0, 1, 0],
    [0, -1, 0],
    [0, 0, 1],
    [0, 0, -1],
  ];
  for (let level = 0; level < levels; level++) {
    const middles = new Map();
    const middle = (a, b) => {
      const key = a < b ? `${a},${b}` : `${b},${a}`;
      if (!middles.has(key)) {
        const sum = points[a].map((x, k) => x + points[b][k]);
        const length = Math.hypot(...sum);
        middles.set(key, points.push(sum.map((x) => x / length)) - 1);
      }
      return middles.get(key);
    };
    triangles = triangles.flatMap(([a, b, c]) => {
      const [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
      return [
        [a, ab, ca],
        [ab, b, bc],
        [ca, bc, c],
        [ab, bc, ca],
      ];
    });
  }
  return { positions: points.map(shape), triangles, points };
}

export const egg = (levels = 3) => ball(levels, ([x, y, z]) => [1.4 * x + 0.2 * y * y, y, 0.8 * z]);
export const bean = (levels = 3) => ball(levels, ([x, y, z]) => [x, 0.9 * y + 0.35 * x * x, 0.7 * z * (1 + 0.3 * x)]);

export function torus(n = 12, m = 8) {
  const positions = [];
  const triangles = [];
  for (let i = 0; i < n; i++)
    for (let j = 0; j < m; j++) {
      const u = (2 * Math.PI * i) / n;
      const v = (2 * Math.PI * j) / m;
      const r = 2 + Math.cos(v);
      positions.push([r * Math.cos(u), r * Math.sin(u), Math.sin(v)]);
      const at = (a, b) => (a % n) * m + (b % m);
      triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
    }
  return { positions, triangles };
}

export const withoutFace = ({ positions, triangles }) => ({ positions, triangles: triangles.slice(1) });

export function apart(a, b, shift = 10) {
  const n = a.positions.length;
  return {
    positions: [...a.positions, ...b.positions.map(([x, y, z]) => [x + shift, y, z])],
    triangles: [...a.triangles, ...b.triangles.map((t) => t.map((v) => v + n))],
  };
}

/** The checksum at the end of each file of a ZIP archive, the same as in PNG and Ethernet. */
function crc32(bytes) {
  let sum = -1;
  for (const byte of bytes) {
    sum ^= byte;
    for (let k = 0; k < 8; k++) sum = (sum >>> 1) ^ (sum & 1 ? 0xedb88320 : 0);
  }
  return ~sum >>> 0;
}

/** A ZIP archive of files by name; texts and bytes are deflated. */
export function zip(files) {
  const bodies = [];
  const directory = [];
  let at = 0;
  for (const [name, content] of Object.entries(files)) {
    const bytes = Buffer.from(content);
    const packed = deflateRawSync(bytes);
    const common = Buffer.alloc(26);
    [20, 0x800, 8, 0, 0].forEach((value, i) => common.writeUInt16LE(value, 2 * i));
    [crc32(bytes), packed.length, bytes.length].forEach((value, i) => common.writeUInt32LE(value, 10 + 4 * i));
    common.writeUInt16LE(Buffer.byteLength(name), 22);
    const tail = Buffer.alloc(14);
    tail.writeUInt32LE(at, 10);
    bodies.push(Buffer.from('PK\x03\x04'), common, Buffer.from(name), packed);
    directory.push(Buffer.from('PK\x01\x02\x14\0'), common, tail, Buffer.from(name));
    at += 30 + Buffer.byteLength(name) + packed.length;
  }
  const end = Buffer.alloc(22);
  end.write('PK\x05\x06');
  [8, 10].forEach((offset) => end.writeUInt16LE(Object.keys(files).length, offset));
  end.writeUInt32LE(Buffer.concat(directory).length, 12);
  end.writeUInt32LE(at, 16);
  return Buffer.concat([...bodies, ...directory, end]);
}

export const xmlOf3mf = ({ positions, triangles }, unit = 'millimeter', transform = '1 0 0 0 1 0 0 0 1 0 0 0') =>
  `<?xml version="1.0" encoding="UTF-8"?>
<model unit="${unit}" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources><object id="1" type="model"><mesh><vertices>
${positions.map(([x, y, z]) => `<vertex x="${x}" y="${y}" z="${z}"/>`).join('\n')}
</vertices><triangles>
${triangles.map(([a, b, c]) => `<triangle v1="${a}" v2="${b}" v3="${c}"/>`).join('\n')}
</triangles></mesh></object></resources>
<build><item objectid="1" transform="${transform}"/></build>
</model>`;

export const package3mf = (xml) =>
  zip({
    '[Content_Types].xml': `<?xml version="1.0"?><Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>`,
    '_rels/.rels': `<?xml version="1.0"?><Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Id="r" Target="/3D/3dmodel.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>`,
    '3D/3dmodel.model': xml,
  });

export const threeMf = (...args) => package3mf(xmlOf3mf(...args));

/** Every triangle has its own vertices, as in an STL file. */
export function soup({ positions, triangles }) {
  return {
    positions: triangles.flatMap((t) => t.map((v) => positions[v])),
    triangles: triangles.map((_, i) => [3 * i, 3 * i + 1, 3 * i + 2]),
  };
}

export const reversed = ({ positions, triangles }, which = () => true) => ({
  positions,
  triangles: triangles.map((t, i) => (which(i) ? [t[0], t[2], t[1]] : t)),
});

export function binaryStl({ positions, triangles }) {
  const bytes = Buffer.alloc(84 + 50 * triangles.length);
  bytes.write('solid but binary');
  bytes.writeUInt32LE(triangles.length, 80);
  triangles.forEach((t, i) =>
    t.forEach((v, c) => positions[v].forEach((x, k) => bytes.writeFloatLE(x, 84 + 50 * i + 12 + 12 * c + 4 * k))),
  );
  return bytes;
}

export function binaryPly({ positions, triangles }, big = false) {
  const order = big ? 'big' : 'little';
  const head = Buffer.from(
    `ply\nformat binary_${order}_endian 1.0\ncomment made by hand\nelement vertex ${positions.length}\nproperty double x\n` +
      `property double y\nproperty double z\nproperty uchar quality\nelement face ${triangles.length}\n` +
      'property list uchar int vertex_indices\nend_header\n',
  );
  const body = Buffer.alloc(25 * positions.length + 13 * triangles.length);
  let at = 0;
  const real = (x) => (at = big ? body.writeDoubleBE(x, at) : body.writeDoubleLE(x, at));
  const int = (x) => (at = big ? body.writeInt32BE(x, at) : body.writeInt32LE(x, at));
  for (const p of positions) {
    p.forEach(real);
    at = body.writeUInt8(7, at);
  }
  for (const t of triangles) {
    at = body.writeUInt8(3, at);
    t.forEach(int);
  }
  return Buffer.concat([head, body]);
}

export function off({ positions, triangles }) {
  return `OFF\n# by hand\n${positions.length} ${triangles.length} 0\n${positions.map((p) => p.join(' ')).join('\n')}\n${triangles.map((t) => `3 ${t.join(' ')}`).join('\n')}\n`;
}

/** Positions and triangles of an OBJ, OFF or ascii PLY file of triangles. */
export function parse(text) {
  const lines = text.split(/\r?\n/);
  if (/^(OFF|ply)/.test(text)) {
    const words = text
      .replace(/#.*$/gm, '')
      .replace(/^ply[\s\S]*?end_header\n/, '')
      .trim()
      .split(/\s+/);
    const head = /element vertex (\d+)[\s\S]*element face (\d+)/.exec(text);
    let at = 0;
    let n;
    let m;
    if (head) [n, m] = [Number(head[1]), Number(head[2])];
    else {
      at = 4;
      [n, m] = [Number(words[1]), Number(words[2])];
    }
    const positions = Array.from({ length: n }, () => [Number(words[at++]), Number(words[at++]), Number(words[at++])]);
    const triangles = Array.from({ length: m }, () => {
      at++; // the number of corners
      return [Number(words[at++]), Number(words[at++]), Number(words[at++])];
    });
    return { positions, triangles };
  }
  const positions = [];
  const triangles = [];
  for (const line of lines) {
    const [kind, ...rest] = line.trim().split(/\s+/);
    if (kind === 'v') positions.push(rest.slice(0, 3).map(Number));
    if (kind === 'f') triangles.push(rest.map((x) => Number(x.split('/')[0]) - 1));
  }
  return { positions, triangles };
}

/** A flat plate with nx × ny square holes, each of which is a handle. map: of its points. */
export function grating(nx, ny, map = (p) => p) {
  const [w, h] = [2 * nx + 1, 2 * ny + 1];
  const positions = [];
  const triangles = [];
  const ids = new Map();
  const is = (i, j) => i >= 0 && j >= 0 && i < w && j < h && !(i % 2 && j % 2);
  const at = (x, y, z) => {
    const key = `${x},${y},${z}`;
    if (!ids.has(key)) ids.set(key, positions.push(map([x, y, z])) - 1);
    return ids.get(key);
  };
  const quad = (...corners) => {
    const [a, b, c, d] = corners.map((p) => at(...p));
    triangles.push([a, b, c], [a, c, d]);
  };
  for (let x = 0; x < w; x++)
    for (let y = 0; y < h; y++) {
      if (!is(x, y)) continue;
      const [X, Y] = [x + 1, y + 1];
      quad([x, y, 1], [X, y, 1], [X, Y, 1], [x, Y, 1]);
      quad([x, y, 0], [x, Y, 0], [X, Y, 0], [X, y, 0]);
      if (!is(x - 1, y)) quad([x, y, 0], [x, y, 1], [x, Y, 1], [x, Y, 0]);
      if (!is(X, y)) quad([X, y, 0], [X, Y, 0], [X, Y, 1], [X, y, 1]);
      if (!is(x, y - 1)) quad([x, y, 0], [X, y, 0], [X, y, 1], [x, y, 1]);
      if (!is(x, Y)) quad([x, Y, 0], [x, Y, 1], [X, Y, 1], [X, Y, 0]);
    }
  return { positions, triangles };
}

/**
 * A figure with head, arms, legs and belly, symmetric between its left (−x) and right. lengths: of an arm, a leg, the
 * head and the belly; depth: of the whole from front to back.
 */
export function figure([arm, leg, head, belly], depth = 0.6, levels = 4) {
  const bump = (p, d, width) => {
    const cosine = (p[0] * d[0] + p[1] * d[1] + p[2] * d[2]) / Math.hypot(...d);
    return Math.exp(-((Math.acos(Math.max(-1, Math.min(1, cosine))) / width) ** 2));
  };
  return ball(levels, (p) => {
    const q = [Math.abs(p[0]), p[1], p[2]];
    const sides = arm * (bump(q, [1, 0.3, 0], 0.35) + bump(q, [-1, 0.3, 0], 0.35));
    const feet = leg * (bump(q, [0.6, -1, 0], 0.3) + bump(q, [-0.6, -1, 0], 0.3));
    const r = 0.6 + sides + feet + head * bump(q, [0, 1, 0], 0.35) + belly * bump(q, [0, 0.2, 1], 0.5);
    return [r * p[0], r * p[1], depth * r * p[2]];
  });
}
