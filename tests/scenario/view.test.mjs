// The pictures that `orbmorph view` draws of small GLB files.
import assert from 'node:assert/strict';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { folder, run } from './support/cli.mjs';
import { writeGlb } from './support/glb_write.mjs';
import { readPng, writePng } from './support/png.mjs';
import { samples } from './support/daemon.mjs';
import * as real from './support/real.mjs';
import { ball, parse } from './support/shapes.mjs';

/** A GLB of one square in the plane z = 0, from (−1,−1) to (1,1), moved by one morph target. */
function square({ move = [0, 0, 0], ...rest }) {
  const positions = [
    [-1, -1, 0],
    [1, -1, 0],
    [1, 1, 0],
    [-1, 1, 0],
  ];
  return writeGlb({
    positions,
    normals: positions.map(() => [0, 0, 1]),
    triangles: [
      [0, 1, 2],
      [0, 2, 3],
    ],
    moves: positions.map(() => move),
    ...rest,
  });
}

async function draw(t, glb, ...options) {
  const at = await folder(t);
  await writeFile(path.join(at, 'in.glb'), glb);
  const { code, err } = await run(['view', 'in.glb', '-o', 'out.png', '--yaw', '0', '--pitch', '0', ...options], {
    cwd: at,
  });
  assert.equal(code, 0, err);
  return readPng(await readFile(path.join(at, 'out.png')));
}

/** The pixel at a fraction of the width and height of a frame. */
const at = (png, x, y, frame = 0) => [
  ...png.frames[frame]
    .subarray(3 * (Math.floor(y * png.height) * png.width + Math.floor(x * png.width)))
    .subarray(0, 3),
];
const mainly = (rgb) => {
  const k = rgb.indexOf(Math.max(...rgb));
  return rgb.every((v, i) => i === k || v < 0.5 * rgb[k]) ? 'rgb'[k] : rgb.join();
};

const corners = [
  [0, 1],
  [1, 1],
  [1, 0],
  [0, 0],
]; // in glTF, v grows downward from the top of the image
const quarters = writePng(16, 16, (x, y) =>
  y < 8 ? (x < 8 ? [230, 0, 0] : [0, 230, 0]) : x < 8 ? [0, 0, 230] : [230, 230, 230],
);

test('a texture appears where its coordinates place it', async (t) => {
  const png = await draw(t, square({ uv: corners, image: quarters }), '--poses', '2', '--size', '64');
  assert.deepEqual([png.width, png.height], [128, 64]);
  // the quarters of the left cell, seen from the front
  assert.equal(mainly(at(png, 0.12, 0.25)), 'r');
  assert.equal(mainly(at(png, 0.38, 0.25)), 'g');
  assert.equal(mainly(at(png, 0.12, 0.75)), 'b');
  const [r, g, b] = at(png, 0.38, 0.75);
  assert.ok(Math.abs(r - g) < 3 && Math.abs(g - b) < 3 && r > 100, `${r} ${g} ${b}`);
});

test('textures repeat or clamp as their sampler says, and are averaged when minified', async (t) => {
  const twice = corners.map(([u, v]) => [2 * u, 2 * v]);
  const repeat = await draw(t, square({ uv: twice, image: quarters }), '--poses', '2', '--size', '64');
  assert.equal(mainly(at(repeat, 0.32, 0.12)), 'r', 'the first quarter repeats');
  const clamp = await draw(t, square({ uv: twice, image: quarters, wrap: 33071 }), '--poses', '2', '--size', '64');
  assert.equal(mainly(at(clamp, 0.38, 0.12)), 'g', 'the edge continues');
  // A half turn and a shift by (1,1): the opposite quarter. Half a width more, against that rotation: its neighbour.
  for (const [offset, expected] of [
    [[1, 1], 'b'],
    [[0.5, 1], 'gray'],
  ]) {
    const edit = ({ materials: [{ pbrMetallicRoughness: surface }] }) => {
      surface.baseColorTexture.extensions = { KHR_texture_transform: { offset, rotation: Math.PI } };
    };
    const moved = await draw(t, square({ uv: corners, image: quarters, edit }), '--poses', '2', '--size', '64');
    const [r, g, b] = at(moved, 0.38, 0.25);
    const seen = r === g && g === b && r > 100 ? 'gray' : mainly([r, g, b]);
    assert.equal(seen, expected, `moved by ${offset}`);
  }
  const stripes = writePng(256, 256, (x) => (x % 2 ? [255, 255, 255] : [0, 0, 0]));
  const fine = await draw(
    t,
    square({ uv: corners.map(([u, v]) => [4 * u, 4 * v]), image: stripes }),
    '--poses',
    '2',
    '--size',
    '32',
  );
  const tones = [];
  for (let x = 0.06; x < 0.44; x += 1 / 64) tones.push(at(fine, x, 0.5)[0]);
  assert.ok(Math.max(...tones) - Math.min(...tones) < 12, `${tones}`);
});

