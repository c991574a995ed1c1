/** Landmark files: those of the page and of the daemon, and lists of vertex numbers, as the command line takes them. */
import type { Landmark, Place } from 'orbmorph';
import { counted } from '../words';

export type Listed = Pick<Landmark, 'name' | 'at' | 'weight' | 'pass' | 'radius' | 'confidence'>[];

/** The list in a landmark file; null if it is none: a glTF document is JSON, too. */
export function listIn(text: string): unknown[] | null {
  try {
    const content = JSON.parse(text);
    const list = Array.isArray(content) ? content : content?.landmarks;
    return Array.isArray(list) ? list : null;
  } catch {
    return null;
  }
}

/** Whether this can be a place; a list may leave out the place on a shape. */
function isPlace(place: unknown): boolean {
  if (place === null) return true;
  if (typeof place !== 'object') return false;
  const { vertex, point, triangle, barycentric } = place as Record<string, unknown>;
  const isTriple = (list: unknown) => Array.isArray(list) && list.length === 3 && list.every(Number.isFinite);
  return Number.isInteger(vertex) || isTriple(point) || (Number.isInteger(triangle) && isTriple(barycentric));
}

/** The landmarks of such a list for this many shapes. Throws an error that says what is wrong with `name`. */
export function marksOf(list: unknown[], shapes: number, name: string): Listed {
  if (!list.length) throw new Error(`${name} has no landmarks.`);
  const marks = list.map((item): Listed[0] =>
    Array.isArray(item) ? { at: item.map((vertex): Place => ({ vertex })) } : (item as Listed[0]),
  );
  for (const [i, mark] of marks.entries()) {
    const at: unknown = mark?.at;
    if (!Array.isArray(at) || !at.length || !at.every(isPlace))
      throw new Error(`${name} is not a landmark file: entry ${i + 1} of its list has no places on shapes.`);
    if (at.length > shapes)
      throw new Error(
        `${name} has landmarks for ${counted(at.length, 'shape')}, and only ${shapes} ${shapes === 1 ? 'is' : 'are'} here. Add the others first, in the order of the file.`,
      );
  }
  return marks;
}
