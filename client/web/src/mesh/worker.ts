/// <reference lib="webworker" />
/**
 * Does all long computations: parsing, geometry, picking, distortion, errors. A request is {id, op, args}. The worker
 * keeps parsed meshes under a key, so the page needs no copy for picking and error maps.
 */
import { Bvh } from './bvh';
import { decodeMorph, type MorphData } from './morph';
import { decodeSphere, type SphereData } from './distortion';
import { buildDisplay, defectiveEdges, loosePieces, type Display, type Frame } from './geometry';
import { decodeImages } from './dress';
import { parseMesh, type RawMesh } from './parse';
import { proposeLandmarks } from './propose';
import { stretchOf, touched, type Touched } from './linked';
import { otherOf, sideOf, type Other } from './others';
import { mirrored, sideOfPlane, symmetryOf, type Plane } from './symmetry';
import type { Place } from 'orbmorph';

interface Held {
  raw: RawMesh;
  frame: Frame;
  bvh?: Bvh;
  /** vertices from this number on are not in the file: a repair added them */
  added: number;
  /** undefined until it is searched */
  plane?: Plane | null;
}

const held = new Map<string, Held>();
const morphs = new Map<string, MorphData>();
const spheres = new Map<string, { surface: Float32Array; index: Uint32Array; place: Float32Array; bvh?: Bvh }>();

export interface Spot {
  /** in view coordinates */
  position: [number, number, number];
  normal: [number, number, number];
  place: Place;
}

function bvhOf(mesh: Held): Bvh {
  return (mesh.bvh ??= new Bvh(mesh.raw.positions, mesh.raw.corners));
}

function planeOf(mesh: Held): Plane | null {
  if (mesh.plane === undefined) mesh.plane = symmetryOf(mesh.raw, bvhOf(mesh), mesh.frame.radius);
  return mesh.plane;
}

function faceNormal({ positions: p, corners }: RawMesh, t: number): [number, number, number] {
  const [a, b, c] = [3 * corners[3 * t], 3 * corners[3 * t + 1], 3 * corners[3 * t + 2]];
  const ux = p[b] - p[a];
  const uy = p[b + 1] - p[a + 1];
  const uz = p[b + 2] - p[a + 2];
  const vx = p[c] - p[a];
  const vy = p[c + 1] - p[a + 1];
  const vz = p[c + 2] - p[a + 2];
  const n = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
  const l = Math.hypot(n[0], n[1], n[2]) || 1;
  return [n[0] / l, n[1] / l, n[2] / l];
}

function toView(frame: Frame, x: ArrayLike<number>, at = 0): [number, number, number] {
  const { center, radius } = frame;
  return [(x[at] - center[0]) / radius, (x[at + 1] - center[1]) / radius, (x[at + 2] - center[2]) / radius];
}

function pointOf({ positions: p, corners }: RawMesh, t: number, w: [number, number, number]): [number, number, number] {
  const out: [number, number, number] = [0, 0, 0];
  for (let c = 0; c < 3; c++) for (let k = 0; k < 3; k++) out[k] += w[c] * p[3 * corners[3 * t + c] + k];
  return out;
}

/** A place in the coordinates of the file. */
function placeOn({ raw }: Held, place: Place): number[] {
  if ('point' in place) return place.point;
  if ('vertex' in place) return [0, 1, 2].map((k) => raw.positions[3 * place.vertex + k]);
  return pointOf(raw, place.triangle, place.barycentric);
}

/** The nearest corner if it is near (within 1 % of the diagonal), otherwise the point itself. */
function spotOn(mesh: Held, t: number, u: number, v: number): Spot {
  const { raw, frame } = mesh;
  const weights: [number, number, number] = [1 - u - v, u, v];
  const point = pointOf(raw, t, weights);
  const normal = faceNormal(raw, t);
  const corner = weights.indexOf(Math.max(...weights));
  const vertex = raw.corners[3 * t + corner];
  const at = 3 * vertex;
  const p = raw.positions;
  const away = Math.hypot(p[at] - point[0], p[at + 1] - point[1], p[at + 2] - point[2]);
  if (away <= 0.02 * frame.radius && vertex < mesh.added)
    return { position: toView(frame, p, at), normal, place: { vertex } };
  return { position: toView(frame, point), normal, place: { point } };
}

