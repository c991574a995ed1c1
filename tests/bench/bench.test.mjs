// Tests orbmorph-bench: the members it prints, their arithmetic, exit statuses. ctest sets ORB_BIN and ORB_SAMPLES.
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';

const { ORB_BIN: bin, ORB_SAMPLES: samples } = process.env;
const bench = (args, env = {}) => {
  const r = spawnSync(join(bin, 'orbmorph-bench'), args, { encoding: 'utf8', env: { ...process.env, ...env } });
  return {
    status: r.status,
    error: r.stderr,
    lines: r.stdout
      .split('\n')
      .filter(Boolean)
      .map((l) => JSON.parse(l)),
  };
};
const dog = join(samples, 'dog.obj');
const giraffe = join(samples, 'giraffe.off');

test('embed prints one line per file and repeat', () => {
  const dir = mkdtempSync(join(tmpdir(), 'orb-bench-'));
  const r = bench(['embed', '--threads', '2', '--repeat', '2', '--out', dir, dog, giraffe], {
    OPENBLAS_NUM_THREADS: '7',
  });
  assert.equal(r.status, 0, r.error);
  assert.deepEqual(
    r.lines.map((l) => l.mesh),
    ['dog', 'dog', 'giraffe', 'giraffe'],
  );
  for (const l of r.lines) {
    const s = l.seconds;
    assert.ok(s.read > 0 && s.total >= s.read + s.check + s.simplify + s.embed + s.certify - 1e-9);
    assert.ok(Math.abs(l.triangles_per_minute / ((60 * l.triangles) / (s.total - s.read)) - 1) < 1e-9);
    assert.ok(l.peak_rss_bytes > 1e6);
    assert.equal(l.threads, 2);
    assert.deepEqual([l.certificate.valid, l.certificate.flipped, l.certificate.degree], [true, 0, 1]);
    assert.ok(l.distortion.symmetric_dirichlet.mean >= 1 && l.distortion.stretch_efficiency > 0);
  }
  const ply = readFileSync(join(dir, 'dog.sphere.ply'));
  assert.equal(ply.subarray(0, 3).toString(), 'ply');
  assert.ok(ply.length > 52 * r.lines[0].vertices + 13 * r.lines[0].triangles);
  rmSync(dir, { recursive: true });
});

test('embed takes both methods and the options of a request; any number of threads gives the same sphere', () => {
  const dir = mkdtempSync(join(tmpdir(), 'orb-bench-'));
  const spheres = [1, 3].map((n) => {
    const r = bench(['embed', '--threads', `${n}`, `--out=${dir}`, '--options', '{"energy_weight":0}', dog]);
    assert.equal(r.status, 0, r.error);
    assert.equal(r.lines[0].options.energy_weight, 0);
    return readFileSync(join(dir, 'dog.sphere.ply'));
  });
  assert.ok(spheres[0].equals(spheres[1]));
  rmSync(dir, { recursive: true });
  const paper = bench(['embed', '--method', 'kernel-sampling', dog]);
  assert.equal(paper.status, 0, paper.error);
  assert.equal(paper.lines[0].method, 'kernel-sampling');
  assert.ok(paper.lines[0].certificate.valid);
});

test('merge writes the asset and prints its report', () => {
  const dir = mkdtempSync(join(tmpdir(), 'orb-bench-'));
  const out = join(dir, 'out.glb');
  const r = bench([
    'merge',
    '--align',
    'rotate',
    '--landmarks',
    join(samples, 'dog-giraffe.json'),
    '--out',
    out,
    dog,
    giraffe,
  ]);
  assert.equal(r.status, 0, r.error);
  const [l] = r.lines;
  assert.equal(l.triangles, 2 * l.vertices - 4);
  assert.equal(l.shapes.length, 2);
  for (const name of ['read', 'embed', 'align', 'remesh', 'transfer', 'write', 'total']) {
    assert.ok(l.seconds[name] >= 0, name);
  }
  assert.ok(l.certificate.closed);
  assert.equal(readFileSync(out).subarray(0, 4).toString(), 'glTF');
  rmSync(dir, { recursive: true });
});

test('landmarks: a set depends only on the seed and its number, and is correct', () => {
  const elephant = join(samples, 'elephant.ply');
  const run = (...more) => {
    const r = bench(['landmarks', '--sizes', '3,12', ...more, dog, giraffe, elephant]);
    assert.equal(r.status, 0, r.error);
    return r.lines;
  };
  const all = run('--sets', '4', '--seed', '9', '--merge-every', '3');
  assert.deepEqual(
    all.map((l) => [l.set, l.landmarks]),
    [
      [0, 3],
      [1, 12],
      [2, 3],
      [3, 12],
    ],
  );
  for (const l of all) {
    assert.equal(l.status, 'ok', l.detail);
    assert.equal(l.right, true);
    assert.notEqual(l.shapes[0], l.shapes[1]);
    assert.ok(Math.min(...l.growth) >= 1);
    assert.equal('triangles' in l, l.set % 3 === 0);
  }
  const [third] = run('--sets', '1', '--first', '2', '--seed', '9');
  assert.deepEqual([third.shapes, third.growth], [all[2].shapes, all[2].growth]);
});

