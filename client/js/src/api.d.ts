// Generated from api/openapi.json by client/js/types.mjs. Do not edit.

/** Requests and responses of the daemon, interface version 1.0.0. */

/** SHA-256 in lower-case hex. */
export type Id = string;

/** 128 random bits in lower-case hex. */
export type JobId = string;

/** RFC 3339, UTC, with milliseconds. */
export type Instant = string;

export type Mesh = {
  id: Id;
  url: string;
  /** UTF-8 of 1 to 127 bytes. */
  name: string;
  /** Told by the content. */
  format: 'obj' | 'off' | 'ply' | 'stl' | 'gltf' | 'glb';
  /** Of the file as uploaded. */
  bytes: number;
  /** After the repairs. */
  vertices: number;
  /** After the repairs. */
  triangles: number;
  /** Vertices of the file, before any repair: the range of landmark vertex numbers. */
  file_vertices: number;
  /** Triangles of the file, polygons cut, before any repair: the range of landmark triangle numbers. */
  file_triangles: number;
  topology: {
    components: number;
    genus: number;
    boundary_loops: number;
    nonmanifold_edges: number;
    nonmanifold_vertices: number;
  };
  /** In squared units of the file. */
  area: number;
  /** In cubed units of the file; positive, the mesh faces outward. */
  volume: number;
  bounds: {
    min: [number, number, number];
    max: [number, number, number];
  };
  /** The repairs that were allowed, in canonical order. */
  repair: string;
  /** What was done, in order; empty where nothing was needed. */
  repairs: Array<{
    kind: 'triangulate' | 'weld' | 'unused-vertices' | 'duplicate-faces' | 'degenerate-faces' | 'reorient' | 'turn-inside-out' | 'split-vertices' | 'fill_holes' | 'largest_component';
    count: number;
  }>;
  attributes: Array<'normal' | 'texcoord' | 'color'>;
  created: Instant;
};

/** newton: progressive, symmetric Dirichlet energy. kernel-sampling: Peng and Timalsena, 2016. */
export type EmbeddingMethod = 'newton' | 'kernel-sampling';

/** Members that the method has no use for are accepted and belong to the id. Answers hold those that differ from the defaults. */
export type EmbeddingOptions = {
  preset?: 'default' | 'fast' | 'quality';
  /** w of the energy: 1 symmetric Dirichlet, 0 stretch alone. */
  energy_weight?: number;
  /** Of kernel-sampling. */
  area_exponent?: number;
  /** Of kernel-sampling. */
  aspect_exponent?: number;
  /** Of kernel-sampling. */
  step?: number;
  /** Of kernel-sampling. */
  displacement_threshold?: number;
  /** Of kernel-sampling. */
  max_iterations?: number;
  /** Of kernel-sampling: vertices inserted before the first optimisation of all. */
  first_optimization?: number;
  /** Of kernel-sampling: of that number, after each. */
  growth?: number;
  /** Of kernel-sampling: quadrics are used down to this many vertices. */
  qem_until?: number;
};

export type EmbeddingRequest = {
  mesh: Id;
  method?: EmbeddingMethod;
  options?: EmbeddingOptions;
};

export type Certificate = {
  /** No triangle flipped or degenerate, degree 1. */
  valid: boolean;
  flipped: number;
  degenerate: number;
  /** How often the sphere is covered, with sign. */
  degree: number;
  /** Decided by exact arithmetic. */
  exact: boolean;
  /** The smallest det(p, q, r) of a triangle. */
  min_determinant: number | null;
};

/** Weighted by the source area. null: not measured, or not finite. */
export type Measure = {
  mean: number | null;
  median: number | null;
  p99: number | null;
  max: number | null;
  std: number | null;
  histogram: {
    /** One more than counts. */
    edges: Array<number | null>;
    /** Triangles in each bin. */
    counts: number[];
  };
};

