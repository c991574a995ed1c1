// The files of deploy/, checked by the tools that read them: systemd scores the unit, Prometheus checks the metrics.
import assert from 'node:assert/strict';
import { spawn, spawnSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, symlinkSync, writeFileSync } from 'node:fs';
import { readFile, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import test from 'node:test';
import parsers from '@stoplight/spectral-parsers';
import { folder } from './support/cli.mjs';
import { binaries, daemon, root, slow, until } from './support/daemon.mjs';
import { configuration } from './support/haproxy_config.mjs';
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
  assert.ok(score <= 1.0, text);
  // The drop-in opens only public addresses.
  const open = path.join(mkdtempSync(path.join(tmpdir(), 'orbmorph-unit-')), 'orbmorphd.service');
  const own = readFileSync(path.join(root, 'deploy/outgoing.conf'), 'utf8').split('[Service]\n')[1];
  writeFileSync(open, readFileSync(unit, 'utf8').replace(/^\[Install\]$/m, `${own}\n$&`));
  assert.match(run('systemd-analyze', ['security', '--offline=true', '--no-pager', open]).text, /level for .*: 1\.2 /);
  assert.doesNotMatch(run('systemd-analyze', ['verify', open]).text, /Unknown|Failed to parse|Invalid|ignoring/i);
  rmSync(path.dirname(open), { recursive: true });
  // 20: systemd-analyze refuses a worse score.
  assert.equal(run('systemd-analyze', ['security', '--offline=true', '--no-pager', '--threshold=20', unit]).status, 0);
  const verified = run('systemd-analyze', ['verify', unit, path.join(root, 'deploy/orbmorphd.socket')]).text;
  assert.doesNotMatch(verified, /Unknown|Failed to parse|Invalid|ignoring/i);
  assert.match(readFileSync(unit, 'utf8'), /^StartLimitBurst=\d+$[\s\S]*^MemoryMax=\d+%$/m);
});

test('the units by role have the sandbox of the single daemon', { skip: lacks('systemd-analyze') }, () => {
  const single = readFileSync(path.join(root, 'deploy/orbmorphd.service'), 'utf8');
  const template = path.join(root, 'deploy/cluster/orbmorphd@.service');
  const text = readFileSync(template, 'utf8');
  const sandbox = (unit) => /^# Sandbox:[\s\S]*^SystemCallFilter=.*$/m.exec(unit)[0];
  assert.equal(sandbox(text), sandbox(single));
  const [, most] = /^TimeoutStopSec=(\d+)$/m.exec(text);
  const [, drains] = /^drain-seconds = (\d+)$/m.exec(cluster('work.conf'));
  assert.ok(Number(most) > Number(drains));
  const place = mkdtempSync(path.join(tmpdir(), 'orbmorph-unit-'));
  const program = path.join(place, 'orbmorphd'); // the build may lie in a folder with a blank
  symlinkSync(binaries.daemon, program);
  writeFileSync(path.join(place, 's3-keys'), 'aws_access_key_id = a\naws_secret_access_key = b\n');
  for (const role of ['serve', 'work']) {
    const unit = path.join(place, `orbmorphd@${role}.service`);
    writeFileSync(unit, text.replace('/usr/bin/orbmorphd', program));
    const verified = run('systemd-analyze', ['verify', '--man=no', unit]);
    assert.deepEqual([verified.status, verified.text], [0, '']);
    // What systemd makes of %i is a command that the daemon takes.
    const [, command] = /^ExecStart=\S+ (.*)$/m.exec(text);
    writeFileSync(path.join(place, `${role}.conf`), cluster(`${role}.conf`).replaceAll('/etc/orbmorph', place));
    const args = command.replaceAll('/etc/orbmorph', place).replaceAll('%i', role).split(' ');
    const checked = run(binaries.daemon, [...args, '--check-config', '--data', place]);
    assert.equal(checked.status, 0, checked.text);
  }
  rmSync(place, { recursive: true });
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
  // The library, for the function that reads meshes.
  const library = path.join(path.dirname(path.dirname(binaries.daemon)), 'core/liborbmorph.so');
  assert.match(run('readelf', ['--dynamic', '--wide', library]).text, /FLAGS_1.*NOW/);
  assert.match(run('readelf', ['--segments', '--wide', library]).text, /GNU_RELRO/);
  const readers = path.join(path.dirname(path.dirname(library)), 'core/CMakeFiles/orbmorph_objects.dir/format');
  for (const name of ['ply.c.o', 'obj.c.o', 'gltf.cc.o', 'gltf_accessor.cc.o'])
    assert.match(run('readelf', ['--syms', '--wide', path.join(readers, name)]).text, /__stack_chk_fail/, name);
});

