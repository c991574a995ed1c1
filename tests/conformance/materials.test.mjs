// A glTF file with all that materials can have, merged by the daemon: the Khronos validator, three.js and a picture of
// the asset agree with the file itself, and the report names the rest.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import http from 'node:http';
import path from 'node:path';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { folder, run } from '../scenario/support/cli.mjs';
import { daemon } from '../scenario/support/daemon.mjs';
import { writeGlb } from '../scenario/support/glb_write.mjs';
import { writePng } from '../scenario/support/png.mjs';
import * as shapes from '../scenario/support/shapes.mjs';
import { executablePath, softwareGl } from '../tools/chromium.mjs';

const modules = fileURLToPath(new URL('../node_modules/', import.meta.url));
const needed = ['three', 'gltf-validator', 'playwright-core'].map((name) => path.join(modules, name));
if (![...needed, executablePath].every((file) => fs.existsSync(file))) {
  console.log('Chromium or the npm packages are missing: npm ci in tests/');
  process.exit(0);
}
const { chromium } = await import('playwright-core');
const validator = (await import('gltf-validator')).default;
globalThis.self ??= globalThis;
globalThis.createImageBitmap ??= async () => ({ width: 1, height: 1, close() {} }); // this test does not look at pictures
const { GLTFLoader } = await import('three/addons/loaders/GLTFLoader.js');

/** A round cube: six faces of n × n squares, each with texture coordinates from 0 to 1 and smooth normals. */
function roundCube(n = 6) {
  const [positions, normals, uv, triangles] = [[], [], [], []];
  for (const axis of [0, 1, 2])
    for (const side of [-1, 1]) {
      const first = positions.length;
      for (let j = 0; j <= n; j++)
        for (let i = 0; i <= n; i++) {
          const p = [0, 0, 0];
          p[axis] = side;
          p[(axis + 1) % 3] = side * ((2 * i) / n - 1);
          p[(axis + 2) % 3] = (2 * j) / n - 1;
          const length = Math.hypot(...p);
          const unit = p.map((x) => x / length + 0);
          positions.push(unit);
          normals.push(unit);
          uv.push([i / n, 1 - j / n]);
        }
      for (let j = 0; j < n; j++)
        for (let i = 0; i < n; i++) {
          const a = first + j * (n + 1) + i;
          triangles.push([a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]);
        }
    }
  return { positions, normals, uv, triangles };
}

const transform = { offset: [0.25, 0.5], rotation: Math.PI / 6, scale: [3, 2] };
const moved = (index, more = {}) => ({ index, ...more, extensions: { KHR_texture_transform: transform } });
const color = writePng(64, 64, (x, y) => [4 * x, 4 * y, ((x >> 3) + (y >> 3)) % 2 ? 200 : 40], [
  ['gAMA', Buffer.from([0, 1, 0x86, 0xa0])],
  ['cHRM', Buffer.alloc(32, 1)],
]);
/** A grid of bumps: their slopes in the directions of u and of smaller v. */
const bumpy = (u, v) =>
  writePng(64, 64, (x, y) => {
    const n = [u * Math.sin(x / 2), v * Math.sin(y / 3), 1];
    const length = Math.hypot(...n);
    return n.map((c) => Math.round(127.5 * (c / length + 1)));
  });

