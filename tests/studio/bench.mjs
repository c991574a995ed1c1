// How fluent the studio is with large shapes, beside a bare three.js page that shows the same GLB in the same browser:
//   node tests/studio/bench.mjs [LEVEL]      20·4^LEVEL triangles a shape; 7 (327,680) unless told
// Prints one JSON object: median frames while scrubbing (ms), their ratio, and the longest tasks of the main thread
// while two shapes are added, the morph is opened, scrubbed and turned. The daemon's answers are made here, so that
// only the page is measured; the page itself is client/web/dist.
import { createServer } from 'node:http';
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { extname, join } from 'node:path';
import { root, startBrowser, until } from './support.mjs';

const level = Number(process.argv[2] ?? 7);

function icosphere(steps) {
  const t = (1 + Math.sqrt(5)) / 2;
  let points = [[-1, t, 0], [1, t, 0], [-1, -t, 0], [1, -t, 0], [0, -1, t], [0, 1, t], [0, -1, -t], [0, 1, -t], [t, 0, -1], [t, 0, 1], [-t, 0, -1], [-t, 0, 1]];
  const unit = (p) => {
    const l = Math.hypot(...p);
    return p.map((x) => x / l);
  };
  points = points.map(unit);
  let faces = [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8],
    [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1]];
  for (let step = 0; step < steps; step++) {
    const middles = new Map();
    const middle = (a, b) => {
      const key = Math.min(a, b) * 2 ** 26 + Math.max(a, b);
      if (!middles.has(key)) middles.set(key, points.push(unit(points[a].map((x, k) => x + points[b][k]))) - 1);
      return middles.get(key);
    };
    faces = faces.flatMap(([a, b, c]) => {
      const [x, y, z] = [middle(a, b), middle(b, c), middle(c, a)];
      return [[a, x, z], [x, b, y], [z, y, c], [x, y, z]];
    });
  }
  return { points, faces };
}

const sphere = icosphere(level);
const radius = [(p) => 1 + 0.35 * Math.sin(5 * p[0]) * Math.cos(4 * p[1]), (p) => 1 + 0.5 * Math.max(0, p[1]) ** 4 + 0.3 * Math.cos(6 * p[2])];

function obj(r) {
  return Buffer.from(sphere.points.map((p) => `v ${p.map((x) => (x * r(p)).toFixed(6)).join(' ')}\n`).join('') + sphere.faces.map((f) => `f ${f.map((v) => v + 1).join(' ')}\n`).join(''));
}

function glb() {
  const places = radius.map((r) => Float32Array.from(sphere.points.flatMap((p) => p.map((x) => x * r(p)))));
  const normals = places.map((p) => {
    const n = new Float32Array(p.length);
    for (const [a, b, c] of sphere.faces) {
      const u = [0, 1, 2].map((k) => p[3 * b + k] - p[3 * a + k]);
      const v = [0, 1, 2].map((k) => p[3 * c + k] - p[3 * a + k]);
      const m = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      for (const q of [a, b, c]) for (let k = 0; k < 3; k++) n[3 * q + k] += m[k];
    }
    for (let i = 0; i < n.length; i += 3) {
      const l = Math.hypot(n[i], n[i + 1], n[i + 2]);
      for (let k = 0; k < 3; k++) n[i + k] /= l;
    }
    return n;
  });
  const bufferViews = [];
  const accessors = [];
  const pieces = [];
  let size = 0;
  const add = (array, type, componentType) => {
    const piece = Buffer.from(array.buffer);
    bufferViews.push({ buffer: 0, byteOffset: size, byteLength: piece.length });
    const width = type === 'VEC3' ? 3 : 1;
    accessors.push({ bufferView: bufferViews.length - 1, componentType, count: array.length / width, type, ...(width === 3 && { min: [-2, -2, -2], max: [2, 2, 2] }) });
    pieces.push(piece);
    size += piece.length;
    return accessors.length - 1;
  };
  const minus = (a, b) => a.map((x, i) => x - b[i]);
  const attributes = { POSITION: add(places[0], 'VEC3', 5126), NORMAL: add(normals[0], 'VEC3', 5126) };
  const indices = add(Uint32Array.from(sphere.faces.flat()), 'SCALAR', 5125);
  const targets = [{ POSITION: add(minus(places[1], places[0]), 'VEC3', 5126), NORMAL: add(minus(normals[1], normals[0]), 'VEC3', 5126) }];
  let json = JSON.stringify({
    asset: { version: '2.0' }, scene: 0, scenes: [{ nodes: [0] }], nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes, indices, targets }], weights: [0], extras: { targetNames: ['b'] } }], accessors, bufferViews, buffers: [{ byteLength: size }],
  });
  json += ' '.repeat((4 - (json.length % 4)) % 4);
  const head = Buffer.alloc(20);
  [0x46546c67, 2, 28 + json.length + size, json.length, 0x4e4f534a].forEach((x, i) => head.writeUInt32LE(x, 4 * i));
  const second = Buffer.alloc(8);
  second.writeUInt32LE(size, 0);
  second.writeUInt32LE(0x4e4942, 4);
  return Buffer.concat([head, Buffer.from(json), second, ...pieces]);
}

