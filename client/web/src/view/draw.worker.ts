/// <reference lib="webworker" />
/** The drawing worker. It owns the canvas, the scene objects and their buffers; messages.ts defines its orders. */
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  Group,
  LineBasicMaterial,
  LineSegments,
  Matrix4,
  ClampToEdgeWrapping,
  Mesh,
  MeshBasicMaterial,
  MirroredRepeatWrapping,
  PerspectiveCamera,
  Points,
  PointsMaterial,
  Scene,
  RepeatWrapping,
  type ShaderMaterial,
  Sphere,
  SRGBColorSpace,
  Texture,
  Vector3,
  WebGLRenderer,
  type Material,
  type Object3D,
} from 'three';
import { FIELD, type Look } from './camera';
import { closeImages, type Skin } from '../mesh/dress';
import type { Paint, Rgb } from './colors';
import type { Defects, Frame, Order, Report, Surface } from './messages';
import { DENSE, SLOTS, surfaceMaterial, wireMaterial, type Clad } from './surface';

const BALL = new Sphere(new Vector3(), 4);
const send = (report: Report) => self.postMessage(report);

function dispose(object: Object3D) {
  object.traverse((part) => {
    const { geometry, material } = part as Partial<Mesh>;
    geometry?.dispose();
    for (const one of [material ?? []].flat() as Material[]) one.dispose();
  });
}

const WRAPS: Record<number, typeof RepeatWrapping | typeof ClampToEdgeWrapping | typeof MirroredRepeatWrapping> = {
  33071: ClampToEdgeWrapping,
  33648: MirroredRepeatWrapping,
};

/** One entry for each cover of a skin. Covers with the same image, repeated alike, share one texture. */
function cladsOf({ covers, images, dye }: Skin): Clad[] {
  const maps = new Map<string, Texture>();
  return covers.map((cover) => {
    const image = images[cover.image];
    if (!image) return { cover, map: null, dyed: !!dye };
    const key = [cover.image, ...cover.wrap].join(' ');
    const map = maps.get(key) ?? new Texture(image);
    if (!maps.has(key)) {
      maps.set(key, map);
      map.colorSpace = SRGBColorSpace;
      map.flipY = false;
      [map.wrapS, map.wrapT] = cover.wrap.map((wrap) => WRAPS[wrap] ?? RepeatWrapping);
      map.needsUpdate = true;
    }
    return { cover, map, dyed: !!dye };
  });
}

/** The buffers of a surface; several models may draw them. */
class Buffers {
  readonly position: BufferAttribute;
  readonly normal: BufferAttribute;
  readonly index: BufferAttribute;
  readonly edges: BufferAttribute;
  readonly targets: { position: BufferAttribute; normal: BufferAttribute }[];
  readonly slots: number;
  readonly dense: boolean;
  readonly skin: Skin | null;
  readonly clads: Clad[];
  private readonly uv: BufferAttribute | null;
  private readonly dye: BufferAttribute | null;
  private models = 0;

  constructor({ position, normal, index, edges, targets = [], skin }: Surface) {
    this.position = new BufferAttribute(position, 3);
    this.normal = normal === position ? this.position : new BufferAttribute(normal, 3);
    this.index = new BufferAttribute(index, 1);
    this.edges = new BufferAttribute(edges, 1);
    this.targets = targets.map((t) => ({
      position: new BufferAttribute(t.position, 3),
      normal: new BufferAttribute(t.normal, 3),
    }));
    this.slots = Math.min(targets.length, SLOTS);
    this.dense = index.length >= 3 * DENSE;
    this.skin = skin ?? null;
    this.clads = skin ? cladsOf(skin) : [];
    this.uv = skin ? new BufferAttribute(skin.uv, 2) : null;
    this.dye = skin?.dye ? new BufferAttribute(skin.dye, 3) : null;
  }

  /** Counts one more model that draws them. */
  take(): this {
    this.models++;
    return this;
  }

  /** Counts one model less. The last one frees the textures and their images. */
  drop() {
    if (--this.models > 0) return;
    for (const { map } of this.clads) map?.dispose();
    closeImages(this.skin);
  }

