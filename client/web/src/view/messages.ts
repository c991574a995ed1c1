/** The orders of the page to the drawing worker and its reports. Models have numbers. */
import type { Skin } from '../mesh/dress';
import type { Look } from './camera';
import type { Paint, Rgb } from './colors';

export interface Surface {
  position: Float32Array;
  normal: Float32Array;
  index: Uint32Array;
  edges: Uint32Array;
  targets?: { position: Float32Array; normal: Float32Array }[];
  skin?: Skin;
}

export interface Defects {
  lines: Float32Array;
  points: Float32Array;
  triangles: Float32Array;
}

/** One view to draw, in CSS pixels from the left and the top of the canvas. */
export interface Frame {
  model: number;
  left: number;
  top: number;
  width: number;
  height: number;
  look: Look;
}

export type Order =
  | { op: 'start'; canvas: OffscreenCanvas; ratio: number }
  | { op: 'draw'; width: number; height: number; frames: Frame[] }
  /** `same`: the model whose buffers this one shares */
  | { op: 'model'; model: number; surface?: Surface; same?: number; scale?: number; paint: Paint }
  | { op: 'paint'; model: number; paint: Paint }
  | { op: 'color'; model: number; color: Rgb }
  | { op: 'attribute'; model: number; name: 'value' | 'tone'; data: Float32Array }
  | { op: 'weights'; model: number; weights: number[] }
  | { op: 'wireframe'; model: number; shown: boolean; color: Rgb }
  | { op: 'defects'; model: number; defects: Defects | null }
  | { op: 'dispose'; model: number };

export type Report = { op: 'started'; works: boolean } | { op: 'drawn' } | { op: 'shown' } | { op: 'restored' };
