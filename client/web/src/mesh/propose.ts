/**
 * Landmarks from a found correspondence: tips and other places that are far apart on every shape. The common mesh has
 * a place on all shapes for each vertex, so choosing a vertex gives a landmark on every shape.
 */
import { edgesOf, weld } from './geometry';
import type { MorphData } from './morph';

/** A heap of (distance, vertex) for Dijkstra's algorithm. */
class Heap {
  private keys: number[] = [];
  private items: number[] = [];
  get size() {
    return this.keys.length;
  }
  push(key: number, item: number) {
    let i = this.keys.length;
    this.keys.push(key);
    this.items.push(item);
    while (i > 0) {
      const up = (i - 1) >> 1;
      if (this.keys[up] <= key) break;
      this.keys[i] = this.keys[up];
      this.items[i] = this.items[up];
      i = up;
    }
    this.keys[i] = key;
    this.items[i] = item;
  }
  pop(): [number, number] {
    const top: [number, number] = [this.keys[0], this.items[0]];
    const key = this.keys.pop()!;
    const item = this.items.pop()!;
    const n = this.keys.length;
    if (n) {
      let i = 0;
      for (;;) {
        let child = 2 * i + 1;
        if (child >= n) break;
        if (child + 1 < n && this.keys[child + 1] < this.keys[child]) child++;
        if (this.keys[child] >= key) break;
        this.keys[i] = this.keys[child];
        this.items[i] = this.items[child];
        i = child;
      }
      this.keys[i] = key;
      this.items[i] = item;
    }
    return top;
  }
}

/** The positions of one shape in the coordinates of the asset. */
export function shapePositions(data: MorphData, shape: number): Float64Array {
  const out = Float64Array.from(data.position);
  data.shapes[shape].forEach((w, k) => {
    if (w) for (let i = 0; i < out.length; i++) out[i] += w * data.targets[k].position[i];
  });
  for (let i = 0; i < out.length; i++) out[i] = out[i] * data.frame.radius + data.frame.center[i % 3];
  return out;
}

/**
 * `count` places, each as a point on every shape, by farthest-point sampling. The distance is measured along the
 * surface and averaged over the shapes, so the first places are the tips of limbs.
 */
export function proposeLandmarks(data: MorphData, count: number): [number, number, number][][] {
  const shapes = data.shapes.map((_, i) => shapePositions(data, i));
  const { place, count: n } = weld(Float64Array.from(data.position));
  const first = new Int32Array(n).fill(-1);
  place.forEach((p, v) => {
    if (first[p] < 0) first[p] = v;
  });
  const edges = edgesOf(data.index.map((v) => place[v]));
  const size = shapes.map((p) => {
    let sum = 0;
    for (let i = 0; i < p.length; i++) sum += (p[i] - p[i % 3]) ** 2;
    return Math.sqrt(sum / p.length) || 1;
  });
  const start = new Uint32Array(n + 1);
  for (const v of edges) start[v + 1]++;
  for (let v = 0; v < n; v++) start[v + 1] += start[v];
  const other = new Uint32Array(edges.length);
  const long = new Float64Array(edges.length);
  const fill = start.slice(0, n);
  for (let e = 0; e < edges.length; e += 2) {
    const [a, b] = [edges[e], edges[e + 1]];
    let length = 0;
    shapes.forEach((p, s) => {
      const [i, j] = [3 * first[a], 3 * first[b]];
      length += Math.hypot(p[i] - p[j], p[i + 1] - p[j + 1], p[i + 2] - p[j + 2]) / size[s];
    });
    for (const [from, to] of [
      [a, b],
      [b, a],
    ]) {
      other[fill[from]] = to;
      long[fill[from]++] = length;
    }
  }
  const away = new Float64Array(n).fill(Infinity);
  const spread = (source: number) => {
    const heap = new Heap();
    away[source] = 0;
    heap.push(0, source);
    while (heap.size) {
      const [d, v] = heap.pop();
      if (d > away[v]) continue;
      for (let k = start[v]; k < start[v + 1]; k++) {
        const next = d + long[k];
        if (next < away[other[k]]) {
          away[other[k]] = next;
          heap.push(next, other[k]);
        }
      }
    }
  };
  const farthest = () => {
    let best = 0;
    for (let v = 1; v < n; v++) if (away[v] < Infinity && away[v] > away[best]) best = v;
    return best;
  };
  spread(0);
  const seed = farthest();
  away.fill(Infinity);
  const chosen = [seed];
  spread(seed);
  while (chosen.length < Math.min(count, n)) {
    const next = farthest();
    if (away[next] === 0) break;
    chosen.push(next);
    spread(next);
  }
  return chosen.map((v) =>
    shapes.map((p): [number, number, number] => [p[3 * first[v]], p[3 * first[v] + 1], p[3 * first[v] + 2]]),
  );
}
