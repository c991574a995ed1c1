/** The types of the client. api.d.ts, generated from the OpenAPI document, has those of the daemon's responses. */
import type {
  Embedding,
  Job,
  Landmark,
  Landmarks,
  LandmarksSummary,
  Mesh,
  Supermesh,
  SupermeshRequest,
  SupermeshSummary,
} from './api.js';

export type Repair = 'none' | 'safe' | 'fill_holes' | 'largest_component' | 'split_nonmanifold' | 'close_handles';
export type Source =
  | Blob
  | ArrayBuffer
  | ArrayBufferView
  | string
  | URL
  | { source: Blob | ArrayBuffer | ArrayBufferView | string; name?: string };

export type {
  Distortion,
  Embedding,
  Job,
  Landmark,
  Landmarks,
  LandmarksSummary,
  Measure,
  Mesh,
  Place,
  Supermesh,
  SupermeshRequest,
  SupermeshSummary,
} from './api.js';
/** A problem of a known type; `type` discriminates. */
export type { Problem as KnownProblem } from './api.js';

/** A problem of any type, with its details. */
export interface Problem {
  type: string;
  title: string;
  status: number;
  detail: string;
  [member: string]: unknown;
}

export interface RequestOptions {
  signal?: AbortSignal;
}

export interface UploadOptions extends RequestOptions {
  name?: string;
  format?: Mesh['format'];
  repair?: Repair | Repair[] | string;
  /** With close_handles: the longest loop to cut along, relative to the diagonal. Default: 0.05. */
  handleSize?: number;
  /** The piece to keep: a number from 0 by size, or a name. */
  part?: number | string;
  onProgress?: (sent: number, total: number) => void;
}

export interface WatchOptions extends RequestOptions {
  onProgress?: (job: Job) => void;
  /** Called once, when the daemon has accepted the job. */
  onJob?: (job: Job) => void;
  /** Keep the job running when `signal` is aborted. */
  detach?: boolean;
}

export type MorphStep =
  | { step: 'upload'; file: number; progress: number }
  | { step: 'merge'; job: Job; progress: number };

export interface MorphOptions extends RequestOptions, Omit<SupermeshRequest, 'shapes' | 'landmarks'> {
  landmarks?: Landmark[] | 'auto' | { landmarks: Landmark[] };
  names?: string[];
  repair?: UploadOptions['repair'];
  onProgress?: (step: MorphStep) => void;
}

export interface Morph extends Supermesh {
  meshes: Mesh[];
  assetUrl: string;
  glb(options?: AssetOptions): Promise<ArrayBuffer>;
}

export interface ConnectOptions {
  server?: string;
  token?: string;
  fetch?: typeof fetch;
  /** How often a request is repeated while the daemon is busy (429, 503); 4 by default. */
  retries?: number;
}

/** How an asset is stored: `quantized` and `meshopt` are smaller, and a renderer needs a decoder for `meshopt`. */
export type Profile = 'float' | 'quantized' | 'meshopt';

export interface AssetOptions extends RequestOptions {
  profile?: Profile;
}

/** The parameters of GET /v1/morph.glb. */
export interface Recipe {
  shapes: string[];
  names?: string[];
  landmarks?: string;
  align?: 'pin' | 'rbf' | 'rotate' | 'auto';
  preset?: 'fast' | 'default' | 'quality';
  remesh?: 'adaptive' | 'overlay' | 'subdivision' | 'convex-hull' | 'template';
  tolerance?: number;
  max_triangles?: number;
  fit?: 'auto' | 'none' | 'rigid' | 'similarity';
  path?: 'linear' | 'rigid';
  animation?: 'pingpong' | 'none';
  normals?: boolean;
  holes?: 'reopen' | 'filled';
  /** Entries such as '1:skin' or '1:texture:2048'. */
  transfer?: string | string[];
  profile?: Profile;
  wait?: number;
}

export interface SignOptions {
  /** KEY and SECRET of the KEY:SECRET that `orbmorphd key add` prints. */
  key: string;
  secret: string;
  /** A Date, a Unix time in seconds, or a span from now such as '30d', '12h' or '90m'. */
  expires: Date | number | string;
}

interface Kinds {
  meshes: Mesh;
  embeddings: Embedding;
  landmarks: LandmarksSummary;
  supermeshes: Supermesh;
  jobs: Job;
}

