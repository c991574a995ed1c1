// Tokens: the command that creates them, and what each scope may do.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { link, mkdir, readFile, readdir, rm, stat, symlink, writeFile } from 'node:fs/promises';
import { userInfo } from 'node:os';
import path from 'node:path';
import test from 'node:test';
import { promisify } from 'node:util';
import { assertProblem, binaries, daemon, endless, patience, slow } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const run = (d, ...args) => promisify(execFile)(binaries.daemon, ['token', ...args, '--data', d.data]);
const bearer = (token) => ({ headers: { authorization: `Bearer ${token}` } });

test('tokens allow what their scopes say', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on'] });
  for (const open of ['/livez', '/readyz']) assert.equal((await d.get(open)).status, 200);
  assertProblem(await d.get('/v1/meshes'), 401, 'unauthorized');
  await d.stop();

  const text = shapes.obj(shapes.egg(2));
  const token = {};
  for (const scope of ['read', 'write', 'admin', 'read,write']) {
    const { stdout } = await run(d, 'add', scope.replace(',', '-'), '--scope', scope, '--tenant', 'shop');
    assert.match(stdout, /^[0-9a-f]{64}\n$/);
    token[scope] = stdout.trim();
  }
  token.small = (await run(d, 'add', 'small', '--scope', 'write', '--quota', String(text.length + 10))).stdout.trim();
  token.gone = (await run(d, 'add', 'gone', '--scope', 'admin')).stdout.trim();
  await run(d, 'remove', 'gone');
  await assert.rejects(run(d, 'add', 'read', '--scope', 'read'), { code: 1 });
  await assert.rejects(run(d, 'remove', 'nobody'), { code: 1 });
  for (const wrong of [
    ['add', 'x'],
    ['add', 'x', '--scope', 'root'],
    ['add'],
    ['drop', 'x'],
    ['add', 'x', '--scope', 'read', '--tenant', '-'],
    ['set', 'read', '--tenant', 'x'],
  ]) {
    await assert.rejects(run(d, ...wrong), { code: 2 });
  }
  const listed = (await run(d, 'list')).stdout;
  assert.deepEqual(
    listed
      .trim()
      .split('\n')
      .map((l) => l.split(' ').slice(0, 2).join(' ')),
    ['admin admin', 'read read', 'read-write read,write', 'small write', 'write write'],
  );
  for (const file of (await readdir(d.data)).filter((f) => f.startsWith('catalogue'))) {
    const bytes = (await readFile(path.join(d.data, file))).toString('latin1');
    for (const secret of Object.values(token)) assert.ok(!bytes.includes(secret), `${file} holds a token`);
  }

  await d.start();
  const upload = (who, body = text) => d.post('/v1/meshes', Buffer.from(body), bearer(token[who]));
  for (const headers of [
    {},
    { authorization: 'Bearer ' },
    { authorization: `Basic ${token.read}` },
    { authorization: `Bearer ${token.gone}` },
    { authorization: `Bearer ${token.read.replace(/^./, (c) => (c === '0' ? '1' : '0'))}` },
  ]) {
    for (const target of ['/v1/meshes', '/metrics', '/nowhere', '/v1']) {
      const reply = await d.get(target, { headers });
      assertProblem(reply, 401, 'unauthorized', target);
      assert.equal(reply.headers.get('www-authenticate'), 'Bearer');
    }
    assertProblem(await d.post('/v1/meshes', Buffer.from(text), { headers }), 401, 'unauthorized');
    for (const open of ['/', '/docs', '/openapi.json'])
      assert.equal((await d.get(open, { headers })).status, 200, open);
  }
  assertProblem(await upload('read'), 403, 'forbidden');
  const made = await upload('write');
  assert.equal(made.status, 201, made.bytes.toString());
  const { id, url } = made.json;
  assertProblem(await d.get(url, bearer(token.write)), 403, 'forbidden');
  assertProblem(await d.delete(url, bearer(token.read)), 403, 'forbidden');
  for (const who of ['read', 'read,write', 'admin']) assert.equal((await d.get(url, bearer(token[who]))).status, 200);
  for (const who of ['read', 'read,write', 'write'])
    assertProblem(await d.get('/metrics', bearer(token[who])), 403, 'forbidden');
  assert.equal((await d.get('/metrics', bearer(token.admin))).status, 200);
  assertProblem(await d.post('/v1/embeddings', { mesh: id }, bearer(token.read)), 403, 'forbidden');
  assert.ok([200, 202].includes((await d.post('/v1/embeddings', { mesh: id }, bearer(token['read,write']))).status));
  for (const open of ['/livez', '/readyz']) assert.equal((await d.get(open)).status, 200);

  // The quota counts owned meshes, each once, also across a restart.
  assert.equal((await upload('small')).status, 201, 'what others have counts as well');
  assert.equal((await upload('small')).status, 200, 'its own is counted once');
  assertProblem(await upload('small', `${text}# 3\n`), 429, 'quota-exceeded');
  await d.stop();
  await d.start();
  assertProblem(await upload('small', `${text}# 3\n`), 429, 'quota-exceeded');
  assert.equal((await upload('write', `${text}# 3\n`)).status, 201);
});