/** For each wanted vertex a triangle that has it, for the vertex's normal. */
function facesAt(raw: RawMesh, wanted: Set<number>): Map<number, number> {
  const found = new Map<number, number>();
  if (!wanted.size) return found;
  for (let c = 0; c < raw.corners.length; c++) {
    const v = raw.corners[c];
    if (wanted.has(v) && !found.has(v)) {
      found.set(v, (c / 3) | 0);
      if (found.size === wanted.size) break;
    }
  }
  return found;
}

const ops = {
  async open(key: string, buffer: ArrayBuffer): Promise<Display> {
    const raw = parseMesh(buffer);
    if (!raw.corners.length) throw new Error('The file has no triangles.');
    const display = buildDisplay(raw);
    held.set(key, { raw, frame: display.frame, added: Infinity });
    await decodeImages(display.skin);
    return display;
  },

  /** Replaces a mesh by what the daemon made of its file: sphere.ply has it, with the numbers of the file. */
  openRepaired(key: string, buffer: ArrayBuffer): Display {
    const repaired = parseMesh(buffer);
    const source = repaired.properties?.get('source');
    if (!source) throw new Error('The daemon did not say which vertices the mesh has.');
    const added = source.reduce((most, s) => Math.max(most, s + 1), 0);
    const number = new Uint32Array(source.length);
    let next = added;
    source.forEach((s, i) => (number[i] = s >= 0 ? s : next++));
    const raw: RawMesh = {
      format: repaired.format,
      positions: new Float64Array(3 * next),
      corners: repaired.corners.map((v) => number[v]),
    };
    number.forEach((to, i) => raw.positions.set(repaired.positions.subarray(3 * i, 3 * i + 3), 3 * to));
    const display = buildDisplay(raw);
    held.set(key, { raw, frame: display.frame, added });
    return display;
  },

  /** Each shape of a morph as the text of an OBJ file. */
  shapesOf(buffer: ArrayBuffer, count: number): string[] {
    const { position, targets, index, shapes } = decodeMorph(buffer, count);
    const faces: string[] = [];
    for (let c = 0; c < index.length; c += 3) faces.push(`f ${index[c] + 1} ${index[c + 1] + 1} ${index[c + 2] + 1}\n`);
    return shapes.map((weights) => {
      const points: string[] = [];
      for (let i = 0; i < position.length; i += 3) {
        const at = (k: number) => targets.reduce((x, t, n) => x + weights[n] * t.position[i + k], position[i + k]);
        points.push(`v ${at(0)} ${at(1)} ${at(2)}\n`);
      }
      return points.concat(faces).join('');
    });
  },

  close(key: string) {
    held.delete(key);
    morphs.delete(key);
    spheres.delete(key);
  },

  pick(key: string, origin: number[], direction: number[]): Spot | null {
    const mesh = held.get(key);
    if (!mesh) return null;
    const { center, radius } = mesh.frame;
    const o = origin.map((x, k) => x * radius + center[k]);
    const d = direction.map((x) => x * radius);
    const hit = bvhOf(mesh).ray(o[0], o[1], o[2], d[0], d[1], d[2]);
    return hit && spotOn(mesh, hit.triangle, hit.u, hit.v);
  },

  /** Whether the shape has one clear plane of symmetry. */
  symmetric(key: string): boolean {
    const mesh = held.get(key);
    return !!mesh && !!planeOf(mesh);
  },

  /** The spot on the other side of the plane of symmetry; null near the plane, or where the surface is not symmetric. */
  mirror(key: string, position: number[]): Spot | null {
    const mesh = held.get(key);
    const plane = mesh && planeOf(mesh);
    if (!plane) return null;
    const { center, radius } = mesh.frame;
    const here = position.map((x, k) => x * radius + center[k]);
    const there = mirrored(plane, here);
    if (Math.hypot(...there.map((x, k) => x - here[k])) < 0.06 * radius) return null;
    const hit = bvhOf(mesh).closest(there[0], there[1], there[2]);
    return hit && hit.t < 0.05 * radius ? spotOn(mesh, hit.triangle, hit.u, hit.v) : null;
  },

  /** With `snap`, points become a near vertex (see spotOn). */
  locate(key: string, places: Place[], snap = false): (Spot | null)[] {
    const mesh = held.get(key);
    if (!mesh) return places.map(() => null);
    const { raw, frame } = mesh;
    const vertices = new Set(places.flatMap((place) => ('vertex' in place ? [place.vertex] : [])));
    const faces = facesAt(raw, vertices);
    return places.map((place) => {
      if ('vertex' in place) {
        const t = faces.get(place.vertex);
        if (t === undefined) return null;
        return { position: toView(frame, raw.positions, 3 * place.vertex), normal: faceNormal(raw, t), place };
      }
      if ('triangle' in place) {
        if (3 * place.triangle >= raw.corners.length) return null;
        const point = pointOf(raw, place.triangle, place.barycentric);
        return { position: toView(frame, point), normal: faceNormal(raw, place.triangle), place };
      }
      const hit = bvhOf(mesh).closest(place.point[0], place.point[1], place.point[2]);
      if (hit && snap) return spotOn(mesh, hit.triangle, hit.u, hit.v);
      return hit && { position: toView(frame, place.point), normal: faceNormal(raw, hit.triangle), place };
    });
  },

  /** The segments, points and triangles to draw in red, in view coordinates. */
  defects(key: string, kind: string, edges: number[][], vertices: number[]) {
    const mesh = held.get(key);
    if (!mesh)
      return { lines: new Float32Array(), triangles: new Float32Array(), points: new Float32Array(), found: 0 };
    const { raw, frame } = mesh;
    let pairs: ArrayLike<number> = edges.flat();
    if (!pairs.length && (kind === 'not-closed' || kind === 'not-manifold')) {
      pairs = defectiveEdges(raw, false);
      const welded = defectiveEdges(raw, true);
      if (welded.length && welded.length < pairs.length) pairs = welded;
    }
    const known = raw.positions.length / 3;
    const segments = Array.from(pairs).filter((_, i) => pairs[i & ~1] < known && pairs[i | 1] < known);
    const lines = new Float32Array(segments.length * 3);
    segments.forEach((v, i) => lines.set(toView(frame, raw.positions, 3 * v), 3 * i));
    const dots = vertices.filter((v) => v < known);
    const points = new Float32Array(dots.length * 3);
    dots.forEach((v, i) => points.set(toView(frame, raw.positions, 3 * v), 3 * i));
    const flat: number[] = [];
    let found = segments.length / 2 + dots.length;
    if (kind === 'not-connected') {
      const { loose, pieces } = loosePieces(raw);
      found = pieces;
      loose.forEach((is, t) => {
        if (is) for (let c = 0; c < 3; c++) flat.push(...toView(frame, raw.positions, 3 * raw.corners[3 * t + c]));
      });
    }
    return { lines, points, triangles: Float32Array.from(flat), found };
  },

  async morph(key: string, buffer: ArrayBuffer, shapeCount: number, look = 0): Promise<MorphData> {
    const data = decodeMorph(buffer, shapeCount, look);
    morphs.clear();
    morphs.set(key, {
      ...data,
      position: data.position.slice(),
      index: data.index.slice(),
      targets: data.targets.map((t) => ({ ...t, position: t.position.slice() })),
      shapes: data.shapes.map((weights) => weights.slice()),
      skin: undefined,
    });
    await decodeImages(data.skin);
    return data;
  },

  /** Where a ray meets a morph with the weights `seen`, and where that place is with other weights. */
  touch(
    key: string,
    seen: ArrayLike<number>,
    ray: { origin: number[]; direction: number[] },
    others: ArrayLike<number>[],
  ): Touched[] | null {
    const morph = morphs.get(key);
    return morph ? touched(morph, seen, ray, others) : null;
  },

  /** How much a morph stretches its surface at each drawn vertex, for each shape. */
  stretch(key: string): Float32Array[] {
    const morph = morphs.get(key);
    return morph ? stretchOf(morph) : [];
  },

  /**
   * What other matches do otherwise than the shown one. found: its landmarks, with their places on all shapes; others:
   * which shape each of the other matches takes otherwise, and its places.
   */
  others(
    keys: string[],
    found: { name: string; at: Place[] }[],
    others: { shape: number; places: Place[][] }[],
  ): Other[] {
    const meshes = keys.map((key) => held.get(key));
    const points = (at: Place[], shape: number) =>
      [0, shape].map((s) => (meshes[s] && at[s] ? placeOn(meshes[s]!, at[s]) : [Infinity, 0, 0]));
    const plane = meshes[0] && planeOf(meshes[0]);
    const sides = found.map(({ name, at }) =>
      plane ? sideOfPlane(plane, points(at, 0)[0], meshes[0]!.frame.radius) : sideOf(name),
    );
    return others.map(({ shape, places }) =>
      otherOf(
        found.map(({ at }) => points(at, shape)),
        places.map((at) => points(at, shape)),
        sides,
        [0, shape].map((s) => 2 * (meshes[s]?.frame.radius ?? 1)),
      ),
    );
  },

  /** For each proposed landmark a point on every shape, in the shape's file coordinates. The asset has `fit` none. */
  propose(buffer: ArrayBuffer, shapeCount: number, count: number): [number, number, number][][] {
    return proposeLandmarks(decodeMorph(buffer, shapeCount), count);
  },

  /** The surface and the sphere in a PLY from the daemon. Keeps them under `key` for sphereSpots(). */
  sphere(key: string, buffer: ArrayBuffer): SphereData {
    const data = decodeSphere(buffer);
    spheres.set(key, {
      surface: data.surface.position.slice(),
      index: data.surface.index.slice(),
      place: data.sphere.slice(),
    });
    return data;
  },

  /** The points of the sphere that correspond to points of the surface, both in view coordinates. */
  sphereSpots(key: string, points: number[][]): [number, number, number][] {
    const sphere = spheres.get(key);
    if (!sphere) return [];
    const { index, place } = sphere;
    const bvh = (sphere.bvh ??= new Bvh(sphere.surface, index));
    return points.map(([x, y, z]) => {
      const hit = bvh.closest(x, y, z)!;
      const weights = [1 - hit.u - hit.v, hit.u, hit.v];
      const p = [0, 1, 2].map((k) =>
        weights.reduce((sum, w, c) => sum + w * place[3 * index[3 * hit.triangle + c] + k], 0),
      );
      const l = Math.hypot(p[0], p[1], p[2]) || 1;
      return [p[0] / l, p[1] / l, p[2] / l];
    });
  },

  /**
   * For each drawn vertex of a shape its distance from the supermesh, relative to the shape's diagonal. If the asset
   * has moved and scaled the shape (asset.fit), undoFit() first moves it back.
   */
  error(
    key: string,
    morphKey: string,
    shape: number,
    fitted: boolean,
  ): { values: Float32Array; made: Float32Array; max: number; rms: number } {
    const mesh = held.get(key);
    const morph = morphs.get(morphKey);
    if (!mesh || !morph) throw new Error('The shape or the morph is not loaded.');
    const { raw, frame } = mesh;
    const moved = morph.position.slice();
    morph.shapes[shape].forEach((w, k) => {
      if (w) for (let i = 0; i < moved.length; i++) moved[i] += w * morph.targets[k].position[i];
    });
    const file = new Float64Array(moved.length);
    for (let i = 0; i < moved.length; i++) file[i] = moved[i] * morph.frame.radius + morph.frame.center[i % 3];
    const place = fitted ? undoFit(raw, file, morph.index) : file;
    const bvh = new Bvh(place, morph.index);
    const n = raw.positions.length / 3;
    const distance = new Float32Array(n).fill(-1);
    let last = Infinity;
    let max = 0;
    let sum = 0;
    let count = 0;
    const p = raw.positions;
    const made = new Float32Array(morph.position.length / 3);
    const away = (x: number, y: number, z: number) => {
      const hit = bvh.closest(x, y, z, last) ?? bvh.closest(x, y, z);
      last = (hit?.t ?? 0) * 4 + 0.02 * frame.radius;
      const d = (hit?.t ?? 0) / (2 * frame.radius);
      for (let c = 0; hit && c < 3; c++) {
        const v = morph.index[3 * hit.triangle + c];
        made[v] = Math.max(made[v], d);
      }
      max = Math.max(max, d);
      sum += d * d;
      count++;
      return d;
    };
    // Also measured at edge midpoints and centroids: the corners get a triangle's largest error.
    for (let c = 0; c < raw.corners.length; c++) {
      const v = raw.corners[c];
      if (distance[v] < 0) distance[v] = away(p[3 * v], p[3 * v + 1], p[3 * v + 2]);
    }
    const middle = [0, 0, 0];
    for (let t = 0; t < raw.corners.length; t += 3)
      for (let k = 0; k < 4; k++) {
        const used = k === 3 ? [0, 1, 2] : [k, (k + 1) % 3];
        if (k < 3 && raw.corners[t + k] > raw.corners[t + used[1]]) continue; // each edge once
        for (let i = 0; i < 3; i++)
          middle[i] = used.reduce((total, corner) => total + p[3 * raw.corners[t + corner] + i], 0) / used.length;
        const d = away(middle[0], middle[1], middle[2]);
        for (const corner of used) {
          const v = raw.corners[t + corner];
          if (d > distance[v]) distance[v] = d;
        }
      }
    const display = buildDisplay(raw);
    const values = new Float32Array(display.position.length / 3);
    for (let c = 0; c < raw.corners.length; c++) values[display.index[c]] = distance[raw.corners[c]];
    return { values, made, max, rms: Math.sqrt(sum / Math.max(count, 1)) };
  },
};

