/** Edges, normal and area of a triangle. p: coordinates, three a vertex; a, b, c: where in p its corners start. */
export type Vector = [number, number, number];

/** The edges from the first corner to the second and to the third. */
export function edges(p: ArrayLike<number>, a: number, b: number, c: number): [Vector, Vector] {
  return [
    [p[b] - p[a], p[b + 1] - p[a + 1], p[b + 2] - p[a + 2]],
    [p[c] - p[a], p[c + 1] - p[a + 1], p[c + 2] - p[a + 2]],
  ];
}

/** The normal, twice as long as the area. */
export function areaNormal(p: ArrayLike<number>, a: number, b: number, c: number): Vector {
  const [u, v] = edges(p, a, b, c);
  return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
}

export const doubleArea = (p: ArrayLike<number>, a: number, b: number, c: number) =>
  Math.hypot(...areaNormal(p, a, b, c));
