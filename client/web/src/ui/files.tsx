/** The button that picks files. */
import { useRef } from 'preact/hooks';
import { addFiles } from '../actions/shapes';
import { Button } from './parts';

const ACCEPT = '.obj,.off,.ply,.stl,.3mf,.gltf,.glb,.json,.bin,.png,.jpg,.jpeg,.webp'; // the last ones: landmarks, files of a .gltf

export function FilePicker({ label, kind = 'plain' }: { label: string; kind?: 'plain' | 'primary' }) {
  const input = useRef<HTMLInputElement>(null);
  return (
    <>
      <Button kind={kind} icon="plus" onClick={() => input.current!.click()}>
        {label}
      </Button>
      <input
        ref={input}
        class="hidden"
        type="file"
        multiple
        accept={ACCEPT}
        aria-label="Mesh files"
        tabIndex={-1}
        onChange={(event) => {
          void addFiles(event.currentTarget.files ?? []);
          event.currentTarget.value = '';
        }}
      />
    </>
  );
}
