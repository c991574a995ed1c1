#!/usr/bin/env bash
# The embedding on 64-bit Arm, where the plain vector loops compile to NEON: cross-compiled, and run by qemu's user
# emulation. Runs unit tests and adversarial meshes, and compares the points of both methods with those of this machine.
#
#   tests/tools/arm.sh [EMBED-DIGEST]    the program built for this machine, build/bin/embed-digest by default
#
# Needs gcc-aarch64-linux-gnu, libc6-dev-arm64-cross, qemu-user-static.
set -euo pipefail
here=$(realpath -- "${1:-$(dirname "${BASH_SOURCE[0]}")/../../build/bin/embed-digest}")
cd "$(dirname "$(realpath -- "${BASH_SOURCE[0]}")")/../.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

flags=(-std=gnu17 -O3 -Wall -Wextra -Wshadow -Wconversion -Wstrict-prototypes -Werror -fno-math-errno
  -ffp-contract=off -D_GNU_SOURCE -D_FILE_OFFSET_BITS=64 -Icore/include -Icore -Itests/tools -Itests/unit)
sources=(core/{base,numeric,mesh,embed}/*.c)
arm=aarch64-linux-gnu-gcc

# cmocka for Arm, unpacked outside the system, which does not change.
mkdir -p "$work"/{lists/partial,archives/partial,cmocka}
touch "$work/status"
apt=(apt-get -qq -o APT::Architecture=arm64 -o APT::Architectures=arm64 -o Dir::State="$work"
  -o Dir::State::status="$work/status" -o Dir::Cache="$work" -o APT::Sandbox::User=root)
"${apt[@]}" update
(cd "$work" && "${apt[@]}" download libcmocka0 libcmocka-dev)
for package in "$work"/*.deb; do
  dpkg-deb -x "$package" "$work/cmocka"
done

mkdir "$work/object"
for source in "${sources[@]}" tests/tools/adversarial.c tests/unit/support_{exact,shapes}.c; do
  "$arm" "${flags[@]}" -I"$work/cmocka/usr/include" -c "$source" -o "$work/object/$(basename "$source" .c)-$(basename "$(dirname "$source")").o"
done
for program in tests/unit/test_{orient,certify,dense,refiner}.c tests/tools/embed_{adversarial,digest}.c; do
  "$arm" "${flags[@]}" -I"$work/cmocka/usr/include" "$program" "$work"/object/*.o -o "$work/$(basename "$program" .c)" \
    -L"$work/cmocka/usr/lib/aarch64-linux-gnu" -lcmocka -lm -lpthread
done
run_arm() {
  qemu-aarch64-static -L /usr/aarch64-linux-gnu -E LD_LIBRARY_PATH="$work/cmocka/usr/lib/aarch64-linux-gnu" "$@"
}

vectors=$(aarch64-linux-gnu-objdump -d "$work/embed_digest" --disassemble=sweep_batch | grep -cE 'v[0-9]+\.2d')
echo "vector instructions in a sweep: $vectors"
[ "$vectors" -gt 50 ]
for program in test_orient test_certify test_dense test_refiner; do
  echo "$program"
  run_arm "$work/$program" 2>&1 | tail -1
done
run_arm "$work/embed_adversarial" 30 1 3000

"$here" | tee "$work/here.txt"
run_arm "$work/embed_digest" | tee "$work/arm.txt"
cmp "$work/here.txt" "$work/arm.txt" && echo "the same bytes on $(uname -m) and on aarch64"
