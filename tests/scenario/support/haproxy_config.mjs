// deploy/cluster/haproxy.cfg for tests.
import { spawnSync } from 'node:child_process';
import { readFileSync } from 'node:fs';

/** undefined if it does not exist. */
export const haproxyProgram = ['haproxy', '/usr/sbin/haproxy'].find((one) => !spawnSync(one, ['-v']).error);

/** The configuration with these nodes, and with another address to bind. */
export function configuration(urls, bind, connections = 64) {
  return readFileSync(new URL('../../../deploy/cluster/haproxy.cfg', import.meta.url), 'utf8')
    .replace(/^ {4}maxconn 16384$/m, `    maxconn ${connections}`) // each uses descriptors, of which a test may have few
    .replace(/^ {4}bind :8080$/m, `    bind ${bind}`)
    .replace(/^ {4}server-template .*$/m, urls.map((url, i) => `    server node${i} ${new URL(url).host}`).join('\n'));
}
