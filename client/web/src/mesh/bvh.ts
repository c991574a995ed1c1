/** A tree of boxes over triangles, in the worker: finds ray hits for picking and nearest points for error maps. */

export interface Hit {
  triangle: number;
  /** barycentric coordinates of the second and third corner */
  u: number;
  v: number;
  /** the parameter along the ray, or the distance */
  t: number;
}

const LEAF = 6;

export class Bvh {
  private readonly boxes: Float64Array; // min xyz, max xyz
  private readonly child: Int32Array; // left child, or ~first of a leaf
  private readonly count: Uint32Array;
  private readonly order: Uint32Array;
  private nodes = 0;

  constructor(
    private readonly positions: ArrayLike<number>,
    private readonly corners: Uint32Array,
  ) {
    const n = corners.length / 3;
    const centers = new Float64Array(n * 3);
    for (let t = 0; t < n; t++)
      for (let k = 0; k < 3; k++)
        centers[3 * t + k] =
          positions[3 * corners[3 * t] + k] +
          positions[3 * corners[3 * t + 1] + k] +
          positions[3 * corners[3 * t + 2] + k];
    this.order = Uint32Array.from({ length: n }, (_, i) => i);
    const capacity = Math.max(1, 2 * n);
    this.boxes = new Float64Array(capacity * 6);
    this.child = new Int32Array(capacity);
    this.count = new Uint32Array(capacity);
    this.nodes = 1;
    const stack = [0, 0, n];
    while (stack.length) {
      const to = stack.pop()!;
      const from = stack.pop()!;
      const node = stack.pop()!;
      this.fit(node, from, to);
      const axis = to - from > LEAF ? this.widest(centers, from, to) : -1;
      if (axis < 0) {
        this.child[node] = ~from;
        this.count[node] = to - from;
        continue;
      }
      const mid = this.split(centers, axis, from, to);
      const left = this.nodes;
      this.nodes += 2;
      this.child[node] = left;
      stack.push(left, from, mid, left + 1, mid, to);
    }
  }

  private fit(node: number, from: number, to: number) {
    const { boxes, positions, corners, order } = this;
    const b = node * 6;
    boxes.fill(Infinity, b, b + 3);
    boxes.fill(-Infinity, b + 3, b + 6);
    for (let i = from; i < to; i++)
      for (let c = 0; c < 3; c++) {
        const v = 3 * corners[3 * order[i] + c];
        for (let k = 0; k < 3; k++) {
          const x = positions[v + k];
          if (x < boxes[b + k]) boxes[b + k] = x;
          if (x > boxes[b + 3 + k]) boxes[b + 3 + k] = x;
        }
      }
  }

  private widest(centers: Float64Array, from: number, to: number): number {
    let best = 0;
    let axis = -1;
    for (let k = 0; k < 3; k++) {
      let min = Infinity;
      let max = -Infinity;
      for (let i = from; i < to; i++) {
        const x = centers[3 * this.order[i] + k];
        if (x < min) min = x;
        if (x > max) max = x;
      }
      if (max - min > best) {
        best = max - min;
        axis = k;
      }
    }
    return axis;
  }

  /** Quickselect of the median. */
  private split(centers: Float64Array, axis: number, from: number, to: number): number {
    const { order } = this;
    const mid = (from + to) >> 1;
    let lo = from;
    let hi = to - 1;
    while (lo < hi) {
      const pivot = centers[3 * order[(lo + hi) >> 1] + axis];
      let i = lo;
      let j = hi;
      while (i <= j) {
        while (centers[3 * order[i] + axis] < pivot) i++;
        while (centers[3 * order[j] + axis] > pivot) j--;
        if (i <= j) {
          const swap = order[i];
          order[i++] = order[j];
          order[j--] = swap;
        }
      }
      if (mid <= j) hi = j;
      else if (mid >= i) lo = i;
      else break;
    }
    return mid;
  }

  ray(ox: number, oy: number, oz: number, dx: number, dy: number, dz: number): Hit | null {
    const { boxes, child, count, order, positions: p, corners } = this;
    const ix = 1 / dx;
    const iy = 1 / dy;
    const iz = 1 / dz;
    let best: Hit | null = null;
    let limit = Infinity;
    const stack = [0];
    while (stack.length) {
      const node = stack.pop()!;
      const b = node * 6;
      const x0 = (boxes[b] - ox) * ix;
      const x1 = (boxes[b + 3] - ox) * ix;
      const y0 = (boxes[b + 1] - oy) * iy;
      const y1 = (boxes[b + 4] - oy) * iy;
      const z0 = (boxes[b + 2] - oz) * iz;
      const z1 = (boxes[b + 5] - oz) * iz;
      const near = Math.max(Math.min(x0, x1), Math.min(y0, y1), Math.min(z0, z1), 0);
      const far = Math.min(Math.max(x0, x1), Math.max(y0, y1), Math.max(z0, z1));
      if (!(near <= far) || near > limit) continue;
      if (child[node] >= 0) {
        stack.push(child[node], child[node] + 1);
        continue;
      }
      const from = ~child[node];
      for (let i = from; i < from + count[node]; i++) {
        const t = order[i];
        const a = 3 * corners[3 * t];
        const q = 3 * corners[3 * t + 1];
        const c = 3 * corners[3 * t + 2];
        const e1x = p[q] - p[a];
        const e1y = p[q + 1] - p[a + 1];
        const e1z = p[q + 2] - p[a + 2];
        const e2x = p[c] - p[a];
        const e2y = p[c + 1] - p[a + 1];
        const e2z = p[c + 2] - p[a + 2];
        const hx = dy * e2z - dz * e2y;
        const hy = dz * e2x - dx * e2z;
        const hz = dx * e2y - dy * e2x;
        const det = e1x * hx + e1y * hy + e1z * hz;
        if (det === 0) continue;
        const f = 1 / det;
        const sx = ox - p[a];
        const sy = oy - p[a + 1];
        const sz = oz - p[a + 2];
        const u = f * (sx * hx + sy * hy + sz * hz);
        if (u < -1e-9 || u > 1 + 1e-9) continue;
        const qx = sy * e1z - sz * e1y;
        const qy = sz * e1x - sx * e1z;
        const qz = sx * e1y - sy * e1x;
        const v = f * (dx * qx + dy * qy + dz * qz);
        if (v < -1e-9 || u + v > 1 + 1e-9) continue;
        const s = f * (e2x * qx + e2y * qy + e2z * qz);
        if (s > 0 && s < limit) {
          limit = s;
          best = { triangle: t, u, v, t: s };
        }
      }
    }
    return best;
  }

