/**
 * One canvas under all views. Each view is a rectangle of the page with its own scene; the canvas is drawn only when
 * something has changed. Views that share an Orbit are linked.
 */
import { PerspectiveCamera, Scene, Vector3, WebGLRenderer, type Object3D } from 'three';
import { Orbit } from './orbit';

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
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(32, 1, 0.1, 100);
  content: Object3D | null = null;
  markers: Marker[] = [];
  onPick: ((ray: Ray) => void) | null = null;
  own = new Orbit();

  constructor(readonly element: HTMLElement, readonly stage: Stage) {}

  get orbit(): Orbit {
    return this.stage.linked ? this.stage.orbit : this.own;
  }

  show(content: Object3D | null) {
    if (this.content === content) return;
    if (this.content) this.scene.remove(this.content);
    this.content = content;
    if (content) {
      this.scene.add(content);
      this.stage.prepare(content);
    }
    this.stage.draw();
  }

  rayAt(clientX: number, clientY: number): Ray {
    const box = this.element.getBoundingClientRect();
    this.orbit.apply(this.camera, box.width / Math.max(box.height, 1));
    const x = ((clientX - box.left) / box.width) * 2 - 1;
    const y = 1 - ((clientY - box.top) / box.height) * 2;
    const far = new Vector3(x, y, 0.5).unproject(this.camera);
    const direction = far.sub(this.camera.position).normalize();
    return { origin: this.camera.position.toArray(), direction: direction.toArray() };
  }

  placeMarkers(width: number, height: number) {
    const point = new Vector3();
    const normal = new Vector3();
    for (const marker of this.markers) {
      point.fromArray(marker.position);
      const facing = normal.fromArray(marker.normal).dot(this.camera.position.clone().sub(point).normalize());
      point.project(this.camera);
      const x = ((point.x + 1) / 2) * width;
      const y = ((1 - point.y) / 2) * height;
      const { style } = marker.element;
      style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
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
  onDrawn: (() => void) | null = null;
  onMoved: (() => void) | null = null;
  private renderer: WebGLRenderer | null = null;
  private asked = 0;
  private observer = new ResizeObserver(() => this.draw());
  /** frames drawn since the page was opened; a page at rest draws none */
  frames = 0;

  constructor(readonly host: HTMLElement) {
    this.canvas.setAttribute('aria-hidden', 'true');
    host.prepend(this.canvas);
    try {
      this.renderer = new WebGLRenderer({ canvas: this.canvas, antialias: true, alpha: true, powerPreference: 'high-performance' });
      this.renderer.debug.checkShaderErrors = import.meta.env.DEV;
      this.renderer.setScissorTest(true);
      this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    } catch {
      host.dataset.failed = 'webgl';
    }
    this.observer.observe(host);
    this.canvas.addEventListener('webglcontextrestored', () => this.draw());
  }

  get works(): boolean {
    return this.renderer !== null;
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

  /** Has the programs of an object compiled beside the page's work; nothing is drawn until they are there. */
  prepare(object: Object3D) {
    if (!this.renderer?.extensions.has('KHR_parallel_shader_compile')) return;
    this.preparing++;
    void this.renderer.compileAsync(object, this.camera).catch(() => {}).finally(() => {
      this.preparing--;
      this.draw();
    });
  }
  private preparing = 0;
  private readonly camera = new PerspectiveCamera();

  draw() {
    if (!this.asked) this.asked = requestAnimationFrame(() => this.paint());
  }

  moved() {
    this.draw();
    this.onMoved?.();
  }

  private paint() {
    this.asked = 0;
    const { renderer, canvas, host } = this;
    if (!renderer || this.preparing) return;
    this.frames++;
    const whole = host.getBoundingClientRect();
    const ratio = renderer.getPixelRatio();
    if (canvas.width !== Math.floor(whole.width * ratio) || canvas.height !== Math.floor(whole.height * ratio))
      renderer.setSize(whole.width, whole.height);
    renderer.setClearColor(0, 0);
    renderer.setScissor(0, 0, whole.width, whole.height);
    renderer.setViewport(0, 0, whole.width, whole.height);
    renderer.clear();
    for (const view of this.views) {
      const box = view.element.getBoundingClientRect();
      if (box.width < 2 || box.height < 2) continue;
      const left = box.left - whole.left;
      const bottom = whole.bottom - box.bottom;
      renderer.setViewport(left, bottom, box.width, box.height);
      renderer.setScissor(left, bottom, box.width, box.height);
      view.orbit.apply(view.camera, box.width / box.height);
      if (view.content) renderer.render(view.scene, view.camera);
      view.placeMarkers(box.width, box.height);
    }
    this.onDrawn?.();
  }
}

/** Mouse, touch, wheel and keys of one view. */
function listen(view: View, stage: Stage) {
  const { element } = view;
  const fingers = new Map<number, { x: number; y: number }>();
  let start: { x: number; y: number; moved: boolean } | null = null;

  element.addEventListener('pointerdown', (event) => {
    if ((event.target as HTMLElement).closest('button, input, a, select')) return;
    element.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    start = fingers.size === 1 ? { x: event.clientX, y: event.clientY, moved: false } : null;
  });
  element.addEventListener('pointermove', (event) => {
    const finger = fingers.get(event.pointerId);
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
    if (event.type === 'pointerup' && start && !start.moved && event.button === 0) view.onPick?.(view.rayAt(event.clientX, event.clientY));
    start = null;
  };
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
    const turn = 0.12;
    if (event.key === 'ArrowLeft') orbit.rotate(-turn, 0);
    else if (event.key === 'ArrowRight') orbit.rotate(turn, 0);
    else if (event.key === 'ArrowUp') orbit.rotate(0, -turn);
    else if (event.key === 'ArrowDown') orbit.rotate(0, turn);
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
