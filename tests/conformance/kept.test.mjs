// A rigged character as the template of a morph: the Khronos validator, and three.js with skin and targets together.
import assert from 'node:assert/strict';
import test from 'node:test';
import { rigged } from '../samples/rigged.mjs';
import { daemon } from '../scenario/support/daemon.mjs';
import * as shapes from '../scenario/support/shapes.mjs';

let validator;
let three;
let GLTFLoader;
let MeshoptDecoder;
try {
  validator = (await import('gltf-validator')).default;
  three = await import('three');
  globalThis.self ??= globalThis;
  // The test ignores pictures; the loader only needs decoding to succeed.
  globalThis.createImageBitmap ??= async () => ({ width: 1, height: 1, close() {} });
  ({ GLTFLoader } = await import('three/addons/loaders/GLTFLoader.js'));
  ({ MeshoptDecoder } = await import('three/addons/libs/meshopt_decoder.module.js'));
} catch {
  console.log('the npm packages are missing: npm ci in tests/');
  process.exit(0);
}

/** The messages of the validator, except for hints about the vendor's extension. */
async function complaints(bytes) {
  const report = await validator.validateBytes(new Uint8Array(bytes), { maxIssues: 100 });
  return report.issues.messages.filter((m) => m.severity < 2);
}

async function load(bytes) {
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
  const gltf = await new GLTFLoader().parseAsync(buffer, '');
  const bodies = [];
  gltf.scene.updateMatrixWorld(true);
  gltf.scene.traverse((object) => object.isSkinnedMesh && bodies.push(object));
  return { gltf, bodies };
}

/** The points of a skinned mesh in the scene, with the current joints and these weights. */
function shown(body, weights) {
  weights.forEach((w, k) => {
    body.morphTargetInfluences[k] = w;
  });
  return Array.from({ length: body.geometry.attributes.position.count }, (_, v) =>
    body.getVertexPosition(v, new three.Vector3()).toArray(),
  );
}

const bend = (gltf) => {
  gltf.scene.getObjectByName('joint_9').rotation.z = 0.7;
  gltf.scene.updateMatrixWorld(true);
};

test('a rigged character with two new shape keys: validator, three.js, skin and targets together', async (t) => {
  const d = await daemon(t);
  const { bytes } = rigged();
  assert.deepEqual(await complaints(bytes), []);
  const first = (await d.upload(bytes, { name: 'body', repair: 'largest_component' })).json;
  const meshes = [{ mesh: first.id }];
  const others = [shapes.bean(3), shapes.egg(3)];
  for (const [i, other] of others.entries())
    meshes.push({ mesh: (await d.upload(shapes.obj(other), { name: `other ${i}` })).json.id });
  const made = await d.made('/v1/supermeshes', {
    shapes: meshes,
    remesh: { method: 'template' },
    asset: { fit: 'none' },
    landmarks: 'auto',
  });
  const asset = (await d.get(made.asset)).bytes;
  assert.deepEqual(await complaints(asset), []);

  const [before, after] = [await load(bytes), await load(asset)];
  assert.deepEqual(
    after.gltf.animations.map((a) => a.name),
    ['wave', 'morph'],
  );
  assert.equal(after.bodies.length, 2);
  for (const [p, body] of after.bodies.entries()) {
    const old = before.bodies[p];
    assert.equal(body.skeleton.bones.length, 20);
    assert.deepEqual(Object.keys(body.morphTargetDictionary), ['smile', 'other 0', 'other 1']);
    assert.equal(body.morphTargetInfluences[0], 0.25);
    for (const name of ['position', 'normal', 'uv', 'uv1', 'tangent', 'skinIndex', 'skinWeight'])
      assert.deepEqual(body.geometry.attributes[name].array, old.geometry.attributes[name].array, name);
    assert.deepEqual(body.geometry.index.array, old.geometry.index.array);
    assert.equal(body.material.name, old.material.name);
    assert.equal(Boolean(body.material.normalMap), p === 1);
    assert.deepEqual(shown(body, [1, 0, 0]), shown(old, [1]));
  }
  const rest = after.bodies.map((body) => shown(body, [0, 1, 0]));
  bend(before.gltf);
  bend(after.gltf);
  for (const [p, body] of after.bodies.entries()) {
    assert.deepEqual(shown(body, [1, 0, 0]), shown(before.bodies[p], [1]), 'bent as before');
    // The skin moves the target's vertex by the joints' matrices, blended by the vertex's weights.
    const bent = shown(body, [0, 1, 0]);
    const { skinIndex, skinWeight } = body.geometry.attributes;
    let moved = 0;
    for (let v = 0; v < bent.length; v++) {
      const sum = new three.Vector3();
      for (let k = 0; k < 2; k++) {
        const joint = skinIndex.getComponent(v, k);
        const matrix = new three.Matrix4().multiplyMatrices(
          body.skeleton.bones[joint].matrixWorld,
          body.skeleton.boneInverses[joint],
        );
        sum.addScaledVector(new three.Vector3(...rest[p][v]).applyMatrix4(matrix), skinWeight.getComponent(v, k));
      }
      assert.ok(sum.distanceTo(new three.Vector3(...bent[v])) < 1e-5);
      moved += sum.distanceTo(new three.Vector3(...rest[p][v])) > 0.1;
    }
    assert.ok(p === 0 || moved > bent.length / 4, 'the joints bend the target');
  }
});