export interface ListOptions extends RequestOptions {
  limit?: number;
  pageToken?: string;
  /** Only entries whose id begins with these digits. */
  idPrefix?: string;
  /** Only jobs in this state. */
  state?: Job['state'];
  /** Only supermeshes with a shape of this mesh. */
  mesh?: string;
  /** Only supermeshes with a shape of this name. */
  name?: string;
  /** For supermeshes: "summary" omits report and request. */
  view?: 'full' | 'summary';
}
/** An entry of a list. */
type Entry<K extends keyof Kinds, O> = K extends 'supermeshes'
  ? O extends { view: 'summary' }
    ? SupermeshSummary
    : Supermesh
  : Kinds[K];

export class Orbmorph {
  constructor(options?: ConnectOptions);
  readonly server: string;
  /** Sent with every request; can be changed at any time. */
  token: string | undefined;
  url(path: string): string;
  request(
    path: string,
    options?: RequestOptions & { method?: string; json?: unknown; headers?: Record<string, string> },
  ): Promise<Response>;
  uploadMesh(source: Source, options?: UploadOptions): Promise<Mesh>;
  getMesh(id: string, options?: RequestOptions): Promise<Mesh>;
  meshFile(id: string, options?: RequestOptions): Promise<ArrayBuffer>;
  deleteMesh(id: string, options?: RequestOptions): Promise<void>;
  embed(
    mesh: string,
    options?: WatchOptions & { method?: Embedding['method']; options?: Record<string, unknown> },
  ): Promise<Embedding>;
  getEmbedding(id: string, options?: RequestOptions): Promise<Embedding>;
  sphere(id: string, options?: RequestOptions): Promise<ArrayBuffer>;
  deleteEmbedding(id: string, options?: RequestOptions): Promise<void>;
  createLandmarks(landmarks: Landmark[] | { landmarks: Landmark[] }, options?: RequestOptions): Promise<Landmarks>;
  getLandmarks(id: string, options?: RequestOptions): Promise<Landmarks>;
  deleteLandmarks(id: string, options?: RequestOptions): Promise<void>;
  merge(request: SupermeshRequest, options?: WatchOptions): Promise<Supermesh>;
  getSupermesh(id: string, options?: RequestOptions): Promise<Supermesh>;
  asset(id: string, options?: AssetOptions): Promise<ArrayBuffer>;
  alignedSphere(id: string, k: number, options?: RequestOptions): Promise<ArrayBuffer>;
  places(id: string, options?: RequestOptions): Promise<ArrayBuffer>;
  deleteSupermesh(id: string, options?: RequestOptions): Promise<void>;
  getJob(job: string | Job, options?: RequestOptions & { wait?: number }): Promise<Job>;
  cancelJob(job: string | Job, options?: RequestOptions): Promise<Job | null>;
  watchJob(job: string | Job, options?: WatchOptions): Promise<Job>;
  result<T = Supermesh | Embedding>(job: string | Job, options?: WatchOptions): Promise<T>;
  page<K extends keyof Kinds, const O extends ListOptions>(
    kind: K,
    options?: O,
  ): Promise<{ items: Entry<K, O>[]; next: string | null }>;
  list<K extends keyof Kinds, const O extends ListOptions>(kind: K, options?: O): AsyncGenerator<Entry<K, O>>;
  morphUrl(recipe: Recipe): string;
  morph(sources: (Source | Mesh)[], options?: MorphOptions): Promise<Morph>;
}

export class ProblemError extends Error {
  readonly problem: Problem;
  readonly type: string;
  readonly kind: string;
  readonly title: string;
  readonly detail: string;
  readonly status: number;
  /** Seconds after which to try again. */
  readonly retryAfter: number | null;
  /** The number of the request in the daemon's log. */
  readonly requestId: string | null;
}
export class UnreachableError extends Error {
  readonly url: string;
}
/** The daemon is running, but does not let pages of this origin in. */
export class CorsError extends UnreachableError {}
export class CancelledError extends Error {
  readonly job: Job;
}

/** What a webhook receives. */
export interface WebhookMessage {
  type: 'job.succeeded' | 'job.failed' | 'job.cancelled';
  timestamp: string;
  data: Job;
}
/** Throws unless the message is genuine and at most `tolerance` (300) seconds old. `body`: as it came. */
export function verifyWebhook(
  body: string | ArrayBuffer | ArrayBufferView,
  headers: Headers | Record<string, string | string[] | undefined>,
  secret: string,
  options?: { tolerance?: number },
): Promise<WebhookMessage>;
export function signUrl(url: string | URL, options: SignOptions): Promise<string>;
export function morph(sources: (Source | Mesh)[], options?: MorphOptions & ConnectOptions): Promise<Morph>;

declare const orbmorph: {
  Orbmorph: typeof Orbmorph;
  morph: typeof morph;
  signUrl: typeof signUrl;
  verifyWebhook: typeof verifyWebhook;
  connect(server: string, options?: ConnectOptions): Orbmorph;
};
export default orbmorph;
