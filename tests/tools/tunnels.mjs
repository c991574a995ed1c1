// A mesh with tunnels: each joins the rims of two triangles that face away from each other on both sides of a thin
// part.

const sub = (a, b) => a.map((x, k) => x - b[k]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((x) => x / Math.hypot(...a));

/** `places`: points at which a tunnel begins. Each adds one to the genus of a closed mesh. */
export function tunnels({ positions, triangles }, places) {
  const corners = triangles.map((t) => t.map((v) => positions[v]));
  const middle = corners.map((c) => [0, 1, 2].map((k) => (c[0][k] + c[1][k] + c[2][k]) / 3));
  const normal = corners.map(([a, b, c]) => unit(cross(sub(b, a), sub(c, a))));
  const used = new Set(); // vertices
  const gone = new Set();
  const walls = [];
  const free = (t) => triangles[t].every((v) => !used.has(v));
  const least = (cost) => triangles.map((_, t) => t).reduce((best, t) => (cost(t) < cost(best) ? t : best));
  for (const place of places) {
    const from = least((t) => (free(t) ? Math.hypot(...sub(middle[t], place)) : Infinity));
    const inwards = normal[from].map((x) => -x);
    const to = least((t) => {
      const way = sub(middle[t], middle[from]);
      const depth = dot(way, inwards);
      const aside = Math.hypot(
        ...sub(
          way,
          inwards.map((x) => depth * x),
        ),
      );
      const faces =
        free(t) && dot(normal[t], inwards) > 0.5 && depth > 0 && !triangles[t].some((v) => triangles[from].includes(v));
      return faces ? depth + 8 * aside : Infinity;
    });
    const [a, b] = [triangles[from], [...triangles[to]].reverse()];
    const length = (turn) =>
      a.reduce((sum, v, i) => sum + Math.hypot(...sub(positions[v], positions[b[(i + turn) % 3]])), 0);
    const turn = [0, 1, 2].reduce((best, t) => (length(t) < length(best) ? t : best));
    for (let i = 0; i < 3; i++) {
      const [p, q] = [a[i], a[(i + 1) % 3]];
      const [r, s] = [b[(i + turn) % 3], b[(i + 1 + turn) % 3]];
      walls.push([p, q, s], [p, s, r]);
    }
    for (const t of [from, to]) {
      gone.add(t);
      triangles[t].forEach((v) => used.add(v));
    }
  }
  return { positions, triangles: [...triangles.filter((_, t) => !gone.has(t)), ...walls] };
}
