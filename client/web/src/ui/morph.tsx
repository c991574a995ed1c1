/** The Morph tab: playing, scrubbing and mixing; the common mesh on each shape; the error; downloads. */
import { useEffect, useRef } from 'preact/hooks';
import { isFast, isTemplate, isWaiting, presetOf, set, state, tint, toast, type Result } from '../state';
import { save } from '../actions/landmarks';
import { explain } from '../actions/token';
import { measureErrors, measureStretch, showLook, STRETCHED } from '../actions/merge';
import { player } from '../player';
import { client } from '../state';
import { Beside } from './beside';
import { Legend, Name } from './labels';
import { Coarse, Match, Suspects, Rotated, Warnings } from './match';
import { count, relative, ROUNDING } from '../words';
import { Button, Icon, Segments, Switch } from './parts';
import { Pane } from './pane';
import { OptionsFold } from './shapes';
import { fileName } from './take';

export function MorphStage() {
  const { result, show } = state;
  if (!result) return <NoMorph />;
  if (show === 'beside')
    return (
      <div class="morph">
        <Beside result={result} />
        <Transport result={result} />
      </div>
    );
  return (
    <div class="morph">
      <div class="grid" data-count={show === 'morph' ? 1 : result.supermesh.shapes.length}>
        {show === 'morph' && <Pane key="main" label="Morph" model={result.main} wire={state.wire} />}
        {show === 'each' &&
          result.supermesh.shapes.map((shape, i) => (
            <Pane
              key={`each${i}`}
              label={`The common mesh as ${shape.name}`}
              model={result.each[i]}
              wire={state.meshWire}
            >
              <Name index={i} name={shape.name} note={`${count(result.supermesh.triangles)} triangles`} />
            </Pane>
          ))}
        {show === 'stretch' &&
          result.supermesh.shapes.map((shape, i) => (
            <Pane key={`stretch${i}`} label={`Stretch on ${shape.name}`} model={result.stretch?.[i]} wire={state.wire}>
              <Name index={i} name={shape.name} note={result.stretch ? stretchedMost(result, i) : 'measuring…'} />
              <Legend
                ramp="heat"
                low="1: as it was"
                high={`${STRETCHED}: bad`}
                label="how much the morph stretches it"
              />
            </Pane>
          ))}
        {show === 'error' &&
          state.shapes.map((shape, i) => (
            <Pane
              key={`error${shape.key}`}
              label={`Error on ${shape.name}`}
              model={shape.error?.model}
              wire={state.wire}
            >
              <Name
                index={i}
                name={shape.name}
                note={
                  shape.error ? `largest ${relative(shape.error.max)}, rms ${relative(shape.error.rms)}` : 'measuring…'
                }
              />
              {shape.error && (
                <Legend
                  ramp="heat"
                  low="0"
                  high={relative(shape.error.top)}
                  label={
                    isTemplate(result) && i > 0
                      ? `how far ${shape.name} is from the mesh of ${result.supermesh.shapes[0].name}, shown, relative to its size`
                      : "distance from the common mesh, relative to the shape's size"
                  }
                />
              )}
            </Pane>
          ))}
      </div>
      {show === 'morph' && <Transport result={result} />}
    </div>
  );
}

function NoMorph() {
  return (
    <div class="blank big">
      <p>No morph yet. Add two shapes and press “Morph”.</p>
      <Button onClick={() => set({ tab: 'shapes' })}>Go to the shapes</Button>
    </div>
  );
}

function Transport({ result }: { result: Result }) {
  const slider = useRef<HTMLInputElement>(null);
  const stops = useRef<HTMLDivElement>(null);
  const names = result.supermesh.shapes.map((shape) => shape.name);
  useEffect(
    () =>
      player.listen((time) => {
        const input = slider.current;
        if (!input) return;
        input.value = String(time);
        input.style.setProperty('--at', `${time * 100}%`);
        [...stops.current!.children].forEach((stop, i) => {
          const isHere = !state.mix && Math.abs(time * (names.length - 1) - i) < 1e-6;
          if (isHere) stop.setAttribute('aria-current', 'true');
          else stop.removeAttribute('aria-current');
        });
      }),
    [result],
  );
  const say = () => {
    const at = player.time * (names.length - 1);
    const i = Math.min(Math.floor(at), names.length - 2);
    return `${Math.round((at - i) * 100)} % from ${names[i]} to ${names[i + 1]}`;
  };
  return (
    <div class="transport">
      <button type="button" class="play" aria-label={state.playing ? 'Pause' : 'Play'} onClick={() => player.toggle()}>
        <Icon name={state.playing ? 'pause' : 'play'} />
      </button>
      <div class="scrub">
        <input
          ref={slider}
          type="range"
          min={0}
          max={1}
          step={0.001}
          aria-label="Along the morph"
          aria-valuetext={say()}
          onInput={(event) => {
            const time = Number(event.currentTarget.value);
            player.pause();
            if (state.mix) set({ mix: null });
            player.seek(time);
            event.currentTarget.setAttribute('aria-valuetext', say());
          }}
        />
        <div class="stops" ref={stops}>
          {names.map((name, i) => (
            <button
              type="button"
              key={i}
              class="stop"
              aria-label={`Show ${name}`}
              title={name}
              onClick={() => {
                player.pause();
                if (state.mix) set({ mix: null });
                player.seek(i / Math.max(names.length - 1, 1));
              }}
            >
              <span class="dot" style={{ background: tint(i) }} aria-hidden="true" />
              <span class="clip">{name}</span>
            </button>
          ))}
        </div>
      </div>
    </div>
  );
}