test('the bill of materials names all that the programs link and the studio bundles', {
  skip: lacks('readelf') || lacks('dpkg-query'),
}, () => {
  const build = path.dirname(path.dirname(binaries.daemon));
  const made = run('node', [path.join(root, 'deploy/sbom.mjs'), build]);
  assert.equal(made.status, 0, made.text);
  const bill = JSON.parse(made.text);
  assert.deepEqual([bill.spdxVersion, bill.dataLicense, bill.SPDXID], ['SPDX-2.3', 'CC0-1.0', 'SPDXRef-DOCUMENT']);
  const ids = bill.packages.map(({ SPDXID }) => SPDXID);
  assert.equal(new Set(ids).size, ids.length);
  for (const one of bill.packages) {
    assert.match(one.SPDXID, /^SPDXRef-[A-Za-z0-9.-]+$/);
    for (const member of [
      'name',
      'downloadLocation',
      'licenseConcluded',
      'licenseDeclared',
      'copyrightText',
      'supplier',
    ])
      assert.ok(one[member], `${one.name}: ${member}`);
  }
  for (const { spdxElementId, relatedSpdxElement } of bill.relationships)
    for (const id of [spdxElementId, relatedSpdxElement]) assert.ok([...ids, bill.SPDXID].includes(id), id);
  assert.equal(bill.relationships.length, ids.length, 'each package has its relation');

  // Every library in the daemon's memory belongs to a package of the bill, in the installed version.
  const versions = new Map(bill.packages.map(({ name, versionInfo }) => [name, versionInfo]));
  const names = run('readelf', ['--dynamic', '--wide', binaries.daemon]).text.match(/(?<=NEEDED.*\[)[^\]]+/g);
  assert.ok(names.length > 10, names.join());
  const owners = run('dpkg-query', ['-S', ...names.map((name) => `*/${name}`)]).text;
  for (const name of names) {
    const found = [...owners.matchAll(/^([^:\s]+)[^\n]*: \/(.*)$/gm)].filter(
      ([, , file]) => path.basename(file) === name,
    );
    const owner = found.map(([, owner]) => owner).find((owner) => versions.has(owner));
    assert.ok(owner, `${name} has no package`);
    assert.equal(versions.get(owner), run('dpkg-query', ['-W', '-f', `\${Version}`, owner]).text, owner);
  }
  for (const name of ['libeigen3-dev', 'libspectra-dev']) assert.ok(versions.has(name), name);
  const { dependencies } = JSON.parse(readFileSync(path.join(root, 'client/web/package.json'), 'utf8'));
  for (const [name, version] of Object.entries(dependencies)) assert.equal(versions.get(name), version, name);
  assert.equal(
    run('node', [path.join(root, 'deploy/sbom.mjs'), build]).text,
    made.text,
    'the same build, the same bytes',
  );
});

