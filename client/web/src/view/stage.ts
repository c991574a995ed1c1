/**
 * One canvas under all views. Each view is a rectangle of the page that shows a model. The canvas belongs to a worker,
 * so neither uploads nor slow GPUs block the page. The worker draws only when something has changed and never starts a
 * drawing before the last one is done. Views that share an Orbit are linked.
 */
import { Orbit, project, rayThrough, type Look } from './camera';
import { changesOrdered, onReport, order } from './link';
import type { Frame } from './messages';
import type { Model } from './models';

export interface Marker {
  position: [number, number, number];
  normal: [number, number, number];
  element: HTMLElement;
}

export interface Ray {
  origin: number[];
  direction: number[];
}

export class View {
  content: Model | null = null;
  markers: Marker[] = [];
  onPick: ((ray: Ray) => void) | null = null;
  /** the place under the mouse; null once it leaves the view */
  onHover: ((ray: Ray | null) => void) | null = null;
  own = new Orbit();
  /** a camera of its own, which the user cannot rotate */
  fixed: Look | null = null;

  constructor(
    readonly element: HTMLElement,
    readonly stage: Stage,
  ) {}

  get orbit(): Orbit {
    return this.stage.linked ? this.stage.orbit : this.own;
  }

  look(aspect: number): Look {
    return this.fixed ?? this.orbit.look(aspect);
  }

  show(content: Model | null) {
    if (this.content === content) return;
    this.content = content;
    this.stage.draw();
  }

  rayAt(clientX: number, clientY: number): Ray {
    const box = this.element.getBoundingClientRect();
    const look = this.orbit.look(box.width / Math.max(box.height, 1));
    return rayThrough(look, (clientX - box.left) / box.width, (clientY - box.top) / box.height);
  }

  placeMarkers(look: Look, width: number, height: number) {
    for (const marker of this.markers) {
      const { x, y, facing } = project(look, marker.position, marker.normal);
      const { style } = marker.element;
      style.transform = `translate(${(x * width).toFixed(1)}px, ${(y * height).toFixed(1)}px)`;
      style.opacity = facing > -0.05 ? '1' : '0.28';
      style.zIndex = facing > -0.05 ? '2' : '1';
    }
  }
}

export class Stage {
  readonly canvas = document.createElement('canvas');
  readonly orbit = new Orbit();
  readonly views = new Set<View>();
  linked = true;
  onMoved: (() => void) | null = null;
  onFailed: (() => void) | null = null;
  private scheduled = false;
  private drawing = false;
  private again = false;
  /** What the last drawing shows; a drawing that would show the same is left out. */
  private shown = '';
  /** whether the page has yet to show the last drawing */
  private unseen = false;
  private readonly observer = new ResizeObserver(() => this.draw());
  private readonly soon = new MessageChannel();

  constructor(readonly host: HTMLElement) {
    this.canvas.setAttribute('aria-hidden', 'true');
    host.prepend(this.canvas);
    this.soon.port1.onmessage = () => this.paint();
    onReport((report) => {
      if (report.op === 'started' && !report.works) this.fail();
      else if (report.op === 'restored') this.redraw();
      else if (report.op === 'drawn') this.drawn();
      else if (report.op === 'shown' && !this.drawing) this.seen();
    });
    try {
      const canvas = this.canvas.transferControlToOffscreen();
      order({ op: 'start', canvas, ratio: Math.min(devicePixelRatio, 2) }, [canvas]);
    } catch {
      queueMicrotask(() => this.fail());
    }
    this.observer.observe(host);
  }

  private fail() {
    this.host.dataset.failed = 'webgl';
    this.onFailed?.();
  }

  add(element: HTMLElement): View {
    const view = new View(element, this);
    this.views.add(view);
    this.observer.observe(element);
    listen(view, this);
    this.draw();
    return view;
  }

  remove(view: View) {
    view.show(null);
    this.views.delete(view);
    this.observer.unobserve(view.element);
    this.draw();
  }

  draw() {
    this.host.dataset.busy = '';
    if (this.drawing) this.again = true;
    else if (!this.scheduled) {
      this.scheduled = true;
      this.soon.port2.postMessage(null);
    }
  }

  /** Draws even if nothing has changed: the canvas is empty. */
  private redraw() {
    this.shown = '';
    this.draw();
  }

  moved() {
    this.draw();
    this.onMoved?.();
  }

