// haproxy with deploy/cluster/haproxy.cfg in front of nodes.
import { spawn } from 'node:child_process';
import { mkdtemp, rm, writeFile } from 'node:fs/promises';
import net from 'node:net';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { Daemon, until } from './daemon.mjs';
import { configuration, haproxyProgram } from './haproxy_config.mjs';

export const lacksHaproxy = haproxyProgram ? false : 'haproxy is not there';

/**
 * Starts haproxy in front of nodes with these URLs, until the test ends; resolves to an object with the requests of a
 * daemon.
 */
export async function haproxy(t, urls) {
  const folder = await mkdtemp(path.join(tmpdir(), 'orbmorph-test-'));
  const file = path.join(folder, 'haproxy.cfg');
  await writeFile(file, configuration(urls, 'fd@3'));
  // haproxy gets the socket, so its port is free.
  const socket = net.createServer();
  await new Promise((done) => socket.listen(0, '127.0.0.1', done));
  const { port } = socket.address();
  const child = spawn(haproxyProgram, ['-db', '-f', file], {
    stdio: ['ignore', 'ignore', 'ignore', socket._handle.fd],
  });
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
