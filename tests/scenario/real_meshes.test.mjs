// Uploads every real mesh: good ones embed, repairable ones are repaired, bad ones are refused for the right reason.
import assert from 'node:assert/strict';
import test from 'node:test';
import { daemon, slow, assertProblem } from './support/daemon.mjs';
import * as real from './support/real.mjs';

const skip = real.there ? false : 'no real meshes';
const large = 20_000; // a build with sanitizers skips meshes with more triangles

async function embeds(d, mesh, what) {
  const { certificate, distortion } = await d.made('/v1/embeddings', { mesh: mesh.id });
  assert.equal(certificate.valid, true, what);
  assert.equal(certificate.flipped, 0, what);
  assert.equal(certificate.degenerate, 0, what);
  assert.equal(certificate.degree, 1, what);
  assert.equal(certificate.exact, true, what);
  assert.ok(distortion.symmetric_dirichlet.mean >= 1, what);
}

test('good meshes are accepted without repairs and embed', { skip }, async (t) => {
  const d = await daemon(t);
  for (const row of real.rows('good')) {
    if (slow && Number(row.f) > large) continue;
    await t.test(row.name, async () => {
      const reply = await d.uploadFile(row.file);
      assert.equal(reply.status, 201, reply.bytes.toString());
      assert.equal(reply.json.triangles, Number(row.f));
      assert.equal(reply.json.format, row.format);
      assert.deepEqual(reply.json.topology, {
        ...reply.json.topology,
        components: 1,
        genus: 0,
        boundary_loops: 0,
        nonmanifold_edges: 0,
        nonmanifold_vertices: 0,
      });
      await embeds(d, reply.json, row.name);
    });
  }
});

test('repairable meshes are repaired, and the response lists the repairs', { skip }, async (t) => {
  const d = await daemon(t);
  const kinds = {
    weld: ['weld'],
    'weld+drop200': ['weld', 'degenerate-faces'],
    reorient: ['reorient'],
    split: ['split-vertices'],
    largest: ['largest_component'],
    flip: ['turn-inside-out'],
  };
  for (const row of real.rows('weldable')) {
    await t.test(`${row.name} (${row.fix})`, async () => {
      assert.ok(kinds[row.fix], `the test does not know this fix: ${row.fix}`);
      const largest = row.fix === 'largest';
      if (largest) assertProblem(await d.uploadFile(row.file), 422, 'not-connected');
      else
        assert.ok([422].includes((await d.uploadFile(row.file, { repair: 'none' })).status), 'refused without repairs');
      const reply = await d.uploadFile(row.file, { repair: largest ? 'largest_component' : 'safe' });
      assert.equal(reply.status, 201, reply.bytes.toString());
      assert.equal(reply.json.triangles, Number(row.usable_f));
      const done = reply.json.repairs.map((r) => r.kind);
      for (const kind of kinds[row.fix]) assert.ok(done.includes(kind), `${kind} in ${done}`);
      await embeds(d, reply.json, row.name);
    });
  }
});

/** The problem types that fit the reason in the index; several if two reasons apply at once. */
function expected(reason) {
  const list = [
    [
      /^empty file/,
      [
        [415, 'unknown-format'],
        [400, 'malformed-mesh'],
      ],
    ],
    [/NaN|inf/, [[422, 'not-finite']]],
    [/malformed|out of range|no faces|binary (PLY|STL)/, [[400, 'malformed-mesh']]],
    [
      /two tetrahedra|non-manifold|non-orientable/,
      [
        [422, 'not-manifold'],
        [422, 'not-orientable'],
        [422, 'not-closed'],
        [422, 'not-connected'],
        [422, 'degenerate'],
      ],
    ],
    [
      /repeated-index/,
      [
        [422, 'not-closed'],
        [422, 'degenerate'],
      ],
    ],
    [
      /boundary and \d+ components/,
      [
        [422, 'not-closed'],
        [422, 'not-manifold'],
        [422, 'not-connected'],
      ],
    ],
    [/components/, [[422, 'not-connected']]],
    [
      /boundary|truncated in the middle/,
      [
        [422, 'not-closed'],
        [400, 'malformed-mesh'],
      ],
    ],
    [/genus/, [[422, 'not-genus-zero']]],
  ];
  return list.find(([pattern]) => pattern.test(reason))?.[1];
}

test('a refusal of a bad mesh names its reason and the facts', { skip }, async (t) => {
  const d = await daemon(t);
  for (const row of real.rows('bad')) {
    await t.test(`${row.name}: ${row.reason}`, async () => {
      const reply = await d.uploadFile(row.file);
      const fits = expected(row.reason);
      assert.ok(fits, `the test does not know this reason: ${row.reason}`);
      const found = fits.find(([status, type]) => status === reply.status && reply.json?.type === `/problems/${type}`);
      assert.ok(found, `${reply.status} ${reply.bytes}`);
      assertProblem(reply, ...found);
      const p = reply.json;
      const facts = {
        'malformed-mesh': () => p.line > 0 || p.offset >= 0,
        'not-closed': () =>
          p.boundary_loops > 0 && p.boundary_edges.length > 0 && p.boundary_edges.every((e) => e.length === 2),
        'not-connected': () => p.components.length > 1,
        'not-genus-zero': () => p.genus === Number(row.genus),
        'not-manifold': () => (p.edges?.length ?? 0) + (p.vertices?.length ?? 0) > 0,
      }[found[1]];
      if (facts) assert.ok(facts(), JSON.stringify(p));
    });
  }
});
