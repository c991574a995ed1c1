// Landmarks of two shapes of which one is misplaced.
import assert from 'node:assert/strict';

export const apart = (p, q) => Math.hypot(...p.map((x, k) => x - q[k]));

export function readOff(text) {
  const numbers = text.split(/\s+/).slice(1).map(Number);
  const [vertices, faces] = numbers;
  const row = (at, size) => numbers.slice(at, at + size);
  return {
    positions: Array.from({ length: vertices }, (_, v) => row(3 + 3 * v, 3)),
    triangles: Array.from({ length: faces }, (_, t) => row(3 + 3 * vertices + 4 * t + 1, 3)),
  };
}

export function placed({ positions, triangles }, at) {
  if (at.point) return at.point;
  if (at.vertex !== undefined) return positions[at.vertex];
  const corners = triangles[at.triangle].map((v) => positions[v]);
  return [0, 1, 2].map((k) => corners.reduce((sum, p, i) => sum + at.barycentric[i] * p[k], 0));
}

export function diagonalOf({ positions }) {
  const ends = [Math.min, Math.max].map((f) => [0, 1, 2].map((k) => f(...positions.map((p) => p[k]))));
  return apart(...ends);
}

/**
 * The vertex of the second shape whose distance from a landmark's true place is nearest to 0.15 of the diagonal, and
 * that is not another landmark.
 */
export function vertexBeside(mesh, landmarks, number) {
  const truth = placed(mesh, landmarks[number].at[1]);
  const taken = new Set(landmarks.map((l) => l.at[1].vertex));
  const diagonal = diagonalOf(mesh);
  const off = mesh.positions.map((p, v) => (taken.has(v) ? Infinity : Math.abs(apart(p, truth) / diagonal - 0.15)));
  const vertex = off.indexOf(Math.min(...off));
  assert.ok(off[vertex] < 0.01);
  return vertex;
}
