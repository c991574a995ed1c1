/** A morph asset, decoded for the viewer: base, targets, wireframe, and the path through the shapes. */
import { dressOf, skinOf, tried, type Skin } from './dress';
import { type Gltf, type Part, readGlb } from './gltf';
import { edgesOf, smoothNormals, type Frame } from './geometry';

export interface MorphData {
  names: string[];
  /** the names of the variants of its materials, the first shape's own first; empty without variants */
  looks: string[];
  vertices: number;
  triangles: number;
  frame: Frame;
  position: Float32Array;
  normal: Float32Array;
  index: Uint32Array;
  edges: Uint32Array;
  targets: { position: Float32Array; normal: Float32Array }[];
  /** its images are decoded later */
  skin?: Skin;
  /** the path from the first to the last shape: for each time in 0..1 the weights of the targets */
  times: Float32Array;
  weights: Float32Array[];
  /** for each shape, the weights that show only this shape */
  shapes: Float32Array[];
}

export interface ShapeSurface {
  position: Float32Array;
}

function joined(arrays: Float32Array[]): Float32Array {
  const out = new Float32Array(arrays.reduce((n, a) => n + a.length, 0));
  let at = 0;
  for (const a of arrays) {
    out.set(a, at);
    at += a.length;
  }
  return out;
}

/** A part of the surface that morphs. */
interface Moving extends Part {
  /** the number of its first target that is a shape */
  first: number;
}

/** What morphs: the mesh of an asset, or in an uploaded document that has got targets those meshes that have. */
function movingParts(gltf: Gltf): Moving[] {
  const all = gltf.triangles();
  const first = (part: Part) => gltf.json.meshes?.[part.mesh].extras?.firstShape;
  const kept = all.filter((part) => first(part) !== undefined);
  return (kept.length ? kept : all.filter((part) => part.mesh === all[0].mesh)).map((part) => ({
    ...part,
    first: first(part) ?? 0,
  }));
}

/** Points (w = 1) or ways (w = 0) of a mesh in the scene. */
function inScene(values: Float32Array, m: number[], w: number): Float32Array {
  const out = new Float32Array(values.length);
  for (let i = 0; i < values.length; i += 3)
    for (let r = 0; r < 3; r++)
      out[i + r] = m[r] * values[i] + m[4 + r] * values[i + 1] + m[8 + r] * values[i + 2] + w * m[12 + r];
  return out;
}

const determinant = (m: number[]) =>
  m[0] * (m[5] * m[10] - m[9] * m[6]) - m[4] * (m[1] * m[10] - m[9] * m[2]) + m[8] * (m[1] * m[6] - m[5] * m[2]);

/** Normals of a mesh in the scene, plus `more` unless that is null: by the cofactors of the matrix. */
function normalsInScene(values: Float32Array, more: Float32Array | null, m: number[]): Float32Array {
  const sign = determinant(m) < 0 ? -1 : 1;
  const cofactors = new Array<number>(16).fill(0);
  for (let r = 0; r < 3; r++)
    for (let c = 0; c < 3; c++) {
      const [r1, r2, c1, c2] = [(r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3];
      cofactors[4 * c + r] = sign * (m[4 * c1 + r1] * m[4 * c2 + r2] - m[4 * c2 + r1] * m[4 * c1 + r2]);
    }
  const sum = more ? values.map((x, i) => x + more[i]) : values;
  const out = inScene(sum, cofactors, 0);
  for (let i = 0; i < out.length; i += 3) {
    const length = Math.hypot(out[i], out[i + 1], out[i + 2]) || 1;
    for (let k = 0; k < 3; k++) out[i + k] /= length;
  }
  return out;
}

/** The triangles of all parts, facing as they do in the scene. */
function joinedIndex(parts: Moving[]): Uint32Array {
  const index = new Uint32Array(parts.reduce((n, part) => n + part.index.length, 0));
  let at = 0;
  let base = 0;
  for (const part of parts) {
    const turned = determinant(part.matrix) < 0;
    for (let i = 0; i < part.index.length; i++) {
      const from = turned && i % 3 > 0 ? i + (i % 3 === 1 ? 1 : -1) : i;
      index[at++] = part.index[from] + base;
    }
    base += part.position.length / 3;
  }
  return index;
}

/** The parts with the materials of a variant. */
const dressedAs = (parts: Moving[], look: number): Moving[] =>
  parts.map((part) => {
    const { mappings = [] } = part.primitive.extensions?.KHR_materials_variants ?? {};
    const material = mappings.find(({ variants }) => variants.includes(look))?.material ?? part.primitive.material;
    return { ...part, primitive: { ...part.primitive, material } };
  });

/**
 * Targets 0 … shapeCount − 2 are the other shapes; the rest are in-betweens of a curved path, and those that came with
 * the files. look: the variant of the materials.
 */
export function decodeMorph(buffer: ArrayBuffer, shapeCount: number, look = 0): MorphData {
  const gltf = readGlb(buffer);
  const parts = dressedAs(movingParts(gltf), look);
  if (!parts.length) throw new Error('The asset has no triangles.');
  const targetCount = (parts[0].primitive.targets?.length ?? 0) - parts[0].first;
  const position = joined(parts.map((p) => inScene(p.position, p.matrix, 1)));
  const index = joinedIndex(parts);
  const hasNormals = parts.every((p) => p.primitive.attributes.NORMAL !== undefined);
  const normal = hasNormals
    ? joined(parts.map((p) => normalsInScene(gltf.floats(p.primitive.attributes.NORMAL), null, p.matrix)))
    : smoothNormals(position, index);
  const targets = Array.from({ length: targetCount }, (_, k) => {
    const of = (p: Moving) => p.primitive.targets![p.first + k];
    const delta = joined(parts.map((p) => inScene(gltf.floats(of(p).POSITION), p.matrix, 0)));
    const withNormals = hasNormals && parts.every((p) => of(p).NORMAL !== undefined);
    const there = withNormals
      ? joined(
          parts.map((p) => {
            const base = gltf.floats(p.primitive.attributes.NORMAL);
            return normalsInScene(base, gltf.floats(of(p).NORMAL), p.matrix);
          }),
        )
      : smoothNormals(
          position.map((x, i) => x + delta[i]),
          index,
        );
    return { position: delta, normal: there.map((x, i) => x - normal[i]) };
  });

  const dress = tried(() => dressOf(gltf, parts));
  const shapes = Array.from({ length: Math.min(shapeCount, targetCount + 1) }, (_, i) => single(i - 1, targetCount));
  const path = animationPath(gltf, parts[0].first, targetCount, shapes);
  const names = targetNames(gltf, parts[0], targetCount);
  const frame = fit(position, targets, shapes);
  for (let i = 0; i < position.length; i++) position[i] = (position[i] - frame.center[i % 3]) / frame.radius;
  for (const target of targets) for (let i = 0; i < position.length; i++) target.position[i] /= frame.radius;
  return {
    names,
    looks: (gltf.json.extensions?.KHR_materials_variants?.variants ?? []).map(({ name }) => name),
    vertices: position.length / 3,
    triangles: index.length / 3,
    frame,
    position,
    normal,
    index,
    edges: edgesOf(index),
    targets,
    skin: dress ? skinOf(dress, index) : undefined,
    times: path.times,
    weights: path.weights,
    shapes,
  };
}

function targetNames(gltf: Gltf, { mesh, first }: Moving, count: number): string[] {
  const names = gltf.json.meshes?.[mesh]?.extras?.targetNames;
  return Array.from({ length: count }, (_, k) => names?.[first + k] ?? `target ${k + 1}`);
}

/** The frame that contains every shape. */
function fit(position: Float32Array, targets: MorphData['targets'], shapes: Float32Array[]): Frame {
  const min = [Infinity, Infinity, Infinity];
  const max = [-Infinity, -Infinity, -Infinity];
  for (const weights of shapes) {
    const active = [...weights.keys()].filter((k) => weights[k] !== 0);
    for (let i = 0; i < position.length; i++) {
      let x = position[i];
      for (const k of active) x += weights[k] * targets[k].position[i];
      const axis = i % 3;
      if (x < min[axis]) min[axis] = x;
      if (x > max[axis]) max[axis] = x;
    }
  }
  const d = Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]);
  return { center: [(min[0] + max[0]) / 2, (min[1] + max[1]) / 2, (min[2] + max[2]) / 2], radius: d / 2 || 1 };
}

