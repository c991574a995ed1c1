// LD_PRELOAD for a program that a test starts.
import { existsSync, mkdtempSync, rmSync, symlinkSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';

const separator = /[\s:]/; // between the entries of LD_PRELOAD; it has no quoting

/**
 * The value of LD_PRELOAD for these files, and a function that removes the links made for it: a path with a blank gets
 * a link.
 */
export function preload(files) {
  const base = [tmpdir(), '/tmp', '/dev/shm'].find((folder) => !separator.test(folder) && existsSync(folder));
  const folder = mkdtempSync(path.join(base, 'orbmorph-preload-'));
  const value = files.map((file, i) => {
    const target = path.resolve(file);
    if (!separator.test(target)) return target;
    const link = path.join(folder, `${i}.so`);
    symlinkSync(target, link);
    return link;
  });
  return { value: value.join(' '), remove: () => rmSync(folder, { recursive: true, force: true }) };
}
