/** Points and normals of the triangles of a parsed mesh. */
import type { Frame } from './geometry';
import type { RawMesh } from './parse';
import { areaNormal, type Vector } from './triangle';

export function faceNormal({ positions: p, corners }: RawMesh, t: number): Vector {
  const n = areaNormal(p, 3 * corners[3 * t], 3 * corners[3 * t + 1], 3 * corners[3 * t + 2]);
  const l = Math.hypot(...n) || 1;
  return [n[0] / l, n[1] / l, n[2] / l];
}

export function pointOf({ positions: p, corners }: RawMesh, t: number, w: Vector): Vector {
  const out: Vector = [0, 0, 0];
  for (let c = 0; c < 3; c++) for (let k = 0; k < 3; k++) out[k] += w[c] * p[3 * corners[3 * t + c] + k];
  return out;
}

/** A point of the file in view coordinates. */
export function toView(frame: Frame, x: ArrayLike<number>, at = 0): Vector {
  const { center, radius } = frame;
  return [(x[at] - center[0]) / radius, (x[at + 1] - center[1]) / radius, (x[at + 2] - center[2]) / radius];
}
