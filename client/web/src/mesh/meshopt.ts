/**
 * Decodes a buffer view of EXT_meshopt_compression, as the specification of the extension describes the streams:
 * https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_meshopt_compression
 * meshoptimizer's own decoder is WebAssembly, which the daemon's Content-Security-Policy does not allow.
 */
export interface Packed {
  buffer: number;
  byteOffset?: number;
  byteLength: number;
  byteStride: number;
  count: number;
  mode: 'ATTRIBUTES' | 'TRIANGLES' | 'INDICES';
  filter?: string;
}

const MOST = 64; // a stream grows by this factor at most: two bits stand for sixteen bytes
const damaged = () => new Error('The compressed data of the file is damaged.');
const signed = (value: number) => (value & 1 ? ~(value >>> 1) : value >>> 1);

/** Reads bytes in order. */
class Stream {
  constructor(
    private readonly bytes: Uint8Array,
    private at: number,
  ) {}
  /** The stream ends where the bytes of its tail begin. */
  end(tail: number) {
    if (this.at !== this.bytes.length - tail) throw damaged();
  }
  next(): number {
    if (this.at >= this.bytes.length) throw damaged();
    return this.bytes[this.at++];
  }
  take(count: number): Uint8Array {
    if (this.at + count > this.bytes.length) throw damaged();
    return this.bytes.subarray(this.at, (this.at += count));
  }
  /** Seven bits a byte, the lowest first. */
  number(): number {
    let value = 0;
    for (let shift = 0; shift < 35; shift += 7) {
      const byte = this.next();
      value |= (byte & 127) << shift;
      if (byte < 128) return value >>> 0;
    }
    throw damaged();
  }
  /** Sixteen numbers of 0, 2, 4 or 8 bits. The largest number of 2 or 4 bits says that a byte of its own follows. */
  group(mode: number, out: Uint8Array) {
    if (mode === 0) out.fill(0);
    else if (mode === 3) out.set(this.take(16));
    else {
      const bits = 2 * mode;
      const most = (1 << bits) - 1;
      const short = this.take(2 * bits);
      for (let i = 0; i < 16; i++) {
        const bit = i * bits;
        const value = (short[bit >> 3] >> (8 - bits - (bit & 7))) & most;
        out[i] = value === most ? this.next() : value;
      }
    }
  }
}

function attributes(bytes: Uint8Array, count: number, stride: number): Uint8Array {
  const out = new Uint8Array(count * stride);
  const stream = new Stream(bytes, 1);
  const last = bytes.slice(bytes.length - stride);
  const rows = Math.min((8192 / stride) & ~15, 256);
  const delta = new Uint8Array(16);
  for (let first = 0; first < count; first += rows) {
    const end = Math.min(first + rows, count);
    const groups = Math.ceil((end - first) / 16);
    for (let k = 0; k < stride; k++) {
      const modes = stream.take(Math.ceil(groups / 4));
      for (let g = 0; g < groups; g++) {
        stream.group((modes[g >> 2] >> (2 * (g & 3))) & 3, delta);
        const start = first + 16 * g;
        for (let i = 0; i < 16 && start + i < end; i++) out[(start + i) * stride + k] = last[k] += signed(delta[i]);
      }
    }
  }
  stream.end(Math.max(stride, 32));
  return out;
}

const BEHIND = 16; // the number of each triangle's likely edges and corners, at the end of the stream