test('tokens change while the daemon runs', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on', '--workers', '1'] });
  const text = shapes.obj(shapes.egg(2));
  const add = async (name, ...more) => (await run(d, 'add', name, ...more)).stdout.trim();
  const web = await add('web', '--scope', 'read,write', '--quota', '1M', '--quota-jobs', '2', '--priority', '3');
  const made = await d.post('/v1/meshes', Buffer.from(text), bearer(web));
  assert.equal(made.status, 201, 'it opens at once');
  assert.equal(made.headers.get('ratelimit-policy'), `"upload";q=1048576;qu="content-bytes"`);
  assert.equal(made.headers.get('ratelimit'), `"upload";r=${1048576 - text.length}`);
  assert.match((await run(d, 'list')).stdout, /^web read,write uploaded=\d+ quota=1048576 quota-jobs=2 priority=3\n$/);
  await assert.rejects(run(d, 'add', 'web', '--scope', 'read'), { code: 1, stderr: /already/ });
  await assert.rejects(run(d, 'set', 'nobody', '--quota', '1'), { code: 1, stderr: /token "nobody" does not exist/ });

  // Unfinished jobs count; ended ones do not.
  const meshes = [];
  for (let i = 0; i < 3; i++)
    meshes.push(
      (
        await d.post(
          '/v1/meshes',
          shapes.binaryPly(shapes.ball(5, ([x, y, z]) => [x, y * (1 + i / 9), z + 0.2 * Math.sin(6 * x)])),
          bearer(await add(`m${i}`, '--scope', 'write', '--tenant', 'web')),
        )
      ).json,
    );
  const jobs = [];
  for (const mesh of meshes.slice(0, 2))
    jobs.push((await d.post('/v1/embeddings', { mesh: mesh.id, ...endless }, bearer(web))).json);
  const third = () => d.post('/v1/embeddings', { mesh: meshes[2].id, ...endless }, bearer(web));
  assertProblem(await third(), 429, 'quota-exceeded');
  assert.equal((await d.delete(jobs[1].url, bearer(web))).status, 200);
  const again = await third();
  assert.equal(again.status, 202);

  await run(d, 'set', 'web', '--quota', '10', '--scope', 'read,write');
  assertProblem(await d.post('/v1/meshes', Buffer.from(`${text}# more\n`), bearer(web)), 429, 'quota-exceeded');
  await run(d, 'set', 'web', '--scope', 'read');
  assertProblem(await d.delete(again.json.url, bearer(web)), 403, 'forbidden');

  // A stream and a poll that are open with a token end when it is revoked.
  let ended = false; // without that, the job continues for a long time, and the wait for a minute
  const stream = d.get(`${again.json.url}/events`, bearer(web));
  const poll = d.get(again.json.url, { ...bearer(web), query: { wait: 60 } }).catch((error) => error);
  const timer = setTimeout(() => (ended = true), 45_000);
  await new Promise((done) => setTimeout(done, 300));
  await run(d, 'remove', 'web');
  assertProblem(await d.get('/v1/meshes', bearer(web)), 401, 'unauthorized');
  await Promise.all([stream, poll]);
  clearTimeout(timer);
  assert.ok(!ended, 'they end before their time');
  const admin = bearer(await add('root', '--scope', 'admin'));
  for (const job of [jobs[0], again.json]) await d.delete(job.url, admin);

  // SIGHUP reads them again as well; the commands also work while no daemon runs.
  d.child.kill('SIGHUP');
  assert.equal((await d.get('/metrics', admin)).status, 200);
  await d.stop();
  const late = await add('late', '--scope', 'read', '--quota-jobs', '1');
  await d.start();
  assert.equal((await d.get('/v1/meshes', bearer(late))).status, 200);
  assert.match((await run(d, 'list')).stdout, /^late read uploaded=0 quota=0 quota-jobs=1 priority=0$/m);
});

