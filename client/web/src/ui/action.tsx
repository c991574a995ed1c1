/** The main action, always in the same place: the Morph button, or the progress of a morph. */
import { useEffect, useRef, useState } from 'preact/hooks';
import type { Job } from 'orbmorph';
import { givenLandmarks, isWaiting, readyShapes, SHAPES_MOST, state, type Running } from '../state';
import { canMerge, cancelMerge, startMerge } from '../actions/merge';
import { Notice } from './notice';
import { Bar, Button } from './parts';

/** The stages of a morph in their order, with the number of the step each belongs to. */
const STAGES: Record<string, [string, number]> = {
  queued: ['Waiting for its turn', 1],
  check: ['Checking the shapes', 1],
  simplify: ['Mapping to the sphere', 1],
  embed: ['Mapping to the sphere', 1],
  certify: ['Mapping to the sphere', 1],
  align: ['Matching the shapes', 2],
  remesh: ['Building the common mesh', 3],
  transfer: ['Placing the shapes', 4],
  write: ['Writing the asset', 5],
  store: ['Writing the asset', 5],
};
const STEPS = 5;

const stageOf = (job: Job | null) => {
  const [text, step] = (job && STAGES[job.state === 'queued' ? 'queued' : (job.stage ?? '')]) || ['Starting', 1];
  return `${text} (${step} of ${STEPS})`;
};

/** The job that the page waits for, and what to call it: the fast morph, then the default one. */
function waitedFor({ fast, job }: Running): { job: Job | null; text: string } {
  if (fast?.job) return { job: fast.job, text: `Fast morph: ${stageOf(fast.job)}` };
  return { job, text: fast && (job || isWaiting()) ? `Default morph: ${stageOf(job)}` : stageOf(job) };
}

const TICK = 250; // ms
/** A stage can be long. Until the daemon reports again, the bar creeps towards this much more than it reported. */
const CREEP = 0.12;
const CREEP_SECONDS = 12;

/** What is known of the job that is waited for, so that the bar moves between reports. */
interface Pace {
  id: string | null;
  reported: number;
  at: number;
  shown: number;
}

function paced(pace: Pace, job: Job | null, now: number): Pace {
  const reported = job?.progress ?? 0;
  const next = job && job.id !== pace.id ? { id: job.id, reported, at: now, shown: 0 } : { ...pace };
  if (reported > next.reported) Object.assign(next, { reported, at: now });
  const creep = CREEP * (1 - Math.exp(-(now - next.at) / 1000 / CREEP_SECONDS));
  next.shown = Math.max(next.shown, Math.min(next.reported + creep, 0.99));
  return next;
}

function left({ seconds_left: seconds }: Job): string {
  if (seconds == null) return 'estimating what is left';
  return seconds < 90 ? `about ${seconds} s left` : `about ${Math.round(seconds / 60)} min left`;
}

function Progress({ running }: { running: Running }) {
  const { job, text } = waitedFor(running);
  const [now, setNow] = useState(() => performance.now());
  const pace = useRef<Pace>({ id: null, reported: 0, at: now, shown: 0 });
  const begun = useRef(now);
  useEffect(() => {
    const timer = setInterval(() => setNow(performance.now()), TICK);
    return () => clearInterval(timer);
  }, []);
  pace.current = paced(pace.current, job, now);
  const seconds = Math.floor(Math.max(0, now - begun.current) / 1000);
  const clock = `${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, '0')}`;
  return (
    // not its Cancel button: holding Enter on “Morph” a moment too long would cancel the morph
    <div class="progress" role="group" aria-label="Progress" tabIndex={-1} data-takes-focus>
      <div class="progress-text">
        <span role="status">{text}</span>
        <span class="number">{pace.current.shown ? `${Math.round(pace.current.shown * 100)} %` : ''}</span>
      </div>
      <Bar label={running.purpose === 'find' ? 'Finding landmarks' : 'Morphing'} value={pace.current.shown || null} />
      <div class="row spread">
        <span class="hint number" data-varies>
          {clock}
          {job ? `, ${left(job)}` : ''}
        </span>
        <Button kind="quiet" onClick={cancelMerge}>
          Cancel
        </Button>
      </div>
      <p class="hint">You may close the page; the job continues.</p>
    </div>
  );
}

/** What a morph still needs. */
function missing(ready: number) {
  if (ready > SHAPES_MOST) {
    const many = ready - SHAPES_MOST;
    return `At most ${SHAPES_MOST} shapes morph at once. Remove ${many === 1 ? 'one' : many} of them.`;
  }
  const refused = state.shapes.filter((shape) => shape.state === 'refused').length;
  if (refused && ready + refused >= 2)
    return refused === 1 ? 'Repair or replace the refused shape first.' : 'Repair or replace the refused shapes first.';
  return ready === 1 ? 'Add one more shape.' : 'Add two shapes.';
}

/** Which of the landmarks meet. */
function meeting(landmarks: number, soft: number) {
  const exact = landmarks - soft;
  const drawn = soft ? `${soft} soft one${soft > 1 ? 's' : ''} will be drawn together` : '';
  const met = exact ? `${exact} landmark${exact > 1 ? 's' : ''} will meet exactly` : '';
  return `${[met, drawn].filter(Boolean).join(', ')}.`;
}

export function Action() {
  const ready = readyShapes().length;
  const { running } = state;
  const busy = state.shapes.some((shape) => shape.state === 'reading' || shape.state === 'uploading');
  const again = state.tab === 'morph' && !!state.result;
  const given = givenLandmarks();
  const landmarks = given.length;
  const soft = given.filter(({ weight }) => weight).length;
  return (
    <div class="action">
      <Notice />
      {running ? (
        <Progress running={running} />
      ) : (
        <>
          <Button
            class={`button wide ${again ? '' : 'primary'}`}
            disabled={!canMerge() || busy}
            onClick={() => startMerge()}
          >
            {ready < 2 ? 'Morph' : again ? 'Morph again' : `Morph ${ready} shapes`}
          </Button>
          <p class="hint center">
            {!canMerge()
              ? busy && ready < 2
                ? 'Uploading…'
                : missing(ready)
              : landmarks
                ? meeting(landmarks, soft)
                : 'Shapes are matched without landmarks.'}
          </p>
        </>
      )}
    </div>
  );
}
