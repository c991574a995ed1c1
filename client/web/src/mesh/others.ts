/** What another match of the shapes does otherwise, told by the landmarks that the shown match has found. */

type Point = ArrayLike<number>;

/** On one shape, another match has the place of landmark `to` where the shown one has that of landmark `from`. */
export interface Swap {
  from: number;
  to: number;
}

export interface Other {
  swaps: Swap[]; // the clearest first
  /** whether it swaps left and right */
  flips: boolean;
}

/** A place farther from a found landmark is not that feature: as a fraction of the diagonal. Limbs lie farther apart. */
const NEAR = 0.1;
/** Two limbs that change sides may be a mistake at one pair; a flip changes this many, and most of those it tells of. */
const FLIPPED = 2;

const apart = (a: Point, b: Point) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);

/**
 * found: the landmarks of the shown match, on the first shape and on the one that is matched otherwise; places: those of
 * the other match. sides: for each found landmark −1 (left), 1 (right), or 0. diagonals: of both shapes.
 */
export function otherOf(found: Point[][], places: Point[][], sides: number[], diagonals: number[]): Other {
  const near = (place: Point, shape: number) => {
    let best = -1;
    let least = NEAR * diagonals[shape];
    found.forEach((at, i) => {
      const far = apart(at[shape], place);
      if (far < least) [best, least] = [i, far];
    });
    return { landmark: best, far: least / diagonals[shape] };
  };
  const swaps: (Swap & { far: number })[] = [];
  let same = 0;
  let changed = 0;
  for (const place of places) {
    const [a, b] = [near(place[0], 0), near(place[1], 1)];
    if (a.landmark < 0 || b.landmark < 0) continue;
    const [from, to] = [a.landmark, b.landmark];
    if (from !== to) swaps.push({ from, to, far: Math.max(a.far, b.far) });
    const product = sides[from] * sides[to];
    if (product < 0) changed++;
    else if (product > 0) same++;
  }
  swaps.sort((a, b) => a.far - b.far);
  return { swaps: swaps.map(({ from, to }) => ({ from, to })), flips: changed >= FLIPPED && changed > 2 * same };
}

/** The side that a name says: −1 for left, 1 for right, or 0. */
export const sideOf = (name: string) => (/\bleft\b/.test(name) ? -1 : /\bright\b/.test(name) ? 1 : 0);
