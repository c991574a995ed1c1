/** Colours of the page and the drawing worker. */

export type Rgb = [number, number, number];
export const RAMPS: Record<'heat' | 'diverging', Rgb[]> = {
  heat: [
    [38, 44, 92],
    [44, 90, 140],
    [42, 142, 148],
    [92, 186, 128],
    [190, 214, 96],
    [250, 196, 80],
    [240, 122, 66],
    [196, 44, 70],
  ],
  diverging: [
    [36, 70, 150],
    [72, 132, 196],
    [150, 196, 222],
    [240, 238, 232],
    [242, 184, 150],
    [214, 106, 84],
    [150, 32, 58],
  ],
};

export function rampCss(name: keyof typeof RAMPS): string {
  return `linear-gradient(90deg, ${RAMPS[name].map((c) => `rgb(${c.join(' ')})`).join(', ')})`;
}

/** Converts "#rrggbb" to linear light, 0 to 1. */
export function linear(hex: string): Rgb {
  const part = (at: number) => {
    const x = parseInt(hex.slice(at, at + 2), 16) / 255;
    return x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4;
  };
  return [part(1), part(3), part(5)];
}

/** Mixes colours in linear light; the shares sum to 1. */
export function mixed(colors: string[], shares: number[]): Rgb {
  const out: Rgb = [0, 0, 0];
  colors.forEach((color, i) => linear(color).forEach((x, k) => (out[k] += shares[i] * x)));
  return out;
}

export type Paint =
  | { kind: 'plain'; color: string }
  /** attribute `value` through a ramp */
  | { kind: 'value'; ramp: keyof typeof RAMPS; low: number; high: number; log?: boolean }
  /** attribute `tone` (a direction) as colour */
  | { kind: 'direction' }
  /** attribute `tone` (a point on the sphere) as a checkerboard */
  | { kind: 'checker' }
  /** the colours and textures of the file */
  | { kind: 'skin' };