  /** The nearest point of the surface; `guess` is an upper bound of the distance. */
  closest(x: number, y: number, z: number, guess = Infinity): Hit | null {
    const { boxes, child, count, order } = this;
    let best: Hit | null = null;
    let limit = guess * guess;
    const stack: number[] = [0];
    const box = (node: number) => {
      const b = node * 6;
      const dx = Math.max(boxes[b] - x, 0, x - boxes[b + 3]);
      const dy = Math.max(boxes[b + 1] - y, 0, y - boxes[b + 4]);
      const dz = Math.max(boxes[b + 2] - z, 0, z - boxes[b + 5]);
      return dx * dx + dy * dy + dz * dz;
    };
    while (stack.length) {
      const node = stack.pop()!;
      if (box(node) > limit) continue;
      if (child[node] >= 0) {
        const left = child[node];
        const dl = box(left);
        const dr = box(left + 1);
        if (dl < dr) {
          if (dr <= limit) stack.push(left + 1);
          if (dl <= limit) stack.push(left);
        } else {
          if (dl <= limit) stack.push(left);
          if (dr <= limit) stack.push(left + 1);
        }
        continue;
      }
      const from = ~child[node];
      for (let i = from; i < from + count[node]; i++) {
        const hit = this.onTriangle(order[i], x, y, z);
        if (hit.t <= limit) {
          limit = hit.t;
          best = hit;
        }
      }
    }
    if (best) best.t = Math.sqrt(best.t);
    return best;
  }

  /** The nearest point of one triangle (Ericson, Real-Time Collision Detection, 5.1.5); t is the squared distance. */
  private onTriangle(t: number, x: number, y: number, z: number): Hit {
    const p = this.positions;
    const a = 3 * this.corners[3 * t];
    const b = 3 * this.corners[3 * t + 1];
    const c = 3 * this.corners[3 * t + 2];
    const abx = p[b] - p[a];
    const aby = p[b + 1] - p[a + 1];
    const abz = p[b + 2] - p[a + 2];
    const acx = p[c] - p[a];
    const acy = p[c + 1] - p[a + 1];
    const acz = p[c + 2] - p[a + 2];
    const apx = x - p[a];
    const apy = y - p[a + 1];
    const apz = z - p[a + 2];
    const d1 = abx * apx + aby * apy + abz * apz;
    const d2 = acx * apx + acy * apy + acz * apz;
    const bpx = x - p[b];
    const bpy = y - p[b + 1];
    const bpz = z - p[b + 2];
    const d3 = abx * bpx + aby * bpy + abz * bpz;
    const d4 = acx * bpx + acy * bpy + acz * bpz;
    const cpx = x - p[c];
    const cpy = y - p[c + 1];
    const cpz = z - p[c + 2];
    const d5 = abx * cpx + aby * cpy + abz * cpz;
    const d6 = acx * cpx + acy * cpy + acz * cpz;
    const vc = d1 * d4 - d3 * d2;
    const vb = d5 * d2 - d1 * d6;
    const va = d3 * d6 - d5 * d4;
    let u = 0;
    let v = 0;
    if (d1 <= 0 && d2 <= 0) u = v = 0;
    else if (d3 >= 0 && d4 <= d3) u = 1;
    else if (vc <= 0 && d1 >= 0 && d3 <= 0) u = d1 / (d1 - d3);
    else if (d6 >= 0 && d5 <= d6) v = 1;
    else if (vb <= 0 && d2 >= 0 && d6 <= 0) v = d2 / (d2 - d6);
    else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
      v = (d4 - d3) / (d4 - d3 + (d5 - d6));
      u = 1 - v;
    } else {
      const sum = va + vb + vc;
      u = vb / sum;
      v = vc / sum;
    }
    const dx = apx - u * abx - v * acx;
    const dy = apy - u * aby - v * acy;
    const dz = apz - u * abz - v * acz;
    return { triangle: t, u, v, t: dx * dx + dy * dy + dz * dz };
  }
}
