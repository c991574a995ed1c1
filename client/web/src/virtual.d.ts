declare module 'virtual:samples' {
  const samples: { name: string; file: string; bytes: number; url: string }[];
  export default samples;
}

/** The part of Google's decoder that the studio uses, by src/draco/javascript/emscripten/draco_web_decoder.idl of Draco. */
declare module 'three/examples/jsm/libs/draco/gltf/draco_decoder.js' {
  interface Attribute {
    /** 0: there is none */
    ptr: number;
    num_components(): number;
  }
  interface Mesh {
    num_points(): number;
    num_faces(): number;
  }
  interface Decoder {
    DecodeArrayToMesh(bytes: Int8Array, length: number, mesh: Mesh): { ok(): boolean; error_msg(): string };
    GetAttributeByUniqueId(mesh: Mesh, id: number): Attribute;
    GetAttributeDataArrayForAllPoints(
      mesh: Mesh,
      attribute: Attribute,
      type: number,
      bytes: number,
      at: number,
    ): boolean;
    GetTrianglesUInt32Array(mesh: Mesh, bytes: number, at: number): boolean;
  }
  export interface Draco {
    Decoder: new () => Decoder;
    Mesh: new () => Mesh;
    destroy(object: Decoder | Mesh): void;
    _malloc(bytes: number): number;
    _free(at: number): void;
    HEAPF32: Float32Array<ArrayBuffer>;
    DT_INT8: number;
    DT_UINT8: number;
    DT_INT16: number;
    DT_UINT16: number;
    DT_UINT32: number;
    DT_FLOAT32: number;
  }
  export default function start(options: { onModuleLoaded(draco: Draco): void }): unknown;
}
