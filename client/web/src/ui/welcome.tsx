/** The first page: a morph that plays, more to try, and a place for files. */
import { useEffect, useState } from 'preact/hooks';
import { set } from '../state';
import { addFiles, addSamples, samplePair } from '../actions/shapes';
import { filesOf, Show, SIGHTS, type Sight } from '../welcome';
import { stage } from '../view/shared';
import { Button, Segments } from './parts';
import { Pane } from './pane';
import { FilePicker } from './files';
import { Notice } from './notice';

/** Whether the user asks for less motion: then the morph stands still until it is played. */
const calm = () => matchMedia('(prefers-reduced-motion: reduce)').matches;

export function Welcome() {
  const [sight, setSight] = useState<Sight>(SIGHTS[0]);
  const [show, setShow] = useState<Show | null>(null);
  const [playing, setPlaying] = useState(!calm());

  useEffect(() => {
    const made = new Show(sight);
    stage.orbit.reset();
    stage.orbit.yaw = sight.yaw;
    made.load().then(
      () => {
        setShow(made);
        if (playing) made.play();
      },
      () => setShow(null), // the page works without it
    );
    return () => made.end();
  }, [sight]);
  // the camera of the shapes that are opened next
  useEffect(() => () => stage.orbit.reset(), []);

  const toggle = () => {
    if (playing) show?.pause();
    else show?.play();
    setPlaying(!playing);
  };
  const open = async () => {
    if (sight === SIGHTS[0]) await addSamples(samplePair());
    else await addFiles(await filesOf(sight));
  };

  return (
    <div class="welcome">
      <div class="hero">
        <Pane label={`A morph: ${sight.names.join(', ')}`} model={show?.sight === sight ? show.model : null} />
        <Button
          class="button quiet hero-play"
          icon={playing ? 'pause' : 'play'}
          label={playing ? 'Pause the sample' : 'Play the sample'}
          onClick={toggle}
        />
      </div>
      <div class="welcome-text">
        <Notice />
        <div class="row center wrap">
          <Segments
            label="Sample morphs"
            value={sight.key}
            onChange={(key) => setSight(SIGHTS.find((s) => s.key === key)!)}
            items={SIGHTS.map((s) => ({ value: s.key, label: s.label, hint: s.names.join(' → ') }))}
          />
        </div>
        <h1>Drop two shapes. Get a morph.</h1>
        <p class="lead">
          Any closed meshes: OBJ, OFF, PLY, STL, 3MF or glTF. The result is one GLB that blends between all of them,
          ready for three.js, Blender, Unity and the web.
        </p>
        <div class="drop-zone row center wrap">
          <FilePicker label="Choose files" />
          <Button kind="primary" icon="wand" onClick={() => void open()}>
            Try with samples
          </Button>
        </div>
        <p class="hint">
          Drop files anywhere, or{' '}
          <button type="button" class="link" onClick={() => set({ drawer: 'server' })}>
            open what is on the server
          </button>
        </p>
      </div>
    </div>
  );
}
