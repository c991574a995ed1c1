// Checks the API document with other tools: Redocly and Spectral report no warnings, and a client with the types of
// openapi-typescript compiles and talks to the daemon.
import assert from 'node:assert/strict';
import { copyFile, readFile, symlink, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { folder } from './support/cli.mjs';
import { daemon, root, samples } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const file = path.join(root, 'api/openapi.json');
const here = path.dirname(fileURLToPath(import.meta.url));

test('Redocly finds nothing', async () => {
  const { createConfig, lint } = await import('@redocly/openapi-core');
  const config = await createConfig({ extends: ['recommended'] });
  const found = await lint({ ref: file, config });
  assert.deepEqual(
    found.map(({ ruleId, severity, message, location }) => [ruleId, severity, message, location[0]?.pointer]),
    [],
  );
});

test('Spectral finds nothing', async () => {
  const { default: core } = await import('@stoplight/spectral-core');
  const { default: parsers } = await import('@stoplight/spectral-parsers');
  const { default: rulesets } = await import('@stoplight/spectral-rulesets');
  const spectral = new core.Spectral();
  spectral.setRuleset({ extends: [rulesets.oas] });
  const found = await spectral.run(new core.Document(await readFile(file, 'utf8'), parsers.Json, file));
  assert.deepEqual(
    found.map(({ code, severity, message, path: at }) => [code, severity, message, at.join('/')]),
    [],
  );
});

test('a client with the types of openapi-typescript compiles and works', async (t) => {
  const { default: generate, astToString } = await import('openapi-typescript');
  const { default: ts } = await import('typescript');
  const at = await folder(t);
  await writeFile(path.join(at, 'api.ts'), astToString(await generate(pathToFileURL(file))));
  await copyFile(path.join(here, 'openapi_client.ts'), path.join(at, 'client.ts'));
  await writeFile(path.join(at, 'package.json'), '{"type": "module"}');
  await symlink(path.join(root, 'tests/node_modules'), path.join(at, 'node_modules'));
  const program = ts.createProgram([path.join(at, 'client.ts')], {
    strict: true,
    exactOptionalPropertyTypes: true,
    noUncheckedIndexedAccess: true,
    skipLibCheck: true,
    target: ts.ScriptTarget.ES2022,
    module: ts.ModuleKind.NodeNext,
    moduleResolution: ts.ModuleResolutionKind.NodeNext,
    lib: ['lib.es2022.d.ts', 'lib.dom.d.ts'],
    types: [],
    outDir: at,
  });
  const errors = [...ts.getPreEmitDiagnostics(program), ...program.emit().diagnostics];
  assert.equal(
    ts.formatDiagnostics(errors, {
      getNewLine: () => '\n',
      getCurrentDirectory: () => at,
      getCanonicalFileName: (name) => name,
    }),
    '',
  );
  const client = await import(pathToFileURL(path.join(at, 'client.js')));

  const d = await daemon(t);
  const files = [];
  for (const name of ['dog.obj', 'giraffe.off'])
    files.push({ name: path.parse(name).name, bytes: new Uint8Array(await readFile(path.join(samples, name))) });
  const { supermesh, names, bytes, magic, deleted } = await client.journey(d.url, files);
  assert.deepEqual(
    supermesh.shapes.map(({ name }) => name),
    ['dog', 'giraffe'],
  );
  assert.deepEqual([names, bytes, magic, deleted], [['dog', 'giraffe'], supermesh.asset_bytes, 'glTF', 204]);
  const why = (text) => client.refusal(d.url, Buffer.from(text));
  assert.equal(await why(shapes.obj(shapes.withoutFace(shapes.ball(2)))), '1 loops');
  assert.equal(await why(shapes.obj(shapes.torus())), 'genus 1');
  assert.equal(await why('OFF\n4 4 0\n0 0 x\n'), 'line 3');
  assert.match(await why(shapes.binaryPly(shapes.ball(2)).subarray(0, 400)), /^offset \d+$/);
});
