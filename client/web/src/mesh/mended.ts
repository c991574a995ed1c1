/** What the daemon made of a file by repairs, in the vertices of the file and with its colours and textures. */
import { PLAIN, type Dress } from './dress';
import { weld } from './geometry';
import type { RawMesh } from './parse';

/**
 * `repaired`: sphere.ply of the daemon, whose property "source" has the numbers of the file. `file`: the file, if it could be
 * read. Vertices of the result from `added` on are not in the file.
 */
export function mendedMesh(repaired: RawMesh, file: RawMesh | undefined): { raw: RawMesh; added: number } {
  const source = repaired.properties?.get('source');
  if (!source) throw new Error('The daemon did not say which vertices the mesh has.');
  const last = source.reduce((most, s) => Math.max(most, s + 1), 0);
  const dressed = file?.dress && last <= file.dress.cover.length ? file : null;
  const added = dressed ? dressed.dress!.cover.length : last;
  let next = added;
  const number = Uint32Array.from(source, (s) => (s >= 0 ? s : next++));
  const positions = new Float64Array(3 * next);
  if (dressed) positions.set(dressed.positions);
  number.forEach((to, i) => positions.set(repaired.positions.subarray(3 * i, 3 * i + 3), 3 * to));
  const raw: RawMesh = { format: repaired.format, positions, corners: repaired.corners.map((v) => number[v]) };
  if (dressed) wear(raw, dressed, dressed.dress!);
  return { raw, added };
}

/** Gives each triangle of the file the file's corners, and with them their look. Other triangles are plain. */
function wear(raw: RawMesh, file: RawMesh, dress: Dress) {
  const find = trianglesOf(file);
  const { corners, positions } = raw;
  const bare: number[] = []; // the vertices of corners without a look
  for (let c = 0; c < corners.length; c += 3) {
    const [a, b, d] = corners.subarray(c, c + 3);
    const known = find(a, b, d);
    if (known) corners.set(known, c);
    else for (const [k, v] of [a, b, d].entries()) corners[c + k] = positions.length / 3 + bare.push(v) - 1;
  }
  const total = positions.length / 3 + bare.length;
  raw.positions = new Float64Array(3 * total);
  raw.positions.set(positions);
  bare.forEach((v, i) => raw.positions.set(positions.subarray(3 * v, 3 * v + 3), positions.length + 3 * i));
  const uv = new Float32Array(2 * total);
  uv.set(dress.uv);
  const cover = new Uint16Array(total).fill(dress.covers.length);
  cover.set(dress.cover);
  const dye = dress.dye && new Float32Array(3 * total).fill(1);
  dye?.set(dress.dye!);
  raw.dress = { uv, dye, cover, covers: [...dress.covers, PLAIN], images: dress.images };
}

/** Finds the corners of the file's triangle that lies at three of its vertices, in their order; null if there is none. */
function trianglesOf({ positions, corners }: RawMesh) {
  const { place, count } = weld(positions);
  const lowest = (a: number, b: number, c: number) => Math.min(place[a], place[b], place[c]);
  const first = new Uint32Array(count + 1);
  const lows = new Uint32Array(corners.length / 3);
  lows.forEach((_, t) => {
    lows[t] = lowest(corners[3 * t], corners[3 * t + 1], corners[3 * t + 2]);
    first[lows[t] + 1]++;
  });
  for (let p = 0; p < count; p++) first[p + 1] += first[p];
  const at = new Uint32Array(lows.length);
  const fill = first.slice(0, count);
  lows.forEach((low, t) => (at[fill[low]++] = t));
  return (...wanted: [number, number, number]): number[] | null => {
    if (wanted.some((v) => v >= place.length)) return null;
    const low = lowest(...wanted);
    for (let i = first[low]; i < first[low + 1]; i++) {
      const here = corners.subarray(3 * at[i], 3 * at[i] + 3);
      const found = wanted.map((v) => here.find((w) => place[w] === place[v]) ?? -1);
      if (!found.includes(-1)) return found;
    }
    return null;
  };
}
