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
import { mendedMesh } from './mended';
import { openMesh, parseMesh, type RawMesh } from './parse';
import { proposeLandmarks } from './propose';
import { stretchOf, touched, type Touched } from './linked';
import { undoFit } from './fit';
import { otherOf, sideOf, type Other } from './others';
import { faceNormal, pointOf, toView } from './surface';
import { mirrored, sideOfPlane, symmetryOf, type Plane } from './symmetry';
import type { Place } from 'orbmorph';

interface Held {
  raw: RawMesh;
  frame: Frame;
  bvh?: Bvh;
  /** vertices from this number on are not in the file: a repair added them */
  added: number;
  /** as the page reads it; undefined where only the daemon can */
  file?: RawMesh;
  /** undefined until it is searched */
  plane?: Plane | null;
}

const held = new Map<string, Held>();
/** What morphs. `drawn`: the number of vertices that the page draws, which is larger. */
const morphs = new Map<string, MorphData & { drawn: number }>();
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

/** A copy of what morphs, without a skin. */
function movingOf(data: MorphData): MorphData {
  const { vertices, corners } = data.moving;
  return {
    ...data,
    position: data.position.slice(0, 3 * vertices),
    index: data.index.slice(0, corners),
    targets: data.targets.map((t) => ({ ...t, position: t.position.slice(0, 3 * vertices) })),
    shapes: data.shapes.map((weights) => weights.slice()),
    skin: undefined,
  };
}

/** Values of vertices with zeros for those that stay as they are. */
function padded(values: Float32Array, count: number): Float32Array {
  const out = new Float32Array(count);
  out.set(values);
  return out;
}

const ops = {
  async open(key: string, buffer: ArrayBuffer): Promise<Display> {
    const raw = await openMesh(buffer);
    if (!raw.corners.length) throw new Error('The file has no triangles.');
    const display = buildDisplay(raw);
    held.set(key, { raw, frame: display.frame, added: Infinity, file: raw });
    await decodeImages(display.skin);
    return display;
  },

  /** Replaces a mesh by what the daemon made of its file: sphere.ply has it, with the numbers of the file. */
  async openRepaired(key: string, buffer: ArrayBuffer): Promise<Display> {
    const file = held.get(key)?.file;
    const { raw, added } = mendedMesh(parseMesh(buffer), file);
    const display = buildDisplay(raw);
    held.set(key, { raw, frame: display.frame, added, file });
    await decodeImages(display.skin);
    return display;
  },

  /** Each shape of a morph as the text of an OBJ file. */
  shapesOf(buffer: ArrayBuffer, count: number): string[] {
    const { position, targets, index, shapes } = movingOf(decodeMorph(buffer, count));
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

  /** carried: how many targets the asset got from the files */
  async morph(key: string, buffer: ArrayBuffer, shapeCount: number, look = 0, carried = 0): Promise<MorphData> {
    const data = decodeMorph(buffer, shapeCount, look, carried);
    morphs.clear();
    morphs.set(key, { ...movingOf(data), drawn: data.position.length / 3 });
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
    return morph ? stretchOf(morph).map((values) => padded(values, morph.drawn)) : [];
  },

  /**
   * How other matches differ from the shown one. found: its landmarks, with their places on all shapes; others: the shape
   * that each other match matches differently, and its places.
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
    return proposeLandmarks(movingOf(decodeMorph(buffer, shapeCount)), count);
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
    return { values, made: padded(made, morph.drawn), max, rms: Math.sqrt(sum / Math.max(count, 1)) };
  },
};

export type Ops = typeof ops;

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
