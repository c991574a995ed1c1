#!/bin/sh
# Installs the library into a scratch folder, moves it, and builds docs/library/morph.c against those files alone: as C17
# with the shared library (pkg-config), as C17 with the static one (pkg-config --static), and as C++17 with the static
# one (find_package). All three write the same valid GLB.
#   installed.sh FOLDER      FOLDER is deleted first. From the environment: ORB_BUILD, CMAKE, CC, CXX, LIBDIR,
#                            ORB_PROJECT_VERSION, and NODE (may be empty)
set -eu
here=$(cd "$(dirname "$0")" && pwd)
tree=$here/../..
scratch=$1
rm -rf "$scratch"
mkdir -p "$scratch"
fail() {
  echo "$*" >&2
  exit 1
}

for component in library development; do
  "$CMAKE" --install "$ORB_BUILD" --prefix "$scratch/first" --component $component >/dev/null
done
mv "$scratch/first" "$scratch/prefix" # no installed file may name the folder it was installed to
prefix=$scratch/prefix
if grep -rlF -e "$scratch/first" -e "$ORB_BUILD" "$prefix/include" "$prefix/$LIBDIR/pkgconfig" "$prefix/$LIBDIR/cmake"; then
  fail "these installed files name folders of the build"
fi
export PKG_CONFIG_PATH="$prefix/$LIBDIR/pkgconfig"
pkg-config --exact-version="$ORB_PROJECT_VERSION" orbmorph || fail "orbmorph.pc has another version than the project"

# pkg-config refuses orbmorph.pc if a file that it requires is missing, so liborbmorph-dev depends on the packages of all
# of them. Left out where these packages have other names.
packages=$(sed -n 's/.*CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "\(.*\)").*/\1/p' "$ORB_BUILD/CPackConfig.cmake" |
  grep -o '[^ ,]*-dev')
mkdir "$scratch/required"
# shellcheck disable=SC2086 # words
if dpkg-query -L $packages >"$scratch/required/files" 2>/dev/null; then
  grep '\.pc$' "$scratch/required/files" | xargs cp -t "$scratch/required"
  PKG_CONFIG_LIBDIR="$scratch/required" pkg-config --print-errors --exists orbmorph ||
    fail "liborbmorph-dev depends on too few packages: $packages"
fi

# Shared, C17.
flags=$(pkg-config --cflags --libs orbmorph)
eval "set -- $flags" # pkg-config escapes blanks in the names of folders
"$CC" -std=c17 -Wall -Wextra -Wpedantic -Werror "$tree/docs/library/morph.c" "$@" -o "$scratch/morph-shared"
export LD_LIBRARY_PATH="$prefix/$LIBDIR"
ldd "$scratch/morph-shared" | grep -q "liborbmorph.so.1 => $prefix/" || fail "morph-shared does not load liborbmorph.so.1"

# Static, C17: the same files without the shared library.
mkdir "$scratch/static"
cp -R "$prefix/." "$scratch/static/"
rm "$scratch/static/$LIBDIR"/liborbmorph.so*
PKG_CONFIG_PATH="$scratch/static/$LIBDIR/pkgconfig"
flags=$(pkg-config --static --cflags --libs orbmorph)
eval "set -- $flags"
"$CC" -std=c17 "$tree/docs/library/morph.c" "$@" -o "$scratch/morph-static"

# Static, C++17.
"$CMAKE" -S "$here/consumer" -B "$scratch/consumer" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_CXX_COMPILER="$CXX" \
  -DMORPH="$tree/docs/library/morph.c" >"$scratch/consumer.log" 2>&1 || { cat "$scratch/consumer.log"; exit 1; }
"$CMAKE" --build "$scratch/consumer" >"$scratch/consumer.log" 2>&1 || { cat "$scratch/consumer.log"; exit 1; }
for program in "$scratch/morph-static" "$scratch/consumer/morph"; do
  if ldd "$program" | grep liborbmorph; then
    fail "$program loads the shared library"
  fi
done

samples=$tree/tests/samples
"$scratch/morph-shared" "$samples/dog.obj" "$samples/giraffe.off" >"$scratch/shared.glb"
[ "$(head -c 4 "$scratch/shared.glb")" = glTF ] || fail "the asset does not begin with glTF"
for program in "$scratch/morph-static" "$scratch/consumer/morph"; do
  "$program" "$samples/dog.obj" "$samples/giraffe.off" | cmp - "$scratch/shared.glb" || fail "$program writes another asset"
done
if [ -n "$NODE" ]; then
  "$NODE" "$here/validate.mjs" "$scratch/shared.glb"
fi

# Errors: the status, plain words, and exit status 1.
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n' >"$scratch/open.obj"
if "$scratch/morph-shared" "$scratch/open.obj" "$samples/giraffe.off" >"$scratch/none.glb" 2>"$scratch/error"; then
  fail "a triangle is accepted as a closed mesh"
fi
grep -q "open.obj: not-closed: " "$scratch/error" || fail "the error of an open mesh reads: $(cat "$scratch/error")"
[ ! -s "$scratch/none.glb" ] || fail "an asset was written in spite of the error"
