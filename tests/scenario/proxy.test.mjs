// Behind nginx and Caddy with the configurations of docs/deploy.md, unchanged except for addresses and folders.
import assert from 'node:assert/strict';
import { execFile, spawn, spawnSync } from 'node:child_process';
import { readFile, writeFile } from 'node:fs/promises';
import http from 'node:http';
import https from 'node:https';
import http2 from 'node:http2';
import net from 'node:net';
import path from 'node:path';
import test from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { promisify } from 'node:util';
import { signUrl } from '../../client/js/src/index.js';
import { folder } from './support/cli.mjs';
import { binaries, daemon, endless, patience, root } from './support/daemon.mjs';
import { parseGlb } from './support/glb.mjs';
import * as shapes from './support/shapes.mjs';

const page = await readFile(path.join(root, 'docs/deploy.md'), 'utf8');
const shown = (language) => new RegExp(`\`\`\`${language}\n([^]*?)\`\`\``).exec(page)[1];
const here = (program) => spawnSync(program, ['-h']).error === undefined && program;
const programs = { nginx: here('nginx') || here('/usr/sbin/nginx'), caddy: here('caddy') };

async function freePort() {
  const server = net.createServer().listen(0, '127.0.0.1');
  await new Promise((done) => server.once('listening', done));
  const { port } = server.address();
  await new Promise((done) => server.close(done));
  return port;
}

function replaced(text, pairs) {
  for (const [from, to] of pairs) {
    assert.ok(text.includes(from), `${from} is in the page`);
    text = text.replaceAll(from, to);
  }
  return text;
}

const setUps = {
  nginx: async (home, port, at, changes) => {
    const site = replaced(shown('nginx'), [
      ['127.0.0.1:8080', at],
      ['listen 443', `listen 127.0.0.1:${port}`],
      ['/etc/ssl/certs/morph.example.org.pem', `${home}/cert.pem`],
      ['/etc/ssl/private/morph.example.org.key', `${home}/key.pem`],
      ...changes,
    ]);
    const temps = ['client_body', 'proxy', 'fastcgi', 'uwsgi', 'scgi']
      .map((name) => `${name}_temp_path ${home}/${name};`)
      .join(' ');
    await writeFile(
      `${home}/nginx.conf`,
      `daemon off; pid ${home}/pid; error_log stderr; events {} http { access_log off; ${temps} ${site} }`,
    );
    return ['-p', home, '-c', `${home}/nginx.conf`];
  },
  caddy: async (home, port, at, changes) => {
    const site = replaced(shown('caddy'), [
      ['127.0.0.1:8080', at],
      ['morph.example.org {', `https://localhost:${port} {\n  tls ${home}/cert.pem ${home}/key.pem`],
      ...changes,
    ]);
    await writeFile(`${home}/Caddyfile`, `{\n  admin off\n  auto_https disable_redirects\n}\n${site}`);
    return ['run', '--adapter', 'caddyfile', '--config', `${home}/Caddyfile`];
  },
};

async function proxy(t, name, changes = []) {
  const d = await daemon(t);
  const home = await folder(t);
  const port = await freePort();
  await promisify(execFile)('openssl', [
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
    'subjectAltName=DNS:localhost',
    '-keyout',
    `${home}/key.pem`,
    '-out',
    `${home}/cert.pem`,
  ]);
  const child = spawn(programs[name], await setUps[name](home, port, new URL(d.url).host, changes), {
    stdio: ['ignore', 'ignore', 'pipe'],
    env: { ...process.env, HOME: home, XDG_DATA_HOME: home, XDG_CONFIG_HOME: home },
  });
  let log = '';
  let code = null;
  child.stderr.on('data', (chunk) => (log += chunk));
  const exited = new Promise((done) => child.once('exit', (c, signal) => done((code = c ?? signal))));
  t.after(async () => {
    child.kill('SIGTERM');
    await exited;
  });
  const ca = await readFile(`${home}/cert.pem`);
  const ask = (target, { method = 'GET', headers = {}, body, chunks, each } = {}) =>
    new Promise((resolve, reject) => {
      const r = https.request(
        `https://localhost:${port}${target}`,
        {
          method,
          headers,
          ca,
          agent: false,
          lookup: (_, o, done) =>
            o.all ? done(null, [{ address: '127.0.0.1', family: 4 }]) : done(null, '127.0.0.1', 4),
        },
        (reply) => {
          const parts = [];
          reply
            .on('data', (part) => {
              parts.push(part);
              each?.(part.toString(), r);
            })
            .on('error', reject)
            .on('end', () =>
              resolve({
                status: reply.statusCode,
                headers: reply.headers,
                bytes: Buffer.concat(parts),
                get json() {
                  return JSON.parse(this.bytes);
                },
              }),
            );
        },
      );
      r.on('error', reject).setTimeout(300_000 * patience, () => r.destroy(new Error('no answer')));
      if (chunks) for (const part of chunks) r.write(part);
      r.end(body);
    });
  for (const until = Date.now() + 120_000 * patience; ; await sleep(50)) {
    assert.ok(code === null, `${name} ended with ${code}: ${log}`);
    if ((await ask('/livez').catch(() => ({}))).status === 200) break;
    assert.ok(Date.now() < until, log);
  }
  return { d, port, ca, ask };
}