test('a token is valid until it expires, and the audit log names who was refused', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on'] });
  const add = async (name, ...words) => (await run(d, 'add', name, ...words)).stdout.trim();
  const day = await add('day', '--scope', 'read', '--expires', '2099-12-31');
  const past = await add('past', '--scope', 'write', '--expires', '2020-01-01', '--tenant', 'shop');
  const root = await add('root', '--scope', 'admin');
  for (const wrong of ['tomorrow', '2027-13-01', '2027-02-31', '1960-01-01', '2027-01-01x', '-1'])
    await assert.rejects(run(d, 'add', 'x', '--scope', 'read', '--expires', wrong), { code: 2 }, wrong);
  assert.match((await run(d, 'list')).stdout, /^day read .* expires=2099-12-31T00:00:00Z$/m);

  const seconds = 3 * patience * (slow ? 2 : 1);
  const soon = await add('soon', '--scope', 'read', '--expires', `${seconds}s`);
  assert.equal((await d.get('/v1/meshes', bearer(soon))).status, 200);
  assert.equal((await d.get('/v1/meshes', bearer(day))).status, 200);
  const refused = await d.post('/v1/meshes', Buffer.from('v'), bearer(past));
  assertProblem(refused, 401, 'unauthorized');
  assert.match(refused.json.detail, /^The token "past" expired at 2020-01-01T00:00:00Z\./);
  await new Promise((done) => setTimeout(done, 1000 * seconds + 100));
  assertProblem(await d.get('/v1/meshes', bearer(soon)), 401, 'unauthorized');
  await run(d, 'set', 'soon', '--expires', 'never');
  assert.equal((await d.get('/v1/meshes', bearer(soon))).status, 200);
  await d.stop();
  await d.start();
  assertProblem(await d.get('/v1/meshes', bearer(past)), 401, 'unauthorized');

  assertProblem(await d.get('/v1/meshes'), 401, 'unauthorized');
  assertProblem(await d.get('/metrics', bearer(day)), 403, 'forbidden');
  await assert.rejects(run(d, 'set', 'nobody', '--expires', 'never'));
  const webhook = (...words) => promisify(execFile)(binaries.daemon, ['webhook', ...words, '--data', d.data]);
  const { stdout: shown } = await webhook('secret', '--tenant', 'shop');
  await webhook('list');
  const crash = 'ab'.repeat(32); // an id, longer than a name
  await assert.rejects(promisify(execFile)(binaries.daemon, ['crash', 'clear', crash, '--data', d.data]));
  const { id } = (await d.post('/v1/meshes', Buffer.from(shapes.tetrahedron), bearer(root))).json;
  assert.equal((await d.delete(`/v1/meshes/${id}`, bearer(day))).status, 403);
  assert.equal((await d.request('PUT', '/v1/no"where', { headers: {} })).status, 401);
  const gone = await d.delete(`/v1/meshes/${id}`, bearer(root));
  assert.equal(gone.status, 204);
  assert.equal((await d.get('/metrics', bearer(root))).status, 200);
  assert.ok((await d.get('/readyz?verbose', bearer(root))).json.integrity);
  await d.stop();
  const lines = d.log
    .split('\n')
    .filter((line) => line.includes('"audit":'))
    .map((line) => JSON.parse(line));
  const has = (wanted) =>
    assert.ok(
      lines.some((line) => Object.entries(wanted).every(([key, value]) => line[key] === value)),
      `${JSON.stringify(wanted)}\n${JSON.stringify(lines, null, 1)}`,
    );
  const address = '127.0.0.1';
  has({ audit: 'command', message: 'token add: past' });
  has({ audit: 'command', message: 'token set: soon' });
  has({ audit: 'command', message: 'token set: nobody, failed' });
  has({ audit: 'command', message: 'webhook secret: shop' });
  has({ audit: 'command', message: `crash clear: ${crash}, failed` });
  assert.ok(!lines.some(({ message }) => /list/.test(message)) && !d.log.includes(shown.trim()));
  has({
    audit: 'refused',
    token: 'past',
    tenant: 'shop',
    address,
    status: 401,
    request: refused.headers.get('x-request-id'),
  });
  has({ audit: 'refused', token: '', address, status: 401 });
  has({ audit: 'refused', token: 'day', address, status: 403, route: '/metrics' });
  has({ audit: 'refused', token: 'day', status: 403, method: 'DELETE', id });
  has({ audit: 'refused', status: 401, method: 'PUT', route: '', id: '' });
  has({ audit: 'delete', token: 'root', tenant: 'root', id, address, request: gone.headers.get('x-request-id') });
  has({ audit: 'admin-read', token: 'root', route: '/metrics', address });
  has({ audit: 'admin-read', token: 'root', route: '/readyz', address });
  assert.ok(!lines.some(({ token, audit }) => token === 'soon' && audit !== 'refused'), 'ordinary reads are not in it');
  for (const secret of [soon, day, past, root]) assert.ok(!d.log.includes(secret));
});

