/** The morphs that the first page plays. welcome/make.mjs computes them beforehand, so they need no daemon. */
import { work } from './mesh/work';
import { weightsAt, type MorphData } from './mesh/morph';
import { type Model, morphModels } from './view/models';
import { mixed } from './view/colors';
import { stage } from './view/shared';

export interface Sight {
  key: string;
  label: string;
  names: string[];
  url: string;
  tints: string[];
  yaw: number;
}

export const SIGHTS: Sight[] = [
  {
    key: 'animals',
    label: 'Animals',
    names: ['dog', 'giraffe', 'elephant'],
    url: new URL('../welcome/animals.glb', import.meta.url).href,
    tints: ['#f2a97f', '#f0c64f', '#8fb2ef'],
    yaw: 0.55,
  },
  {
    key: 'star',
    label: 'Star',
    names: ['cube', 'star', 'flower'],
    url: new URL('../welcome/cube.glb', import.meta.url).href,
    tints: ['#7fa0f0', '#f5b84a', '#e88bb8'],
    yaw: 0.3,
  },
  {
    key: 'fruit',
    label: 'Fruit',
    names: ['apple', 'pear', 'pumpkin'],
    url: new URL('../welcome/apple.glb', import.meta.url).href,
    tints: ['#ea6a5e', '#b9cf5c', '#f09440'],
    yaw: 0.4,
  },
  {
    key: 'vase',
    label: 'Vase',
    names: ['vase', 'pawn', 'bottle'],
    url: new URL('../welcome/vase.glb', import.meta.url).href,
    tints: ['#6fc3c0', '#c9a5ec', '#7fc98a'],
    yaw: 0.3,
  },
];

const SECONDS_A_SHAPE = 2;
const REST = 0.3; // share of a leg at each of its ends

/** The shapes of a sight as OBJ files. */
export async function filesOf(sight: Sight): Promise<File[]> {
  const buffer = await (await fetch(sight.url)).arrayBuffer();
  const texts = await work('shapesOf', buffer, sight.names.length);
  return texts.map((text, i) => new File([text], `${sight.names[i]}.obj`));
}

/** Plays one sight in a model. The path is a round: from the last shape back to the first. */
export class Show {
  model: Model | null = null;
  playing = false;
  private data: Pick<MorphData, 'times' | 'weights' | 'shapes'> | null = null;
  private phase = 0;
  private last = 0;
  private frame = 0;
  private ended = false;

  constructor(readonly sight: Sight) {}

  async load() {
    const response = await fetch(this.sight.url);
    if (!response.ok) throw new Error(String(response.status));
    const data = await work(
      'morph',
      `welcome ${this.sight.key}`,
      await response.arrayBuffer(),
      this.sight.names.length,
    );
    void work('close', `welcome ${this.sight.key}`);
    if (this.ended) return;
    this.data = { times: data.times, weights: data.weights, shapes: data.shapes };
    this.model = morphModels(data, 1, this.sight.tints[0])[0];
    this.show();
  }

  play() {
    if (this.playing || this.ended) return;
    this.playing = true;
    this.last = 0;
    this.frame = requestAnimationFrame(this.tick);
  }
  pause() {
    this.playing = false;
    cancelAnimationFrame(this.frame);
  }
  end() {
    this.pause();
    this.ended = true;
    this.model?.dispose();
    this.model = null;
  }

  private tick = (now: number) => {
    this.phase += this.last ? Math.min((now - this.last) / 1000, 0.1) / SECONDS_A_SHAPE : 0;
    this.last = now;
    this.show();
    this.frame = requestAnimationFrame(this.tick);
  };

  private show() {
    const { data, model } = this;
    if (!data || !model) return;
    const { names, tints } = this.sight;
    const leg = Math.floor(this.phase) % names.length;
    const part = Math.min(1, Math.max(0, (this.phase - Math.floor(this.phase) - REST / 2) / (1 - REST)));
    const t = part * part * (3 - 2 * part);
    const next = (leg + 1) % names.length;
    const weights =
      next > leg
        ? weightsAt(data, (leg + t) / (names.length - 1))
        : Array.from(data.shapes[leg], (w, k) => (1 - t) * w + t * data.shapes[0][k]);
    model.weights(weights);
    model.color(mixed([tints[leg], tints[next]], [1 - t, t]));
    stage.draw();
  }
}
