#!/bin/sh
# A static library takes either of two functions of one name without a word: no external name is defined twice in it.
# usage: symbols.sh LIBRARY…
set -eu
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