export type Ops = typeof ops;

/**
 * Undoes the similarity that the asset has applied to a shape. It finds the least-squares similarity between the two
 * surfaces by nearest points, starting from 24 rotations, and then improves it by tangent planes.
 */
function undoFit(raw: RawMesh, place: Float64Array, index: Uint32Array): Float64Array {
  const a = moments(raw.positions, raw.corners);
  const b = moments(place, index);
  const scale = a.spread / b.spread;
  let best: Float64Array = place;
  let least = Infinity;
  const bvh = new Bvh(raw.positions, raw.corners);
  const stride = Math.max(1, Math.floor(place.length / 3 / 1500));
  const nearer = (moved: Float64Array, rounds: number, gain: number): [Float64Array, number] => {
    let cost = Infinity;
    for (let round = 0; round < rounds; round++) {
      const from: number[][] = [];
      const to: number[][] = [];
      let sum = 0;
      for (let v = 0; v < place.length / 3; v += stride) {
        const p = [moved[3 * v], moved[3 * v + 1], moved[3 * v + 2]];
        const hit = bvh.closest(p[0], p[1], p[2]);
        if (!hit) continue;
        from.push(p);
        to.push(pointOf(raw, hit.triangle, [1 - hit.u - hit.v, hit.u, hit.v]));
        sum += hit.t * hit.t;
      }
      if (sum > gain * cost) break;
      cost = sum;
      if (round === 3 && sum > 4 * least) break;
      moved = applyFit(moved, from, to);
    }
    return [moved, cost];
  };
  for (const rotation of rotations()) {
    const [moved, cost] = nearer(transformed(place, rotation, scale, b.center, a.center), 12, 0.98);
    if (cost < least) {
      least = cost;
      best = moved;
    }
  }
  for (let round = 0; round < 25; round++) {
    const next = towardsPlanes(raw, bvh, best, stride);
    if (!next) break;
    best = next;
  }
  return best;
}