const json = (body) => ({
  method: 'POST',
  headers: { 'content-type': 'application/json' },
  body: JSON.stringify(body),
});

for (const name of Object.keys(setUps))
  test(`behind ${name}`, { skip: !programs[name] && `${name} is not installed` }, async (t) => {
    const { d, port, ca, ask } = await proxy(t, name);
    const one = shapes.obj(shapes.egg(6));
    const two = shapes.binaryPly(shapes.ball(5, ([x, y, z]) => [x * (1 + 0.3 * Math.sin(7 * y)), 1.5 * y, z]));
    assert.ok(one.length > 1 << 20);

    // Uploads with a length and in chunks.
    const a = await ask('/v1/meshes?name=egg', {
      method: 'POST',
      body: one,
      headers: { 'content-length': one.length },
    });
    assert.equal(a.status, 201, a.bytes.toString());
    const b = await ask('/v1/meshes?name=ball', {
      method: 'POST',
      headers: { 'transfer-encoding': 'chunked' },
      chunks: [two.subarray(0, 1000), two.subarray(1000)],
    });
    assert.equal(b.status, 201, b.bytes.toString());
    assert.equal(b.json.bytes, two.length);

    // The proxy holds a long poll and answers it when the job has ended; events arrive one by one, since the proxy does
    // not buffer them. The job takes longer than anyone waits, and is cancelled.
    const c = await ask('/v1/meshes?name=large', { method: 'POST', body: shapes.binaryPly(shapes.egg(5)) });
    assert.equal(c.status, 201, c.bytes.toString());
    const job = (await ask('/v1/embeddings', json({ mesh: c.json.id, ...endless }))).json;
    const began = Date.now();
    assert.equal((await ask(`${job.url}?wait=1`)).json.state, 'running');
    assert.ok(Date.now() - began >= 900);
    let seen = '';
    const stream = ask(`${job.url}/events`, { each: (text) => (seen += text) });
    for (const until = Date.now() + 120_000 * patience; !/^event: ?progress/m.test(seen); await sleep(20))
      assert.ok(Date.now() < until, 'an event comes while the job runs');
    const poll = ask(`${job.url}?wait=60`);
    assert.equal((await ask(job.url, { method: 'DELETE' })).status, 200);
    assert.equal((await poll).json.state, 'cancelled');
    assert.match((await stream).bytes.toString(), /^event: ?cancelled/m);

    // The result in ranges, with the conditions and headers of the daemon.
    const made = await ask('/v1/supermeshes', {
      ...json({ shapes: [{ mesh: a.json.id }, { mesh: b.json.id }], remesh: { method: 'adaptive', tolerance: 0.05 } }),
      headers: { 'content-type': 'application/json', prefer: 'wait=60' },
    });
    assert.ok([200, 202].includes(made.status), made.bytes.toString());
    const ended =
      made.status === 200 ? made.json : (await ask((await ask(`${made.json.url}?wait=60`)).json.result)).json;
    const whole = await ask(ended.asset);
    parseGlb(whole.bytes);
    assert.equal(whole.headers['cache-control'], 'public, max-age=31536000, immutable');
    const part = await ask(ended.asset, { headers: { range: 'bytes=0-3' } });
    assert.deepEqual([part.status, part.bytes.toString()], [206, 'glTF']);
    assert.equal((await ask(ended.asset, { headers: { 'if-none-match': whole.headers.etag } })).status, 304);
    const trace = '00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01';
    const missing = await ask(`/v1/meshes/${'0'.repeat(64)}`, { headers: { traceparent: trace } });
    assert.equal(missing.json.type, '/problems/not-found');
    assert.equal(
      (await ask('/v1/meshes', { method: 'POST', headers: { 'content-length': 600e6 } }).catch((error) => error))
        .status ?? 413,
      413,
    );

    // The operator's routes stay inside, in any spelling.
    for (const target of [
      '/metrics',
      '/%6detrics',
      '/./metrics',
      '/readyz?verbose',
      '/readyz?%76erbose=1',
      '/%72eadyz?a=1&verbose',
    ])
      assert.equal((await ask(target)).status, 404, target);
    assert.deepEqual((await ask('/readyz')).json, { status: 'ready' });
    assert.equal((await d.get('/metrics')).status, 200);

    // HTTP/2 for browsers: many requests over one connection.
    const session = http2.connect(`https://localhost:${port}`, {
      ca,
      lookup: (_, o, done) => (o.all ? done(null, [{ address: '127.0.0.1', family: 4 }]) : done(null, '127.0.0.1', 4)),
    });
    t.after(() => session.close());
    const answers = await Promise.all(
      Array.from(
        { length: 50 },
        () =>
          new Promise((resolve, reject) => {
            const r = session.request({ ':path': a.json.url });
            r.on('response', (headers) => resolve(headers[':status']))
              .on('error', reject)
              .resume()
              .end();
          }),
      ),
    );
    assert.ok(
      answers.every((status) => status === 200),
      `${answers}`,
    );
    session.close();
    assert.equal((await d.get('/livez')).status, 200);
  });

