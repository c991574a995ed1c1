// Generated from api/openapi.json by client/js/types.mjs. Do not edit.

/** Requests and responses of the daemon, interface version 1.0.0. */

/** A SHA-256 in lower-case hexadecimal. */
export type Id = string;

/** 128 random bits in lower-case hexadecimal. */
export type JobId = string;

/** A time by RFC 3339, in UTC, with milliseconds. */
export type Instant = string;

export type Mesh = {
  id: Id;
  url: string;
  /** 1 to 127 bytes of UTF-8. */
  name: string;
  /** The format, as determined from the content. */
  format: 'obj' | 'off' | 'ply' | 'stl' | '3mf' | 'gltf' | 'glb';
  /** The size of the uploaded file. */
  bytes: number;
  /** The count after repairs. */
  vertices: number;
  /** The count after repairs. */
  triangles: number;
  /** The vertices of the file before repairs. Landmark vertex numbers are below this count. */
  file_vertices: number;
  /** The triangles of the file before repairs, with polygons triangulated. Landmark triangle numbers are below this count. */
  file_triangles: number;
  topology: {
    components: number;
    genus: number;
    boundary_loops: number;
    nonmanifold_edges: number;
    nonmanifold_vertices: number;
  };
  /** The surface area, in squared units of the file. */
  area: number;
  /** The volume, in cubed units of the file. It is positive: the mesh faces outward. */
  volume: number;
  bounds: {
    min: [number, number, number];
    max: [number, number, number];
  };
  /** The repairs that the upload allowed, in canonical order. */
  repair: string;
  /** The repairs that were made, in order; empty if the file needed none. */
  repairs: Array<{
    kind: 'triangulate' | 'weld' | 'unused-vertices' | 'duplicate-faces' | 'degenerate-faces' | 'reorient' | 'turn-inside-out' | 'split-vertices' | 'split_nonmanifold' | 'fill_holes' | 'largest_component' | 'part' | 'close_handles';
    count: number;
    /** Of a handle: the vertices of the file that the cut goes through, in order; the last is joined to the first. */
    loop?: number[];
    /** The length of the loop, relative to the diagonal. */
    length_relative?: number;
    /** cut: the loop went around the handle. fill: it went around the tunnel. */
    how?: 'cut' | 'fill';
    /** The area of the patches on both sides of the loop, relative to the square of the diagonal. */
    area_relative?: number;
  }>;
  attributes: Array<'normal' | 'texcoord' | 'color'>;
  created: Instant;
};

/** newton: progressive embedding that minimises the symmetric Dirichlet energy. kernel-sampling: Peng and Timalsena, 2016. Default: "newton". */
export type EmbeddingMethod = 'newton' | 'kernel-sampling';

/** The daemon accepts members that the method does not use, and they are part of the id. Responses contain the members that differ from their defaults. */
export type EmbeddingOptions = {
  /** Default: "default". */
  preset?: 'default' | 'fast' | 'quality';
  /** The weight w of the energy: 1 is symmetric Dirichlet, 0 is stretch alone. Default: 1. */
  energy_weight?: number;
  /** For kernel-sampling. Default: 3. */
  area_exponent?: number;
  /** For kernel-sampling. Default: 12. */
  aspect_exponent?: number;
  /** For kernel-sampling. Default: 0.11. */
  step?: number;
  /** For kernel-sampling. Default: 1e-06. */
  displacement_threshold?: number;
  /** For kernel-sampling. Default: 25. */
  max_iterations?: number;
  /** For kernel-sampling: how many vertices are inserted before the first optimisation of all vertices. Default: 25. */
  first_optimization?: number;
  /** For kernel-sampling: the factor by which first_optimization grows after each optimisation. Default: 1.25. */
  growth?: number;
  /** For kernel-sampling: quadrics are used down to this many vertices. Default: 6000. */
  qem_until?: number;
};

export type EmbeddingRequest = {
  mesh: Id;
  method?: EmbeddingMethod;
  options?: EmbeddingOptions;
  webhook?: WebhookRequest;
};

export type Certificate = {
  /** True if no triangle is flipped or degenerate and the degree is 1. */
  valid: boolean;
  flipped: number;
  degenerate: number;
  /** How often the map covers the sphere, with sign. */
  degree: number;
  /** True if exact arithmetic decided the signs. */
  exact: boolean;
  /** The smallest det(p, q, r) of all triangles. */
  min_determinant: number | null;
};

/** Statistics weighted by the area of the source triangles. A value is null if it was not measured or is not finite. */
export type Measure = {
  mean: number | null;
  median: number | null;
  p99: number | null;
  max: number | null;
  std: number | null;
  histogram: {
    /** The limits of the bins: one more than counts. */
    edges: Array<number | null>;
    /** The number of triangles in each bin. */
    counts: number[];
  };
};

/** Distortion after both surfaces are scaled to equal area; σ₁ ≥ σ₂ are the singular values. symmetric_dirichlet is ¼(σ₁²+σ₁⁻²+σ₂²+σ₂⁻²), 1 for an isometry; angle is σ₁/σ₂; area is ln σ₁σ₂; aspect is circumradius / (2 inradius) of the image triangle. */
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
  /** The name and version of the engine. */
  engine: string;
  created: Instant;
};

/** A place on a shape. Vertices and triangles are numbered as in the uploaded file, before repairs. */
export type Place = {
  vertex: number;
} | {
  /** A point in space; the place is the nearest point of the surface. */
  point: [number, number, number];
} | {
  triangle: number;
  /** Barycentric coordinates: not negative, with a sum within 1e-6 of 1. */
  barycentric: [number, number, number];
};

export type Landmark = {
  /** Default: "landmark" and its number, from 0. */
  name?: string;
  /** One place for each shape, in request order. */
  at: Place[];
  /** For rbf: the pass that moves this landmark; pass 0 runs first. Default: 0. */
  pass?: number;
  /** For rbf: the radius of influence, as a chord length on the unit sphere. Default: 0, which leaves it to the method. */
  radius?: number;
  /** Below 1: the landmark was found, not set. It changes no result. Default: 1. */
  confidence?: number;
  /** Below 1: the landmark is soft. A spring of stiffness weight / (1 - weight) pulls its places together; they stay apart if that improves the map. For the method pin. Default: 1, exact. */
  weight?: number;
};