  private paint() {
    this.scheduled = false;
    const whole = this.host.getBoundingClientRect();
    if (this.host.dataset.failed || whole.width < 2 || whole.height < 2) return void delete this.host.dataset.busy;
    const frames: Frame[] = [];
    for (const view of this.views) {
      const box = view.element.getBoundingClientRect();
      if (box.width < 2 || box.height < 2) continue;
      const look = view.look(box.width / box.height);
      view.placeMarkers(look, box.width, box.height);
      if (view.content)
        frames.push({
          model: view.content.id,
          left: box.left - whole.left,
          top: box.top - whole.top,
          width: box.width,
          height: box.height,
          look,
        });
    }
    const now = JSON.stringify([whole.width, whole.height, frames, changesOrdered()]);
    if (now === this.shown) {
      if (!this.unseen) delete this.host.dataset.busy;
      return;
    }
    this.shown = now;
    this.drawing = this.unseen = true;
    order({ op: 'draw', width: whole.width, height: whole.height, frames });
  }

  private seen() {
    this.unseen = false;
    if (!this.scheduled) delete this.host.dataset.busy;
  }

  /** Tests use the event and data-busy to measure and to take pictures; nothing else depends on them. */
  private drawn() {
    this.drawing = false;
    this.host.dispatchEvent(new Event('drawn'));
    if (!this.again) return;
    this.again = false;
    this.draw();
  }
}

/** Handles mouse, touch, wheel and keys of one view. */
function listen(view: View, stage: Stage) {
  const { element } = view;
  const fingers = new Map<number, { x: number; y: number }>();
  let start: { x: number; y: number; moved: boolean } | null = null;
  let over = { x: NaN, y: NaN };

  element.addEventListener('pointerdown', (event) => {
    if ((event.target as HTMLElement).closest('button, input, a, select')) return;
    element.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    start = fingers.size === 1 ? { x: event.clientX, y: event.clientY, moved: false } : null;
  });
  element.addEventListener('pointermove', (event) => {
    const finger = fingers.get(event.pointerId);
    if (!finger && event.pointerType === 'mouse' && (event.clientX !== over.x || event.clientY !== over.y)) {
      over = { x: event.clientX, y: event.clientY }; // browsers also send the event where only the page has moved
      view.onHover?.(view.rayAt(over.x, over.y));
    }
    if (!finger) return;
    const dx = event.clientX - finger.x;
    const dy = event.clientY - finger.y;
    if (start && Math.hypot(event.clientX - start.x, event.clientY - start.y) > 4) start.moved = true;
    if (start && !start.moved) return;
    const size = Math.max(element.clientHeight, 1);
    if (fingers.size === 2) {
      const [a, b] = [...fingers.values()];
      const before = Math.hypot(a.x - b.x, a.y - b.y);
      finger.x = event.clientX;
      finger.y = event.clientY;
      const after = Math.hypot(a.x - b.x, a.y - b.y);
      view.orbit.zoom(before / Math.max(after, 1));
      view.orbit.pan((dx / size) * 0.3, (dy / size) * 0.3);
    } else if (event.buttons & 6 || event.shiftKey) view.orbit.pan((dx / size) * 0.57, (dy / size) * 0.57);
    else view.orbit.rotate((dx / size) * 4, (dy / size) * 4);
    finger.x = event.clientX;
    finger.y = event.clientY;
    stage.moved();
  });
  const end = (event: PointerEvent) => {
    if (!fingers.delete(event.pointerId)) return;
    if (event.type === 'pointerup' && start && !start.moved && event.button === 0)
      view.onPick?.(view.rayAt(event.clientX, event.clientY));
    start = null;
  };
  element.addEventListener('pointerleave', (event) => {
    if (event.pointerType !== 'mouse' || fingers.size) return;
    over = { x: NaN, y: NaN };
    view.onHover?.(null);
  });
  element.addEventListener('pointerup', end);
  element.addEventListener('pointercancel', end);
  element.addEventListener('contextmenu', (event) => event.preventDefault());
  element.addEventListener(
    'wheel',
    (event) => {
      event.preventDefault();
      view.orbit.zoom(Math.exp(Math.max(-60, Math.min(60, event.deltaY)) * 0.0025));
      stage.moved();
    },
    { passive: false },
  );
  element.addEventListener('keydown', (event) => {
    if (event.target !== element || event.ctrlKey || event.metaKey || event.altKey) return;
    const { orbit } = view;
    const step = 0.12;
    if (event.key === 'ArrowLeft') orbit.rotate(-step, 0);
    else if (event.key === 'ArrowRight') orbit.rotate(step, 0);
    else if (event.key === 'ArrowUp') orbit.rotate(0, -step);
    else if (event.key === 'ArrowDown') orbit.rotate(0, step);
    else if (event.key === '+' || event.key === '=') orbit.zoom(0.88);
    else if (event.key === '-') orbit.zoom(1.14);
    else if (event.key === '0') orbit.reset();
    else if (event.key === 'Enter') {
      const box = element.getBoundingClientRect();
      view.onPick?.(view.rayAt(box.left + box.width / 2, box.top + box.height / 2));
    } else return;
    event.preventDefault();
    event.stopPropagation();
    stage.moved();
  });
}