const single = (k: number, count: number) => Float32Array.from({ length: count }, (_, i) => (i === k ? 1 : 0));
const equal = (a: Float32Array, b: Float32Array) => a.every((x, i) => Math.abs(x - b[i]) < 1e-6);

/**
 * The weights along the path from the first to the last shape, which reaches the shapes at equal intervals. The
 * in-betweens come from the animation's keyframes, without its rests at a shape. Without an animation the path is
 * straight.
 */
export function pathOf(
  frames: Float32Array[],
  shapes: Float32Array[],
): { times: Float32Array; weights: Float32Array[] } {
  const legs = Math.max(shapes.length - 1, 1);
  const straight = { times: Float32Array.from(shapes, (_, i) => i / legs), weights: shapes };
  const times: number[] = [];
  const weights: Float32Array[] = [];
  let shape = 0;
  let between: Float32Array[] = [];
  for (const frame of frames) {
    if (equal(frame, shapes[shape])) {
      between.forEach((w, k) => {
        times.push((shape - 1 + (k + 1) / (between.length + 1)) / legs);
        weights.push(w);
      });
      between = [];
      times.push(shape / legs);
      weights.push(frame);
      if (++shape === shapes.length) return { times: Float32Array.from(times), weights };
    } else if (shape > 0 && !equal(frame, shapes[shape - 1])) between.push(frame);
  }
  return straight;
}

/** The animation of the morph is the last: those of an uploaded document come before it, with `first` targets more. */
function animationPath(gltf: Gltf, first: number, count: number, shapes: Float32Array[]) {
  for (const animation of (gltf.json.animations ?? []).slice(-1)) {
    const channel = animation.channels.find((c) => c.target.path === 'weights');
    if (!channel || !count) continue;
    const sampler = animation.samplers[channel.sampler];
    const output = gltf.floats(sampler.output);
    const step = sampler.interpolation === 'CUBICSPLINE' ? 3 : 1;
    const width = first + count;
    const keys = Math.floor(output.length / (width * step));
    const frames = Array.from({ length: keys }, (_, i) => {
      const from = (i * step + (step === 3 ? 1 : 0)) * width + first;
      return output.slice(from, from + count);
    });
    return pathOf(frames, shapes);
  }
  return pathOf([], shapes);
}

/** The weights at `time`, in 0..1. */
export function weightsAt(data: Pick<MorphData, 'times' | 'weights'>, time: number): number[] {
  const { times, weights } = data;
  let i = 0;
  while (i + 2 < times.length && times[i + 1] <= time) i++;
  if (times.length < 2) return Array.from(weights[0] ?? []);
  const s = Math.min(1, Math.max(0, (time - times[i]) / (times[i + 1] - times[i] || 1)));
  return Array.from(weights[i], (w, k) => w + s * (weights[i + 1][k] - w));
}