/** Stored landmarks, without their places. */
export type LandmarksSummary = {
  id: Id;
  url: string;
  /** The number of landmarks. */
  count: number;
  /** The number of places of each landmark. */
  shapes: number;
  created: Instant;
};

/** Stored landmarks. The id is the hash of the canonical array. */
export type Landmarks = {
  id: Id;
  url: string;
  /** The number of landmarks. */
  count: number;
  /** The number of places of each landmark. */
  shapes: number;
  created: Instant;
  /** The canonical array, with every member. */
  landmarks: Landmark[];
};

/** The daemon refuses unknown members and names them. It accepts members that a method does not use, and they are part of the id. */
export type SupermeshRequest = {
  shapes: Array<{
    mesh: Id;
    /** Default: the name of the mesh. */
    name?: string;
  }>;
  /** If "auto", omitted or empty, the alignment finds the correspondence itself. */
  landmarks?: 'auto' | Landmark[] | {
    id: Id;
  };
  embedding?: {
    method?: EmbeddingMethod;
    options?: EmbeddingOptions;
  };
  align?: {
    /** Default: pin with landmarks, auto without. pin and rbf require landmarks. */
    method?: 'pin' | 'rbf' | 'rotate' | 'auto';
    /** The member alignment of a supermesh of the same meshes, in the same order: begin where that alignment ended. For landmarks that were corrected: nothing is searched, so it takes a fraction of the time, and limbs stay where they are. Needs landmarks, and the method pin or auto; the preset fast makes the same map as default then. The problem bad-option with the member start says that the alignment is no longer kept. */
    start?: string;
    options?: {
      /** Default: "default". */
      preset?: 'default' | 'fast' | 'quality';
      /** For rbf: the number of steps of a pass. Default: 10. */
      steps?: number;
      /** For rbf: move only the later shapes, not the first. Default: false. */
      one_way?: boolean;
      /** For rbf: the radius of influence of landmarks that set none. Default: 0, which leaves it to the method. */
      radius?: number;
    };
  };
  remesh?: {
    /** With template the vertices and triangles are those of the first shape as uploaded; if that is glTF, the asset is that document with targets added. Default: "adaptive". */
    method?: 'adaptive' | 'overlay' | 'subdivision' | 'convex-hull' | 'template';
    /** The largest deviation, relative to the diagonal of the bounding box. Default: 0.001. */
    tolerance?: number;
    /** The largest number of triangles, at least 4; 0 sets no limit. It takes precedence over tolerance. Default: 0. */
    max_triangles?: number;
  };
  asset?: {
    /** Default: true. Without normals, viewers shade each triangle flat: hard edges of files without normals, such as STL, look hard then. */
    normals?: boolean;
    /** Default: "pingpong". */
    animation?: 'pingpong' | 'none';
    /** Move the later shapes onto the first, by their landmarks or else by their surfaces: not at all, rigidly, or by a similarity. auto uses a similarity if the frame clearly differs from the first shape's (a scale beyond 1.5, a rotation of more than 30°, or a distance of more than half a diagonal), and otherwise does not move the shape. It rotates shapes of other postures by right angles only, so that they stand as upright as in their files, and if `match.verdict` is `unsure`, only where that is clearly because the files have other axes, or where the shape would otherwise collapse on the way; `shapes[].fit` of the supermesh has the result. Default: "auto". */
    fit?: 'auto' | 'none' | 'rigid' | 'similarity';
    /** rigid adds in-between targets that preserve lengths. Default: "linear". */
    path?: 'linear' | 'rigid';
    /** For rigid: the number of targets between two consecutive shapes. Default: 3. */
    path_steps?: number;
    /** Store the colours of later shapes as morphed attributes. Default: false. */
    colors?: boolean;
    /** Whether holes of the first shape that repair=fill_holes has filled are open in the asset, without the triangles that fill them. `dropped` lists holes that cannot be reopened. With template the triangles are always those of the file. Default: "reopen". */
    holes?: 'reopen' | 'filled';
  };
  /** With the remesh method template and a first shape in glTF: the meshes of its document that form the closed surface. The job fails (bad-option) if the uploaded surface has vertices of another mesh, or none of a named one; choose the surface at the upload with part=NAME. Other meshes do not change. */
  template?: {
    /** Numbers of meshes of the document. */
    meshes?: number[];
    /** Names of nodes: the meshes that they and the nodes below them show. */
    nodes?: string[];
  };
  /** What orbmorph copies from the shapes to the asset besides their surfaces, place by place: the skin with its skeleton, fitted to the first shape, and its animations; all sets of colours of vertices, or of texture coordinates, each as the next COLOR_n or TEXCOORD_n that is free; the morph targets of the file; or the base colour textures, baked into the texture coordinates of the first shape and offered as a variant (KHR_materials_variants). An asset can have one skin. The job fails (bad-option) if a shape lacks what an entry names. `transferred` of the supermesh lists what was copied. An asset with anything but targets copied has only the profile float. */
  transfer?: Array<{
    /** The shape, from 0 in their order. */
    from: number;
    what: 'skin' | 'color' | 'texcoord' | 'targets' | 'texture';
    /** Of a texture: texels a side. Default: as fine as the textures of the shape, at most 4096. */
    resolution?: number;
  }>;
  webhook?: WebhookRequest;
};

