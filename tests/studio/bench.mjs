// Measures the studio with large shapes, and a bare three.js page that shows the same GLB in the same browser:
//   node tests/studio/bench.mjs [TRIANGLES] [--software-compositing]
// TRIANGLES of a shape: 100,000 by default; the next number 20·n² is taken (100,820). Prints one JSON object: the median
// frame times (ms) of both pages while scrubbing, the ratio of each round and their median, and for each step the long
// tasks of the main thread with their CPU time (see bench/tasks.mjs). The ratio of the means as well, since a page may
// miss animation frames. A stub replaces the daemon, so that only the page (client/web/dist) is measured.
// docs/bench-studio.md has the results.
import { createServer } from 'node:http';
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { extname, join } from 'node:path';
import { glb, icosphere, objFiles } from './bench/shapes.mjs';
import { traced } from './bench/tasks.mjs';
import { wholeBrowser } from '../tools/chromium.mjs';
import { counted, root, startBrowser, until } from './support.mjs';

const wanted = Number(process.argv.slice(2).find((a) => /^\d+$/.test(a)) ?? 100_000);
const compositing = process.argv.includes('--software-compositing') ? 'software' : 'gpu';

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

const sphere = icosphere(Math.ceil(Math.sqrt(wanted / 20)));
const vertices = sphere.points.length / 3;
const triangles = sphere.faces.length / 3;
const asset = glb(sphere);
const meshes = objFiles(sphere).map((file, i) => ({ id: String(i).repeat(64), file }));
const supermesh = {
  id: 'e'.repeat(64),
  url: `/v1/supermeshes/${'e'.repeat(64)}`,
  asset: `/v1/supermeshes/${'e'.repeat(64)}/asset.glb`,
  vertices,
  triangles,
  shapes: meshes.map((m, i) => ({ mesh: m.id, name: `shape${i}`, hausdorff_relative: 0, rms_relative: 0 })),
  landmarks: [],
  certificate: { closed: true, genus: 0, flipped: [0, 0], degree: [1, 1] },
  timings_ms: { total: 1 },
  engine: 'bench',
};
const describe = (m, i) => ({
  id: m.id,
  url: `/v1/meshes/${m.id}`,
  name: `shape${i}`,
  format: 'obj',
  vertices,
  triangles,
  repairs: [],
});
const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.css': 'text/css', '.svg': 'image/svg+xml' };
const folder = mkdtempSync(join(tmpdir(), 'orbmorph-bench-'));
let uploads = 0;
const server = createServer((req, res) => {
  const path = new URL(req.url, 'http://x').pathname;
  const json = (value) => res.writeHead(200, { 'Content-Type': 'application/json' }).end(JSON.stringify(value));
  if (req.method === 'POST') {
    req
      .resume()
      .on('end', () => json(path === '/v1/meshes' ? describe(meshes[uploads % 2], uploads++ % 2) : supermesh));
  } else if (path.endsWith('/asset.glb')) res.writeHead(200, { 'Content-Type': 'model/gltf-binary' }).end(asset);
  else if (path.startsWith('/v1/supermeshes/')) json(supermesh);
  else if (path === '/bare') res.writeHead(200, { 'Content-Type': 'text/html' }).end(BARE);
  else {
    const file = path.startsWith('/three/')
      ? join(root, 'client/web/node_modules/three', path.slice(7))
      : join(root, 'client/web/dist', path === '/' ? 'index.html' : path);
    if (existsSync(file))
      res
        .writeHead(200, { 'Content-Type': TYPES[extname(file)] ?? 'application/octet-stream' })
        .end(readFileSync(file));
    else res.writeHead(404).end();
  }
});
await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
const url = `http://127.0.0.1:${server.address().port}`;
const browser = await startBrowser({ compositing, program: wholeBrowser });

/**
 * Sets a new value as soon as the last one is drawn, 22 times. Returns the times between drawings. The studio
 * draws in a worker and dispatches an event after each drawing; the bare page draws in its animation frames.
 */
