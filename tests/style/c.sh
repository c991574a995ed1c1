#!/bin/sh
# Format of all tracked C and C++ files, by clang-format 14: other versions format differently. 77 (skipped) without it
# or outside a Git checkout.
# To reformat: git ls-files '*.c' '*.h' '*.cc' | xargs clang-format -i
set -eu
cd "$(dirname "$0")/../.."
for clang_format in clang-format-14 clang-format; do
  case $("$clang_format" --version 2>/dev/null) in *' version 14.'*)
    git rev-parse >/dev/null 2>&1 || { echo "skipped: not a Git checkout"; exit 77; }
    git ls-files -z '*.c' '*.h' '*.cc' | xargs -0 "$clang_format" --dry-run -Werror
    exit
  esac
done
echo "skipped: clang-format 14 is not there"
exit 77
