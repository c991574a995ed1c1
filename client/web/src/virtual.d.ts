declare module 'virtual:samples' {
  const samples: { name: string; file: string; bytes: number; url: string }[];
  export default samples;
}