/** The request with all members; of the embedding options, those that are not default. Sending it again requests the same supermesh. */
export type CanonicalRequest = {
  shapes: Array<{
    mesh: Id;
    /** 1 to 127 bytes of UTF-8. */
    name: string;
  }>;
  landmarks: 'auto' | Array<{
    name: string;
    at: Place[];
    pass: number;
    radius: number;
    confidence: number;
    /** Only of a soft landmark. */
    weight?: number;
  }>;
  embedding: {
    method: EmbeddingMethod;
    options: EmbeddingOptions;
  };
  align: {
    method: 'pin' | 'rbf' | 'rotate' | 'auto';
    /** Only if the request has it. */
    start?: string;
    options: {
      preset: 'default' | 'fast' | 'quality';
      /** For rbf: the number of steps of a pass. */
      steps: number;
      /** For rbf: move only the later shapes, not the first. */
      one_way: boolean;
      /** For rbf: the radius of influence of landmarks that set none; 0 selects the default. */
      radius: number;
    };
  };
  remesh: {
    method: 'adaptive' | 'overlay' | 'subdivision' | 'convex-hull' | 'template';
    /** The largest deviation, relative to the diagonal of the bounding box. */
    tolerance: number;
    /** The largest number of triangles, at least 4; 0 sets no limit. It takes precedence over tolerance. */
    max_triangles: number;
  };
  asset: {
    normals: boolean;
    animation: 'pingpong' | 'none';
    /** Move the later shapes onto the first, by their landmarks or else by their surfaces: not at all, rigidly, or by a similarity. auto uses a similarity if the frame clearly differs from the first shape's (a scale beyond 1.5, a rotation of more than 30°, or a distance of more than half a diagonal), and otherwise does not move the shape. It rotates shapes of other postures by right angles only, so that they stand as upright as in their files, and if `match.verdict` is `unsure`, only where that is clearly because the files have other axes, or where the shape would otherwise collapse on the way; `shapes[].fit` of the supermesh has the result. */
    fit: 'auto' | 'none' | 'rigid' | 'similarity';
    /** rigid adds in-between targets that preserve lengths. */
    path: 'linear' | 'rigid';
    /** For rigid: the number of targets between two consecutive shapes. */
    path_steps: number;
    /** Store the colours of later shapes as morphed attributes. */
    colors: boolean;
    /** Whether holes of the first shape that a repair has filled are open in the asset. */
    holes: 'reopen' | 'filled';
  };
  /** Only if the request has it. */
  template?: {
    /** Numbers of meshes of the document. */
    meshes: number[];
    /** Names of nodes: the meshes that they and the nodes below them show. */
    nodes: string[];
  };
  /** Only if the request has it. */
  transfer?: Array<{
    /** The shape, from 0 in their order. */
    from: number;
    what: 'skin' | 'color' | 'texcoord' | 'targets' | 'texture';
    /** Of a texture: texels a side. Default: as fine as the textures of the shape, at most 4096. */
    resolution?: number;
  }>;
};

export type ProfileBounds = {
  /** The largest distance between a vertex and its place in the float asset, at every weight from 0 to 1 of one target, divided by the smallest diagonal of the bounding boxes of the shapes in the asset: a proved bound; add it to hausdorff_relative. */
  quantization_relative: number | null;
  /** The largest angle between a normal and that of the float asset, at every weight from 0 to 1 of one target: a proved bound, below 1. 0 without normals. */
  normal_degrees: number | null;
};