test('the audit log names who gave a command, also where no daemon ran', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on'] });
  const pending = path.join(d.data, 'audit.pending');
  const webhook = (...words) => promisify(execFile)(binaries.daemon, ['webhook', ...words, '--data', d.data]);
  await run(d, 'add', 'live', '--scope', 'read');
  await d.stop();
  const before = Date.now();
  const { stdout: token } = await run(d, 'add', 'late', '--scope', 'read');
  await assert.rejects(run(d, 'set', 'nobody', '--expires', 'never'), { code: 1 });
  await run(d, 'list');
  const { stdout: secret } = await webhook('secret', '--tenant', 'shop');
  const after = Date.now();
  assert.equal((await stat(pending)).mode & 0o777, 0o600);
  const kept = await readFile(pending, 'utf8');

  // A command that could leave no record is not executed, nor one that would write to another file.
  const other = path.join(d.data, 'other');
  await writeFile(other, '');
  for (const put of [mkdir, (at) => symlink(other, at), (at) => link(other, at)]) {
    await rm(pending, { recursive: true });
    await put(pending);
    await assert.rejects(run(d, 'add', 'unseen', '--scope', 'admin'), ({ code, stdout, stderr }) => {
      return code === 1 && stdout === '' && /nothing was done: .*audit\.pending/.test(stderr);
    });
  }
  await rm(pending);
  assert.equal(await readFile(other, 'utf8'), '');
  await rm(other);
  assert.doesNotMatch((await run(d, 'list')).stdout, /unseen/);

  await writeFile(pending, `${kept}{"made":"20\n`); // half a line hides no other
  const start = d.log.length;
  await d.start();
  await assert.rejects(stat(pending), { code: 'ENOENT' });
  await d.stop();
  await d.start();
  await run(d, 'remove', 'late');
  await d.stop();
  const lines = d.log
    .split('\n')
    .filter((line) => line.includes('"audit":"command"'))
    .map((line) => JSON.parse(line));
  const { uid, username } = userInfo();
  const names = lines.map(({ message, without_daemon: alone }) => [message, alone]);
  assert.deepEqual(names, [
    ['token add: live', undefined],
    ['token add: late', true],
    ['token set: nobody, failed', true],
    ['webhook secret: shop', true],
    ['token remove: late', undefined],
  ]);
  for (const line of lines) {
    assert.deepEqual([line.level, line.uid, line.user], ['info', uid, username]);
    if (!line.without_daemon) continue;
    const made = Date.parse(line.made);
    assert.ok(before <= made && made <= after && made < Date.parse(line.time), JSON.stringify(line));
  }
  assert.match(d.log.slice(start), /audit\.pending has 1 line/);
  for (const text of [token, secret]) assert.ok(!`${kept}${d.log}`.includes(text.trim()));
});
