// The processes of a daemon: what they use, read from /proc.
import { readdirSync, readFileSync } from 'node:fs';

/** The processes whose parent is `pid`. */
export function children(pid) {
  return readdirSync('/proc')
    .filter((name) => /^\d+$/.test(name))
    .map(Number)
    .filter((each) => {
      try {
        const fields = readFileSync(`/proc/${each}/stat`, 'latin1').split(') ').pop().split(' ');
        return Number(fields[1]) === pid && fields[0] !== 'Z';
      } catch {
        return false; // it has ended
      }
    });
}

/** The processes that check meshes and run jobs. */
export const workers = (d) => children(d.child.pid).flatMap(children);

/** Resident megabytes of the daemon and all its processes; what several share counts once. */
export function megabytes(d) {
  let kilobytes = 0;
  const forks = children(d.child.pid);
  for (const pid of [d.child.pid, ...forks, ...forks.flatMap(children)]) {
    try {
      kilobytes += Number(/^Pss:\s+(\d+)/m.exec(readFileSync(`/proc/${pid}/smaps_rollup`, 'latin1'))[1]);
    } catch {
      // it has ended
    }
  }
  return kilobytes / 1024;
}

/** Seconds of processor time of all processes that have ended, which checked meshes and ran jobs. */
export function workSeconds(d) {
  let ticks = 0;
  for (const pid of children(d.child.pid)) {
    const fields = readFileSync(`/proc/${pid}/stat`, 'latin1').split(') ').pop().split(' ');
    ticks += Number(fields[13]) + Number(fields[14]); // of its children, in ticks of 1/100 s
  }
  return ticks / 100;
}
