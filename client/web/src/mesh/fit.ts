/** Finds the similarity that an asset has applied to a shape, to show the shape's errors at its own place. */
import { Bvh } from './bvh';
import type { RawMesh } from './parse';
import { faceNormal, pointOf } from './surface';
import { doubleArea } from './triangle';

/**
 * Undoes the similarity that the asset has applied to a shape. It finds the least-squares similarity between the two
 * surfaces by nearest points, starting from 24 rotations, and then improves it by tangent planes.
 */
export function undoFit(raw: RawMesh, place: Float64Array, index: Uint32Array): Float64Array {
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
      const w = doubleArea(p, a, b, c);
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
