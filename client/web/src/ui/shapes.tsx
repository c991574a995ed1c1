/** Shapes: the views side by side, the list with uploads and refusals, the options. */
import { useState } from 'preact/hooks';
import {
  DEFAULTS,
  extrasOf,
  patch,
  readyShapes,
  set,
  state,
  takenFrom,
  TEXELS,
  tint,
  type Options,
  type Shape,
} from '../state';
import type { Extra } from '../mesh/extras';
import { piecesOf, repairsFor, sentenceFor, type Offer } from '../mesh/refusal';
import { addSamples, uploadAgain, moveShape, removeShape, sampleList } from '../actions/shapes';
import { stage } from '../view/shared';
import { count, counted } from '../words';
import { Bar, Button, Field, Icon, Segments, Switch } from './parts';
import { FilePicker } from './files';
import { Pane } from './pane';
import { Welcome } from './welcome';

export function ShapesStage() {
  if (!state.shapes.length) return <Welcome />;
  return (
    <div class="grid" data-count={state.shapes.length}>
      {state.shapes.map((shape, index) => (
        <Pane key={shape.key} label={shape.name} model={shape.model} wire={state.wire}>
          <Caption shape={shape} index={index} />
        </Pane>
      ))}
    </div>
  );
}

export function Caption({ shape, index }: { shape: Shape; index: number }) {
  return (
    <div class="caption">
      <span class="dot" style={{ background: tint(index) }} aria-hidden="true" />
      <strong>{shape.name}</strong>
      {shape.facts && <span class="muted">{count(shape.facts.triangles)} triangles</span>}
      {shape.state === 'refused' && <span class="badge bad">refused</span>}
      {!shape.model && !shape.message && shape.state !== 'refused' && shape.state !== 'failed' && (
        <span class="muted">reading…</span>
      )}
    </div>
  );
}

export function ShapesInspector() {
  const left = sampleList.filter((sample) => !state.shapes.some((shape) => shape.name === sample.name));
  return (
    <>
      <h2>Shapes</h2>
      <ul class="cards">
        {state.shapes.map((shape, index) => (
          <ShapeCard key={shape.key} shape={shape} index={index} />
        ))}
      </ul>
      <div class="row wrap">
        <FilePicker label="Add files" />
        {left.slice(0, 4).map((sample) => (
          <Button
            kind="quiet"
            key={sample.file}
            icon="plus"
            onClick={() => void addSamples([sample])}
            label={`Add the sample ${sample.name}`}
          >
            {sample.name}
          </Button>
        ))}
      </div>
      <div class="row wrap gap-top">
        <Switch
          label="Link the cameras"
          on={state.linked}
          onChange={(linked) => {
            for (const view of stage.views) view.own.restore(stage.orbit.toString());
            stage.linked = linked;
            set({ linked });
            stage.draw();
          }}
        />
        <Switch label="Wireframe" on={state.wire} onChange={(wire) => set({ wire })} />
      </div>
      <OwnMesh />
      <Extras />
      <OptionsFold />
    </>
  );
}

/** Whether the first mesh stays as it came, and with its holes. */
function OwnMesh() {
  const [first] = state.shapes;
  if (!first?.mesh) return null;
  const keeps = state.options.remesh === 'template';
  const filled = first.mesh.repairs?.some(({ kind, count }) => kind === 'fill_holes' && count > 0);
  return (
    <div class="own">
      <Switch
        label={`Keep the mesh of ${first.name}`}
        on={keeps}
        onChange={(on) => change({ remesh: on ? 'template' : DEFAULTS.remesh })}
      />
      <p class="hint">
        {keeps
          ? `Its vertices, triangles, texture coordinates, skin, materials and holes stay as they are. The other shapes become its morph targets.`
          : 'Off: the morph has a new mesh that fits all shapes.'}
      </p>
      {filled && !keeps && (
        <Switch
          label={`Open the holes of ${first.name} again in the morph`}
          on={state.options.holes === 'reopen'}
          onChange={(on) => change({ holes: on ? 'reopen' : 'filled' })}
        />
      )}
      {keeps && <Surface shape={first} />}
    </div>
  );
}

/** A tick for each. */
function Ticks<T extends string | number>({
  items,
  ticked,
  onChange,
}: {
  items: { value: T; label: string }[];
  ticked: T[];
  onChange: (ticked: T[]) => void;
}) {
  return items.map(({ value, label }) => (
    <label class="check" key={value}>
      <input
        type="checkbox"
        checked={ticked.includes(value)}
        onChange={(event) =>
          onChange(event.currentTarget.checked ? [...ticked, value] : ticked.filter((other) => other !== value))
        }
      />
      <span>{label}</span>
    </label>
  ));
}

