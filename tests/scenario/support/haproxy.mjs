// haproxy with deploy/cluster/haproxy.cfg in front of nodes.
import { spawn, spawnSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { mkdtemp, rm, writeFile } from 'node:fs/promises';
import net from 'node:net';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { Daemon, root, until } from './daemon.mjs';

const program = ['haproxy', '/usr/sbin/haproxy'].find((one) => !spawnSync(one, ['-v']).error);
export const lacksHaproxy = program ? false : 'haproxy is not there';

/** The configuration with these nodes, and with another address to bind. */
export function configuration(urls, bind) {
  return readFileSync(path.join(root, 'deploy/cluster/haproxy.cfg'), 'utf8')
    .replace(/^ {4}maxconn 16384$/m, '    maxconn 64') // each takes descriptors, of which a test may have few
    .replace(/^ {4}bind :8080$/m, `    bind ${bind}`)
    .replace(/^ {4}server-template .*$/m, urls.map((url, i) => `    server node${i} ${new URL(url).host}`).join('\n'));
}

/** Starts haproxy before nodes with these URLs, until the test ends; resolves to what asks it as one asks a daemon. */
export async function haproxy(t, urls) {
  const folder = await mkdtemp(path.join(tmpdir(), 'orbmorph-test-'));
  const file = path.join(folder, 'haproxy.cfg');
  await writeFile(file, configuration(urls, 'fd@3'));
  // haproxy gets the socket, so its port is free.
  const socket = net.createServer();
  await new Promise((done) => socket.listen(0, '127.0.0.1', done));
  const { port } = socket.address();
  const child = spawn(program, ['-db', '-f', file], { stdio: ['ignore', 'ignore', 'ignore', socket._handle.fd] });
  const ended = new Promise((done) => child.once('exit', done));
  socket.close();
  t.after(async () => {
    child.kill('SIGKILL');
    await ended;
    await rm(folder, { recursive: true, force: true });
  });
  const proxy = Object.assign(new Daemon(folder, [], {}), { url: `http://127.0.0.1:${port}` });
  await until(
    () =>
      proxy
        .get('/livez')
        .then(({ status }) => status === 200)
        .catch(() => false),
    'haproxy passes requests on',
    30,
  );
  return proxy;
}
