// Files that people have: compressed and quantized glTF, 3MF, and files of other kinds, which the refusal names.
import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { folder, run } from './support/cli.mjs';
import { assertProblem, daemon, samples } from './support/daemon.mjs';
import { draco, encoder } from './support/draco.mjs';
import * as shapes from './support/shapes.mjs';

const near = (a, b, part, what) => assert.ok(Math.abs(a - b) <= part * Math.abs(b), `${what}: ${a}, expected ${b}`);

test('quantized and meshopt-compressed glTF are read: the mesh is that of the plain asset', async (t) => {
  const d = await daemon(t);
  const [a, b] = await Promise.all([d.mesh(path.join(samples, 'dog.obj')), d.mesh(path.join(samples, 'elephant.ply'))]);
  const made = await d.made('/v1/supermeshes', {
    shapes: [{ mesh: a.id }, { mesh: b.id }],
    align: { method: 'rotate' },
    remesh: { tolerance: 0.01 },
  });
  const upload = async (profile) => {
    const bytes = Buffer.from(await (await fetch(`${d.url}${made.asset}?profile=${profile}`)).arrayBuffer());
    const reply = await d.upload(bytes);
    assert.equal(reply.status, 201, JSON.stringify(reply.json));
    return { bytes, ...reply.json };
  };
  const [plain, quantized, packed] = [await upload('float'), await upload('quantized'), await upload('meshopt')];
  for (const mesh of [quantized, packed]) {
    assert.deepEqual([mesh.triangles, mesh.topology], [plain.triangles, plain.topology]);
    near(mesh.volume, plain.volume, 1e-3, 'volume');
    near(mesh.area, plain.area, 1e-3, 'area');
  }
  // damage to any byte of the compressed data gives a mesh or a problem
  for (let at = 100; at < packed.bytes.length; at += Math.ceil(packed.bytes.length / 40)) {
    const damaged = Buffer.from(packed.bytes);
    damaged[at] ^= 0x5a;
    assert.ok([200, 201, 400, 413, 422].includes((await d.upload(damaged)).status), `byte ${at}`);
  }
});

test('Draco-compressed glTF is read, and damaged data is refused', { skip: !existsSync(encoder) }, async (t) => {
  const d = await daemon(t);
  const egg = shapes.egg();
  const plain = (await d.upload(shapes.obj(egg))).json;
  const { glb, at, length } = await draco(egg);
  const { status, json } = await d.upload(glb);
  assert.equal(status, 201, JSON.stringify(json));
  assert.deepEqual([json.format, json.triangles, json.topology], ['glb', egg.triangles.length, plain.topology]);
  near(json.volume, 8 * plain.volume, 2e-3, 'volume, twice as large each way');
  near(json.bounds.max[0], 2 * plain.bounds.max[0], 2e-3, 'size');
  for (let k = 0; k < 30; k++) {
    const damaged = Buffer.from(glb);
    damaged[at + Math.floor((k * length) / 30)] ^= 0xa5;
    assert.ok([200, 201, 400, 413, 422].includes((await d.upload(damaged)).status), `damage ${k}`);
  }
  assertProblem(await d.upload(glb.subarray(0, at + length / 2)), 400, 'malformed-mesh');
  // two meshes that have one compressed mesh, with accessors of their own
  const twice = await draco({
    ...egg,
    edit: (json) => {
      const [only] = json.meshes[0].primitives;
      json.accessors.push(...structuredClone(json.accessors));
      json.meshes.push({ primitives: [{ ...only, attributes: { POSITION: 2 }, indices: 3 }] });
      json.nodes.push({ ...json.nodes[0], mesh: 1, translation: [100, 0, 0] });
      json.scenes[0].nodes.push(1);
    },
  });
  const two = await d.upload(twice.glb);
  assertProblem(two, 422, 'not-connected');
  assert.deepEqual(
    two.json.parts.map((part) => part.triangles),
    [egg.triangles.length, egg.triangles.length],
  );
});

