// Signed URLs: what a signature gives access to and for how long, keys and their limits, and the lines of
// docs/assets-by-url.md for other languages.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { createHmac } from 'node:crypto';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { signUrl } from '../../client/js/src/index.js';
import { folder, runProgram } from './support/cli.mjs';
import { assertProblem, binaries, daemon, root } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const now = () => Math.floor(Date.now() / 1000);
/** Signs as the contract describes it, without the client. */
function sign(target, { name, secret }, expires = now() + 3600) {
  const whole = `${target}${target.includes('?') ? '&' : '?'}key=${name}&expires=${expires}`;
  return `${whole}&signature=${createHmac('sha256', secret).update(whole).digest('hex')}`;
}

async function admin(d, ...words) {
  const ran = await runProgram(binaries.daemon, [...words, '--data', d.data]);
  assert.equal(ran.code, 0, ran.err);
  return ran.out;
}
async function keyOf(d, name, ...more) {
  const [, made, secret] = /^([\w.-]+):([0-9a-f]{64})\n$/.exec(await admin(d, 'key', 'add', name, ...more));
  assert.equal(made, name);
  return { name, secret };
}

/** A daemon with tokens, two meshes of the tenant "shop", and the target of their morph. */
async function shop(t, options) {
  const d = await daemon(t, { args: ['--auth', 'on', ...(options ?? [])] });
  const token = (await admin(d, 'token', 'add', 'shop', '--scope', 'read,write')).trim();
  const headers = { authorization: `Bearer ${token}` };
  const ids = [];
  for (const shape of [shapes.egg(2), shapes.bean(2)]) {
    const mesh = await d.request('POST', '/v1/meshes', { body: Buffer.from(shapes.obj(shape)), headers });
    assert.equal(mesh.status, 201);
    ids.push(mesh.json.id);
  }
  return { d, headers, ids, target: `/v1/morph.glb?shapes=${ids}&tolerance=0.05&align=rotate` };
}

test('a signed URL is served without a token, and computes what nobody has computed', async (t) => {
  const { d, target, headers } = await shop(t);
  const key = await keyOf(d, 'web', '--tenant', 'shop');
  assertProblem(await d.get(target), 401, 'unauthorized');
  const url = sign(target, key);
  const first = await d.get(url, { headers: { origin: 'https://page.example' } });
  assert.equal(first.status, 200, first.bytes.toString());
  assert.equal(first.bytes.toString('latin1', 0, 4), 'glTF');
  assert.equal(first.headers.get('access-control-allow-origin'), '*');
  const [, age] = /^public, max-age=(\d+)$/.exec(first.headers.get('cache-control'));
  assert.ok(age > 3500 && age <= 3600, `${age}: until the signature expires`);
  const again = await d.get(url);
  assert.ok(again.bytes.equals(first.bytes));
  assert.equal((await d.request('HEAD', url)).status, 200);
  assert.equal((await d.get(url, { headers: { range: 'bytes=0-3' } })).status, 206);
  // The supermesh belongs to the tenant, whose token sees it and its job.
  const [, id] = /supermeshes\/(\w+)/.exec(first.headers.get('link'));
  assert.equal((await d.get(`/v1/supermeshes/${id}`, { headers })).status, 200);
  assert.equal((await d.get('/v1/jobs', { headers })).json.jobs.length, 1);
  // Its description, asset, places and spheres can be signed, and nothing else.
  for (const more of ['', '/asset.glb', '/places', '/spheres/1.ply'])
    assert.equal((await d.get(sign(`/v1/supermeshes/${id}${more}`, key))).status, 200, more);
  for (const [method, at] of [
    ['DELETE', `/v1/supermeshes/${id}`],
    ['GET', '/v1/supermeshes'],
    ['GET', '/v1/jobs'],
    ['GET', '/metrics'],
    ['POST', '/v1/supermeshes'],
  ])
    assertProblem(await d.request(method, sign(at, key), {}), 401, 'unauthorized', `${method} ${at}`);
});

