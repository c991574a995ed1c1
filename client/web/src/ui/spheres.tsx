/** The Spheres tab: each surface beside its sphere in the same colours, distortion as heat map and histogram. */
import { useEffect } from 'preact/hooks';
import type { Measure } from 'orbmorph';
import { PAINTS, readyShapes, state, tint, type Shape, type SpherePaint } from '../state';
import { canAlign, isMeasure, loadSpheres, measureRange, setPaint, showSide, sphereOf } from '../actions/spheres';
import { Bar, Segments } from './parts';
import { Pane } from './pane';
import { Legend } from './labels';

const NAMES: Record<SpherePaint, string> = {
  direction: 'Normals',
  checker: 'Checkerboard',
  symmetric_dirichlet: 'Stretch',
  angle: 'Angles',
  area: 'Areas',
  aspect: 'Triangle shape',
};
const MEANING: Record<SpherePaint, string> = {
  direction: 'Normals of the surface as colours. The sphere has the same colours, so you can recognise parts on it.',
  checker:
    'A regular checkerboard on the sphere, mapped back to the surface. Cells are large where the map shrinks the surface.',
  symmetric_dirichlet: 'Symmetric Dirichlet energy: 1 where the map preserves lengths, more where it distorts them.',
  angle: 'Ratio of the singular values: 1 where the map preserves angles.',
  area: 'Logarithm of the area ratio: blue where the map shrinks areas, red where it enlarges them.',
  aspect: 'Circumradius over twice the inradius of the triangles on the sphere: 1 for equilateral triangles.',
};

export function SpheresStage() {
  const shapes = readyShapes();
  useEffect(() => void loadSpheres(), [shapes.map((s) => s.key).join(), state.result, state.side]);
  return (
    <div class="grid pairs" data-count={shapes.length * 2}>
      {shapes.map((shape) => {
        const sphere = sphereOf(shape);
        const index = state.shapes.indexOf(shape);
        return [
          <Pane key={`${shape.key}a`} label={`${shape.name}, surface`} model={sphere?.surface} wire={state.wire}>
            <div class="caption">
              <span class="dot" style={{ background: tint(index) }} aria-hidden="true" />
              <strong>{shape.name}</strong>
            </div>
            {sphere?.state === 'working' && (
              <div class="centered">
                <Bar label={`Mapping ${shape.name} to the sphere`} value={sphere.job?.progress ?? null} />
              </div>
            )}
            {sphere?.state === 'failed' && (
              <div class="centered">
                <p class="red">{sphere.message}</p>
              </div>
            )}
          </Pane>,
          <Pane
            key={`${shape.key}b`}
            label={`${shape.name}, sphere ${state.side} the alignment`}
            model={sphere?.ball}
            wire={state.wire}
            spots={sphere}
          >
            <div class="caption">
              <span class="muted">{state.side === 'after' ? 'on the common sphere' : 'on its own sphere'}</span>
            </div>
          </Pane>,
        ];
      })}
    </div>
  );
}

export function SpheresInspector() {
  const { paint } = state;
  const range = isMeasure(paint) ? measureRange(paint) : null;
  return (
    <>
      <h2>Spheres</h2>
      <Segments
        label="Alignment"
        value={state.side}
        onChange={showSide}
        items={[
          { value: 'before', label: 'Before alignment' },
          { value: 'after', label: 'After', off: !canAlign(), hint: canAlign() ? undefined : 'Morph the shapes first' },
        ]}
      />
      <p class="hint">
        {state.side === 'after'
          ? 'All shapes on one common sphere: points at the same position correspond.'
          : canAlign()
            ? 'Each shape on its own sphere.'
            : 'Each shape on its own sphere. Morph the shapes to see the aligned spheres.'}
      </p>
      <Segments
        label="Colour"
        value={paint}
        onChange={setPaint}
        items={PAINTS.map((value) => ({ value, label: NAMES[value] }))}
      />
      <p class="hint">{MEANING[paint]}</p>
      {range && (
        <Legend
          ramp={paint === 'area' ? 'diverging' : 'heat'}
          low={range.low.toFixed(2)}
          high={range.high.toFixed(2)}
          label={`${NAMES[paint]}${paint === 'area' ? '' : ', logarithmic'}`}
        />
      )}
      {readyShapes().map((shape) => (
        <ShapeReport key={shape.key} shape={shape} />
      ))}
    </>
  );
}

function ShapeReport({ shape }: { shape: Shape }) {
  const embedding = shape.sphere?.embedding;
  if (!embedding) return null;
  const { paint } = state;
  const measure = embedding.distortion?.[isMeasure(paint) ? paint : 'symmetric_dirichlet'];
  const { certificate } = embedding;
  return (
    <section class="sphere-report" aria-label={`Distortion of ${shape.name}`}>
      <h3>
        <span class="dot" style={{ background: tint(state.shapes.indexOf(shape)) }} aria-hidden="true" /> {shape.name}
      </h3>
      <p class={`facts ${certificate?.valid ? 'good' : 'red'}`}>
        {certificate?.valid ? 'Certified one to one' : 'Not certified'}: {certificate?.flipped} flipped, degree{' '}
        {certificate?.degree}
      </p>
      {measure && (
        <>
          <Histogram
            measure={measure}
            label={`${NAMES[isMeasure(paint) ? paint : 'symmetric_dirichlet']} of ${shape.name}`}
          />
          <dl class="numbers">
            {(['mean', 'median', 'p99', 'max'] as const).map((key) => (
              <div key={key}>
                <dt>{key === 'p99' ? '99 %' : key}</dt>
                <dd>{measure[key]?.toPrecision(3)}</dd>
              </div>
            ))}
          </dl>
        </>
      )}
    </section>
  );
}

function Histogram({ measure, label }: { measure: Measure; label: string }) {
  const { edges, counts } = measure.histogram ?? { edges: [], counts: [] };
  if (!counts?.length) return null;
  const most = Math.max(...counts, 1e-12);
  const width = 300 / counts.length;
  const middle = counts.reduce((best, c, i) => (c > counts[best] ? i : best), 0);
  return (
    <figure class="histogram">
      <svg
        viewBox="0 0 300 84"
        role="img"
        preserveAspectRatio="none"
        aria-label={`Histogram, ${label}: from ${edges[0]?.toPrecision(3)} to ${edges.at(-1)?.toPrecision(3)}, most around ${edges[middle]?.toPrecision(3)}`}
      >
        {counts.map((c, i) => {
          const h = (c / most) * 82;
          return <rect key={i} x={i * width + 0.5} y={84 - h} width={Math.max(width - 1, 0.5)} height={h} rx="1" />;
        })}
      </svg>
      <figcaption class="row spread">
        <span>{edges[0]?.toPrecision(3)}</span>
        <span>{edges.at(-1)?.toPrecision(3)}</span>
      </figcaption>
    </figure>
  );
}
