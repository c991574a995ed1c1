// The tasks of a page's main thread, from Chromium's own trace: the wall time and the CPU time of each. The difference
// is time spent waiting for the GPU process (which under software GL draws on the same cores) or for a core.

const CATEGORIES = [
  'toplevel',
  'devtools.timeline',
  'disabled-by-default-devtools.timeline',
  'v8',
  'gpu',
  '__metadata',
];
const LONG = 50;

/** Runs `body`. Returns {value, tasks: [{ms, cpu_ms, what}]} with the tasks of 50 ms and more, longest first. */
export async function traced(browser, page, body) {
  await browser.startTracing(page, { categories: CATEGORIES });
  const value = await body();
  const { traceEvents } = JSON.parse(await browser.stopTracing());
  return { value, tasks: tasksIn(traceEvents) };
}

function tasksIn(events) {
  const thread = (e) => `${e.pid}:${e.tid}`;
  const main = new Set(events.filter((e) => e.name === 'thread_name' && e.args?.name === 'CrRendererMain').map(thread));
  const spans = events.filter((e) => e.ph === 'X' && e.dur && main.has(thread(e)));
  const tasks = spans.filter((e) => /RunTask$/.test(e.name) && e.dur >= 1000 * LONG);
  const outer = tasks.filter(
    (e) =>
      !tasks.some(
        (o) => o !== e && thread(o) === thread(e) && o.ts <= e.ts && o.ts + o.dur >= e.ts + e.dur && o.dur > e.dur,
      ),
  );
  const unique = outer.filter((e, i) => outer.findIndex((o) => thread(o) === thread(e) && o.ts === e.ts) === i);
  return unique
    .sort((a, b) => b.dur - a.dur)
    .map((e) => {
      // `what`: the innermost span that takes more than half of the task
      const inside = spans.filter(
        (s) =>
          thread(s) === thread(e) &&
          s.ts >= e.ts &&
          s.ts + s.dur <= e.ts + e.dur &&
          s.dur > 0.5 * e.dur &&
          !/RunTask$/.test(s.name),
      );
      const inner = inside.sort((a, b) => a.dur - b.dur)[0];
      return { ms: Math.round(e.dur / 1000), cpu_ms: Math.round((e.tdur ?? 0) / 1000), what: inner?.name ?? '' };
    });
}
