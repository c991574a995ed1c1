/**
 * The materials of surfaces: one studio light computed from the normals, times a tint or colours from data. The few
 * morph targets that have a weight are plain vertex attributes. Meshes of many small triangles are lit at their
 * vertices, which looks the same and costs less than the loaders' standard materials.
 */
import { DataTexture, GLSL3, LinearFilter, RGBAFormat, ShaderMaterial, SRGBColorSpace, type Texture } from 'three';
import type { Cover } from '../mesh/dress';
import { linear, RAMPS, type Paint } from './colors';

/** How many targets can have a weight at once. Each takes two attributes; the surface itself takes three. */
export const SLOTS = 6;
/** From this number on, triangles are smaller than a few pixels. */
export const DENSE = 60_000;

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

/** Linear light by the normal in view space: a soft key light from the upper left, a cool fill, a rim, a highlight. */
const LIGHT = `
vec3 light(vec3 n) {
  float key = max(0.0, dot(n, vec3(-0.4240, 0.7067, 0.5654)) * 0.72 + 0.28);
  float fill = max(0.0, dot(n, vec3(0.8664, -0.1083, 0.4874)));
  float shine = max(0.0, dot(n, vec3(-0.2407, 0.4012, 0.8827)));
  shine *= shine; shine *= shine; shine *= shine; shine *= shine; shine *= shine; // to the 32nd
  float rim = 1.0 - clamp(n.z, 0.0, 1.0);
  rim *= rim * rim;
  float all = 0.225 + 0.065 * n.y + 0.78 * key * key + 0.12 * fill;
  vec3 c = min(vec3(1.0), all * vec3(0.98, 0.965, 0.95) + vec3(0.1 * shine) + rim * vec3(0.05, 0.06, 0.09) + vec3(0.0, 0.0, 0.03 * (1.0 - key)));
  return c * (0.8 + 0.2 * c);
}`;

/** Converts linear light to sRGB by a fit of its curve with square roots. */
const SHOWN = `
vec3 shown(vec3 c) {
  vec3 s1 = sqrt(c);
  vec3 s2 = sqrt(s1);
  return 0.585122381 * s1 + 0.783140355 * s2 - 0.368262736 * sqrt(s2);
}`;

const morph = (slots: number, normals: boolean) =>
  Array.from(
    { length: slots },
    (_, i) => `p += weight[${i}] * targetPosition${i};${normals ? ` n += weight[${i}] * targetNormal${i};` : ''}`,
  ).join(' ');
const declared = (slots: number, normals: boolean) =>
  slots
    ? `uniform float weight[${slots}]; ${Array.from({ length: slots }, (_, i) => `in vec3 targetPosition${i};${normals ? ` in vec3 targetNormal${i};` : ''}`).join(' ')}`
    : '';

const COLOR: Record<Paint['kind'], string> = {
  plain: 'vec3 c = base;',
  skin: '',
  value: `float at = clamp((rampLog ? log(max(vValue, 1e-12)) : vValue) * rampRange.x + rampRange.y, 0.0, 1.0);
    vec3 c = texture(ramp, vec2(0.002 + 0.996 * at, 0.5)).rgb;`,
  direction: 'vec3 c = pow(clamp(0.5 + 0.5 * normalize(vTone), 0.0, 1.0), vec3(1.7));',
  checker: `vec3 d = normalize(vTone);
    vec3 a = abs(d);
    vec2 st = a.x >= a.y && a.x >= a.z ? d.yz / a.x : (a.y >= a.z ? d.zx / a.y : d.xy / a.z);
    vec2 cell = atan(st) * (4.0 / 0.78539816);
    vec2 pixel = max(fwidth(cell), vec2(1e-4));
    vec2 wave = (abs(fract(cell * 0.5) - 0.5) - 0.25) * 2.0;
    vec2 edge = clamp(wave / pixel + 0.5, 0.0, 1.0);
    float dark = edge.x * (1.0 - edge.y) + edge.y * (1.0 - edge.x);
    vec3 side = a.x >= a.y && a.x >= a.z ? vec3(0.86, 0.42, 0.33) : (a.y >= a.z ? vec3(0.27, 0.52, 0.60) : vec3(0.88, 0.68, 0.30));
    vec3 c = mix(vec3(0.93, 0.92, 0.89), side, dark);`,
};

