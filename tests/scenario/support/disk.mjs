// A small file system in memory, for tests of full and read-only disks.
import { execFileSync, spawnSync } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';

/** Mounts one of `size`. Where mounting is not allowed, the test is skipped, and the result undefined. */
export function memoryDisk(t, size) {
  const folder = mkdtempSync(path.join(tmpdir(), 'orbmorph-disk-'));
  const mounted = spawnSync('mount', ['-t', 'tmpfs', '-o', `size=${size}`, 'tmpfs', folder]);
  if (mounted.status !== 0) {
    rmSync(folder, { recursive: true });
    t.skip(`mounting is not allowed here: ${mounted.stderr ?? mounted.error}`.trim());
    return undefined;
  }
  const unmount = () => {
    execFileSync('umount', ['-l', folder]);
    rmSync(folder, { recursive: true });
  };
  return { folder, unmount };
}