export type Supermesh = {
  id: Id;
  url: string;
  asset: string;
  asset_bytes: number;
  /** How much the profiles quantized and meshopt change: the bounds of both, and those of each. Absent if an older engine made the supermesh, and for assets with only the profile float: uploaded glTF documents, and those to which `transfer` copied anything but targets. */
  profiles?: {
    /** The largest distance between a vertex and its place in the float asset, at every weight from 0 to 1 of one target, divided by the smallest diagonal of the bounding boxes of the shapes in the asset: a proved bound; add it to hausdorff_relative. */
    quantization_relative: number | null;
    /** The largest angle between a normal and that of the float asset, at every weight from 0 to 1 of one target: a proved bound, below 1. 0 without normals. */
    normal_degrees: number | null;
    quantized: ProfileBounds;
    meshopt: ProfileBounds;
  };
  vertices: number;
  triangles: number;
  /** The shapes, in request order. */
  shapes: Array<{
    mesh: Id;
    /** 1 to 127 bytes of UTF-8. */
    name: string;
    /** The shape on the common sphere, as PLY. Absent if an older engine made the supermesh. */
    sphere?: string;
    /** The Hausdorff distance between the supermesh's shape and the mesh: a proved bound if there is one, else sampled. */
    hausdorff_relative: number | null;
    /** Whether hausdorff_relative is a proved bound. */
    hausdorff_proved: boolean;
    hausdorff_sampled_relative: number | null;
    rms_relative: number | null;
    /** The angle between normals, in degrees. */
    normal_deviation: {
      mean: number | null;
      p99: number | null;
    };
    /** The diagonal of the mesh's bounding box, in units of the mesh. */
    diagonal: number | null;
    /** The area of the smallest triangle divided by the mean area. */
    min_area_ratio: number | null;
    /** With the method `template`: where the triangles of the first shape are too coarse for this one. At samples of both surfaces they are farther apart than `remesh.tolerance`. Absent if none is. */
    coarse?: {
      /** The share of these triangles in the area of the template on this shape. */
      share: number;
      /** The number of these triangles. */
      count: number;
      /** The farthest of them, the farthest first, as triangles of the first shape's file, counted from 0 after polygons are cut into triangles. Triangles that a repair made are not listed. */
      triangles: number[];
      /** The distances of these triangles, relative to the diagonal of this shape. */
      errors_relative: number[];
    };
    /** What `asset.fit` did to the shape. Absent if an older engine made the supermesh. */
    fit?: {
      kind: 'none' | 'rigid' | 'similarity';
      /** 1 if it kept the size. */
      scale: number;
      rotation_degrees: number;
      /** The distance that the mean of the shape's fitted points moved, divided by the first shape's diagonal. */
      translation_relative: number;
      /** The angle by which the y axis rotated. Beyond 60° the shape lay down or stood up. */
      up_degrees: number;
    };
    /** The 4×4 matrix, column-major as in glTF, from the shape's own coordinates to those of the asset: the identity, or the result of `asset.fit`. Absent if an older engine made the supermesh. */
    transform?: number[];
  }>;
  /** The landmarks of the request, or else the found ones. */
  landmarks: Array<{
    /** The name from the request, or "landmark" and its number, from 0. */
    name: string;
    /** The vertex of the supermesh; −1 if there is none. */
    vertex: number;
    /** Only of a soft landmark. */
    weight?: number;
    /** The distance from the place that the request gives, one for each shape. A soft landmark ends halfway between its places on the sphere. */
    residual_relative: Array<number | null>;
    /** The share of the map's distortion that lies nearer to this landmark than to the others; with several later shapes, the largest. Absent where no suspects are looked for: the map is good or was not composed, one shape is a part of the other, or the request has fewer than four landmarks. */
    share?: number;
  } | {
    /** "auto" and its number, from 1. */
    name: string;
    /** One place for each shape, in request order. A client can correct them and send them as a landmark. */
    at: Place[];
    /** One distance for each shape. */
    residual_relative: Array<number | null>;
    /** From 0 to 1. It falls as the map nearby stretches. Where another match is nearly as good (match.clear below 0.5), those of all landmarks are multiplied by 2 · match.clear, unless match.part is true. */
    confidence: number | null;
  }>;
  /** The alignment, for align.start of a request with other landmarks. Absent if an older engine made the supermesh. */
  alignment?: string;
  /** Only if the request has align.start: whether the map follows that alignment. false: the landmarks lead far away from it, so the shapes were aligned anew. */
  start_followed?: boolean;
  /** Landmarks of the request that may be misplaced, by falling distance; empty if the map is good, or its energy was not measured. Absent if an older engine made the supermesh. */
  suspects?: Array<{
    /** An index into the landmarks. */
    landmark: number;
    name: string;
    /** An index into shapes: the map from the first shape to this one is bad around the landmark. */
    shape: number;
    /** The share of that map's distortion that is nearer to this landmark than to the others. */
    share: number;
    /** Where it would lie on that shape if its place on the first one is right. Send it as the landmark's place to try it. */
    at: Place;
    /** The distance from its given place to there, relative to the diagonal. */
    distance_relative: number;
  }>;
  /** How far you can rely on the correspondence that orbmorph found; with more than two shapes, bend, clear and lead are each the worst of all maps. Absent if the request gives landmarks or its alignment only rotates. docs/bench-confidence.md says how it is calibrated. */
  match?: {
    /** From 0 to 1, calibrated on pairs of shapes: of measured matches with about this confidence, about this share was right (docs/bench-confidence.md). */
    confidence: number;
    /** `sure` from a confidence of 0.8 on, `likely` from 0.5 on, else `unsure`. */
    verdict: 'sure' | 'likely' | 'unsure';
    /** From 0 to 1: how far the next best rough map that differs is behind; 0.5 if none differs. */
    clear: number;
    /** The geometric mean of two ratios of the nearest other rough map to the best one: of how much they bend the shapes, and of what they cost. About 1 if a shape looks alike from several sides, so that no match stands out; such a match is never `sure`. */
    lead: number;
    /** How much the best rough map bends the shapes: 0 for a rigid motion. */
    bend: number;
    /** True if one of two shapes is a part of the other one, as a head is of a bust, and was matched with it in space; else absent. `bend`, `clear` and `lead` are then of the shapes as wholes. */
    part?: true;
  };
  /** Other correspondences that the search considered, the best first; empty unless a correspondence was found. Absent if an older engine made the supermesh. */
  alternatives?: Array<{
    /** What its rough map costs, as a multiple of the best one: how much it bends and resizes the shapes, how unlike it leaves normals, how far it turns, and how far mirror images are off. */
    cost: number;
    /** The later shape that it matches differently; the others are matched as in this supermesh. Absent if an older engine made the supermesh. */
    shape?: number;
    request: CanonicalRequest;
  }>;
  certificate: {
    closed: boolean;
    genus: number;
    /** For the aligned sphere of each shape. */
    flipped: number[];
    /** For the aligned sphere of each shape. */
    degree: number[];
    /** True if each landmark of the request whose `weight` is 1 is one vertex of the supermesh, at its place on every shape. It is about no other landmark: not about soft ones, whose `weight` is below 1, and not about found ones. So it is true as well if the request gives no landmark of weight 1. `residual_relative` says how far each landmark is off. */
    landmarks_exact: boolean;
    /** For the supermesh on the sphere. */
    supermesh: {
      flipped: number;
      degree: number;
    };
  };
  /** The composed maps between two shapes. */
  pairs: Array<{
    /** An index into shapes. */
    a: number;
    /** An index into shapes. */
    b: number;
    distortion: Distortion;
    /** The share of the supermesh's triangles that are inverted on either shape: they face away from the smooth normals of the surface at their corners and from its face at their centre. */
    inverted_fraction: number | null;
    /** The number of inverted triangles. Absent if an older engine made the supermesh. */
    inverted_count?: number;
    /** With the method `template`: the largest of them, as triangles of the file of the first shape, counted from 0 after polygons are cut into triangles; the largest first. Empty with other methods. Absent if an older engine made the supermesh. */
    inverted_triangles?: number[];
  }>;
  /** Where the map between the shapes of a pair is bad; empty if it is good everywhere. Absent if an older engine made the supermesh. */
  warnings?: Array<{
    /** `stretched`: the symmetric Dirichlet energy is above 20 on more than 1 % of the area of either shape. `thin`: patches of the surface keep less than half of their area halfway through the linear morph, after a fit by similarity, because the map twists a limb or the pose rotates it far. */
    kind: 'stretched' | 'thin';
    /** An index into shapes. */
    a: number;
    /** An index into shapes. */
    b: number;
    /** The share of the area of all parts, listed or not, on the shape on which it is larger. */
    share: number;
    /** The connected parts, at most four, the largest first. */
    parts: Array<{
      /** Of the area. */
      share: number;
      /** A ball around the part on shape a, and one on shape b, in the coordinates of their files. */
      at: [{
        /** An index into shapes. */
        shape: number;
        centre: [number, number, number];
        radius: number;
      }, {
        /** An index into shapes. */
        shape: number;
        centre: [number, number, number];
        radius: number;
      }];
      /** The largest triangles of the part, each by three vertices of the supermesh. */
      triangles: [number, number, number][];
    }>;
  }>;
  /** The energy of the alignment; null if it was not measured. */
  energy: number | null;
  /** What the files have and the asset lacks: parts of the first shape's materials, and data that no new document has, such as skins. With the remesh method template an uploaded glTF document is kept, and the list is mostly empty. The last entry of a long list counts the rest. */
  dropped: Array<{
    /** The part. */
    what: string;
    /** Its place in the file of the first shape, or the shape; empty for the whole file. */
    where: string;
    /** The reason. */
    why: string;
  }>;
  /** How many holes of the first shape are open in the asset. Only if there are any. The certificate is about the common mesh, in which they are filled. */
  open_holes?: number;
  /** How many triangles the asset has. Only if that differs from `triangles`, the number of the common mesh: holes of the first shape are open in the asset, or a template keeps triangles that are not on the closed surface. */
  asset_triangles?: number;
  /** Filled holes of the first shape and of a later one that correspond: the rims lie on each other. Only if there are any; `dropped` names the other holes. Holes are numbered from 1, in the order in which they were filled. */
  rims?: Array<{
    /** The later shape. */
    shape: number;
    /** The hole of the first shape. */
    base: Rim;
    /** The hole of the later shape. */
    other: Rim;
    /** How far a vertex of the first rim is from the other rim at most, on the later shape, relative to its diagonal. 0 up to rounding where all points of the rims meet. */
    off_relative: number;
  }>;
  /** What `transfer` copied to the asset. Only if the request has it. */
  transferred?: Array<{
    /** The shape. */
    from: number;
    what: 'skin' | 'color' | 'texcoord' | 'targets' | 'texture';
    /** Its name in the asset: that of an attribute, of a target or of a variant. */
    as: string;
    /** Of a texture: texels a side. */
    resolution?: number;
  }>;
  timings_ms: {
    embed: number;
    /** 0 if the alignment was kept. */
    align: number;
    remesh: number;
    transfer: number;
    write: number;
    total: number;
  };
  request: CanonicalRequest;
  /** The name and version of the engine. */
  engine: string;
  created: Instant;
};

