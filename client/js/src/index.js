/**
 * orbmorph for JavaScript.
 *
 *   import orbmorph from 'orbmorph';
 *   const morph = await orbmorph.morph([fileA, fileB], { landmarks });
 *   const glb = await morph.glb();
 *
 * The functions of the default export use the daemon that served the page or, in Node, ORBMORPH_SERVER
 * (http://127.0.0.1:8080). `new Orbmorph({server, token})` uses any other daemon.
 */
import { Orbmorph } from './client.js';
import { signUrl } from './sign.js';
import { verifyWebhook } from './webhook.js';

export { Orbmorph } from './client.js';
export { CancelledError, CorsError, ProblemError, UnreachableError } from './errors.js';
export { signUrl } from './sign.js';
export { verifyWebhook } from './webhook.js';

export const morph = (sources, { server, token, ...options } = {}) =>
  new Orbmorph({ server, token }).morph(sources, options);

export default {
  Orbmorph,
  morph,
  signUrl,
  verifyWebhook,
  connect: (server, options) => new Orbmorph({ server, ...options }),
};
