/** How another match of the shapes differs, told by the landmarks that the shown match has found. */

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
/** Two limbs that change sides may be a mistake at one pair; a flip changes this many. */
const FLIPPED = 2;

const apart = (a: Point, b: Point) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);

/**
 * found: the landmarks of the shown match, on the first shape and on the one that is matched otherwise; places: those of
 * the other match. sides: for each found landmark −1 (left), 1 (right), 0 (in the middle), or NaN (unknown). diagonals: of
 * both shapes.
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
  let kept = 0; // or taken between a side and the middle, as head to foot
  let changed = 0;
  for (const place of places) {
    const [a, b] = [near(place[0], 0), near(place[1], 1)];
    if (a.landmark < 0 || b.landmark < 0) continue;
    const [from, to] = [a.landmark, b.landmark];
    if (from !== to) swaps.push({ from, to, far: Math.max(a.far, b.far) });
    const [side, other] = [sides[from], sides[to]];
    if (side * other < 0) changed++;
    else if (side * other > 0 || (side !== other && Math.abs(side * other) === 0)) kept++;
  }
  swaps.sort((a, b) => a.far - b.far);
  return { swaps: swaps.map(({ from, to }) => ({ from, to })), flips: changed >= FLIPPED && changed > 2 * kept };
}

/** Whether a landmark's name says what it is. */
export const isWord = (name: string) => !!name && !/^(auto|pair) \d+$/.test(name);

/** The side that a name says: −1 for left, 1 for right, 0 for the head or the tail; NaN if it says nothing. */
export const sideOf = (name: string) =>
  !isWord(name) ? NaN : /\bleft\b/.test(name) ? -1 : /\bright\b/.test(name) ? 1 : 0;
