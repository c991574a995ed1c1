// Uploads the chosen files, requests their morph from the daemon and plays the animation in the GLB.
import orbmorph from 'orbmorph';
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

const canvas = document.getElementById('view');
const status = document.getElementById('status');
const renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
const scene = new THREE.Scene();
scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8578, 2.5));
const sun = new THREE.DirectionalLight(0xffffff, 1.5);
sun.position.set(-1, 2, 1.5);
scene.add(sun);
const camera = new THREE.PerspectiveCamera(35, 1);
const controls = new OrbitControls(camera, canvas);
const clock = new THREE.Clock();
let mixer = null;
let shown = null;

document.getElementById('form').addEventListener('submit', async (event) => {
  event.preventDefault();
  try {
    const morph = await orbmorph.morph([...document.getElementById('files').files], {
      asset: { fit: 'similarity' },
      onProgress: ({ step, progress, job }) => {
        status.value = `${step === 'upload' ? 'uploading' : (job.stage ?? 'waiting')} ${Math.round(progress * 100)} %`;
      },
    });
    play(await new GLTFLoader().parseAsync(await morph.glb(), ''));
    status.value = `${morph.triangles} triangles for ${morph.shapes.map((shape) => shape.name).join(', ')}`;
  } catch (error) {
    status.value = error.message; // a ProblemError says why the daemon refused, and what to do
  }
});

function play(gltf) {
  if (shown) scene.remove(shown);
  shown = gltf.scene;
  scene.add(shown);
  const ball = new THREE.Box3().setFromObject(shown).getBoundingSphere(new THREE.Sphere());
  controls.target.copy(ball.center);
  camera.position.copy(ball.center).add(new THREE.Vector3(0.6, 0.4, 1).setLength(ball.radius * 3.6));
  camera.near = ball.radius / 20;
  camera.far = ball.radius * 40;
  mixer = new THREE.AnimationMixer(shown);
  for (const clip of gltf.animations) mixer.clipAction(clip).play();
}

renderer.setAnimationLoop(() => {
  const { clientWidth, clientHeight } = canvas;
  renderer.setSize(clientWidth, clientHeight, false);
  camera.aspect = clientWidth / clientHeight;
  camera.updateProjectionMatrix();
  mixer?.update(clock.getDelta());
  controls.update();
  renderer.render(scene, camera);
});
