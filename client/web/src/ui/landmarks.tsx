/** Landmarks: the same feature on each shape. */
import { useEffect, useRef } from 'preact/hooks';
import { hue, readyShapes, set, state, wireLandmarks } from '../state';
import {
  clearLandmarks,
  exportLandmarks,
  findSymmetry,
  importLandmarks,
  pending,
  redo,
  removeLandmark,
  renameLandmark,
  undo,
} from '../actions/landmarks';
import { canMerge, cancelMerge, startMerge } from '../actions/merge';
import { Button, Icon, Switch } from './parts';
import { Pane } from './pane';
import { Caption } from './shapes';

export function LandmarksStage() {
  const shapes = readyShapes();
  const open = pending();
  return (
    <div class="grid" data-count={shapes.length}>
      {shapes.map((shape) => (
        <Pane
          key={shape.key}
          label={`${shape.name}, landmarks`}
          model={shape.model}
          pickable={shape}
          markers={shape}
          wire={state.wire}
        >
          <Caption shape={shape} index={state.shapes.indexOf(shape)} />
          {open && !open.at[shape.key] && (
            <div class="wanted" style={{ '--hue': hue(state.landmarks.indexOf(open)) }}>
              Click {open.name ? `“${open.name}”` : `landmark ${state.landmarks.indexOf(open) + 1}`} here
            </div>
          )}
        </Pane>
      ))}
    </div>
  );
}

export function LandmarksInspector() {
  const shapes = readyShapes();
  const input = useRef<HTMLInputElement>(null);
  const complete = wireLandmarks().length;
  const finding = state.running?.purpose === 'find';
  useEffect(findSymmetry);
  return (
    <>
      <div class="row spread">
        <h2>Landmarks</h2>
        <div class="row tight">
          <Button kind="quiet" icon="undo" label="Undo" disabled={!state.past.length} onClick={undo} />
          <Button kind="quiet" icon="redo" label="Redo" disabled={!state.future.length} onClick={redo} />
        </div>
      </div>
      <p class="lead small">
        Click the same feature on each shape: a nose, a foot, the tip of a tail. Landmarks meet exactly. Five to ten,
        well spread, do most of the work.
      </p>
      <div class="row wrap">
        <Button
          icon={finding ? 'close' : 'wand'}
          disabled={!finding && (!canMerge() || !!state.running)}
          onClick={() => (finding ? cancelMerge() : void startMerge('find'))}
        >
          {finding ? 'Stop finding' : 'Find them for me'}
        </Button>
      </div>
      {shapes.some((shape) => shape.symmetric) && (
        <div title="A landmark on one side of a symmetric shape also sets its mirror image on the other side">
          <Switch label="Click left, get right" on={state.mirror} onChange={(mirror) => set({ mirror })} />
        </div>
      )}
      {state.landmarks.length > 0 && state.landmarks === state.listed && (
        <p class="hint">
          The morph found these. Correct, rename or delete any: the next morph then uses the whole list.
        </p>
      )}
      {state.landmarks.length === 0 ? (
        <div class="blank">
          <span class="marker still" style={{ '--hue': hue(0) }} aria-hidden="true">
            1
          </span>
          <p>No landmarks yet. Without landmarks, the shapes alone determine the correspondence.</p>
        </div>
      ) : (
        <ol class="marks">
          {state.landmarks.map((landmark, index) => {
            const missing = shapes.filter((shape) => !landmark.at[shape.key]);
            return (
              <li key={landmark.id} class={landmark.id === state.active ? 'active' : ''}>
                <button
                  type="button"
                  class="marker still"
                  style={{ '--hue': hue(index) }}
                  aria-pressed={landmark.id === state.active}
                  aria-label={`Select landmark ${index + 1}`}
                  onClick={() => set({ active: landmark.id })}
                >
                  {index + 1}
                </button>
                <input
                  type="text"
                  value={landmark.name}
                  placeholder={`Landmark ${index + 1}`}
                  aria-label={`Name of landmark ${index + 1}`}
                  maxLength={80}
                  onFocus={() => state.active !== landmark.id && set({ active: landmark.id })}
                  onChange={(event) => renameLandmark(landmark.id, event.currentTarget.value.trim())}
                />
                {landmark.weight && (
                  <span class="badge" title={`Soft: weight ${landmark.weight}`}>
                    soft
                  </span>
                )}
                {missing.length > 0 && (
                  <span class="badge warn" title={`Not yet on ${missing.map((s) => s.name).join(', ')}`}>
                    {missing.length} to go
                  </span>
                )}
                <Button
                  kind="quiet"
                  icon="trash"
                  label={`Delete landmark ${index + 1}`}
                  onClick={() => removeLandmark(landmark.id)}
                />
              </li>
            );
          })}
        </ol>
      )}
      {complete < state.landmarks.length && (
        <p class="hint">
          <Icon name="alert" /> Only landmarks set on every shape are used.
        </p>
      )}
      <div class="row wrap gap-top">
        <Button kind="quiet" icon="file" onClick={() => input.current!.click()}>
          Import
        </Button>
        <Button kind="quiet" icon="download" disabled={!complete} onClick={exportLandmarks}>
          Export
        </Button>
        <Button kind="quiet" icon="trash" disabled={!state.landmarks.length} onClick={clearLandmarks}>
          Clear
        </Button>
        <input
          ref={input}
          class="hidden"
          type="file"
          accept=".json,application/json"
          aria-label="Landmark file"
          tabIndex={-1}
          onChange={(event) => {
            const file = event.currentTarget.files?.[0];
            if (file) void importLandmarks(file);
            event.currentTarget.value = '';
          }}
        />
      </div>
    </>
  );
}
