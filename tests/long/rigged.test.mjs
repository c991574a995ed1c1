// A rigged character that came as a GLB and got two more shape keys, in three.js, Babylon.js and Blender: the joints bend
// the new targets as they bend the old one. Every program is asked where it puts the vertices of four poses.
// ORB_SHOTS names a folder that keeps the pictures of all, on one sheet.
import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import { mkdtemp, mkdir, readFile, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { after, before, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { need, npmFile, serve, startBrowser } from '../conformance/pages.mjs';
import { rigged } from '../samples/rigged.mjs';
import { daemon } from '../scenario/support/daemon.mjs';
import { parseGlb } from '../scenario/support/glb.mjs';
import * as shapes from '../scenario/support/shapes.mjs';
import { sheet } from './sheet.mjs';

need('three', 'babylonjs', 'babylonjs-loaders');

const OFF = 2e-5; // of a figure two units tall: programs compute in 32 bits
const JOINT = 9; // the joint that the animation "wave" rotates: after half a second by 0.6 around z
const ANGLE = 0.6;
const AT = (JOINT * 2) / 19;

const pear = shapes.ball(4, ([x, y, z]) => [x * (0.7 - 0.4 * y), 1 + y, z * (0.6 - 0.35 * y)]);
const flat = shapes.ball(4, ([x, y, z]) => [1.2 * x, 1 + y * (1 - 0.4 * x * x), 0.25 * z]);

const poses = [
  ['at rest', 0, [0, 0, 0]],
  ['a new target', 0, [0, 1, 0]],
  ['bent', 0.5, [0, 0, 0]],
  ['bent, the old target and half of both new ones', 0.5, [1, 0.5, 0.5]],
  ['bent, a new target', 0.5, [0, 1, 0]],
].map(([name, time, weights]) => ({ name, time, weights }));

/**
 * The places of the vertices of a pose by the glTF specification: targets, then joints. Those below JOINT stay, the
 * others rotate.
 */
function expected(asset, { time, weights }) {
  const { gltf, read } = parseGlb(asset);
  return gltf.meshes[1].primitives.flatMap(({ attributes, targets }) => {
    const [base, joints, shares] = ['POSITION', 'JOINTS_0', 'WEIGHTS_0'].map((name) => read(attributes[name]));
    const moves = targets.map((target) => read(target.POSITION));
    return Array.from({ length: base.length / 3 }, (_, v) => {
      const p = [0, 1, 2].map((k) => moves.reduce((sum, m, i) => sum + weights[i] * m[3 * v + k], base[3 * v + k]));
      let turned = 0;
      for (let k = 0; k < 4; k++) if (time > 0 && joints[4 * v + k] >= JOINT) turned += shares[4 * v + k];
      const [x, y] = [p[0], p[1] - AT];
      const q = [x * Math.cos(ANGLE) - y * Math.sin(ANGLE), x * Math.sin(ANGLE) + y * Math.cos(ANGLE) + AT, p[2]];
      return p.map((c, k) => c + turned * (q[k] - c));
    });
  });
}

/** Which of these vertices a triangle uses: Blender drops the others. */
function used(asset) {
  const { gltf, read } = parseGlb(asset);
  return gltf.meshes[1].primitives.flatMap(({ attributes, indices }) => {
    const all = Array.from({ length: gltf.accessors[attributes.POSITION].count }, () => false);
    for (const v of read(indices)) all[v] = true;
    return all;
  });
}

const PAGE = `<!doctype html><title>rigged</title>
<script type="importmap">{"imports":{"three":"/npm/three/build/three.module.js","three/addons/":"/npm/three/examples/jsm/"}}</script>
<script src="/npm/babylonjs/babylon.js"></script>
<script src="/npm/babylonjs-loaders/babylon.glTF2FileLoader.min.js"></script>
<script type="module">
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
const SIZE = 300, EYE = [2, 2, 6], MIDDLE = [0, 1, 0], HALF = 1.5;
const picture = (canvas) => canvas.toDataURL("image/png").split(",")[1];

window.three = async ({ time, weights }) => {
  const gltf = await new GLTFLoader().loadAsync("/rigged.glb");
  const mixer = new THREE.AnimationMixer(gltf.scene);
  mixer.clipAction(gltf.animations.find((a) => a.name === "wave")).play();
  mixer.setTime(time);
  const points = [];
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0xffffff);
  const sun = new THREE.DirectionalLight(0xffffff, 3);
  sun.position.set(3, 4, 5);
  scene.add(gltf.scene, sun, new THREE.AmbientLight(0xffffff, 1));
  gltf.scene.traverse((o) => o.isSkinnedMesh && weights.forEach((w, k) => (o.morphTargetInfluences[k] = w)));
  scene.updateMatrixWorld(true);
  gltf.scene.traverse((body) => {
    for (let v = 0; body.isSkinnedMesh && v < body.geometry.attributes.position.count; v++)
      points.push(body.getVertexPosition(v, new THREE.Vector3()).applyMatrix4(body.matrixWorld).toArray());
  });
  const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  renderer.setSize(SIZE, SIZE);
  const camera = new THREE.OrthographicCamera(-HALF, HALF, HALF, -HALF, 0.1, 60);
  camera.position.set(...EYE);
  camera.lookAt(...MIDDLE);
  renderer.render(scene, camera);
  const png = picture(renderer.domElement);
  renderer.dispose();
  renderer.forceContextLoss();
  return { points, png };
};

window.babylon = async ({ time, weights }) => {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = SIZE;
  const engine = new BABYLON.Engine(canvas, true, { preserveDrawingBuffer: true });
  const scene = new BABYLON.Scene(engine);
  scene.useRightHandedSystem = true;
  scene.clearColor = new BABYLON.Color4(1, 1, 1, 1);
  await BABYLON.SceneLoader.AppendAsync("/", "rigged.glb", scene);
  scene.animationGroups.forEach((group) => group.stop());
  const wave = scene.animationGroups.find((group) => group.name === "wave");
  wave.start(false);
  wave.pause();
  wave.goToFrame(wave.from + time * (wave.to - wave.from));
  new BABYLON.HemisphericLight("sun", new BABYLON.Vector3(3, 4, 5), scene);
  const camera = new BABYLON.FreeCamera("eye", new BABYLON.Vector3(...EYE), scene);
  camera.mode = BABYLON.Camera.ORTHOGRAPHIC_CAMERA;
  Object.assign(camera, { orthoLeft: -HALF, orthoRight: HALF, orthoTop: HALF, orthoBottom: -HALF, minZ: 0.1, maxZ: 60 });
  camera.setTarget(new BABYLON.Vector3(...MIDDLE));
  scene.activeCamera = camera;
  const bodies = scene.meshes.filter((mesh) => mesh.skeleton);
  for (const body of bodies)
    weights.forEach((w, k) => (body.morphTargetManager.getTarget(k).influence = w));
  await scene.whenReadyAsync();
  scene.render();
  const points = bodies.flatMap((body) => {
    const flat = body.getPositionData(true, true);
    return Array.from({ length: flat.length / 3 }, (_, v) => [...flat.slice(3 * v, 3 * v + 3)]);
  });
  const png = picture(canvas);
  engine.dispose();
  return { points, png };
};
window.ready = true;
</script>`;

const shots = { 'three.js': [], 'Babylon.js': [], Blender: [] };
let folder;
let asset;
let browser;
let server;
before(async () => {
  folder = await mkdtemp(path.join(tmpdir(), 'orbmorph-rigged-'));
  const ends = [];
  const d = await daemon({ after: (end) => ends.push(end) });
  const list = [{ mesh: (await d.upload(rigged().bytes, { name: 'body', repair: 'largest_component' })).json.id }];
  for (const [name, body] of Object.entries({ pear, flat }))
    list.push({ mesh: (await d.upload(shapes.obj(body), { name })).json.id });
  const made = await d.made('/v1/supermeshes', {
    shapes: list,
    align: { method: 'rotate' },
    remesh: { method: 'template' },
    asset: { fit: 'none' },
  });
  asset = (await d.get(made.asset)).bytes;
  for (const end of ends) await end();
  await writeFile(path.join(folder, 'rigged.glb'), asset);
  server = await serve((at) => {
    if (at.startsWith('/npm/')) return npmFile(at.slice(5));
    return at === '/rigged.glb' ? path.join(folder, 'rigged.glb') : { html: PAGE };
  });
  browser = await startBrowser();
});

after(async () => {
  if (process.env.ORB_SHOTS && browser) {
    await mkdir(process.env.ORB_SHOTS, { recursive: true });
    const rows = Object.entries(shots).map(([title, pictures]) => ({ title, pictures }));
    await writeFile(
      path.join(process.env.ORB_SHOTS, 'rigged.png'),
      await sheet(browser, rows, { width: 180, height: 180, across: 1 }),
    );
  }
  await browser?.close();
  server?.close();
  await rm(folder, { recursive: true, force: true });
});

/** Asserts that the points are where they should be, in their order. */
function assertThere(points, wanted, what) {
  assert.equal(points.length, wanted.length, what);
  const off = Math.max(...wanted.map((p, v) => Math.hypot(...p.map((x, k) => x - points[v][k]))));
  assert.ok(off < OFF, `${what}: a vertex is off by ${off}`);
}

test('the poses differ by far more than the tolerance', () => {
  const all = poses.map((pose) => expected(asset, pose));
  for (const [i, a] of all.entries())
    for (const b of all.slice(0, i))
      assert.ok(Math.max(...a.map((p, v) => Math.hypot(...p.map((x, k) => x - b[v][k])))) > 0.1);
});

for (const [program, how] of [
  ['three.js', 'three'],
  ['Babylon.js', 'babylon'],
])
  test(program, async () => {
    const page = await browser.newPage();
    const faults = [];
    page.on('pageerror', (error) => faults.push(String(error)));
    await page.goto(`http://127.0.0.1:${server.port}/`);
    await page.waitForFunction(() => window.ready, null, { timeout: 180_000 });
    for (const pose of poses) {
      const { points, png } = await page.evaluate(([name, one]) => window[name](one), [how, pose]);
      shots[program].push(png);
      assertThere(points, expected(asset, pose), pose.name);
    }
    assert.deepEqual(faults, []);
    await page.close();
  });

const blender = spawnSync('blender', ['--version']).status === 0;
test('Blender', { skip: blender ? false : 'no blender' }, async () => {
  const shown = used(asset);
  const facts = poses.map((pose) => ({ ...pose, points: expected(asset, pose).filter((_, v) => shown[v]) }));
  await writeFile(path.join(folder, 'poses.json'), JSON.stringify(facts));
  const script = fileURLToPath(new URL('rigged.py', import.meta.url));
  const out = execFileSync('blender', ['-b', '--python-exit-code', '1', '--python', script, '--', folder], {
    encoding: 'utf8',
  });
  for (const i of poses.keys()) {
    assert.match(out, new RegExp(`pose ${i}: \\d+ vertices within`));
    shots.Blender.push((await readFile(path.join(folder, `${i}.png`))).toString('base64'));
  }
});