test('the image is built from a base that is named by its digest', async (t) => {
  const place = await folder(t);
  const builder = path.join(place, 'builder');
  const digest = `sha256:${'0123456789abcdef'.repeat(4)}`;
  await writeFile(
    builder,
    `#!/bin/sh\necho "$@" >> ${place}/calls\n[ "$1 $2" = "image inspect" ] && echo docker.io/library/debian@${digest}\nexit 0\n`,
    { mode: 0o755 },
  );
  const make = (...variables) =>
    run('env', [`ORB_BUILDER=${builder}`, ...variables, path.join(root, 'deploy/image.sh'), 'name']);
  for (const base of ['docker.io/library/debian:12-slim', `debian@${digest.slice(0, -1)}`, `@${digest}`]) {
    const refused = make(`ORB_BASE=${base}`);
    assert.equal(refused.status, 1, base);
    assert.match(refused.text, /has no digest: name one as IMAGE:TAG@sha256:DIGEST/);
  }
  assert.throws(() => readFileSync(path.join(place, 'calls')), 'nothing is built');
  const other = make(`ORB_BASE=example.org/debian:12@${digest}`);
  assert.match(other.text, new RegExp(`^base: example.org/debian:12@${digest}$`, 'm'));
  const { status, text } = make();
  assert.equal(status, 0, text);
  const [, reference] = /^base: (\S+)$/m.exec(text);
  assert.match(reference, /^docker\.io\/library\/debian:12-slim@sha256:[0-9a-f]{64}$/);
  assert.equal(reference, readFileSync(path.join(root, 'deploy/base-image'), 'utf8').trim());
  const build = readFileSync(path.join(place, 'calls'), 'utf8').trim().split('\n').pop();
  assert.ok(build.startsWith(`build --build-arg BASE=${reference} `), build);
  assert.match(build, / -f deploy\/Dockerfile -t name \.$/);
  const file = readFileSync(path.join(root, 'deploy/Dockerfile'), 'utf8');
  assert.equal(file.match(/^FROM /gm).length, 2);
  assert.match(file, /^ARG BASE$\n^FROM \$\{BASE\} AS build$[\s\S]*^FROM \$\{BASE\}$/m, 'without a default');
});

