/** How surfaces are shaded: one painted studio light (a matcap made here), tinted, with colours from data on request. */
import { Color, DataTexture, LinearFilter, MeshMatcapMaterial, RGBAFormat, SRGBColorSpace, type Texture } from 'three';

let matcap: DataTexture | null = null;

/** Soft key light from the upper left, a cool fill, a rim, a small highlight; painted over the hemisphere of normals. */
function studioLight(): Texture {
  if (matcap) return matcap;
  const size = 256;
  const data = new Uint8Array(size * size * 4);
  const unit = (x: number, y: number, z: number) => {
    const l = Math.hypot(x, y, z);
    return [x / l, y / l, z / l];
  };
  const key = unit(-0.45, 0.75, 0.6);
  const fill = unit(0.8, -0.1, 0.45);
  const half = unit(-0.3, 0.5, 1.1);
  for (let j = 0; j < size; j++)
    for (let i = 0; i < size; i++) {
      let x = (i + 0.5) / (size / 2) - 1;
      let y = (j + 0.5) / (size / 2) - 1;
      const r = Math.hypot(x, y);
      if (r > 0.995) {
        x *= 0.995 / r;
        y *= 0.995 / r;
      }
      const z = Math.sqrt(Math.max(0, 1 - x * x - y * y));
      const dot = (v: number[]) => x * v[0] + y * v[1] + z * v[2];
      const k = Math.max(0, dot(key) * 0.72 + 0.28);
      const f = Math.max(0, dot(fill));
      const sky = 0.5 + 0.5 * y;
      const rim = (1 - z) ** 3;
      const shine = Math.max(0, dot(half)) ** 42;
      const light = 0.16 + 0.13 * sky + 0.78 * k * k + 0.12 * f;
      const at = 4 * (j * size + i);
      const tone = (x: number) => 255 * Math.min(1, x) ** (1 / 1.9);
      data[at] = tone(light * 0.98 + 0.1 * shine + 0.05 * rim);
      data[at + 1] = tone(light * 0.965 + 0.1 * shine + 0.06 * rim);
      data[at + 2] = tone(light * 0.95 + 0.03 * (1 - k) + 0.1 * shine + 0.09 * rim);
      data[at + 3] = 255;
    }
  matcap = new DataTexture(data, size, size, RGBAFormat);
  matcap.colorSpace = SRGBColorSpace;
  matcap.magFilter = matcap.minFilter = LinearFilter;
  matcap.needsUpdate = true;
  return matcap;
}

type Rgb = [number, number, number];
export const RAMPS: Record<'heat' | 'diverging', Rgb[]> = {
  heat: [[38, 44, 92], [44, 90, 140], [42, 142, 148], [92, 186, 128], [190, 214, 96], [250, 196, 80], [240, 122, 66], [196, 44, 70]],
  diverging: [[36, 70, 150], [72, 132, 196], [150, 196, 222], [240, 238, 232], [242, 184, 150], [214, 106, 84], [150, 32, 58]],
};

export function rampCss(name: keyof typeof RAMPS): string {
  return `linear-gradient(90deg, ${RAMPS[name].map((c) => `rgb(${c.join(' ')})`).join(', ')})`;
}

const textures = new Map<string, DataTexture>();
function rampTexture(name: keyof typeof RAMPS): DataTexture {
  const known = textures.get(name);
  if (known) return known;
  const stops = RAMPS[name];
  const data = new Uint8Array(256 * 4);
  for (let i = 0; i < 256; i++) {
    const at = (i / 255) * (stops.length - 1);
    const k = Math.min(Math.floor(at), stops.length - 2);
    for (let c = 0; c < 3; c++) data[4 * i + c] = stops[k][c] + (at - k) * (stops[k + 1][c] - stops[k][c]);
    data[4 * i + 3] = 255;
  }
  const texture = new DataTexture(data, 256, 1, RGBAFormat);
  texture.colorSpace = SRGBColorSpace;
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  textures.set(name, texture);
  return texture;
}