export type Rim = {
  hole: number;
  /** Of the rim, in the file. */
  edges: number;
  /** Of the rim, relative to the diagonal. */
  length_relative: number;
};

/** A supermesh without its report and request. */
export type SupermeshSummary = {
  id: Id;
  url: string;
  asset: string;
  asset_bytes: number;
  vertices: number;
  triangles: number;
  /** The shapes, in request order. */
  shapes: Array<{
    mesh: Id;
    /** 1 to 127 bytes of UTF-8. */
    name: string;
  }>;
  /** The name and version of the engine. */
  engine: string;
  created: Instant;
};

export type Job = {
  id: JobId;
  url: string;
  kind: 'embedding' | 'supermesh' | 'fetch';
  state: 'queued' | 'running' | 'succeeded' | 'failed' | 'cancelled';
  /** The current step: download, check, read, simplify, embed, certify, align, remesh, transfer, write or store. */
  stage: string | null;
  /** The progress of the whole job. */
  progress: number;
  /** An estimate of the time that a running job still takes. Null until the job has run for a second and made 5 % of progress. A job that waits for its embeddings runs; the estimate begins anew when a worker takes it. Null if it fetches a file or does not run. */
  seconds_left: number | null;
  /** The result, once the job has succeeded. */
  result: string | null;
  /** Why the job failed. */
  problem: Problem | null;
  /** How often the job was started. */
  attempt: number;
  created: Instant;
  started: Instant | null;
  finished: Instant | null;
};

/** The daemon announces the end of the job to this URL. The webhook belongs to the job, not to the id of its result. */
export type WebhookRequest = {
  /** https://, or http:// to an address that the operator has listed. */
  url: string;
  /** The ends that are announced. Default: all of them. */
  events?: Array<'succeeded' | 'failed' | 'cancelled'>;
};

export type FetchRequest = {
  /** Where the file is: https://, or http:// to an address that the operator has listed. */
  url: string;
  /** 1 to 127 bytes of UTF-8 without control characters. Default: "mesh". */
  name?: string;
  /** The format to assume if the content does not determine it. */
  format?: 'obj' | 'off' | 'ply' | 'stl' | '3mf' | 'gltf' | 'glb';
  /** As of an upload. Default: "safe". */
  repair?: string;
  /** As of an upload. */
  handle_size?: number;
  /** As of an upload. */
  part?: string;
  webhook?: WebhookRequest;
};

/** The message about the end of a job to one webhook. */
export type Delivery = {
  /** Among the deliveries of the job, from 1. */
  number: number;
  /** The webhook-id of the message, the same in every attempt. */
  id: string;
  /** The name of a webhook of the tenant; null: the request named the URL. */
  webhook: string | null;
  url: string;
  type: 'job.succeeded' | 'job.failed' | 'job.cancelled';
  state: 'pending' | 'delivered' | 'failed';
  attempts: number;
  /** Of the last answer. */
  status: number | null;
  /** Of the last attempt. */
  error: string | null;
  created: Instant;
  /** Of a pending delivery. */
  next_attempt: Instant | null;
  finished: Instant | null;
};

export type DeliveryList = {
  /** By number. */
  deliveries: Delivery[];
};

export type WebhookMessage = {
  type: 'job.succeeded' | 'job.failed' | 'job.cancelled';
  timestamp: Instant;
  data: Job;
};

export type MeshPage = {
  /** Newest first. */
  meshes: Mesh[];
  /** The value of page_token for the next page; null on the last page. */
  next_page_token: string | null;
};

export type EmbeddingPage = {
  /** Newest first. */
  embeddings: Embedding[];
  /** The value of page_token for the next page; null on the last page. */
  next_page_token: string | null;
};

export type SupermeshPage = {
  /** Newest first. */
  supermeshes: Supermesh[];
  /** The value of page_token for the next page; null on the last page. */
  next_page_token: string | null;
};

export type SupermeshSummaryPage = {
  /** Newest first. */
  supermeshes: SupermeshSummary[];
  /** The value of page_token for the next page; null on the last page. */
  next_page_token: string | null;
};

export type LandmarksPage = {
  landmarks: LandmarksSummary[];
  /** The value of page_token for the next page; null on the last page. */
  next_page_token: string | null;
};

export type JobPage = {
  /** Newest first. */
  jobs: Job[];
  /** The value of page_token for the next page; null on the last page. */
  next_page_token: string | null;
};

export type Usage = {
  /** Empty for resources made without a token. */
  tenant: string;
  meshes: number;
  /** Of its meshes and landmarks. */
  bytes: number;
  /** Of embeddings, supermeshes and kept alignments that its jobs made, and of the requests of its unfinished jobs, with the landmarks that they name. */
  derived_bytes: number;
  /** The limits of the caller's token; for other tenants, the smallest of their tokens. 0: no limit. */
  quotas: {
    bytes: number;
    derived_bytes: number;
    /** Unfinished jobs. */
    jobs: number;
  };
  /** Jobs that workers have. */
  running: number;
  /** Other unfinished jobs, with the embeddings that supermeshes wait for. */
  queued: number;
  /** The time that workers spent on its jobs, failed ones included. */
  worker_seconds: number;
  /** Processes that died at its work, until the operator clears them. */
  crashes: number;
};

