/** A morph asset, decoded for the viewer: base, targets, wireframe, and the path through the shapes. */
import { dressOf, skinOf, tried, type Skin } from './dress';
import { readGlb } from './gltf';
import { edgesOf, smoothNormals, type Frame } from './geometry';

export interface MorphData {
  names: string[];
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

/** Targets 0 … shapeCount − 2 are the other shapes; the rest are in-betweens of a curved path. */
export function decodeMorph(buffer: ArrayBuffer, shapeCount: number): MorphData {
  const gltf = readGlb(buffer);
  const parts = gltf.triangles().filter((part, _, all) => part.mesh === all[0].mesh);
  if (!parts.length) throw new Error('The asset has no triangles.');
  const targetCount = parts[0].primitive.targets?.length ?? 0;
  const position = joined(parts.map((p) => p.position));
  let total = 0;
  for (const part of parts) total += part.index.length;
  const index = new Uint32Array(total);
  let at = 0;
  let base = 0;
  for (const part of parts) {
    for (const v of part.index) index[at++] = v + base;
    base += part.position.length / 3;
  }
  const hasNormals = parts.every((p) => p.primitive.attributes.NORMAL !== undefined);
  const normal = hasNormals
    ? joined(parts.map((p) => gltf.floats(p.primitive.attributes.NORMAL)))
    : smoothNormals(position, index);
  const targets = Array.from({ length: targetCount }, (_, k) => {
    const delta = joined(parts.map((p) => gltf.floats(p.primitive.targets![k].POSITION)));
    const withNormals = hasNormals && parts.every((p) => p.primitive.targets![k].NORMAL !== undefined);
    let normalDelta: Float32Array;
    if (withNormals) normalDelta = joined(parts.map((p) => gltf.floats(p.primitive.targets![k].NORMAL)));
    else {
      normalDelta = smoothNormals(
        position.map((x, i) => x + delta[i]),
        index,
      );
      for (let i = 0; i < normalDelta.length; i++) normalDelta[i] -= normal[i];
    }
    return { position: delta, normal: normalDelta };
  });

  const dress = tried(() => dressOf(gltf, parts));
  const shapes = Array.from({ length: Math.min(shapeCount, targetCount + 1) }, (_, i) => single(i - 1, targetCount));
  const path = animationPath(gltf, targetCount, shapes);
  const names = targetNames(gltf, parts[0].mesh, targetCount);
  const frame = fit(position, targets, shapes);
  for (let i = 0; i < position.length; i++) position[i] = (position[i] - frame.center[i % 3]) / frame.radius;
  for (const target of targets) for (let i = 0; i < position.length; i++) target.position[i] /= frame.radius;
  return {
    names,
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

function targetNames(gltf: ReturnType<typeof readGlb>, mesh: number, count: number): string[] {
  const names = gltf.json.meshes?.[mesh]?.extras?.targetNames;
  return Array.from({ length: count }, (_, k) => names?.[k] ?? `target ${k + 1}`);
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

function animationPath(gltf: ReturnType<typeof readGlb>, count: number, shapes: Float32Array[]) {
  for (const animation of gltf.json.animations ?? []) {
    const channel = animation.channels.find((c) => c.target.path === 'weights');
    if (!channel || !count) continue;
    const sampler = animation.samplers[channel.sampler];
    const output = gltf.floats(sampler.output);
    const step = sampler.interpolation === 'CUBICSPLINE' ? 3 : 1;
    const keys = Math.floor(output.length / (count * step));
    const frames = Array.from({ length: keys }, (_, i) => {
      const from = (i * step + (step === 3 ? 1 : 0)) * count;
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
