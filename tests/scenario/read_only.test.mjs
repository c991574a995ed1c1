// A data folder on a read-only file system, as after errors of the disk: the daemon reports it, at its start and while
// it runs. The test mounts file systems; it is skipped if that is not allowed.
import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import path from 'node:path';
import test from 'node:test';
import { assertProblem, binaries, Daemon } from './support/daemon.mjs';
import { memoryDisk } from './support/disk.mjs';
import * as shapes from './support/shapes.mjs';

test('a read-only data folder is named as such', async (t) => {
  const disk = memoryDisk(t, '64m');
  if (!disk) return;
  const mount = disk.folder;
  const data = path.join(mount, 'data');
  const d = new Daemon(data, ['--scrub-rate', '0', '--disk-reserve', '0'], {});
  t.after(async () => {
    if (d.child) await d.stop('SIGKILL');
    spawnSync('umount', ['-l', data]);
    disk.unmount();
  });
  await d.start();
  const text = shapes.obj(shapes.egg(2));
  const { json: mesh, status } = await d.upload(text);
  assert.equal(status, 201);
  const made = await d.made('/v1/embeddings', { mesh: mesh.id });
  const verbose = async () => (await d.get('/readyz?verbose')).json.read_only;
  assert.equal(await verbose(), false);

  // A read-only mount over the folder: every file that the daemon opens from now on is read-only. (Its catalogue is
  // already open.)
  const lock = () => {
    execFileSync('mount', ['--bind', data, data]);
    execFileSync('mount', ['-o', 'remount,ro,bind', data]);
  };
  lock();
  assert.equal(await verbose(), true);
  const refused = await d.upload(shapes.obj(shapes.bean(2)));
  assertProblem(refused, 507, 'read-only');
  assert.match(refused.json.detail, /read-only file system/);
  assert.match(d.log, /"level":"error","message":"[^"]*Read-only file system"/);
  assert.equal((await d.get(`${mesh.url}/file`)).bytes.toString(), text);
  assert.equal((await d.get(made.sphere)).status, 200);
  assert.equal((await d.get('/v1/meshes')).json.meshes.length, 1);
  assert.equal((await d.get('/readyz')).status, 200, 'what is stored is served');
  execFileSync('umount', [data]);
  assert.equal((await d.upload(shapes.obj(shapes.bean(2)))).status, 201, 'it heals without a restart');
  assert.equal((await d.stop()).code, 0);

  // Before the start, and for commands that change the folder.
  lock();
  await assert.rejects(d.start(), /the data folder \S+\/data is on a read-only file system/);
  assert.doesNotMatch(d.log.split('\n').slice(-3).join('\n'), /in use by another process/);
  for (const command of ['--gc', '--check-data']) {
    const { status, stderr } = spawnSync(binaries.daemon, [command, '--data', data], { encoding: 'utf8' });
    assert.equal(status, 1, command);
    assert.match(stderr, /is on a read-only file system/);
  }
  execFileSync('umount', [data]);
  await d.start();
  assert.equal((await d.get('/v1/meshes')).json.meshes.length, 2);
  assert.equal((await d.stop()).code, 0);
});