export type UsagePage = {
  tenants: Usage[];
  /** The value of page_token for the next page; null on the last page. */
  next_page_token: string | null;
};

export type Live = {
  status: 'alive';
};

/** Members other than status appear with ?verbose only. */
export type Ready = {
  status: 'ready';
  queued?: number;
  running?: number;
  workers?: number;
  connections?: number;
  /** Jobs that wait for embeddings. */
  waiting?: number;
  /** The limit on unfinished jobs. */
  queue_limit?: number;
  /** The age of the oldest queued job. */
  oldest_ms?: number;
  /** The limit on connections. */
  max_connections?: number;
  /** Connections that wait for a job. */
  waiting_connections?: number;
  /** Free space of the file system that holds the data folder. */
  disk_free_bytes?: number;
  /** The time since the daemon started. */
  uptime_seconds?: number;
  /** The name and version of the engine. */
  engine?: string;
  integrity?: Integrity;
  /** The data folder is on a read-only file system: stored results are served, and nothing is stored. */
  read_only?: boolean;
};

/** Damage of the stored data, as the last complete round of the scrub found it; quarantined counts up to now. */
export type Integrity = {
  /** damaged: SQLite's quick_check found damage; /readyz then answers 503. */
  catalogue: 'ok' | 'damaged';
  /** Stored files that did not match their hash, since the start. */
  quarantined: number;
  /** Stored files that a row names and that do not exist: upload the mesh again. */
  missing: number;
  /** Stored files that could not be read. */
  unreadable: number;
  /** Stored files that no row names. A crash leaves one or two; more mean that the catalogue has lost rows. */
  without_row: number;
  /** Complete rounds since the start. */
  scrubs: number;
  /** Stored files that the last round compared with their hashes. */
  scrubbed_objects: number;
};

