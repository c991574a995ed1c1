/** Turns a parsed mesh into what the GPU draws: scaled to the unit ball, with smooth normals, creases and edges. */
import { splitByLook, type Skin } from './dress';
import type { RawMesh } from './parse';
import { areaNormal } from './triangle';

export interface Frame {
  center: [number, number, number];
  /** half the diagonal of the bounding box; view = (file - center) / radius */
  radius: number;
}

export interface Display {
  format: string;
  frame: Frame;
  vertices: number;
  triangles: number;
  position: Float32Array;
  normal: Float32Array;
  index: Uint32Array;
  edges: Uint32Array;
  /** its images are decoded later */
  skin?: Skin;
  extras?: RawMesh['extras'];
  beyond?: RawMesh['beyond'];
  content?: RawMesh['content'];
}

export function frameOf(positions: ArrayLike<number>, used?: Uint32Array): Frame {
  const min = [Infinity, Infinity, Infinity];
  const max = [-Infinity, -Infinity, -Infinity];
  const count = used ? used.length : positions.length / 3;
  for (let i = 0; i < count; i++) {
    const v = used ? used[i] : i;
    for (let k = 0; k < 3; k++) {
      const x = positions[3 * v + k];
      if (x < min[k]) min[k] = x;
      if (x > max[k]) max[k] = x;
    }
  }
  if (!(min[0] <= max[0])) return { center: [0, 0, 0], radius: 1 };
  const d = Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]);
  return { center: [(min[0] + max[0]) / 2, (min[1] + max[1]) / 2, (min[2] + max[2]) / 2], radius: d / 2 || 1 };
}

/** Numbers the distinct positions. Returns the number of each vertex's position. */
export function weld(positions: Float64Array): { place: Uint32Array; count: number } {
  const n = positions.length / 3;
  let size = 1;
  while (size < n * 2) size *= 2;
  const table = new Int32Array(size).fill(-1);
  const place = new Uint32Array(n);
  const bits = new Uint32Array(positions.buffer, positions.byteOffset, positions.length * 2);
  let count = 0;
  for (let v = 0; v < n; v++) {
    let hash = 0;
    for (let k = 0; k < 6; k++) hash = (Math.imul(hash ^ bits[6 * v + k], 0x9e3779b1) ^ (hash >>> 15)) >>> 0;
    let slot = hash & (size - 1);
    for (;;) {
      const other = table[slot];
      if (other < 0) {
        table[slot] = v;
        place[v] = count++;
        break;
      }
      if (
        positions[3 * other] === positions[3 * v] &&
        positions[3 * other + 1] === positions[3 * v + 1] &&
        positions[3 * other + 2] === positions[3 * v + 2]
      ) {
        place[v] = place[other];
        break;
      }
      slot = (slot + 1) & (size - 1);
    }
  }
  return { place, count };
}

/** Normals weighted by area, split where faces meet at more than the crease angle. */
export function buildDisplay(raw: RawMesh, creaseDegrees = 48): Display {
  const { positions, corners } = raw;
  const frame = frameOf(positions, corners);
  const triangles = corners.length / 3;
  const { place, count: places } = weld(positions);

  const face = new Float32Array(triangles * 3);
  const length = new Float32Array(triangles);
  for (let t = 0; t < triangles; t++) {
    const a = 3 * corners[3 * t];
    const b = 3 * corners[3 * t + 1];
    const c = 3 * corners[3 * t + 2];
    const s = 1 / frame.radius;
    const ux = (positions[b] - positions[a]) * s;
    const uy = (positions[b + 1] - positions[a + 1]) * s;
    const uz = (positions[b + 2] - positions[a + 2]) * s;
    const vx = (positions[c] - positions[a]) * s;
    const vy = (positions[c + 1] - positions[a + 1]) * s;
    const vz = (positions[c + 2] - positions[a + 2]) * s;
    const nx = uy * vz - uz * vy;
    const ny = uz * vx - ux * vz;
    const nz = ux * vy - uy * vx;
    face[3 * t] = nx;
    face[3 * t + 1] = ny;
    face[3 * t + 2] = nz;
    length[t] = Math.hypot(nx, ny, nz);
  }

  // the corners at each position
  const first = new Uint32Array(places + 1);
  for (let i = 0; i < corners.length; i++) first[place[corners[i]] + 1]++;
  for (let p = 0; p < places; p++) first[p + 1] += first[p];
  const around = new Uint32Array(corners.length);
  const fill = first.slice(0, places);
  for (let i = 0; i < corners.length; i++) around[fill[place[corners[i]]]++] = i;

  const cosine = Math.cos((creaseDegrees * Math.PI) / 180);
  const index = new Uint32Array(corners.length);
  let position = new Float32Array(places * 3 + 3072);
  let normal = new Float32Array(places * 3 + 3072);
  let n = 0;
  for (let p = 0; p < places; p++) {
    const start = n;
    for (let j = first[p]; j < first[p + 1]; j++) {
      const corner = around[j];
      const t = (corner / 3) | 0;
      const l = length[t] || 1;
      let group = -1;
      for (let g = start; g < n; g++) {
        const d =
          normal[3 * g] * face[3 * t] + normal[3 * g + 1] * face[3 * t + 1] + normal[3 * g + 2] * face[3 * t + 2];
        const gl = Math.hypot(normal[3 * g], normal[3 * g + 1], normal[3 * g + 2]);
        if (creaseDegrees >= 180 || d >= cosine * gl * l) {
          group = g;
          break;
        }
      }
      if (group < 0) {
        group = n++;
        if (3 * n > position.length) {
          position = grown(position);
          normal = grown(normal);
        }
        const v = corners[corner];
        for (let k = 0; k < 3; k++) {
          position[3 * group + k] = (positions[3 * v + k] - frame.center[k]) / frame.radius;
          normal[3 * group + k] = 0;
        }
      }
      for (let k = 0; k < 3; k++) normal[3 * group + k] += face[3 * t + k];
      index[corner] = group;
    }
  }
  normalize(normal, n);
  let skin: Skin | undefined;
  if (raw.dress) {
    const split = splitByLook(raw.dress, corners, index, n);
    skin = split.skin;
    position = gathered(position, split.from);
    normal = gathered(normal, split.from);
    n = split.from.length;
  }
  return {
    format: raw.format,
    frame,
    vertices: positions.length / 3,
    triangles,
    position: position.slice(0, 3 * n),
    normal: normal.slice(0, 3 * n),
    index,
    edges: edgesOf(index),
    skin,
    extras: raw.extras,
    beyond: raw.beyond,
    content: raw.content,
  };
}

