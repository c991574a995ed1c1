// The service over TLS, with a certificate made here.
import assert from 'node:assert/strict';
import { execFile, spawn } from 'node:child_process';
import { readFile, writeFile } from 'node:fs/promises';
import http from 'node:http';
import https from 'node:https';
import path from 'node:path';
import test from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import tls from 'node:tls';
import { promisify } from 'node:util';
import { folder } from './support/cli.mjs';
import { binaries, patience } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const exec = promisify(execFile);

async function certificate(t) {
  const home = await folder(t);
  const at = (name) => path.join(home, name);
  await exec('openssl', [
    'req',
    '-x509',
    '-newkey',
    'ec',
    '-pkeyopt',
    'ec_paramgen_curve:prime256v1',
    '-nodes',
    '-days',
    '2',
    '-subj',
    '/CN=localhost',
    '-addext',
    'subjectAltName=IP:127.0.0.1,DNS:localhost',
    '-keyout',
    at('key.pem'),
    '-out',
    at('cert.pem'),
  ]);
  return { home, key: at('key.pem'), file: at('cert.pem'), ca: await readFile(at('cert.pem')) };
}

/** Starts the daemon; resolves to the line that it prints, or to its end. */
async function start(t, data, ...args) {
  const child = spawn(binaries.daemon, ['--listen', '127.0.0.1:0', '--data', data, ...args], {
    stdio: ['ignore', 'pipe', 'pipe'],
  });
  const made = { child, out: '', log: '' };
  made.exited = new Promise((resolve) => child.once('exit', (code, signal) => resolve(code ?? signal)));
  t.after(async () => {
    child.kill('SIGKILL');
    await made.exited;
  });
  child.stderr.on('data', (chunk) => (made.log += chunk));
  await Promise.race([
    made.exited,
    new Promise((resolve) => child.stdout.on('data', (chunk) => (made.out += chunk).includes('\n') && resolve())),
  ]);
  made.url = /^orbmorphd listening on (\S+)\n/m.exec(made.out)?.[1];
  return made;
}

const send = (url, target, { method = 'GET', body, ...options } = {}) =>
  new Promise((resolve, reject) => {
    const r = https.request(new URL(target, url), { method, agent: false, ...options }, (reply) => {
      const parts = [];
      reply
        .on('data', (part) => parts.push(part))
        .on('end', () => resolve({ status: reply.statusCode, bytes: Buffer.concat(parts) }));
    });
    r.on('error', reject).setTimeout(300_000 * patience, () => r.destroy(new Error('no answer')));
    r.end(body);
  });

test('a morph over TLS', async (t) => {
  const { home, key, file, ca } = await certificate(t);
  const d = await start(t, path.join(home, 'data'), '--tls-certificate', file, '--tls-key', key);
  assert.match(d.url ?? '', /^https:\/\/127\.0\.0\.1:\d+$/, d.log);
  const live = await send(d.url, '/livez', { ca });
  assert.equal(live.status, 200);
  await assert.rejects(send(d.url, '/livez'), { code: 'DEPTH_ZERO_SELF_SIGNED_CERT' });

  // Upload and download: several records of TLS, and a range.
  const text = shapes.obj(shapes.egg(6));
  assert.ok(text.length > 1 << 20);
  const { status, bytes } = await send(d.url, '/v1/meshes', { ca, method: 'POST', body: text });
  assert.equal(status, 201, bytes.toString());
  const mesh = JSON.parse(bytes);
  assert.equal((await send(d.url, `${mesh.url}/file`, { ca })).bytes.toString(), text);
  const part = await send(d.url, `${mesh.url}/file`, { ca, headers: { range: 'bytes=100000-299999' } });
  assert.deepEqual([part.status, part.bytes.toString()], [206, text.slice(100_000, 300_000)]);
  const small = JSON.parse(
    (await send(d.url, '/v1/meshes', { ca, method: 'POST', body: shapes.obj(shapes.bean(3)) })).bytes,
  );
  const made = await send(d.url, '/v1/embeddings', {
    ca,
    method: 'POST',
    body: JSON.stringify({ mesh: small.id }),
    headers: { 'content-type': 'application/json', prefer: 'wait=60' },
  });
  assert.equal(made.status, 200, made.bytes.toString());
  assert.equal(JSON.parse(made.bytes).certificate.valid, true);

  // Plain HTTP gets no answer there, and neither does TLS before 1.2; neither harms the daemon.
  await assert.rejects(
    new Promise((resolve, reject) =>
      http.get(d.url.replace('https', 'http'), { agent: false }, resolve).on('error', reject),
    ),
  );
  const speaks = (version) =>
    new Promise((resolve, reject) => {
      const socket = tls.connect(
        {
          port: Number(new URL(d.url).port),
          host: '127.0.0.1',
          ca,
          minVersion: version,
          maxVersion: version,
          ciphers: 'ALL:@SECLEVEL=0',
        },
        () => resolve(socket.destroy()),
      );
      socket.on('error', reject).on('end', () => reject(new Error('closed')));
    });
  for (const version of ['TLSv1.2', 'TLSv1.3']) await speaks(version);
  for (const version of ['TLSv1', 'TLSv1.1']) await assert.rejects(speaks(version), undefined, version);
  // A malformed request gets one answer, over TLS too.
  const raw = (request) =>
    new Promise((resolve, reject) => {
      let text = '';
      const socket = tls.connect({ port: Number(new URL(d.url).port), host: '127.0.0.1', ca }, () =>
        socket.write(request),
      );
      socket.on('data', (bytes) => (text += bytes));
      socket.on('error', reject).on('close', () => resolve(text));
    });
  const reply = await raw('GET /livez HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n');
  assert.match(reply, /^HTTP\/1\.1 400 /);
  assert.equal(reply.split('HTTP/1.1').length, 2, reply);
  const many = Array.from({ length: 250 }, (_, i) => `a${i}=1`).join('&');
  for (const [query, header, status, type] of [
    [many, '', 414, 'uri-too-long'],
    [`a=${'x'.repeat(12_000)}`, '', 414, 'uri-too-long'],
    [`a=${'x'.repeat(16_200)}`, '', 414, 'uri-too-long'],
    ['limit=1', `X-Long: ${'z'.repeat(15_500)}\r\n`, 431, 'headers-too-large'],
  ]) {
    const text = await raw(`GET /v1/meshes?${query} HTTP/1.1\r\nHost: localhost\r\n${header}\r\n`);
    assert.ok(text.startsWith(`HTTP/1.1 ${status} `), `${status}: ${text}`);
    assert.match(text, new RegExp(`"type":"/problems/${type}"`));
    assert.equal(text.split('HTTP/1.1').length, 2, text);
  }
  assert.equal((await send(d.url, '/readyz', { ca })).status, 200);
  d.child.kill('SIGTERM');
  assert.equal(await d.exited, 0, d.log);
});

