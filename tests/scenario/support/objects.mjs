// The objects that a daemon has stored: files below its data folder, or keys in the bucket of with_s3.sh and with_nodes.sh.
import { createHash } from 'node:crypto';
import { readFileSync, writeFileSync } from 'node:fs';
import { readdir } from 'node:fs/promises';
import path from 'node:path';
import { list } from '../../tools/s3.mjs';

/** Their names that contain `part`. */
export async function objectsNamed(data, part) {
  const { ORB_S3 } = process.env;
  const names = ORB_S3
    ? await list(ORB_S3, 'objects', `${createHash('sha1').update(data).digest('hex').slice(0, 24)}/`)
    : await readdir(path.join(data, 'objects'), { recursive: true });
  return names.filter((name) => name.includes(part));
}

/** The file of one of them below a data folder. */
export const object = (data, kind, id) => path.join(data, 'objects', kind, id.slice(0, 2), id);

/** Flips one bit in the middle of a file, which keeps its size. Returns what it holds then. */
export function flip(file) {
  const bytes = readFileSync(file);
  bytes[bytes.length >> 1] ^= 1;
  writeFileSync(file, bytes);
  return bytes;
}
