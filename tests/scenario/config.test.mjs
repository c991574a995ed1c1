// The daemon refuses a configuration that cannot work before it uses it, and says what to change.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { existsSync, mkdtempSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';
import test from 'node:test';
import { binaries } from './support/daemon.mjs';

const check = (...args) => spawnSync(binaries.daemon, ['--check-config', ...args], { encoding: 'utf8' });

test('values that no daemon can use are refused by name', () => {
  for (const [name, values] of Object.entries({
    listen: [
      '127.0.0.1:65536',
      '127.0.0.1:99999',
      '127.0.0.1:',
      '127.0.0.1',
      '127.0.0.1:http',
      '127.0.0.1:-1',
      'unix:',
    ],
    'log-level': ['verbose', 'INFO', ''],
    'log-format': ['xml', 'JSON'],
    cors: ['https://a.example/', 'a.example', '*, https://a.example', 'https://a.example, b', '://x', 'https://'],
    'tls-key': ['/nowhere/key.pem'],
    limits: ['some'],
    auth: ['maybe'],
    role: ['both', 'serve', 'work'], // the last two only among nodes that share a catalogue
    'socket-mode': ['0999', '1777', 'rw'],
  }))
    for (const value of values) {
      const { status, stderr } = check(
        `--${name}`,
        value,
        ...(name === 'tls-key' ? ['--tls-certificate', binaries.daemon] : []),
      );
      assert.equal(status, 2, `${name} = ${value}`);
      assert.match(stderr, new RegExp(`^orbmorphd: ${name}\\b`), `${name} = ${value}`);
    }
  for (const args of [
    ['--listen', '127.0.0.1:65535'],
    ['--listen', '[::1]:0'],
    ['--listen', ':8080'],
    ['--listen', 'unix:/tmp/x'],
    ['--role', 'work', '--catalogue', 'postgresql:///x', '--objects', 's3://bucket'],
    ['--cors', '*'],
    ['--cors', 'https://a.example,http://localhost:5173, null'],
    ['--cors', ''],
    ['--log-level', 'warn', '--log-format', 'text'],
  ])
    assert.equal(check(...args).status, 0, args.join(' '));
});

test('refusals name the option, the value and what it takes', () => {
  for (const [args, why] of [
    [['--check-config', '--workers', '300'], /workers must be 0 or a number from 1 to 256, not "300"/],
    [['token', 'set', 'x', '--quota', '12X'], /--quota takes a number of bytes.*, not "12X"/],
    [['token', 'set', 'x', '--quota'], /--quota needs a value/],
  ]) {
    const { status, stderr } = spawnSync(binaries.daemon, args, { encoding: 'utf8' });
    assert.equal(status, 2, args.join(' '));
    assert.match(stderr, why);
  }
});

test('commands about what is stored make no data folder', (t) => {
  const folder = mkdtempSync(path.join(tmpdir(), 'orbmorph-test-'));
  t.after(() => rmSync(folder, { recursive: true }));
  for (const data of [folder, path.join(folder, 'typo')])
    for (const command of [['--check-data'], ['--gc'], ['token', 'list'], ['key', 'remove', 'x'], ['crash', 'list']]) {
      const { status, stderr } = spawnSync(binaries.daemon, [...command, '--data', data], { encoding: 'utf8' });
      assert.equal(status, 78, command.join(' '));
      assert.match(stderr, /is no data folder.*--data/);
    }
  assert.deepEqual([readdirSync(folder), existsSync(path.join(folder, 'typo'))], [[], false]);
});

test('a line of the file without a value is refused', (t) => {
  const folder = mkdtempSync(path.join(tmpdir(), 'orbmorph-test-'));
  t.after(() => rmSync(folder, { recursive: true }));
  const file = path.join(folder, 'conf');
  writeFileSync(file, '# a comment\nmax-body = 1M\nworkers 2\n');
  const { status, stderr } = check('--config', file);
  assert.deepEqual(
    [status, stderr],
    [2, 'orbmorphd: config file, line 3: a line must be NAME = VALUE, not "workers 2"\n'],
  );
});