/**
 * One step of a similarity towards the tangent planes of the nearest points, which converges far faster than nearest
 * points do: least squares in rotation (3), translation (3) and scale (1) around the centre. Returns null if the step
 * changes nothing.
 */
function towardsPlanes(raw: RawMesh, bvh: Bvh, all: Float64Array, stride: number): Float64Array | null {
  const c = [0, 1, 2].map((k) => {
    let sum = 0;
    for (let i = k; i < all.length; i += 3) sum += all[i];
    return (sum * 3) / all.length;
  });
  const A = Array.from({ length: 7 }, () => new Array<number>(8).fill(0));
  let size = 0;
  for (let i = 0; i < all.length; i += 3 * stride) {
    const hit = bvh.closest(all[i], all[i + 1], all[i + 2]);
    if (!hit) continue;
    const q = pointOf(raw, hit.triangle, [1 - hit.u - hit.v, hit.u, hit.v]);
    const n = faceNormal(raw, hit.triangle);
    const d = [all[i] - c[0], all[i + 1] - c[1], all[i + 2] - c[2]];
    size = Math.max(size, Math.hypot(d[0], d[1], d[2]));
    // biome-ignore format: rotation, translation, scale and right-hand side
    const row = [
      d[1] * n[2] - d[2] * n[1], d[2] * n[0] - d[0] * n[2], d[0] * n[1] - d[1] * n[0],
      n[0], n[1], n[2],
      n[0] * d[0] + n[1] * d[1] + n[2] * d[2],
      n[0] * (q[0] - all[i]) + n[1] * (q[1] - all[i + 1]) + n[2] * (q[2] - all[i + 2]),
    ];
    for (let r = 0; r < 7; r++) for (let k = 0; k < 8; k++) A[r][k] += row[r] * row[k];
  }
  for (let r = 0; r < 7; r++) A[r][r] *= 1 + 1e-9;
  for (let r = 0; r < 7; r++) {
    let pivot = r;
    for (let k = r + 1; k < 7; k++) if (Math.abs(A[k][r]) > Math.abs(A[pivot][r])) pivot = k;
    [A[r], A[pivot]] = [A[pivot], A[r]];
    if (Math.abs(A[r][r]) < 1e-300) return null;
    for (let k = 0; k < 7; k++) {
      if (k === r) continue;
      const f = A[k][r] / A[r][r];
      for (let j = r; j < 8; j++) A[k][j] -= f * A[r][j];
    }
  }
  const x = A.map((row, r) => row[7] / row[r]);
  const angle = Math.hypot(x[0], x[1], x[2]);
  if (angle + Math.hypot(x[3], x[4], x[5]) / size + Math.abs(x[6]) < 1e-10) return null;
  const [ux, uy, uz] = angle > 0 ? [x[0] / angle, x[1] / angle, x[2] / angle] : [1, 0, 0];
  const s = Math.sin(angle);
  const h = 1 - Math.cos(angle);
  // biome-ignore format: rows of a matrix
  const m = [
    1 - h * (uy * uy + uz * uz), h * ux * uy - s * uz, h * ux * uz + s * uy,
    h * ux * uy + s * uz, 1 - h * (ux * ux + uz * uz), h * uy * uz - s * ux,
    h * ux * uz - s * uy, h * uy * uz + s * ux, 1 - h * (ux * ux + uy * uy),
  ];
  return transformed(all, m, Math.exp(x[6]), c, [c[0] + x[3], c[1] + x[4], c[2] + x[5]]);
}

