// The processes of a daemon and the resources they use, read from /proc.
import { readdirSync, readFileSync } from 'node:fs';
import { until } from './daemon.mjs';

/** What /proc/PID/stat says of a process, from its state on. Throws if it has ended. */
const statOf = (pid) => readFileSync(`/proc/${pid}/stat`, 'latin1').split(') ').pop().split(' ');

/** The processes whose parent is `pid`. */
export function children(pid) {
  return readdirSync('/proc')
    .filter((name) => /^\d+$/.test(name))
    .map(Number)
    .filter((each) => {
      try {
        const fields = statOf(each);
        return Number(fields[1]) === pid && fields[0] !== 'Z';
      } catch {
        return false; // it has ended
      }
    });
}

/** The processes that check meshes and run jobs. */
export const workers = (d) => children(d.child.pid).flatMap(children);

/** Stops the process that runs the only job of a daemon, once that embeds. The stopped process takes no core, and the
 * daemon does not notice. Returns a function that lets it go on. */
export async function pause(d, job, options) {
  await until(async () => (await d.get(job.url, options)).json.stage === 'embed', 'the job runs', 120);
  const began = (pid) => {
    try {
      return Number(statOf(pid)[19]);
    } catch {
      return 0; // it has ended
    }
  };
  const [pid] = workers(d).sort((a, b) => began(b) - began(a)); // older ones have checked its mesh
  if (!pid) throw new Error('no process runs the job');
  process.kill(pid, 'SIGSTOP');
  return () => process.kill(pid, 'SIGCONT');
}

function megabytesOf(pids, what) {
  let kilobytes = 0;
  for (const pid of pids) {
    try {
      const usage = readFileSync(`/proc/${pid}/smaps_rollup`, 'latin1');
      for (const each of what.length ? what : ['']) {
        kilobytes += Number(new RegExp(`^Pss${each}:\\s+(\\d+)`, 'm').exec(usage)[1]);
      }
    } catch {
      // it has ended
    }
  }
  return kilobytes / 1024;
}

/** Megabytes of the daemon and all its processes; what they share counts once. what: all that is resident (''), or
 * parts of that: anonymous memory ('_Anon'), memory as files ('_Shmem'). The rest is pages of files. */
export function megabytes(d, ...what) {
  const forks = children(d.child.pid);
  return megabytesOf([d.child.pid, ...forks, ...forks.flatMap(children)], what);
}

/** The same of the daemon's own process. */
export const ownMegabytes = (d, ...what) => megabytesOf([d.child.pid], what);

/** Seconds of processor time of the daemon's own process. */
export function ownSeconds(d) {
  const fields = statOf(d.child.pid);
  return (Number(fields[11]) + Number(fields[12])) / 100;
}

/** Seconds of processor time of the processes that checked meshes and ran jobs; some check further files. */
export function workSeconds(d) {
  let ticks = 0; // of 1/100 s
  const add = (pid, at) => {
    const fields = statOf(pid);
    ticks += Number(fields[at]) + Number(fields[at + 1]);
  };
  for (const fork of children(d.child.pid)) {
    for (const pid of children(fork)) {
      try {
        add(pid, 11);
      } catch {
        // it has ended
      }
    }
    add(fork, 13); // those that have ended
  }
  return ticks / 100;
}

/** How many times slower a thread is now than alone, because of other work on this machine. */
export function busy() {
  const [began, before] = [performance.now(), process.cpuUsage()];
  let used;
  do {
    used = process.cpuUsage(before);
  } while (used.user + used.system < 50_000);
  return Math.max(1, (1000 * (performance.now() - began)) / (used.user + used.system));
}