test('vertex colours and material colours appear', async (t) => {
  const red = await draw(
    t,
    square({
      colors: [
        [1, 0, 0],
        [1, 0, 0],
        [1, 0, 0],
        [1, 0, 0],
      ],
    }),
    '--poses',
    '2',
    '--size',
    '32',
  );
  assert.equal(mainly(at(red, 0.25, 0.5)), 'r');
  const blue = await draw(t, square({ factor: [0, 0, 1, 1] }), '--poses', '2', '--size', '32');
  assert.equal(mainly(at(blue, 0.25, 0.5)), 'b');
});

test('what has no normals is shaded by the planes of its triangles', async (t) => {
  for (const yaw of ['0', '40', '-40']) {
    const options = ['--poses', '2', '--size', '32', '--yaw', yaw];
    const given = await draw(t, square({}), ...options);
    const flat = await draw(t, square({ normals: undefined }), ...options);
    const [one, other] = [given, flat].map((png) => at(png, 0.25, 0.5));
    assert.ok(one.every((v, k) => Math.abs(v - other[k]) <= 2) && one[0] > 60, `${yaw}: ${other}, not ${one}`);
  }
});

test('--inside paints triangles seen from inside red', async (t) => {
  const glb = square({ factor: [0, 1, 0, 1] });
  assert.equal(mainly(at(await draw(t, glb, '--poses', '2', '--size', '32', '--yaw', '180'), 0.25, 0.5)), 'g');
  assert.equal(
    mainly(at(await draw(t, glb, '--poses', '2', '--size', '32', '--yaw', '180', '--inside'), 0.25, 0.5)),
    'r',
  );
});

test('an animation goes to the last shape and back', async (t) => {
  const png = await draw(t, square({ factor: [1, 0, 0, 1], move: [4, 0, 0] }), '--frames', '8', '--size', '60');
  assert.equal(png.frames.length, 8);
  assert.equal(png.milliseconds, 50);
  const left = [...Array(8).keys()].map((k) => mainly(at(png, 0.2, 0.5, k)) === 'r');
  const right = [...Array(8).keys()].map((k) => mainly(at(png, 0.8, 0.5, k)) === 'r');
  assert.deepEqual([left[0], right[0]], [true, false]);
  assert.deepEqual([left[4], right[4]], [false, true]);
  for (let k = 1; k < 4; k++) assert.ok(png.frames[k].equals(png.frames[8 - k]), `frame ${k} repeats on the way back`);
});

test('view explains why it cannot draw a file', async (t) => {
  const where = await folder(t);
  const broken = square({ uv: corners, image: Buffer.from('no image at all') });
  await writeFile(path.join(where, 'cut.glb'), square({}).subarray(0, 200));
  await writeFile(path.join(where, 'image.glb'), broken);
  for (const [file, why] of [
    ['cut.glb', /truncated or damaged/],
    ['image.glb', /texture/],
    ['none.glb', /No such file/],
    [path.join(samples, 'dog.obj'), /not a GLB/],
  ]) {
    const { code, err } = await run(['view', file, '-o', 'o.png'], { cwd: where });
    assert.equal(code, 2, err);
    assert.match(err, why);
  }
});

