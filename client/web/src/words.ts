/** How the page writes numbers. */

export const count = (n: number) => n.toLocaleString('en-US').replace(/,/g, '\u202f');

/** "1 landmark", "2 landmarks" */
export const counted = (n: number, one: string, many = `${one}s`) => `${count(n)} ${n === 1 ? one : many}`;

/** Distances below this are rounding, relative to the diagonal: 0, as the command line prints them. */
export const ROUNDING = 1e-12;

export function relative(x: number | null | undefined): string {
  if (x === undefined || x === null || !Number.isFinite(x)) return '–';
  if (Math.abs(x) < ROUNDING) return '0 %';
  const percent = x * 100;
  return `${percent < 0.001 ? percent.toExponential(1) : percent.toPrecision(2)} %`;
}
