/** Points and normals of the triangles of a parsed mesh. */
import type { Frame } from './geometry';
import type { RawMesh } from './parse';

export function faceNormal({ positions: p, corners }: RawMesh, t: number): [number, number, number] {
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

export function pointOf(
  { positions: p, corners }: RawMesh,
  t: number,
  w: [number, number, number],
): [number, number, number] {
  const out: [number, number, number] = [0, 0, 0];
  for (let c = 0; c < 3; c++) for (let k = 0; k < 3; k++) out[k] += w[c] * p[3 * corners[3 * t + c] + k];
  return out;
}

/** A point of the file in view coordinates. */
export function toView(frame: Frame, x: ArrayLike<number>, at = 0): [number, number, number] {
  const { center, radius } = frame;
  return [(x[at] - center[0]) / radius, (x[at + 1] - center[1]) / radius, (x[at + 2] - center[2]) / radius];
}
