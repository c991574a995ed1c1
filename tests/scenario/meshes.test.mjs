// Meshes: which ones are accepted, repaired or refused and why; and the resource itself.
import assert from 'node:assert/strict';
import { createHash } from 'node:crypto';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { daemon, samples, slow, assertProblem } from './support/daemon.mjs';
import { writeGlb, writeGltf } from './support/glb_write.mjs';
import * as shapes from './support/shapes.mjs';

const { obj, ball } = shapes;

test('the content of a mesh determines its id', async (t) => {
  const d = await daemon(t);
  const bytes = await readFile(path.join(samples, 'dog.obj'));
  const first = await d.upload(bytes, { name: 'dog' });
  assert.equal(first.status, 201, first.bytes.toString());
  const mesh = first.json;
  assert.match(mesh.id, /^[0-9a-f]{64}$/);
  assert.equal(mesh.url, `/v1/meshes/${mesh.id}`);
  assert.ok(first.headers.get('location').endsWith(mesh.url));
  assert.equal(mesh.name, 'dog');
  assert.equal(mesh.format, 'obj');
  assert.equal(mesh.bytes, bytes.length);
  assert.equal(mesh.triangles, 2 * mesh.vertices - 4);
  assert.equal(mesh.triangles, bytes.toString().match(/^f /gm).length);
  assert.deepEqual(mesh.topology, {
    ...mesh.topology,
    components: 1,
    genus: 0,
    boundary_loops: 0,
    nonmanifold_edges: 0,
    nonmanifold_vertices: 0,
  });
  assert.deepEqual(mesh.repairs, []);
  assert.ok(Math.abs(Date.parse(mesh.created) - Date.now()) < 600_000);

  const again = await d.upload(bytes, { name: 'dog' });
  assert.equal(again.status, 200);
  assert.equal(again.json.id, mesh.id);
  const other = await d.upload(bytes, { name: 'dog', repair: 'none' });
  assert.notEqual(other.json.id, mesh.id, 'the repair options belong to the identity');

  assert.deepEqual((await d.get(mesh.url)).json, mesh);
  const file = await d.get(`${mesh.url}/file`);
  assert.equal(createHash('sha256').update(file.bytes).digest('hex'), createHash('sha256').update(bytes).digest('hex'));
});

test('a mesh has the area, volume and bounds of its surface', async (t) => {
  const d = await daemon(t);
  const { json: cube } = await d.upload(shapes.cube.replaceAll('v 1', 'v 2'), { name: 'box' });
  assert.equal(cube.vertices, 8);
  assert.equal(cube.triangles, 12);
  assert.ok(Math.abs(cube.area - 10) < 1e-12);
  assert.ok(Math.abs(cube.volume - 2) < 1e-12);
  assert.deepEqual(cube.bounds, { min: [0, 0, 0], max: [2, 1, 1] });
});

test('every format is detected by its content', async (t) => {
  const d = await daemon(t);
  const m = ball(2);
  const files = [
    ['obj', obj(m)],
    ['off', shapes.off(m)],
    ['ply', shapes.binaryPly(m)],
    ['stl', shapes.binaryStl(m)],
    ['3mf', shapes.threeMf(m)],
    ['gltf', writeGltf(m)],
    ['glb', writeGlb(m)],
  ];
  for (const [format, bytes] of files) {
    const reply = await d.upload(bytes, { name: 'misleading.xyz' });
    assert.equal(reply.status, 201, `${format}: ${reply.bytes}`);
    assert.equal(reply.json.format, format);
    assert.equal(reply.json.vertices, m.positions.length, format);
    assert.equal(reply.json.triangles, m.triangles.length, format);
    const file = await d.get(`${reply.json.url}/file`);
    assert.equal(file.headers.get('content-disposition'), `inline; filename="misleading.xyz.${format}"`);
  }
  for (const [name, value] of [
    ['dog', 'filename="dog.obj"'],
    ['-rf', 'filename="_rf.obj"'],
    ['a/b"c', `filename="a_b_c.obj"`],
    ['Kätzchen', `filename="K_tzchen.obj"; filename*=UTF-8''K%C3%A4tzchen.obj`],
    ['x'.repeat(127), `filename="${'x'.repeat(127)}.obj"`],
  ]) {
    const { json } = await d.upload(obj(ball(1)), { name });
    const { headers } = await d.get(`${json.url}/file`);
    assert.equal(headers.get('content-disposition'), `inline; ${value}`);
    assert.equal((await d.delete(json.url)).status, 204);
  }
  const big = await d.upload(shapes.binaryPly(m, true));
  assert.equal(big.status, 201, big.bytes.toString());
});

