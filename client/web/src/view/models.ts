/**
 * The page's side of what is drawn: each model is an object of the drawing worker, known here by its number. The page
 * keeps no geometry; nothing here loops over vertices.
 */
import type { Display } from '../mesh/geometry';
import type { MorphData } from '../mesh/morph';
import type { SphereData } from '../mesh/distortion';
import { linear, type Paint, type Rgb } from './colors';
import type { Faults, Surface } from './messages';
import { order } from './link';

let count = 0;

/** A surface with its wireframe, whose paint can be changed. */
export class Model {
  readonly id = ++count;

  /** `hand`: the page has no more use for the buffers, so that they go over without being copied. */
  constructor(from: { surface: Surface; hand?: boolean; scale?: number } | { same: Model }, paint: Paint) {
    if ('same' in from) {
      order({ op: 'model', model: this.id, same: from.same.id, paint });
      return;
    }
    const { surface, hand, scale } = from;
    const arrays = [
      surface.position,
      surface.normal,
      surface.index,
      surface.edges,
      ...(surface.targets ?? []).flatMap((t) => [t.position, t.normal]),
    ];
    order(
      { op: 'model', model: this.id, surface, scale, paint },
      hand ? [...new Set(arrays.map((a) => a.buffer as ArrayBuffer))] : [],
    );
  }

  paint(paint: Paint) {
    order({ op: 'paint', model: this.id, paint });
  }

  /** The same surface in another paint; attributes are its own. */
  twin(): Model {
    return new Model({ same: this }, { kind: 'plain', color: '#ffffff' });
  }

  color(color: string | Rgb) {
    order({ op: 'color', model: this.id, color: typeof color === 'string' ? linear(color) : color });
  }

  attribute(name: 'value' | 'tone', data: Float32Array) {
    order({ op: 'attribute', model: this.id, name, data });
  }

  /** The weights of the targets, for the surface and its wireframe. */
  weights(weights: ArrayLike<number>) {
    order({ op: 'weights', model: this.id, weights: Array.from(weights) });
  }

  wireframe(shown: boolean, color: string) {
    const now = `${shown} ${color}`;
    if (now === this.wired || (!shown && !this.wired)) return;
    this.wired = now;
    order({ op: 'wireframe', model: this.id, shown, color: linear(color) });
  }
  private wired = '';

  /** Red edges, points and faces over the surface. */
  faults(faults: Faults | null) {
    order({ op: 'faults', model: this.id, faults });
  }

  dispose() {
    order({ op: 'dispose', model: this.id });
  }
}

export const shapeModel = (d: Display, color: string) =>
  new Model({ surface: d, hand: true }, { kind: 'plain', color });

/** Models of one morph share its buffers: one on the GPU, any number of weights. */
export function morphModels(d: MorphData, count: number, color: string): Model[] {
  const first = new Model({ surface: d, hand: true }, { kind: 'plain', color });
  return [first, ...Array.from({ length: count - 1 }, () => new Model({ same: first }, { kind: 'plain', color }))];
}

const WHITE: Paint = { kind: 'plain', color: '#ffffff' };

/** A ball fills its box more than a shape does. */
export const BALL_SCALE = 0.72;

/** The surface and the sphere of an embedding. */
export const sphereModels = ({ surface, sphere }: SphereData) => ({
  surface: new Model({ surface }, WHITE),
  ball: new Model(
    { surface: { position: sphere, normal: sphere, index: surface.index, edges: surface.edges }, scale: BALL_SCALE },
    WHITE,
  ),
});
