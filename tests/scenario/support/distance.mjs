// Distances of points from a surface, by testing the bounding balls of all triangles.

const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** The distance from p to the triangle a, b, c (Ericson, Real-Time Collision Detection, 5.1.5). Corners may coincide. */
export function toTriangle(p, a, b, c) {
  const ab = sub(b, a);
  const ac = sub(c, a);
  const ap = sub(p, a);
  const at = (s, t) => {
    const d = [ap[0] - s * ab[0] - t * ac[0], ap[1] - s * ab[1] - t * ac[1], ap[2] - s * ab[2] - t * ac[2]];
    return Math.sqrt(dot(d, d));
  };
  const d1 = dot(ab, ap);
  const d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return at(0, 0);
  const bp = sub(p, b);
  const d3 = dot(ab, bp);
  const d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return at(1, 0);
  const vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0 && d1 > d3) return at(d1 / (d1 - d3), 0);
  const cp = sub(p, c);
  const d5 = dot(ab, cp);
  const d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return at(0, 1);
  const vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return at(0, d2 / (d2 - d6));
  const va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const w = (d4 - d3) / (d4 - d3 + d5 - d6);
    return at(1 - w, w);
  }
  const sum = va + vb + vc;
  return at(vb / sum, vc / sum);
}

/** The largest distance of any of `points` (arrays of three) from the surface {flat positions, flat triangles}. */
export function farthest(points, positions, triangles) {
  const balls = [];
  for (let t = 0; t < triangles.length; t += 3) {
    const corners = [0, 1, 2].map((k) => Array.from(positions.slice(3 * triangles[t + k], 3 * triangles[t + k] + 3)));
    const centre = [0, 1, 2].map((k) => (corners[0][k] + corners[1][k] + corners[2][k]) / 3);
    balls.push({ corners, centre, radius: Math.max(...corners.map((c) => Math.hypot(...sub(c, centre)))) });
  }
  let worst = 0;
  for (const p of points) {
    let least = Infinity;
    for (const { corners, centre, radius } of balls) {
      const dx = p[0] - centre[0];
      const dy = p[1] - centre[1];
      const dz = p[2] - centre[2];
      const reach = least + radius;
      if (dx * dx + dy * dy + dz * dz < reach * reach) least = Math.min(least, toTriangle(p, ...corners));
    }
    worst = Math.max(worst, least);
  }
  return worst;
}
