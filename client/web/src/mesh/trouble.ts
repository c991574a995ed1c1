/** What is wrong with landmarks, in the names and numbers of the page: the daemon counts both from 0. */
import type { Problem } from 'orbmorph';

/** The landmarks and shapes of a request as the page calls them. */
export interface Marks {
  /** "1", or "2 (nose)" */
  names: string[];
  shapes: string[];
  /** where the landmarks lie, by landmark and shape */
  places: (readonly number[])[][];
}

const listed = (names: string[]) => `${names.slice(0, -1).join(', ')} and ${names.at(-1)}`;

/** The sentence for a problem of the kind bad-landmarks; null if it names no landmark of the request. */
export function landmarkTrouble({ landmarks, shape }: Problem, { names, shapes, places }: Marks): string | null {
  const all = Array.isArray(landmarks) ? (landmarks as number[]).filter((i) => i in names) : [];
  if (!all.length) return null;
  const on = typeof shape === 'number' && shapes[shape] ? ` on ${shapes[shape]}` : '';
  if (all.length === 1)
    return `Landmark ${names[all[0]]} cannot be where it is${on} while the others are where they are. Move it or delete it.`;
  const spots = all.map((i) => places[i][Number(shape)]?.map((x) => x.toFixed(5)).join());
  const shared = spots.find((spot, i) => spot && spots.indexOf(spot) < i);
  if (!shared)
    return `Landmarks ${listed(all.map((i) => names[i]))} do not fit together${on}: they may be crossed. Move or delete one of them.`;
  const there = all.filter((_, i) => spots[i] === shared).map((i) => names[i]);
  return `Landmarks ${listed(there)} are at one place${on}, but not on every shape. Move or delete one of them.`;
}