/** A GLB of a mesh whose points are rotated; it does not move. */
function still({ positions, triangles }, turn = (p) => p) {
  const points = positions.map(turn);
  return writeGlb({
    positions: points,
    normals: points.map(() => turn([0, 0, 1])),
    triangles,
    moves: points.map(() => [0, 0, 0]),
  });
}
/** How many pixels of the left half are not background, and the width and height of their extent. */
function outline(png) {
  const rows = [];
  const columns = [];
  for (let y = 0; y < png.height; y++)
    for (let x = 0; x < png.width / 2; x++) {
      const [r, g, b] = at(png, (x + 0.5) / png.width, (y + 0.5) / png.height);
      if (Math.min(r, g, b) < 215) rows.push(y) && columns.push(x);
    }
  const reach = (list) => list.reduce((m, v) => Math.max(m, v), 0) - list.reduce((m, v) => Math.min(m, v), 1e9) + 1;
  return { pixels: rows.length, width: reach(columns), height: reach(rows) };
}
async function drawAsIs(t, glb, ...options) {
  const where = await folder(t);
  await writeFile(path.join(where, 'in.glb'), glb);
  const args = ['view', 'in.glb', '-o', 'out.png', '--poses', '2', '--size', '120', ...options];
  const { code, err } = await run(args, { cwd: where });
  assert.equal(code, 0, err);
  return readPng(await readFile(path.join(where, 'out.png')));
}

test('view looks at the largest side, whichever way a shape faces', async (t) => {
  // three times as long as it is wide
  const long = ball(4, ([x, y, z]) => [x, y, 3 * z]);
  for (const angle of [0, 37, 90, 200]) {
    const [c, s] = [Math.cos((angle * Math.PI) / 180), Math.sin((angle * Math.PI) / 180)];
    const { width, height } = outline(
      await drawAsIs(
        t,
        still(long, ([x, y, z]) => [c * x + s * z, y, c * z - s * x]),
      ),
    );
    assert.ok(width > 2.3 * height, `turned by ${angle}: ${width} × ${height}`);
  }
});

/** The same mesh with other axes up. */
const turns = {
  'z up': ([x, y, z]) => [x, -z, y],
  'z up, sideways': ([x, y, z]) => [z, x, y],
  'x up': ([x, y, z]) => [y, -x, z],
  'z down': ([x, y, z]) => [x, z, -y],
};

/** That a mesh whose y axis points up looks as high and wide under all turns, without --up. */
async function assertUpright(t, mesh, what, keys = ['pixels', 'width', 'height']) {
  const upright = outline(await drawAsIs(t, still(mesh), '--up', 'y'));
  for (const [name, turn] of Object.entries({ 'y up': (p) => p, ...turns })) {
    const seen = outline(await drawAsIs(t, still(mesh, turn)));
    for (const key of keys)
      assert.ok(
        Math.abs(seen[key] - upright[key]) < 0.08 * upright[key],
        `${what}, ${name}: ${JSON.stringify([seen, upright])}`,
      );
  }
}

/** A person of ellipsoids: head, trunk, legs, and arms that hang, stretch out or point up. */
function person(arms) {
  const parts = [
    [
      [0, 1.6, 0],
      [0.1, 0.13, 0.11],
    ],
    [
      [0, 1.15, 0],
      [0.2, 0.36, 0.13],
    ],
    ...[-1, 1].map((side) => [
      [0.12 * side, 0.45, 0],
      [0.08, 0.47, 0.09],
    ]),
    ...[-1, 1].map((side) =>
      arms === 'out'
        ? [
            [0.5 * side, 1.4, 0],
            [0.37, 0.06, 0.06],
          ]
        : [
            [0.27 * side, arms === 'up' ? 1.7 : 1.1, 0],
            [0.06, 0.37, 0.06],
          ],
    ),
  ];
  const mesh = { positions: [], triangles: [] };
  for (const [centre, radii] of parts) {
    const one = ball(3, (p) => p.map((x, k) => centre[k] + radii[k] * x));
    const first = mesh.positions.length;
    mesh.positions.push(...one.positions);
    mesh.triangles.push(...one.triangles.map((t) => t.map((v) => v + first)));
  }
  return mesh;
}

test('view shows people upright whatever axis points up in their file', async (t) => {
  for (const arms of ['down', 'out', 'up']) await assertUpright(t, person(arms), `arms ${arms}`);
});

for (const name of ['ada-sit', 'ben-crouch', 'dan-run', 'emmy-armsup'])
  test(`view shows ${name} upright`, { skip: !real.there }, async (t) => {
    const file = path.join(real.folder, 'posed', `${name}.obj`);
    await assertUpright(t, parse(await readFile(file, 'utf8')), name);
  });

