/**
 * Reads mesh files for display, all but 3MF, which only the daemon reads. Vertices have the same numbers as in the daemon:
 * OBJ, OFF and PLY in file order, STL 3·facet + corner, glTF the POSITION accessors of all triangle primitives one after
 * another. The reader is lenient and shows what it can; the daemon decides what is a mesh.
 */
import { unpackPrimitives } from './draco';
import { dressOf, plyDress, tried, type Dress } from './dress';
import { beyondIn, contentOf, extrasIn, type Content, type Extra } from './extras';
import { readGlb, type Gltf } from './gltf';

export interface RawMesh {
  format: string;
  /** xyz of each vertex of the file */
  positions: Float64Array;
  /** three vertices of the file for each triangle */
  corners: Uint32Array;
  /** other properties of PLY vertices, by name */
  properties?: Map<string, Float64Array>;
  dress?: Dress | null;
  /** what a glTF file has besides its surface */
  extras?: Extra[];
  /** which of these a new mesh lacks, if this is the first shape */
  beyond?: Extra[];
  /** the parts of a glTF document */
  content?: Content;
}

/** A growing typed array. */
class Doubles {
  data = new Float64Array(1 << 16);
  length = 0;
  push3(x: number, y: number, z: number) {
    if (this.length + 3 > this.data.length) {
      const wider = new Float64Array(this.data.length * 2);
      wider.set(this.data);
      this.data = wider;
    }
    this.data[this.length++] = x;
    this.data[this.length++] = y;
    this.data[this.length++] = z;
  }
  done = () => this.data.slice(0, this.length);
}

class Corners {
  data = new Uint32Array(1 << 16);
  length = 0;
  push(value: number) {
    if (this.length === this.data.length) {
      const wider = new Uint32Array(this.data.length * 2);
      wider.set(this.data);
      this.data = wider;
    }
    this.data[this.length++] = value;
  }
  /** Adds a polygon as a triangle fan. */
  fan(polygon: number[], count = polygon.length) {
    for (let i = 2; i < count; i++) {
      this.push(polygon[0]);
      this.push(polygon[i - 1]);
      this.push(polygon[i]);
    }
  }
  done = () => this.data.slice(0, this.length);
}

/** Scans text as bytes; reads numbers without creating strings where that is exact enough for display. */
class Scanner {
  at = 0;
  constructor(readonly bytes: Uint8Array) {}
  get ended() {
    return this.at >= this.bytes.length;
  }
  /** Skips blanks within the line. Returns whether something follows on it. */
  more(): boolean {
    const { bytes } = this;
    for (;;) {
      const c = bytes[this.at];
      if (c === 32 || c === 9) this.at++;
      else if (c === 92 && (bytes[this.at + 1] === 10 || bytes[this.at + 1] === 13)) {
        this.at++;
        this.nextLine();
      } else return c !== undefined && c !== 10 && c !== 13;
    }
  }
  nextLine() {
    const { bytes } = this;
    while (this.at < bytes.length && bytes[this.at] !== 10 && bytes[this.at] !== 13) this.at++;
    if (bytes[this.at] === 13 && bytes[this.at + 1] === 10) this.at++;
    this.at++;
  }
  /** Skips blanks, line ends and comments. */
  skip() {
    for (;;) {
      const c = this.bytes[this.at];
      if (c === 32 || c === 9 || c === 10 || c === 13) this.at++;
      else if (c === 35) this.nextLine();
      else return;
    }
  }
  word(): string {
    const start = this.at;
    while (this.at < this.bytes.length && this.bytes[this.at] > 32) this.at++;
    return String.fromCharCode(...this.bytes.subarray(start, Math.min(this.at, start + 64)));
  }
  nextNumber(): number {
    this.skip();
    return this.number();
  }
  number(): number {
    const { bytes } = this;
    const start = this.at;
    let negative = false;
    let c = bytes[this.at];
    if (c === 45 || c === 43) {
      negative = c === 45;
      c = bytes[++this.at];
    }
    let value = 0;
    let digits = 0;
    let scale = 0;
    while (c >= 48 && c <= 57) {
      value = value * 10 + (c - 48);
      digits++;
      c = bytes[++this.at];
    }
    if (c === 46) {
      c = bytes[++this.at];
      while (c >= 48 && c <= 57) {
        value = value * 10 + (c - 48);
        digits++;
        scale--;
        c = bytes[++this.at];
      }
    }
    if (c === 101 || c === 69) {
      c = bytes[++this.at];
      let sign = 1;
      if (c === 45 || c === 43) {
        sign = c === 45 ? -1 : 1;
        c = bytes[++this.at];
      }
      let exponent = 0;
      while (c >= 48 && c <= 57) {
        exponent = exponent * 10 + (c - 48);
        c = bytes[++this.at];
      }
      scale += sign * exponent;
    }
    if (digits === 0 || (c > 32 && c !== 47 && c !== undefined)) {
      this.at = start;
      return parseFloat(this.word());
    }
    if (scale) value = scale < 0 ? value / 10 ** -scale : value * 10 ** scale;
    return negative ? -value : value;
  }
}