/** Names the parts of a document that its closed surface consists of. The others stay as they are. */
function Surface({ shape }: { shape: Shape }) {
  const { content, surface = { meshes: [], nodes: [] } } = shape;
  if (!content || content.meshes.length < 2) return null;
  const named = surface.meshes.length + surface.nodes.length;
  return (
    <details class="fold">
      <summary>
        The closed surface: {named ? `${named} named ${named === 1 ? 'part' : 'parts'}` : 'what was uploaded'}
      </summary>
      <fieldset class="extras scrolls" aria-label="Meshes of the closed surface">
        <legend>Meshes</legend>
        <Ticks
          items={content.meshes.map(({ number, name }) => ({
            value: number,
            label: name ? `Mesh ${number}, “${name}”` : `Mesh ${number}`,
          }))}
          ticked={surface.meshes}
          onChange={(meshes) => patch(shape, { surface: { ...surface, meshes } })}
        />
      </fieldset>
      {content.nodes.length > 0 && (
        <fieldset class="extras scrolls" aria-label="Nodes of the closed surface">
          <legend>Nodes, with those below them</legend>
          <Ticks
            items={content.nodes.map((name) => ({ value: name, label: `Node “${name}”` }))}
            ticked={surface.nodes}
            onChange={(nodes) => patch(shape, { surface: { ...surface, nodes } })}
          />
        </fieldset>
      )}
      <p class="hint">
        Name what the morph moves. Eyes, clothes and other parts stay as they are. If the uploaded surface is made of
        other parts, the morph is refused, and says which.
      </p>
    </details>
  );
}

const TAKE: Record<Extra, (name: string) => string> = {
  skin: (name) => `Take the skin of ${name}`,
  color: (name) => `Take the vertex colours of ${name}`,
  texcoord: (name) => `Take the texture coordinates of ${name}`,
  targets: (name) => `Take the morph targets of ${name}`,
  texture: (name) => `Take the texture of ${name}, as a second look`,
};

const KEEP: Partial<Record<Extra, (name: string) => string>> = {
  skin: (name) => `Keep the skin of ${name}`,
  color: (name) => `Keep the further vertex colours of ${name}`,
  texcoord: (name) => `Keep the further texture coordinates of ${name}`,
  targets: (name) => `Keep the morph targets of ${name}`,
};

/** Takes something from a shape, or leaves it. A morph has one skin: that of another shape is left. */
function take(shape: Shape, what: Extra, on: boolean) {
  for (const other of state.shapes)
    if (other === shape || (on && what === 'skin'))
      patch(other, { taken: (other.taken ?? []).filter((known) => known !== what) });
  if (on) patch(shape, { taken: [...(shape.taken ?? []), what] });
}

/** The sizes on offer, with one that the request of an opened morph has. */
const texelChoices = (own: number | null) =>
  own && !TEXELS.includes(own) ? [...TEXELS, own].sort((a, b) => a - b) : TEXELS;

/** What the morph can take from the shapes besides their surfaces. */
function Extras() {
  const [first] = readyShapes();
  const offers = readyShapes().flatMap((shape) => extrasOf(shape).map((what) => ({ shape, what })));
  if (!offers.length) return null;
  return (
    <fieldset class="extras">
      <legend>Besides the surfaces</legend>
      {offers.map(({ shape, what }) => (
        <label class="check" key={`${shape.key} ${what}`}>
          <input
            type="checkbox"
            checked={takenFrom(shape).includes(what)}
            onChange={(event) => take(shape, what, event.currentTarget.checked)}
          />
          <span>{((shape === first && KEEP[what]) || TAKE[what])(shape.name)}</span>
        </label>
      ))}
      {offers.some(({ shape, what }) => what === 'texture' && takenFrom(shape).includes(what)) && (
        <Field label="Size of the pictures">
          <select
            value={String(state.options.texels ?? '')}
            onChange={(event) => change({ texels: Number(event.currentTarget.value) || null })}
          >
            <option value="">As fine as those of the shape</option>
            {texelChoices(state.options.texels).map((size) => (
              <option key={size} value={String(size)}>
                {size} × {size} texels
              </option>
            ))}
          </select>
        </Field>
      )}
      <p class="hint">
        The morph gets these on its own surface: each vertex takes the values at its place on the shape.
      </p>
    </fieldset>
  );
}

