/** Files that belong to others that are added with them: the buffers and images of a glTF, the materials of an OBJ. */

const COMPANION = /\.(bin|mtl|png|jpe?g|webp|ktx2|bmp|tga|tiff?)$/i;

interface Linked {
  buffers?: { uri?: string }[];
  images?: { uri?: string }[];
}

const dataUrl = (file: File): Promise<string> =>
  new Promise((resolve, reject) => {
    const reader = new FileReader();
    reader.onload = () => resolve(reader.result as string);
    reader.onerror = () => reject(reader.error);
    reader.readAsDataURL(file);
  });

/** The name of a file in a relative URI. */
function nameIn(uri: string): string {
  try {
    return decodeURIComponent(uri).replace(/^.*[\\/]/, '');
  } catch {
    return uri; // the daemon says what is wrong with it
  }
}

/** A glTF with those of the other files in it that it names; they are added to `used`. */
async function embed(file: File, others: File[], used: Set<File>): Promise<File> {
  let document: Linked;
  try {
    document = JSON.parse(await file.text());
  } catch {
    return file; // the daemon says what is wrong with it
  }
  const lists = [document?.buffers, document?.images].filter(Array.isArray);
  for (const entry of lists.flat()) {
    if (typeof entry?.uri !== 'string' || entry.uri.startsWith('data:')) continue;
    const name = nameIn(entry.uri);
    const other = others.find((one) => one.name === name);
    if (!other) continue;
    entry.uri = await dataUrl(other);
    used.add(other);
  }
  return used.size ? new File([JSON.stringify(document)], file.name) : file;
}

/** The files that a glTF names for its data, without which it cannot be read: its buffers. */
export async function missingOf(file: File): Promise<string[]> {
  if (!/\.gltf$/i.test(file.name)) return [];
  try {
    const { buffers }: Linked = JSON.parse(await file.text());
    return (buffers ?? []).flatMap(({ uri }) => (uri && !uri.startsWith('data:') ? [nameIn(uri)] : []));
  } catch {
    return []; // the daemon says what is wrong with it
  }
}

/** The meshes among files that are added together, and the names of the other files that none of them contains. */
export async function meshesOf(files: File[]): Promise<{ meshes: File[]; left: string[] }> {
  const meshes = files.filter(({ name }) => !COMPANION.test(name));
  if (!meshes.length) return { meshes: files, left: [] };
  const others = files.filter((file) => !meshes.includes(file));
  const used = new Set<File>();
  const whole = await Promise.all(
    meshes.map((file) => (others.length && /\.gltf$/i.test(file.name) ? embed(file, others, used) : file)),
  );
  return { meshes: whole, left: others.filter((file) => !used.has(file)).map(({ name }) => name) };
}
