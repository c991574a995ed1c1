/** The way to the drawing worker. Orders are carried out in the order in which they are given. */
import type { Order, Report } from './messages';

const worker = new Worker(new URL('./draw.worker.ts', import.meta.url), { type: 'module' });

export function order(what: Order, hand: Transferable[] = []) {
  worker.postMessage(what, hand);
}

export function onReport(hear: (report: Report) => void) {
  worker.onmessage = ({ data }: MessageEvent<Report>) => hear(data);
  worker.onerror = () => hear({ op: 'started', works: false });
}
