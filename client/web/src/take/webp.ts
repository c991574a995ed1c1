/**
 * An animated WebP from still ones that the browser encodes. https://developers.google.com/speed/webp/docs/riff_container
 */

const chunk = (name: string, parts: Uint8Array[]): Uint8Array => {
  const size = parts.reduce((n, p) => n + p.length, 0);
  const out = new Uint8Array(8 + size + (size & 1));
  for (let i = 0; i < 4; i++) out[i] = name.charCodeAt(i);
  new DataView(out.buffer).setUint32(4, size, true);
  let at = 8;
  for (const part of parts) {
    out.set(part, at);
    at += part.length;
  }
  return out;
};
const three = (value: number) => [value & 255, (value >> 8) & 255, (value >> 16) & 255];

/** The chunks of a still WebP that hold its picture. */
function picture(still: Uint8Array): Uint8Array[] {
  const view = new DataView(still.buffer, still.byteOffset);
  const out: Uint8Array[] = [];
  for (let at = 12; at + 8 <= still.length; ) {
    const name = String.fromCharCode(...still.subarray(at, at + 4));
    const size = view.getUint32(at + 4, true);
    const whole = 8 + size + (size & 1);
    if (name === 'VP8 ' || name === 'VP8L' || name === 'ALPH') out.push(still.subarray(at, at + whole));
    at += whole;
  }
  return out;
}

/** Joins still WebP files of the same size; `milliseconds` a frame. */
export function joinWebp(stills: Uint8Array[], width: number, height: number, milliseconds: number): Blob {
  const head = new Uint8Array([0x02, 0, 0, 0, ...three(width - 1), ...three(height - 1)]);
  const frames = stills.map((still) =>
    chunk('ANMF', [
      new Uint8Array([0, 0, 0, 0, 0, 0, ...three(width - 1), ...three(height - 1), ...three(milliseconds), 0x02]),
      ...picture(still),
    ]),
  );
  const body = [chunk('VP8X', [head]), chunk('ANIM', [new Uint8Array(6)]), ...frames];
  const webp = new TextEncoder().encode('WEBP');
  return new Blob([chunk('RIFF', [webp, ...body]) as BlobPart], { type: 'image/webp' });
}