test('a changed character, another key and an expired date are refused', async (t) => {
  const { d, target } = await shop(t);
  const key = await keyOf(d, 'web', '--tenant', 'shop');
  const other = await keyOf(d, 'other', '--tenant', 'shop');
  const url = sign(target, key);
  assert.equal((await d.get(url)).status, 200);
  // Each character alone; the path decides which route it is.
  for (let i = url.indexOf('?') + 1; i < url.length; i++) {
    const c = url[i] === '0' ? '1' : '0';
    const reply = await d.get(`${url.slice(0, i)}${c}${url.slice(i + 1)}`);
    assert.ok([400, 401, 403].includes(reply.status), `${i}: ${reply.status}`);
    if (reply.status === 403) assert.equal(reply.json.type, '/problems/bad-signature', String(i));
  }
  const signature = /signature=(\w+)/.exec(url)[1];
  for (const bad of [
    sign(target, { ...key, secret: other.secret }),
    sign(target, { ...key, name: 'nobody' }),
    sign(target, { ...key, secret: key.secret.toUpperCase() }),
    sign(target, { ...key, secret: '' }),
    url.replace(signature, signature.toUpperCase()),
    url.replace(signature, signature.slice(1)),
    url.replace(signature, `${signature}0`),
    url.replace(signature, ''),
    `${url}&normals=false`,
    `${url}&signature=${signature}`,
    `${url}&`,
    url.replace('&signature', '&normals=false&signature'),
    url.replace('shapes=', 'shapes=%20'),
    url.replace('shapes', '%73hapes'),
    url.replace(/&key=\w+&expires=(\d+)/, '&expires=$1&key=web'),
    url.replace(/&expires=/, '&expires=0'),
    url.replace(/expires=\d+/, 'expires=9999999999999999999999'),
    url.replace('&key=web', ''),
  ])
    assertProblem(await d.get(bad), 403, 'bad-signature', bad);
  const late = await d.get(sign(target, key, now() - 1));
  assertProblem(late, 403, 'expired-signature');
  assert.ok(late.json.expires < now());
  assert.equal(late.headers.get('cache-control'), 'no-store');
  // The path is signed too: a signature for one supermesh does not open another.
  const [, query] = sign(`/v1/supermeshes/${'0'.repeat(64)}`, key).split('?');
  assertProblem(await d.get(`/v1/supermeshes/${'1'.repeat(64)}?${query}`), 403, 'bad-signature');
  assertProblem(await d.get(sign(`/v1/supermeshes/${'0'.repeat(64)}`, key)), 404, 'not-found');
});

test('a key names meshes of its tenant only', async (t) => {
  const { d, target } = await shop(t);
  const stranger = await keyOf(d, 'stranger');
  assertProblem(await d.get(sign(target, stranger)), 404, 'not-found');
});

test('keys are added, rotated and removed while the daemon runs', async (t) => {
  const { d, target } = await shop(t);
  const old = await keyOf(
    d,
    'web',
    '--tenant',
    'shop',
    '--origin',
    'https://a.example',
    '--origin',
    'http://b.example:1',
  );
  const url = sign(target, old);
  assert.equal((await d.get(url)).status, 200);
  const listed = await admin(d, 'key', 'list');
  assert.match(listed, /^web tenant=shop origins=https:\/\/a\.example,http:\/\/b\.example:1 requests=1/m);
  assert.ok(!listed.includes(old.secret));
  const [, secret] = /^web:(\w{64})\n$/.exec(await admin(d, 'key', 'rotate', 'web', '--overlap', '1h'));
  for (const key of [old, { ...old, secret }])
    assert.equal((await d.get(sign(target, key))).status, 200, 'both are valid for an hour');
  await admin(d, 'key', 'rotate', 'web', '--overlap', '0s');
  for (const key of [old, { ...old, secret }]) assertProblem(await d.get(sign(target, key)), 403, 'bad-signature');
  // Across a restart.
  const [, third] = /:(\w+)/.exec(await admin(d, 'key', 'rotate', 'web'));
  await d.stop();
  await d.start();
  assert.equal((await d.get(sign(target, { name: 'web', secret: third }))).status, 200);
  await admin(d, 'key', 'remove', 'web');
  assertProblem(await d.get(sign(target, { name: 'web', secret: third })), 403, 'bad-signature');
  assert.equal(await admin(d, 'key', 'list'), '');
  assert.ok(!d.log.includes(third) && !d.log.includes(secret), 'secrets are not logged');
  for (const [words, why] of [
    [['key', 'remove', 'web'], /does not exist/],
    [['key', 'rotate', 'web'], /does not exist/],
    [['key', 'add', 'a b'], /NAME must have/],
    [['key', 'add', 'x', '--origin', 'a.example'], /--origin takes/],
    [['key', 'add', 'x', '--origin', 'https://a.example/'], /--origin takes/],
    [['key', 'rotate', 'x', '--overlap', 'soon'], /--overlap takes a time such as .*, not "soon"/],
    [['key', 'sign'], /add, rotate, list or remove/],
  ]) {
    const ran = await runProgram(binaries.daemon, [...words, '--data', d.data]);
    assert.ok(ran.code > 0, words.join(' '));
    assert.match(ran.err, why);
  }
  await keyOf(d, 'twice');
  assert.match((await runProgram(binaries.daemon, ['key', 'add', 'twice', '--data', d.data])).err, /already exists/);
});

