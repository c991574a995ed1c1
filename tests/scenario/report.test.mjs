// docs/report.md explains every member of a report.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { daemon, root } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const text = await readFile(path.join(root, 'docs/report.md'), 'utf8');

/** Yields the names of all members, nested ones included, except within the members in `skip`. */
function* members(value, skip) {
  if (Array.isArray(value)) yield* value.flatMap((item) => [...members(item, skip)]);
  else if (value && typeof value === 'object')
    for (const [name, inner] of Object.entries(value)) {
      yield name;
      if (!skip.includes(name)) yield* members(inner, skip);
    }
}

test('docs/report.md explains every member of a supermesh and of an embedding', async (t) => {
  const d = await daemon(t);
  const [a, b] = await Promise.all(
    [shapes.egg(), shapes.bean()].map(async (m) => (await d.upload(shapes.obj(m))).json),
  );
  const embedding = await d.made('/v1/embeddings', { mesh: a.id });
  const body = {
    shapes: [
      { mesh: a.id, name: 'egg' },
      { mesh: b.id, name: 'bean' },
    ],
  };
  const found = await d.made('/v1/supermeshes', body);
  const given = await d.made('/v1/supermeshes', {
    ...body,
    landmarks: [{ name: 'tip', at: [{ vertex: 0 }, { vertex: 0 }] }],
  });
  const names = new Set(
    [embedding, found, given].flatMap((report) => [...members(report, ['request', 'at', 'options'])]),
  );
  assert.ok(names.size > 40);
  const explained = new Set(
    [...text.matchAll(/`([^`]+)`/g)].flatMap(([, code]) => code.match(/[a-z][a-z0-9_]*/g) ?? []),
  );
  assert.deepEqual(
    [...names].filter((name) => !explained.has(name)),
    [],
  );
});