test('safe repairs do not change the shape, and the response lists them', async (t) => {
  const d = await daemon(t);
  const m = ball(2);
  const kinds = (reply) => Object.fromEntries(reply.json.repairs.map((r) => [r.kind, r.count]));
  const repaired = async (mesh, kind, what) => {
    const reply = await d.upload(typeof mesh === 'string' ? mesh : obj(mesh));
    assert.equal(reply.status, 201, `${what}: ${reply.bytes}`);
    assert.ok(kinds(reply)[kind] > 0, `${what}: ${JSON.stringify(reply.json.repairs)}`);
    assert.equal(reply.json.triangles, m.triangles.length, what);
    assert.ok(reply.json.volume > 0, `${what}: the surface faces outwards`);
  };
  await repaired(shapes.soup(m), 'weld', 'vertices at one place');
  await repaired(
    shapes.reversed(m, (i) => i % 5 === 2),
    'reorient',
    'some faces reversed',
  );
  await repaired(shapes.reversed(m), 'turn-inside-out', 'all faces reversed');
  await repaired({ ...m, positions: [...m.positions, [9, 9, 9]] }, 'unused-vertices', 'a vertex without faces');
  await repaired({ ...m, triangles: [...m.triangles, m.triangles[3]] }, 'duplicate-faces', 'a face twice');
  await repaired(`${obj(m)}f 1 1 2\n`, 'degenerate-faces', 'a face over one vertex twice');
  const cube = await d.upload(shapes.cube);
  assert.equal(kinds(cube).triangulate, 6, 'polygons');
});

test('a small file with a hole of very many edges is checked with the memory that filling it takes', async (t) => {
  const d = await daemon(t);
  const edges = 2000;
  const rim = Array.from({ length: edges }, (_, i) => (2 * Math.PI * i) / edges);
  const bowl = shapes.binaryPly({
    positions: [[0, 0, -1], ...rim.map((a) => [Math.cos(a), Math.sin(a), 0])],
    triangles: rim.map((_, i) => [0, 1 + ((i + 1) % edges), 1 + i]),
  });
  const filled = await d.upload(bowl, { repair: 'fill_holes' });
  assert.equal(filled.status, 201, filled.bytes.toString());
  assert.ok(filled.json.triangles > 8 * edges, `${filled.json.triangles} triangles`); // docs/limits.md: 16,384 at most
});

test('repairs that change the shape happen only on request', async (t) => {
  const d = await daemon(t);
  const open = obj(shapes.withoutFace(ball(2)));
  assertProblem(await d.upload(open), 422, 'not-closed');
  const filled = await d.upload(open, { repair: 'fill_holes' });
  assert.equal(filled.status, 201, filled.bytes.toString());
  assert.ok(filled.json.repairs.some((r) => r.kind === 'fill_holes' && r.count === 1));
  const two = obj(shapes.apart(ball(2), ball(1)));
  assertProblem(await d.upload(two), 422, 'not-connected');
  const largest = await d.upload(two, { repair: 'largest_component' });
  assert.equal(largest.status, 201, largest.bytes.toString());
  assert.equal(largest.json.triangles, 128);
  const named = two.replace(/^f/m, 'o one\nf').replace(/^((?:f.*\n){128})/m, '$1o two\n');
  const pieces = await d.upload(named);
  assertProblem(pieces, 422, 'not-connected');
  assert.deepEqual(pieces.json.parts, [
    { part: 0, triangles: 128, name: 'one' },
    { part: 1, triangles: 32, name: 'two' },
  ]);
  for (const part of [1, 'two']) {
    const other = await d.upload(named, { repair: 'largest_component', part });
    assert.equal(other.status, 201, other.bytes.toString());
    assert.equal(other.json.triangles, 32);
    assert.equal(other.json.repair, `safe,part:${part}`);
    assert.ok(other.json.repairs.some((r) => r.kind === 'part' && r.count === 1));
  }
  assertProblem(await d.upload(named, { part: 'three' }), 422, 'not-connected');
  const one = await d.upload(obj(ball(2)), { part: 4 });
  assertProblem(one, 422, 'bad-option');
  assert.match(one.json.detail, /one piece and has no part 4/);
  assert.equal(one.json.member, 'part');
  assertProblem(await d.upload(named, { part: 'two', repair: 'none' }), 400, 'bad-query');
  const unknown = await d.upload(open, { repair: 'magic' });
  assert.equal(unknown.status, 400, unknown.bytes.toString());
});