test('a page of an origin of the key may read the answer, others may not', async (t) => {
  const { d, target } = await shop(t);
  const key = await keyOf(d, 'web', '--tenant', 'shop', '--origin', 'https://a.example');
  const url = sign(target, key);
  for (const [origin, allowed] of [
    ['https://a.example', 'https://a.example'],
    ['https://b.example', null],
    [undefined, null],
  ]) {
    const headers = origin ? { origin } : {};
    for (const reply of [await d.get(url, { headers }), await d.request('OPTIONS', url, { headers })]) {
      assert.ok([200, 204].includes(reply.status));
      assert.equal(reply.headers.get('access-control-allow-origin'), allowed, String(origin));
      assert.match(reply.headers.get('vary'), /Origin/);
    }
  }
  const preflight = await d.request('OPTIONS', `${url}x`, { headers: { origin: 'https://a.example' } });
  assert.equal(preflight.headers.get('access-control-allow-origin'), null);
});

test('requests and work of a key are bounded by day', async (t) => {
  const { d, target } = await shop(t);
  const few = await keyOf(d, 'few', '--tenant', 'shop', '--requests-per-day', '3');
  for (let i = 0; i < 3; i++) assert.equal((await d.get(sign(target, few))).status, 200);
  assertProblem(await d.get(sign(target, { ...few, secret: 'x' })), 403, 'bad-signature');
  const over = await d.get(sign(target, few));
  assertProblem(over, 429, 'quota-exceeded');
  assert.equal(over.json.quota, 3);
  const wait = Number(over.headers.get('retry-after'));
  assert.ok(wait > 0 && wait <= 86400, 'until midnight UTC');
  await d.stop();
  await d.start();
  assertProblem(await d.get(sign(target, few)), 429, 'quota-exceeded', 'a restart forgets nothing');
  assert.match(await admin(d, 'key', 'list'), /^few .*requests=3\/3/m);

  // A limit of a second of work: the first morph may take longer, the next one is refused, and existing morphs are
  // still served.
  const poor = await keyOf(d, 'poor', '--tenant', 'shop', '--cpu-seconds-per-day', '1');
  const more = (tolerance) => sign(`${target.replace('0.05', tolerance)}&preset=quality`, poor);
  let refused;
  for (let i = 1; i < 200 && !refused; i++) {
    const reply = await d.get(more((0.05 / i).toFixed(6)));
    if (reply.status !== 200) refused = reply;
  }
  assertProblem(refused, 429, 'quota-exceeded');
  assert.match(refused.json.detail, /processor time/);
  assert.equal((await d.get(more('0.050000'))).status, 200);
  assert.match(await admin(d, 'key', 'list'), /^poor .*cpu-seconds=[1-9]\d*\/1/m);
});

test('without tokens a signature is checked too, and lets a foreign page in', async (t) => {
  const d = await daemon(t);
  const ids = [];
  for (const shape of [shapes.egg(2), shapes.bean(2)]) ids.push((await d.upload(shapes.obj(shape))).json.id);
  const target = `/v1/morph.glb?shapes=${ids}&tolerance=0.05&align=rotate`;
  const key = await keyOf(d, 'web', '--origin', 'https://a.example');
  const headers = { origin: 'https://a.example' };
  assertProblem(await d.get(target, { headers }), 403, 'foreign-origin');
  const reply = await d.get(sign(target, key), { headers });
  assert.deepEqual([reply.status, reply.headers.get('access-control-allow-origin')], [200, headers.origin]);
  assertProblem(await d.get(`${sign(target, key)}0`), 403, 'bad-signature');
});