const rich = {
  name: 'rich',
  alphaMode: 'MASK',
  alphaCutoff: 0.1,
  doubleSided: true,
  emissiveFactor: [0.1, 0.05, 0.2],
  emissiveTexture: moved(0),
  normalTexture: { index: 1, scale: 0.7 },
  occlusionTexture: { index: 0, strength: 0.6 },
  pbrMetallicRoughness: {
    baseColorFactor: [1, 0.75, 0.5, 1],
    baseColorTexture: moved(0),
    metallicFactor: 0.25,
    roughnessFactor: 0.375,
    metallicRoughnessTexture: { index: 2 },
  },
  extensions: {
    KHR_materials_emissive_strength: { emissiveStrength: 1.5 },
    KHR_materials_ior: { ior: 1.4 },
    KHR_materials_clearcoat: {
      clearcoatFactor: 0.5,
      clearcoatRoughnessFactor: 0.1,
      clearcoatTexture: moved(0),
      clearcoatNormalTexture: { index: 1, scale: 0.3 },
    },
    KHR_materials_sheen: {
      sheenColorFactor: [0.1, 0.2, 0.3],
      sheenRoughnessFactor: 0.4,
      sheenColorTexture: { index: 2 },
    },
    KHR_materials_specular: { specularFactor: 0.7, specularColorFactor: [1, 0.9, 2], specularTexture: moved(0) },
    KHR_materials_iridescence: {
      iridescenceFactor: 0.3,
      iridescenceIor: 1.7,
      iridescenceThicknessMinimum: 150,
      iridescenceThicknessMaximum: 300,
      iridescenceThicknessTexture: { index: 0 },
    },
    KHR_materials_anisotropy: { anisotropyStrength: 0.6, anisotropyRotation: 0.2, anisotropyTexture: { index: 0 } },
    KHR_materials_transmission: { transmissionFactor: 0.2, transmissionTexture: { index: 0 } },
    VENDOR_glitter: { amount: 1 },
  },
};
const glass = {
  name: 'glass',
  pbrMetallicRoughness: { baseColorFactor: [0.9, 1, 1, 0.5] },
  alphaMode: 'BLEND',
  extensions: {
    KHR_materials_transmission: { transmissionFactor: 0.9 },
    KHR_materials_volume: {
      thicknessFactor: 0.5,
      attenuationDistance: 2,
      attenuationColor: [0.2, 0.9, 0.4],
      thicknessTexture: { index: 0 },
    },
    KHR_materials_dispersion: { dispersion: 0.3 },
  },
};
const flat = { name: 'flat', extensions: { KHR_materials_unlit: {} } };

/** The round cube with these materials, which its faces share. */
function dressed(materials, { uv1, bumps = bumpy(0.8, 0.8) } = {}) {
  const cube = roundCube();
  const third = Math.ceil(cube.triangles.length / materials.length);
  const parts = materials.map((_, i) => cube.triangles.slice(i * third, (i + 1) * third));
  return writeGlb({
    ...cube,
    uv1: uv1 && cube.uv,
    image: color,
    edit(gltf, push) {
      const image = (bytes) => ({ bufferView: push(bytes), mimeType: 'image/png' });
      gltf.images.push(image(bumps));
      gltf.textures.push({ source: 1, sampler: 0 }, { source: 0, sampler: 1 });
      gltf.samplers.push({ wrapS: 33071, wrapT: 33648, magFilter: 9728 });
      gltf.materials = materials;
      gltf.extensionsUsed = [
        'KHR_texture_transform',
        ...new Set(materials.flatMap((m) => Object.keys(m.extensions ?? {}))),
      ];
      const [primitive] = gltf.meshes[0].primitives;
      gltf.meshes[0].primitives = parts.map((triangles, material) => {
        const corners = triangles.flat();
        const bufferView = push(Buffer.from(new Uint16Array(corners).buffer));
        const accessor = { bufferView, componentType: 5123, count: corners.length, type: 'SCALAR' };
        return { ...primitive, indices: gltf.accessors.push(accessor) - 1, material };
      });
    },
  });
}

/** The asset and report of the file, and of a bean as second shape. */
async function merged(t, glb, more = {}) {
  const d = await daemon(t);
  const bean = Buffer.from(shapes.obj(shapes.bean(2)));
  const upload = async (name, body) => ({
    mesh: (await d.request('POST', `/v1/meshes?name=${name}`, { body })).json.id,
  });
  const body = {
    shapes: [await upload('file', glb), await upload('bean', bean)],
    align: { method: 'rotate' },
    ...more,
  };
  const made = await d.request('POST', '/v1/supermeshes', { body, headers: { prefer: 'wait=60' } });
  assert.equal(made.status, 200, made.bytes.toString());
  return { d, report: made.json, asset: (await d.get(made.json.asset)).bytes };
}

async function materialsOf(bytes) {
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
  const { scene } = await new GLTFLoader().parseAsync(buffer, '');
  const found = new Map();
  scene.traverse((o) => o.isMesh && found.set(o.material.name, o.material));
  return found;
}