// A box of 1 × 2 × 3 cm in two materials, in a component that doubles it and moves it by 5 cm, written by lib3mf 1.8.1.
const boxOfLib3mf = Buffer.from(
  [
    'UEsDBC0AAAAIAAAAAACWewfy//////////8QABQAM0QvM2Rtb2RlbC5tb2RlbAEAEACQCAAAAAAAAPMCAAAAAAAAlVbLbtswEDwnX0GwZ0YvUh',
    'INOkGKIkCBHgoU+QCSohMVkmhItOH067uk5GecxLYBO5Jmdmdn18uIh03boLXph9p2c5zcxRiZTtuq7l7meOUWpMQP97eitZVpEGC7YY5fnVvO',
    'omjQr6aVw11b694OduHutG2jrGplt1pI7VY9BIm07U2UxgmL4hSjVVe7Odamc3VrnOmxjzlrpM9mOvL8J9zohll7ZZpWQrRaNvtUQexseWWcZW',
    '+rlXbgxhQp3ypSV0ZSRraNdK7Wof4i1D+KutbDoZmCgIkFvr+9Eb0Z7KrXZoCLG6HkAJ0YDRhQXUEjPWp6gjrZmjn+/esRo6oelo1807ax/Rx/',
    'e3oqY//CKHqHf/wOzTjBe+zT0w4voqPMQYtVf412QQT0e0yt7AYj97YEFWGQMFrOnp9//pjjWOasYKUmVVZQQhnlhJdckySnjJd5wvKMAXosCb',
    '67ymyANVXXmuE16L4RMMLe6eCHL9xfmw0KYPTmKehf+BwLPULA1IcXvgqY7lgfBoakkPpi4Kgx28W9TOrl+CMhn9LOCH+HF9Gx58LB7697afY9',
    '2N5A6yRYv07BDIzWmZ/PfVPHh7tiz7GykQXk3Sh8xqIAh1wwOT4X/IKvYQHcs4oLWWCVzwUFedbhsH6mcGJNCkHvRQp9kr2HJ3XBw/MeTqyprh',
    'OFH7J8oyDX5PyJG1+xAH7G+Q9ZPgnk8qaAhydufMXyzX7frz1LRNuJGpeDiLZrQ0TjsjrdWyDn7LIq5IJlclEQEytFaJJWsKxS/5dM8zJhJi/0',
    'tJngJFzaDo65aSGJ3Q005vQbDSx2veyGhe3huEtRHN77b+avYTSmXZlLzrnkCUnVoiSUa0p4RSlhCpZkasqEUkCPMyDg3D1UcFCqiA4PD6FWdV',
    'PtciQs1YylJSljmRCqDSOqyBOic5VUVcaNgVM8+FU70x7UAp5tdRZxkVJZcFJQXhGackVkyRihhutEySKnsRp1wvnhs8P/F1E4F+5v/wNQSwME',
    'LQAAAAgAAAAAAKEKeAj//////////xMAFABbQ29udGVudF9UeXBlc10ueG1sAQAQAFECAAAAAAAA6wAAAAAAAACdUk1KxTAQXttThGylTVUQkb',
    'Zvod7AC4R0+qPJJCTTR72901YeKNaCy8nM90uq0+ysOENMo8da3hSlFIDGtyP2tZyoyx/kqcmq148ASfAtploOROFRqWQGcDoVPgDypvPRaeIx',
    '9ipo8657ULdlea+MRwKknBYO2WRX1TN0erIkXmZebMpvAXopnrbTRa2Wo1sotoXahf0H5XwL9oeaDsGORhP3oM7YFi7lXymKu9ZpnDptaIrcS8',
    '7zQnDNoaXYcxbwd2fr+x4ogk0Hvr63ffHIyNV7GsaQ/nZGMHMQONA5zn/h4TSVWn9Ik30CUEsDBC0AAAAIAAAAAAA+zaVO//////////8LABQA',
    'X3JlbHMvLnJlbHMBABAACAEAAAAAAACyAAAAAAAAAGWPzQrCMBCEz/Ypwt7tthZExLQXL16lLxDS7Q82PySp6Nu7goLF487MfsycmoeZxZ1CnJ',
    'yVUOYFCLLadZMdJCyp3x6gqbPTlWaVOBLHyUfBPzZKGFPyR8SoRzIq5s6TZad3wajEZxjQK31TA+GuKPYYfhlQZ5sVVbRPT39MM+ngoutTrp3B',
    'qjPKLr3SaQlckLFlhUX51l1HM4hWhYGSBKzOXzH/WJdOAjfgfch7cDWozl5QSwECLQAtAAAACAAAAAAAlnsH8v//////////EAAcAAAAAAAAAI',
    'AAAAD/////M0QvM2Rtb2RlbC5tb2RlbAEAGACQCAAAAAAAAPMCAAAAAAAAAAAAAAAAAABQSwECLQAtAAAACAAAAAAAoQp4CP//////////EwAc',
    'AAAAAAAAAIAAAAD/////W0NvbnRlbnRfVHlwZXNdLnhtbAEAGABRAgAAAAAAAOsAAAAAAAAANQMAAAAAAABQSwECLQAtAAAACAAAAAAAPs2lTv',
    '//////////CwAcAAAAAAAAAIAAAAD/////X3JlbHMvLnJlbHMBABgACAEAAAAAAACyAAAAAAAAAGUEAAAAAAAAUEsGBiwAAAAAAAAALQAtAAAA',
    'AAAAAAAAAwAAAAAAAAADAAAAAAAAAAwBAAAAAAAAVAUAAAAAAABQSwYHAAAAAGAGAAAAAAAAAQAAAFBLBQYAAAAAAwADAAwBAAD/////AAA=',
  ].join(''),
  'base64',
);