  geometry(index: BufferAttribute, normals: boolean): BufferGeometry {
    const made = new BufferGeometry();
    made.setAttribute('position', this.position);
    if (normals) made.setAttribute('normal', this.normal);
    if (normals && this.uv) made.setAttribute('uv', this.uv);
    if (normals && this.dye) made.setAttribute('dye', this.dye);
    if (normals) for (const { start, count, cover } of this.skin?.runs ?? []) made.addGroup(start, count, cover);
    made.setIndex(index);
    made.boundingSphere = BALL;
    return made;
  }
}

class Model {
  readonly group = new Group();
  private readonly mesh: Mesh<BufferGeometry, ShaderMaterial | ShaderMaterial[]>;
  private lines: LineSegments<BufferGeometry, ShaderMaterial> | null = null;
  private extra: Group | null = null;
  private current: number[] = [];

  constructor(
    readonly buffers: Buffers,
    paint: Paint,
    scale = 1,
  ) {
    this.mesh = new Mesh(buffers.geometry(buffers.index, true), this.materials(paint));
    this.mesh.frustumCulled = false;
    this.group.scale.setScalar(scale);
    this.group.add(this.mesh);
    this.weights(buffers.targets.map(() => 0));
  }

  private materials(paint: Paint): ShaderMaterial | ShaderMaterial[] {
    const { slots, dense, clads } = this.buffers;
    if (paint.kind !== 'skin') return surfaceMaterial(paint, slots, dense);
    return clads.map((clad) => surfaceMaterial(paint, slots, dense, clad));
  }

  paint(paint: Paint) {
    for (const old of [this.mesh.material].flat()) old.dispose();
    this.mesh.material = this.materials(paint);
    this.weights(this.current);
  }

  color(color: Rgb) {
    const { material } = this.mesh; // a skin keeps its own colours
    if (!Array.isArray(material)) material.uniforms.base.value = color;
  }

  attribute(name: string, data: Float32Array) {
    this.mesh.geometry.setAttribute(name, new BufferAttribute(data, name === 'value' ? 1 : 3));
  }

  /** The targets with the largest weights take the slots. */
  weights(weights: number[]) {
    this.current = weights;
    const { slots, targets } = this.buffers;
    if (!slots) return;
    const taken = [...weights.keys()]
      .sort((a, b) => Math.abs(weights[b]) - Math.abs(weights[a]))
      .slice(0, slots)
      .sort((a, b) => a - b);
    for (const object of [this.mesh, this.lines]) {
      if (!object) continue;
      taken.forEach((k, slot) => {
        object.geometry.setAttribute(`targetPosition${slot}`, targets[k].position);
        if (object === this.mesh) object.geometry.setAttribute(`targetNormal${slot}`, targets[k].normal);
      });
      for (const { uniforms } of [object.material].flat()) uniforms.weight.value = taken.map((k) => weights[k]);
    }
  }

  wireframe(shown: boolean, color: Rgb) {
    if (shown && !this.lines) {
      this.lines = new LineSegments(this.buffers.geometry(this.buffers.edges, false), wireMaterial(this.buffers.slots));
      this.lines.frustumCulled = false;
      this.group.add(this.lines);
      this.weights(this.current);
    }
    if (!this.lines) return;
    this.lines.visible = shown;
    this.lines.material.uniforms.base.value = color;
    this.lines.material.uniforms.strength.value = this.buffers.dense ? 0.2 : 0.42;
  }

  defects(defects: Defects | null) {
    if (this.extra) {
      this.group.remove(this.extra);
      dispose(this.extra);
    }
    this.extra = null;
    if (!defects) return;
    const red = new Color('#e5383b');
    const extra = (this.extra = new Group());
    const add = (data: Float32Array, make: (g: BufferGeometry) => Mesh | LineSegments | Points) => {
      if (!data.length) return;
      const shape = new BufferGeometry();
      shape.setAttribute('position', new BufferAttribute(data, 3));
      shape.boundingSphere = BALL;
      const object = make(shape);
      object.frustumCulled = false;
      extra.add(object);
    };
    add(defects.triangles, (g) => new Mesh(g, new MeshBasicMaterial({ color: red, transparent: true, opacity: 0.75 })));
    add(defects.lines, (g) => new LineSegments(g, new LineBasicMaterial({ color: red, depthTest: false })));
    add(
      defects.lines,
      (g) => new Points(g, new PointsMaterial({ color: red, size: 5, sizeAttenuation: false, depthTest: false })),
    );
    add(
      defects.points,
      (g) => new Points(g, new PointsMaterial({ color: red, size: 10, sizeAttenuation: false, depthTest: false })),
    );
    this.group.add(extra);
  }
}