test('an OBJ of three materials: the primitives share their vertices, in every profile', async (t) => {
  const d = await daemon(t);
  const base = shapes.egg(3);
  const kindOf = (i) => (i * 7) % 3;
  const text =
    [...base.positions, [7, 8, 9]].map((p) => `v ${p.join(' ')}\n`).join('') +
    base.triangles.map((f, i) => `usemtl m${kindOf(i)}\nf ${f.map((v) => v + 1).join(' ')}\n`).join('');
  const first = (await d.upload(text, { name: 'egg' })).json;
  const second = (await d.upload(shapes.obj(shapes.bean(3)), { name: 'bean' })).json;
  const made = await d.made('/v1/supermeshes', {
    shapes: [{ mesh: first.id }, { mesh: second.id }],
    align: { method: 'rotate' },
    remesh: { method: 'template' },
    asset: { fit: 'none' },
  });
  /** The triangles of a profile by material, as points of the target, sorted. */
  const drawn = async (profile) => {
    const { bytes } = await d.get(`${made.asset}?profile=${profile}`);
    assert.deepEqual(await complaints(bytes), [], profile);
    const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
    const { scene } = await new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).parseAsync(buffer, '');
    scene.updateMatrixWorld(true);
    const parts = {};
    scene.traverse((mesh) => {
      if (!mesh.isMesh) return;
      mesh.morphTargetInfluences[0] = 1;
      assert.equal(mesh.geometry.attributes.position.count, base.positions.length + 1, profile);
      const at = Array.from({ length: mesh.geometry.attributes.position.count }, (_, v) =>
        mesh.getVertexPosition(v, new three.Vector3()).applyMatrix4(mesh.matrixWorld),
      );
      const index = [...mesh.geometry.index.array];
      parts[mesh.material.name] = index.map((v) => at[v]);
    });
    return parts;
  };
  const plain = await drawn('float');
  assert.deepEqual(Object.keys(plain).sort(), ['m0', 'm1', 'm2']);
  for (const profile of ['quantized', 'meshopt']) {
    const parts = await drawn(profile);
    for (const [name, corners] of Object.entries(plain)) {
      assert.equal(parts[name].length, corners.length);
      const centers = (list) =>
        Array.from({ length: list.length / 3 }, (_, i) =>
          list[3 * i]
            .clone()
            .add(list[3 * i + 1])
            .add(list[3 * i + 2])
            .divideScalar(3),
        );
      const theirs = centers(parts[name]);
      for (const center of centers(corners))
        assert.ok(Math.min(...theirs.map((other) => other.distanceTo(center))) < 1e-3, `${profile}, ${name}`);
    }
  }
});
