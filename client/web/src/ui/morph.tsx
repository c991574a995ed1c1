/** The Morph tab: playing, scrubbing and mixing; the common mesh on each shape; the error; downloads. */
import { useEffect, useRef, useState } from 'preact/hooks';
import { isFast, isWaiting, presetOf, set, state, tint, toast, type Result } from '../state';
import { save } from '../actions/landmarks';
import { explain } from '../actions/token';
import { measureErrors, nextMatch } from '../actions/merge';
import { player } from '../player';
import { client } from '../state';
import { type RAMPS, rampCss } from '../view/colors';
import { Button, count, Icon, relative, Segments, Switch } from './parts';
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
                  high={relative(shape.error.max)}
                  label="distance from the common mesh, relative to the shape's size"
                />
              )}
            </Pane>
          ))}
      </div>
      {show === 'morph' && <Transport result={result} />}
    </div>
  );
}

/** The morph between the two shapes that it blends now, in one frame and under one camera. */
function Beside({ result }: { result: Result }) {
  const { shapes } = result.supermesh;
  const [leg, setLeg] = useState(0);
  useEffect(
    () => player.listen((time) => setLeg(Math.min(Math.floor(time * (shapes.length - 1)), shapes.length - 2))),
    [result],
  );
  const from = Math.min(leg, shapes.length - 2); // another morph may have fewer shapes
  const side = (i: number) => (
    <Pane key={`side${i}`} label={shapes[i].name} model={result.each[i]} wire={state.wire}>
      <Name index={i} name={shapes[i].name} note="" />
    </Pane>
  );
  return (
    <div class="grid" data-count={3}>
      {side(from)}
      <Pane key="main" label="Morph" model={result.main} wire={state.wire}>
        <div class="caption">
          <strong>Morph</strong>
        </div>
      </Pane>
      {side(from + 1)}
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

function Name({ index, name, note }: { index: number; name: string; note: string }) {
  return (
    <div class="caption">
      <span class="dot" style={{ background: tint(index) }} aria-hidden="true" />
      <strong>{name}</strong>
      <span class="muted">{note}</span>
    </div>
  );
}

export function Legend({
  ramp,
  low,
  high,
  label,
}: {
  ramp: keyof typeof RAMPS;
  low: string;
  high: string;
  label: string;
}) {
  return (
    <div class="legend">
      <span class="ramp" style={{ background: rampCss(ramp) }} aria-hidden="true" />
      <span class="row spread">
        <span>{low}</span>
        <span>{high}</span>
      </span>
      <span class="muted">{label}</span>
    </div>
  );
}

function Transport({ result }: { result: Result }) {
  const slider = useRef<HTMLInputElement>(null);
  const names = result.supermesh.shapes.map((shape) => shape.name);
  useEffect(
    () =>
      player.listen((time) => {
        const input = slider.current;
        if (!input) return;
        input.value = String(time);
        input.style.setProperty('--at', `${time * 100}%`);
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
        <div class="stops">
          {names.map((name, i) => (
            <button
              type="button"
              key={i}
              class="stop"
              aria-label={`Show ${name}`}
              onClick={() => {
                player.pause();
                if (state.mix) set({ mix: null });
                player.seek(i / Math.max(names.length - 1, 1));
              }}
            >
              <span class="dot" style={{ background: tint(i) }} aria-hidden="true" />
              {name}
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

/** How sure the match of the shapes is, and a way to the next one. */
function Match({ result }: { result: Result }) {
  const { matches, supermesh } = result;
  const verdict = supermesh.match?.verdict;
  const said =
    verdict === 'unsure'
      ? 'Not sure: the shapes may be matched wrongly. Look at it, try the next match, or set landmarks.'
      : verdict === 'likely'
        ? 'The match looks plausible, but check it before you rely on it.'
        : matches && matches.at > 0
          ? `Match ${matches.at + 1} of ${matches.requests.length}; the first one was the best.`
          : '';
  if (!said && !matches) return null;
  return (
    <div class="match">
      {said && (
        <p class="hint" role="status" aria-label="How sure the match is">
          {said}
        </p>
      )}
      {matches && (
        <Button disabled={!!state.running} onClick={() => void nextMatch()}>
          Next match
        </Button>
      )}
    </div>
  );
}

/** Landmarks that may be misplaced. */
function Suspects({ result: { supermesh } }: { result: Result }) {
  const { shapes, suspects = [] } = supermesh;
  if (!suspects.length) return null;
  return (
    <ul class="hint" aria-label="Landmarks that may be misplaced">
      {suspects.map(({ landmark, name, shape, share, distance_relative: far }) => (
        <li key={`${shape} ${landmark}`}>
          {`${name || `Landmark ${landmark + 1}`} may be misplaced: ${Math.round(100 * share)} % of the distortion is around it. On ${
            shapes[shape].name
          } it would lie ${Math.round(100 * far)} % of the diagonal away.`}
        </li>
      ))}
    </ul>
  );
}

/** Beyond this a fit turned a shape over: degrees of its up axis. */
const OVER = 60;

/** What the fit did to shapes that it turned over. */
function Turned({ result: { supermesh } }: { result: Result }) {
  const over = supermesh.shapes.filter(({ fit }) => (fit?.up_degrees ?? 0) > OVER);
  if (!over.length) return null;
  return (
    <ul class="hint" aria-label="Shapes that the fit turned over">
      {over.map(({ name, fit }) => (
        <li key={name}>
          {`The fit turned ${name} over: its up axis by ${Math.round(fit!.up_degrees)}°. If that is wrong, set landmarks, or choose another fit under Options.`}
        </li>
      ))}
    </ul>
  );
}

/** The share of the surface that may get thin halfway: a patch or two are hardly seen. */
const THIN_MOST = 0.01;

/** Where the map between two shapes is bad. */
function Warnings({ result: { supermesh } }: { result: Result }) {
  const { shapes } = supermesh;
  const warnings = (supermesh.warnings ?? []).filter(({ kind, share }) => kind !== 'thin' || share > THIN_MOST);
  if (!warnings.length) return null;
  const place = ({ shape, centre, radius }: (typeof warnings)[0]['parts'][0]['at'][0]) =>
    `around (${centre.map((x) => Number(x.toPrecision(3))).join(', ')}) of ${shapes[shape].name}, within ${Number(radius.toPrecision(2))}`;
  return (
    <ul class="hint" aria-label="Warnings of the map">
      {warnings.map(({ kind, a, b, share, parts }) => (
        <li key={`${kind}${a}${b}`}>
          {`From ${shapes[a].name} to ${shapes[b].name}, ${Number((100 * share).toPrecision(2))} % of the surface ${
            kind === 'thin' ? 'gets thin halfway, as if a limb were twisted' : 'is stretched badly'
          }: look ${place(parts[0].at[0])}. A landmark there may help.`}
        </li>
      ))}
    </ul>
  );
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
  const exact = supermesh.certificate?.landmarks_exact && wereGiven(result);
  return (
    <>
      <h2>Morph</h2>
      <Shown result={result} />
      <Match result={result} />
      <Turned result={result} />
      <Suspects result={result} />
      <Warnings result={result} />
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
          { value: 'error', label: 'Error' },
        ]}
      />
      {state.show === 'error' && <ErrorLoader />}
      {(state.show === 'morph' || state.show === 'beside') && <Mix result={result} />}
      <div class="row wrap gap-top">
        <Switch label="Wireframe" on={state.show === 'each' ? state.meshWire : state.wire} onChange={switchWire} />
      </div>
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
            <td>{count(supermesh.triangles)} triangles</td>
          </tr>
          <tr>
            <th scope="row">Closed, genus</th>
            <td>
              {supermesh.certificate?.closed ? 'yes' : 'no'}, {supermesh.certificate?.genus}
            </td>
          </tr>
          <tr>
            <th scope="row">Flipped triangles</th>
            <td>{(supermesh.certificate?.flipped ?? []).join(', ') || '–'}</td>
          </tr>
          {!!supermesh.landmarks?.length && (
            <tr>
              <th scope="row">Landmarks</th>
              <td>
                {supermesh.landmarks.length}
                {exact ? ', exact' : ''}
              </td>
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
      <Dropped entries={supermesh.dropped} />
      <OptionsFold />
    </>
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
          <span class="clip">{name}</span>
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