test('SIGHUP reads a renewed certificate, and keeps the old one where the new one is not valid', async (t) => {
  const { home, key, file, ca } = await certificate(t);
  const renewed = await certificate(t);
  const d = await start(t, path.join(home, 'data'), '--tls-certificate', file, '--tls-key', key);
  const hangUp = async (logged) => {
    const before = d.log.length;
    d.child.kill('SIGHUP');
    for (const end = Date.now() + 20_000 * patience; !logged.test(d.log.slice(before)); await sleep(20))
      assert.ok(Date.now() < end, d.log);
  };
  const agent = new https.Agent({ keepAlive: true, ca });
  t.after(() => agent.destroy());
  assert.equal((await send(d.url, '/livez', { agent })).status, 200);

  await writeFile(file, renewed.ca); // its key does not exist yet
  await hangUp(/the previous certificate stays in use/);
  assert.equal((await send(d.url, '/livez', { ca })).status, 200);

  await writeFile(key, await readFile(renewed.key));
  await hangUp(/the configuration was read again/);
  assert.equal((await send(d.url, '/livez', { ca: renewed.ca })).status, 200);
  await assert.rejects(send(d.url, '/livez', { ca }), { code: 'DEPTH_ZERO_SELF_SIGNED_CERT' });
  assert.equal((await send(d.url, '/livez', { agent })).status, 200, 'an open connection goes on');
  await hangUp(/the configuration was read again/); // nothing new
  assert.equal((await send(d.url, '/livez', { ca: renewed.ca })).status, 200);
  d.child.kill('SIGTERM');
  assert.equal(await d.exited, 0, d.log);
});

test('the daemon does not start without a valid certificate', async (t) => {
  const { home, key, file } = await certificate(t);
  const data = path.join(home, 'data');
  const broken = path.join(home, 'broken.pem');
  await writeFile(broken, '-----BEGIN CERTIFICATE-----\nno\n-----END CERTIFICATE-----\n');
  for (const args of [
    ['--tls-certificate', file],
    ['--tls-key', key],
    ['--tls-certificate', path.join(home, 'none'), '--tls-key', key],
    ['--tls-certificate', broken, '--tls-key', key],
    ['--tls-certificate', file, '--tls-key', broken],
  ]) {
    const d = await start(t, data, ...args);
    assert.equal(d.url, undefined, args.join(' '));
    assert.ok([1, 2].includes(await d.exited), `${args}: ${await d.exited}`);
    assert.match(
      d.log,
      /tls-certificate and tls-key must both be set|cannot be read|are not a certificate and its key/,
      args.join(' '),
    );
  }
});
