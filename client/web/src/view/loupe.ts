/** A magnified picture of a place, above the finger that covers it. */
import type { Spot } from '../mesh/worker';
import type { View } from './stage';

const NEARER = 0.2; // of the camera's distance

export class Loupe {
  private readonly element = document.createElement('div');
  private readonly view: View;

  constructor(private readonly of: View) {
    this.element.className = 'loupe';
    of.element.append(this.element);
    this.view = of.stage.add(this.element);
    this.view.show(of.content);
  }

  /** x, y: the finger, in pixels of the view */
  at(spot: Spot, x: number, y: number) {
    const box = this.of.element.getBoundingClientRect();
    const side = this.element.offsetWidth;
    const left = Math.max(6, Math.min(box.width - side - 6, x - side / 2));
    const above = y - side - 40;
    const top = above > 6 ? above : Math.min(box.height - side - 6, y + 40);
    this.element.style.transform = `translate(${left}px, ${top}px)`;
    const look = this.of.orbit.look(box.width / Math.max(box.height, 1));
    const distance = NEARER * Math.hypot(...look.eye.map((e, k) => e - spot.position[k]));
    const eye = spot.position.map((p, k) => p + distance * look.back[k]) as [number, number, number];
    this.view.fixed = { ...look, eye, near: 0.05 * distance, far: look.far, aspect: 1 };
    this.view.stage.draw();
  }

  close() {
    this.view.stage.remove(this.view);
    this.element.remove();
  }
}