test('edges of three faces are split on request', async (t) => {
  const d = await daemon(t);
  const wall =
    'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0 0 -1\nf 1 2 4\nf 2 3 4\nf 3 1 4\nf 2 1 5\nf 3 2 5\nf 1 3 5\nf 1 3 2\n';
  const refused = await d.upload(wall);
  assertProblem(refused, 422, 'not-manifold');
  assert.match(refused.json.detail, /repair=split_nonmanifold/);
  assertProblem(await d.upload(wall, { repair: 'split_nonmanifold' }), 422, 'not-connected');
  const split = await d.upload(wall, { repair: 'split_nonmanifold,largest_component' });
  assert.equal(split.status, 201, split.bytes.toString());
  assert.equal(split.json.triangles, 6, 'the wall is gone');
  assert.equal(split.json.repair, 'safe,largest_component,split_nonmanifold');
  assert.ok(split.json.repairs.some((r) => r.kind === 'split_nonmanifold' && r.count === 3));
  assert.ok(Math.abs(split.json.volume - 1 / 3) < 1e-12);
});

test('handles are closed up to a size, and shown beyond it', async (t) => {
  const d = await daemon(t);
  const ring = obj(shapes.torus());
  const refused = await d.upload(ring);
  assertProblem(refused, 422, 'not-genus-zero');
  const { loops, loop_lengths_relative: lengths, genus } = refused.json;
  assert.equal(genus, 1);
  assert.equal(loops.length, 1);
  assert.equal(new Set(loops[0]).size, loops[0].length);
  assertProblem(await d.upload(ring, { repair: 'close_handles' }), 422, 'not-genus-zero');
  const size = 1.001 * lengths[0];
  const closed = await d.upload(ring, { repair: 'close_handles', handle_size: size });
  assert.equal(closed.status, 201, closed.bytes.toString());
  assert.equal(closed.json.topology.genus, 0);
  const [handle, ...more] = closed.json.repairs.filter((r) => r.kind === 'close_handles');
  assert.equal(more.length, 0);
  assert.equal(handle.how, 'cut');
  assert.equal(handle.loop.length, loops[0].length);
  assert.ok(Math.abs(handle.length_relative - lengths[0]) < 1e-12 && handle.area_relative > 0);
  const again = await d.upload(ring, { repair: 'close_handles', handle_size: size });
  assert.equal(again.status, 200);
  assert.equal(again.json.id, closed.json.id);
  const embedded = (await d.post('/v1/embeddings?wait=30', { mesh: closed.json.id })).json;
  assert.equal(embedded.certificate.valid, true);
  assertProblem(await d.upload(ring, { handle_size: 0.1 }), 400, 'bad-query');
  assertProblem(await d.upload(ring, { repair: 'close_handles', handle_size: 0 }), 400, 'bad-query');
});

test('a piece of a glTF file has the name of its mesh, and that of its node', async (t) => {
  const d = await daemon(t);
  const pair = (name) =>
    writeGlb({
      ...ball(2),
      edit: (gltf) => {
        if (name) gltf.meshes[0].name = name;
        gltf.nodes = [
          { name: 'left', mesh: 0 },
          { name: 'right', mesh: 0, translation: [5, 0, 0] },
        ];
        gltf.scenes[0].nodes = [0, 1];
      },
    });
  const pieces = async (file) => (await d.upload(file)).json.parts.map(({ name, node }) => [name, node]);
  assert.deepEqual(await pieces(pair('eye')), [
    ['eye', 'left'],
    ['eye', 'right'],
  ]);
  assert.deepEqual(await pieces(pair()), [
    ['left', 'left'],
    ['right', 'right'],
  ]);
  const right = await d.upload(pair('eye'), { part: 'right' });
  assert.equal(right.status, 201, right.bytes.toString());
  assert.ok(right.json.bounds.min[0] > 3);
  const first = await d.upload(pair('eye'), { part: 'eye' });
  assert.ok(first.json.bounds.max[0] < 2, 'of equal pieces the first');
});