const BARE = `<!doctype html><style>html,body{margin:0}</style>
<script type="importmap">{"imports":{"three":"/three/build/three.module.js","three/addons/":"/three/examples/jsm/"}}</script>
<script type="module">
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
const renderer = new THREE.WebGLRenderer({ antialias: true });
const [width, height] = location.search.slice(1).split('x').map(Number);
renderer.setSize(width, height);
document.body.append(renderer.domElement);
const scene = new THREE.Scene();
scene.add(new THREE.HemisphereLight(0xffffff, 0x888888, 3));
const camera = new THREE.PerspectiveCamera(32, width / height, 0.1, 100);
camera.position.set(3, 1.2, 5);
camera.lookAt(0, 0, 0);
const gltf = await new GLTFLoader().loadAsync('/v1/supermeshes/${'e'.repeat(64)}/asset.glb');
scene.add(gltf.scene);
let mesh;
gltf.scene.traverse((object) => { if (object.morphTargetInfluences) mesh = object; });
globalThis.scrub = (value) => { mesh.morphTargetInfluences[0] = value; renderer.render(scene, camera); };
scrub(0);
globalThis.ready = true;
</script>`;

const asset = glb();
const meshes = radius.map((r, i) => ({ id: String(i).repeat(64), file: obj(r) }));
const supermesh = {
  id: 'e'.repeat(64), url: `/v1/supermeshes/${'e'.repeat(64)}`, asset: `/v1/supermeshes/${'e'.repeat(64)}/asset.glb`, vertices: sphere.points.length,
  triangles: sphere.faces.length, shapes: meshes.map((m, i) => ({ mesh: m.id, name: `shape${i}`, hausdorff_relative: 0, rms_relative: 0 })), landmarks: [],
  certificate: { closed: true, genus: 0, flipped: [0, 0], degree: [1, 1] }, timings_ms: { total: 1 }, engine: 'bench',
};
const describe = (m, i) => ({ id: m.id, url: `/v1/meshes/${m.id}`, name: `shape${i}`, format: 'obj', vertices: sphere.points.length, triangles: sphere.faces.length, repairs: [] });
const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.css': 'text/css', '.svg': 'image/svg+xml' };
const folder = mkdtempSync(join(tmpdir(), 'orbmorph-bench-'));
let uploads = 0;
const server = createServer((req, res) => {
  const path = new URL(req.url, 'http://x').pathname;
  const json = (value) => res.writeHead(200, { 'Content-Type': 'application/json' }).end(JSON.stringify(value));
  if (req.method === 'POST') {
    req.resume().on('end', () => json(path === '/v1/meshes' ? describe(meshes[uploads % 2], uploads++ % 2) : supermesh));
  } else if (path.endsWith('/asset.glb')) res.writeHead(200, { 'Content-Type': 'model/gltf-binary' }).end(asset);
  else if (path.startsWith('/v1/supermeshes/')) json(supermesh);
  else if (path === '/bare') res.writeHead(200, { 'Content-Type': 'text/html' }).end(BARE);
  else {
    const file = path.startsWith('/three/') ? join(root, 'client/web/node_modules/three', path.slice(7)) : join(root, 'client/web/dist', path === '/' ? 'index.html' : path);
    if (existsSync(file)) res.writeHead(200, { 'Content-Type': TYPES[extname(file)] ?? 'application/octet-stream' }).end(readFileSync(file));
    else res.writeHead(404).end();
  }
});
await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
const url = `http://127.0.0.1:${server.address().port}`;
const browser = await startBrowser();