function parseObj(bytes: Uint8Array): RawMesh {
  const s = new Scanner(bytes);
  const positions = new Doubles();
  const corners = new Corners();
  const polygon: number[] = [];
  while (!s.ended) {
    if (!s.more()) {
      s.nextLine();
      continue;
    }
    const c = bytes[s.at];
    const next = bytes[s.at + 1];
    if (c === 118 && (next === 32 || next === 9)) {
      s.at++;
      let x = NaN;
      let y = NaN;
      let z = NaN;
      if (s.more()) x = s.number();
      if (s.more()) y = s.number();
      if (s.more()) z = s.number();
      positions.push3(x, y, z);
    } else if (c === 102 && (next === 32 || next === 9)) {
      s.at++;
      let count = 0;
      while (s.more()) {
        const value = s.number();
        while (bytes[s.at] > 32) s.at++;
        const vertex = value < 0 ? positions.length / 3 + value : value - 1;
        if (!Number.isNaN(vertex)) polygon[count++] = vertex;
      }
      corners.fan(polygon, count);
    }
    s.nextLine();
  }
  return { format: 'obj', positions: positions.done(), corners: corners.done() };
}

function parseOff(bytes: Uint8Array): RawMesh {
  const s = new Scanner(bytes);
  const positions = new Doubles();
  const corners = new Corners();
  s.skip();
  const head = s.word();
  const counts: number[] = /OFF$/i.test(head) ? [] : [parseFloat(head)];
  while (counts.length < 3) counts.push(s.nextNumber());
  for (let i = 0; i < counts[0] && !s.ended; i++) {
    const x = s.nextNumber();
    s.more();
    const y = s.number();
    s.more();
    const z = s.number();
    s.nextLine();
    positions.push3(x, y, z);
  }
  const polygon: number[] = [];
  for (let i = 0; i < counts[1] && !s.ended; i++) {
    const n = s.nextNumber();
    let count = 0;
    while (count < n && s.more()) polygon[count++] = s.number();
    s.nextLine();
    corners.fan(polygon, count);
  }
  return { format: 'off', positions: positions.done(), corners: corners.done() };
}

function parseStl(bytes: Uint8Array): RawMesh {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const facets = bytes.length >= 84 ? view.getUint32(80, true) : 0;
  const binary =
    bytes.length >= 84 &&
    84 + 50 * facets <= bytes.length &&
    (84 + 50 * facets === bytes.length || !/^solid/.test(ascii(bytes, 0, 5)));
  let positions: Float64Array;
  if (binary) {
    positions = new Float64Array(facets * 9);
    for (let i = 0, at = 84; i < facets; i++, at += 50)
      for (let k = 0; k < 9; k++) positions[9 * i + k] = view.getFloat32(at + 12 + 4 * k, true);
  } else {
    const s = new Scanner(bytes);
    const list = new Doubles();
    while (!s.ended) {
      if (s.more() && s.word() === 'vertex') {
        s.more();
        const x = s.number();
        s.more();
        const y = s.number();
        s.more();
        list.push3(x, y, s.number());
      }
      s.nextLine();
    }
    positions = list.done();
  }
  const corners = new Uint32Array(Math.floor(positions.length / 9) * 3);
  for (let i = 0; i < corners.length; i++) corners[i] = i;
  return { format: 'stl', positions, corners };
}

const ascii = (bytes: Uint8Array, from: number, to: number) => String.fromCharCode(...bytes.subarray(from, to));

