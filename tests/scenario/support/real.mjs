// Real meshes, if their folder exists: an index.csv beside the folders good, weldable, bad and pairs.
import { existsSync, readFileSync, readdirSync } from 'node:fs';
import path from 'node:path';

export const folder = process.env.ORB_SHARED_MESHES ?? '';
export const there = folder !== '' && existsSync(path.join(folder, 'index.csv'));

function csvRow(line) {
  const fields = [];
  for (const [, quoted, plain] of line.matchAll(/(?:^|,)(?:"((?:[^"]|"")*)"|([^,]*))/g))
    fields.push(quoted?.replaceAll('""', '"') ?? plain);
  return fields;
}

/** The rows of the index of one kind. */
export function rows(kind) {
  if (!there) return [];
  const [head, ...lines] = readFileSync(path.join(folder, 'index.csv'), 'utf8').trim().split(/\r?\n/);
  const names = csvRow(head);
  return lines
    .map((line) => Object.fromEntries(csvRow(line).map((value, i) => [names[i], value])))
    .filter((row) => row.kind === kind && existsSync(path.join(folder, kind, row.name)))
    .map((row) => ({ ...row, file: path.join(folder, kind, row.name) }));
}

export function pairs() {
  if (!there) return [];
  return readdirSync(path.join(folder, 'pairs'))
    .filter((name) => name.endsWith('.json'))
    .sort()
    .map((name) => {
      const pair = JSON.parse(readFileSync(path.join(folder, 'pairs', name), 'utf8'));
      const landmarks = pair.landmarks.map((at, i) => ({
        name: pair.landmark_names?.[i] ?? `${i + 1}`,
        at: at.map((vertex) => ({ vertex })),
      }));
      return {
        name: path.parse(name).name,
        files: pair.meshes.map((m) => path.join(folder, 'good', m)),
        names: pair.meshes.map((m) => path.parse(m).name),
        landmarks,
      };
    });
}