function ShapeCard({ shape, index }: { shape: Shape; index: number }) {
  const { mesh } = shape;
  const repairs = (mesh?.repairs ?? []).filter((r) => r.count > 0);
  return (
    <li class={`card ${shape.state}`}>
      <div class="row spread">
        <div class="row tight">
          <span class="dot" style={{ background: tint(index) }} aria-hidden="true" />
          <strong class="clip" title={shape.name}>
            {shape.name}
          </strong>
        </div>
        <div class="row tight">
          {index > 0 && (
            <Button
              kind="quiet"
              icon="up"
              label={`Move ${shape.name} before ${state.shapes[index - 1].name}`}
              onClick={() => moveShape(shape.key, -1)}
            />
          )}
          <Button kind="quiet" icon="close" label={`Remove ${shape.name}`} onClick={() => removeShape(shape.key)} />
        </div>
      </div>
      {shape.facts && (
        <p class="facts">
          {count(shape.facts.vertices)} vertices · {count(shape.facts.triangles)} triangles ·{' '}
          {shape.facts.format.toUpperCase()}
        </p>
      )}
      {(shape.state === 'uploading' || shape.state === 'reading') && !mesh && (
        <Bar label={`Uploading ${shape.name}`} value={shape.progress} />
      )}
      {repairs.length > 0 && (
        <p class="facts">
          Repaired: {repairs.map((r) => `${r.kind.replace(/_/g, ' ')} (${count(r.count)})`).join(', ')}
        </p>
      )}
      {shape.state === 'ready' && (
        <p class="facts good">
          <Icon name="check" /> Closed, in one piece, no handles
        </p>
      )}
      {shape.problem && <Refusal shape={shape} />}
      {shape.message && !shape.problem && (
        <div class="notice error" role="alert">
          <Icon name="alert" />
          <div>
            <p>{shape.message}</p>
          </div>
          {shape.file && shape.state === 'failed' && (
            <Button onClick={() => void uploadAgain(shape.key, state.options.repair)}>Try again</Button>
          )}
        </div>
      )}
    </li>
  );
}

const HANDLES_SHOWN = 5;
const HANDLES_MOST = 2000; // a longer list makes the page slow
const PIECES_SHOWN = 5;

function ShowAll({ label, all, change }: { label: string; all: boolean; change: (all: boolean) => void }) {
  return (
    <Button kind="quiet" aria-expanded={all} onClick={() => change(!all)}>
      {all ? 'Show fewer' : label}
    </Button>
  );
}

/** A button for each repair; of very many pieces, the smaller ones on request, in a list that scrolls. */
function Mends({ shape, offers }: { shape: Shape; offers: Offer[] }) {
  const [all, setAll] = useState(false);
  const { total, listed } = piecesOf(shape.problem!);
  const label =
    total > listed ? `Show the largest ${count(listed)} of ${count(total)} pieces` : `Show all ${count(total)} pieces`;
  return (
    <>
      <div class={all ? 'row wrap scrolls' : 'row wrap'} role="group" aria-label={`Repairs of ${shape.name}`}>
        {offers.slice(0, all ? undefined : PIECES_SHOWN).map((offer) => (
          <Button key={offer.repair} onClick={() => void uploadAgain(shape.key, offer.repair)}>
            {offer.label}
          </Button>
        ))}
        {all && total > listed && <p class="facts">{count(total - listed)} smaller pieces are not listed.</p>}
      </div>
      {offers.length > PIECES_SHOWN && <ShowAll label={label} all={all} change={setAll} />}
    </>
  );
}

/** The length of each handle's loop; of very many, the others on request, in a list that scrolls. */
function Handles({ lengths }: { lengths: number[] }) {
  const [all, setAll] = useState(false);
  const listed = lengths.slice(0, all ? HANDLES_MOST : HANDLES_SHOWN);
  return (
    <>
      <ul class={all ? 'facts scrolls' : 'facts'} aria-label="Handles">
        {listed.map((length, i) => (
          <li key={i}>
            Handle {i + 1}: its loop is {Number((100 * length).toPrecision(2))} % of the diagonal long.
          </li>
        ))}
        {lengths.length > listed.length && <li>{count(lengths.length - listed.length)} more</li>}
      </ul>
      {lengths.length > HANDLES_SHOWN && (
        <ShowAll label={`Show all ${count(lengths.length)} handles`} all={all} change={setAll} />
      )}
    </>
  );
}

function Refusal({ shape }: { shape: Shape }) {
  const problem = shape.problem!;
  const offers = repairsFor(problem, shape.repair);
  const loops = problem.boundary_loops as number | undefined;
  const pieces = piecesOf(problem).total;
  const handles = (problem.loop_lengths_relative as number[] | undefined) ?? [];
  const lacks = !!shape.missing?.length;
  const said = lacks ? missingFiles(shape) : sentenceFor(problem, offers);
  return (
    <div class="notice error" role="alert">
      <Icon name="alert" />
      <div>
        <strong>{lacks ? 'A file of this shape is missing' : problem.title}</strong>
        <p>{said}</p>
        <p class="facts">
          {loops !== undefined && `${counted(loops, 'hole')}. `}
          {pieces > 0 && `${counted(pieces, 'piece')}. `}
          {problem.genus !== undefined && `Genus ${count(Number(problem.genus))}. `}
          {!lacks && problem.line !== undefined && `Line ${String(problem.line)}. `}
          {!lacks && problem.offset !== undefined && `Byte ${String(problem.offset)}. `}
          {!!shape.defects && shape.model && <span class="red">Shown in red on the model.</span>}
        </p>
        {handles.length > 0 && <Handles lengths={handles} />}
        <Mends shape={shape} offers={offers} />
        {said !== problem.detail && (
          <details class="dropped">
            <summary>What the server says</summary>
            <p class="facts">{problem.detail}</p>
          </details>
        )}
      </div>
    </div>
  );
}