const PLY_SIZES: Record<string, number> = {
  char: 1,
  int8: 1,
  uchar: 1,
  uint8: 1,
  short: 2,
  int16: 2,
  ushort: 2,
  uint16: 2,
  int: 4,
  int32: 4,
  uint: 4,
  uint32: 4,
  float: 4,
  float32: 4,
  double: 8,
  float64: 8,
};

type Reader = (view: DataView, at: number, little: boolean) => number;
function plyReader(type: string): Reader {
  switch (type) {
    case 'char':
    case 'int8':
      return (v, at) => v.getInt8(at);
    case 'uchar':
    case 'uint8':
      return (v, at) => v.getUint8(at);
    case 'short':
    case 'int16':
      return (v, at, l) => v.getInt16(at, l);
    case 'ushort':
    case 'uint16':
      return (v, at, l) => v.getUint16(at, l);
    case 'int':
    case 'int32':
      return (v, at, l) => v.getInt32(at, l);
    case 'uint':
    case 'uint32':
      return (v, at, l) => v.getUint32(at, l);
    case 'float':
    case 'float32':
      return (v, at, l) => v.getFloat32(at, l);
    default:
      return (v, at, l) => v.getFloat64(at, l);
  }
}

interface PlyProperty {
  name: string;
  type: string;
  count?: string;
}
interface PlyElement {
  name: string;
  count: number;
  properties: PlyProperty[];
}

function plyHeader(bytes: Uint8Array) {
  let text = '';
  let end = -1;
  for (let at = 0; at < bytes.length && end < 0; at += 4096) {
    text += ascii(bytes, at, Math.min(at + 4096, bytes.length));
    const found = text.match(/end_header[ \t]*\r?\n?/);
    if (found && (found[0].endsWith('\n') || text.length >= bytes.length)) end = found.index! + found[0].length;
  }
  if (end < 0) throw new Error('The PLY header has no end.');
  const elements: PlyElement[] = [];
  let format = 'ascii';
  for (const line of text.slice(0, end).split(/\r?\n/)) {
    const words = line.trim().split(/\s+/);
    if (words[0] === 'format') format = words[1];
    else if (words[0] === 'element') elements.push({ name: words[1], count: Number(words[2]), properties: [] });
    else if (words[0] === 'property' && words[1] === 'list')
      elements.at(-1)?.properties.push({ name: words[4], type: words[3], count: words[2] });
    else if (words[0] === 'property') elements.at(-1)?.properties.push({ name: words[2], type: words[1] });
  }
  return { format, elements, end };
}

function parsePly(bytes: Uint8Array): RawMesh {
  const { format, elements, end } = plyHeader(bytes);
  const properties = new Map<string, Float64Array>();
  const corners = new Corners();
  const polygon: number[] = [];
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const text = format === 'ascii' ? new Scanner(bytes) : null;
  const little = format !== 'binary_big_endian';
  let at = end;
  if (text) text.at = end;
  let vertices = 0;
  for (const element of elements) {
    const scalar = element.name === 'vertex';
    const readers = element.properties.map((p) => plyReader(p.type));
    const columns = element.properties.map((p) => {
      if (!scalar || p.count) return null;
      const column = new Float64Array(Math.min(element.count, bytes.length));
      properties.set(p.name, column);
      return column;
    });
    if (scalar) vertices = Math.min(element.count, bytes.length);
    rows: for (let row = 0; row < element.count; row++) {
      if (text) text.skip();
      for (let k = 0; k < element.properties.length; k++) {
        const property = element.properties[k];
        if (!property.count) {
          if (text ? text.ended : at + PLY_SIZES[property.type] > bytes.length) break rows;
          const value = text ? text.nextNumber() : readers[k](view, at, little);
          if (!text) at += PLY_SIZES[property.type];
          if (columns[k]) columns[k]![row] = value;
          continue;
        }
        if (text ? text.ended : at >= bytes.length) break rows;
        const size = PLY_SIZES[property.type];
        const count = text ? text.nextNumber() : plyReader(property.count)(view, at, little);
        if (!text) at += PLY_SIZES[property.count];
        if (!text && at + count * size > bytes.length) break rows;
        for (let i = 0; i < count; i++) {
          polygon[i] = text ? text.nextNumber() : readers[k](view, at, little);
          if (!text) at += size;
        }
        if (element.name === 'face' && /^vertex_ind/.test(property.name)) corners.fan(polygon, count);
      }
    }
  }
  const [x, y, z] = ['x', 'y', 'z'].map((name) => properties.get(name) ?? new Float64Array(vertices));
  const positions = new Float64Array(vertices * 3);
  for (let i = 0; i < vertices; i++) {
    positions[3 * i] = x[i];
    positions[3 * i + 1] = y[i];
    positions[3 * i + 2] = z[i];
  }
  const declared = elements.find(({ name }) => name === 'vertex')?.properties ?? [];
  const dress = plyDress(properties, new Map(declared.map(({ name, type }) => [name, type])));
  return { format: 'ply', positions, corners: corners.done(), properties, dress };
}