const frames = (page, step) =>
  page.evaluate(async (source) => {
    const step = new Function('value', source);
    const stage = document.querySelector('.stage');
    const next = (done) =>
      stage
        ? stage.addEventListener('drawn', () => done(performance.now()), { once: true })
        : requestAnimationFrame(done);
    const times = [];
    let last = 0;
    await new Promise((resolve) => {
      let n = 0;
      const tick = (now) => {
        if (n > 5) times.push(now - last);
        last = now;
        if (n++ > 20) return resolve();
        next(tick);
        step(0.5 - 0.5 * Math.cos(n / 9));
      };
      tick(0);
    });
    return times;
  }, step);
const SCRUB =
  "const i = document.querySelector('.scrub input'); i.value = value; i.dispatchEvent(new Event('input', { bubbles: true }));";
const middle = (list) => list.toSorted((a, b) => a - b)[list.length >> 1];
const mean = (list) => list.reduce((sum, x) => sum + x, 0) / list.length;
const ROUNDS = 7; // of both pages alternately, so that other load of the machine affects both
const files = meshes.map((m, i) => {
  const path = join(folder, `shape${i}.obj`);
  writeFileSync(path, m.file);
  return path;
});

try {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 } });
  const page = await context.newPage();
  const bare = await context.newPage();
  const tasks = {};
  const step = async (name, of, body) => {
    await of.bringToFront();
    const { value, tasks: long } = await traced(browser, of, body);
    (tasks[name] ??= []).push(...long);
    return value;
  };
  await step('start', page, () => page.goto(url));
  await step('open two shapes', page, async () => {
    await page.locator('input[type=file]').first().setInputFiles(files);
    await counted(page.locator('.card.ready .facts.good'), 2, 'both uploaded');
    await counted(page.locator('.caption .muted', { hasText: 'triangles' }), 2, 'both drawn');
    await page.waitForTimeout(1500);
  });
  await step('pick', page, async () => {
    await page.getByRole('button', { name: 'Landmarks' }).click();
    const box = await page.locator('.pane-view').first().boundingBox();
    await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
    await page.locator('.marks li').first().waitFor();
  });
  await step('open the morph', page, async () => {
    await page.getByRole('button', { name: /^Morph 2/ }).click();
    await until(() => page.getByRole('button', { name: 'Pause' }).count(), 'plays');
    await until(() => page.getByText('Shown: the default morph.').count(), 'the default morph plays');
    await page.waitForTimeout(500);
    await page.getByRole('button', { name: 'Pause' }).click();
    await page.waitForTimeout(500);
  });
  const box = await page.locator('.pane').boundingBox();
  await step('bare: open', bare, async () => {
    await bare.goto(`${url}/bare?${Math.round(box.width)}x${Math.round(box.height)}`);
    await until(() => bare.evaluate(() => globalThis.ready), 'the bare page is ready');
  });
  const studio = [];
  const plain = [];
  for (let round = 0; round < ROUNDS; round++) {
    studio.push(await step('scrub', page, () => frames(page, SCRUB)));
    plain.push(await step('bare: scrub', bare, () => frames(bare, 'scrub(value)')));
  }
  const ratios = studio.map((times, i) => middle(times) / middle(plain[i]));
  await step('turn', page, async () => {
    await page.locator('.pane-view').first().focus();
    for (let i = 0; i < 10; i++) await page.keyboard.press('ArrowLeft');
  });
  await step('wireframe', page, async () => {
    await page.getByRole('switch', { name: 'Wireframe' }).click();
    await page.waitForTimeout(1500);
  });
  const longest = Object.fromEntries(
    Object.entries(tasks).map(([name, list]) => [name, list.sort((a, b) => b.ms - a.ms).slice(0, 4)]),
  );
  console.log(
    JSON.stringify(
      {
        triangles,
        compositing,
        studio_ms: middle(studio.map(middle)),
        bare_ms: middle(plain.map(middle)),
        ratio: middle(ratios),
        ratio_of_means: mean(studio.flat()) / mean(plain.flat()),
        ratios: ratios.map((ratio) => Number(ratio.toFixed(2))),
        long_tasks: longest,
      },
      null,
      1,
    ),
  );
} finally {
  await browser.close();
  server.close();
  rmSync(folder, { recursive: true });
  server.closeAllConnections();
}
