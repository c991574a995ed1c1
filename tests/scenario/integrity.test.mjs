// Stored bytes that are no longer what was stored: no result is computed from them, and sending them again heals them.
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import test from 'node:test';
import { daemon } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

/** Changes one digit of a stored mesh, so that it is still a mesh of the same size. */
function alter(d, id) {
  const file = path.join(d.data, 'objects/mesh', id.slice(0, 2), id);
  const bytes = readFileSync(file);
  const at = bytes.indexOf('1');
  bytes[at] ^= 1;
  writeFileSync(file, bytes);
}

for (const isolate of ['on', 'off'])
  test(`a mesh whose bytes changed on the disk is refused, and healed by an upload (isolate ${isolate})`, async (t) => {
    const d = await daemon(t, { args: ['--isolate', isolate] });
    const text = shapes.obj(shapes.egg(2));
    const { json: mesh } = await d.upload(text);
    alter(d, mesh.id);
    const made = await d.make('/v1/embeddings', { mesh: mesh.id });
    assert.equal(made.problem?.type, '/problems/corrupt', JSON.stringify(made));
    const again = await d.upload(text);
    assert.equal(again.status, 200, again.bytes.toString());
    assert.equal((await d.get(`${mesh.url}/file`)).bytes.toString(), text);
    assert.equal((await d.made('/v1/embeddings', { mesh: mesh.id })).certificate.valid, true);
    assert.match(d.log, /was lost or altered and is restored/);
  });
