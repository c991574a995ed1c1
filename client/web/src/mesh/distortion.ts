/**
 * The distortion of a spherical map from sphere.ply, per triangle and per vertex, as the daemon defines it: both areas
 * are scaled to be equal, the image of a triangle is its flat chord triangle, sigma1 >= sigma2 are the singular values.
 */
import { buildDisplay, type Display } from './geometry';
import { parseMesh } from './parse';
import { doubleArea, edges } from './triangle';

export const MEASURES = ['symmetric_dirichlet', 'angle', 'area', 'aspect'] as const;
export type MeasureName = (typeof MEASURES)[number];

export interface SphereData {
  surface: Display;
  /** for each drawn vertex, its point on the sphere */
  sphere: Float32Array;
  values: Record<MeasureName, Float32Array>;
}

export function decodeSphere(buffer: ArrayBuffer): SphereData {
  const raw = parseMesh(buffer);
  const { positions: x, corners, properties } = raw;
  const [px, py, pz] = ['px', 'py', 'pz'].map((name) => properties?.get(name));
  if (!px || !py || !pz) throw new Error('The file has no points on the sphere.');
  const n = x.length / 3;
  const image = new Float64Array(3 * n);
  for (let i = 0; i < n; i++) {
    image[3 * i] = px[i];
    image[3 * i + 1] = py[i];
    image[3 * i + 2] = pz[i];
  }
  const values = vertexDistortion(x, image, corners);
  // one drawn vertex for each vertex of the mesh: splitting at creases would open the sphere
  const surface = buildDisplay({ ...raw, properties: undefined, dress: null }, 180);
  const sphere = new Float32Array(surface.position.length);
  const spread = {} as Record<MeasureName, Float32Array>;
  for (const name of MEASURES) spread[name] = new Float32Array(surface.position.length / 3);
  for (let c = 0; c < corners.length; c++) {
    const from = corners[c];
    const to = surface.index[c];
    for (let k = 0; k < 3; k++) sphere[3 * to + k] = image[3 * from + k];
    for (const name of MEASURES) spread[name][to] = values[name][from];
  }
  return { surface, sphere, values: spread };
}

/** The Gram matrix of the edges at the first corner: (uu, uv, vv). */
function gram(p: Float64Array, a: number, b: number, c: number): [number, number, number] {
  const [u, v] = edges(p, a, b, c);
  const dot = (x: number[], y: number[]) => x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
  return [dot(u, u), dot(u, v), dot(v, v)];
}

export interface TriangleDistortion {
  sigma1: Float64Array;
  sigma2: Float64Array;
  aspect: Float64Array;
  weight: Float64Array;
}

export function triangleDistortion(x: Float64Array, image: Float64Array, corners: Uint32Array): TriangleDistortion {
  const n = corners.length / 3;
  const out = {
    sigma1: new Float64Array(n),
    sigma2: new Float64Array(n),
    aspect: new Float64Array(n),
    weight: new Float64Array(n),
  };
  let sumX = 0;
  let sumP = 0;
  for (let t = 0; t < n; t++) {
    const [a, b, c] = [3 * corners[3 * t], 3 * corners[3 * t + 1], 3 * corners[3 * t + 2]];
    out.weight[t] = doubleArea(x, a, b, c);
    sumX += out.weight[t];
    sumP += doubleArea(image, a, b, c);
  }
  const scale = sumX / sumP;
  for (let t = 0; t < n; t++) {
    const [a, b, c] = [3 * corners[3 * t], 3 * corners[3 * t + 1], 3 * corners[3 * t + 2]];
    const [E, F, G] = gram(x, a, b, c);
    const [e, f, g] = gram(image, a, b, c);
    const det = E * G - F * F || 1e-300;
    // the eigenvalues of (source metric)^-1 (image metric) are the squared singular values
    const trace = (scale * (G * e - 2 * F * f + E * g)) / det;
    const product = (scale * scale * Math.max(e * g - f * f, 0)) / det;
    const root = Math.sqrt(Math.max((trace * trace) / 4 - product, 0));
    const large = trace / 2 + root;
    out.sigma1[t] = Math.sqrt(large);
    out.sigma2[t] = Math.sqrt(large > 0 ? product / large : 0);
    const l1 = Math.sqrt(e);
    const l2 = Math.sqrt(g);
    const l3 = Math.sqrt(Math.max(e + g - 2 * f, 0));
    const double = Math.sqrt(Math.max(e * g - f * f, 1e-300));
    out.aspect[t] = (l1 * l2 * l3 * (l1 + l2 + l3)) / (4 * double * double);
  }
  return out;
}

/** The symmetric Dirichlet energy at each vertex of the map that takes x to image. */
export const vertexDirichlet = (x: Float64Array, image: Float64Array, corners: Uint32Array) =>
  vertexDistortion(x, image, corners).symmetric_dirichlet;

function vertexDistortion(
  x: Float64Array,
  image: Float64Array,
  corners: Uint32Array,
): Record<MeasureName, Float64Array> {
  const n = x.length / 3;
  const d = triangleDistortion(x, image, corners);
  const total = new Float64Array(n);
  const sum = {} as Record<MeasureName, Float64Array>;
  for (const name of MEASURES) sum[name] = new Float64Array(n);
  for (let t = 0; t < d.weight.length; t++) {
    const s1 = d.sigma1[t];
    const s2 = Math.max(d.sigma2[t], 1e-12);
    const w = d.weight[t] + 1e-300;
    const dirichlet = 0.25 * (s1 * s1 + 1 / (s1 * s1 || 1e-24) + s2 * s2 + 1 / (s2 * s2));
    const log = Math.log((s1 || 1e-12) * s2);
    for (let k = 0; k < 3; k++) {
      const v = corners[3 * t + k];
      total[v] += w;
      sum.symmetric_dirichlet[v] += w * dirichlet;
      sum.angle[v] += (w * s1) / s2;
      sum.area[v] += w * log;
      sum.aspect[v] += w * d.aspect[t];
    }
  }
  for (const name of MEASURES) for (let v = 0; v < n; v++) sum[name][v] /= total[v] || 1;
  return sum;
}