test('nginx keeps an address within its limits', { skip: !programs.nginx && 'nginx is not installed' }, async (t) => {
  const { ask } = await proxy(t, 'nginx', [
    ['rate=100r/s', 'rate=1r/s'],
    ['burst=200', 'burst=5'],
  ]);
  const answers = await Promise.all(Array.from({ length: 30 }, () => ask('/livez').then(({ status }) => status)));
  assert.ok(answers.includes(200) && answers.includes(429), `${answers}`);
  assert.ok(answers.every((status) => [200, 429].includes(status)));
});

test('nginx keeps signed morphs', { skip: !programs.nginx && 'nginx is not installed' }, async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on'] });
  const admin = async (...words) =>
    (await promisify(execFile)(binaries.daemon, [...words, '--data', d.data])).stdout.trim();
  const headers = { authorization: `Bearer ${await admin('token', 'add', 'shop', '--scope', 'read,write')}` };
  const [key, secret] = (await admin('key', 'add', 'web', '--tenant', 'shop')).split(':');
  const ids = [];
  for (const shape of [shapes.egg(2), shapes.bean(2)])
    ids.push((await d.request('POST', '/v1/meshes', { body: Buffer.from(shapes.obj(shape)), headers })).json.id);
  const page_of_assets = await readFile(path.join(root, 'docs/assets-by-url.md'), 'utf8');
  const home = await folder(t);
  const port = await freePort();
  // Its workers must be able to write the folder of the test.
  const asRoot = process.getuid() === 0 ? 'user root; ' : '';
  const [cache, location] = replaced(/```nginx\n([\s\S]*?)```/.exec(page_of_assets)[1], [
    ['127.0.0.1:8080', new URL(d.url).host],
    ['/var/cache/nginx/orbmorph', `${home}/cache`],
  ]).split(/(?=^location)/m);
  const temps = ['client_body', 'proxy', 'fastcgi', 'uwsgi', 'scgi']
    .map((name) => `${name}_temp_path ${home}/${name};`)
    .join(' ');
  await writeFile(
    `${home}/nginx.conf`,
    `${asRoot}daemon off; pid ${home}/pid; error_log stderr; events {} http { access_log off; ${temps}\n${cache}\nserver { listen 127.0.0.1:${port};\n${location} } }`,
  );
  const child = spawn(programs.nginx, ['-p', home, '-c', `${home}/nginx.conf`], {
    stdio: ['ignore', 'ignore', 'pipe'],
  });
  let log = '';
  child.stderr.on('data', (chunk) => (log += chunk));
  const exited = new Promise((done) => child.once('exit', done));
  t.after(async () => {
    child.kill('SIGTERM');
    await exited;
  });
  // Not fetch(), which chooses Accept-Encoding itself; nginx caches each coding separately.
  const ask = (target, headers) =>
    new Promise((resolve, reject) => {
      const r = http.get(`http://127.0.0.1:${port}${target}`, { headers }, (reply) => {
        const parts = [];
        reply
          .on('data', (part) => parts.push(part))
          .on('end', () => resolve({ status: reply.statusCode, headers: reply.headers, bytes: Buffer.concat(parts) }));
      });
      r.on('error', reject);
    });
  for (const until = Date.now() + 60_000 * patience; !(await ask('/').catch(() => null)); await sleep(50))
    assert.ok(Date.now() < until, log);
  const requests = async () => Number(/requests=(\d+)/.exec(await admin('key', 'list'))[1]);
  const url = await signUrl(`/v1/morph.glb?shapes=${ids}&align=rotate&tolerance=0.05`, { key, secret, expires: '1d' });
  // Many visitors at once of a morph that has not been computed: one request reaches the daemon.
  const answers = await Promise.all(Array.from({ length: 16 }, () => ask(url)));
  for (const answer of answers) {
    assert.equal(answer.status, 200, log);
    assert.ok(answer.bytes.equals(answers[0].bytes));
  }
  assert.equal(await requests(), 1);
  const part = await ask(url, { range: 'bytes=0-3' });
  assert.deepEqual([part.status, part.bytes.toString()], [206, 'glTF']);
  assert.equal((await ask(url, { 'if-none-match': answers[0].headers.etag })).status, 304);
  assert.equal(await requests(), 1, 'what is stored never reaches the daemon again');
  assert.equal((await ask(url.replace('0.05', '0.06'))).status, 403);
});