test('3MF is read: units, placement and materials of the file, by whichever program wrote it', async (t) => {
  const d = await daemon(t);
  const { status, json: box } = await d.upload(boxOfLib3mf);
  assert.equal(status, 201, JSON.stringify(box));
  assert.deepEqual([box.format, box.vertices, box.triangles], ['3mf', 8, 12]);
  near(box.volume, 8 * 6000, 1e-12, 'cubic millimetres');
  assert.deepEqual(box.bounds, { min: [50, 0, 0], max: [70, 40, 60] });

  // the same shape in inches, as the OBJ in millimetres
  const egg = shapes.egg();
  const plain = (await d.upload(shapes.obj(egg))).json;
  const inches = (await d.upload(shapes.threeMf(egg, 'inch'))).json;
  assert.deepEqual([inches.triangles, inches.topology], [plain.triangles, plain.topology]);
  near(inches.volume, 25.4 ** 3 * plain.volume, 1e-12, 'volume');

  // a morph has the materials of its first shape
  const { id } = (await d.upload(shapes.obj(shapes.ball(3)))).json;
  const made = await d.made('/v1/supermeshes', {
    shapes: [{ mesh: box.id }, { mesh: id }],
    align: { method: 'rotate' },
    remesh: { tolerance: 0.02 },
  });
  const glb = Buffer.from(await (await fetch(d.url + made.asset)).arrayBuffer());
  const asset = JSON.parse(glb.subarray(20, 20 + glb.readUInt32LE(12)).toString());
  assert.deepEqual(asset.materials.map(({ name }) => name).sort(), ['ABS', 'PLA']);
  const pla = asset.materials.find(({ name }) => name === 'PLA').pbrMetallicRoughness.baseColorFactor;
  // 128 of 255 in sRGB
  for (const [k, linear] of [1, ((128 / 255 + 0.055) / 1.055) ** 2.4, 0, 1].entries())
    assert.ok(Math.abs(pla[k] - linear) < 1e-4, `${pla}`);
});

test('the textures of a 3MF are named as dropped, and doctor examines such files', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const egg = shapes.egg();
  const xmlns = 'http://schemas.microsoft.com/3dmanufacturing/material/2015/02';
  const textured = shapes
    .xmlOf3mf(egg)
    .replace('<resources>', `<resources><t:texture2dgroup xmlns:t="${xmlns}" id="21" texid="20"/>`);
  const { id: base } = (await d.upload(shapes.package3mf(textured))).json;
  const { id: other } = (await d.upload(shapes.obj(shapes.ball(3)))).json;
  const dropped = async (...ids) => {
    const request = { shapes: ids.map((mesh) => ({ mesh })), align: { method: 'rotate' }, remesh: { tolerance: 0.02 } };
    return (await d.made('/v1/supermeshes', request)).dropped.map(({ what, where, why }) => [what, where, why]);
  };
  assert.deepEqual(await dropped(base, other), [
    ['texture2dgroup', '', 'The reader takes colours from 3MF, no textures.'],
  ]);
  assert.deepEqual(await dropped(other, base), [
    ['textures', 'shapes[1]', "The materials of the asset are the first shape's."],
  ]);

  const at = await folder(t);
  const files = { whole: egg, open: { ...egg, triangles: egg.triangles.slice(1) }, ring: shapes.torus() };
  for (const [name, mesh] of Object.entries(files)) await writeFile(path.join(at, `${name}.3mf`), shapes.threeMf(mesh));
  const examined = async (name) => run(['doctor', path.join(at, `${name}.3mf`)], { env });
  const [whole, open, ring] = [await examined('whole'), await examined('open'), await examined('ring')];
  assert.deepEqual([whole.code, open.code, ring.code], [0, 1, 1]);
  assert.match(
    whole.out,
    new RegExp(`whole\\.3mf: healthy: closed, in one piece, genus 0, ${egg.triangles.length} triangles`),
  );
  assert.match(open.out, /helps: orbmorph upload --repair fill_holes .*open\.3mf/);
  assert.match(ring.out, /handle: a loop of \d+ vertices/);
});

