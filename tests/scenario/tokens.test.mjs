// Tokens: the command that makes them, and what each scope may do.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { readFile, readdir } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { promisify } from 'node:util';
import { assertProblem, binaries, daemon } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const run = (d, ...args) => promisify(execFile)(binaries.daemon, ['token', ...args, '--data', d.data]);
const bearer = (token) => ({ headers: { authorization: `Bearer ${token}` } });

test('tokens open what their scopes say', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on'] });
  for (const open of ['/livez', '/readyz']) assert.equal((await d.get(open)).status, 200);
  assertProblem(await d.get('/v1/meshes'), 401, 'unauthorized');
  await d.stop();

  const text = shapes.obj(shapes.egg(2));
  const token = {};
  for (const scope of ['read', 'write', 'admin', 'read,write']) {
    const { stdout } = await run(d, 'add', scope.replace(',', '-'), '--scope', scope);
    assert.match(stdout, /^[0-9a-f]{64}\n$/);
    token[scope] = stdout.trim();
  }
  token.small = (await run(d, 'add', 'small', '--scope', 'write', '--quota', String(text.length + 10))).stdout.trim();
  token.gone = (await run(d, 'add', 'gone', '--scope', 'admin')).stdout.trim();
  await run(d, 'remove', 'gone');
  await assert.rejects(run(d, 'add', 'read', '--scope', 'read'), { code: 1 });
  await assert.rejects(run(d, 'remove', 'nobody'), { code: 1 });
  for (const wrong of [['add', 'x'], ['add', 'x', '--scope', 'root'], ['add'], ['drop', 'x']]) {
    await assert.rejects(run(d, ...wrong), { code: 2 });
  }
  const listed = (await run(d, 'list')).stdout;
  assert.deepEqual(listed.trim().split('\n').map((l) => l.split(' ').slice(0, 2).join(' ')),
    ['admin admin', 'read read', 'read-write read,write', 'small write', 'write write']);
  for (const file of (await readdir(d.data)).filter((f) => f.startsWith('catalogue'))) {
    const bytes = (await readFile(path.join(d.data, file))).toString('latin1');
    for (const secret of Object.values(token)) assert.ok(!bytes.includes(secret), `${file} holds a token`);
  }

  await d.start();
  const upload = (who, body = text) => d.post('/v1/meshes', Buffer.from(body), bearer(token[who]));
  for (const headers of [{}, { authorization: 'Bearer ' }, { authorization: `Basic ${token.read}` },
    { authorization: `Bearer ${token.gone}` }, { authorization: `Bearer ${token.read.replace(/^./, (c) => (c === '0' ? '1' : '0'))}` }]) {
    for (const target of ['/v1/meshes', '/metrics', '/', '/openapi.json', '/nowhere']) {
      const reply = await d.get(target, { headers });
      assertProblem(reply, 401, 'unauthorized', target);
      assert.equal(reply.headers.get('www-authenticate'), 'Bearer');
    }
    assertProblem(await d.post('/v1/meshes', Buffer.from(text), { headers }), 401, 'unauthorized');
  }
  assertProblem(await upload('read'), 403, 'forbidden');
  const made = await upload('write');
  assert.equal(made.status, 201, made.bytes.toString());
  const { id, url } = made.json;
  assertProblem(await d.get(url, bearer(token.write)), 403, 'forbidden');
  assertProblem(await d.delete(url, bearer(token.read)), 403, 'forbidden');
  for (const who of ['read', 'read,write', 'admin']) assert.equal((await d.get(url, bearer(token[who]))).status, 200);
  for (const who of ['read', 'read,write', 'write']) assertProblem(await d.get('/metrics', bearer(token[who])), 403, 'forbidden');
  assert.equal((await d.get('/metrics', bearer(token.admin))).status, 200);
  assertProblem(await d.post('/v1/embeddings', { mesh: id }, bearer(token.read)), 403, 'forbidden');
  assert.ok([200, 202].includes((await d.post('/v1/embeddings', { mesh: id }, bearer(token['read,write']))).status));
  for (const open of ['/livez', '/readyz']) assert.equal((await d.get(open)).status, 200);

  // The quota counts what is stored anew, also across a restart.
  assert.equal((await upload('small')).status, 200, 'known already: it costs nothing');
  assert.equal((await upload('small', `${text}# 2\n`)).status, 201);
  assertProblem(await upload('small', `${text}# 3\n`), 429, 'quota-exceeded');
  await d.stop();
  await d.start();
  assertProblem(await upload('small', `${text}# 3\n`), 429, 'quota-exceeded');
  assert.equal((await upload('write', `${text}# 3\n`)).status, 201);
});
