/** The types of the daemon's API (see /openapi.json) and of this client. */

export type Repair = 'none' | 'safe' | 'fill_holes' | 'largest_component';
export type Source = Blob | ArrayBuffer | ArrayBufferView | string | URL | { source: Blob | ArrayBuffer | ArrayBufferView | string; name?: string };

export interface Topology {
  components: number;
  genus: number;
  boundary_loops: number;
  nonmanifold_edges: number;
  nonmanifold_vertices: number;
}

export interface Mesh {
  id: string;
  url: string;
  name: string;
  format: 'obj' | 'off' | 'ply' | 'stl' | 'gltf' | 'glb';
  bytes: number;
  vertices: number;
  triangles: number;
  topology: Topology;
  area: number;
  volume: number;
  bounds: { min: [number, number, number]; max: [number, number, number] };
  repairs: { kind: string; count: number }[];
  attributes: string[];
  created: string;
}

export interface Histogram {
  edges: number[];
  counts: number[];
}

export interface Measure {
  mean: number;
  median: number;
  p99: number;
  max: number;
  std?: number;
  histogram: Histogram;
}

export interface Distortion {
  symmetric_dirichlet: Measure;
  angle: Measure;
  area: Measure;
  aspect: Measure;
  stretch_efficiency: number;
}

export interface Embedding {
  id: string;
  url: string;
  mesh: string;
  method: 'newton' | 'kernel-sampling';
  options: Record<string, unknown>;
  certificate: { valid: boolean; flipped: number; degenerate: number; degree: number; exact: boolean; min_determinant?: number };
  distortion: Distortion;
  timings_ms: Record<string, number>;
  engine: string;
}

export type Place =
  | { vertex: number }
  | { point: [number, number, number] }
  | { triangle: number; barycentric: [number, number, number] };

export interface Landmark {
  name?: string;
  at: Place[];
  pass?: number;
  radius?: number;
  confidence?: number;
}

export interface SupermeshRequest {
  shapes: { mesh: string; name?: string }[];
  landmarks?: Landmark[] | 'auto';
  align?: { method?: 'pin' | 'rbf' | 'rotate' | 'auto'; options?: Record<string, unknown> };
  remesh?: { method?: 'adaptive' | 'overlay' | 'subdivision' | 'convex-hull'; tolerance?: number; max_triangles?: number };
  asset?: { normals?: boolean; animation?: 'pingpong' | 'none'; fit?: 'none' | 'rigid' | 'similarity'; path?: 'linear' | 'rigid' };
}

export interface Supermesh {
  id: string;
  url: string;
  asset: string;
  vertices: number;
  triangles: number;
  shapes: {
    mesh: string;
    name: string;
    sphere?: string;
    hausdorff_relative: number;
    hausdorff_sampled_relative?: number;
    rms_relative: number;
    normal_deviation: { mean: number; p99: number };
  }[];
  landmarks: (Partial<Landmark> & { name?: string; residual_relative?: number[] })[];
  certificate: { closed: boolean; genus: number; flipped: number[]; degree: number[]; landmarks_exact: boolean };
  pairs?: { a: number; b: number; distortion: Distortion; inverted_fraction: number }[];
  /** The request that it answers, with every default written out. */
  request?: SupermeshRequest;
  timings_ms: Record<string, number>;
  engine: string;
}

export interface Problem {
  type: string;
  title: string;
  status: number;
  detail: string;
  [fact: string]: unknown;
}

export interface Job {
  id: string;
  url: string;
  kind: 'embedding' | 'supermesh';
  state: 'queued' | 'running' | 'succeeded' | 'failed' | 'cancelled';
  stage?: string;
  progress?: number;
  result?: string | null;
  problem?: Problem | null;
  attempt: number;
  created: string;
  started?: string | null;
  finished?: string | null;
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
  /** Told once, when the daemon has accepted a job. */
  onJob?: (job: Job) => void;
  /** Leave the job running when `signal` is aborted. */
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
  /** Sent with every request; may be set at any time. */
  token: string | undefined;
  url(path: string): string;
  request(path: string, options?: RequestOptions & { method?: string; json?: unknown; headers?: Record<string, string> }): Promise<Response>;
  uploadMesh(source: Source, options?: UploadOptions): Promise<Mesh>;
  getMesh(id: string, options?: RequestOptions): Promise<Mesh>;
  meshFile(id: string, options?: RequestOptions): Promise<ArrayBuffer>;
  deleteMesh(id: string, options?: RequestOptions): Promise<void>;
  embed(mesh: string, options?: WatchOptions & { method?: Embedding['method']; options?: Record<string, unknown> }): Promise<Embedding>;
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
