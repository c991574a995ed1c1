#!/bin/sh
# Names of functions in libraries.
#   symbols.sh once LIBRARY…              no static library defines an external name twice: the linker would take either
#   symbols.sh exports LIST LIBRARY…      each library exports exactly the names in LIST, sorted, one a line
set -eu
export LC_ALL=C

# The names that a library defines for others: T functions, D data and so on; nm reads a shared library's with -D.
exported() {
  case $1 in
    *.a) nm --defined-only --extern-only "$1" ;;
    *) nm --defined-only --dynamic "$1" ;;
  esac | awk 'NF == 3 && $2 != "A" { sub(/@.*/, "", $3); print $3 }' | sort
}

once() {
  for library in "$@"; do
    names=$(nm --defined-only --extern-only "$library" | awk '$2 == "T" { print $3 }')
    if [ -z "$names" ]; then
      echo "$library: no symbols found" >&2
      exit 1
    fi
    twice=$(printf '%s\n' "$names" | sort | uniq -d)
    if [ -n "$twice" ]; then
      printf '%s defines more than once:\n%s\n' "$library" "$twice" >&2
      exit 1
    fi
  done
}

exports() {
  list=$1
  shift
  for library in "$@"; do
    if exported "$library" | diff -u --label "$list" --label "$library" "$list" - >&2; then
      continue
    fi
    cat >&2 <<TEXT
The names that the library exports differ from $list.
+ A new function: if callers need it, add its name to the list; else declare it in an internal header, without ORB_API.
- A missing function: programs linked to liborbmorph.so.1 stop working. Restore it, or raise the major version and with
  it the SOVERSION (see docs/library.md), and remove the name from the list.
TEXT
    exit 1
  done
}

command=$1
shift
"$command" "$@"
