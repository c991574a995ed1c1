/** The main action, always in the same place: the Morph button, or the progress of a morph. */
import { readyShapes, set, state, wireLandmarks } from '../state';
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
        <div class="progress">
          <div class="progress-text" role="status">
            <span>
              {(running.job &&
                (STAGES[running.job.state === 'queued' ? 'queued' : (running.job.stage ?? '')] ?? running.job.stage)) ||
                'Starting'}
            </span>
            <span class="number">{running.job?.progress ? `${Math.round(running.job.progress * 100)} %` : ''}</span>
          </div>
          <Bar
            label={running.purpose === 'find' ? 'Finding landmarks' : 'Morphing'}
            value={running.job?.progress ?? null}
          />
          <div class="row spread">
            <span class="hint">You may close the page; the job continues.</span>
            <Button kind="quiet" onClick={cancelMerge}>
              Cancel
            </Button>
          </div>
        </div>
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
