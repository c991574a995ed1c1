// PNG and animated PNG, written and read against the specification (https://www.w3.org/TR/png-3/): 8 bits, RGB or palette.
import assert from 'node:assert/strict';
import { deflateSync, inflateSync } from 'node:zlib';

function crc(bytes) {
  let c = ~0;
  for (const b of bytes) {
    c ^= b;
    for (let k = 0; k < 8; k++) c = c & 1 ? (c >>> 1) ^ 0xedb88320 : c >>> 1;
  }
  return ~c >>> 0;
}

function chunk(name, bytes) {
  const body = Buffer.concat([Buffer.from(name), bytes]);
  const out = Buffer.alloc(body.length + 8);
  out.writeUInt32BE(bytes.length, 0);
  body.copy(out, 4);
  out.writeUInt32BE(crc(body), body.length + 4);
  return out;
}

/** pixel(x, y): red, green, blue; before: [name, bytes] of further chunks, after the header. */
export function writePng(width, height, pixel, before = []) {
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, 2], 8);
  const rows = Buffer.alloc((3 * width + 1) * height);
  for (let y = 0; y < height; y++)
    for (let x = 0; x < width; x++) rows.set(pixel(x, y), y * (3 * width + 1) + 1 + 3 * x);
  return Buffer.concat([
    Buffer.from('\x89PNG\r\n\x1a\n', 'latin1'),
    chunk('IHDR', head),
    ...before.map(([name, bytes]) => chunk(name, bytes)),
    chunk('IDAT', deflateSync(rows)),
    chunk('IEND', Buffer.alloc(0)),
  ]);
}

function* chunks(bytes) {
  assert.equal(bytes.toString('latin1', 0, 8), '\x89PNG\r\n\x1a\n');
  for (let at = 8; at < bytes.length; ) {
    const size = bytes.readUInt32BE(at);
    const body = bytes.subarray(at + 4, at + 8 + size);
    assert.equal(bytes.readUInt32BE(at + 8 + size), crc(body), 'the sum of a chunk');
    yield { name: body.toString('latin1', 0, 4), data: body.subarray(4) };
    at += 12 + size;
  }
}

/** Bytes of the pixels, `channels` each, with the rows' filters undone. */
function unfilter(packed, width, height, channels) {
  const raw = inflateSync(packed);
  const stride = width * channels;
  const out = Buffer.alloc(stride * height);
  assert.equal(raw.length, (stride + 1) * height);
  for (let y = 0; y < height; y++) {
    const filter = raw[y * (stride + 1)];
    for (let i = 0; i < stride; i++) {
      const left = i >= channels ? out[y * stride + i - channels] : 0;
      const up = y ? out[(y - 1) * stride + i] : 0;
      const corner = i >= channels && y ? out[(y - 1) * stride + i - channels] : 0;
      const p = left + up - corner;
      const paeth =
        Math.abs(p - left) <= Math.abs(p - up) && Math.abs(p - left) <= Math.abs(p - corner)
          ? left
          : Math.abs(p - up) <= Math.abs(p - corner)
            ? up
            : corner;
      out[y * stride + i] = raw[y * (stride + 1) + 1 + i] + [0, left, up, (left + up) >> 1, paeth][filter];
    }
  }
  return out;
}

/** {width, height, frames: [RGB bytes…], milliseconds}; a still picture has one frame. */
export function readPng(bytes) {
  let width;
  let height;
  let channels;
  let palette;
  let control;
  let count = 1;
  let milliseconds = 0;
  let expected = 0;
  const frames = [];
  const parts = [];
  const show = () => {
    if (!parts.length) return;
    const { x, y, w, h } = control ?? { x: 0, y: 0, w: width, h: height };
    assert.ok(w > 0 && h > 0 && x + w <= width && y + h <= height, 'a frame within the picture');
    const pixels = unfilter(Buffer.concat(parts.splice(0)), w, h, channels);
    const frame = frames.length ? Buffer.from(frames.at(-1)) : Buffer.alloc(3 * width * height);
    for (let i = 0; i < w * h; i++) {
      const rgb = palette ? palette.subarray(3 * pixels[i], 3 * pixels[i] + 3) : pixels.subarray(3 * i, 3 * i + 3);
      assert.equal(rgb.length, 3, 'a colour of the palette');
      rgb.copy(frame, 3 * ((y + Math.floor(i / w)) * width + x + (i % w)));
    }
    frames.push(frame);
  };
  for (const { name, data } of chunks(bytes)) {
    if (name === 'IHDR') {
      [width, height] = [data.readUInt32BE(0), data.readUInt32BE(4)];
      assert.equal(data[8], 8);
      assert.ok(data[9] === 2 || data[9] === 3, 'RGB or a palette');
      channels = data[9] === 3 ? 1 : 3;
    } else if (name === 'PLTE') palette = data;
    else if (name === 'acTL') count = data.readUInt32BE(0);
    else if (name === 'fcTL') {
      show();
      assert.equal(data.readUInt32BE(0), expected++, 'frames in sequence');
      control = {
        w: data.readUInt32BE(4),
        h: data.readUInt32BE(8),
        x: data.readUInt32BE(12),
        y: data.readUInt32BE(16),
      };
      milliseconds = (1000 * data.readUInt16BE(20)) / data.readUInt16BE(22);
    } else if (name === 'IDAT') parts.push(data);
    else if (name === 'fdAT') {
      assert.equal(data.readUInt32BE(0), expected++, 'frames in sequence');
      parts.push(data.subarray(4));
    } else if (name === 'IEND') show();
  }
  assert.equal(frames.length, count);
  return { width, height, frames, milliseconds };
}
