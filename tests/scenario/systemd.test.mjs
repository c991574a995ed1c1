// Unix sockets, and systemd played by this script: it passes a socket on and receives notifications.
import assert from 'node:assert/strict';
import { execFile, spawn } from 'node:child_process';
import { chmod, lstat, mkdtemp, rm, writeFile } from 'node:fs/promises';
import http from 'node:http';
import { tmpdir } from 'node:os';
import path from 'node:path';
import test from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { promisify } from 'node:util';
import { runProgram } from './support/cli.mjs';
import { binaries, daemon, patience, samples } from './support/daemon.mjs';

async function folder(t) {
  const made = await mkdtemp(path.join(tmpdir(), 'orbmorph-test-'));
  t.after(() => rm(made, { recursive: true, force: true }));
  return made;
}

// What systemd does before it starts a service with a socket: it listens, puts the socket at descriptor 3, and tells
// this process.
const PASS = `use POSIX; use Socket; $^F = 9; my ($host, $port, $count) = splice @ARGV, 0, 3;
  socket(S, PF_INET, SOCK_STREAM, 0); setsockopt(S, SOL_SOCKET, SO_REUSEADDR, 1);
  bind(S, sockaddr_in($port, inet_aton($host))) or die "bind: $!"; $count < 0 or listen(S, 64) or die;
  POSIX::dup2(fileno(S), 3); $ENV{LISTEN_PID} = $$; $ENV{LISTEN_FDS} = abs $count; exec @ARGV`;

/** Starts orbmorphd, optionally with a socket passed on; resolves once it is ready or has ended. */
async function start(t, args, { env = {}, pass } = {}) {
  const [command, ...rest] = [...(pass ? ['perl', '-e', PASS, ...pass.map(String)] : []), binaries.daemon, ...args];
  const child = spawn(command, rest, { stdio: ['ignore', 'pipe', 'pipe'], env: { ...process.env, ...env } });
  const made = { child, out: '', log: '' };
  made.exited = new Promise((resolve) => child.once('exit', (code, signal) => resolve({ code, signal })));
  t.after(async () => {
    child.kill('SIGKILL');
    await made.exited;
  });
  child.stderr.on('data', (chunk) => (made.log += chunk));
  const ready = new Promise((resolve) =>
    child.stdout.on('data', (chunk) => (made.out += chunk).includes('\n') && resolve()),
  );
  await Promise.race([ready, made.exited]);
  return made;
}

function get(options) {
  return new Promise((resolve, reject) => {
    const r = http.get({ path: '/v1/meshes', ...options }, (reply) => {
      let text = '';
      reply.on('data', (chunk) => (text += chunk)).on('end', () => resolve({ status: reply.statusCode, text }));
    });
    r.on('error', reject).setTimeout(120_000 * patience, () => r.destroy(new Error('no answer')));
  });
}

test('a Unix socket', async (t) => {
  const home = await folder(t);
  const at = path.join(home, 'http.sock');
  const data = path.join(home, 'data');
  const args = ['--listen', `unix:${at}`, '--data', data];
  let d = await start(t, [...args, '--socket-mode', '0600']);
  assert.equal(d.out, `orbmorphd listening on unix:${at}\n`, d.log);
  assert.equal((await lstat(at)).mode & 0o777, 0o600);
  assert.equal((await get({ socketPath: at })).status, 200, 'no token is needed');
  const second = await start(t, ['--listen', `unix:${at}`, '--data', path.join(home, 'other')]);
  assert.equal((await second.exited).code, 1);
  assert.match(second.log, /another process listens/);
  assert.equal((await get({ socketPath: at })).status, 200, 'the first one goes on');
  // The socket file of a killed daemon does not stop the next one.
  d.child.kill('SIGKILL');
  await d.exited;
  assert.ok((await lstat(at)).isSocket());
  d = await start(t, args);
  assert.equal((await lstat(at)).mode & 0o777, 0o660);
  assert.equal((await get({ socketPath: at })).status, 200);
  // The command line reaches it with any proxy in the environment.
  const client = (...args) => runProgram(binaries.client, [...args], { env: { http_proxy: 'http://127.0.0.1:9' } });
  const ran = await client('upload', '-s', `unix:${at}`, path.join(samples, 'dog.obj'));
  assert.equal(ran.code, 0, ran.err);
  assert.match((await client('-s', `unix:${at}`, 'ls')).out, /dog/);
  const away = await client('-s', `unix:${at}x`, 'ls');
  assert.equal(away.code, 3);
  assert.ok(away.err.includes(`unix:${at}x`), away.err);
  d.child.kill('SIGTERM');
  assert.equal((await d.exited).code, 0, d.log);
  await assert.rejects(lstat(at), { code: 'ENOENT' }, 'it is removed at the end');

  await writeFile(at, 'precious');
  d = await start(t, args);
  assert.equal((await d.exited).code, 1);
  assert.match(d.log, /is not a socket/);
  assert.ok((await lstat(at)).isFile());
  for (const [listen, why, status] of [
    [`unix:${'x'.repeat(200)}`, /1 to 107 bytes/, 1],
    ['unix:', /unix:PATH/, 2],
    ['127.0.0.1', /ADDR:PORT/, 2],
    ['127.0.0.1:http?', /ADDR:PORT/, 2],
    ['nowhere.invalid:80', /cannot listen/, 1],
  ]) {
    d = await start(t, ['--listen', listen, '--data', data]);
    assert.equal((await d.exited).code, status, listen);
    assert.match(d.log, why);
  }
  d = await start(t, [...args, '--socket-mode', '0999']);
  assert.equal((await d.exited).code, 2);
});