/** The members of a material in three.js, except for numbers that it gives to each object. */
function parameters(material) {
  const out = {};
  for (const [key, value] of Object.entries(material)) {
    if (value?.isTexture) {
      out[key] = {
        ...Object.fromEntries(
          ['channel', 'wrapS', 'wrapT', 'magFilter', 'minFilter', 'rotation'].map((k) => [k, value[k]]),
        ),
        offset: value.offset.toArray(),
        repeat: value.repeat.toArray(),
        colorSpace: value.colorSpace,
      };
    } else if (value?.isColor || value?.isVector2) {
      // The loader turns y where it has no tangents (three.js issue 11438).
      out[key] = value.toArray().map((x) => (/ormalScale/.test(key) ? Math.abs(x) : x));
    } else if (
      typeof value !== 'object' &&
      typeof value !== 'function' &&
      !/^(uuid|id|version|_listeners)$/.test(key)
    ) {
      out[key] = value;
    }
  }
  return out;
}

const near = (a, b, what) => {
  if (typeof a === 'number' && typeof b === 'number') {
    assert.ok(a === b || Math.abs(a - b) <= 1e-6 * Math.max(1, Math.abs(a)), `${what}: ${a} ${b}`);
  } else if (a && typeof a === 'object') {
    assert.deepEqual(Object.keys(b ?? {}).sort(), Object.keys(a).sort(), what);
    for (const key of Object.keys(a)) near(a[key], b[key], `${what}.${key}`);
  } else {
    assert.equal(b, a, what);
  }
};

