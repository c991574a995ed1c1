// The API document alone: its references, schemas and examples, and the sources of the texts that it quotes.
import assert from 'node:assert/strict';
import { readdir, readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { root } from './support/daemon.mjs';
import { document, objects, operations, resolve, validate, VERBS } from './support/openapi.mjs';

test('the document is valid, and its examples match their schemas', () => {
  assert.match(document.openapi, /^3\.1\./);
  for (const [name, schema] of Object.entries(document.components.schemas))
    for (const example of schema.examples ?? [])
      validate({ $ref: `#/components/schemas/${name}` }, example, `example of ${name}`);
  const ids = new Set();
  for (const [target, item] of Object.entries(document.paths))
    for (const verb of VERBS.filter((v) => item[v])) {
      const operation = item[verb];
      assert.ok(operation.summary && !ids.has(operation.operationId), `${verb} ${target}`);
      ids.add(operation.operationId);
      const parameters = [...(item.parameters ?? []), ...(operation.parameters ?? [])].map(resolve);
      const inPath = parameters.filter((p) => p.in === 'path').map((p) => p.name);
      assert.deepEqual(
        inPath,
        [...target.matchAll(/\{(\w+)\}/g)].map((m) => m[1]),
        target,
      );
      for (const p of parameters) validate(p.schema, p.example, `${verb} ${target}: ${p.name}`);
      for (const content of [operation.requestBody, ...Object.values(operation.responses).map(resolve)].map(
        (r) => r?.content ?? {},
      ))
        for (const media of Object.values(content)) {
          const examples = media.examples
            ? Object.values(media.examples).map((e) => resolve(e).value)
            : [media.example];
          for (const example of examples) {
            assert.notEqual(example, undefined, `${verb} ${target} has no example`);
            validate(media.schema, example, `${verb} ${target}`);
          }
        }
    }
});

test('every reference leads somewhere, and every component is used', () => {
  const used = new Set([...JSON.stringify(document).matchAll(/"\$ref":"#\/components\/([^"]+)"/g)].map((m) => m[1]));
  const named = ['parameters', 'headers', 'responses', 'schemas', 'examples'].flatMap((kind) =>
    Object.keys(document.components[kind]).map((name) => `${kind}/${name}`),
  );
  assert.deepEqual([...used].sort(), named.sort());
});

/** The names of all members of a value that a schema allows. */
function membersOf(schema, seen = new Set()) {
  for (const [, { properties, $ref }] of objects(schema ?? {})) {
    for (const name of Object.keys(properties ?? {})) seen.add(name);
    if ($ref && !seen.has($ref)) membersOf(resolve({ $ref }), seen.add($ref));
  }
  return seen;
}

test('a response that several operations share is a component', () => {
  const written = new Map();
  const note = (at, response) => {
    const text = JSON.stringify(response);
    assert.ok(!written.has(text), `${at} repeats ${written.get(text)}`);
    written.set(text, at);
  };
  for (const { target, verb, responses } of operations)
    for (const [status, response] of Object.entries(responses))
      if (response.$ref) assert.match(response.$ref, /^#\/components\/responses\/\w+$/);
      else {
        assert.ok(status < 400, `${verb} ${target}: the problem ${status} is not a component`);
        note(`${verb} ${target} ${status}`, response);
      }
  for (const [name, response] of Object.entries(document.components.responses)) note(name, response);
});

test('no schema holds what generators of types read as something else', () => {
  for (const [at, schema] of objects(document.components.schemas)) {
    for (const [name, member] of Object.entries(schema.properties ?? {}))
      assert.equal(member.default, undefined, `${at}/${name}: a default makes an optional member mandatory`);
    for (const kind of ['anyOf', 'oneOf', 'allOf'])
      for (const part of schema[kind] ?? [])
        assert.notDeepEqual(Object.keys(part), ['required'], `${at}/${kind} says only what is required`);
  }
});

test('every operation says which security it needs', () => {
  const schemes = Object.keys(document.components.securitySchemes);
  for (const { target, verb, security, description } of operations) {
    assert.ok(Array.isArray(security), `${verb} ${target}`);
    assert.equal(security.length > 0, /scope (read|write|admin)/.test(description), `${verb} ${target}`);
    for (const name of security.flatMap(Object.keys)) assert.ok(schemes.includes(name));
  }
});

test('the example of a problem is about a request of its operation', async () => {
  const table = await readFile(path.join(root, 'api/routes.h'), 'utf8');
  const define = (name) => {
    const [, text] = table.match(new RegExp(`#define ${name} *((?:\\\\?\\s*"[^"]*")+)`));
    return [...text.matchAll(/"([^"]*)"/g)].map(([, part]) => part).join('');
  };
  const rows = [...table.matchAll(/ROUTE\(ROUTE_\w+, "(\w+)", "([^"]+)", \w+, SCOPE_(\w+), ([^)]*?),\s*\\?\s*handle/g)];
  const routes = new Map(
    rows.map(([, method, target, scope, query]) => [
      `${method.toLowerCase()} ${target}`,
      {
        scope: scope.toLowerCase(),
        query: query
          .replace(/API_\w+/g, (name) => `"${define(name)}"`)
          .replace(/[?"\\]/g, '')
          .split(/\s+/)
          .filter(Boolean),
      },
    ]),
  );
  let examined = 0;
  for (const { target, verb, responses, requestBody } of operations) {
    const what = `${verb} ${target}`;
    const { scope, query } = routes.get(what);
    const body = membersOf(requestBody);
    const examples = Object.values(responses)
      .map(resolve)
      .flatMap((r) => Object.values(r.content?.['application/problem+json']?.examples ?? {}))
      .map((e) => resolve(e).value);
    for (const problem of examples) {
      const { type, detail } = problem;
      const [, unknown, known] = /no query parameter "(\w+)" on this route, which takes (.*?)\./.exec(detail) ?? [];
      if (unknown) {
        assert.deepEqual(known, query.join(', ') || 'none', `${what}: ${detail}`);
        assert.ok(!query.includes(unknown), `${what}: ${detail}`);
      } else if (type === '/problems/bad-query') {
        const named = problem.parameter ?? /"(\w+)" must/.exec(detail)?.[1] ?? (/repair/.test(detail) && 'repair');
        assert.ok(query.includes(named), `${what}: ${detail}`);
      } else if (type === '/problems/forbidden') {
        assert.equal(problem.scope, scope, `${what}: ${detail}`);
        assert.ok(detail.includes(`"${scope}"`), `${what}: ${detail}`);
      } else if (/takes no body/.test(detail)) {
        assert.equal(requestBody, undefined, `${what}: ${detail}`);
      } else if (type === '/problems/bad-landmarks' && target === '/v1/landmarks') {
        assert.doesNotMatch(detail, /the file has/, `${what} knows no meshes: ${detail}`);
      } else if (type === '/problems/bad-option') {
        assert.ok([...body, ...query].includes(problem.member), `${what}: ${detail}`);
      } else continue;
      examined += 1;
    }
  }
  assert.ok(examined > 80, String(examined));
});

test('every problem has an example whose detail says more than its title', async () => {
  const table = (await readFile(path.join(root, 'api/problem.c'), 'utf8')).match(/table\[\] = \{\n([\s\S]*?)\n\};/)[1];
  const titles = new Map(
    [...table.matchAll(/\{"([a-z-]+)", (\d{3}), "([^"]+)"\}/g)].map((m) => [
      `/problems/${m[1]}`,
      { status: Number(m[2]), title: m[3] },
    ]),
  );
  const schemas = document.components.schemas;
  const examples = [
    ...Object.values(document.components.examples).map((e) => e.value),
    ...Object.values(schemas).flatMap((s) => s.examples ?? []),
  ];
  const problems = examples.filter((e) => /^\/problems\//.test(e.type));
  const known = schemas.Problem.oneOf.map((s) => (resolve(s).oneOf?.[0] ?? resolve(s)).properties);
  for (const { type, title, status } of known) {
    assert.deepEqual({ title: title.const, status: status.const }, titles.get(type.const), type.const);
    assert.ok(
      problems.some((p) => p.type === type.const),
      `${type.const} has no example`,
    );
  }
  for (const { type, title, detail } of problems) {
    assert.match(detail, /^\S.*[.]$/, type);
    const words = (text) =>
      text
        .toLowerCase()
        .replace(/[^a-z ]/g, '')
        .trim();
    assert.ok(!words(title).includes(words(detail)), `${type}: the detail repeats the title`);
    assert.ok(detail.length > title.length, `${type}: ${detail}`);
  }
  assert.equal(new Set(problems.map((p) => p.detail)).size, problems.length, 'each example has a detail of its own');
});

// The texts of a source as patterns: adjacent literals are one text, and a conversion such as %lld stands for anything.
const patternsOf = (source) =>
  [...source.matchAll(/(?:"(?:[^"\\\n]|\\.)*"\s*)+/g)]
    .map(([run]) => [...run.matchAll(/"((?:[^"\\\n]|\\.)*)"/g)].map((m) => m[1].replaceAll('\\"', '"')).join(''))
    .map((text) => text.split(/%[-.*\d]*(?:ll|z)?[a-z]/))
    .filter((parts) => parts.join('').replace(/[^A-Za-z]/g, '').length > 7)
    .map((parts) => parts.map((part) => part.replace(/[.*+?^${}()|[\]\\]/g, '\\$&')).join('.+'));

test('every example of a problem has a detail that the sources write', async () => {
  const files = [];
  for (const folder of ['api', 'core', 'server'])
    for (const file of await readdir(path.join(root, folder), { recursive: true }))
      if (/\.cc?$/.test(file)) files.push(await readFile(path.join(root, folder, file), 'utf8'));
  const patterns = files.flatMap(patternsOf).map((text) => new RegExp(`^${text}$`));
  const { examples, schemas } = document.components;
  const problems = [
    ...Object.values(examples).map((e) => e.value),
    ...Object.values(schemas).flatMap((s) => s.examples),
  ];
  const details = problems.filter((e) => /^\/problems\//.test(e?.type)).map((e) => e.detail);
  assert.ok(details.length > 40);
  for (const detail of details)
    assert.ok(
      patterns.some((p) => p.test(detail)),
      `no source writes: ${detail}`,
    );
});