test('a socket that systemd passes', async (t) => {
  const data = await folder(t);
  let port = 0;
  for (let round = 0; round < 2; round++) {
    const d = await start(t, ['--data', data], { pass: ['127.0.0.1', port, 1] });
    port = Number(/^orbmorphd listening on http:\/\/127\.0\.0\.1:(\d+)\n$/.exec(d.out)?.[1]);
    assert.ok(port > 0, d.out + d.log);
    assert.equal((await get({ port, agent: false })).status, 200);
    d.child.kill('SIGTERM');
    assert.equal((await d.exited).code, 0, d.log);
  }
  for (const [count, why] of [
    [2, /passed 2 sockets/],
    [-1, /not a listening stream socket/],
  ]) {
    const d = await start(t, ['--data', data], { pass: ['127.0.0.1', 0, count] });
    assert.equal((await d.exited).code, 1);
    assert.match(d.log, why);
  }
  // Variables for another process: the daemon ignores them.
  const d = await start(t, ['--data', data, '--listen', '127.0.0.1:0'], { env: { LISTEN_PID: '1', LISTEN_FDS: '1' } });
  assert.match(d.out, /listening/, d.log);
});

test('a passed socket that others can reach needs tokens', async (t) => {
  const d = await start(t, ['--data', await folder(t), '--listen', '127.0.0.1:8080'], { pass: ['0.0.0.0', 0, 1] });
  const port = Number(/^orbmorphd listening on http:\/\/0\.0\.0\.0:(\d+)\n$/.exec(d.out)?.[1]);
  assert.match(d.log, /tokens are needed but none exist/);
  assert.equal((await get({ port, agent: false })).status, 401);
});

test('systemd is notified of start, reload, watchdog and stop', async (t) => {
  const home = await folder(t);
  const at = path.join(home, 'notify');
  const log = [];
  const take = `use Socket; $| = 1; socket(S, PF_UNIX, SOCK_DGRAM, 0); bind(S, sockaddr_un($ARGV[0])) or die; print "up\\n";
    while (defined recv(S, $b, 4096, 0)) { print map { "$_\\n" } split /\\n/, $b }`;
  const taker = spawn('perl', ['-e', take, at], { stdio: ['ignore', 'pipe', 'inherit'] });
  t.after(() => taker.kill());
  taker.stdout.on('data', (chunk) => log.push(...chunk.toString().split('\n').filter(Boolean)));
  const told = async (wanted, times = 1) => {
    for (
      const until = Date.now() + 120_000 * patience;
      log.filter((line) => wanted.test(line)).length < times;
      await sleep(20)
    )
      assert.ok(Date.now() < until, `${wanted}: ${log}`);
  };
  await told(/^up$/);
  const file = path.join(home, 'conf');
  await writeFile(file, 'queue-limit = 5\n');
  const d = await start(t, ['--data', path.join(home, 'data'), '--listen', '127.0.0.1:0', '--config', file], {
    env: { NOTIFY_SOCKET: at, WATCHDOG_USEC: '200000' },
  });
  await told(/^READY=1$/);
  await told(/^WATCHDOG=1$/, 5);
  d.child.kill('SIGHUP');
  await told(/^READY=1$/, 2);
  const begun = log.indexOf('RELOADING=1');
  assert.ok(begun > 0 && begun < log.lastIndexOf('READY=1'), log.join());
  assert.match(log[begun + 1], /^MONOTONIC_USEC=\d+$/);
  d.child.kill('SIGTERM');
  assert.equal((await d.exited).code, 0);
  await told(/^STOPPING=1$/);
});

test('the daemon does not use the data folder of another process', async (t) => {
  const d = await daemon(t);
  const second = await start(t, ['--data', d.data, '--listen', '127.0.0.1:0']);
  assert.equal((await second.exited).code, 1);
  assert.match(second.log, /in use by another process/);
  await chmod(d.data, 0o700);
  assert.equal((await promisify(execFile)(binaries.daemon, ['--check-config'])).stdout, 'the configuration is valid\n');
});