/** Both areas scaled equal; σ₁ ≥ σ₂ the singular values. symmetric_dirichlet ¼(σ₁²+σ₁⁻²+σ₂²+σ₂⁻²), 1 = isometric; angle σ₁/σ₂; area ln σ₁σ₂; aspect circumradius / 2 inradius of the image. */
export type Distortion = {
  symmetric_dirichlet: Measure;
  angle: Measure;
  area: Measure;
  aspect: Measure;
  /** 1 / mean(½(σ₁⁻²+σ₂⁻²)) */
  stretch_efficiency: number | null;
};

export type Embedding = {
  id: Id;
  url: string;
  mesh: Id;
  method: EmbeddingMethod;
  options: EmbeddingOptions;
  certificate: Certificate;
  distortion: Distortion;
  timings_ms: {
    check: number;
    simplify: number;
    embed: number;
    certify: number;
    total: number;
  };
  sphere: string;
  /** Name and version. */
  engine: string;
  created: Instant;
};

/** A place on a shape; numbers as in the uploaded file, before any repair. */
export type Place = {
  vertex: number;
} | {
  /** The nearest point of the surface is meant. */
  point: [number, number, number];
} | {
  triangle: number;
  /** Not negative, sum 1 within 1e-6. */
  barycentric: [number, number, number];
};

export type Landmark = {
  /** Default: "landmark" and its number. */
  name?: string;
  /** One for each shape, in their order. */
  at: Place[];
  /** rbf: 0 first, then 1, … */
  pass?: number;
  /** rbf: of its influence, chord length on the unit sphere; 0: the default. */
  radius?: number;
  confidence?: number;
};

/** Members that are not known are refused by name; those that a method has no use for belong to the id. */
export type SupermeshRequest = {
  shapes: Array<{
    mesh: Id;
    /** Default: the name of the mesh. */
    name?: string;
  }>;
  /** "auto", none or an empty list: correspondence is found without help. */
  landmarks?: 'auto' | Landmark[];
  embedding?: {
    method?: EmbeddingMethod;
    options?: EmbeddingOptions;
  };
  align?: {
    /** Default: pin with landmarks, auto without. pin and rbf need landmarks. */
    method?: 'pin' | 'rbf' | 'rotate' | 'auto';
    options?: {
      preset?: 'default' | 'fast' | 'quality';
      /** rbf: steps of a pass. */
      steps?: number;
      /** rbf: move the later shapes only. */
      one_way?: boolean;
      /** rbf: of all landmarks; 0: the default. */
      radius?: number;
      /** Of what is tried in a random order. */
      seed?: number;
    };
  };
  remesh?: {
    method?: 'adaptive' | 'overlay' | 'subdivision' | 'convex-hull';
    /** Largest deviation, relative to the diagonal of the bounding box. */
    tolerance?: number;
    /** 0: no limit. Goes before tolerance. */
    max_triangles?: number;
  };
  asset?: {
    normals?: boolean;
    animation?: 'pingpong' | 'none';
    /** Move the later shapes onto the first by their landmarks. */
    fit?: 'none' | 'rigid' | 'similarity';
    /** rigid: in-between targets that keep lengths. */
    path?: 'linear' | 'rigid';
    /** rigid: targets between two neighbours. */
    path_steps?: number;
    /** Carry the later shapes' colours as morphed attributes. */
    colors?: boolean;
  };
};

