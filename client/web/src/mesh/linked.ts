/** The same place on every shape of a morph, and how much the morph stretches its surface there. */
import { vertexDirichlet } from './distortion';
import type { MorphData } from './morph';

type Morph = Pick<MorphData, 'position' | 'index' | 'targets' | 'shapes'>;

/** A place of a surface, in view coordinates. */
export interface Touched {
  position: [number, number, number];
  normal: [number, number, number];
}

/** The vertices of a morph with these weights of its targets. */
function positionsAt({ position, targets }: Morph, weights: ArrayLike<number>): Float32Array {
  const out = position.slice();
  targets.forEach((target, k) => {
    const w = weights[k];
    if (w) for (let i = 0; i < out.length; i++) out[i] += w * target.position[i];
  });
  return out;
}

const cross = (a: number[], b: number[]) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
const dot = (a: number[], b: number[]) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const sides = (p: Float32Array, [a, b, c]: number[]) => ({
  from: [p[a], p[a + 1], p[a + 2]],
  u: [p[b] - p[a], p[b + 1] - p[a + 1], p[b + 2] - p[a + 2]],
  v: [p[c] - p[a], p[c + 1] - p[a + 1], p[c + 2] - p[a + 2]],
});

/**
 * The first triangle that a ray meets from outside (Möller and Trumbore). Each ray meets another surface, so a tree does
 * not pay.
 */
function firstHit(p: Float32Array, index: Uint32Array, origin: number[], direction: number[]) {
  let best: { corners: number[]; weights: number[] } | null = null;
  let least = Infinity;
  for (let t = 0; t < index.length; t += 3) {
    const corners = [3 * index[t], 3 * index[t + 1], 3 * index[t + 2]];
    const { from, u, v } = sides(p, corners);
    const h = cross(direction, v);
    const det = dot(u, h);
    if (det < 1e-14) continue; // also what faces away
    const s = origin.map((x, k) => x - from[k]);
    const a = dot(s, h) / det;
    if (a < 0 || a > 1) continue;
    const q = cross(s, u);
    const b = dot(direction, q) / det;
    const far = dot(v, q) / det;
    if (b < 0 || a + b > 1 || far <= 0 || far >= least) continue;
    least = far;
    best = { corners, weights: [1 - a - b, a, b] };
  }
  return best;
}

/** Where a ray meets a morph with the weights `seen`, as it lies with each of the weights `others`; null beside it. */
export function touched(
  morph: Morph,
  seen: ArrayLike<number>,
  { origin, direction }: { origin: number[]; direction: number[] },
  others: ArrayLike<number>[],
): Touched[] | null {
  const hit = firstHit(positionsAt(morph, seen), morph.index, origin, direction);
  if (!hit) return null;
  const { position, targets } = morph;
  return others.map((weights) => {
    const at = new Float32Array(9); // the corners
    hit.corners.forEach((corner, c) => {
      for (let k = 0; k < 3; k++) {
        at[3 * c + k] = position[corner + k];
        targets.forEach((target, n) => (at[3 * c + k] += (weights[n] ?? 0) * target.position[corner + k]));
      }
    });
    const { u, v } = sides(at, [0, 3, 6]);
    const n = cross(u, v);
    const length = Math.hypot(...n) || 1;
    return {
      position: [0, 1, 2].map((k) => hit.weights.reduce((sum, w, c) => sum + w * at[3 * c + k], 0)) as [
        number,
        number,
        number,
      ],
      normal: n.map((x) => x / length) as [number, number, number],
    };
  });
}

/**
 * For each shape and each drawn vertex the symmetric Dirichlet energy of the map between the first shape and it, 1 where
 * lengths are kept; for the first shape the largest of them.
 */
export function stretchOf(morph: Morph): Float32Array[] {
  const [first, ...others] = morph.shapes.map((weights) => Float64Array.from(positionsAt(morph, weights)));
  const values = others.map((other) => Float32Array.from(vertexDirichlet(first, other, morph.index)));
  const most = new Float32Array(first.length / 3);
  for (const list of values) list.forEach((x, i) => (most[i] = Math.max(most[i], x)));
  return [most, ...values];
}
