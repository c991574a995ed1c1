/** The types of the client. api.d.ts, generated from the OpenAPI document, has those of the daemon's responses. */
import type { Embedding, Job, Landmark, Mesh, Supermesh, SupermeshRequest } from './api.js';

export type Repair = 'none' | 'safe' | 'fill_holes' | 'largest_component';
export type Source =
  | Blob
  | ArrayBuffer
  | ArrayBufferView
  | string
  | URL
  | { source: Blob | ArrayBuffer | ArrayBufferView | string; name?: string };

export type { Distortion, Embedding, Job, Landmark, Measure, Mesh, Place, Supermesh, SupermeshRequest } from './api.js';
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
  glb(options?: RequestOptions): Promise<ArrayBuffer>;
}

export interface ConnectOptions {
  server?: string;
  token?: string;
  fetch?: typeof fetch;
}

interface Kinds {
  meshes: Mesh;
  embeddings: Embedding;
  supermeshes: Supermesh;
  jobs: Job;
}

export interface ListOptions extends RequestOptions {
  limit?: number;
  pageToken?: string;
  state?: Job['state'];
}

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
  merge(request: SupermeshRequest, options?: WatchOptions): Promise<Supermesh>;
  getSupermesh(id: string, options?: RequestOptions): Promise<Supermesh>;
  asset(id: string, options?: RequestOptions): Promise<ArrayBuffer>;
  alignedSphere(id: string, k: number, options?: RequestOptions): Promise<ArrayBuffer>;
  places(id: string, options?: RequestOptions): Promise<ArrayBuffer>;
  deleteSupermesh(id: string, options?: RequestOptions): Promise<void>;
  getJob(job: string | Job, options?: RequestOptions & { wait?: number }): Promise<Job>;
  cancelJob(job: string | Job, options?: RequestOptions): Promise<Job | null>;
  watchJob(job: string | Job, options?: WatchOptions): Promise<Job>;
  result<T = Supermesh | Embedding>(job: string | Job, options?: WatchOptions): Promise<T>;
  page<K extends keyof Kinds>(kind: K, options?: ListOptions): Promise<{ items: Kinds[K][]; next: string | null }>;
  list<K extends keyof Kinds>(kind: K, options?: ListOptions): AsyncGenerator<Kinds[K]>;
  morph(sources: (Source | Mesh)[], options?: MorphOptions): Promise<Morph>;
}

export class ProblemError extends Error {
  readonly problem: Problem;
  readonly type: string;
  readonly kind: string;
  readonly title: string;
  readonly detail: string;
  readonly status: number;
}
export class UnreachableError extends Error {
  readonly url: string;
}
export class CancelledError extends Error {
  readonly job: Job;
}

export function morph(sources: (Source | Mesh)[], options?: MorphOptions & ConnectOptions): Promise<Morph>;

declare const orbmorph: {
  Orbmorph: typeof Orbmorph;
  morph: typeof morph;
  connect(server: string, options?: ConnectOptions): Orbmorph;
};
export default orbmorph;
