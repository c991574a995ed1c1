/** The names in a list of repairs, and the piece that it keeps: "part:NAME" comes last, as a name may contain commas. */
function parse(list: string): { names: string[]; part: string } {
  const at = list.search(/(^|,)part:/);
  const names = (at < 0 ? list : list.slice(0, at)).split(',').filter(Boolean);
  return { names, part: at < 0 ? '' : list.slice(at).replace(/^,/, '') };
}

const nameOf = (repair: string) => repair.split(':')[0];

/** A list of repairs with further ones. Of two sizes or pieces, the later one holds; a piece replaces the largest. */
export function withRepairs(list: string, more: string): string {
  const before = parse(list);
  const added = parse(more);
  if (added.names.includes('none')) return more;
  const kept = before.names.filter(
    (name) => name !== 'none' && !added.names.some((other) => nameOf(other) === nameOf(name)),
  );
  const part = added.part || (added.names.includes('largest_component') ? '' : before.part);
  const names = [...kept, ...added.names].filter((name) => !part || name !== 'largest_component');
  return [...names, part].filter(Boolean).join(',');
}
