/** The page's side of the worker: `await work('open', key, buffer)`. ArrayBuffer arguments are transferred. */
import type { Ops } from './worker';

let worker: Worker | null = null;
let count = 0;
const waiting = new Map<number, { resolve: (value: never) => void; reject: (error: Error) => void }>();

function start(): Worker {
  const made = new Worker(new URL('./worker.ts', import.meta.url), { type: 'module' });
  made.onmessage = ({ data }) => {
    const call = waiting.get(data.id);
    waiting.delete(data.id);
    if (data.error !== undefined) call?.reject(new Error(data.error));
    else call?.resolve(data.value as never);
  };
  made.onerror = () => {
    for (const call of waiting.values()) call.reject(new Error('The worker of the page failed. Reload the page.'));
    waiting.clear();
  };
  return made;
}

export function work<K extends keyof Ops>(op: K, ...args: Parameters<Ops[K]>): Promise<Awaited<ReturnType<Ops[K]>>> {
  worker ??= start();
  const id = ++count;
  return new Promise((resolve, reject) => {
    waiting.set(id, { resolve, reject });
    const transfer = args.filter((arg): arg is ArrayBuffer => (arg as unknown) instanceof ArrayBuffer);
    worker!.postMessage({ id, op, args }, transfer);
  });
}