const models = new Map<number, Model>();
const scene = new Scene();
scene.matrixWorldAutoUpdate = true;
const camera = new PerspectiveCamera(FIELD, 1);
camera.matrixAutoUpdate = false;
let renderer: WebGLRenderer | null = null;

function start(canvas: OffscreenCanvas, ratio: number) {
  try {
    renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, powerPreference: 'high-performance' });
    renderer.debug.checkShaderErrors = import.meta.env.DEV;
    renderer.setScissorTest(true);
    renderer.setPixelRatio(ratio);
    canvas.addEventListener('webglcontextrestored', () => send({ op: 'restored' }));
  } catch {
    // reported below
  }
  send({ op: 'started', works: renderer !== null });
}

function placeCamera({ eye, right, up, back, near, far, aspect }: Look) {
  camera.matrix.copy(
    new Matrix4().makeBasis(new Vector3(...right), new Vector3(...up), new Vector3(...back)).setPosition(...eye),
  );
  camera.near = near;
  camera.far = far;
  camera.aspect = aspect;
  camera.updateProjectionMatrix();
  camera.updateMatrixWorld(true);
}

function draw(width: number, height: number, frames: Frame[]) {
  if (!renderer) return;
  const ratio = renderer.getPixelRatio();
  const { domElement: canvas } = renderer;
  if (canvas.width !== Math.floor(width * ratio) || canvas.height !== Math.floor(height * ratio))
    renderer.setSize(width, height, false);
  renderer.setClearColor(0, 0);
  renderer.setScissor(0, 0, width, height);
  renderer.setViewport(0, 0, width, height);
  renderer.clear();
  for (const frame of frames) {
    const model = models.get(frame.model);
    if (!model) continue;
    const bottom = height - frame.top - frame.height;
    renderer.setViewport(frame.left, bottom, frame.width, frame.height);
    renderer.setScissor(frame.left, bottom, frame.width, frame.height);
    placeCamera(frame.look);
    scene.add(model.group);
    renderer.render(scene, camera);
    scene.remove(model.group);
  }
}

type Drawing = Extract<Order, { op: 'draw' }>;
let next: Drawing | null = null;
let pending = 0; // animation frames until the browser has taken the last drawing

/**
 * Draws at once, or, while the browser has not taken the last drawing, in its next animation frame. So the page prepares
 * a drawing meanwhile, and no animation frame passes without one: where the GPU is slow, it lasts as long as a drawing.
 */
function drawNow({ width, height, frames }: Drawing, until: number) {
  draw(width, height, frames);
  send({ op: 'drawn' });
  pending = until;
}

function taken() {
  if (--pending === 0) send({ op: 'shown' });
  const drawing = next;
  next = null;
  if (drawing) drawNow(drawing, 1);
  if (pending) requestAnimationFrame(taken);
}

function execute(order: Order) {
  if (order.op === 'start') return start(order.canvas, order.ratio);
  if (order.op === 'draw') {
    if (pending) {
      next = order;
      return;
    }
    drawNow(order, 2); // between animation frames: the browser may take it only after the next one has begun
    requestAnimationFrame(taken);
    return;
  }
  if (order.op === 'model') {
    const buffers = order.surface ? new Buffers(order.surface) : models.get(order.same!)?.buffers;
    if (buffers) models.set(order.model, new Model(buffers.take(), order.paint, order.scale));
    return;
  }
  const model = models.get(order.model);
  if (!model) return;
  switch (order.op) {
    case 'paint':
      return model.paint(order.paint);
    case 'color':
      return model.color(order.color);
    case 'attribute':
      return model.attribute(order.name, order.data);
    case 'weights':
      return model.weights(order.weights);
    case 'wireframe':
      return model.wireframe(order.shown, order.color);
    case 'defects':
      return model.defects(order.defects);
    case 'dispose':
      dispose(model.group);
      model.buffers.drop();
      models.delete(order.model);
  }
}

self.onmessage = ({ data }: MessageEvent<Order>) => execute(data);
