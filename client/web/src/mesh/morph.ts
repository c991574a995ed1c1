/** A morph asset, decoded for the viewer: base, targets, wireframe, and the path through the shapes. */
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
  /** keyframes of the way there (not back): for each time in 0..1 the weights of the targets */
  times: Float32Array;
  weights: Float32Array[];
  /** for each shape, the weights that show it alone */
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

/** `targetNames` of in-between targets of a curved path are told by the animation, which gives shapes whole times. */
export function decodeMorph(buffer: ArrayBuffer): MorphData {
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
  const normal = hasNormals ? joined(parts.map((p) => gltf.floats(p.primitive.attributes.NORMAL))) : smoothNormals(position, index);
  const targets = Array.from({ length: targetCount }, (_, k) => {
    const delta = joined(parts.map((p) => gltf.floats(p.primitive.targets![k].POSITION)));
    const withNormals = hasNormals && parts.every((p) => p.primitive.targets![k].NORMAL !== undefined);
    let turned: Float32Array;
    if (withNormals) turned = joined(parts.map((p) => gltf.floats(p.primitive.targets![k].NORMAL)));
    else {
      turned = smoothNormals(position.map((x, i) => x + delta[i]), index);
      for (let i = 0; i < turned.length; i++) turned[i] -= normal[i];
    }
    return { position: delta, normal: turned };
  });

  const path = animationPath(gltf, targetCount);
  const shapes = [new Float32Array(targetCount), ...path.alone];
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
    times: path.times,
    weights: path.weights,
    shapes,
  };
}

function targetNames(gltf: ReturnType<typeof readGlb>, mesh: number, count: number): string[] {
  const names = gltf.json.meshes?.[mesh]?.extras?.targetNames;
  return Array.from({ length: count }, (_, k) => names?.[k] ?? `target ${k + 1}`);
}

/** The frame that holds every shape. */
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

/**
 * The weights along the way from the first to the last shape. Taken from the animation up to the keyframe where the
 * last target stands alone; without an animation every target is a shape.
 */
function animationPath(gltf: ReturnType<typeof readGlb>, count: number) {
  const unit = (k: number) => Float32Array.from({ length: count }, (_, i) => (i === k ? 1 : 0));
  for (const animation of gltf.json.animations ?? []) {
    const channel = animation.channels.find((c) => c.target.path === 'weights');
    if (!channel || !count) continue;
    const sampler = animation.samplers[channel.sampler];
    const input = gltf.floats(sampler.input);
    const output = gltf.floats(sampler.output);
    const step = sampler.interpolation === 'CUBICSPLINE' ? 3 : 1;
    const frames = Array.from(input, (_, i) => {
      const from = (i * step + (step === 3 ? 1 : 0)) * count;
      return output.slice(from, from + count);
    });
    const last = frames.findIndex((w) => w[count - 1] > 0.999);
    if (last <= 0) continue;
    const span = input[last] - input[0] || 1;
    const times = input.slice(0, last + 1).map((t) => (t - input[0]) / span);
    return { times, weights: frames.slice(0, last + 1), alone: Array.from({ length: count }, (_, k) => unit(k)) };
  }
  return {
    times: Float32Array.from({ length: count + 1 }, (_, i) => (count ? i / count : 0)),
    weights: [new Float32Array(count), ...Array.from({ length: count }, (_, k) => unit(k))],
    alone: Array.from({ length: count }, (_, k) => unit(k)),
  };
}

/** The weights at a time in 0..1. */
export function weightsAt(data: Pick<MorphData, 'times' | 'weights'>, time: number): number[] {
  const { times, weights } = data;
  let i = 0;
  while (i + 2 < times.length && times[i + 1] <= time) i++;
  if (times.length < 2) return Array.from(weights[0] ?? []);
  const s = Math.min(1, Math.max(0, (time - times[i]) / (times[i + 1] - times[i] || 1)));
  return Array.from(weights[i], (w, k) => w + s * (weights[i + 1][k] - w));
}