/** Switches the wireframe of the current view; “Each shape” has one of its own. */
export const switchWire = () =>
  set(state.tab === 'morph' && state.show === 'each' ? { meshWire: !state.meshWire } : { wire: !state.wire });

/** Which morph is shown, and what becomes of it. */
function Shown({ result }: { result: Result }) {
  return (
    <p class="hint" role="status" aria-label="Which morph is shown">
      {!isFast(result)
        ? `Shown: the ${presetOf(result)} morph.`
        : isWaiting()
          ? 'Shown: the fast morph. The default one replaces it when it is done; then you can download it.'
          : 'Shown: the fast morph. “Morph again” makes the default one.'}
    </p>
  );
}

/** Whether the landmarks of a morph were set, not found. */
function wereGiven({ supermesh }: Result) {
  const given = supermesh.request?.landmarks;
  return Array.isArray(given) && given.every((landmark) => landmark.confidence === 1);
}

/** "20 exact, 1 soft, up to 4.7 % from its place": exact are only those that were set and have a weight of 1. */
function landmarksIn(result: Result): string {
  const { landmarks = [], certificate } = result.supermesh;
  const soft = landmarks.filter((landmark) => 'weight' in landmark);
  const firm = landmarks.length - soft.length;
  const exact = firm > 0 && certificate?.landmarks_exact && wereGiven(result);
  if (!soft.length) return `${firm}${exact ? ', exact' : ''}`;
  const worst = Math.max(...soft.flatMap((landmark) => landmark.residual_relative.map((x) => x ?? 0)));
  const place = soft.length > 1 ? 'their places' : 'its place';
  const before = firm ? `${firm}${exact ? ' exact' : ''}, ` : '';
  return `${before}${soft.length} soft, ${worst > ROUNDING ? `up to ${relative(worst)} from` : 'at'} ${place}`;
}

function Download({ result }: { result: Result }) {
  const { supermesh } = result;
  if (isWaiting())
    return (
      <Button icon="download" disabled onClick={() => {}}>
        Download GLB
      </Button>
    );
  return (
    <a
      class="button primary"
      href={client.url(supermesh.asset)}
      download={fileName(result, 'glb')}
      onClick={(event) => {
        if (!client.token) return;
        event.preventDefault(); // a link cannot send the token
        void client.asset(supermesh.id).then(
          (glb) => save(new Blob([glb], { type: 'model/gltf-binary' }), fileName(result, 'glb')),
          (error) => toast(explain(error), 'error'),
        );
      }}
    >
      <Icon name="download" />
      <span>Download GLB</span>
    </a>
  );
}

