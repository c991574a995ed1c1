/**
 * The clock of the morph. It changes weights and requests a drawing without rendering the page again for each frame;
 * controls that show the time (the slider) listen to it directly.
 */
import { set, state, tint, type Result } from './state';
import { stage } from './view/shared';
import { weightsAt } from './mesh/morph';
import { mixed } from './view/colors';
import { EASINGS } from './take/player.js';

const HOLD = 0.18;

class Player {
  /** 0..1 along the way through the shapes */
  time = 0;
  private phase = 0;
  private last = 0;
  private frame = 0;
  private listeners = new Set<(time: number) => void>();

  listen(listener: (time: number) => void): () => void {
    this.listeners.add(listener);
    listener(this.time);
    return () => this.listeners.delete(listener);
  }

  load(result: Result) {
    this.result = result;
    this.seek(this.time);
  }
  unload() {
    this.pause();
    this.result = null;
    this.time = 0;
  }
  private result: Result | null = null;

  private get legs() {
    return Math.max(1, (this.result?.supermesh.shapes.length ?? 2) - 1);
  }

  play() {
    if (!this.result || this.frame) return;
    this.phase = this.phaseOf(this.time);
    this.last = 0;
    set({ playing: true, mix: null });
    this.frame = requestAnimationFrame(this.tick);
  }

  pause() {
    cancelAnimationFrame(this.frame);
    this.frame = 0;
    if (state.playing) set({ playing: false });
  }

  toggle() {
    if (state.playing) this.pause();
    else this.play();
  }

  seek(time: number) {
    this.time = Math.max(0, Math.min(1, time));
    const { result } = this;
    if (result) {
      this.setWeights(weightsAt(result.data, this.time));
      this.tintAt(this.time);
    }
    for (const listener of this.listeners) listener(this.time);
  }

  /** Shows a mixture of the shapes; `shares` may have any sum. */
  mix(shares: number[]) {
    const { result } = this;
    if (!result) return;
    this.pause();
    const sum = shares.reduce((s, x) => s + x, 0);
    const part = sum > 0 ? shares.map((x) => x / sum) : shares.map((_, i) => (i ? 0 : 1));
    const weights = new Array<number>(result.data.names.length).fill(0);
    part.forEach((x, i) => result.data.shapes[i]?.forEach((w, k) => (weights[k] += x * w)));
    this.setWeights(weights);
    result.main.color(
      mixed(
        part.map((_, i) => tint(i)),
        part,
      ),
    );
    set({ mix: shares });
  }

  /** of the targets, as they are shown */
  weights: ArrayLike<number> = [];
  /** without those of targets that are not shapes */
  private way: ArrayLike<number> = [];

  private setWeights(way: ArrayLike<number>) {
    this.way = way;
    const weights = Array.from(way);
    this.result?.data.extras.forEach(({ at }, i) => (weights[at] = this.result!.extras[i]));
    this.weights = weights;
    this.result?.main.weights(weights);
    stage.draw();
  }

  /** Sets the weight of a target that is not a shape, wherever the morph is. */
  setExtra(number: number, weight: number) {
    if (!this.result) return;
    this.result.extras[number] = weight;
    this.setWeights(this.way);
    set();
  }

  private tintAt(time: number) {
    const at = time * this.legs;
    const i = Math.min(Math.floor(at), this.legs - 1);
    this.result?.main.color(mixed([tint(i), tint(i + 1)], [1 - at + i, at - i]));
  }

  /** How far a leg is done, with a short rest at each of its shapes. */
  private eased(part: number): number {
    const s = Math.max(0, Math.min(1, (part - HOLD / 2) / (1 - HOLD)));
    return EASINGS[state.motion.easing](s);
  }

  /** The time of a phase: back and forth, or forth only. */
  private timeOf(phase: number): number {
    const there = phase % (2 * this.legs);
    const at = there <= this.legs ? there : 2 * this.legs - there;
    const leg = Math.min(Math.floor(at), this.legs - 1);
    return (leg + this.eased(at - leg)) / this.legs;
  }

  /** Shows a phase of a loop, whose last leg leads straight from the last shape to the first. */
  private round(phase: number) {
    const there = phase % (this.legs + 1);
    if (there <= this.legs) return this.seek(this.timeOf(there));
    const { result, legs } = this;
    const t = this.eased(there - legs);
    const [last, first] = [result!.data.shapes[legs], result!.data.shapes[0]];
    this.time = 1 - t;
    this.setWeights(last.map((w, k) => (1 - t) * w + t * first[k]));
    result!.main.color(mixed([tint(legs), tint(0)], [1 - t, t]));
    for (const listener of this.listeners) listener(this.time);
  }

  private phaseOf(time: number): number {
    let low = 0;
    let high = this.legs;
    for (let i = 0; i < 30; i++) {
      const mid = (low + high) / 2;
      if (this.timeOf(mid) < time) low = mid;
      else high = mid;
    }
    return low;
  }

  private tick = (now: number) => {
    const passed = this.last ? Math.min((now - this.last) / 1000, 0.1) : 0;
    this.last = now;
    this.phase += passed / state.motion.seconds;
    if (state.motion.loop === 'loop') this.round(this.phase);
    else this.seek(this.timeOf(this.phase));
    this.frame = requestAnimationFrame(this.tick);
  };
}

export const player = new Player();
