/** Pictures and films of a morph, drawn by the player of the downloaded page. */
import { encodeGif } from './gif';
import { open, type Player } from './player.js';
import { joinWebp } from './webp';
import type { Settings } from './page';

export type Kind = 'gif' | 'webp' | 'video';
export type Subject = 'morph' | 'turntable' | 'both';

const TURN_SECONDS = 6;
const FRAMES_A_SECOND: Record<Kind, number> = { gif: 20, webp: 25, video: 30 };

/** The video format that the browser records; null if it records none. */
export const videoType = (): string | null =>
  typeof MediaRecorder === 'undefined'
    ? null
    : (['video/mp4;codecs=avc1.42E01E', 'video/mp4', 'video/webm;codecs=vp9', 'video/webm'].find((type) =>
        MediaRecorder.isTypeSupported(type),
      ) ?? null);

/** Whether the browser encodes WebP; some only decode it. */
export async function hasWebp(): Promise<boolean> {
  const canvas = new OffscreenCanvas(2, 2);
  canvas.getContext('2d');
  return (await canvas.convertToBlob({ type: 'image/webp' }).catch(() => null))?.type === 'image/webp';
}

/** Draws the frame at a time in seconds, and says how long the film is. */
function director(player: Player, subject: Subject, at: number) {
  const { yaw } = player.camera;
  const seconds = subject === 'turntable' ? TURN_SECONDS : player.seconds;
  const draw = (time: number, background: string) => {
    player.camera.yaw = subject === 'morph' ? yaw : yaw + (2 * Math.PI * time) / seconds;
    player.draw(subject === 'turntable' ? at : player.placeAt(time), background);
  };
  return { seconds, draw };
}

/** A PNG of the morph at a place of its path. */
export async function picture(glb: ArrayBuffer, settings: Settings, place: number, width: number, height: number) {
  const canvas = new OffscreenCanvas(width, height);
  const player = await open(canvas, glb, settings);
  player.draw(place);
  const blob = await canvas.convertToBlob({ type: 'image/png' });
  player.close();
  return blob;
}

export interface Film {
  kind: Kind;
  subject: Subject;
  /** the place at which a turntable stands */
  place: number;
  width: number;
  height: number;
  background: string;
  onProgress: (share: number) => void;
  signal: AbortSignal;
}

/** Returns the film and the ending of its file name. */
export async function film(
  glb: ArrayBuffer,
  settings: Settings,
  wanted: Film,
): Promise<{ blob: Blob; ending: string }> {
  if (wanted.kind === 'video') return record(glb, settings, wanted);
  const { kind, width, height, background, signal } = wanted;
  const canvas = new OffscreenCanvas(width, height);
  const flat = new OffscreenCanvas(width, height).getContext('2d', { willReadFrequently: true })!;
  const player = await open(canvas, glb, settings);
  const { seconds, draw } = director(player, wanted.subject, wanted.place);
  const rate = FRAMES_A_SECOND[kind];
  const count = Math.max(2, Math.round(seconds * rate));
  const raw: Uint8ClampedArray[] = [];
  const stills: Uint8Array[] = [];
  try {
    for (let i = 0; i < count; i++) {
      signal.throwIfAborted();
      draw((i * seconds) / count, background);
      if (kind === 'webp') {
        const still = await canvas.convertToBlob({ type: 'image/webp', quality: 0.9 });
        stills.push(new Uint8Array(await still.arrayBuffer()));
      } else {
        flat.drawImage(canvas, 0, 0);
        raw.push(flat.getImageData(0, 0, width, height).data);
      }
      wanted.onProgress(((i + 1) / count) * (kind === 'gif' ? 0.6 : 1));
      await new Promise((resolve) => setTimeout(resolve));
    }
  } finally {
    player.close();
  }
  const milliseconds = Math.round((1000 * seconds) / count);
  if (kind === 'webp') return { blob: joinWebp(stills, width, height, milliseconds), ending: 'webp' };
  return { blob: encodeGif(raw, width, height, Math.round(milliseconds / 10)), ending: 'gif' };
}

/** Records one round in real time. */
async function record(glb: ArrayBuffer, settings: Settings, wanted: Film) {
  const canvas = document.createElement('canvas');
  canvas.width = wanted.width;
  canvas.height = wanted.height;
  const player = await open(canvas, glb, settings);
  const { seconds, draw } = director(player, wanted.subject, wanted.place);
  const type = videoType()!;
  draw(0, wanted.background);
  const recorder = new MediaRecorder(canvas.captureStream(FRAMES_A_SECOND.video), {
    mimeType: type,
    videoBitsPerSecond: 8_000_000,
  });
  const parts: Blob[] = [];
  recorder.ondataavailable = ({ data }) => data.size && parts.push(data);
  const stopped = new Promise((resolve) => (recorder.onstop = resolve));
  recorder.start();
  const begun = performance.now();
  for (;;) {
    const now = await new Promise<number>((resolve) => requestAnimationFrame(resolve));
    const time = (now - begun) / 1000;
    if (wanted.signal.aborted || time >= seconds) break;
    draw(Math.max(0, time), wanted.background);
    wanted.onProgress(time / seconds);
  }
  recorder.stop();
  await stopped;
  player.close();
  wanted.signal.throwIfAborted();
  return { blob: new Blob(parts, { type }), ending: type.startsWith('video/mp4') ? 'mp4' : 'webm' };
}
