/** A turntable camera. Views that share one are linked. */

type Vec = [number, number, number];
const dot = (a: ArrayLike<number>, b: ArrayLike<number>) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

const HOME = { yaw: 0.55, pitch: 0.22, distance: 3.15, panX: 0, panY: 0 };
export const FIELD = 32; // vertical field of view in degrees
const SLOPE = Math.tan((FIELD * Math.PI) / 360);

/** Position and orientation of a camera: `back` points from its target to the eye. */
export interface Look {
  eye: Vec;
  right: Vec;
  up: Vec;
  back: Vec;
  near: number;
  far: number;
  aspect: number;
}

export class Orbit {
  yaw = HOME.yaw;
  pitch = HOME.pitch;
  distance = HOME.distance;
  panX = HOME.panX;
  panY = HOME.panY;

  rotate(dx: number, dy: number) {
    this.yaw -= dx;
    this.pitch = Math.max(-1.55, Math.min(1.55, this.pitch + dy));
  }
  zoom(factor: number) {
    this.distance = Math.max(0.25, Math.min(20, this.distance * factor));
  }
  pan(dx: number, dy: number) {
    this.panX -= dx * this.distance;
    this.panY += dy * this.distance;
  }
  reset() {
    Object.assign(this, HOME);
  }

  look(aspect: number): Look {
    // a narrow view moves back until the shape fits its width
    const distance = this.distance / Math.min(1, aspect);
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    const back: Vec = [sy * cp, sp, cy * cp];
    const right: Vec = [cy, 0, -sy];
    const up: Vec = [-sy * sp, cp, -cy * sp];
    const eye = back.map((b, k) => b * distance + right[k] * this.panX + up[k] * this.panY) as Vec;
    return { eye, right, up, back, near: Math.max(0.01, distance - 3), far: distance + 6, aspect };
  }

  toString(): string {
    return [this.yaw, this.pitch, this.distance, this.panX, this.panY].map((x) => +x.toFixed(3)).join(',');
  }
  restore(text: string) {
    const values = text.split(',').map(Number);
    if (values.length !== 5 || !values.every(Number.isFinite)) return;
    [this.yaw, this.pitch, this.distance, this.panX, this.panY] = values;
  }
}

/** The view position of a point, 0 to 1 from the left and the top, and how much its normal faces the eye. */
export function project(
  look: Look,
  point: ArrayLike<number>,
  normal: ArrayLike<number>,
): { x: number; y: number; facing: number } {
  const d = look.eye.map((e, k) => point[k] - e);
  const depth = Math.max(-dot(d, look.back), 1e-6);
  return {
    x: 0.5 + dot(d, look.right) / (2 * depth * SLOPE * look.aspect),
    y: 0.5 - dot(d, look.up) / (2 * depth * SLOPE),
    facing: -dot(normal, d) / Math.hypot(d[0], d[1], d[2]),
  };
}

/** The ray through a position of the view, 0 to 1 from the left and the top. */
export function rayThrough(look: Look, x: number, y: number): { origin: number[]; direction: number[] } {
  const a = (2 * x - 1) * SLOPE * look.aspect;
  const b = (1 - 2 * y) * SLOPE;
  const direction = look.back.map((back, k) => a * look.right[k] + b * look.up[k] - back);
  const length = Math.hypot(...direction);
  return { origin: [...look.eye], direction: direction.map((d) => d / length) };
}