/** The cover of a run of triangles. `dyed`: the vertices have colours, in attribute `dye`. */
export interface Clad {
  cover: Cover;
  map: Texture | null;
  dyed: boolean;
}

const cladColor = ({ cover, map, dyed }: Clad) => `vec4 s = vec4(base${dyed ? ' * vDye' : ''}, 1.0);
    ${map ? 's *= texture(map, vUv);' : ''}
    ${map && cover.cutoff ? 'if (s.a < cutoff) discard;' : ''}
    vec3 c = s.rgb;`;

/** What the vertices hand on to the pixels: declared and set at the vertices, declared at the pixels. */
function carried(paint: Paint, clad: Clad | undefined): [string, string, string] {
  if (paint.kind === 'value')
    return [
      'in float value; out float vValue;',
      'vValue = value;',
      'in float vValue; uniform sampler2D ramp; uniform vec2 rampRange; uniform bool rampLog;',
    ];
  if (paint.kind === 'direction' || paint.kind === 'checker')
    return ['in vec3 tone; out vec3 vTone;', 'vTone = tone;', 'in vec3 vTone;'];
  if (!clad) return ['', '', ''];
  const { map, dyed } = clad; // three declares uv
  return [
    `${map ? 'out vec2 vUv;' : ''} ${dyed ? 'in vec3 dye; out vec3 vDye;' : ''}`,
    `${map ? 'vUv = uv;' : ''} ${dyed ? 'vDye = dye;' : ''}`,
    `${map ? 'in vec2 vUv; uniform sampler2D map; uniform float cutoff;' : ''} ${dyed ? 'in vec3 vDye;' : ''}`,
  ];
}

export function surfaceMaterial(paint: Paint, slots: number, dense: boolean, clad?: Clad): ShaderMaterial {
  const carry = carried(paint, clad);
  const made = new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: `${declared(slots, true)} ${carry[0]} out vec3 vLit; ${dense ? LIGHT : ''}
      void main() {
        vec3 p = position; vec3 n = normal;
        ${morph(slots, true)}
        n = normalMatrix * n;
        vLit = ${dense ? 'light(normalize(n))' : 'n'};
        ${carry[1]}
        gl_Position = projectionMatrix * modelViewMatrix * vec4(p, 1.0);
      }`,
    fragmentShader: `uniform vec3 base; in vec3 vLit; ${carry[2]} out vec4 color; ${dense ? '' : LIGHT} ${SHOWN}
      void main() {
        ${clad ? cladColor(clad) : COLOR[paint.kind]}
        color = vec4(shown(c * ${dense ? 'vLit' : 'light(normalize(vLit))'}), 1.0);
      }`,
    uniforms: {
      base: { value: paint.kind === 'plain' ? linear(paint.color) : (clad?.cover.base ?? [1, 1, 1]) },
      weight: { value: new Array<number>(slots).fill(0) },
    },
    polygonOffset: true,
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 1,
  });
  if (clad?.map) {
    made.uniforms.map = { value: clad.map };
    made.uniforms.cutoff = { value: clad.cover.cutoff };
  }
  if (paint.kind === 'value') {
    const [low, high] = [paint.low, paint.high].map((x) => (paint.log ? Math.log(Math.max(x, 1e-12)) : x));
    const scale = 1 / (high - low || 1);
    made.uniforms.ramp = { value: rampTexture(paint.ramp) };
    made.uniforms.rampRange = { value: [scale, -low * scale] };
    made.uniforms.rampLog = { value: !!paint.log };
  }
  return made;
}

export function wireMaterial(slots: number): ShaderMaterial {
  return new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: `${declared(slots, false)}
      void main() {
        vec3 p = position;
        ${morph(slots, false)}
        gl_Position = projectionMatrix * modelViewMatrix * vec4(p, 1.0);
      }`,
    fragmentShader:
      'uniform vec3 base; uniform float strength; out vec4 color; void main() { color = vec4(base, strength); }',
    uniforms: {
      base: { value: [0, 0, 0] },
      strength: { value: 0.42 },
      weight: { value: new Array<number>(slots).fill(0) },
    },
    transparent: true,
  });
}