test('three.js finds the same materials in the asset as in the file; the validator has no complaint', async (t) => {
  const glb = dressed([rich, glass, flat], { uv1: true });
  const { d, report, asset } = await merged(t, glb);
  const checked = await validator.validateBytes(new Uint8Array(asset), { maxIssues: 100 });
  assert.deepEqual(
    checked.issues.messages.filter((m) => m.severity < 2),
    [],
  );
  const [before, after] = [await materialsOf(glb), await materialsOf(asset)];
  assert.deepEqual([...after.keys()].sort(), ['flat', 'glass', 'rich']);
  for (const [name, material] of before) near(parameters(material), parameters(after.get(name)), name);
  assert.ok(after.get('rich').normalMap && after.get('rich').map.repeat.x === 3);

  assert.deepEqual(
    report.dropped.map(({ what, where }) => [what, where]),
    [
      ['VENDOR_glitter', 'materials[0] "rich"'],
      ['TEXCOORD_1', ''],
    ],
  );
  const place = await folder(t);
  const files = ['file.glb', 'bean.obj', 'out.glb', 'report.md'].map((name) => path.join(place, name));
  fs.writeFileSync(files[0], glb);
  fs.writeFileSync(files[1], shapes.obj(shapes.bean(2)));
  const words = [
    '--server',
    d.url,
    'morph',
    files[0],
    files[1],
    '--align',
    'rotate',
    '-o',
    files[2],
    '--report',
    files[3],
  ];
  const ran = await run(words);
  assert.equal(ran.code, 0, ran.err);
  assert.match(ran.out, /not in the asset: 2 parts of the files/);
  const text = fs.readFileSync(files[3], 'utf8');
  assert.match(text, /## Not in the asset\n\n\| what .*\n.*\n\| VENDOR\\_glitter \| materials\\\[0\\\] "rich" \| \S/);
});

test('an asset without normals omits normal maps, and says so', async (t) => {
  const { report, asset } = await merged(t, dressed([{ name: 'bumpy', normalTexture: { index: 1 } }]), {
    asset: { normals: false },
  });
  const checked = await validator.validateBytes(new Uint8Array(asset));
  assert.equal(checked.issues.numErrors + checked.issues.numWarnings, 0);
  assert.deepEqual(
    report.dropped.map((entry) => entry.what),
    ['normalTexture'],
  );
});

const page = `<!doctype html><title>materials</title>
<script type="importmap">{"imports":{"three":"/npm/three/build/three.module.js","three/addons/":"/npm/three/examples/jsm/"}}</script>
<script type="module">
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
const SIZE = 192;
const renderer = new THREE.WebGLRenderer({ preserveDrawingBuffer: true });
renderer.setSize(SIZE, SIZE);
window.draw = async (name) => {
  const { scene } = await new GLTFLoader().loadAsync("/file/" + name);
  const camera = new THREE.PerspectiveCamera(30, 1, 0.1, 20);
  camera.position.set(2, 2.5, 4);
  camera.lookAt(0, 0, 0);
  scene.add(new THREE.AmbientLight(0xffffff, 0.4));
  const sun = new THREE.DirectionalLight(0xffffff, 3);
  sun.position.set(3, 1, 2);
  scene.add(sun);
  renderer.render(scene, camera);
  const url = renderer.domElement.toDataURL();
  const gl = renderer.getContext(), out = new Uint8Array(4 * SIZE * SIZE);
  gl.readPixels(0, 0, SIZE, SIZE, gl.RGBA, gl.UNSIGNED_BYTE, out);
  return { url, pixels: [...out] };
};
window.ready = true;
</script>`;

test('the asset looks like the file, with its bumps and its transform', async (t) => {
  const material = {
    normalTexture: moved(1),
    pbrMetallicRoughness: { baseColorTexture: moved(0), metallicFactor: 0, roughnessFactor: 0.6 },
  };
  const straight = { pbrMetallicRoughness: { ...material.pbrMetallicRoughness, baseColorTexture: { index: 0 } } };
  const glb = dressed([material]);
  const { asset } = await merged(t, glb, { remesh: { method: 'overlay' } });
  const files = {
    'file.glb': glb,
    'asset.glb': asset,
    'smooth.glb': dressed([{ pbrMetallicRoughness: material.pbrMetallicRoughness }]),
    'straight.glb': dressed([{ ...straight, normalTexture: moved(1) }]),
    'left.glb': dressed([material], { bumps: bumpy(-0.8, 0.8) }),
    'down.glb': dressed([material], { bumps: bumpy(0.8, -0.8) }),
  };
  const server = http.createServer((request, response) => {
    const at = new URL(request.url, 'http://x').pathname;
    if (at === '/') return response.writeHead(200, { 'content-type': 'text/html' }).end(page);
    if (at.startsWith('/file/')) return response.writeHead(200).end(files[at.slice(6)]);
    const file = path.join(modules, at.slice(5));
    if (!at.startsWith('/npm/') || !fs.existsSync(file)) return response.writeHead(404).end();
    response.writeHead(200, { 'content-type': 'text/javascript' });
    fs.createReadStream(file).pipe(response);
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  const args = ['--no-sandbox', ...softwareGl];
  const browser = await chromium.launch({ timeout: 180_000, executablePath, args });
  t.after(async () => {
    await browser.close();
    server.close();
  });
  const tab = await browser.newPage();
  await tab.goto(`http://127.0.0.1:${server.address().port}/`);
  await tab.waitForFunction(() => window.ready, null, { timeout: 120_000 });
  const drawn = {};
  for (const name of Object.keys(files)) {
    drawn[name] = await tab.evaluate((file) => window.draw(file), name);
    const keep = process.env.ORB_TEST_PICTURES;
    if (keep) fs.writeFileSync(path.join(keep, `${name}.png`), Buffer.from(drawn[name].url.split(',')[1], 'base64'));
  }
  const apart = (a, b) => {
    let sum = 0;
    drawn[a].pixels.forEach((value, i) => (sum += Math.abs(value - drawn[b].pixels[i])));
    return sum / drawn[a].pixels.length;
  };
  const [same, ...others] = ['asset', 'smooth', 'straight', 'left', 'down'].map((name) =>
    apart('file.glb', `${name}.glb`),
  );
  t.diagnostic(`mean differences from the file: ${[same, ...others].map((x) => x.toFixed(2)).join(', ')}`);
  // The asset has one tangent per vertex; three.js computes one per pixel if the file has none.
  assert.ok(same < 0.4 * Math.min(...others), `${same} of ${others}`);
});
