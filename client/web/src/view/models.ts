/**
 * The page's handles of models. Each stands for an object of the drawing worker and has its number. The page keeps no
 * geometry, and nothing here loops over vertices.
 */
import type { Display } from '../mesh/geometry';
import type { MorphData } from '../mesh/morph';
import type { SphereData } from '../mesh/distortion';
import { linear, type Paint, type Rgb } from './colors';
import type { Defects, Surface } from './messages';
import { order } from './link';

let count = 0;

/** A surface with its wireframe and paint. */
export class Model {
  readonly id = ++count;

  /** `transfer`: the page no longer needs the buffers, so the worker gets them without a copy. */
  constructor(from: { surface: Surface; transfer?: boolean; scale?: number } | { same: Model }, paint: Paint) {
    if ('same' in from) {
      order({ op: 'model', model: this.id, same: from.same.id, paint });
      return;
    }
    const { surface, transfer, scale } = from;
    const { skin } = surface;
    const arrays = [
      surface.position,
      surface.normal,
      surface.index,
      surface.edges,
      ...(surface.targets ?? []).flatMap((t) => [t.position, t.normal]),
      ...(skin ? [skin.uv] : []),
      ...(skin?.dye ? [skin.dye] : []),
    ];
    order(
      { op: 'model', model: this.id, surface, scale, paint },
      transfer
        ? [...new Set(arrays.map((a) => a.buffer as ArrayBuffer)), ...(skin?.images ?? []).filter((i) => !!i)]
        : [],
    );
  }

  paint(paint: Paint) {
    order({ op: 'paint', model: this.id, paint });
  }

  /** A model of the same surface with its own paint and attributes. */
  copy(): Model {
    return new Model({ same: this }, { kind: 'plain', color: '#ffffff' });
  }

  color(color: string | Rgb) {
    order({ op: 'color', model: this.id, color: typeof color === 'string' ? linear(color) : color });
  }

  attribute(name: 'value' | 'tone', data: Float32Array) {
    order({ op: 'attribute', model: this.id, name, data });
  }

  /** Sets the weights of the targets for the surface and its wireframe. */
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

  /** Draws edges, points and faces in red over the surface. */
  defects(defects: Defects | null) {
    order({ op: 'defects', model: this.id, defects });
  }

  dispose() {
    order({ op: 'dispose', model: this.id });
  }
}

/** A shape with a skin shows it instead of its tint. */
const paintOf = (surface: Surface, color: string): Paint =>
  surface.skin ? { kind: 'skin' } : { kind: 'plain', color };

export const shapeModel = (d: Display, color: string) => new Model({ surface: d, transfer: true }, paintOf(d, color));

/** `count` models with their own weights that share one copy of the buffers on the GPU. */
export function morphModels(d: MorphData, count: number, color: string): Model[] {
  const paint = paintOf(d, color);
  const first = new Model({ surface: d, transfer: true }, paint);
  return [first, ...Array.from({ length: count - 1 }, () => new Model({ same: first }, paint))];
}

const WHITE: Paint = { kind: 'plain', color: '#ffffff' };

/** A sphere fills its bounding box more than a shape does. */
export const BALL_SCALE = 0.72;

/** The surface and the sphere of an embedding. */
export const sphereModels = ({ surface, sphere }: SphereData) => ({
  surface: new Model({ surface }, WHITE),
  ball: new Model(
    { surface: { position: sphere, normal: sphere, index: surface.index, edges: surface.edges }, scale: BALL_SCALE },
    WHITE,
  ),
});
