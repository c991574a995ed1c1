/** Sends orders to the drawing worker, which executes them in sequence. */
import type { Order, Report } from './messages';

const worker = new Worker(new URL('./draw.worker.ts', import.meta.url), { type: 'module' });

let changes = 0;

/** How many orders so far have changed what a drawing shows. */
export const changesOrdered = () => changes;

export function order(what: Order, transfer: Transferable[] = []) {
  if (what.op !== 'draw') changes++;
  worker.postMessage(what, transfer);
}

export function onReport(listener: (report: Report) => void) {
  worker.onmessage = ({ data }: MessageEvent<Report>) => listener(data);
  worker.onerror = () => listener({ op: 'started', works: false });
}