/** Centre of area and root mean square radius. */
function moments(p: ArrayLike<number>, corners: Uint32Array) {
  const center = [0, 0, 0];
  let area = 0;
  let second = 0;
  for (const pass of [0, 1])
    for (let t = 0; t < corners.length; t += 3) {
      const [a, b, c] = [3 * corners[t], 3 * corners[t + 1], 3 * corners[t + 2]];
      const ux = p[b] - p[a];
      const uy = p[b + 1] - p[a + 1];
      const uz = p[b + 2] - p[a + 2];
      const vx = p[c] - p[a];
      const vy = p[c + 1] - p[a + 1];
      const vz = p[c + 2] - p[a + 2];
      const w = Math.hypot(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx);
      const m = [0, 1, 2].map((k) => (p[a + k] + p[b + k] + p[c + k]) / 3);
      if (pass === 0) {
        area += w;
        for (let k = 0; k < 3; k++) center[k] += w * m[k];
      } else second += w * ((m[0] - center[0]) ** 2 + (m[1] - center[1]) ** 2 + (m[2] - center[2]) ** 2);
      if (pass === 0 && t + 3 >= corners.length) for (let k = 0; k < 3; k++) center[k] /= area || 1;
    }
  return { center, spread: Math.sqrt(second / (area || 1)) || 1 };
}