/** The request as it was understood: every member written out (of the embedding, the options that are not default). Sent again it names the same supermesh. */
export type CanonicalRequest = {
  shapes: Array<{
    mesh: Id;
    /** UTF-8 of 1 to 127 bytes. */
    name: string;
  }>;
  landmarks: 'auto' | Array<{
    name: string;
    at: Place[];
    pass: number;
    radius: number;
    confidence: number;
  }>;
  embedding: {
    method: EmbeddingMethod;
    options: EmbeddingOptions;
  };
  align: {
    method: 'pin' | 'rbf' | 'rotate' | 'auto';
    options: {
      preset: 'default' | 'fast' | 'quality';
      /** rbf: steps of a pass. */
      steps: number;
      /** rbf: move the later shapes only. */
      one_way: boolean;
      /** rbf: of all landmarks; 0: the default. */
      radius: number;
      /** Of what is tried in a random order. */
      seed: number;
    };
  };
  remesh: {
    method: 'adaptive' | 'overlay' | 'subdivision' | 'convex-hull';
    /** Largest deviation, relative to the diagonal of the bounding box. */
    tolerance: number;
    /** 0: no limit. Goes before tolerance. */
    max_triangles: number;
  };
  asset: {
    normals: boolean;
    animation: 'pingpong' | 'none';
    /** Move the later shapes onto the first by their landmarks. */
    fit: 'none' | 'rigid' | 'similarity';
    /** rigid: in-between targets that keep lengths. */
    path: 'linear' | 'rigid';
    /** rigid: targets between two neighbours. */
    path_steps: number;
    /** Carry the later shapes' colours as morphed attributes. */
    colors: boolean;
  };
};

export type Supermesh = {
  id: Id;
  url: string;
  asset: string;
  asset_bytes: number;
  vertices: number;
  triangles: number;
  /** In the order of the request. */
  shapes: Array<{
    mesh: Id;
    /** UTF-8 of 1 to 127 bytes. */
    name: string;
    /** The shape on the common sphere, as PLY. Missing where an older engine made the supermesh. */
    sphere?: string;
    /** Distance of the supermesh's shape from the mesh: the proved bound where there is one, else sampled. */
    hausdorff_relative: number | null;
    /** Whether hausdorff_relative is a proved bound. */
    hausdorff_proved: boolean;
    hausdorff_sampled_relative: number | null;
    rms_relative: number | null;
    /** In degrees. */
    normal_deviation: {
      mean: number | null;
      p99: number | null;
    };
    /** Of the mesh's bounding box, in its own units. */
    diagonal: number | null;
    /** The smallest triangle's area by the mean one's. */
    min_area_ratio: number | null;
    /** Column-major 4×4 matrix, as in glTF, that takes the shape's own coordinates to those of the asset: the identity, or what `asset.fit` found. Missing where an older engine made the supermesh. */
    transform?: number[];
  }>;
  /** Those of the request, or those that were found. */
  landmarks: Array<{
    /** As given, or "landmark" and its number. */
    name: string;
    /** The vertex of the supermesh; −1: none. */
    vertex: number;
    /** Distance from where the request put it, one for each shape. */
    residual_relative: Array<number | null>;
  } | {
    /** "auto" and its number, from 1. */
    name: string;
    /** One for each shape, in their order; can be corrected and sent as a landmark. */
    at: Place[];
    /** One for each shape. */
    residual_relative: Array<number | null>;
    /** 0 to 1. */
    confidence: number | null;
  }>;
  certificate: {
    closed: boolean;
    genus: number;
    /** Of each shape's aligned sphere. */
    flipped: number[];
    /** Of each shape's aligned sphere. */
    degree: number[];
    /** Each landmark is one vertex, at its place on every shape. */
    landmarks_exact: boolean;
    /** Of the supermesh on the sphere. */
    supermesh: {
      flipped: number;
      degree: number;
    };
  };
  /** The composed maps. */
  pairs: Array<{
    /** Index into shapes. */
    a: number;
    /** Index into shapes. */
    b: number;
    distortion: Distortion;
    /** Share of the supermesh's triangles that are turned in space, at either end, against that surface: its smooth normals at their corners and its face at their centre. */
    inverted_fraction: number | null;
  }>;
  /** Of the alignment; null: not measured. */
  energy: number | null;
  timings_ms: {
    embed: number;
    align: number;
    remesh: number;
    transfer: number;
    write: number;
    total: number;
  };
  request: CanonicalRequest;
  /** Name and version. */
  engine: string;
  created: Instant;
};