function parseGltf(gltf: Gltf, format: string): RawMesh {
  const parts = gltf.triangles();
  let vertices = 0;
  let count = 0;
  for (const part of parts) {
    vertices += part.position.length / 3;
    count += part.index.length;
  }
  const positions = new Float64Array(vertices * 3);
  const corners = new Uint32Array(count);
  let v = 0;
  let c = 0;
  for (const part of parts) {
    const m = part.matrix;
    for (let i = 0; i < part.position.length; i += 3) {
      const x = part.position[i];
      const y = part.position[i + 1];
      const z = part.position[i + 2];
      for (let k = 0; k < 3; k++) positions[3 * v + i + k] = m[k] * x + m[4 + k] * y + m[8 + k] * z + m[12 + k];
    }
    for (let i = 0; i < part.index.length; i++) corners[c++] = part.index[i] + v;
    v += part.position.length / 3;
  }
  return {
    format,
    positions,
    corners,
    dress: tried(() => dressOf(gltf, parts)),
    extras: extrasIn(gltf, parts),
    beyond: beyondIn(gltf, parts),
    content: contentOf(gltf),
  };
}

/** Drops triangles that cannot be drawn because a vertex does not exist or is not finite. */
function drawable(raw: RawMesh): RawMesh {
  const { positions, corners } = raw;
  const vertices = positions.length / 3;
  const ok = (v: number) =>
    v < vertices && Number.isFinite(positions[3 * v] + positions[3 * v + 1] + positions[3 * v + 2]);
  let n = 0;
  for (let i = 0; i + 2 < corners.length; i += 3) {
    const a = corners[i];
    const b = corners[i + 1];
    const c = corners[i + 2];
    if (!ok(a) || !ok(b) || !ok(c)) continue;
    corners[n++] = a;
    corners[n++] = b;
    corners[n++] = c;
  }
  return { ...raw, corners: n === corners.length ? corners : corners.slice(0, n) };
}

const headOf = (bytes: Uint8Array) => ascii(bytes, 0, Math.min(512, bytes.length)).trimStart();
const gltfFormat = (head: string) => (head.startsWith('glTF') ? 'glb' : head.startsWith('{') ? 'gltf' : null);

/** Detects the format by content, as the daemon does. Draco is not decoded: openMesh() does that. */
export function parseMesh(buffer: ArrayBuffer): RawMesh {
  const bytes = new Uint8Array(buffer);
  const head = headOf(bytes);
  const gltf = gltfFormat(head);
  if (gltf) return drawable(parseGltf(readGlb(buffer), gltf));
  if (head.startsWith('PK')) throw new Error('Only the daemon reads 3MF.');
  if (head.startsWith('ply')) return drawable(parsePly(bytes));
  if (/^(ST|C|N|4|n)*OFF\b/.test(head)) return drawable(parseOff(bytes));
  if (/^solid/i.test(head) && /facet|endsolid/i.test(head)) return drawable(parseStl(bytes));
  if (/^(#|v|vn|vt|f|o|g|s|mtllib|usemtl)\b/m.test(head)) return drawable(parseObj(bytes));
  return drawable(parseStl(bytes));
}

/** As parseMesh(), and with Draco's decoder for files that need it. */
export async function openMesh(buffer: ArrayBuffer): Promise<RawMesh> {
  const format = gltfFormat(headOf(new Uint8Array(buffer)));
  if (!format) return parseMesh(buffer);
  const gltf = readGlb(buffer);
  await unpackPrimitives(gltf);
  return drawable(parseGltf(gltf, format));
}