/** A glTF without its buffers is refused, whatever else the daemon says of it. */
const missingFiles = ({ name, missing = [] }: Shape) =>
  `${name} needs ${missing.join(', ')}, which ${missing.length > 1 ? 'were' : 'was'} not added with it. Remove it, and add or drop all its files together.`;

function change(options: Partial<Options>) {
  set({ options: { ...state.options, ...options } });
}

/** "embedding: method kernel-sampling, align: preset quality": names and values as in the request. */
function moreOf({ embedding, align, asset }: Options['more']): string {
  const list = (values: object = {}) =>
    Object.entries(values).map(
      ([key, value]) => `${key.replace(/_/g, ' ')} ${JSON.stringify(value).replace(/"/g, '')}`,
    );
  return [
    ...(embedding ? [`embedding ${embedding.method}`, ...list(embedding.options)] : []),
    ...list(align?.options),
    ...list(asset),
  ].join(', ');
}

/** What the next morph keeps of the request of an opened one, beyond the fields of the page. */
function More() {
  const { more } = state.options;
  if (!Object.keys(more).length) return null;
  return (
    <div class="field">
      <p class="hint">
        As the opened morph: {moreOf(more)}.{' '}
        <button type="button" class="link" onClick={() => change({ more: {} })}>
          Leave this out
        </button>
      </p>
    </div>
  );
}

export function OptionsFold() {
  const { options } = state;
  return (
    <details class="fold">
      <summary>Options</summary>
      <Field
        label="Matching"
        hint="How the correspondence is found. Automatic: from the landmarks if there are any, otherwise from the shapes."
      >
        <select
          value={options.align}
          onChange={(event) => change({ align: event.currentTarget.value as Options['align'] })}
        >
          <option value="default">Automatic</option>
          <option value="pin">Pinned landmarks</option>
          <option value="auto">From the shapes alone</option>
          <option value="rbf">Radial basis functions</option>
          <option value="rotate">Rotation only</option>
        </select>
      </Field>
      <Field label="Common mesh">
        <select
          value={options.remesh}
          onChange={(event) => change({ remesh: event.currentTarget.value as Options['remesh'] })}
        >
          <option value="adaptive">Adaptive: as few triangles as needed</option>
          <option value="template">Template: keep my first mesh as it is</option>
          <option value="overlay">Overlay: exact, many triangles</option>
          <option value="subdivision">Subdivision</option>
          <option value="convex-hull">Convex hull</option>
        </select>
      </Field>
      <Field label={`Tolerance: ${relative(options.tolerance)} of the size`}>
        <input
          type="range"
          min={-4}
          max={-1.5}
          step={0.05}
          value={Math.log10(options.tolerance)}
          aria-valuetext={`${relative(options.tolerance)} of the size`}
          onInput={(event) => change({ tolerance: Number((10 ** Number(event.currentTarget.value)).toPrecision(2)) })}
        />
      </Field>
      <Field label="Most triangles" hint="Empty: no limit. The limit takes precedence over the tolerance.">
        <input
          type="number"
          min={4}
          step={1000}
          placeholder="no limit"
          value={options.maxTriangles ?? ''}
          onChange={(event) =>
            change({
              maxTriangles:
                Number(event.currentTarget.value) >= 4 ? Math.round(Number(event.currentTarget.value)) : null,
            })
          }
        />
      </Field>
      <div class="field">
        <span class="field-name">Path between the shapes</span>
        <Segments
          label="Path between the shapes"
          value={options.path}
          onChange={(path) => change({ path })}
          items={[
            { value: 'linear', label: 'Straight' },
            { value: 'rigid', label: 'As rigid as possible' },
          ]}
        />
      </div>
      <div class="field">
        <span class="field-name">Placement</span>
        <Segments
          label="Placement"
          value={options.fit}
          onChange={(fit) => change({ fit })}
          items={[
            {
              value: 'auto',
              label: 'Auto',
              hint: 'Fit the other shapes where their size, axes or place clearly differ',
            },
            {
              value: 'similarity',
              label: 'Fit size',
              hint: 'Translate, rotate and scale the other shapes to fit the first',
            },
            { value: 'rigid', label: 'Move' },
            { value: 'none', label: 'As in the files' },
          ]}
        />
      </div>
      <More />
    </details>
  );
}

const relative = (x: number) => `${Number((x * 100).toPrecision(2))} %`;