function triangles(bytes: Uint8Array, count: number, out: Uint16Array | Uint32Array) {
  const codes = new Stream(bytes, 1);
  const stream = new Stream(bytes, 1 + count / 3);
  const likely = bytes.subarray(bytes.length - BEHIND);
  // the last sixteen edges and corners
  const edges = new Uint32Array(32);
  const corners = new Uint32Array(16);
  let edgeCount = 0;
  let cornerCount = 0;
  let next = 0;
  let last = 0;
  const edge = (from: number, to: number) => {
    edges[2 * (edgeCount & 15)] = from;
    edges[2 * (edgeCount++ & 15) + 1] = to;
  };
  const corner = (vertex: number) => (corners[cornerCount++ & 15] = vertex);
  const recent = (back: number) => corners[(cornerCount - 1 - back) & 15];
  const far = () => (last = (last + signed(stream.number())) >>> 0);
  for (let i = 0; i < count; i += 3) {
    const code = codes.next();
    const [high, low] = [code >> 4, code & 15];
    let a: number;
    let b: number;
    let c: number;
    if (high < 15) {
      const at = 2 * ((edgeCount - 1 - high) & 15);
      [a, b] = [edges[at], edges[at + 1]];
      if (low === 0) c = next++;
      else if (low < 13) c = recent(low);
      else if (low === 15) c = far();
      else c = last = (last + (low === 13 ? -1 : 1)) >>> 0;
      if (low === 0 || low >= 13) corner(c);
    } else {
      const pair = low < 14 ? likely[low] : stream.next();
      if (low >= 14 && pair === 0) next = 0;
      const [second, third] = [pair >> 4, pair & 15];
      const whole = low >= 14; // only then does 15 stand for a number that follows
      const pick = (which: number) => (which === 0 ? next++ : whole && which === 15 ? far() : recent(which - 1));
      a = low === 15 ? far() : next++;
      b = pick(second);
      c = pick(third);
      corner(a);
      if (second === 0 || (whole && second === 15)) corner(b);
      if (third === 0 || (whole && third === 15)) corner(c);
      edge(b, a);
    }
    edge(c, b);
    edge(a, c);
    out[i] = a;
    out[i + 1] = b;
    out[i + 2] = c;
  }
  stream.end(BEHIND);
}

/** Each index is a step from one of the last two that were used. */
function indices(bytes: Uint8Array, count: number, out: Uint16Array | Uint32Array) {
  const stream = new Stream(bytes, 1);
  const last = new Uint32Array(2);
  for (let i = 0; i < count; i++) {
    const value = stream.number();
    out[i] = last[value & 1] += signed(value >>> 1);
  }
  stream.end(4);
}

/** Floats of a signed 8-bit exponent and a signed 24-bit mantissa. */
function exponential(bytes: Uint8Array) {
  const from = new Int32Array(bytes.buffer);
  const to = new Float32Array(bytes.buffer);
  for (let i = 0; i < from.length; i++) to[i] = 2 ** (from[i] >> 24) * ((from[i] << 8) >> 8);
}

const HEADS = { ATTRIBUTES: 0xa0, TRIANGLES: 0xe1, INDICES: 0xd1 };

/** What the view holds. The studio does not read normals and rotations, which have filters of their own. */
export function unpackView(
  { count, byteStride: stride, mode, filter = 'NONE' }: Packed,
  bytes: Uint8Array,
): Uint8Array {
  const whole = mode === 'ATTRIBUTES' ? stride % 4 === 0 && stride > 0 && stride <= 256 : stride === 2 || stride === 4;
  const behind = mode === 'ATTRIBUTES' ? stride : mode === 'TRIANGLES' ? BEHIND : 0;
  if (bytes[0] !== HEADS[mode] || !whole || bytes.length < 1 + behind || count * stride > MOST * bytes.length)
    throw damaged();
  if (mode === 'TRIANGLES' && count % 3) throw damaged();
  if (mode === 'ATTRIBUTES') {
    const out = attributes(bytes, count, stride);
    if (filter === 'EXPONENTIAL') exponential(out);
    else if (filter !== 'NONE') throw new Error(`The studio does not read data with the filter ${filter}.`);
    return out;
  }
  const out = stride === 2 ? new Uint16Array(count) : new Uint32Array(count);
  (mode === 'TRIANGLES' ? triangles : indices)(bytes, count, out);
  return new Uint8Array(out.buffer);
}
