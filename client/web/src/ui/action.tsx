/** The main action, always in the same place: the Morph button, or the progress of a morph. */
import type { Job } from 'orbmorph';
import { isWaiting, readyShapes, set, state, wireLandmarks, type Running } from '../state';
import { cancelMerge, startMerge } from '../actions/merge';
import { Bar, Button, Icon } from './parts';

const STAGES: Record<string, string> = {
  queued: 'Queued',
  check: 'Checking',
  simplify: 'Simplifying',
  embed: 'Mapping to the sphere',
  certify: 'Certifying',
  align: 'Matching the shapes',
  remesh: 'Building the common mesh',
  transfer: 'Transferring the shapes',
  write: 'Writing the asset',
};

const stageOf = (job: Job | null) =>
  (job && (STAGES[job.state === 'queued' ? 'queued' : (job.stage ?? '')] ?? job.stage)) || 'Starting';

/** The job that the page waits for, and what to call it: the fast morph, then the default one. */
function waitedFor({ fast, job }: Running): { job: Job | null; text: string } {
  if (fast?.job) return { job: fast.job, text: `Fast morph: ${stageOf(fast.job)}` };
  return { job, text: fast && (job || isWaiting()) ? `Default morph: ${stageOf(job)}` : stageOf(job) };
}

function Progress({ running }: { running: Running }) {
  const { job, text } = waitedFor(running);
  return (
    <div class="progress">
      <div class="progress-text" role="status">
        <span>{text}</span>
        <span class="number">{job?.progress ? `${Math.round(job.progress * 100)} %` : ''}</span>
      </div>
      <Bar label={running.purpose === 'find' ? 'Finding landmarks' : 'Morphing'} value={job?.progress ?? null} />
      <div class="row spread">
        <span class="hint">You may close the page; the job continues.</span>
        <Button kind="quiet" onClick={cancelMerge}>
          Cancel
        </Button>
      </div>
    </div>
  );
}

export function Action() {
  const ready = readyShapes().length;
  const { running, problem } = state;
  const busy = state.shapes.some((shape) => shape.state === 'reading' || shape.state === 'uploading');
  const again = state.tab === 'morph' && !!state.result;
  const landmarks = wireLandmarks().length;
  return (
    <div class="action">
      {problem && (
        <div class="notice error" role="alert">
          <Icon name="alert" />
          <div>
            <strong>{problem.title}</strong>
            <p>{problem.detail}</p>
          </div>
          <Button kind="quiet" icon="close" label="Dismiss" onClick={() => set({ problem: null })} />
        </div>
      )}
      {running ? (
        <Progress running={running} />
      ) : (
        <>
          <Button
            class={`button wide ${again ? '' : 'primary'}`}
            disabled={ready < 2 || busy}
            onClick={() => startMerge()}
          >
            {ready < 2 ? 'Morph' : again ? 'Morph again' : `Morph ${ready} shapes`}
          </Button>
          <p class="hint center">
            {ready < 2
              ? busy
                ? 'Uploading…'
                : ready === 1
                  ? 'Add one more shape.'
                  : 'Add two shapes.'
              : landmarks
                ? `${landmarks} landmark${landmarks > 1 ? 's' : ''} will meet exactly.`
                : 'Shapes are matched without landmarks.'}
          </p>
        </>
      )}
    </div>
  );
}