test('open pieces beside a closed one need no filling', async (t) => {
  const d = await daemon(t);
  const advice = async (...parts) => {
    const reply = await d.upload(obj(shapes.apart(...parts)));
    assertProblem(reply, 422, 'not-closed');
    return [reply.json.detail, reply.json.components];
  };
  const [body, sizes] = await advice(ball(2), shapes.withoutFace(ball(1)));
  assert.match(body, /mesh with repair=largest_component: the largest of its 2 pieces has no holes\.$/);
  assert.deepEqual(sizes, [128, 31]);
  assert.match(
    (await advice(shapes.withoutFace(ball(2)), ball(1)))[0],
    /repair=fill_holes, and with largest_component or part=K to keep one of its 2 pieces; piece 1 has no holes\.$/,
  );
  assert.match(
    (await advice(shapes.withoutFace(ball(2)), shapes.withoutFace(ball(1))))[0],
    /repair=fill_holes, and with largest_component or part=K to keep one of its 2 pieces\.$/,
  );
});

test('a refusal of a bad mesh says what is wrong and where', async (t) => {
  const d = await daemon(t);
  const m = ball(2);
  const refused = async (body, status, type, query) => {
    const reply = await d.upload(typeof body === 'object' && body.positions ? obj(body) : body, query);
    assertProblem(reply, status, type, type);
    return reply.json;
  };
  const open = await refused(shapes.withoutFace(m), 422, 'not-closed');
  assert.match(open.detail, /3 edges in 1 boundary loop have a face on one side only\. Close the hole,/);
  assert.equal(open.boundary_loops, 1);
  assert.equal(open.boundary_edges.length, 3);
  assert.deepEqual(
    [...new Set(open.boundary_edges.flat())].sort((a, b) => a - b),
    [...m.triangles[0]].sort((a, b) => a - b),
  );
  assert.equal((await refused(shapes.torus(), 422, 'not-genus-zero')).genus, 1);
  assert.deepEqual((await refused(shapes.apart(ball(2), ball(1)), 422, 'not-connected')).components, [128, 32]);
  const along = {
    positions: [
      [0, 0, 0],
      [1, 0, 0],
      [0, 1, 0],
      [0, 0, 1],
      [0, -1, 0],
      [0, 0, -1],
    ], // two tetrahedra that share an edge
    triangles: [
      [0, 2, 1],
      [0, 1, 3],
      [0, 3, 2],
      [1, 2, 3],
      [0, 4, 1],
      [0, 1, 5],
      [0, 5, 4],
      [1, 4, 5],
    ],
  };
  assert.deepEqual(
    (await refused(along, 422, 'not-manifold')).edges.map((e) => [...e].sort()),
    [[0, 1]],
  );
  await refused(
    shapes.reversed(m, (i) => i === 5),
    422,
    'not-orientable',
    { repair: 'none' },
  );
  // a Möbius strip: after 12 quads, upper and lower vertex have changed places
  const strip = { positions: [], triangles: [] };
  for (let i = 0; i < 12; i++) {
    const [across, along] = [(Math.PI * i) / 12, (Math.PI * i) / 6];
    for (const side of [-0.3, 0.3]) {
      const away = 1 + side * Math.cos(across);
      strip.positions.push([away * Math.cos(along), away * Math.sin(along), side * Math.sin(across)]);
    }
    const [a, b, c, d] = [2 * i, 2 * i + 1, ...(i < 11 ? [2 * i + 2, 2 * i + 3] : [1, 0])];
    strip.triangles.push([a, c, b], [b, c, d]);
  }
  const twisted = await refused(strip, 422, 'not-orientable');
  assert.equal(twisted.edges.length, 1);
  assert.match(twisted.detail, /only one side.*Cut the surface there, and close it\.$/);
  await refused(obj(m).replace('v 1 0 0', 'v nan 0 0'), 422, 'not-finite');
  const grown = (scale, shift = 0) => ({ ...m, positions: m.positions.map((p) => p.map((x) => x * scale + shift)) });
  for (const scale of [1.1e30, 1e100, 1e150, 1e200, 1e308]) {
    const far = await refused(grown(scale), 422, 'not-finite');
    assert.match(far.detail, /scale the mesh down/);
    assert.ok(far.vertex_count > 0);
  }
  for (const scale of [1e-31, 1e-40, 1e-200])
    assert.match((await refused(grown(scale), 422, 'degenerate')).detail, /scale it up/);
  assert.match((await refused(grown(1, 1e9), 422, 'degenerate')).detail, /move it to the origin/);
  const line = await refused(obj(m).replace(/\nf (\d+)/, '\nf 99999'), 400, 'malformed-mesh');
  assert.equal(line.line, m.positions.length + 1);
  assert.doesNotMatch(line.detail, /fill_holes/);
  const faces = obj(m).trimEnd().split('\n');
  const ends = await refused(faces.slice(0, -1).concat('f 1').join('\n'), 400, 'malformed-mesh');
  assert.match(ends.detail, /ends within this line.*delete this line and send what is left with repair=fill_holes/);
  const cut = await refused(shapes.binaryPly(m).subarray(0, -20), 400, 'malformed-mesh');
  assert.ok(cut.offset > 0 || cut.line > 0);
  await refused('v 0 0 0\nv 1 0 0\nv 0 1 0\n', 400, 'malformed-mesh');
  await refused(Buffer.from([0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10, 0, 1, 2, 3]), 415, 'unknown-format');
  await refused('v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 3 2 1\n', 422, 'degenerate');
  const list = await d.get('/v1/meshes');
  assert.deepEqual(list.json.meshes ?? list.json.items, [], 'nothing that was refused is stored');
});