test('the unit denies all addresses; with the drop-in, what the daemon refuses: all but public ones', async () => {
  const closed = await readFile(path.join(root, 'deploy/orbmorphd.service'), 'utf8');
  assert.deepEqual(closed.match(/^IPAddress.*$/gm), ['IPAddressDeny=any', 'IPAddressAllow=localhost']);
  const unit = await readFile(path.join(root, 'deploy/outgoing.conf'), 'utf8');
  assert.match(unit, /^IPAddressDeny=$/m, 'the list of the unit is emptied first');
  const source = await readFile(path.join(root, 'server/net/networks.c'), 'utf8');
  const denied = [...unit.matchAll(/^IPAddressDeny=(.+)$/gm)].flatMap(([, list]) => list.split(' '));
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

const cluster = (name) => readFileSync(path.join(root, 'deploy/cluster', name), 'utf8');
/** The documents of a YAML file, which must be valid. */
function yaml(name) {
  const documents = cluster(name).split(/^---$/m);
  return documents.map((text) => {
    const { data, diagnostics } = parsers.Yaml.parse(text);
    assert.deepEqual(diagnostics, [], name);
    assert.equal(typeof data, 'object', name);
    return data;
  });
}
/** All values in a document, with their keys. */
function* walk(value, key = '') {
  yield [key, value];
  if (value && typeof value === 'object') for (const [name, inner] of Object.entries(value)) yield* walk(inner, name);
}

test('the files for a cluster are valid and name options that the daemon has', () => {
  const help = run(binaries.daemon, ['--help']).text;
  const known = new Set([...help.matchAll(/^ {2}--([a-z0-9-]+) /gm)].map(([, name]) => name));
  const [compose] = yaml('compose.yaml');
  const manifests = yaml('kubernetes.yaml');
  const named = new Map();
  for (const [key, value] of [compose, ...manifests].flatMap((document) => [...walk(document)])) {
    if (key.startsWith('ORBMORPH_')) named.set(key.slice(9).toLowerCase().replaceAll('_', '-'), key);
    if (['command', 'args'].includes(key) && Array.isArray(value) && String(value[0]).startsWith('--'))
      for (const word of value) if (String(word).startsWith('--')) named.set(word.slice(2), word);
  }
  for (const name of ['serve.conf', 'work.conf'])
    for (const [, option] of cluster(name).matchAll(/^([a-z0-9-]+) = \S/gm)) named.set(option, name);
  for (const option of ['role', 'listen', 'catalogue', 'objects', 'cache-bytes', 'drain-seconds', 'lease-seconds'])
    assert.ok(named.has(option), option);
  for (const [option, where] of named) assert.ok(known.has(option), `${where}: ${option}`);

  // Both deployments, their budgets, and an autoscaler for the one that works.
  const all = manifests.map(({ kind, metadata }) => `${kind} ${metadata.name}`);
  for (const one of ['Deployment serve', 'Deployment work', 'Service orbmorph', 'HorizontalPodAutoscaler work'])
    assert.ok(all.includes(one), one);
  assert.equal(all.filter((one) => one.startsWith('PodDisruptionBudget')).length, 2);
  const spec = (name) => manifests.find(({ kind, metadata }) => kind === 'Deployment' && metadata.name === name).spec;
  for (const name of ['serve', 'work']) {
    const { selector, template } = spec(name);
    assert.deepEqual(selector.matchLabels, template.metadata.labels);
    const [container] = template.spec.containers;
    for (const { name: volume } of container.volumeMounts)
      assert.ok(template.spec.volumes.some((one) => one.name === volume));
    const drains = Number(container.args[container.args.indexOf('--drain-seconds') + 1] || 8);
    assert.ok(
      !container.args.includes('--drain-seconds') || template.spec.terminationGracePeriodSeconds > drains,
      name,
    );
  }
  for (const [name, option] of [
    ['serve', '--listen'],
    ['work', '--metrics-listen'],
  ]) {
    const { annotations } = spec(name).template.metadata;
    const [{ args, ports, readinessProbe, livenessProbe }] = spec(name).template.spec.containers;
    assert.equal(readinessProbe.httpGet.path, '/readyz');
    assert.equal(livenessProbe.httpGet.path, '/livez');
    for (const probe of [readinessProbe, livenessProbe]) assert.equal(probe.httpGet.port, ports[0].name);
    assert.equal(args[args.indexOf(option) + 1], `0.0.0.0:${ports[0].containerPort}`);
    assert.equal(annotations['prometheus.io/port'], `${ports[0].containerPort}`);
  }
  // What comes from a registry is named by its digest; what deploy/image.sh builds is not there.
  const foreign = [...walk(compose)].filter(([key, value]) => key === 'image' && value.includes('/'));
  assert.ok(foreign.length >= 2);
  for (const [, image] of foreign) assert.match(image, /^[^@]+:[^@]+@sha256:[0-9a-f]{64}$/);
  for (const variable of cluster('compose.yaml').matchAll(/\$\{([A-Z0-9_]+):\?/g))
    assert.match(cluster('example.env'), new RegExp(`^${variable[1]}=`, 'm'));
});

test('haproxy takes its configuration, and hides what strangers should not see', {
  skip: lacks('haproxy'),
}, async (t) => {
  const file = path.join(root, 'deploy/cluster/haproxy.cfg');
  const checked = run('haproxy', ['-c', '-f', file]);
  assert.equal(checked.status, 0, checked.text);
  assert.doesNotMatch(checked.text, /WARNING/);

  const d = await daemon(t);
  const socket = path.join(await folder(t), 'clients.sock');
  const text = configuration([d.url], `unix@${socket}`);
  const own = path.join(path.dirname(socket), 'haproxy.cfg');
  await writeFile(own, text);
  const proxy = spawn('haproxy', ['-db', '-f', own], { stdio: 'ignore' });
  t.after(() => proxy.kill());
  const ask = (target, ...more) =>
    run('curl', [
      '-sS',
      '-o',
      path.join(path.dirname(socket), 'answer'),
      '-w',
      '%{http_code}',
      '--unix-socket',
      socket,
      ...more,
      `http://localhost${target}`,
    ]).text;
  await until(() => ask('/livez') === '200', 'haproxy passes requests on', 30);
  assert.equal(ask('/v1/meshes'), '200');
  assert.equal(ask('/readyz'), '200');
  for (const hidden of ['/metrics', '/readyz?verbose', '/readyz?x=1']) assert.equal(ask(hidden), '404', hidden);
  assert.equal(ask('/v1/meshes?name=tetrahedron', '--data-binary', shapes.tetrahedron), '201');
  await d.stop();
  assert.equal(ask('/v1/meshes'), '503');
});
