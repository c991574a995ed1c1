// The files of deploy/, checked by the tools that read them: systemd scores the unit, Prometheus checks the metrics.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { folder } from './support/cli.mjs';
import { binaries, daemon, root, slow } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const lacks = (program) => spawnSync(program, ['--version']).error !== undefined && `${program} is not installed`;
const run = (program, args, input) => {
  const { status, stdout, stderr } = spawnSync(program, args, { input, encoding: 'utf8' });
  return { status, text: stdout + stderr };
};

test('the unit is sandboxed', { skip: lacks('systemd-analyze') }, () => {
  const unit = path.join(root, 'deploy/orbmorphd.service');
  const { text } = run('systemd-analyze', ['security', '--offline=true', '--no-pager', unit]);
  const score = Number(/Overall exposure level for orbmorphd\.service: (\d+\.\d+)/.exec(text)?.[1]);
  assert.ok(score < 2, text);
  // 20: worse than that would be refused.
  assert.equal(run('systemd-analyze', ['security', '--offline=true', '--no-pager', '--threshold=20', unit]).status, 0);
  const verified = run('systemd-analyze', ['verify', unit, path.join(root, 'deploy/orbmorphd.socket')]).text;
  assert.doesNotMatch(verified, /Unknown|Failed to parse|Invalid|ignoring/i);
  assert.match(readFileSync(unit, 'utf8'), /^StartLimitBurst=\d+$[\s\S]*^MemoryMax=\d+%$/m);
});

test('the programs are hardened', {
  skip: (slow && 'sanitizers take the place of hardening') || lacks('readelf'),
}, () => {
  for (const program of [binaries.daemon, binaries.client]) {
    const read = (...args) => run('readelf', [...args, '--wide', program]).text;
    assert.match(read('--file-header'), /Type:\s+DYN/, 'position-independent');
    const dynamic = read('--dynamic');
    assert.match(dynamic, /FLAGS_1.*NOW.*PIE/, 'all symbols are bound at the start');
    assert.match(read('--segments'), /GNU_RELRO/, 'and then read-only');
    assert.match(read('--segments'), /GNU_STACK.* RW /, 'the stack is not executable');
    const symbols = read('--dyn-syms');
    assert.match(symbols, /__stack_chk_fail@/, 'stack protector');
    assert.match(symbols, /__(snprintf|vsnprintf|memcpy)_chk@/, 'fortified calls');
  }
});

test('the unit denies what the daemon refuses: all but public addresses', async () => {
  const unit = await readFile(path.join(root, 'deploy/orbmorphd.service'), 'utf8');
  const source = await readFile(path.join(root, 'server/net/networks.c'), 'utf8');
  const denied = [...unit.matchAll(/^IPAddressDeny=(.*)$/gm)].flatMap(([, list]) => list.split(' '));
  const refused = [...source.matchAll(/"([0-9a-f.:]+\/\d+),?"/g)].map(([, network]) => network);
  assert.ok(refused.length > 15, refused.join());
  // Of IPv6 the daemon takes 2000::/3 without exceptions; the rest are three networks.
  const others = ['::/3', '4000::/2', '8000::/1'];
  assert.deepEqual(denied.toSorted(), [...refused.filter((network) => network !== '2000::/3'), ...others].toSorted());
  assert.match(unit, /^IPAddressAllow=localhost$/m);
});

test('Prometheus takes the metrics, and the queries of the dashboard', { skip: lacks('promtool') }, async (t) => {
  const d = await daemon(t);
  await d.made('/v1/embeddings', { mesh: (await d.upload(shapes.obj(shapes.egg(2)))).json.id });
  const metrics = run('promtool', ['check', 'metrics'], (await d.get('/metrics')).bytes.toString());
  assert.equal(metrics.status, 0, metrics.text);
  const { panels } = JSON.parse(await readFile(path.join(root, 'deploy/grafana/orbmorph.json'), 'utf8'));
  const queries = panels.flatMap(({ targets }) => targets.map(({ expr }) => expr.replaceAll('$__rate_interval', '5m')));
  assert.ok(queries.length > 10);
  const file = path.join(await folder(t), 'rules.yml');
  await writeFile(
    file,
    JSON.stringify({
      groups: [{ name: 'dashboard', rules: queries.map((expr, i) => ({ record: `query:${i}`, expr })) }],
    }),
  );
  const rules = run('promtool', ['check', 'rules', file]);
  assert.equal(rules.status, 0, rules.text);
  assert.match(rules.text, new RegExp(`${queries.length} rules`));
});
