// Draws written assets with three.js and Babylon.js in headless Chromium and compares them with a direct drawing of
// the shapes in the facts: same camera, same shading (flat normals as colours in three.js; silhouettes in Babylon.js).
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, test } from 'node:test';
import { need, npmFile, serve, startBrowser } from './pages.mjs';

need('three', 'babylonjs', 'babylonjs-loaders');

const SIZE = 256;
const PAGE = `<!doctype html><title>asset</title>
<script type="importmap">{"imports":{"three":"/npm/three/build/three.module.js","three/addons/":"/npm/three/examples/jsm/"}}</script>
<script src="/npm/babylonjs/babylon.js"></script>
<script src="/npm/babylonjs-loaders/babylon.glTF2FileLoader.min.js"></script>
<script type="module">
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { MeshoptDecoder } from "three/addons/libs/meshopt_decoder.module.js";
BABYLON.MeshoptCompression.Configuration = { decoder: { url: "/decoder.js" } };
const HALF = 2.5, EYE = [6, 8, 20], SIZE = ${SIZE};

/** Encodes bytes as base64: an array of numbers takes seconds to leave the browser. */
function packed(bytes) {
  let text = "";
  for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
  return btoa(text);
}

function drawThree(root) {
  const renderer = new THREE.WebGLRenderer({ alpha: true, antialias: false, preserveDrawingBuffer: true });
  renderer.setSize(SIZE, SIZE);
  renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
  const camera = new THREE.OrthographicCamera(-HALF, HALF, HALF, -HALF, 1, 60);
  camera.position.set(...EYE);
  camera.lookAt(0, 0, 0);
  const scene = new THREE.Scene();
  scene.add(root);
  renderer.render(scene, camera);
  const gl = renderer.getContext(), out = new Uint8Array(4 * SIZE * SIZE);
  gl.readPixels(0, 0, SIZE, SIZE, gl.RGBA, gl.UNSIGNED_BYTE, out);
  renderer.dispose();
  renderer.forceContextLoss();
  return packed(out);
}

window.direct = async (name, shape) => {
  const facts = await (await fetch("/asset/" + name + ".json")).json();
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(facts.shapes[shape], 3));
  geometry.setIndex(facts.triangles.flat());
  return drawThree(new THREE.Mesh(geometry, new THREE.MeshNormalMaterial({ flatShading: true })));
};

window.three = async (name, target) => {
  const gltf = await new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).loadAsync("/asset/" + name + ".glb");
  gltf.scene.traverse((object) => {
    if (!object.isMesh) return;
    object.material = new THREE.MeshNormalMaterial({ flatShading: true });
    object.morphTargetInfluences.fill(0);
    if (target >= 0) object.morphTargetInfluences[target] = 1;
  });
  return drawThree(gltf.scene);
};

// The plain texture: no light, no conversion of colours.
function plain(map) {
  map.colorSpace = THREE.NoColorSpace;
  map.needsUpdate = true;
  return new THREE.MeshBasicMaterial({ map });
}

window.paintedDirect = async (name, shape) => {
  const { corners } = (await (await fetch("/asset/" + name + ".json")).json()).shapes[shape];
  const array = new THREE.InterleavedBuffer(new Float32Array(corners), 5);
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.InterleavedBufferAttribute(array, 3, 0));
  geometry.setAttribute("uv", new THREE.InterleavedBufferAttribute(array, 2, 3));
  const map = await new THREE.TextureLoader().loadAsync("/asset/" + name + ".png");
  Object.assign(map, { flipY: false, wrapS: THREE.RepeatWrapping, wrapT: THREE.RepeatWrapping, generateMipmaps: false,
    magFilter: THREE.NearestFilter, minFilter: THREE.NearestFilter });
  return drawThree(new THREE.Mesh(geometry, plain(map)));
};

window.paintedThree = async (name, target) => {
  const gltf = await new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).loadAsync("/asset/" + name + ".glb");
  gltf.scene.traverse((object) => {
    if (!object.isMesh) return;
    object.material = plain(object.material.map);
    object.morphTargetInfluences.fill(0);
    if (target >= 0) object.morphTargetInfluences[target] = 1;
  });
  return drawThree(gltf.scene);
};

window.paintedBabylon = (name, target) => window.babylon(name, target, true);

window.babylon = async (name, target, painted) => {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = SIZE;
  const engine = new BABYLON.Engine(canvas, false, { preserveDrawingBuffer: true });
  const scene = new BABYLON.Scene(engine);
  scene.useRightHandedSystem = true;
  scene.clearColor = new BABYLON.Color4(0, 0, 0, 0);
  await BABYLON.SceneLoader.AppendAsync("/asset/", name + ".glb", scene);
  scene.animationGroups.forEach((group) => group.stop());
  const white = new BABYLON.StandardMaterial("white", scene);
  white.disableLighting = true;
  white.backFaceCulling = true;
  white.emissiveColor = BABYLON.Color3.White();
  for (const mesh of scene.meshes) {
    if (!mesh.morphTargetManager) continue;
    if (painted) {
      white.emissiveColor = BABYLON.Color3.Black();
      white.emissiveTexture = mesh.material.albedoTexture;
    }
    mesh.material = white;
    mesh.useVertexColors = false;
    for (let i = 0; i < mesh.morphTargetManager.numTargets; i++) {
      mesh.morphTargetManager.getTarget(i).influence = i === target ? 1 : 0;
    }
  }
  const camera = new BABYLON.FreeCamera("eye", new BABYLON.Vector3(...EYE), scene);
  camera.mode = BABYLON.Camera.ORTHOGRAPHIC_CAMERA;
  Object.assign(camera, { orthoLeft: -HALF, orthoRight: HALF, orthoTop: HALF, orthoBottom: -HALF, minZ: 1, maxZ: 60 });
  camera.setTarget(BABYLON.Vector3.Zero());
  await scene.whenReadyAsync();
  scene.render();
  const pixels = await engine.readPixels(0, 0, SIZE, SIZE);
  const out = new Uint8Array(pixels.buffer);
  if (painted) { // Babylon.js treats the texels as linear light
    for (let i = 0; i < out.length; i++) {
      const light = out[i] / 255;
      if (i % 4 < 3) out[i] = Math.round(255 * (light <= 0.0031308 ? 12.92 * light : 1.055 * light ** (1 / 2.4) - 0.055));
    }
  }
  engine.dispose();
  return packed(out);
};
window.ready = true;
</script>`;