export type Paint =
  | { kind: 'plain'; color: string }
  /** attribute `value` through a ramp */
  | { kind: 'value'; ramp: keyof typeof RAMPS; low: number; high: number; log?: boolean }
  /** attribute `tone` (a direction) as red, green, blue */
  | { kind: 'direction' }
  /** attribute `tone` (a place on the sphere) as a checkerboard */
  | { kind: 'checker' };

const FRAGMENT: Record<Exclude<Paint['kind'], 'plain'>, string> = {
  value: `float paintAt = clamp((paintLog ? log(max(vValue, 1e-12)) : vValue) * paintRange.x + paintRange.y, 0.0, 1.0);
    diffuseColor.rgb = texture2D(paintRamp, vec2(0.002 + 0.996 * paintAt, 0.5)).rgb;`,
  direction: `diffuseColor.rgb = pow(clamp(0.5 + 0.5 * normalize(vTone), 0.0, 1.0), vec3(1.7));`,
  checker: `vec3 d = normalize(vTone);
    vec3 a = abs(d);
    vec2 st = a.x >= a.y && a.x >= a.z ? d.yz / a.x : (a.y >= a.z ? d.zx / a.y : d.xy / a.z);
    vec2 cell = atan(st) * (4.0 / 0.78539816);
    vec2 pixel = max(fwidth(cell), vec2(1e-4));
    vec2 wave = (abs(fract(cell * 0.5) - 0.5) - 0.25) * 2.0;
    vec2 edge = clamp(wave / pixel + 0.5, 0.0, 1.0);
    float dark = edge.x * (1.0 - edge.y) + edge.y * (1.0 - edge.x);
    vec3 side = a.x >= a.y && a.x >= a.z ? vec3(0.86, 0.42, 0.33) : (a.y >= a.z ? vec3(0.27, 0.52, 0.60) : vec3(0.88, 0.68, 0.30));
    diffuseColor.rgb = mix(vec3(0.93, 0.92, 0.89), side, dark);`,
};

export function surfaceMaterial(paint: Paint): MeshMatcapMaterial {
  const material = new MeshMatcapMaterial({
    matcap: studioLight(),
    color: paint.kind === 'plain' ? new Color(paint.color) : new Color('#ffffff'),
    polygonOffset: true,
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 1,
  });
  if (paint.kind === 'plain') return material;
  const uniforms: Record<string, { value: unknown }> = {};
  if (paint.kind === 'value') {
    const low = paint.log ? Math.log(Math.max(paint.low, 1e-12)) : paint.low;
    const high = paint.log ? Math.log(Math.max(paint.high, 1e-12)) : paint.high;
    const scale = 1 / (high - low || 1);
    uniforms.paintRamp = { value: rampTexture(paint.ramp) };
    uniforms.paintRange = { value: { x: scale, y: -low * scale, isVector2: true } };
    uniforms.paintLog = { value: !!paint.log };
  }
  const varying = paint.kind === 'value' ? 'varying float vValue;' : 'varying vec3 vTone;';
  const attribute = paint.kind === 'value' ? 'attribute float value;' : 'attribute vec3 tone;';
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    shader.vertexShader = `${attribute}\n${varying}\n${shader.vertexShader}`.replace(
      '#include <begin_vertex>',
      `#include <begin_vertex>\n${paint.kind === 'value' ? 'vValue = value;' : 'vTone = tone;'}`,
    );
    const declared = paint.kind === 'value' ? 'uniform sampler2D paintRamp; uniform vec2 paintRange; uniform bool paintLog;' : '';
    shader.fragmentShader = `${declared}\n${varying}\n${shader.fragmentShader}`.replace('#include <color_fragment>', FRAGMENT[paint.kind]);
  };
  material.customProgramCacheKey = () => paint.kind;
  return material;
}
