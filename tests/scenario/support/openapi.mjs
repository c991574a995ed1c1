// The API document: its schemas, references and operations.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import Ajv2020 from 'ajv/dist/2020.js';
import { root } from './daemon.mjs';

export const document = JSON.parse(await readFile(path.join(root, 'api/openapi.json'), 'utf8'));
export const VERBS = ['get', 'post', 'put', 'patch', 'delete'];

/** Validates values against the schemas of the document. */
function validators() {
  const ajv = new Ajv2020.default({
    strict: true,
    allowUnionTypes: true,
    strictRequired: false,
    strictTypes: false,
    allErrors: true,
    formats: { 'date-time': true, 'uri-reference': true },
  });
  const moved = (value) => JSON.parse(JSON.stringify(value).replaceAll('#/components/schemas/', 'document#/$defs/'));
  ajv.addSchema({ $id: 'document', $defs: moved(document.components.schemas) });
  const made = new Map();
  return (schema, value, what) => {
    const key = JSON.stringify(schema);
    if (!made.has(key)) made.set(key, ajv.compile(moved(schema)));
    const check = made.get(key);
    const fine = check(value);
    // Of the alternatives of a problem, report the errors of the one that its type names.
    const meant = /^\/problems\//.test(value?.type)
      ? `/Problem${value.type.slice(10).replace(/(^|-)(.)/g, (_, __, c) => c.toUpperCase())}/`
      : '';
    const errors = (check.errors ?? []).filter((e) => e.schemaPath.includes(meant)).slice(0, 6);
    assert.ok(fine, `${what}\n${JSON.stringify(errors)}\n${JSON.stringify(value).slice(0, 1500)}`);
  };
}
export const validate = validators();
export const resolve = (o) =>
  o.$ref
    ? o.$ref
        .split('/')
        .slice(1)
        .reduce((at, name) => at[name], document)
    : o;

/** Every object of the document with its place in it. */
export function* objects(value, at = '#') {
  if (!value || typeof value !== 'object') return;
  if (!Array.isArray(value)) yield [at, value];
  for (const [key, item] of Object.entries(value)) yield* objects(item, `${at}/${key}`);
}
export const operations = Object.entries(document.paths).flatMap(([target, item]) =>
  VERBS.filter((v) => item[v]).map((verb) => ({ target, verb, ...item[verb] })),
);