function gathered(values: Float32Array, from: number[]): Float32Array<ArrayBuffer> {
  const out = new Float32Array(3 * from.length);
  from.forEach((v, i) => out.set(values.subarray(3 * v, 3 * v + 3), 3 * i));
  return out;
}

function grown(old: Float32Array): Float32Array<ArrayBuffer> {
  const wider = new Float32Array(old.length * 2);
  wider.set(old);
  return wider;
}

export function normalize(normal: Float32Array, n: number) {
  for (let i = 0; i < 3 * n; i += 3) {
    const l = Math.hypot(normal[i], normal[i + 1], normal[i + 2]) || 1;
    normal[i] /= l;
    normal[i + 1] /= l;
    normal[i + 2] /= l;
  }
}

/** Smooth normals of an indexed mesh. */
export function smoothNormals(position: Float32Array, index: Uint32Array): Float32Array {
  const normal = new Float32Array(position.length);
  for (let t = 0; t < index.length; t += 3) {
    const a = 3 * index[t];
    const b = 3 * index[t + 1];
    const c = 3 * index[t + 2];
    const [nx, ny, nz] = areaNormal(position, a, b, c);
    for (const v of [a, b, c]) {
      normal[v] += nx;
      normal[v + 1] += ny;
      normal[v + 2] += nz;
    }
  }
  normalize(normal, normal.length / 3);
  return normal;
}

/** Each edge once, as pairs of vertices. */
export function edgesOf(index: Uint32Array): Uint32Array {
  let size = 1;
  while (size < index.length * 2) size *= 2;
  const low = new Int32Array(size).fill(-1);
  const high = new Int32Array(size);
  const out = new Uint32Array(index.length * 2);
  let n = 0;
  for (let t = 0; t < index.length; t += 3)
    for (let k = 0; k < 3; k++) {
      const i = index[t + k];
      const j = index[t + ((k + 1) % 3)];
      const a = Math.min(i, j);
      const b = Math.max(i, j);
      let slot = ((Math.imul(a, 0x9e3779b1) ^ Math.imul(b, 0x85ebca6b)) >>> 7) & (size - 1);
      while (low[slot] >= 0 && (low[slot] !== a || high[slot] !== b)) slot = (slot + 1) & (size - 1);
      if (low[slot] >= 0) continue;
      low[slot] = a;
      high[slot] = b;
      out[n++] = a;
      out[n++] = b;
    }
  return out.slice(0, n);
}

/** Finds the triangles of all components but the largest. Returns triangle flags and the number of components. */
export function loosePieces(raw: RawMesh): { loose: Uint8Array; pieces: number } {
  const { place, count } = weld(raw.positions);
  const parent = Uint32Array.from({ length: count }, (_, i) => i);
  const find = (v: number) => {
    while (parent[v] !== v) v = parent[v] = parent[parent[v]];
    return v;
  };
  const { corners } = raw;
  for (let t = 0; t < corners.length; t += 3) {
    const a = find(place[corners[t]]);
    parent[find(place[corners[t + 1]])] = a;
    parent[find(place[corners[t + 2]])] = a;
  }
  const sizes = new Map<number, number>();
  for (let t = 0; t < corners.length; t += 3) {
    const root = find(place[corners[t]]);
    sizes.set(root, (sizes.get(root) ?? 0) + 1);
  }
  let largest = -1;
  for (const [root, size] of sizes) if (largest < 0 || size > sizes.get(largest)!) largest = root;
  const loose = new Uint8Array(corners.length / 3);
  for (let t = 0; t < loose.length; t++) loose[t] = find(place[corners[3 * t]]) === largest ? 0 : 1;
  return { loose, pieces: sizes.size };
}

/** Edges without exactly two faces: boundaries of holes and non-manifold edges. Returns pairs of vertices. */
export function defectiveEdges(raw: RawMesh, welded: boolean): Uint32Array {
  const n = raw.positions.length / 3;
  const place = welded ? weld(raw.positions).place : Uint32Array.from({ length: n }, (_, i) => i);
  const uses = new Map<number, [number, number, number]>();
  const { corners } = raw;
  for (let t = 0; t < corners.length; t += 3)
    for (let k = 0; k < 3; k++) {
      const i = corners[t + k];
      const j = corners[t + ((k + 1) % 3)];
      const a = Math.min(place[i], place[j]);
      const b = Math.max(place[i], place[j]);
      const key = a * n + b;
      const known = uses.get(key);
      if (known) known[0]++;
      else uses.set(key, [1, i, j]);
    }
  const out: number[] = [];
  for (const [count, i, j] of uses.values()) if (count !== 2) out.push(i, j);
  return Uint32Array.from(out);
}