export function MorphInspector() {
  const { result } = state;
  if (!result)
    return (
      <>
        <h2>Morph</h2>
        <OptionsFold />
      </>
    );
  const { supermesh } = result;
  return (
    <>
      <h2>Morph</h2>
      <Shown result={result} />
      <Match result={result} />
      <Rotated result={result} />
      <Suspects result={result} />
      <Warnings result={result} />
      <Coarse result={result} />
      <Segments
        label="What is shown"
        value={state.show}
        onChange={(show) => {
          set({ show });
          if (show !== 'morph' && show !== 'beside') player.pause();
        }}
        items={[
          { value: 'morph', label: 'Morph' },
          { value: 'beside', label: 'Side by side' },
          { value: 'each', label: 'Each shape' },
          { value: 'stretch', label: 'Stretch', hint: 'A heat map of how much the morph stretches the surface' },
          { value: 'error', label: 'Error', hint: 'How far the common mesh is from each shape' },
        ]}
      />
      {state.show === 'beside' && (
        <p class="hint">Point at a place, or press Enter in a view: it is marked on all of them.</p>
      )}
      {state.show === 'stretch' && <StretchLoader />}
      {state.show === 'error' && <ErrorLoader />}
      {(state.show === 'morph' || state.show === 'beside') && <Mix result={result} />}
      {(state.show === 'morph' || state.show === 'beside') && <Extras result={result} />}
      <Looks result={result} />
      <div class="row wrap gap-top">
        <Switch label="Wireframe" on={state.show === 'each' ? state.meshWire : state.wire} onChange={switchWire} />
      </div>
      <Rims supermesh={supermesh} />
      <Dropped entries={supermesh.dropped} />
      <div class="row wrap gap-top">
        <Download result={result} />
        <Button icon="code" disabled={isWaiting()} onClick={() => set({ drawer: 'share' })}>
          Use it
        </Button>
      </div>
      <h3>Report</h3>
      <table class="report">
        <tbody>
          <tr>
            <th scope="row">Common mesh</th>
            <td>
              {count(supermesh.triangles)} triangles
              {supermesh.asset_triangles ? `, ${count(supermesh.asset_triangles)} in the asset` : ''}
            </td>
          </tr>
          <tr>
            <th scope="row">Closed, genus</th>
            <td>
              {supermesh.open_holes
                ? `open at ${supermesh.open_holes} ${supermesh.open_holes === 1 ? 'hole' : 'holes'}`
                : supermesh.certificate?.closed
                  ? 'yes'
                  : 'no'}
              , {supermesh.certificate?.genus}
            </td>
          </tr>
          <tr>
            <th scope="row">Flipped triangles</th>
            <td>{(supermesh.certificate?.flipped ?? []).join(', ') || '–'}</td>
          </tr>
          {!!supermesh.landmarks?.length && (
            <tr>
              <th scope="row">Landmarks</th>
              <td>{landmarksIn(result)}</td>
            </tr>
          )}
          <tr>
            <th scope="row">Time</th>
            <td data-varies>
              {supermesh.timings_ms?.total !== undefined
                ? `${(supermesh.timings_ms.total / 1000).toPrecision(2)} s`
                : '–'}
            </td>
          </tr>
        </tbody>
      </table>
      <table class="report">
        <thead>
          <tr>
            <th scope="col">Shape</th>
            <th scope="col">Largest error</th>
            <th scope="col">RMS</th>
            <th scope="col">Normals</th>
          </tr>
        </thead>
        <tbody>
          {supermesh.shapes.map((shape, i) => (
            <tr key={i}>
              <th scope="row">
                <span class="dot" style={{ background: tint(i) }} aria-hidden="true" /> {shape.name}
              </th>
              <td>{relative(shape.hausdorff_relative ?? shape.hausdorff_sampled_relative)}</td>
              <td>{relative(shape.rms_relative)}</td>
              <td>{shape.normal_deviation?.mean != null ? `${shape.normal_deviation.mean.toFixed(1)}°` : '–'}</td>
            </tr>
          ))}
        </tbody>
      </table>
      <Moved shapes={supermesh.shapes} />
      <OptionsFold />
    </>
  );
}

/** What the fit did to each shape that it moved. */
function Moved({ shapes }: { shapes: Result['supermesh']['shapes'] }) {
  const moved = shapes.flatMap(({ name, fit }) => (fit && fit.kind !== 'none' ? [{ name, fit }] : []));
  if (!moved.length) return null;
  return (
    <ul class="hint" aria-label="Shapes that the fit moved">
      {moved.map(({ name, fit }, i) => (
        <li key={i}>
          {`Onto ${shapes[0].name}, ${name} was scaled by ${Number(fit.scale.toPrecision(2))}, rotated by ${Math.round(fit.rotation_degrees)}°, and moved by ${Number(fit.translation_relative.toPrecision(2))} diagonals.`}
        </li>
      ))}
    </ul>
  );
}

/** The variants of the materials: those of the first shape, and the baked textures of others. */
function Looks({ result: { data, look } }: { result: Result }) {
  if (data.looks.length < 2) return null;
  return (
    <div class="field">
      <span class="field-name">Look</span>
      <Segments
        label="Look"
        value={String(look)}
        onChange={(value) => void showLook(Number(value))}
        items={data.looks.map(({ name }, i) => ({ value: String(i), label: name }))}
      />
    </div>
  );
}

