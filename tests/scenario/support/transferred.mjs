// Shapes with texture coordinates, and an asset with the results of "transfer".
import assert from 'node:assert/strict';
import validator from 'gltf-validator';
import { parseGlb } from './glb.mjs';

export const uploaded = async (d, bytes, query) => {
  const reply = await d.upload(bytes, query);
  assert.equal(reply.status, 201, JSON.stringify(reply.json));
  return { mesh: reply.json.id };
};

/**
 * A shape as two charts, which meet where its sphere has x = 0. uvOf(v, east): the coordinates of vertex v of the shape
 * on a chart.
 */
export function inCharts({ positions, points, triangles }, uvOf) {
  const made = { positions: [], uv: [], triangles: [] };
  const known = new Map();
  for (const t of triangles) {
    const east = t.reduce((sum, v) => sum + points[v][0], 0) > 0;
    made.triangles.push(
      t.map((v) => {
        const key = `${v} ${east}`;
        if (!known.has(key)) {
          known.set(key, made.positions.push(positions[v]) - 1);
          made.uv.push(uvOf(v, east));
        }
        return known.get(key);
      }),
    );
  }
  return made;
}

/** The asset of a supermesh: its document, and each primitive with its values read. Fails if the validator warns. */
export async function assetOf(d, made) {
  const { bytes } = await d.get(made.asset);
  const { issues } = await validator.validateBytes(new Uint8Array(bytes));
  const bad = issues.messages.filter((m) => m.severity < 2);
  assert.deepEqual(bad, []);
  const { gltf, read } = parseGlb(bytes);
  const all = gltf.meshes.flatMap((mesh) =>
    mesh.primitives.map((primitive) => {
      const values = Object.fromEntries(
        Object.entries(primitive.attributes).map(([name, index]) => [name, [...read(index)]]),
      );
      const moves = (primitive.targets ?? []).map((target) => [...read(target.POSITION)]);
      return { ...values, primitive, moves, indices: [...read(primitive.indices)] };
    }),
  );
  return { gltf, read, all, bytes };
}

/** The place of each vertex on the shape that a target shows. */
export const shown = ({ POSITION, moves }, target = 0) =>
  Array.from({ length: POSITION.length / 3 }, (_, v) =>
    [0, 1, 2].map((k) => POSITION[3 * v + k] + moves[target][3 * v + k]),
  );

export const near = (a, b, most, what) =>
  a.forEach((x, k) => {
    assert.ok(Math.abs(x - b[k]) < most, `${what}: ${a} is not ${b}`);
  });