export type Job = {
  id: JobId;
  url: string;
  kind: 'embedding' | 'supermesh';
  state: 'queued' | 'running' | 'succeeded' | 'failed' | 'cancelled';
  /** What is being done: read, simplify, embed, certify, align, remesh, transfer, write, store. */
  stage: string | null;
  /** Of the whole job. */
  progress: number;
  /** Once it has succeeded. */
  result: string | null;
  /** Of a failed job. */
  problem: Problem | null;
  /** How often it was begun. */
  attempt: number;
  created: Instant;
  started: Instant | null;
  finished: Instant | null;
};

export type MeshPage = {
  /** The newest first. */
  meshes: Mesh[];
  /** For page_token; null on the last page. */
  next_page_token: string | null;
};

export type EmbeddingPage = {
  /** The newest first. */
  embeddings: Embedding[];
  /** For page_token; null on the last page. */
  next_page_token: string | null;
};

export type SupermeshPage = {
  /** The newest first. */
  supermeshes: Supermesh[];
  /** For page_token; null on the last page. */
  next_page_token: string | null;
};

export type JobPage = {
  /** The newest first. */
  jobs: Job[];
  /** For page_token; null on the last page. */
  next_page_token: string | null;
};

export type Live = {
  status: 'alive';
};

/** All but status with ?verbose. */
export type Ready = {
  status: 'ready';
  queued?: number;
  running?: number;
  workers?: number;
  connections?: number;
  /** Jobs that wait for embeddings. */
  waiting?: number;
  /** Unfinished jobs that are taken. */
  queue_limit?: number;
  /** The age of the oldest queued job. */
  oldest_ms?: number;
  /** Connections that are taken. */
  max_connections?: number;
  /** Suspended: they wait for a job. */
  waiting_connections?: number;
  /** Of the data folder's disk. */
  disk_free_bytes?: number;
  /** Since the start. */
  uptime_seconds?: number;
  /** Name and version. */
  engine?: string;
};