/** Rims of holes that lie on each other. */
function Rims({ supermesh }: { supermesh: Result['supermesh'] }) {
  if (!supermesh.rims?.length) return null;
  const one = (rim: NonNullable<Result['supermesh']['rims']>[number]) =>
    `rim of hole ${rim.base.hole} to rim of hole ${rim.other.hole}${
      rim.off_relative < 1e-6 ? '' : `, at most ${(100 * rim.off_relative).toPrecision(2)} % of the diagonal apart`
    }`;
  return (
    <details class="dropped">
      <summary>
        {supermesh.rims.length === 1 ? 'A hole corresponds' : `${supermesh.rims.length} holes correspond`}
      </summary>
      <ul>
        {supermesh.rims.map((rim, i) => (
          <li key={i}>
            <strong>{supermesh.shapes[rim.shape]?.name}</strong> {one(rim)}
          </li>
        ))}
      </ul>
    </details>
  );
}

/** What the files have and the asset lacks. */
function Dropped({ entries }: { entries: Result['supermesh']['dropped'] }) {
  if (!entries?.length) return null;
  return (
    <details class="dropped">
      <summary>
        Not in the asset: {entries.length} {entries.length === 1 ? 'part' : 'parts'} of the files
      </summary>
      <ul>
        {entries.map((entry, i) => (
          <li key={i}>
            <strong>{entry.what}</strong> {entry.where && <span class="muted">{entry.where}</span>}
            <br />
            {entry.why}
          </li>
        ))}
      </ul>
    </details>
  );
}

function ErrorLoader() {
  useEffect(() => void measureErrors(), [state.result]);
  return <p class="hint">Distance of each shape from the common mesh, measured in this browser.</p>;
}

/** By the report: what 99 % of a shape's surface stay below; of the first shape, on the way to any other one. */
function stretchedMost({ supermesh: { pairs = [] } }: Result, shape: number): string {
  const of = pairs.filter(({ a, b }) => a === 0 && (shape === 0 || b === shape));
  const most = Math.max(...of.map(({ distortion }) => distortion.symmetric_dirichlet.p99 ?? Infinity));
  return Number.isFinite(most) ? `99 % of it below ${Number(most.toPrecision(2))}` : '';
}

function StretchLoader() {
  useEffect(() => void measureStretch(), [state.result]);
  return (
    <p class="hint">
      The map is least reliable where it stretches most: the symmetric Dirichlet energy between the first shape and each
      other one, from 1 to bad.
    </p>
  );
}

function Mix({ result }: { result: Result }) {
  const names = result.supermesh.shapes.map((shape) => shape.name);
  const inputs = useRef<(HTMLInputElement | null)[]>([]);
  useEffect(
    () =>
      player.listen((time) => {
        if (state.mix) return;
        const at = time * (names.length - 1);
        inputs.current.forEach((input, i) => {
          if (input) input.value = String(Math.max(0, 1 - Math.abs(at - i)));
        });
      }),
    [result],
  );
  const read = () => inputs.current.slice(0, names.length).map((input) => Number(input?.value ?? 0));
  return (
    <fieldset class="mix">
      <legend>Mix</legend>
      {names.map((name, i) => (
        <label key={i} class="mix-row">
          <span class="dot" style={{ background: tint(i) }} aria-hidden="true" />
          <span class="clip" title={name}>
            {name}
          </span>
          <input
            ref={(el) => void (inputs.current[i] = el)}
            type="range"
            min={0}
            max={1}
            step={0.01}
            aria-label={`Share of ${name}`}
            onInput={() => {
              const values = read();
              if (names.length === 2) {
                values[1 - i] = 1 - values[i];
                inputs.current[1 - i]!.value = String(values[1 - i]);
              }
              player.mix(values);
            }}
          />
        </label>
      ))}
    </fieldset>
  );
}

/** A slider for each target that is not a shape: those that came with the files. */
function Extras({ result }: { result: Result }) {
  const { extras } = result.data;
  if (!extras.length) return null;
  return (
    <fieldset class="mix many">
      <legend>Targets of the files</legend>
      {extras.map(({ name, target }, i) => (
        <label key={target} class="mix-row">
          <span class="dot" aria-hidden="true" />
          <span class="clip" title={name}>
            {name}
          </span>
          <input
            type="range"
            min={Math.min(0, result.extras[i])}
            max={Math.max(1, result.extras[i])}
            step={0.01}
            value={result.extras[i]}
            aria-label={`Weight of ${name}`}
            onInput={(event) => player.setExtra(i, Number(event.currentTarget.value))}
          />
        </label>
      ))}
    </fieldset>
  );
}