/** Runs `step(value)` in every frame and gives the median time between frames. */
const frames = (page, step) => page.evaluate(async (source) => {
  const step = new Function('value', source);
  const times = [];
  let last = 0;
  await new Promise((resolve) => {
    let n = 0;
    const tick = (now) => {
      if (n > 5) times.push(now - last);
      last = now;
      step(0.5 - 0.5 * Math.cos(n / 9));
      if (n++ < 30) requestAnimationFrame(tick);
      else resolve();
    };
    requestAnimationFrame(tick);
  });
  return times.sort((a, b) => a - b)[times.length >> 1];
}, step);

try {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 } });
  const page = await context.newPage();
  await context.addInitScript(() => {
    globalThis.longTasks = [];
    new PerformanceObserver((list) => globalThis.longTasks.push(...list.getEntries().map((e) => Math.round(e.duration)))).observe({ type: 'longtask', buffered: true });
  });
  const tasks = async (of = page) => of.evaluate(() => globalThis.longTasks.splice(0).sort((a, b) => b - a).slice(0, 5));
  await page.goto(url);
  const longest = { start: await tasks() };
  await page.locator('input[type=file]').first().setInputFiles(meshes.map((m, i) => {
    writeFileSync(join(folder, `shape${i}.obj`), m.file);
    return join(folder, `shape${i}.obj`);
  }));
  await until(() => page.locator('.card.ready .facts.good').count().then((n) => n === 2), 'both uploaded');
  await until(() => page.locator('.caption .muted', { hasText: 'triangles' }).count().then((n) => n === 2), 'both drawn');
  await page.waitForTimeout(1500);
  longest.open = await tasks();
  await page.getByRole('button', { name: /^Morph 2/ }).click();
  await until(() => page.getByRole('button', { name: 'Pause' }).count(), 'plays');
  await page.getByRole('button', { name: 'Pause' }).click();
  await page.waitForTimeout(1500);
  longest.morph = await tasks();
  const scrub = "const i = document.querySelector('.scrub input'); i.value = value; i.dispatchEvent(new Event('input', { bubbles: true }));";
  const box = await page.locator('.pane').boundingBox();
  const bare = await context.newPage();
  await bare.goto(`${url}/bare?${Math.round(box.width)}x${Math.round(box.height)}`);
  await until(() => bare.evaluate(() => globalThis.ready), 'the bare page is ready');
  const studio = [];
  const plain = [];
  for (let round = 0; round < 3; round++) {
    await page.bringToFront();
    studio.push(await frames(page, scrub));
    await bare.bringToFront();
    plain.push(await frames(bare, 'scrub(value)'));
  }
  longest.scrub = await tasks();
  longest.bare_page = await tasks(bare);
  await page.bringToFront();
  await page.locator('.pane-view').first().focus();
  for (let i = 0; i < 10; i++) await page.keyboard.press('ArrowLeft');
  await page.getByRole('switch', { name: 'Wireframe' }).click();
  await page.waitForTimeout(2500);
  longest.turn_and_wireframe = await tasks();
  const middle = (list) => list.sort((a, b) => a - b)[list.length >> 1];
  console.log(JSON.stringify({ triangles: sphere.faces.length, studio_ms: middle(studio), bare_ms: middle(plain), ratio: middle(studio) / middle(plain), long_tasks_ms: longest }, null, 1));
} finally {
  await browser.close();
  server.close();
  rmSync(folder, { recursive: true });
  server.closeAllConnections();
}
