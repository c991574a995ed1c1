#!/usr/bin/env node
// Stands for orbmorphd where the scenarios run on several nodes: three daemons on one catalogue in PostgreSQL and one
// bucket of S3, behind haproxy with deploy/cluster/haproxy.cfg. Runs within with_postgresql.sh and with_s3.sh.
//
// A start of the daemon starts all four, each node with a folder of its own below --data; the workers are spread over the
// nodes. It prints the line of one daemon with haproxy's address, and ends when all nodes have ended. Any other command
// runs with the same catalogue and bucket, and with another folder.
import { execFileSync, spawn, spawnSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { mkdirSync, writeFileSync } from 'node:fs';
import { availableParallelism } from 'node:os';
import path from 'node:path';
import net from 'node:net';
import { configuration, haproxyProgram } from '../scenario/support/haproxy_config.mjs';

const NODES = 3;
const program = process.env.ORB_DAEMON;
const args = process.argv.slice(2);
const at = args.indexOf('--data');
const env = { ...process.env };
if (at >= 0) {
  const data = args[at + 1];
  env.ORBMORPH_CATALOGUE = execFileSync(process.env.ORB_NEW_CATALOGUE, [data], { encoding: 'utf8' });
  const prefix = createHash('sha1').update(data).digest('hex').slice(0, 24);
  env.ORBMORPH_OBJECTS = `s3://objects/${prefix}?endpoint=${process.env.ORB_S3}`;
}

function folder(name) {
  const made = path.join(args[at + 1], name);
  mkdirSync(made, { recursive: true, mode: 0o700 });
  return made;
}

if (!args.includes('--listen')) {
  const given = at < 0 ? args : args.with(at + 1, folder('command'));
  const { status, signal } = spawnSync(program, given, { stdio: 'inherit', env });
  process.exit(signal ? 1 : status);
}

const workersAt = args.indexOf('--workers');
const workers = workersAt < 0 ? availableParallelism() : Number(args[workersAt + 1]);
const children = [];

/** Starts a node that ends with this process; resolves to its URL. */
function start(i) {
  const own = Math.floor(workers / NODES) + (i < workers % NODES);
  const given = args.with(at + 1, folder(`node${i}`));
  if (workersAt >= 0) given.splice(workersAt, 2);
  given.push(...(own ? ['--workers', `${own}`] : ['--role', 'serve']));
  const child = spawn('setpriv', ['--pdeathsig', 'KILL', program, ...given], {
    env,
    stdio: ['ignore', 'pipe', 'inherit'],
  });
  const ended = new Promise((resolve) => child.once('exit', (code, signal) => resolve(signal ? 1 : code)));
  children.push({ child, ended });
  let out = '';
  return new Promise((resolve, reject) => {
    ended.then((code) => reject(code));
    child.stdout.on('data', (chunk) => {
      out += chunk;
      const found = /listening on (http:\/\/\S+)\n/.exec(out);
      if (found) resolve(found[1]);
    });
  });
}

async function end() {
  for (const { child } of children) child.kill('SIGTERM');
  const codes = await Promise.all(children.map(({ ended }) => ended));
  process.exit(Math.max(...codes));
}
for (const signal of ['SIGTERM', 'SIGINT']) process.on(signal, end);

try {
  const urls = [await start(0)]; // this one migrates the schema
  urls.push(...(await Promise.all([start(1), start(2)])));
  // A single client sends requests here, without pauses; and tests read what haproxy hides from strangers.
  const text = configuration(urls, 'fd@3', 1024)
    .replace(/^ {4}(http-request return|tcp-request connection reject).*\n/gm, '')
    .replace('balance leastconn', 'balance roundrobin');
  const file = path.join(args[at + 1], 'haproxy.cfg');
  writeFileSync(file, text);
  const socket = net.createServer();
  await new Promise((done) => socket.listen(0, '127.0.0.1', done));
  const { port } = socket.address();
  const handle = socket._handle.fd;
  const proxy = spawn('setpriv', ['--pdeathsig', 'KILL', haproxyProgram, '-db', '-f', file], {
    stdio: ['ignore', 'ignore', 'ignore', handle],
  });
  proxy.once('exit', () => process.exit(1));
  socket.close();
  for (;;) {
    const answer = await fetch(`http://127.0.0.1:${port}/livez`).catch(() => ({ status: 0, arrayBuffer() {} }));
    await answer.arrayBuffer();
    if (answer.status === 200) break;
    await new Promise((done) => setTimeout(done, 20));
  }
  process.stdout.write(`orbmorphd listening on http://127.0.0.1:${port}\n`);
} catch (code) {
  for (const { child } of children) child.kill('SIGKILL');
  process.exit(typeof code === 'number' ? code : 1);
}