test('truncated and corrupted files never crash the daemon', async (t) => {
  const d = await daemon(t);
  const files = [
    Buffer.from(obj(ball(1))),
    Buffer.from(shapes.off(ball(1))),
    shapes.binaryPly(ball(1)),
    shapes.binaryStl(ball(1)),
  ];
  let seed = 12345;
  const random = (n) => {
    seed = (Math.imul(seed, 1103515245) + 12345) >>> 0;
    return seed % n;
  };
  for (const file of files)
    for (let i = 0; i < 25; i++) {
      const bytes = Buffer.from(file.subarray(0, 1 + random(file.length)));
      for (let k = random(6); k > 0; k--) bytes[random(bytes.length)] = random(256);
      const reply = await d.upload(bytes);
      assert.ok([200, 201, 400, 413, 415, 422].includes(reply.status), `${reply.status} ${reply.bytes}`);
    }
  assert.equal((await d.get('/livez')).status, 200);
});

test('lists are paged; a deleted mesh is gone', async (t) => {
  const d = await daemon(t);
  const ids = [];
  for (let i = 0; i < 5; i++)
    ids.push((await d.upload(shapes.tetrahedron.replace('v 1 0 0', `v ${i + 1} 0 0`), { name: `t${i}` })).json.id);
  const seen = [];
  let token;
  let pages = 0;
  do {
    const page = (await d.get('/v1/meshes', { query: { limit: 2, ...(token ? { page_token: token } : {}) } })).json;
    const items = Object.values(page).find(Array.isArray);
    assert.ok(items.length <= 2);
    seen.push(...items.map((m) => m.id));
    token = page.next_page_token;
    pages++;
  } while (token);
  assert.equal(pages, 3);
  assert.deepEqual([...seen].sort(), [...ids].sort());
  const gone = await d.delete(`/v1/meshes/${ids[2]}`);
  assert.ok([200, 204].includes(gone.status), gone.bytes.toString());
  assertProblem(await d.get(`/v1/meshes/${ids[2]}`), 404, 'not-found');
  assert.equal((await d.upload(shapes.tetrahedron.replace('v 1 0 0', 'v 3 0 0'))).status, 201, 'it can come back');
});

test('small uploads are checked while large ones are in progress', async (t) => {
  // With one worker, one thread checks uploads of more than 16 MB and another checks the rest.
  const d = await daemon(t, { args: ['--workers', '1'] });
  const shape = shapes.ball(8, ([x, y, z]) => [x, 1.5 * y, z * (1 + 0.2 * x)]);
  const text = shapes.obj(shape);
  assert.ok(text.length > 20 << 20, `${text.length} bytes`);
  let ended = 0;
  const large = (slow ? [0, 1] : [0, 1, 2, 3]).map((i) => d.upload(`# ${i}\n${text}`).finally(() => ended++));
  // After the first large upload arrives, it is being checked and the other waits; each small one is still answered.
  const received = async () =>
    Number(/^orbmorph_received_bytes_total (\d+)$/m.exec((await d.get('/metrics')).bytes.toString())[1]);
  while (ended === 0 && (await received()) < text.length) await new Promise((done) => setTimeout(done, 20));
  let between = 0;
  for (let i = 0; ended < large.length; i++) {
    const reply = await d.upload(`${shapes.tetrahedron}# ${i}\n`);
    assert.equal(reply.status, 201, reply.bytes.toString());
    between += ended < large.length;
  }
  assert.ok(between > 0, 'small ones passed');
  for (const [i, reply] of (await Promise.all(large)).entries()) {
    assert.equal(reply.status, 201, reply.bytes.toString());
    assert.equal(reply.json.triangles, shape.triangles.length);
    assert.equal((await d.get(`${reply.json.url}/file`)).bytes.length, text.length + `# ${i}\n`.length);
  }
});