/** The decoder of meshoptimizer as Babylon.js expects it: a script that defines a global name. */
function decoderScript() {
  const decoder = npmFile('three/examples/jsm/libs/meshopt_decoder.module.js');
  return fs.readFileSync(decoder, 'utf8').replace('export { MeshoptDecoder };', '');
}

let folder;
let server;
let browser;
let page;
const faults = [];
before(async () => {
  folder = fs.mkdtempSync(path.join(os.tmpdir(), 'orbmorph-browser-'));
  execFileSync(process.env.ORB_ASSET_FIXTURE, [folder], { stdio: 'inherit' });
  server = await serve((at) => {
    const [, kind, ...rest] = at.split('/');
    if (kind === 'decoder.js') return { script: decoderScript() };
    return kind === 'npm' ? npmFile(rest.join('/')) : kind === 'asset' ? path.join(folder, ...rest) : { html: PAGE };
  });
  browser = await startBrowser();
  page = await browser.newPage();
  page.on('pageerror', (error) => faults.push(String(error)));
  await page.goto(`http://127.0.0.1:${server.port}/`);
  await page.waitForFunction(() => window.ready, null, { timeout: 180_000 });
});
after(async () => {
  await browser?.close();
  server?.close();
  fs.rmSync(folder, { recursive: true, force: true });
});

const draw = async (how, ...args) =>
  Buffer.from(await page.evaluate(([how, args]) => window[how](...args), [how, args]), 'base64');
const covered = (image) => Array.from({ length: SIZE * SIZE }, (_, i) => image[4 * i + 3] > 127);

// The share of differing pixels among those that either image covers.
function difference(a, b, tolerance) {
  let either = 0;
  let differ = 0;
  const inA = covered(a);
  const inB = covered(b);
  for (let i = 0; i < SIZE * SIZE; i++) {
    if (!inA[i] && !inB[i]) continue;
    either++;
    const far = [0, 1, 2].some((c) => Math.abs(a[4 * i + c] - b[4 * i + c]) > tolerance);
    if (inA[i] !== inB[i] || far) differ++;
  }
  assert.ok(either > 0.05 * SIZE * SIZE, 'the picture is empty');
  return differ / either;
}

// ORB_SHOTS names a folder that keeps the pictures for inspection.
function keep(name, image) {
  if (!process.env.ORB_SHOTS) return;
  const rgb = Buffer.alloc(3 * SIZE * SIZE);
  for (let y = 0; y < SIZE; y++) {
    for (let x = 0; x < SIZE; x++) {
      for (let c = 0; c < 3; c++) rgb[3 * (y * SIZE + x) + c] = image[4 * ((SIZE - 1 - y) * SIZE + x) + c];
    }
  }
  fs.writeFileSync(
    path.join(process.env.ORB_SHOTS, `${name}.ppm`),
    Buffer.concat([Buffer.from(`P6 ${SIZE} ${SIZE} 255\n`), rgb]),
  );
}

for (const [name, shape] of [
  ['two', 0],
  ['two', 1],
  ['dressed', 2],
  ['six', 1],
  ['two.quantized', 1],
  ['two.meshopt', 1],
  ['dressed.meshopt', 2],
]) {
  test(`${name}, shape ${shape}: three.js draws its shading, Babylon.js its outline`, async () => {
    const wanted = await draw('direct', name.split('.')[0], shape);
    assert.ok(difference(wanted, await draw('three', name, shape - 1), 6) < 0.005);
    assert.ok(difference(wanted, await draw('babylon', name, shape - 1), 256) < 0.01);
  });
}

// Three shapes with different triangles. The overlay has every edge of the textured shape, so its texture is exact
// there. On the others the direct picture interpolates coordinates over different triangles, which moves the tiles'
// borders.
for (const name of ['painted', 'painted-adaptive', 'painted.quantized', 'painted.meshopt']) {
  for (const shape of name.includes('.') ? [0] : [0, 1, 2]) {
    test(`${name}, shape ${shape}: both draw its texture`, async () => {
      const wanted = await draw('paintedDirect', name.split('.')[0], shape);
      const most = name !== 'painted-adaptive' && shape === 0 ? 0.01 : 0.08;
      for (const how of ['paintedThree', 'paintedBabylon']) {
        const got = await draw(how, name, shape - 1);
        keep(`${name}-${shape}-${how}`, got);
        keep(`${name}-${shape}-wanted`, wanted);
        const share = difference(wanted, got, 12);
        if (process.env.ORB_SHOTS) console.log(name, shape, how, share);
        assert.ok(share < most, `${how}: ${share}`);
      }
    });
  }
}

test('the shapes differ by far more than the tolerances', async () => {
  const first = await draw('direct', 'two', 0);
  assert.ok(difference(first, await draw('direct', 'two', 1), 256) > 0.1);
  assert.ok(difference(first, await draw('three', 'two', 0), 6) > 0.2);
});

test('the page threw no exception', () => assert.deepEqual(faults, []));
