#!/bin/sh
# Each public header compiles alone, as C17 and as C++17, without extensions and without warnings. Each function has
# ORB_API and C linkage, and orbmorph.h includes each header.
#   headers.sh INCLUDE C-COMPILER C++-COMPILER
set -eu
include=$1 cc=$2 cxx=$3
flags="-Wall -Wextra -Wpedantic -Werror -fsyntax-only"
count=0
for header in "$include"/orbmorph/*.h; do
  name=orbmorph/$(basename "$header")
  # shellcheck disable=SC2086 # flags are words
  printf '#include "%s"\ntypedef int not_empty;\n' "$name" | "$cc" -std=c17 -Wstrict-prototypes $flags -I "$include" -x c - || { echo "$name as C17" >&2; exit 1; }
  # shellcheck disable=SC2086
  printf '#include "%s"\ntypedef int not_empty;\n' "$name" | "$cxx" -std=c++17 $flags -I "$include" -x c++ - || { echo "$name as C++17" >&2; exit 1; }
  if [ "$name" != orbmorph/orbmorph.h ]; then
    if grep -nE '^(ORB_MUST_CHECK|const|unsigned|void|[a-z]+|[a-z0-9]+_t|orb_[a-z_]+) [a-z_ *0-9]*orb_[a-z_0-9]+\(' "$header" |
      grep -v ':static '; then
      echo "$name declares these functions without ORB_API" >&2
      exit 1
    fi
    if grep -q '^ORB_API' "$header"; then
      grep -q 'extern "C"' "$header" || { echo "$name lacks extern \"C\"" >&2; exit 1; }
    fi
    grep -q "#include \"$name\"" "$include/orbmorph/orbmorph.h" || { echo "orbmorph.h lacks $name" >&2; exit 1; }
  fi
  count=$((count + 1))
done
[ $count -gt 10 ] || { echo "only $count headers in $include/orbmorph" >&2; exit 1; }
