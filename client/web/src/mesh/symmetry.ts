/**
 * The plane in which a surface mirrors itself. From several first guesses, sample points are mirrored and the plane is
 * fitted to them and their nearest points of the surface, as ICP fits a rotation.
 */
import type { Bvh } from './bvh';
import type { RawMesh } from './parse';
import { doubleArea } from './triangle';

export interface Plane {
  /** unit vector; the plane is where dot(normal, x) = offset */
  normal: number[];
  offset: number;
}

const SAMPLES = 400;
const ROUNDS = 12;
/** A plane counts if mirrored points are this near the surface: root mean square, in half diagonals of the box. */
const GOOD = 0.012;
/** Another plane, rotated by more than 15°, must be worse by this factor. A ball or a box has many good planes. */
const CLEARLY = 4;
const SAME = Math.cos((15 * Math.PI) / 180);

type Matrix = number[][];
const dot = (a: number[], b: number[]) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

export const mirrored = ({ normal, offset }: Plane, p: number[]): number[] => {
  const away = 2 * (dot(normal, p) - offset);
  return p.map((x, k) => x - away * normal[k]);
};

/** A limb is farther from the plane than the middle of a body: as a fraction of half the diagonal. */
const OFF = 0.06;

/** The side of the plane on which a point lies: −1, 1, or 0 near the plane. */
export function sideOfPlane({ normal, offset }: Plane, p: number[], radius: number): number {
  const far = dot(normal, p) - offset;
  return Math.abs(far) < OFF * radius ? 0 : Math.sign(far);
}

/** Eigenvectors of a symmetric matrix by Jacobi rotations, with their values, ascending. */
function eigen(a: Matrix): { value: number; vector: number[] }[] {
  const m = a.map((row) => [...row]);
  const v: Matrix = [0, 1, 2].map((i) => [0, 1, 2].map((j) => Number(i === j)));
  for (let sweep = 0; sweep < 30; sweep++)
    for (const [p, q] of [
      [0, 1],
      [0, 2],
      [1, 2],
    ]) {
      if (Math.abs(m[p][q]) < 1e-300) continue;
      const angle = 0.5 * Math.atan2(2 * m[p][q], m[q][q] - m[p][p]);
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      for (let k = 0; k < 3; k++) [m[k][p], m[k][q]] = [c * m[k][p] - s * m[k][q], s * m[k][p] + c * m[k][q]];
      for (let k = 0; k < 3; k++) [m[p][k], m[q][k]] = [c * m[p][k] - s * m[q][k], s * m[p][k] + c * m[q][k]];
      for (let k = 0; k < 3; k++) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
    }
  return [0, 1, 2].map((k) => ({ value: m[k][k], vector: v.map((row) => row[k]) })).sort((x, y) => x.value - y.value);
}

/** Points spread evenly over the area. */
function samples({ positions: p, corners }: RawMesh): number[][] {
  const faces = corners.length / 3;
  const total = new Float64Array(faces + 1);
  const corner = (t: number, c: number) => [0, 1, 2].map((k) => p[3 * corners[3 * t + c] + k]);
  for (let t = 0; t < faces; t++)
    total[t + 1] = total[t] + doubleArea(p, 3 * corners[3 * t], 3 * corners[3 * t + 1], 3 * corners[3 * t + 2]);
  const out: number[][] = [];
  for (let i = 0, t = 0; i < SAMPLES; i++) {
    const at = ((i + 0.5) / SAMPLES) * total[faces];
    while (t + 1 < faces && total[t + 1] < at) t++;
    // a sequence of low discrepancy (Roberts' R2), folded into the triangle
    let [x, y] = [(0.7548776662466927 * (i + 1)) % 1, (0.5698402909980532 * (i + 1)) % 1];
    if (x + y > 1) [x, y] = [1 - x, 1 - y];
    const [a, b, c] = [corner(t, 0), corner(t, 1), corner(t, 2)];
    out.push(a.map((z, k) => z + x * (b[k] - z) + y * (c[k] - z)));
  }
  return out;
}

const mean = (points: number[][]) => [0, 1, 2].map((k) => points.reduce((sum, p) => sum + p[k], 0) / points.length);

/** Fits the plane to the points and the nearest points of the surface to their images; also how far these are. */
function fitted(points: number[][], { positions, corners }: RawMesh, bvh: Bvh, plane: Plane) {
  const near: number[][] = [];
  let sum = 0;
  for (const point of points) {
    const [x, y, z] = mirrored(plane, point);
    const hit = bvh.closest(x, y, z)!;
    const weights = [1 - hit.u - hit.v, hit.u, hit.v];
    near.push(
      [0, 1, 2].map((k) => weights.reduce((s, w, c) => s + w * positions[3 * corners[3 * hit.triangle + c] + k], 0)),
    );
    sum += hit.t * hit.t;
  }
  const [a, b] = [mean(points), mean(near)];
  const m: Matrix = [0, 1, 2].map(() => [0, 0, 0]);
  points.forEach((p, i) => {
    for (let r = 0; r < 3; r++)
      for (let c = 0; c < 3; c++) m[r][c] += (p[r] - a[r]) * (near[i][c] - b[c]) + (p[c] - a[c]) * (near[i][r] - b[r]);
  });
  const normal = eigen(m)[0].vector;
  return {
    plane: {
      normal,
      offset: dot(
        normal,
        a.map((x, k) => (x + b[k]) / 2),
      ),
    },
    away: Math.sqrt(sum / points.length),
  };
}

/** The one clear plane of symmetry; null if there is none, or several. `size`: half the diagonal of the box. */
export function symmetryOf(raw: RawMesh, bvh: Bvh, size: number): Plane | null {
  const points = samples(raw);
  const center = mean(points);
  const spread: Matrix = [0, 1, 2].map((r) =>
    [0, 1, 2].map((c) => points.reduce((s, p) => s + (p[r] - center[r]) * (p[c] - center[c]), 0)),
  );
  const guesses = eigen(spread).map(({ vector }) => vector);
  for (let x = -1; x <= 1; x++)
    for (let y = -1; y <= 1; y++)
      for (let z = 0; z <= 1; z++) {
        const length = Math.hypot(x, y, z);
        if (length > 0 && length < 1.5) guesses.push([x / length, y / length, z / length]);
      }
  const refine = (plane: Plane, rounds: number, gain: number) => {
    let step = { plane, away: Infinity };
    for (let round = 0; round < rounds; round++) {
      const next = fitted(points, raw, bvh, step.plane);
      if (next.away > 0.15 * size || next.away > gain * step.away) return { plane: step.plane, away: next.away };
      step = next;
    }
    return { plane: step.plane, away: fitted(points, raw, bvh, step.plane).away };
  };
  const found = guesses.map((normal) => refine({ normal, offset: dot(normal, center) }, ROUNDS, 0.999));
  found.sort((x, y) => x.away - y.away);
  const [best, ...others] = found;
  if (!(best.away < GOOD * size)) return null;
  const rival = others.find(({ plane }) => Math.abs(dot(plane.normal, best.plane.normal)) < SAME);
  return !rival || rival.away > CLEARLY * Math.max(best.away, 0.25 * GOOD * size)
    ? refine(best.plane, 5 * ROUNDS, 0.9999).plane
    : null;
}