/** The headers are ambiguous, or the route takes no body but the request has one. The daemon closes the connection. */
export type ProblemBadRequest = {
  type: '/problems/bad-request';
  title: 'The request is malformed';
  status: 400;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemBadQuery = {
  type: '/problems/bad-query';
  title: 'A query parameter is not valid';
  status: 400;
  /** What is wrong and what to do. */
  detail: string;
  /** The parameter that is unknown, given twice or without a value. */
  parameter?: string;
};

export type ProblemMalformedJson = {
  type: '/problems/malformed-json';
  title: 'The body is not valid JSON';
  status: 400;
  /** What is wrong and what to do. */
  detail: string;
  /** The byte at which the parser stopped. */
  offset: number;
};

/** A part of a glTF document. */
export type DocumentElement = {
  /** Its place, such as meshes[0] or nodes[3]; without a number, such as nodes, where the document does not have it. */
  where: string;
  /** Its name in the document; absent if it has none. */
  name?: string;
};

/** A text file gives the line, a binary file the offset. */
export type ProblemMalformedMesh = {
  type: '/problems/malformed-mesh';
  title: 'The mesh file is malformed';
  status: 400;
  /** What is wrong and what to do. */
  detail: string;
  /** The line of a text file, from 1; the last line if the file ends too early. */
  line: number;
} | {
  type: '/problems/malformed-mesh';
  title: 'The mesh file is malformed';
  status: 400;
  /** What is wrong and what to do. */
  detail: string;
  /** The offset in bytes. */
  offset: number;
  /** The number of the shape in the request, from 0. */
  shape?: number;
  /** The number of the entry of `transfer` in the request, from 0. */
  transfer?: number;
  /** How many parts of the shape's glTF document are at fault. */
  element_count?: number;
  /** The first of them. */
  elements?: DocumentElement[];
};

export type ProblemMalformedEncoding = {
  type: '/problems/malformed-encoding';
  title: 'The compressed body is malformed';
  status: 400;
  /** What is wrong and what to do. */
  detail: string;
  /** The offset in bytes of the body before unpacking. */
  offset?: number;
};

export type ProblemUnauthorized = {
  type: '/problems/unauthorized';
  title: 'A valid token is required';
  status: 401;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemForbidden = {
  type: '/problems/forbidden';
  title: 'The token does not allow this';
  status: 403;
  /** What is wrong and what to do. */
  detail: string;
  /** The required scope. */
  scope: 'read' | 'write' | 'admin';
};

export type ProblemBadSignature = {
  type: '/problems/bad-signature';
  title: 'The signature is not valid';
  status: 403;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemExpiredSignature = {
  type: '/problems/expired-signature';
  title: 'The signature has expired';
  status: 403;
  /** What is wrong and what to do. */
  detail: string;
  /** Unix time in seconds. */
  expires: number;
};

export type ProblemForeignHost = {
  type: '/problems/foreign-host';
  title: 'The request addresses the daemon by a name that is not its own';
  status: 403;
  /** What is wrong and what to do. */
  detail: string;
  /** The host that the request names. */
  host: string;
};

export type ProblemForeignOrigin = {
  type: '/problems/foreign-origin';
  title: 'A page of another site sent the request';
  status: 403;
  /** What is wrong and what to do. */
  detail: string;
  /** The Origin header; absent if the browser sent none. */
  origin?: string;
};

export type ProblemForbiddenAddress = {
  type: '/problems/forbidden-address';
  title: 'The daemon may not connect to this address';
  status: 403;
  /** What is wrong and what to do. */
  detail: string;
  /** The URL of the request. */
  url: string;
};

export type ProblemNotFound = {
  type: '/problems/not-found';
  title: 'Nothing is here';
  status: 404;
  /** What is wrong and what to do. */
  detail: string;
  /** The unknown mesh, if the request names one. */
  mesh?: string;
  /** The unknown landmarks, if the request names some. */
  landmarks?: string;
};

export type ProblemMethodNotAllowed = {
  type: '/problems/method-not-allowed';
  title: 'This path does not accept the method';
  status: 405;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemInUse = {
  type: '/problems/in-use';
  title: 'Unfinished jobs use this mesh';
  status: 409;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemJobEnded = {
  type: '/problems/job-ended';
  title: 'The job has already ended';
  status: 409;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemCancelled = {
  type: '/problems/cancelled';
  title: 'The job was cancelled';
  status: 409;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemLengthRequired = {
  type: '/problems/length-required';
  title: 'The length of the body is required';
  status: 411;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemTooLarge = {
  type: '/problems/too-large';
  title: 'The input is too large';
  status: 413;
  /** What is wrong and what to do. */
  detail: string;
  /** The limit in bytes, if the body exceeds it. */
  limit?: number;
  /** The line of a text file, from 1; the last line if the file ends too early. */
  line?: number;
  /** The offset in bytes. */
  offset?: number;
  /** The numbers of the landmarks in the request, from 0. */
  landmarks?: number[];
  /** The number of the shape in the request, from 0. */
  shape?: number;
  /** The number of the entry of `transfer` in the request, from 0. */
  transfer?: number;
  /** How many parts of the shape's glTF document are at fault. */
  element_count?: number;
  /** The first of them. */
  elements?: DocumentElement[];
  /** The limit that a compressed body exceeds: unpacked size over packed size. */
  ratio_limit?: number;
};

export type ProblemUnknownFormat = {
  type: '/problems/unknown-format';
  title: 'The mesh format is not recognised';
  status: 415;
  /** What is wrong and what to do. */
  detail: string;
  /** The line of a text file, from 1; the last line if the file ends too early. */
  line?: number;
  /** The offset in bytes. */
  offset?: number;
};

export type ProblemUnsupportedMediaType = {
  type: '/problems/unsupported-media-type';
  title: 'The media type is not supported';
  status: 415;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemUnsupportedEncoding = {
  type: '/problems/unsupported-encoding';
  title: 'The content encoding is not supported';
  status: 415;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemPreconditionFailed = {
  type: '/problems/precondition-failed';
  title: 'The resource differs from what the request expects';
  status: 412;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemRangeNotSatisfiable = {
  type: '/problems/range-not-satisfiable';
  title: 'The range lies outside the file';
  status: 416;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemNotClosed = {
  type: '/problems/not-closed';
  title: 'The mesh is not closed';
  status: 422;
  /** What is wrong and what to do. */
  detail: string;
  boundary_loops: number;
  boundary_edge_count: number;
  /** Up to 100 pairs of vertex numbers of the file, from 0. */
  boundary_edges: [number, number][];
  component_count?: number;
  /** The number of triangles of each component, largest first. */
  components?: number[];
  parts?: Parts;
};

/** edges: edges of more than two faces; vertices: vertices where two fans of faces touch. */
export type ProblemNotManifold = {
  type: '/problems/not-manifold';
  title: 'The mesh is not manifold';
  status: 422;
  /** What is wrong and what to do. */
  detail: string;
  edge_count?: number;
  /** Up to 100 pairs of vertex numbers of the file, from 0. */
  edges?: [number, number][];
  vertex_count?: number;
  /** Up to 100 vertex numbers of the file, from 0. */
  vertices?: number[];
  component_count?: number;
  /** The number of triangles of each component, largest first. */
  components?: number[];
  parts?: Parts;
};

export type ProblemNotOrientable = {
  type: '/problems/not-orientable';
  title: 'The mesh cannot be oriented';
  status: 422;
  /** What is wrong and what to do. */
  detail: string;
  edge_count?: number;
  /** Up to 100 pairs of vertex numbers of the file, from 0. */
  edges?: [number, number][];
  component_count?: number;
  /** The number of triangles of each component, largest first. */
  components?: number[];
  parts?: Parts;
};

export type ProblemNotConnected = {
  type: '/problems/not-connected';
  title: 'The mesh is not connected';
  status: 422;
  /** What is wrong and what to do. */
  detail: string;
  component_count: number;
  /** The number of triangles of each component, largest first. */
  components: number[];
  parts?: Parts;
};

/** The pieces of a mesh, largest first; up to 100. Each can be kept with the parameter `part`. */
export type Parts = Array<{
  part: number;
  triangles: number;
  /** Of the object (OBJ) or mesh (glTF) that most of its triangles belong to. A mesh without a name has that of its node. */
  name?: string;
  /** glTF: the node that shows that mesh. The parameter `part` takes this name too. */
  node?: string;
}>;

export type ProblemNotGenusZero = {
  type: '/problems/not-genus-zero';
  title: 'The mesh has handles';
  status: 422;
  /** What is wrong and what to do. */
  detail: string;
  genus: number;
  /** A loop for each handle, up to 32768 loops and 262144 vertices in all, in the problem of a job at most 32 KB of them: vertices of the file, each once, joined by edges; the last is joined to the first. A cut along it leaves the surface in one piece. */
  loops: number[][];
  /** The length of each loop, relative to the diagonal. */
  loop_lengths_relative: number[];
  /** The number of handles whose loops are not in the list. Absent: the list has all. */
  loops_left_out?: number;
};

export type ProblemDegenerate = {
  type: '/problems/degenerate';
  title: 'The mesh has too few triangles or is too small';
  status: 422;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemNotFinite = {
  type: '/problems/not-finite';
  title: 'A coordinate is not finite or too large';
  status: 422;
  /** What is wrong and what to do. */
  detail: string;
  /** The line of a text file, from 1; the last line if the file ends too early. */
  line?: number;
  /** The offset in bytes. */
  offset?: number;
  vertex_count?: number;
  /** Up to 100 vertex numbers of the file, from 0. */
  vertices?: number[];
};

export type ProblemBadLandmarks = {
  type: '/problems/bad-landmarks';
  title: 'The landmarks are invalid or contradict each other';
  status: 422;
  /** What is wrong and what to do. */
  detail: string;
  /** The numbers of the landmarks in the request, from 0. */
  landmarks?: number[];
  /** The number of the shape in the request, from 0. */
  shape?: number;
  reason?: 'out-of-range' | 'dropped';
};

export type ProblemBadOption = {
  type: '/problems/bad-option';
  title: 'An option is not valid';
  status: 422;
  /** What is wrong and what to do. */
  detail: string;
  /** The name of the member. */
  member?: string;
  /** The numbers of the landmarks in the request, from 0. */
  landmarks?: number[];
  /** The number of the shape in the request, from 0. */
  shape?: number;
  /** The number of the entry of `transfer` in the request, from 0. */
  transfer?: number;
  /** How many parts of the shape's glTF document are at fault. */
  element_count?: number;
  /** The first of them. */
  elements?: DocumentElement[];
};

export type ProblemUnknownMember = {
  type: '/problems/unknown-member';
  title: 'A member of the request is unknown';
  status: 422;
  /** What is wrong and what to do. */
  detail: string;
  /** The name of the member. */
  member: string;
  /** The number of the entry of `transfer` in the request, from 0. */
  transfer?: number;
};

export type ProblemInvalidRequest = {
  type: '/problems/invalid-request';
  title: 'A member of the request is not valid';
  status: 422;
  /** What is wrong and what to do. */
  detail: string;
  /** The number of the entry of `transfer` in the request, from 0. */
  transfer?: number;
};

export type ProblemUnsupportedMethod = {
  type: '/problems/unsupported-method';
  title: 'The method is not available in this build';
  status: 422;
  /** What is wrong and what to do. */
  detail: string;
  /** The name of the method. */
  method?: string;
  /** The numbers of the landmarks in the request, from 0. */
  landmarks?: number[];
  /** The number of the shape in the request, from 0. */
  shape?: number;
};

export type ProblemTooManyRequests = {
  type: '/problems/too-many-requests';
  title: 'Too many requests came at once';
  status: 429;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemQuotaExceeded = {
  type: '/problems/quota-exceeded';
  title: 'The quota is used up';
  status: 429;
  /** What is wrong and what to do. */
  detail: string;
  /** The bytes of meshes and landmarks that the token's tenant may own, the bytes of what its jobs made, the unfinished jobs that it may have, or what the key of a signed URL may use in a day. */
  quota: number;
  /** The bytes of what the tenant's jobs made, if that quota is exhausted. */
  used?: number;
  /** The bytes of the requests of the tenant's unfinished jobs, and those that they will add, estimated; with `used`. */
  pending?: number;
};

export type ProblemQueueFull = {
  type: '/problems/queue-full';
  title: 'The queue is full';
  status: 429;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemFetchFailed = {
  type: '/problems/fetch-failed';
  title: 'The file could not be fetched';
  status: 502;
  /** What is wrong and what to do. */
  detail: string;
  /** The URL of the request. */
  url: string;
  /** The status with which its server answered, if it did. */
  answer?: number;
};

export type ProblemInternal = {
  type: '/problems/internal';
  title: 'The daemon failed at this';
  status: 500;
  /** What is wrong and what to do. */
  detail: string;
  /** The numbers of the landmarks in the request, from 0. */
  landmarks?: number[];
  /** The number of the shape in the request, from 0. */
  shape?: number;
};

/** For jobs: the daemon returns no result rather than an invalid one. */
export type ProblemNotCertified = {
  type: '/problems/not-certified';
  title: 'The result could not be certified';
  status: 500;
  /** What is wrong and what to do. */
  detail: string;
  /** The numbers of the landmarks in the request, from 0. */
  landmarks?: number[];
  /** The number of the shape in the request, from 0. */
  shape?: number;
};

/** For jobs. */
export type ProblemCorrupt = {
  type: '/problems/corrupt';
  title: 'Stored data is corrupt';
  status: 500;
  /** What is wrong and what to do. */
  detail: string;
};

/** For jobs. */
export type ProblemCrashed = {
  type: '/problems/crashed';
  title: 'The job crashed the daemon repeatedly';
  status: 500;
  /** What is wrong and what to do. */
  detail: string;
};

/** For jobs, for requests whose processes have died three times, and for the check of an upload. */
export type ProblemJobCrashed = {
  type: '/problems/job-crashed';
  title: 'The process that did this work died';
  status: 500;
  /** What is wrong and what to do. */
  detail: string;
};

/** For jobs, and for the check of an upload. */
export type ProblemTimeout = {
  type: '/problems/timeout';
  title: 'The work took longer than its time limit';
  status: 503;
  /** What is wrong and what to do. */
  detail: string;
  /** The numbers of the landmarks in the request, from 0. */
  landmarks?: number[];
  /** The number of the shape in the request, from 0. */
  shape?: number;
};

export type ProblemNotReady = {
  type: '/problems/not-ready';
  title: 'The result is not ready';
  status: 503;
  /** What is wrong and what to do. */
  detail: string;
  /** The job that computes it. */
  url: string;
};

export type ProblemNoMemory = {
  type: '/problems/no-memory';
  title: 'The daemon has no memory left';
  status: 503;
  /** What is wrong and what to do. */
  detail: string;
  /** The numbers of the landmarks in the request, from 0. */
  landmarks?: number[];
  /** The number of the shape in the request, from 0. */
  shape?: number;
};

export type ProblemUnavailable = {
  type: '/problems/unavailable';
  title: 'The daemon cannot answer this now';
  status: 503;
  /** What is wrong and what to do. */
  detail: string;
};

/** The data folder is on a read-only file system. Stored results are still served. */
export type ProblemReadOnly = {
  type: '/problems/read-only';
  title: 'The data folder is read-only';
  status: 507;
  /** What is wrong and what to do. */
  detail: string;
};

export type ProblemStorageFull = {
  type: '/problems/storage-full';
  title: 'The disk is full';
  status: 507;
  /** What is wrong and what to do. */
  detail: string;
};

/** A problem document of RFC 9457; `type` identifies the problem. */
export type Problem = ProblemBadRequest | ProblemBadQuery | ProblemMalformedJson | ProblemMalformedMesh | ProblemMalformedEncoding | ProblemUnauthorized | ProblemForbidden | ProblemBadSignature | ProblemExpiredSignature | ProblemForeignHost | ProblemForeignOrigin | ProblemForbiddenAddress | ProblemNotFound | ProblemMethodNotAllowed | ProblemInUse | ProblemJobEnded | ProblemCancelled | ProblemLengthRequired | ProblemTooLarge | ProblemUnknownFormat | ProblemUnsupportedMediaType | ProblemUnsupportedEncoding | ProblemPreconditionFailed | ProblemRangeNotSatisfiable | ProblemNotClosed | ProblemNotManifold | ProblemNotOrientable | ProblemNotConnected | ProblemNotGenusZero | ProblemDegenerate | ProblemNotFinite | ProblemBadLandmarks | ProblemBadOption | ProblemUnknownMember | ProblemInvalidRequest | ProblemUnsupportedMethod | ProblemTooManyRequests | ProblemQuotaExceeded | ProblemQueueFull | ProblemFetchFailed | ProblemInternal | ProblemNotCertified | ProblemCorrupt | ProblemCrashed | ProblemJobCrashed | ProblemTimeout | ProblemNotReady | ProblemNoMemory | ProblemUnavailable | ProblemStorageFull;
