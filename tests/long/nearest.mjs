// Distances of points from a surface, by a tree of boxes over all triangles, independent of orbmorph.
import { toTriangle } from '../scenario/support/distance.mjs';

const LEAF = 8; // triangles

/** From `p` to the box of `node`, whose six numbers lie in `boxes`. */
function toBox(p, boxes, node) {
  let sum = 0;
  for (let k = 0; k < 3; k++) {
    const off = Math.max(boxes[6 * node + k] - p[k], 0, p[k] - boxes[6 * node + 3 + k]);
    sum += off * off;
  }
  return Math.sqrt(sum);
}

/** The distance of a point from the surface {flat positions, flat triangles}: a function of the point. */
export function surface(positions, triangles) {
  const count = triangles.length / 3;
  const corner = (t, k) => {
    const v = 3 * triangles[3 * t + k];
    return [positions[v], positions[v + 1], positions[v + 2]];
  };
  const corners = Array.from({ length: count }, (_, t) => [corner(t, 0), corner(t, 1), corner(t, 2)]);
  const centres = corners.map(([a, b, c]) => [0, 1, 2].map((k) => a[k] + b[k] + c[k]));
  const order = Uint32Array.from({ length: count }, (_, t) => t);
  const boxes = [];
  const nodes = []; // [first, end, left child], the right one follows the left; no child: a leaf
  const add = (first, end) => {
    const box = [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity];
    for (const t of order.subarray(first, end))
      for (const p of corners[t])
        for (let k = 0; k < 3; k++) {
          box[k] = Math.min(box[k], p[k]);
          box[3 + k] = Math.max(box[3 + k], p[k]);
        }
    boxes.push(...box);
    nodes.push([first, end, 0]);
  };
  add(0, count);
  for (let n = 0; n < nodes.length; n++) {
    const [first, end] = nodes[n];
    if (end - first <= LEAF) continue;
    const sizes = [0, 1, 2].map((k) => boxes[6 * n + 3 + k] - boxes[6 * n + k]);
    const axis = sizes.indexOf(Math.max(...sizes));
    order.subarray(first, end).sort((a, b) => centres[a][axis] - centres[b][axis]);
    nodes[n][2] = nodes.length;
    const middle = (first + end) >> 1;
    add(first, middle);
    add(middle, end);
  }
  return (p) => {
    let least = Infinity;
    const open = [0];
    while (open.length) {
      const n = open.pop();
      if (toBox(p, boxes, n) >= least) continue;
      const [first, end, child] = nodes[n];
      if (!child) for (let i = first; i < end; i++) least = Math.min(least, toTriangle(p, ...corners[order[i]]));
      else {
        const [near, far] = toBox(p, boxes, child) < toBox(p, boxes, child + 1) ? [0, 1] : [1, 0];
        open.push(child + far, child + near);
      }
    }
    return least;
  };
}

/**
 * Points of the surface {flat positions, flat triangles}: its vertices, the middles of edges and triangles, and `more`
 * points at random in triangles that are drawn by their area.
 */
export function samples(positions, triangles, more) {
  const points = [];
  const at = (t, weights) =>
    [0, 1, 2].map((k) => weights.reduce((sum, w, i) => sum + w * positions[3 * triangles[3 * t + i] + k], 0));
  const areas = [0];
  for (let t = 0; t < triangles.length / 3; t++) {
    const [a, b, c] = [at(t, [1, 0, 0]), at(t, [0, 1, 0]), at(t, [0, 0, 1])];
    points.push(
      a,
      b,
      c,
      at(t, [0.5, 0.5, 0]),
      at(t, [0, 0.5, 0.5]),
      at(t, [0.5, 0, 0.5]),
      at(t, [1 / 3, 1 / 3, 1 / 3]),
    );
    const [u, v] = [b.map((x, k) => x - a[k]), c.map((x, k) => x - a[k])];
    areas.push(areas[t] + Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]));
  }
  let state = 1n;
  const random = () => {
    state = BigInt.asUintN(64, state * 6364136223846793005n + 1442695040888963407n);
    return Number(state >> 11n) / 2 ** 53;
  };
  for (let i = 0; i < more; i++) {
    const wanted = random() * areas.at(-1);
    let [low, high] = [0, areas.length - 1];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (areas[middle] <= wanted) low = middle;
      else high = middle;
    }
    const [r, s] = [Math.sqrt(random()), random()];
    points.push(at(low, [1 - r, r * (1 - s), r * s]));
  }
  return points;
}
