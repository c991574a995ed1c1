/** Scene objects from what the worker hands over. Nothing here loops over vertices. */
import {
  BufferAttribute, BufferGeometry, Color, Group, LineBasicMaterial, LineSegments, Mesh, MeshBasicMaterial, Points, PointsMaterial, Sphere, Vector3,
  MeshMatcapMaterial, type Material,
} from 'three';
import type { Display } from '../mesh/geometry';
import type { MorphData } from '../mesh/morph';
import type { SphereData } from '../mesh/distortion';
import { surfaceMaterial, type Paint } from './materials';

const BALL = new Sphere(new Vector3(), 4);

function geometry(position: Float32Array, normal: Float32Array | null, index: Uint32Array): BufferGeometry {
  const made = new BufferGeometry();
  made.setAttribute('position', new BufferAttribute(position, 3));
  if (normal) made.setAttribute('normal', new BufferAttribute(normal, 3));
  made.setIndex(new BufferAttribute(index, 1));
  made.boundingSphere = BALL;
  return made;
}

/** A surface with its wireframe, whose paint can be changed. */
export class Model {
  readonly group = new Group();
  readonly mesh: Mesh<BufferGeometry, Material>;
  private lines: LineSegments<BufferGeometry, LineBasicMaterial> | null = null;
  private extra: Group | null = null;

  constructor(readonly shape: BufferGeometry, private readonly edges: Uint32Array | null, paint: Paint) {
    this.mesh = new Mesh(shape, surfaceMaterial(paint));
    this.mesh.frustumCulled = false;
    this.group.add(this.mesh);
  }

  paint(paint: Paint) {
    const old = this.mesh.material;
    this.mesh.material = surfaceMaterial(paint);
    old.dispose();
  }

  /** The same surface in another paint; attributes are its own. */
  twin(): Model {
    const shape = new BufferGeometry();
    for (const name of ['position', 'normal']) shape.setAttribute(name, this.shape.getAttribute(name));
    shape.setIndex(this.shape.getIndex());
    shape.boundingSphere = BALL;
    return new Model(shape, this.edges, { kind: 'plain', color: '#ffffff' });
  }

  color(color: string | Color) {
    (this.mesh.material as MeshMatcapMaterial).color.set(color);
  }

  attribute(name: 'value' | 'tone', data: Float32Array) {
    this.shape.setAttribute(name, new BufferAttribute(data, name === 'value' ? 1 : 3));
  }

  /** The weights of the targets, for the surface and its wireframe. */
  weights(weights: ArrayLike<number>) {
    for (const object of [this.mesh, this.lines])
      if (object?.morphTargetInfluences) for (let k = 0; k < weights.length; k++) object.morphTargetInfluences[k] = weights[k];
  }

  /** -> whether something new was made for it */
  wireframe(shown: boolean, color: string): boolean {
    if (!this.edges) return false;
    const fresh = shown && !this.lines;
    if (fresh) {
      const wires = new BufferGeometry();
      wires.setAttribute('position', this.shape.getAttribute('position'));
      wires.setIndex(new BufferAttribute(this.edges, 1));
      wires.boundingSphere = BALL;
      if (this.shape.morphAttributes.position) {
        wires.morphTargetsRelative = true;
        wires.morphAttributes.position = this.shape.morphAttributes.position;
      }
      this.lines = new LineSegments(wires, new LineBasicMaterial({ transparent: true, opacity: 0.42 }));
      this.lines.frustumCulled = false;
      this.group.add(this.lines);
      if (this.mesh.morphTargetInfluences) this.weights(this.mesh.morphTargetInfluences);
    }
    if (this.lines) {
      this.lines.visible = shown;
      this.lines.material.color.set(color);
    }
    return fresh;
  }

  /** Red edges, points and faces over the surface. */
  faults(faults: { lines: Float32Array; points: Float32Array; triangles: Float32Array } | null) {
    if (this.extra) {
      this.group.remove(this.extra);
      dispose(this.extra);
    }
    this.extra = null;
    if (!faults) return;
    const red = new Color('#e5383b');
    this.extra = new Group();
    const add = (data: Float32Array, make: (g: BufferGeometry) => Mesh | LineSegments | Points) => {
      if (!data.length) return;
      const shape = new BufferGeometry();
      shape.setAttribute('position', new BufferAttribute(data, 3));
      shape.boundingSphere = BALL;
      const object = make(shape);
      object.frustumCulled = false;
      this.extra!.add(object);
    };
    add(faults.triangles, (g) => new Mesh(g, new MeshBasicMaterial({ color: red, transparent: true, opacity: 0.75 })));
    add(faults.lines, (g) => new LineSegments(g, new LineBasicMaterial({ color: red, depthTest: false })));
    add(faults.lines, (g) => new Points(g, new PointsMaterial({ color: red, size: 5, sizeAttenuation: false, depthTest: false })));
    add(faults.points, (g) => new Points(g, new PointsMaterial({ color: red, size: 10, sizeAttenuation: false, depthTest: false })));
    this.group.add(this.extra);
  }

  dispose() {
    dispose(this.group);
  }
}

function dispose(group: Group) {
  group.traverse((object) => {
    const { geometry: shape, material } = object as Partial<Mesh>;
    shape?.dispose();
    (material as Material | undefined)?.dispose();
  });
}

export const shapeModel = (d: Display, color: string) =>
  new Model(geometry(d.position, d.normal, d.index), d.edges, { kind: 'plain', color });

/** Models of one morph share its geometry: one on the GPU, any number of weights. */
export function morphModels(d: MorphData, count: number, color: string): Model[] {
  const shape = geometry(d.position, d.normal, d.index);
  if (d.targets.length) {
    shape.morphTargetsRelative = true;
    shape.morphAttributes.position = d.targets.map((t) => new BufferAttribute(t.position, 3));
    shape.morphAttributes.normal = d.targets.map((t) => new BufferAttribute(t.normal, 3));
  }
  return Array.from({ length: count }, () => new Model(shape, d.edges, { kind: 'plain', color }));
}

/** The surface and the sphere of an embedding. */
export function sphereModels(d: SphereData): { surface: Model; ball: Model } {
  const white = { kind: 'plain', color: '#ffffff' } as const;
  const { surface, sphere } = d;
  const ball = new Model(geometry(sphere, sphere, surface.index), surface.edges, white);
  ball.group.scale.setScalar(0.72); // a ball fills its box more than a shape does
  return { surface: new Model(geometry(surface.position, surface.normal, surface.index), surface.edges, white), ball };
}