test('the command line and the client sign as the daemon checks', async (t) => {
  const { d, target } = await shop(t);
  const key = await keyOf(d, 'web', '--tenant', 'shop');
  const both = `${key.name}:${key.secret}`;
  const odd = `${target}&names=${encodeURIComponent('Kätzchen & Hund')},y+z`;
  for (const at of [target, odd, d.url + target]) {
    for (const [args, env] of [
      [['--key', both, '--expires', '30d'], {}],
      [['--expires', '90m'], { ORBMORPH_KEY: both }],
    ]) {
      const ran = await runProgram(binaries.client, ['sign', at, ...args], { env: { ...process.env, ...env } });
      assert.equal(ran.code, 0, ran.err);
      assert.ok(ran.out.startsWith(at));
      assert.equal((await d.get(ran.out.trim())).status, 200, ran.out);
    }
    for (const expires of ['1h', now() + 60, new Date(Date.now() + 60_000)]) {
      const url = await signUrl(at, { key: key.name, secret: key.secret, expires });
      assert.equal((await d.get(url)).status, 200, url);
    }
  }
  // Targets that a browser would send in another form are signed in that form.
  const raw = `${target}&names=Kätzchen,a b`;
  assert.equal((await d.get(await signUrl(raw, { key: 'web', secret: key.secret, expires: '1h' }))).status, 200);
  for (const [at, args] of [
    [raw, ['--key', both, '--expires', '1d']],
    [target, ['--key', 'web', '--expires', '1d']],
    [target, ['--key', both]],
    [target, ['--key', both, '--expires', 'soon']],
    ['https://morph.example.org', ['--key', both, '--expires', '1d']],
    ['/v1/../v1/morph.glb', ['--key', both, '--expires', '1d']],
    [sign(target, key), ['--key', both, '--expires', '1d']],
  ])
    assert.equal((await runProgram(binaries.client, ['sign', at, ...args])).code, 2, at);
  for (const wrong of [{ expires: 'soon' }, { expires: 1.5 }, { secret: '' }, { key: 'a&b' }, {}])
    await assert.rejects(signUrl(target, { key: 'web', secret: 'x', expires: undefined, ...wrong }), TypeError);
  await assert.rejects(signUrl(sign(target, key), { key: 'web', secret: 'x', expires: '1d' }), TypeError);
});

const page = await readFile(path.join(root, 'docs/assets-by-url.md'), 'utf8');
const lines = (language) => new RegExp(`\`\`\`${language}\n([\\s\\S]*?)\`\`\``).exec(page)[1];
const programs = {
  python: {
    run: ['python3', 'sign.py'],
    text: (body, v) => `target, key, secret = ${JSON.stringify(v).slice(1, -1)}\n${body}\nprint(signed)\n`,
  },
  php: {
    run: ['php', 'sign.php'],
    text: (body, v) => `<?php\n[$target, $key, $secret] = ${JSON.stringify(v)};\n${body}\necho $signed;\n`,
  },
  go: {
    run: ['go', 'run', 'sign.go'],
    text: (body, v) =>
      `package main\nimport ("crypto/hmac"; "crypto/sha256"; "encoding/hex"; "fmt"; "time")\nfunc main() {\n` +
      `target, key, secret := ${JSON.stringify(v).slice(1, -1)}\n${body}\nfmt.Println(signed)\n}\n`,
  },
  ruby: {
    run: ['ruby', 'sign.rb'],
    text: (body, v) =>
      `require 'openssl'\ntarget, key, secret = ${JSON.stringify(v).slice(1, -1)}\n${body}\nputs signed\n`,
  },
};
for (const [language, { run, text }] of Object.entries(programs)) {
  const there = spawnSync(run[0], ['--version']).error === undefined;
  test(`the lines for ${language} sign`, { skip: !there && `${run[0]} is not installed` }, async (t) => {
    const { d, target } = await shop(t);
    const key = await keyOf(d, 'web', '--tenant', 'shop');
    const at = await folder(t);
    await writeFile(path.join(at, run.at(-1)), text(lines(language), [target, key.name, key.secret]));
    const ran = spawnSync(run[0], run.slice(1), { cwd: at, encoding: 'utf8' });
    assert.equal(ran.status, 0, ran.stderr);
    assert.equal((await d.get(ran.stdout.trim())).status, 200, ran.stdout);
  });
}
