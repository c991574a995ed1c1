export interface Player {
  camera: Record<'yaw' | 'pitch' | 'distance' | 'panX' | 'panY', number>;
  shapes: number;
  seconds: number;
  placeAt(time: number): number;
  draw(place: number, background?: string): void;
  close(): void;
}
export const EASINGS: Record<string, (t: number) => number>;
export function open(canvas: HTMLCanvasElement | OffscreenCanvas, glb: ArrayBuffer, settings: object): Promise<Player>;