test('3MF that is damaged, or made to cost much, is refused', async (t) => {
  const d = await daemon(t);
  const whole = shapes.threeMf(shapes.egg());
  for (let k = 0; k < 30; k++) {
    const damaged = Buffer.from(whole);
    damaged[Math.floor((k * whole.length) / 30)] ^= 0xa5;
    assert.ok([200, 201, 400, 413, 415, 422].includes((await d.upload(damaged)).status), `damage ${k}`);
  }
  assertProblem(await d.upload(whole.subarray(0, whole.length / 2), { format: '3mf' }), 400, 'malformed-mesh');
  const xml = shapes.xmlOf3mf(shapes.egg());
  const bombs = [
    [xml.replace('<build>', `${' '.repeat(2e7)}<build>`), 413, 'too-large', /unpacks to more/],
    [xml.replace('<build>', `<build>${'<item objectid="1"/>'.repeat(2000)}`), 413, 'too-large', /justifies/],
    [xml.replace('<model', '<!DOCTYPE model [<!ENTITY a "b">]><model'), 400, 'malformed-mesh', /document type/],
    [xml.replace('<build>', '<a>'.repeat(100)), 400, 'malformed-mesh', /nests deeper/],
  ];
  for (const [model, status, problem, detail] of bombs) {
    const reply = await d.upload(shapes.package3mf(model));
    assertProblem(reply, status, problem, String(detail));
    assert.match(reply.json.detail, detail);
  }
});

test('files of other kinds are refused by name, with advice', async (t) => {
  const d = await daemon(t);
  const kinds = [
    ['Kaydara FBX Binary  \0\x1a\0', /FBX file.*export it as glTF/],
    ['BLENDER-v300RENDH', /Blender file.*glTF/],
    ['PK\x03\x04\x14\0\x06\0', /ZIP archive.*3MF/],
    ['ISO-10303-21;\nHEADER;', /STEP file/],
    ['<?xml version="1.0"?>\n<COLLADA xmlns="x">', /Collada file/],
    ['<!doctype html>\n<html lang="en">', /web page/],
    ['\x89PNG\r\n\x1a\n', /PNG picture/],
    ['MM\x0a\0\0\0\x02\0\x0a\0', /3DS file.*glTF/],
    [`PK\x03\x04${'\0'.repeat(26)}scene.usdc`, /USDZ file.*glTF/],
    ['  0\r\nSECTION\r\n  2\r\nHEADER\r\n', /DXF file.*glTF/],
    ['3D Geometry File Format        5', /Rhino file.*mesh/],
    ['# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n', /PCD file, a cloud of points/],
    // the second line could be of an OBJ
    ['# vtk DataFile Version 3.0\nv of a bone\nASCII\nDATASET POLYDATA\n', /VTK file.*PLY/],
    ['#VRML V2.0 utf8\n', /VRML file.*glTF/],
    ['{"landmarks": [{"at": [{"vertex": 0}, {"vertex": 1}]}]}', /landmark file.*--landmarks/],
    [' [\n[0, 1]]', /list in JSON.*--landmarks/],
  ];
  for (const [text, expected] of kinds) {
    const reply = await d.upload(Buffer.from(text, 'latin1'));
    assertProblem(reply, 415, 'unknown-format', text);
    assert.match(reply.json.detail, expected);
  }
  assert.equal((await d.upload(await readFile(path.join(samples, 'elephant.ply')))).status, 201);
});
