/**
 * An animated GIF. All frames share a palette of at most 255 colours from the median cut of a sample of their pixels; the
 * errors of rounding are spread by an ordered pattern, which does not flicker from frame to frame. GIF89a.
 */

const BITS = 5; // of a colour channel in the table that finds the nearest colour

/** The palette of these RGBA pictures: 3 bytes a colour. */
function paletteOf(frames: Uint8ClampedArray[], most: number): number[][] {
  const counts = new Map<number, number>();
  for (const frame of frames)
    for (let i = 0; i < frame.length; i += 4 * 7) {
      const key = ((frame[i] >> 2) << 12) | ((frame[i + 1] >> 2) << 6) | (frame[i + 2] >> 2);
      counts.set(key, (counts.get(key) ?? 0) + 1);
    }
  type Entry = { rgb: number[]; count: number };
  const all: Entry[] = [...counts].map(([key, count]) => ({
    rgb: [(key >> 12) * 4 + 2, ((key >> 6) & 63) * 4 + 2, (key & 63) * 4 + 2],
    count,
  }));
  const spread = (box: Entry[]) => {
    let best = { axis: 0, size: -1 };
    for (let axis = 0; axis < 3; axis++) {
      let low = 255;
      let high = 0;
      for (const { rgb } of box) {
        low = Math.min(low, rgb[axis]);
        high = Math.max(high, rgb[axis]);
      }
      if (high - low > best.size) best = { axis, size: high - low };
    }
    return { ...best, weight: best.size * Math.sqrt(box.reduce((s, e) => s + e.count, 0)) };
  };
  const boxes = [{ box: all, ...spread(all) }];
  while (boxes.length < most) {
    boxes.sort((a, b) => b.weight - a.weight);
    const { box, axis, size } = boxes[0];
    if (size <= 0 || box.length < 2) break;
    box.sort((a, b) => a.rgb[axis] - b.rgb[axis]);
    const half = box.reduce((s, e) => s + e.count, 0) / 2;
    let sum = 0;
    let at = 0;
    while (at < box.length - 1 && (sum += box[at].count) < half) at++;
    const cut = Math.max(1, Math.min(box.length - 1, at));
    const [a, b] = [box.slice(0, cut), box.slice(cut)];
    boxes.splice(0, 1, { box: a, ...spread(a) }, { box: b, ...spread(b) });
  }
  return boxes.map(({ box }) => {
    const total = box.reduce((s, e) => s + e.count, 0) || 1;
    return [0, 1, 2].map((k) => Math.round(box.reduce((s, e) => s + e.rgb[k] * e.count, 0) / total));
  });
}

class Bytes {
  private parts: Uint8Array[] = [];
  private block = new Uint8Array(1 << 16);
  private fill = 0;
  put(...values: number[]) {
    for (const value of values) {
      if (this.fill === this.block.length) this.flush();
      this.block[this.fill++] = value;
    }
  }
  word(value: number) {
    this.put(value & 255, value >> 8);
  }
  text(text: string) {
    for (const c of text) this.put(c.charCodeAt(0));
  }
  private flush() {
    this.parts.push(this.block.slice(0, this.fill));
    this.fill = 0;
  }
  done(): Blob {
    this.flush();
    return new Blob(this.parts as BlobPart[], { type: 'image/gif' });
  }
}

/** The variable-length codes of GIF's LZW, in blocks of at most 255 bytes. */
function compress(indices: Uint8Array, out: Bytes) {
  const clear = 256;
  const block: number[] = [];
  let bits = 0;
  let held = 0;
  let size = 9;
  let next = clear + 2;
  const table = new Map<number, number>();
  const emit = (code: number) => {
    held |= code << bits;
    bits += size;
    while (bits >= 8) {
      block.push(held & 255);
      held >>>= 8;
      bits -= 8;
      if (block.length === 255) out.put(255, ...block.splice(0));
    }
  };
  out.put(8);
  emit(clear);
  let prefix = indices[0];
  for (let i = 1; i < indices.length; i++) {
    const key = (prefix << 8) | indices[i];
    const known = table.get(key);
    if (known !== undefined) {
      prefix = known;
      continue;
    }
    emit(prefix);
    if (next < 4096) {
      table.set(key, next++);
      if (next > 1 << size && size < 12) size++;
    } else {
      emit(clear);
      table.clear();
      size = 9;
      next = clear + 2;
    }
    prefix = indices[i];
  }
  emit(prefix);
  emit(clear + 1);
  if (bits > 0) block.push(held & 255);
  if (block.length) out.put(block.length, ...block);
  out.put(0);
}

const PATTERN = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5].map((x) => x / 16 - 0.47);

/** Encodes RGBA frames of the same size; `delay` in hundredths of a second. */
export function encodeGif(frames: Uint8ClampedArray[], width: number, height: number, delay: number): Blob {
  const palette = paletteOf(frames, 255);
  const nearest = new Uint8Array(1 << (3 * BITS)).fill(255);
  const find = (r: number, g: number, b: number) => {
    const key = ((r >> 3) << 10) | ((g >> 3) << 5) | (b >> 3);
    if (nearest[key] !== 255) return nearest[key];
    let best = 0;
    let least = Infinity;
    palette.forEach((c, i) => {
      const d = 2 * (c[0] - r) ** 2 + 4 * (c[1] - g) ** 2 + 3 * (c[2] - b) ** 2;
      if (d < least) [least, best] = [d, i];
    });
    return (nearest[key] = best);
  };
  const out = new Bytes();
  out.text('GIF89a');
  out.word(width);
  out.word(height);
  out.put(0xf7, 0, 0);
  for (let i = 0; i < 256; i++) out.put(...(palette[i] ?? [0, 0, 0]));
  out.put(0x21, 0xff, 11);
  out.text('NETSCAPE2.0');
  out.put(3, 1, 0, 0, 0);
  const clamp = (x: number) => Math.max(0, Math.min(255, Math.round(x)));
  for (const frame of frames) {
    const indices = new Uint8Array(width * height);
    for (let i = 0; i < indices.length; i++) {
      const d = 10 * PATTERN[((((i / width) | 0) & 3) << 2) | ((i % width) & 3)];
      indices[i] = find(clamp(frame[4 * i] + d), clamp(frame[4 * i + 1] + d), clamp(frame[4 * i + 2] + d));
    }
    out.put(0x21, 0xf9, 4, 0);
    out.word(delay);
    out.put(0, 0, 0x2c, 0, 0, 0, 0);
    out.word(width);
    out.word(height);
    out.put(0);
    compress(indices, out);
  }
  out.put(0x3b);
  return out.done();
}
