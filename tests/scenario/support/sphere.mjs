// Reads the PLY of a mesh and its sphere, and checks the sphere.
import assert from 'node:assert/strict';

export function readSphere(bytes) {
  const end = bytes.indexOf('end_header\n') + 11;
  const head = bytes.toString('latin1', 0, end);
  assert.match(head, /^ply\nformat binary_little_endian 1\.0\n/);
  const count = Number(/element vertex (\d+)/.exec(head)[1]);
  const faces = Number(/element face (\d+)/.exec(head)[1]);
  const properties = [...head.matchAll(/property (?!list)(\w+) (\w+)/g)].map((m) => m.slice(1).join(' '));
  assert.deepEqual(properties, [
    'double x',
    'double y',
    'double z',
    'double px',
    'double py',
    'double pz',
    'int source',
  ]);
  assert.match(head, /property list uchar int vertex_indices/);
  const vertices = [];
  const triangles = [];
  let at = end;
  for (let v = 0; v < count; v++, at += 52) {
    const x = Array.from({ length: 6 }, (_, k) => bytes.readDoubleLE(at + 8 * k));
    vertices.push({ at: x.slice(0, 3), on: x.slice(3), source: bytes.readInt32LE(at + 48) });
  }
  for (let f = 0; f < faces; f++, at += 13) {
    assert.equal(bytes[at], 3);
    triangles.push([0, 1, 2].map((k) => bytes.readInt32LE(at + 1 + 4 * k)));
  }
  assert.equal(at, bytes.length);
  return { vertices, triangles };
}

const determinant = ([a, b, c], [d, e, f], [g, h, i]) =>
  a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);

/** Twice the tangent of half the solid angle, by Oosterom and Strackee. */
function solidAngle(p, q, r) {
  const dot = (u, v) => u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
  return 2 * Math.atan2(determinant(p, q, r), 1 + dot(p, q) + dot(q, r) + dot(r, p));
}

/** Every point is of unit length, every triangle faces outward, and together they cover the sphere once. */
export function coversOnce({ vertices, triangles }, what) {
  for (const v of vertices) assert.ok(Math.abs(Math.hypot(...v.on) - 1) < 1e-12, `${what}: a point is off the sphere`);
  let angle = 0;
  for (const [a, b, c] of triangles) {
    const [p, q, r] = [vertices[a].on, vertices[b].on, vertices[c].on];
    assert.ok(determinant(p, q, r) > 0, `${what}: a triangle is flipped`);
    angle += solidAngle(p, q, r);
  }
  assert.ok(Math.abs(angle - 4 * Math.PI) < 1e-6, `${what}: it covers the sphere once`);
}
