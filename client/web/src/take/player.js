/**
 * The player of a downloaded page: shows a morph with WebGL 2 and nothing else. The studio also draws pictures and films
 * with it. The page contains the text of this file, so it imports nothing.
 *
 * A morph is a GLB as orbmorph writes it: meshes whose primitives have the same morph targets, and an animation whose
 * keyframes each show one target or none.
 */

const FIELD = 32; // vertical field of view in degrees
const REST = 0.18; // share of a leg during which the morph rests at a shape

/** Easings of the way from one shape to the next, from 0 to 1. */
export const EASINGS = {
  smooth: (t) => t * t * (3 - 2 * t),
  linear: (t) => t,
  slow: (t) => t * t * t * (t * (6 * t - 15) + 10),
  bounce: (t) => 1 - Math.abs(Math.cos(t * Math.PI * 2.5)) * (1 - t) ** 2,
};

const WIDTH = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };
const ARRAY = {
  5120: Int8Array,
  5121: Uint8Array,
  5122: Int16Array,
  5123: Uint16Array,
  5125: Uint32Array,
  5126: Float32Array,
};

function parse(buffer) {
  const view = new DataView(buffer);
  const length = view.getUint32(12, true);
  const json = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 20, length)));
  const start = 20 + length + 8;
  /** The numbers of an accessor; normalized integers become fractions. */
  const read = (index) => {
    const accessor = json.accessors[index];
    const width = WIDTH[accessor.type];
    const Type = ARRAY[accessor.componentType];
    const bytes = json.bufferViews[accessor.bufferView];
    const from = start + (bytes?.byteOffset ?? 0) + (accessor.byteOffset ?? 0);
    const stride = bytes?.byteStride ?? width * Type.BYTES_PER_ELEMENT;
    const out =
      Type === Float32Array || accessor.normalized
        ? new Float32Array(accessor.count * width)
        : new Uint32Array(accessor.count * width);
    if (!bytes) return withSparse(out, accessor, width);
    const scale = accessor.normalized
      ? 1 / (2 ** (8 * Type.BYTES_PER_ELEMENT - (accessor.componentType % 2 ? 0 : 1)) - 1)
      : 1;
    const part = new Type(width);
    const raw = new Uint8Array(part.buffer);
    const all = new Uint8Array(buffer);
    for (let i = 0; i < accessor.count; i++) {
      raw.set(all.subarray(from + i * stride, from + i * stride + raw.length));
      for (let k = 0; k < width; k++) out[i * width + k] = part[k] * scale;
    }
    return withSparse(out, accessor, width);
  };
  /** Puts in the elements that a sparse accessor gives by their numbers. */
  const withSparse = (out, { sparse, componentType }, width) => {
    if (!sparse) return out;
    const list = ({ bufferView, byteOffset = 0, componentType: type = componentType }, count) => {
      const from = start + (json.bufferViews[bufferView].byteOffset ?? 0) + byteOffset;
      return new ARRAY[type](buffer.slice(from, from + count * ARRAY[type].BYTES_PER_ELEMENT));
    };
    const values = list(sparse.values, sparse.count * width);
    list(sparse.indices, sparse.count).forEach((at, i) =>
      out.set(values.subarray(i * width, (i + 1) * width), at * width),
    );
    return out;
  };
  const image = async (index) => {
    const { bufferView, mimeType } = json.images[index];
    const { byteOffset = 0, byteLength } = json.bufferViews[bufferView];
    return createImageBitmap(new Blob([new Uint8Array(buffer, start + byteOffset, byteLength)], { type: mimeType }));
  };
  return { json, read, image };
}

/** The product of two matrices, column-major. */
const times = (a, b) =>
  Array.from({ length: 16 }, (_, i) =>
    [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * k + (i % 4)] * b[4 * (i >> 2) + k], 0),
  );