/** The 24 rotations of the cube. */
function* rotations(): Generator<number[]> {
  const axes = [
    [0, 1, 2],
    [1, 2, 0],
    [2, 0, 1],
    [0, 2, 1],
    [2, 1, 0],
    [1, 0, 2],
  ];
  for (const [n, order] of axes.entries())
    for (let s = 0; s < 8; s++) {
      const signs = [s & 1 ? -1 : 1, s & 2 ? -1 : 1, s & 4 ? -1 : 1];
      if (signs[0] * signs[1] * signs[2] * (n < 3 ? 1 : -1) < 0) continue;
      const m = new Array<number>(9).fill(0);
      order.forEach((column, row) => (m[3 * row + column] = signs[row]));
      yield m;
    }
}

function transformed(p: Float64Array, m: number[], scale: number, from: number[], to: number[]): Float64Array {
  const out = new Float64Array(p.length);
  for (let i = 0; i < p.length; i += 3) {
    const x = p[i] - from[0];
    const y = p[i + 1] - from[1];
    const z = p[i + 2] - from[2];
    for (let k = 0; k < 3; k++) out[i + k] = to[k] + scale * (m[3 * k] * x + m[3 * k + 1] * y + m[3 * k + 2] * z);
  }
  return out;
}

/** Applies to `all` the least-squares similarity from the points `from` to `to`, in Horn's closed form (1987). */
function applyFit(all: Float64Array, from: number[][], to: number[][]): Float64Array {
  const n = from.length;
  const mean = (list: number[][]) => [0, 1, 2].map((k) => list.reduce((s, p) => s + p[k], 0) / n);
  const a = mean(from);
  const b = mean(to);
  const S = new Array<number>(9).fill(0);
  let spread = 0;
  for (let i = 0; i < n; i++)
    for (let r = 0; r < 3; r++) {
      spread += (from[i][r] - a[r]) ** 2;
      for (let c = 0; c < 3; c++) S[3 * r + c] += (from[i][r] - a[r]) * (to[i][c] - b[c]);
    }
  const [xx, xy, xz, yx, yy, yz, zx, zy, zz] = S;
  const N = [
    [xx + yy + zz, yz - zy, zx - xz, xy - yx],
    [yz - zy, xx - yy - zz, xy + yx, zx + xz],
    [zx - xz, xy + yx, -xx + yy - zz, yz + zy],
    [xy - yx, zx + xz, yz + zy, -xx - yy + zz],
  ];
  // power iteration on the shifted matrix: its largest eigenvector is the rotation
  const shift = Math.sqrt(N.flat().reduce((s, x) => s + x * x, 0));
  let q = [1, 0, 0, 0];
  for (let round = 0; round < 300; round++) {
    const next = N.map((row, r) => row.reduce((s, x, c) => s + x * q[c], 0) + shift * q[r]);
    const l = Math.hypot(...next) || 1;
    q = next.map((x) => x / l);
  }
  const [w, x, y, z] = q;
  // biome-ignore format: rows of a matrix
  const m = [
    1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
  ];
  let dot = 0;
  for (let r = 0; r < 3; r++) for (let c = 0; c < 3; c++) dot += m[3 * c + r] * S[3 * r + c];
  return transformed(all, m, spread > 0 ? dot / spread : 1, a, b);
}

/** The buffers and images inside a reply, which postMessage transfers instead of copying. */
function buffersIn(value: unknown, found = new Set<Transferable>(), depth = 0): Set<Transferable> {
  if (ArrayBuffer.isView(value)) found.add(value.buffer as ArrayBuffer);
  else if (value instanceof ImageBitmap) found.add(value);
  else if (value && typeof value === 'object' && depth < 4)
    for (const part of Object.values(value)) buffersIn(part, found, depth + 1);
  return found;
}

self.onmessage = async (event: MessageEvent<{ id: number; op: keyof Ops; args: unknown[] }>) => {
  const { id, op, args } = event.data;
  try {
    const value = await (ops[op] as (...args: unknown[]) => unknown)(...args);
    self.postMessage({ id, value }, { transfer: [...buffersIn(value)] });
  } catch (error) {
    self.postMessage({ id, error: error instanceof Error ? error.message : String(error) });
  }
};