/** A bust: an egg without its lower part, on a flat base. */
function bust() {
  const egg = ball(4, ([x, y, z]) => [x * (1 - 0.2 * y), 1.6 * y, 0.9 * z + (y > 0 && z > 0 ? 0.2 * y * z : 0)]);
  return { ...egg, positions: egg.positions.map(([x, y, z]) => [x, Math.max(y, -0.8), z]) };
}

test('view shows what has a flat base upright, and says why', async (t) => {
  await assertUpright(t, bust(), 'bust');
  const cwd = await folder(t);
  const said = async (glb, ...options) => {
    await writeFile(path.join(cwd, 'in.glb'), glb);
    return (await run(['view', 'in.glb', ...options], { cwd })).err;
  };
  const turned = still(bust(), turns['z up']);
  assert.match(await said(turned), /^z points up, .*: it has a flat base; --up y shows it as in glTF\n$/);
  assert.equal(await said(turned, '-q'), '');
  assert.equal(await said(turned, '--up', 'z'), '');
  assert.equal(await said(still(bust())), '');
  assert.match(await said(still(ball(3))), /^nothing in the first shape tells which way is up/);
});

/** The head of a cow: an egg on a broad neck with a snout and two horns. */
function head() {
  const horns = [unit([0.5, 1, 0]), unit([-0.5, 1, 0])];
  return ball(5, (p) => {
    const near = Math.max(...horns.map((h) => p[0] * h[0] + p[1] * h[1] + p[2] * h[2]));
    const horn = Math.exp(-(((1 - near) / 0.02) ** 2));
    const snout = Math.max(0, p[2]) ** 3;
    return [p[0] * (1 + 0.4 * horn), p[1] + 0.7 * horn - 0.3 * snout, 0.9 * p[2] + 0.35 * snout];
  });
}
const unit = (v) => v.map((x) => x / Math.hypot(...v));

/** That view says which axis points up in a mesh whose y axis does; an outline is as high upside down. */
async function assertUp(t, mesh, ways) {
  const cwd = await folder(t);
  for (const way of ways) {
    await writeFile(path.join(cwd, 'in.glb'), still(mesh, turns[way]));
    const { err } = await run(['view', 'in.glb'], { cwd });
    const axis = { 'x up': 'x', 'z down': '-z' }[way] ?? 'z';
    assert.match(err, new RegExp(`^${axis} points up, .*: it has two horns; --up y shows it as in glTF\\n$`), way);
  }
}

test('view shows heads with horns upright, and says why', async (t) => assertUp(t, head(), Object.keys(turns)));

// the goat's is shown as in the file if x points up
for (const [name, ways] of [
  ['good/goathead', ['z up', 'z up, sideways', 'z down']],
  ['bad/cowhead_open', Object.keys(turns)],
])
  test(`view shows ${name} upright`, { skip: !real.there }, async (t) =>
    assertUp(t, parse(await readFile(path.join(real.folder, `${name}.obj`), 'utf8')), ways),
  );

for (const name of ['penguin', 'nefertiti_70k'])
  test(`view shows ${name} upright`, { skip: !real.there }, async (t) => {
    const file = path.join(real.folder, 'good', `${name}.obj`);
    // which side shows depends on where its front is
    await assertUpright(t, parse(await readFile(file, 'utf8')), name, ['height']);
  });

test('view shows animals upright whatever axis points up in their file', async (t) => {
  const dog = parse(await readFile(path.join(samples, 'dog.obj'), 'utf8'));
  const upright = outline(await drawAsIs(t, still(dog), '--up', 'y'));
  for (const [name, turn] of Object.entries({
    'y up': (p) => p,
    'z up': ([x, y, z]) => [x, -z, y],
    'z up, sideways': ([x, y, z]) => [z, x, y],
    'z down': ([x, y, z]) => [x, z, -y],
  })) {
    const seen = outline(await drawAsIs(t, still(dog, turn)));
    for (const key of ['pixels', 'width', 'height'])
      assert.ok(
        Math.abs(seen[key] - upright[key]) < 0.08 * upright[key],
        `${name}: ${JSON.stringify([seen, upright])}`,
      );
  }
  const flipped = await drawAsIs(
    t,
    still(dog, ([x, y, z]) => [x, -y, -z]),
    '--up',
    '-y',
  );
  assert.deepEqual(outline(flipped), upright);
});
