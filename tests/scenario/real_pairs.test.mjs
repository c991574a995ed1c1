// Every real pair: one closed surface, landmarks at their places on both shapes, small errors, a clean asset.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import test from 'node:test';
import validator from 'gltf-validator';
import { daemon, slow } from './support/daemon.mjs';
import { morphOf, topologyOf, vertexAt } from './support/glb.mjs';
import * as real from './support/real.mjs';
import * as shapes from './support/shapes.mjs';

const skip = real.there ? false : 'no real meshes';
const few = ['cow-spot', 'shrec397-shrec398', 'human_man-penguin']; // the pairs for a build with sanitizers

test('every pair merges', { skip }, async (t) => {
  const d = await daemon(t);
  for (const pair of real.pairs()) {
    if (slow && !few.includes(pair.name)) continue;
    await t.test(pair.name, async (u) => {
      const meshes = [];
      for (const file of pair.files) meshes.push(await d.mesh(file));
      const request = {
        shapes: meshes.map((m) => ({ mesh: m.id, name: m.name })),
        landmarks: pair.landmarks,
        asset: { fit: 'none' }, // keeps the positions of the files, at which the test looks up landmarks
      };
      const result = await d.make('/v1/supermeshes', request);
      assert.ok(result.resource, JSON.stringify(result.problem));
      const s = result.resource;
      assert.equal(s.triangles, 2 * s.vertices - 4);
      assert.equal(s.certificate.closed, true);
      assert.equal(s.certificate.genus, 0);
      assert.deepEqual(s.certificate.flipped, [0, 0]);
      assert.deepEqual(s.certificate.degree, [1, 1]);
      assert.equal(s.certificate.landmarks_exact, true);
      for (const shape of s.shapes)
        assert.ok(shape.hausdorff_relative <= 0.005, `${shape.name}: ${shape.hausdorff_relative}`);
      u.diagnostic(
        `${s.triangles} triangles, off by ${s.shapes.map((x) => (100 * x.hausdorff_relative).toFixed(3)).join(' and ')} %, ${s.timings_ms.total} ms`,
      );

      const asset = (await d.get(s.asset)).bytes;
      const morph = morphOf(asset);
      const topology = topologyOf(morph);
      assert.equal(topology.closed, true);
      assert.equal(topology.euler, 2);
      assert.equal(topology.vertices, s.vertices);
      const sources = await Promise.all(pair.files.map(async (file) => shapes.parse(await readFile(file, 'utf8'))));
      const used = new Set();
      for (const { name, at } of pair.landmarks) {
        const vertex = vertexAt(
          morph,
          at.map((place, i) => sources[i].positions[place.vertex]),
        );
        assert.ok(vertex >= 0, `landmark ${name} is not a vertex of the supermesh`);
        used.add(topology.weld[vertex]);
      }
      assert.equal(used.size, pair.landmarks.length);
      if (asset.length < 20e6) {
        const report = await validator.validateBytes(new Uint8Array(asset));
        assert.equal(
          report.issues.numErrors + report.issues.numWarnings,
          0,
          JSON.stringify(report.issues.messages.slice(0, 3)),
        );
      }
      const again = await d.make('/v1/supermeshes', request);
      assert.equal(again.status, 200);
    });
  }
});

// Both files have y up. Without landmarks the cow's head may go to a leg of Spot; the verdict then says so.
test('a match of two standing animals leaves both standing', { skip: skip || (slow && 'takes minutes') }, async (t) => {
  const d = await daemon(t);
  const cow = real.pairs().find((pair) => pair.name === 'cow-spot');
  const list = [];
  for (const file of cow.files) list.push({ mesh: (await d.mesh(file)).id });
  const made = await d.made('/v1/supermeshes', { shapes: list });
  const { up_degrees } = made.shapes[1].fit;
  assert.ok(up_degrees < 30, `${made.match.verdict}, and the up axis rotates by ${up_degrees}°`);
});