function matrixOf({ matrix, translation: [tx, ty, tz] = [0, 0, 0], rotation = [0, 0, 0, 1], scale = [1, 1, 1] }) {
  const [x, y, z, w] = rotation;
  const columns = [
    [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
    [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
    [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
  ];
  return matrix ?? [...columns.flatMap((column, c) => [...column.map((v) => v * scale[c]), 0]), tx, ty, tz, 1];
}

/** The matrices to the scene of the nodes that show each mesh. */
function matricesOf({ nodes = [], scenes, scene = 0 }) {
  const found = new Map();
  const below = new Set(nodes.flatMap(({ children = [] }) => children));
  const roots = scenes?.[scene]?.nodes ?? [...nodes.keys()].filter((node) => !below.has(node));
  const stack = roots.map((node) => [node, matrixOf({}), 0]).reverse(); // the first one is on top
  while (stack.length) {
    const [node, above, depth] = stack.pop();
    if (!nodes[node] || depth > 64) continue;
    const to = times(above, matrixOf(nodes[node]));
    const { mesh } = nodes[node];
    if (mesh !== undefined) found.set(mesh, [...(found.get(mesh) ?? []), to]);
    for (const child of [...(nodes[node].children ?? [])].reverse()) stack.push([child, to, depth + 1]);
  }
  return found;
}

/**
 * The primitives that morph, with those targets that are shapes: an uploaded document to which targets were added may
 * have others first. Its other meshes follow, which stay as they are. variant: of the materials; extras: other targets,
 * with weights that stay.
 */
function meshOf({ json, read }, variant, extras) {
  const kept = json.meshes.filter((mesh) => mesh.extras?.firstShape !== undefined);
  const meshes = kept.length ? kept : json.meshes.slice(0, 1);
  const first = meshes[0].extras?.firstShape ?? 0;
  const matrices = matricesOf(json);
  const dressed = (p) => {
    const mappings = p.extensions?.KHR_materials_variants?.mappings ?? [];
    return mappings.find(({ variants }) => variants.includes(variant))?.material ?? p.material;
  };
  const placed = (mesh) => matrices.get(json.meshes.indexOf(mesh)) ?? [];
  const morphing = (p, m) => ({
    ...p,
    material: dressed(p),
    targets: p.targets?.slice(first),
    still: extras.map(({ target, weight }) => ({ ...p.targets?.[target], weight })),
    ...toScene(m, read),
  });
  const staying = (p, m) => ({ ...p, material: dressed(p), targets: [], still: [], ...toScene(m, read) });
  const isSurface = ({ mode = 4, attributes }) => mode >= 4 && mode <= 6 && attributes.POSITION !== undefined;
  const primitives = meshes.flatMap((mesh) => {
    const [m = matrixOf({})] = placed(mesh);
    return mesh.primitives.filter(isSurface).map((p) => morphing(p, m));
  });
  const others = kept.length ? json.meshes.filter((mesh) => !kept.includes(mesh)) : [];
  for (const mesh of others)
    for (const m of placed(mesh)) primitives.push(...mesh.primitives.filter(isSurface).map((p) => staying(p, m)));
  return { first, primitives };
}

/** What reads places, ways and normals of a mesh in the scene. mirrored: its triangles face inwards there. */
function toScene(m, read) {
  const by = (columns, w) => (values) => {
    const out = new Float32Array(values.length);
    for (let i = 0; i < values.length; i += 3)
      for (let r = 0; r < 3; r++)
        out[i + r] =
          columns[r] * values[i] +
          columns[4 + r] * values[i + 1] +
          columns[8 + r] * values[i + 2] +
          w * columns[12 + r];
    return out;
  };
  const minor = (r, c) => {
    const at = (i, j) => m[4 * ((c + j) % 3) + ((r + i) % 3)];
    return at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1);
  };
  const mirrored = m[0] * minor(0, 0) + m[4] * minor(0, 1) + m[8] * minor(0, 2) < 0;
  const turned = new Array(16).fill(0); // normals go by the cofactors
  for (let r = 0; r < 3; r++) for (let c = 0; c < 3; c++) turned[4 * c + r] = (mirrored ? -1 : 1) * minor(r, c);
  const normal = by(turned, 0);
  const unit = (values) => {
    const out = normal(values);
    for (let i = 0; i < out.length; i += 3) {
      const length = Math.hypot(out[i], out[i + 1], out[i + 2]) || 1;
      for (let k = 0; k < 3; k++) out[i + k] /= length;
    }
    return out;
  };
  const [place, way] = [by(m, 1), by(m, 0)];
  return {
    mirrored,
    places: (index) => place(read(index)),
    ways: (index) => way(read(index)),
    /** with the change that a target adds */
    normals: (index, turn) => {
      const values = read(index);
      const more = turn === undefined ? null : read(turn);
      return unit(more ? values.map((x, i) => x + more[i]) : values);
    },
  };
}

/**
 * The keys of the path from the first to the last shape: {time, target}; target −1 is the base. Rests are omitted, and
 * the shapes stand at equal intervals.
 */
function pathOf({ json, read }, first, targets, shapes) {
  const straight = Array.from({ length: shapes }, (_, i) => ({ time: i, target: i - 1 }));
  const animation = json.animations?.at(-1);
  const channel = animation?.channels.find((c) => c.target.path === 'weights');
  if (!channel || !targets) return straight;
  const output = read(animation.samplers[channel.sampler].output);
  const keys = [];
  let shape = 0;
  let between = [];
  for (let i = first; i + targets <= output.length; i += first + targets) {
    const weights = output.subarray(i, i + targets);
    const target = weights.findIndex((w) => w > 0.5);
    if (target === shape - 1) {
      between.forEach((k, n) => keys.push({ time: shape - 1 + (n + 1) / (between.length + 1), target: k }));
      between = [];
      keys.push({ time: shape, target });
      if (++shape === shapes) return keys;
    } else if (shape > 0 && target !== shape - 2) between.push(target);
  }
  return straight;
}

const VERTEX = `#version 300 es
uniform mat4 look;
uniform vec3 right, up, back;
uniform vec3 weight;
layout(location = 0) in vec3 p0; layout(location = 1) in vec3 n0;
layout(location = 2) in vec3 pa; layout(location = 3) in vec3 na;
layout(location = 4) in vec3 pb; layout(location = 5) in vec3 nb;
layout(location = 6) in vec2 uv; layout(location = 7) in vec4 color;
out vec3 n; out vec2 at; out vec4 tone;
void main() {
  vec3 m = n0 + weight.x * na + weight.y * nb;
  n = vec3(dot(m, right), dot(m, up), dot(m, back));
  at = uv; tone = color;
  gl_Position = look * vec4(p0 + weight.x * pa + weight.y * pb, 1.0);
}`;
const FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 base; uniform bool mapped; uniform sampler2D map; uniform float cutoff;
in vec3 n; in vec2 at; in vec4 tone;
out vec4 color;
vec3 light(vec3 n) {
  float key = max(0.0, dot(n, vec3(-0.4240, 0.7067, 0.5654)) * 0.72 + 0.28);
  float fill = max(0.0, dot(n, vec3(0.8664, -0.1083, 0.4874)));
  float shine = pow(max(0.0, dot(n, vec3(-0.2407, 0.4012, 0.8827))), 32.0);
  float rim = pow(1.0 - clamp(n.z, 0.0, 1.0), 3.0);
  float all = 0.225 + 0.065 * n.y + 0.78 * key * key + 0.12 * fill;
  vec3 c = min(vec3(1.0), all * vec3(0.98, 0.965, 0.95) + vec3(0.1 * shine) + rim * vec3(0.05, 0.06, 0.09));
  return c * (0.8 + 0.2 * c);
}
void main() {
  vec4 c = base * tone;
  if (mapped) { vec4 t = texture(map, at); c *= vec4(pow(t.rgb, vec3(2.2)), t.a); }
  if (c.a < cutoff) discard;
  vec3 m = normalize(gl_FrontFacing ? n : -n);
  color = vec4(pow(c.rgb * light(m), vec3(1.0 / 2.2)), 1.0);
}`;

function programOf(gl) {
  const program = gl.createProgram();
  for (const [type, text] of [
    [gl.VERTEX_SHADER, VERTEX],
    [gl.FRAGMENT_SHADER, FRAGMENT],
  ]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS))
    throw new Error(gl.getProgramInfoLog(program) || 'WebGL failed');
  return program;
}

const linear = (hex) => [1, 3, 5].map((i) => (parseInt(hex.slice(i, i + 2), 16) / 255) ** 2.2);

/** The corners of triangles, also those of a strip (mode 5) and of a fan (6). */
const trianglesOf = (list, mode = 4) =>
  mode === 4
    ? list
    : Uint32Array.from(
        [...list.keys()]
          .slice(2)
          .flatMap((i) =>
            mode === 6 ? [list[i - 1], list[i], list[0]] : [list[i - 2], list[i - 1 + (i % 2)], list[i - (i % 2)]],
          ),
      );

/** Uploads a primitive. The positions are placed in the unit ball by centre and radius. */
async function partOf(gl, file, primitive, center, radius) {
  const { json, read, image } = file;
  const { attributes, targets = [], still } = primitive;
  const upload = (data) => {
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    return buffer;
  };
  const position = primitive.places(attributes.POSITION);
  const count = position.length / 3;
  const index = trianglesOf(
    primitive.indices === undefined
      ? Uint32Array.from({ length: count }, (_, i) => i)
      : Uint32Array.from(read(primitive.indices)),
    primitive.mode,
  );
  for (let i = 0; primitive.mirrored && i < index.length; i += 3)
    [index[i + 1], index[i + 2]] = [index[i + 2], index[i + 1]];
  const normals = (at) => {
    const out = new Float32Array(at.length);
    for (let i = 0; i < index.length; i += 3) {
      const [a, b, c] = [3 * index[i], 3 * index[i + 1], 3 * index[i + 2]];
      const [ux, uy, uz] = [0, 1, 2].map((k) => at[b + k] - at[a + k]);
      const [vx, vy, vz] = [0, 1, 2].map((k) => at[c + k] - at[a + k]);
      const n = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
      for (const v of [a, b, c]) for (let k = 0; k < 3; k++) out[v + k] += n[k];
    }
    for (let i = 0; i < out.length; i += 3) {
      const l = Math.hypot(out[i], out[i + 1], out[i + 2]) || 1;
      for (let k = 0; k < 3; k++) out[i + k] /= l;
    }
    return out;
  };
  const normal = attributes.NORMAL === undefined ? normals(position) : primitive.normals(attributes.NORMAL);
  const base = still.length ? normal.slice() : normal;
  const material = json.materials?.[primitive.material] ?? {};
  const surface = material.pbrMetallicRoughness ?? {};
  const slot = surface.baseColorTexture;
  const transform = slot?.extensions?.KHR_texture_transform ?? {};
  const set = `TEXCOORD_${transform.texCoord ?? slot?.texCoord ?? 0}`;
  let texture = null;
  if (slot && attributes[set] !== undefined && json.textures[slot.index].source !== undefined) {
    texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    const { source, sampler } = json.textures[slot.index];
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, await image(source));
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, json.samplers?.[sampler]?.wrapS ?? gl.REPEAT);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, json.samplers?.[sampler]?.wrapT ?? gl.REPEAT);
  }
  const uv = texture ? read(attributes[set]) : null;
  if (uv) {
    const [sx, sy] = transform.scale ?? [1, 1];
    const [ox, oy] = transform.offset ?? [0, 0];
    const [s, c] = [Math.sin(transform.rotation ?? 0), Math.cos(transform.rotation ?? 0)];
    for (let i = 0; i < uv.length; i += 2) {
      const [u, v] = [uv[i] * sx, uv[i + 1] * sy];
      uv[i] = c * u + s * v + ox;
      uv[i + 1] = c * v - s * u + oy;
    }
  }
  let color = null;
  if (attributes.COLOR_0 !== undefined) {
    const wide = file.json.accessors[attributes.COLOR_0].type === 'VEC4';
    const data = read(attributes.COLOR_0);
    color = { buffer: upload(data), width: wide ? 4 : 3 };
  }
  const moved = targets.map((target) => {
    const delta = primitive.ways(target.POSITION);
    const turn =
      target.NORMAL !== undefined && attributes.NORMAL !== undefined
        ? primitive.normals(attributes.NORMAL, target.NORMAL)
        : normals(position.map((x, i) => x + delta[i]));
    for (let i = 0; i < turn.length; i++) turn[i] -= normal[i];
    for (let i = 0; i < delta.length; i++) delta[i] /= radius;
    return { position: upload(delta), normal: upload(turn) };
  });
  for (const { POSITION, NORMAL, weight } of still) {
    const way = POSITION === undefined ? [] : primitive.ways(POSITION);
    for (let i = 0; i < way.length; i++) position[i] += weight * way[i];
    const turned = NORMAL === undefined ? [] : primitive.normals(attributes.NORMAL, NORMAL);
    for (let i = 0; i < turned.length; i++) normal[i] += weight * (turned[i] - base[i]);
  }
  for (let i = 0; i < position.length; i++) position[i] = (position[i] - center[i % 3]) / radius;
  const elements = gl.createBuffer();
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, elements);
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, index, gl.STATIC_DRAW);
  const factor = surface.baseColorFactor ?? [1, 1, 1, 1];
  return {
    base: { position: upload(position), normal: upload(normal) },
    moved,
    uv: uv && upload(uv),
    color,
    texture,
    factor,
    plain: !texture && !color && Math.max(...factor.slice(0, 3)) - Math.min(...factor.slice(0, 3)) < 0.01,
    cutoff: material.alphaMode === 'MASK' ? (material.alphaCutoff ?? 0.5) : 0,
    elements,
    count: index.length,
  };
}

/** The box of every shape: {center, radius}. */
function frameOf(primitives, shapes) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (const { attributes, targets = [], places, ways } of primitives) {
    const base = places(attributes.POSITION);
    for (let shape = 0; shape < shapes; shape++) {
      const delta = shape && targets.length ? ways(targets[shape - 1].POSITION) : null;
      for (let i = 0; i < base.length; i++) {
        const x = base[i] + (delta ? delta[i] : 0);
        if (x < low[i % 3]) low[i % 3] = x;
        if (x > high[i % 3]) high[i % 3] = x;
      }
    }
  }
  const radius = Math.hypot(...high.map((x, k) => x - low[k])) / 2 || 1;
  return { center: low.map((x, k) => (x + high[k]) / 2), radius };
}

/**
 * Opens a morph on a canvas. settings: shapes (their number), tints (colours of shapes without material), seconds a
 * shape, easing, loop ("pingpong" or "loop"), variant of the materials (-1: those of the primitives), extras (targets of
 * the primitives that are not shapes, with weights), and the camera: yaw, pitch, distance, panX, panY.
 */
export async function open(canvas, glb, settings) {
  const gl = canvas.getContext('webgl2', { antialias: true, alpha: true, preserveDrawingBuffer: true });
  if (!gl) throw new Error('This browser has no WebGL 2.');
  const file = parse(glb);
  const { primitives, first } = meshOf(file, settings.variant ?? -1, settings.extras ?? []);
  const targets = primitives[0].targets?.length ?? 0;
  const shapes = Math.min(settings.shapes ?? targets + 1, targets + 1);
  const { center, radius } = frameOf(primitives, shapes);
  const parts = [];
  for (const primitive of primitives) parts.push(await partOf(gl, file, primitive, center, radius));
  const isTinted = parts.every((part) => part.plain); // grey all over: the file says nothing of colours
  const keys = pathOf(file, first, targets, shapes);
  const program = programOf(gl);
  const uniform = (name) => gl.getUniformLocation(program, name);
  const tints = (settings.tints ?? ['#d8c7b8']).map(linear);
  const legs = Math.max(1, shapes - 1);
  const round = settings.loop === 'loop' && shapes > 2;
  const way = shapes < 2 ? 1 : round || (settings.loop === 'loop' && shapes === 2) ? shapes : 2 * legs;

  /** What is blended at a place of the path, 0 to `shapes`; beyond the last shape it leads back to the first. */
  const blendAt = (at) => {
    if (at > legs) return { a: shapes - 2, b: -1, t: at - legs, from: shapes - 1, to: 0 };
    let i = 0;
    while (i + 2 < keys.length && keys[i + 1].time <= at) i++;
    const [k, next] = [keys[i], keys[Math.min(i + 1, keys.length - 1)]];
    const t = next.time > k.time ? Math.min(1, Math.max(0, (at - k.time) / (next.time - k.time))) : 0;
    const from = Math.min(Math.floor(at), shapes - 1);
    return { a: k.target, b: next.target, t, from, to: Math.min(from + 1, shapes - 1), tint: at - from };
  };

  const attribute = (place, buffer, width) => {
    if (!buffer) {
      gl.disableVertexAttribArray(place);
      return gl.vertexAttrib4f(place, 0, 0, 0, 1);
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, width, gl.FLOAT, false, 0, 0);
  };

  const camera = { yaw: 0.55, pitch: 0.22, distance: 3.15, panX: 0, panY: 0, ...settings.camera };
  const player = {
    camera,
    shapes,
    /** seconds of one round */
    seconds: way * (settings.seconds ?? 2.2),
    /** The place on the path, 0 to `shapes` − 1 (or `shapes` in a loop), at a time in seconds. */
    placeAt(time) {
      if (shapes < 2) return 0;
      const phase = (((time / (settings.seconds ?? 2.2)) % way) + way) % way;
      const there = settings.loop === 'loop' ? phase : phase <= legs ? phase : way - phase;
      const leg = Math.min(Math.floor(there), (settings.loop === 'loop' ? shapes : legs) - 1);
      const s = Math.min(1, Math.max(0, (there - leg - REST / 2) / (1 - REST)));
      return leg + (EASINGS[settings.easing] ?? EASINGS.smooth)(s);
    },
    /** Draws the morph at a place of the path. background: "#rrggbb", or none. */
    draw(place, background) {
      const { width, height } = canvas;
      const aspect = width / height;
      const { a, b, t, from, to, tint = t } = blendAt(place);
      const distance = camera.distance / Math.min(1, aspect);
      const [sy, cy, sp, cp] = [
        Math.sin(camera.yaw),
        Math.cos(camera.yaw),
        Math.sin(camera.pitch),
        Math.cos(camera.pitch),
      ];
      const back = [sy * cp, sp, cy * cp];
      const right = [cy, 0, -sy];
      const up = [-sy * sp, cp, -cy * sp];
      const eye = back.map((x, k) => x * distance + right[k] * camera.panX + up[k] * camera.panY);
      const dot = (u, v) => u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
      const f = 1 / Math.tan((FIELD * Math.PI) / 360);
      const [near, far] = [Math.max(0.01, distance - 3), distance + 6];
      const [p, q] = [(near + far) / (near - far), (2 * near * far) / (near - far)];
      const [ex, ey, ez] = [-dot(right, eye), -dot(up, eye), -dot(back, eye)];
      const look = [];
      for (let k = 0; k < 3; k++) look.push((right[k] * f) / aspect, up[k] * f, back[k] * p, -back[k]);
      look.push((ex * f) / aspect, ey * f, ez * p + q, -ez);
      gl.viewport(0, 0, width, height);
      const clear = background ? [1, 3, 5].map((i) => parseInt(background.slice(i, i + 2), 16) / 255) : [0, 0, 0];
      gl.clearColor(clear[0], clear[1], clear[2], background ? 1 : 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      gl.useProgram(program);
      gl.uniformMatrix4fv(uniform('look'), false, look);
      gl.uniform3fv(uniform('right'), right);
      gl.uniform3fv(uniform('up'), up);
      gl.uniform3fv(uniform('back'), back);
      gl.uniform3f(uniform('weight'), a < 0 ? 0 : 1 - t, b < 0 ? 0 : t, 0);
      for (const part of parts) {
        attribute(0, part.base.position, 3);
        attribute(1, part.base.normal, 3);
        attribute(2, part.moved[a]?.position, 3);
        attribute(3, part.moved[a]?.normal, 3);
        attribute(4, part.moved[b]?.position, 3);
        attribute(5, part.moved[b]?.normal, 3);
        attribute(6, part.uv, 2);
        attribute(7, part.color?.buffer, part.color?.width);
        if (!part.color) gl.vertexAttrib4f(7, 1, 1, 1, 1);
        const [c, d] = [tints[from % tints.length], tints[to % tints.length]];
        const base = isTinted ? [...c.map((x, k) => x + (d[k] - x) * Math.min(1, Math.max(0, tint))), 1] : part.factor;
        gl.uniform4fv(uniform('base'), base);
        gl.uniform1i(uniform('mapped'), part.texture ? 1 : 0);
        gl.uniform1f(uniform('cutoff'), part.cutoff);
        gl.bindTexture(gl.TEXTURE_2D, part.texture);
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, part.elements);
        gl.drawElements(gl.TRIANGLES, part.count, gl.UNSIGNED_INT, 0);
      }
    },
    close() {
      gl.getExtension('WEBGL_lose_context')?.loseContext();
    },
  };
  return player;
}
