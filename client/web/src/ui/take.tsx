/** Take it away: the morph as a GLB, a page, a picture or a film, and how it moves in them. */
import { useEffect, useRef, useState } from 'preact/hooks';
import { client, isWaiting, MOTION, set, state, tint, toast, type Motion, type Result } from '../state';
import { save } from '../actions/landmarks';
import { explain } from '../actions/token';
import { player } from '../player';
import { film, hasWebp, picture, videoType, type Kind, type Subject } from '../take/film';
import { pageOf, type Settings } from '../take/page';
import { isDark } from '../theme';
import { stage } from '../view/shared';
import { Bar, Button, Field, Segments } from './parts';

/** What may stand in a file name. */
const plain = (name: string) => name.replace(/[\\/:*?"<>|]+/g, '_').trim() || 'shape';
export const fileName = ({ supermesh }: Result, ending: string) =>
  `${supermesh.shapes
    .map((s) => plain(s.name))
    .join('-')
    .slice(0, 120)}.${ending}`;

function settingsOf(result: Result): Settings {
  const { yaw, pitch, distance, panX, panY } = stage.orbit;
  const names = result.supermesh.shapes.map((s) => s.name);
  const camera = { yaw, pitch, distance, panX, panY };
  const { looks, extras } = result.data;
  return {
    shapes: names.length,
    names,
    tints: names.map((_, i) => tint(i)),
    ...state.motion,
    variant: looks[result.look]?.variant ?? -1,
    extras: extras.flatMap(({ target }, i) => (result.extras[i] ? [{ target, weight: result.extras[i] }] : [])),
    camera,
  };
}

const change = (motion: Partial<Motion>) => set({ motion: { ...state.motion, ...motion } });

function MotionFields() {
  const { motion } = state;
  return (
    <>
      <Field label={`${motion.seconds.toFixed(1)} seconds a shape`}>
        <input
          type="range"
          min={0.5}
          max={6}
          step={0.1}
          value={motion.seconds}
          aria-valuetext={`${motion.seconds.toFixed(1)} seconds a shape`}
          onInput={(event) => change({ seconds: Number(event.currentTarget.value) })}
        />
      </Field>
      <Field label="Easing">
        <select
          value={motion.easing}
          onChange={(event) => change({ easing: event.currentTarget.value as Motion['easing'] })}
        >
          {MOTION.easing.map((easing) => (
            <option key={easing} value={easing}>
              {easing[0].toUpperCase() + easing.slice(1)}
            </option>
          ))}
        </select>
      </Field>
      <div class="field">
        <span class="field-name">After the last shape</span>
        <Segments
          label="After the last shape"
          value={motion.loop}
          onChange={(loop) => change({ loop })}
          items={[
            { value: 'pingpong', label: 'Back again' },
            { value: 'loop', label: 'On to the first' },
          ]}
        />
      </div>
    </>
  );
}

const SIZES = { small: 360, medium: 540, large: 800 };

export function TakeAway({ result }: { result: Result }) {
  const [subject, setSubject] = useState<Subject>('morph');
  const [size, setSize] = useState<keyof typeof SIZES>('medium');
  const [webp, setWebp] = useState(false);
  const [share, setShare] = useState<number | null>(null);
  const abort = useRef<AbortController | null>(null);
  useEffect(() => {
    void hasWebp().then(setWebp);
    return () => abort.current?.abort();
  }, []);
  const asset = () => client.asset(result.supermesh.id);
  const place = () => player.time * (result.supermesh.shapes.length - 1);
  const attempt = (make: () => Promise<void>) => () =>
    make().catch((error) => {
      if (!abort.current?.signal.aborted) toast(explain(error), 'error');
    });
  const shoot = attempt(async () => {
    const blob = await picture(await asset(), settingsOf(result), place(), 1600, 1200);
    save(blob, fileName(result, 'png'));
  });
  const write = attempt(async () => {
    const html = pageOf(await asset(), settingsOf(result));
    save(new Blob([html], { type: 'text/html' }), fileName(result, 'html'));
  });
  const load = attempt(async () =>
    save(new Blob([await asset()], { type: 'model/gltf-binary' }), fileName(result, 'glb')),
  );
  const make = (kind: Kind) =>
    attempt(async () => {
      abort.current = new AbortController();
      setShare(0);
      try {
        const { blob, ending } = await film(await asset(), settingsOf(result), {
          kind,
          subject,
          place: place(),
          width: SIZES[size],
          height: SIZES[size],
          background: isDark() ? '#1a1d23' : '#f5f2ec',
          onProgress: setShare,
          signal: abort.current.signal,
        });
        save(blob, fileName(result, ending));
      } finally {
        setShare(null);
      }
    });
  const busy = share !== null || isWaiting();
  const video = videoType();
  return (
    <section class="take" aria-label="Take it away">
      <div class="row wrap">
        <Button kind="primary" icon="download" disabled={busy} onClick={write}>
          Web page
        </Button>
        <Button icon="download" disabled={busy} onClick={load}>
          GLB
        </Button>
        <Button icon="download" disabled={busy} onClick={shoot}>
          Picture
        </Button>
      </div>
      <p class="hint">The web page is one file: it holds the morph and its player, and needs no network.</p>
      <MotionFields />
      <h3>Film</h3>
      <Segments
        label="What moves"
        value={subject}
        onChange={setSubject}
        items={[
          { value: 'morph', label: 'The morph' },
          { value: 'turntable', label: 'A turntable' },
          { value: 'both', label: 'Both' },
        ]}
      />
      <Segments
        label="Size of the film"
        value={size}
        onChange={setSize}
        items={Object.entries(SIZES).map(([value, pixels]) => ({
          value: value as keyof typeof SIZES,
          label: `${pixels} × ${pixels}`,
        }))}
      />
      {share === null ? (
        <div class="row wrap">
          <Button icon="download" disabled={busy} onClick={make('gif')}>
            GIF
          </Button>
          {webp && (
            <Button icon="download" disabled={busy} onClick={make('webp')}>
              WebP
            </Button>
          )}
          {video && (
            <Button icon="download" disabled={busy} onClick={make('video')}>
              {video.startsWith('video/mp4') ? 'MP4' : 'WebM'}
            </Button>
          )}
        </div>
      ) : (
        <div class="row">
          <div class="grow">
            <Bar label="Making the film" value={share} />
          </div>
          <Button kind="quiet" onClick={() => abort.current?.abort()}>
            Cancel
          </Button>
        </div>
      )}
    </section>
  );
}