/** Two readers could understand the headers in different ways, or a route that takes no body was given one. The connection closes. */
export type ProblemBadRequest = {
  type: '/problems/bad-request';
  title: 'The request is malformed';
  status: 400;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemBadQuery = {
  type: '/problems/bad-query';
  title: 'A query parameter is not valid';
  status: 400;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemMalformedJson = {
  type: '/problems/malformed-json';
  title: 'The body is not valid JSON';
  status: 400;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** The byte where reading stopped. */
  offset: number;
};

/** Always with line or offset. */
export type ProblemMalformedMesh = {
  type: '/problems/malformed-mesh';
  title: 'The mesh file is broken';
  status: 400;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** Of the text file, from 1; the end where something is missing. */
  line?: number;
  /** In bytes. */
  offset?: number;
};

export type ProblemMalformedEncoding = {
  type: '/problems/malformed-encoding';
  title: 'The compressed body is broken';
  status: 400;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** In bytes of the body as it came. */
  offset?: number;
};

export type ProblemUnauthorized = {
  type: '/problems/unauthorized';
  title: 'A token is needed';
  status: 401;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemForbidden = {
  type: '/problems/forbidden';
  title: 'The token does not allow this';
  status: 403;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** The one that is needed. */
  scope: 'read' | 'write' | 'admin';
};

export type ProblemNotFound = {
  type: '/problems/not-found';
  title: 'There is no such thing here';
  status: 404;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** The id that is not known, where a request names it. */
  mesh?: string;
};

export type ProblemMethodNotAllowed = {
  type: '/problems/method-not-allowed';
  title: 'This path does not answer to that method';
  status: 405;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemInUse = {
  type: '/problems/in-use';
  title: 'Unfinished jobs need it';
  status: 409;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemJobEnded = {
  type: '/problems/job-ended';
  title: 'The job has ended already';
  status: 409;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemLengthRequired = {
  type: '/problems/length-required';
  title: 'The length of the body is needed';
  status: 411;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemTooLarge = {
  type: '/problems/too-large';
  title: 'It is too large';
  status: 413;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** In bytes, where the body is beyond it. */
  limit?: number;
  /** Of the text file, from 1; the end where something is missing. */
  line?: number;
  /** In bytes. */
  offset?: number;
  /** Their numbers in the request. */
  landmarks?: number[];
  /** Its number in the request. */
  shape?: number;
  /** Where a compressed body grows beyond so many times its size. */
  ratio_limit?: number;
};

export type ProblemUnknownFormat = {
  type: '/problems/unknown-format';
  title: 'The bytes are of no known mesh format';
  status: 415;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** Of the text file, from 1; the end where something is missing. */
  line?: number;
  /** In bytes. */
  offset?: number;
};

export type ProblemUnsupportedEncoding = {
  type: '/problems/unsupported-encoding';
  title: 'The content encoding is not known';
  status: 415;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemPreconditionFailed = {
  type: '/problems/precondition-failed';
  title: 'A condition of the request does not hold';
  status: 412;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemRangeNotSatisfiable = {
  type: '/problems/range-not-satisfiable';
  title: 'The range lies outside';
  status: 416;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemNotClosed = {
  type: '/problems/not-closed';
  title: 'The mesh is not closed';
  status: 422;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  boundary_loops: number;
  boundary_edge_count: number;
  /** Pairs of vertex numbers of the file, up to 100. */
  boundary_edges: [number, number][];
  component_count?: number;
  /** Triangles of each, the largest first. */
  components?: number[];
};

/** edges: those of more than two faces; vertices: those where two fans touch. */
export type ProblemNotManifold = {
  type: '/problems/not-manifold';
  title: 'The mesh is not manifold';
  status: 422;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  edge_count?: number;
  /** Pairs of vertex numbers of the file, up to 100. */
  edges?: [number, number][];
  vertex_count?: number;
  /** Vertex numbers of the file, up to 100. */
  vertices?: number[];
  component_count?: number;
  /** Triangles of each, the largest first. */
  components?: number[];
};

export type ProblemNotOrientable = {
  type: '/problems/not-orientable';
  title: 'The mesh cannot be oriented';
  status: 422;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  edge_count?: number;
  /** Pairs of vertex numbers of the file, up to 100. */
  edges?: [number, number][];
  component_count?: number;
  /** Triangles of each, the largest first. */
  components?: number[];
};

export type ProblemNotConnected = {
  type: '/problems/not-connected';
  title: 'The mesh is in several pieces';
  status: 422;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  component_count: number;
  /** Triangles of each, the largest first. */
  components: number[];
};

export type ProblemNotGenusZero = {
  type: '/problems/not-genus-zero';
  title: 'The mesh has handles';
  status: 422;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  genus: number;
};

export type ProblemDegenerate = {
  type: '/problems/degenerate';
  title: 'The surface is degenerate';
  status: 422;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemNotFinite = {
  type: '/problems/not-finite';
  title: 'A coordinate is not finite or too large';
  status: 422;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** Of the text file, from 1; the end where something is missing. */
  line?: number;
  /** In bytes. */
  offset?: number;
  vertex_count?: number;
  /** Vertex numbers of the file, up to 100. */
  vertices?: number[];
};

export type ProblemBadLandmarks = {
  type: '/problems/bad-landmarks';
  title: 'The landmarks cannot be met';
  status: 422;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** Their numbers in the request. */
  landmarks?: number[];
  /** Its number in the request. */
  shape?: number;
  reason?: 'out-of-range' | 'dropped';
};

export type ProblemBadOption = {
  type: '/problems/bad-option';
  title: 'An option is not valid';
  status: 422;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** Its name. */
  member?: string;
  /** Their numbers in the request. */
  landmarks?: number[];
  /** Its number in the request. */
  shape?: number;
};

export type ProblemUnknownMember = {
  type: '/problems/unknown-member';
  title: 'A member is not known';
  status: 422;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** Its name. */
  member: string;
};

export type ProblemInvalidRequest = {
  type: '/problems/invalid-request';
  title: 'The request is not valid';
  status: 422;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemUnsupportedMethod = {
  type: '/problems/unsupported-method';
  title: 'The method is not available';
  status: 422;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** Its name. */
  method?: string;
  /** Their numbers in the request. */
  landmarks?: number[];
  /** Its number in the request. */
  shape?: number;
};

export type ProblemTooManyRequests = {
  type: '/problems/too-many-requests';
  title: 'Too many requests';
  status: 429;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemQuotaExceeded = {
  type: '/problems/quota-exceeded';
  title: 'The quota is used up';
  status: 429;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** Bytes of meshes that the token's tenant may own, or jobs that it may have unfinished. */
  quota: number;
};

export type ProblemQueueFull = {
  type: '/problems/queue-full';
  title: 'The queue is full';
  status: 429;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemInternal = {
  type: '/problems/internal';
  title: 'A fault of the server';
  status: 500;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** Their numbers in the request. */
  landmarks?: number[];
  /** Its number in the request. */
  shape?: number;
};

/** Of a job: no result is given rather than one that is not valid. */
export type ProblemNotCertified = {
  type: '/problems/not-certified';
  title: 'The result could not be certified';
  status: 500;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** Their numbers in the request. */
  landmarks?: number[];
  /** Its number in the request. */
  shape?: number;
};

/** Of a job. */
export type ProblemCorrupt = {
  type: '/problems/corrupt';
  title: 'Stored data do not decode';
  status: 500;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

/** Of a job. */
export type ProblemCrashed = {
  type: '/problems/crashed';
  title: 'The job ended the process repeatedly';
  status: 500;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

/** Of a job, or of the check of an upload. */
export type ProblemTimeout = {
  type: '/problems/timeout';
  title: 'The job ran out of time';
  status: 503;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** Their numbers in the request. */
  landmarks?: number[];
  /** Its number in the request. */
  shape?: number;
};

export type ProblemNoMemory = {
  type: '/problems/no-memory';
  title: 'The job ran out of memory';
  status: 503;
  /** What is wrong and what to do, in plain words. */
  detail: string;
  /** Their numbers in the request. */
  landmarks?: number[];
  /** Its number in the request. */
  shape?: number;
};

export type ProblemUnavailable = {
  type: '/problems/unavailable';
  title: 'The service is not available now';
  status: 503;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

export type ProblemStorageFull = {
  type: '/problems/storage-full';
  title: 'The storage is full';
  status: 507;
  /** What is wrong and what to do, in plain words. */
  detail: string;
};

/** RFC 9457; `type` tells which. */
export type Problem = ProblemBadRequest | ProblemBadQuery | ProblemMalformedJson | ProblemMalformedMesh | ProblemMalformedEncoding | ProblemUnauthorized | ProblemForbidden | ProblemNotFound | ProblemMethodNotAllowed | ProblemInUse | ProblemJobEnded | ProblemLengthRequired | ProblemTooLarge | ProblemUnknownFormat | ProblemUnsupportedEncoding | ProblemPreconditionFailed | ProblemRangeNotSatisfiable | ProblemNotClosed | ProblemNotManifold | ProblemNotOrientable | ProblemNotConnected | ProblemNotGenusZero | ProblemDegenerate | ProblemNotFinite | ProblemBadLandmarks | ProblemBadOption | ProblemUnknownMember | ProblemInvalidRequest | ProblemUnsupportedMethod | ProblemTooManyRequests | ProblemQuotaExceeded | ProblemQueueFull | ProblemInternal | ProblemNotCertified | ProblemCorrupt | ProblemCrashed | ProblemTimeout | ProblemNoMemory | ProblemUnavailable | ProblemStorageFull;
