/** A morph asset, decoded for the viewer: base, targets, wireframe, and the path through the shapes. */
import { dressOf, skinOf, tried, type Skin } from './dress';
import { type Gltf, type Part, readGlb } from './gltf';
import { edgesOf, smoothNormals, type Frame } from './geometry';

/** What the materials of a morph can look like. variant: of the asset's materials; −1: those of its primitives. */
export interface Look {
  name: string;
  variant: number;
}

/** A target that is not a shape: it came with a file. */
export interface Extra {
  name: string;
  /** among the targets of MorphData */
  at: number;
  /** among the targets of the primitives */
  target: number;
  /** the weight that the asset gives it */
  weight: number;
}

export interface MorphData {
  names: string[];
  /** empty where there is nothing to choose from */
  looks: Look[];
  extras: Extra[];
  /** what morphs comes first; the rest stays as it is */
  moving: { vertices: number; corners: number };
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

/** A part of what is drawn. */
interface Drawn extends Part {
  /** the number of its first target that is a shape; undefined: it stays as it is */
  first?: number;
}

/**
 * What morphs: the mesh of an asset, or those meshes of an uploaded document to which targets were added. The rest of
 * such a document follows, such as eyes and clothes, wherever its scene shows them.
 */
function drawnParts(gltf: Gltf): { moving: (Drawn & { first: number })[]; still: Drawn[] } {
  const all = gltf.triangles();
  const first = (part: Part) => gltf.json.meshes?.[part.mesh].extras?.firstShape;
  const kept = all.filter((part) => first(part) !== undefined);
  const moving = kept.length ? kept : all.filter((part) => part.mesh === all[0].mesh);
  return {
    moving: moving.map((part) => ({ ...part, first: first(part) ?? 0 })),
    still: kept.length ? gltf.shown(all.filter((part) => first(part) === undefined)) : [],
  };
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
function joinedIndex(parts: Drawn[]): Uint32Array {
  const index = new Uint32Array(parts.reduce((n, part) => n + part.index.length, 0));
  let at = 0;
  let base = 0;
  for (const part of parts) {
    const reversed = determinant(part.matrix) < 0;
    for (let i = 0; i < part.index.length; i++) {
      const from = reversed && i % 3 > 0 ? i + (i % 3 === 1 ? 1 : -1) : i;
      index[at++] = part.index[from] + base;
    }
    base += part.position.length / 3;
  }
  return index;
}

/** The material of a part in a variant. */
const materialIn = ({ primitive }: Drawn, variant: number) =>
  primitive.extensions?.KHR_materials_variants?.mappings?.find(({ variants }) => variants.includes(variant))
    ?.material ?? primitive.material;

/** The variants of the materials, and before them those that the primitives name, unless the first variant has them. */
function looksOf({ json }: Gltf, parts: Drawn[]): Look[] {
  const variants = json.extensions?.KHR_materials_variants?.variants ?? [];
  const looks = variants.map(({ name }, variant) => ({ name, variant }));
  const isOwn = parts.every((part) => materialIn(part, 0) === part.primitive.material);
  return isOwn || !looks.length ? looks : [{ name: 'As in the file', variant: -1 }, ...looks];
}

/** The parts with the materials of a look. */
const dressedAs = <T extends Drawn>(parts: T[], look: Look | undefined): T[] =>
  parts.map((part) => ({ ...part, primitive: { ...part.primitive, material: materialIn(part, look?.variant ?? -1) } }));

/** What a target does to a part, by its number in the primitives: nothing to what stays as it is. */
function targetOf(gltf: Gltf, part: Drawn, target: number, place: Float32Array, normal: Float32Array) {
  const { POSITION, NORMAL } = (part.first === undefined ? undefined : part.primitive.targets?.[target]) ?? {};
  if (POSITION === undefined)
    return { position: new Float32Array(place.length), normal: new Float32Array(place.length) };
  const position = inScene(gltf.floats(POSITION), part.matrix, 0);
  const own = part.primitive.attributes.NORMAL;
  const there =
    own !== undefined && NORMAL !== undefined
      ? normalsInScene(gltf.floats(own), gltf.floats(NORMAL), part.matrix)
      : smoothNormals(
          place.map((x, i) => x + position[i]),
          joinedIndex([part]),
        );
  return { position, normal: there.map((x, i) => x - normal[i]) };
}

/**
 * Targets 0 … shapeCount − 2 are the other shapes. In-betweens of a curved path follow, then the targets that came with
 * the files: `carried` of them, and last those that an uploaded document had before the shapes. look: one of its looks.
 */
export function decodeMorph(buffer: ArrayBuffer, shapeCount: number, look = 0, carried = 0): MorphData {
  const gltf = readGlb(buffer);
  const { moving, still } = drawnParts(gltf);
  if (!moving.length) throw new Error('The asset has no triangles.');
  const looks = looksOf(gltf, [...moving, ...still]);
  const parts = dressedAs<Drawn>([...moving, ...still], looks[look]);
  const { first: had, primitive } = moving[0];
  const fresh = (primitive.targets?.length ?? 0) - had;
  const targetCount = fresh + had;
  const index = joinedIndex(parts);
  const places = parts.map((p) => inScene(p.position, p.matrix, 1));
  const turned = parts.map((p, i) => {
    const { NORMAL } = p.primitive.attributes;
    return NORMAL === undefined
      ? smoothNormals(places[i], joinedIndex([p]))
      : normalsInScene(gltf.floats(NORMAL), null, p.matrix);
  });
  const targets = Array.from({ length: targetCount }, (_, k) => {
    const moves = parts.map((p, i) => targetOf(gltf, p, targetAt(k, had, fresh), places[i], turned[i]));
    return { position: joined(moves.map((m) => m.position)), normal: joined(moves.map((m) => m.normal)) };
  });
  const [position, normal] = [joined(places), joined(turned)];

  const dress = tried(() => dressOf(gltf, parts));
  const shapes = Array.from({ length: Math.min(shapeCount, fresh + 1) }, (_, i) => single(i - 1, targetCount));
  const path = animationPath(gltf, had, fresh, shapes);
  const names = targetNames(gltf, moving[0].mesh, targetCount, (k) => targetAt(k, had, fresh));
  const extras = names.flatMap((name, at) => {
    const target = targetAt(at, had, fresh);
    return at < fresh - carried ? [] : [{ name, at, target, weight: weightOf(gltf, moving[0].mesh, target) }];
  });
  const frame = fit(position, targets, shapes);
  for (let i = 0; i < position.length; i++) position[i] = (position[i] - frame.center[i % 3]) / frame.radius;
  for (const target of targets) for (let i = 0; i < position.length; i++) target.position[i] /= frame.radius;
  const count = moving.reduce((n, p) => n + p.position.length / 3, 0);
  return {
    names,
    moving: { vertices: count, corners: moving.reduce((n, p) => n + p.index.length, 0) },
    looks,
    extras,
    vertices: count,
    triangles: moving.reduce((n, p) => n + p.index.length / 3, 0),
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

/** The number in the primitives of a target of MorphData, where those that a document `had` come last. */
const targetAt = (k: number, had: number, fresh: number) => (k < fresh ? had + k : k - fresh);

function targetNames(gltf: Gltf, mesh: number, count: number, at: (k: number) => number): string[] {
  const names = gltf.json.meshes?.[mesh]?.extras?.targetNames;
  return Array.from({ length: count }, (_, k) => names?.[at(k)] ?? `target ${k + 1}`);
}

/** The weight of a target at rest. */
function weightOf({ json }: Gltf, mesh: number, target: number): number {
  const own = json.nodes?.find((node) => node.mesh === mesh)?.weights;
  return (own ?? json.meshes?.[mesh]?.weights)?.[target] ?? 0;
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

/** The animation of the morph is the last: those of an uploaded document come before it. The targets that it `had` rest. */
function animationPath(gltf: Gltf, had: number, count: number, shapes: Float32Array[]) {
  for (const animation of (gltf.json.animations ?? []).slice(-1)) {
    const channel = animation.channels.find((c) => c.target.path === 'weights');
    if (!channel || !count) continue;
    const sampler = animation.samplers[channel.sampler];
    const output = gltf.floats(sampler.output);
    const step = sampler.interpolation === 'CUBICSPLINE' ? 3 : 1;
    const width = had + count;
    const keys = Math.floor(output.length / (width * step));
    const frames = Array.from({ length: keys }, (_, i) => {
      const from = (i * step + (step === 3 ? 1 : 0)) * width + had;
      const frame = new Float32Array(width);
      frame.set(output.subarray(from, from + count));
      return frame;
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