test('pairs: merges every pair once, certified', () => {
  const r = bench(['pairs', '--align-preset', 'fast', dog, giraffe, join(samples, 'elephant.ply')]);
  assert.equal(r.status, 0, r.error);
  assert.deepEqual(
    r.lines.map((l) => l.shapes.join()),
    ['dog,giraffe', 'dog,elephant', 'giraffe,elephant'],
  );
  for (const l of r.lines) {
    assert.equal(l.status, 'ok', l.detail);
    assert.equal(l.certificate.closed, true);
    assert.ok(l.bound_relative <= 0.001);
  }
  const one = bench([
    'pairs',
    '--align-preset',
    'fast',
    '--first',
    '1',
    '--sets',
    '1',
    dog,
    giraffe,
    join(samples, 'elephant.ply'),
  ]);
  assert.deepEqual(
    one.lines.map((l) => l.shapes.join()),
    ['dog,elephant'],
  );
});

test('landmarks: meets awkward sets; refuses contradictions and names both landmarks', () => {
  const r = bench(['landmarks', '--sizes', 'awkward', '--sets', '8', dog, giraffe, join(samples, 'elephant.ply')]);
  assert.equal(r.status, 0, r.error);
  assert.deepEqual(
    r.lines.map((l) => l.status),
    [0, 1].flatMap(() => ['ok', 'ok', 'ok', 'bad-landmarks']),
  );
  assert.ok(r.lines.every((l) => l.right));
});

test('truth: a shape mapped to itself has no error; landmarks not given are measured', () => {
  const marks = JSON.parse(readFileSync(join(samples, 'dog-giraffe.json'))).landmarks;
  const dir = mkdtempSync(join(tmpdir(), 'orb-bench-'));
  const same = join(dir, 'same.json');
  writeFileSync(same, JSON.stringify({ landmarks: marks.map((m) => ({ ...m, at: [m.at[0], m.at[0]] })) }));
  const r = bench(['truth', '--landmarks', same, '--given', '5', '--methods', 'rotate,default,auto', dog, dog]);
  assert.equal(r.status, 0, r.error);
  assert.deepEqual(
    r.lines.map((l) => [l.method, l.given]),
    [
      ['rotate', 5],
      ['default', 5],
      ['auto', 0],
    ],
  );
  for (const l of r.lines) {
    assert.equal(l.flipped, 0);
    assert.ok(l.dense_percent.mean < 0.5, `${l.method}: ${l.dense_percent.mean}`);
    assert.equal(l.held_out.length, marks.length - l.given);
    assert.ok(l.held_out_percent.max < 2, `${l.method}: ${l.held_out_percent.max}`);
    assert.ok(l.inverted_fraction.map < 0.001);
  }
  const other = bench([
    'truth',
    '--landmarks',
    join(samples, 'dog-giraffe.json'),
    '--given',
    '5',
    '--methods',
    'fast',
    dog,
    giraffe,
  ]);
  assert.equal(other.status, 0, other.error);
  assert.equal(other.lines[0].dense_percent, null);
  assert.ok(other.lines[0].held_out_percent.mean > 0.1 && other.lines[0].held_out_percent.mean < 30);
  rmSync(dir, { recursive: true });
});

test('exit statuses: 1 refused with the reason, 2 wrong usage', () => {
  const cases = [
    [1, ['embed', '/nowhere/mesh.obj'], /nowhere/],
    [1, ['embed', join(samples, 'dog-giraffe.json')], /unknown-format|malformed/],
    [1, ['merge', '--align', 'pin', dog, giraffe], /landmark/i],
    [2, [], /usage/],
    [2, ['transmogrify'], /usage/],
    [2, ['embed'], /file/],
    [2, ['merge', dog], /two/],
    [2, ['pairs', dog], /two/],
    [2, ['landmarks', '--sizes', '3,x', dog, giraffe], /--sizes/],
    [2, ['landmarks', '--sets', '0', dog, giraffe], /--sets/],
    [2, ['pairs', '--seed', '5', dog, giraffe], /unknown option/],
    [2, ['embed', '--threads', 'many', dog], /--threads/],
    [2, ['embed', '--method', 'magic', dog], /magic/],
    [2, ['embed', '--options', '{"radius":1}', dog], /radius/],
    [2, ['embed', '--landmarks', 'x', dog], /unknown option/],
    [2, ['truth', dog, giraffe], /--landmarks/],
    [2, ['truth', '--landmarks', 'x', '--methods', 'fast,magic', dog, giraffe], /magic/],
  ];
  for (const [status, args, message] of cases) {
    const r = bench(args);
    assert.equal(r.status, status, `${args.join(' ')}: ${r.error}`);
    assert.match(r.error, message);
    assert.equal(r.lines.length, 0);
  }
  assert.match(spawnSync(join(bin, 'orbmorph-bench'), ['--version'], { encoding: 'utf8' }).stdout, /^orbmorph \d/);
  assert.equal(bench(['embed', join('/nowhere', 'x'), dog]).lines.length, 1); // the other file is still embedded
});
