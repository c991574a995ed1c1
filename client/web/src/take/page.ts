/** A self-contained page that plays a morph: the player, the settings and the GLB in one HTML file. */
import player from './player.js?raw';
import script from './script.js?raw';

export interface Settings {
  shapes: number;
  names: string[];
  tints: string[];
  seconds: number;
  easing: string;
  loop: string;
  /** of the materials; -1: those of the primitives */
  variant: number;
  /** weights of targets of the primitives that are not shapes */
  extras: { target: number; weight: number }[];
  camera: Record<'yaw' | 'pitch' | 'distance' | 'panX' | 'panY', number>;
}

/** Escapes text for HTML. */
export const escaped = (text: string) =>
  text.replace(/[&<>"]/g, (c) => ({ '&': '&amp;', '<': '&lt;', '>': '&gt;', '"': '&quot;' })[c]!);

function base64(bytes: Uint8Array): string {
  let text = '';
  for (let i = 0; i < bytes.length; i += 0x8000) text += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
  return btoa(text);
}

export function pageOf(glb: ArrayBuffer, settings: Settings): string {
  const title = escaped(settings.names.join(' to '));
  // “<” within JSON would end the element at “</script>”
  const json = JSON.stringify(settings).replace(/</g, '\\u003c');
  return `<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>${title}</title>
<style>
  html, body { margin: 0; height: 100%; overflow: hidden; font: 16px system-ui, sans-serif;
    background: radial-gradient(60% 60% at 50% 40%, #fff3e2, transparent), radial-gradient(70% 70% at 20% 20%, #e4eaff, transparent), #f2efe9; color: #1c1f25; }
  @media (prefers-color-scheme: dark) { html, body { color: #eceae6;
    background: radial-gradient(60% 60% at 50% 40%, #3a352f, transparent), radial-gradient(70% 70% at 20% 20%, #2a3147, transparent), #15171c; } }
  canvas { display: block; width: 100vw; height: 100vh; touch-action: none; cursor: grab; }
  form { position: fixed; left: 0; right: 0; bottom: 24px; display: flex; gap: 14px; justify-content: center; align-items: center; }
  input { width: min(420px, 60vw); }
  button { width: 44px; height: 44px; border: 0; border-radius: 50%; background: #3d52c4; color: #fff; font-size: 15px; cursor: pointer; }
  p { position: fixed; top: 40%; width: 100%; text-align: center; }
</style>
<canvas role="img" aria-label="${title}: a morph. Drag to rotate it."></canvas>
<p></p>
<form onsubmit="return false">
  <button type="button" aria-label="Pause">❚❚</button>
  <input type="range" min="0" max="1" step="0.001" value="0" aria-label="Along the morph">
</form>
<script type="application/json" id="settings">${json}</script>
<script type="text/plain" id="morph">${base64(new Uint8Array(glb))}</script>
<script type="module">
${player.replace(/^export /gm, '')}
${script}</script>
</html>
`;
}
