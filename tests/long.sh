#!/usr/bin/env bash
# What takes longer than tests/run.sh may: races, leaks, fuzzing, kill -9 in a loop, real meshes under sanitizers.
#
#   tests/long.sh [PART…]    all of them without arguments:
#   tsan valgrind fuzz crash migrate cluster pgbouncer claims attacks deaths faults faults_asan soak load adversarial arm
#   robust templates holes handles rigged deploy blender visit
#
# ORB_MINUTES (5) is the CPU time for each fuzz target, ORB_KILLS (1000) the number of kills, ORB_ROUNDS (500) that of
# rounds of chaos among several nodes, ORB_TEST_PATIENCE how many times longer than usual scenarios wait for what should
# come: 4 with tsan, 20 with valgrind.
set -euo pipefail
cd "$(dirname "$(realpath -- "${BASH_SOURCE[0]}")")/.."

source deploy/packages.sh
orb_install_packages "${orb_build_packages[@]}" "${orb_test_packages[@]}" "${orb_fuzz_packages[@]}" \
  "${orb_long_packages[@]}"
orb_install_node
if command -v ccache >/dev/null; then
  export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache
fi

# Without address randomisation: clang 14's runtime cannot place its shadow memory where a kernel randomises much.
part_tsan() {
  local failed=0
  cmake --preset tsan -DORB_TESTS=ON >/dev/null
  cmake --build build-tsan
  rm -rf build-tsan/reports
  mkdir -p build-tsan/reports
  ORB_TEST_PATIENCE=${ORB_TEST_PATIENCE:-4} TSAN_OPTIONS="log_path=$PWD/build-tsan/reports/report" \
    setarch -R ctest --test-dir build-tsan --output-on-failure -R '^(unit|scenario)\.' --timeout 3600 || failed=1
  cat build-tsan/reports/* 2>/dev/null && failed=1
  return $failed
}

# The units; then daemon and command line under memcheck: a walk through every route, and the scenarios.
# ORB_VALGRIND_UNITS (programs) and ORB_VALGRIND_SCENARIOS name fewer of them, or none; several runs with different ones
# may go on side by side. Left out: what is about time (crowd, fairness, slow), what measures or needs the release build
# (bench, report, readme, demo), what preloads a library of its own (clock, faults), what ends the daemon before it can
# tell of leaks (crash), and large meshes (real_meshes, real_pairs). The folder of a run that found something is left.
valgrind_scenarios=(walk abuse assets check_data cli conditions config cors disk_full durability embeddings encodings
  eviction jobs meshes openapi operations places problems requests resume shell spheres supermeshes systemd tenants
  tls tokens view)
part_valgrind() {
  cmake --preset debug -DORB_TESTS=ON >/dev/null
  cmake --build build-debug
  local name program folder failed=0
  local -x ORB_SLOW=1 ORB_TEST_PATIENCE=${ORB_TEST_PATIENCE:-20} ORBMORPHD ORBMORPH
  folder=$(mktemp -d "$PWD/build-debug/valgrind.XXXXXX")
  ORBMORPHD=$folder/orbmorphd ORBMORPH=$folder/orbmorph
  mkdir "$folder/reports"
  ln -s ../bin/orbmorph-bench "$folder/"
  for name in orbmorphd orbmorph; do
    cat >"$folder/$name" <<END
#!/bin/sh
exec valgrind --quiet --fair-sched=try --error-exitcode=9 --leak-check=full --show-leak-kinds=definite,indirect \\
  --errors-for-leak-kinds=definite --suppressions="$PWD/tests/long/valgrind.supp" \\
  --log-file="$folder/reports/$name.%p" "$PWD/build-debug/bin/$name" "\$@"
END
    chmod +x "$folder/$name"
  done
  for program in ${ORB_VALGRIND_UNITS-build-debug/bin/test_*}; do
    echo "valgrind $program"
    valgrind --quiet --error-exitcode=9 --leak-check=full "$program" || failed=1
  done
  for name in ${ORB_VALGRIND_SCENARIOS-${valgrind_scenarios[*]}}; do
    echo "valgrind scenario $name"
    case $name in
      walk) node tests/long/walk.mjs || failed=1 ;;
      *) node --test --test-reporter=spec "tests/scenario/$name.test.mjs" || failed=1 ;;
    esac
  done
  find "$folder/reports" -type f -size +0 -exec cat {} + | tee "$folder/found"
  [ ! -s "$folder/found" ] && [ $failed -eq 0 ] && rm -r "$folder"
}

part_fuzz() {
  tests/fuzz/run.sh --cpu $((60 * ${ORB_MINUTES:-5}))
}

# kill -9 at random instants and at every named point of the code, and while webhooks are pending.
part_crash() {
  cmake --preset faults -DORB_TESTS=ON >/dev/null
  cmake --build build-faults --target orbmorphd
  ORB_KILLS=${ORB_KILLS:-1000} ORB_FAULTS=1 ORBMORPHD=build-faults/bin/orbmorphd \
    node --test --test-reporter=spec tests/scenario/crash.test.mjs
  ORB_HOOK_KILLS=${ORB_KILLS:-1000} ORBMORPHD=build-faults/bin/orbmorphd \
    node --test --test-reporter=spec tests/scenario/webhooks.test.mjs
}

# orbmorphd migrate is killed at ORB_KILLS (200) random moments, between SQLite and files, PostgreSQL and S3.
part_migrate() {
  cmake --preset release >/dev/null
  cmake --build build --target orbmorphd
  ORBMORPHD="$PWD/build/bin/orbmorphd" tests/tools/with_postgresql.sh tests/tools/with_s3.sh node tests/long/migrate.mjs
}

# The scenarios on three nodes behind haproxy, with PostgreSQL and S3: OpenStack Swift, then Ceph's radosgw if it can be
# installed (ORB_S3_SERVERS names fewer). The scenarios jobs and tenants also run with PostgreSQL and files. Then
# several nodes which are killed, paused and cut off in turn.
part_cluster() {
  cmake --preset release -DORB_TESTS=ON >/dev/null
  cmake --build build --target orbmorphd orbmorph
  local name
  local -x ORB_S3_SERVER ORBMORPHD=$PWD/build/bin/orbmorphd
  for name in jobs tenants; do
    tests/tools/with_postgresql.sh node --test --test-reporter=spec "tests/scenario/$name.test.mjs"
  done
  for ORB_S3_SERVER in ${ORB_S3_SERVERS:-swift radosgw}; do
    if [ "$ORB_S3_SERVER" = radosgw ] && ! orb_install_packages "${orb_radosgw_packages[@]}"; then
      echo "radosgw: skipped, its packages cannot be installed"
      continue
    fi
    for name in ${ORB_CLUSTER_SCENARIOS-meshes jobs supermeshes tenants eviction resume fairness embeddings lists landmarks conditions}; do
      echo "$ORB_S3_SERVER, three nodes: $name"
      tests/tools/with_postgresql.sh tests/tools/with_s3.sh tests/tools/with_nodes.sh \
        node --test --test-reporter=spec "tests/scenario/$name.test.mjs"
    done
    echo "$ORB_S3_SERVER: s3"
    tests/tools/with_s3.sh node --test --test-reporter=spec tests/scenario/s3.test.mjs
    for name in migrate nodes; do
      echo "$ORB_S3_SERVER: $name"
      ORB_ROUNDS=${ORB_ROUNDS:-500} tests/tools/with_postgresql.sh tests/tools/with_s3.sh \
        node --test --test-reporter=spec "tests/scenario/$name.test.mjs"
    done
  done
}

# The same nodes, with pgbouncer before PostgreSQL.
part_pgbouncer() {
  cmake --preset release -DORB_TESTS=ON >/dev/null
  cmake --build build --target orbmorphd
  ORB_ROUNDS=${ORB_ROUNDS:-25} ORBMORPHD=$PWD/build/bin/orbmorphd tests/tools/with_postgresql.sh \
    tests/tools/with_pgbouncer.sh tests/tools/with_s3.sh node --test --test-reporter=spec tests/scenario/nodes.test.mjs
}

# Claims of jobs in a queue of ORB_JOBS (1000000).
part_claims() {
  cmake --preset release -DORB_TESTS=ON >/dev/null
  cmake --build build --target claims-bench
  tests/tools/with_postgresql.sh build/bin/claims-bench "${ORB_JOBS:-1000000}"
}

# All attacks of tests/scenario/attacks.test.mjs, with larger files and from several connections at once.
part_attacks() {
  cmake --preset release >/dev/null
  cmake --build build --target orbmorphd
  ORB_ATTACKS=all node --test --test-reporter=spec tests/scenario/attacks.test.mjs
}

# ORB_DEATHS (200) processes of jobs die in six ways, at random moments, under 64 clients.
part_deaths() {
  cmake --preset release >/dev/null
  cmake --build build --target orbmorphd
  node tests/long/deaths.mjs
}

# Makes each call of the daemon that may fail do so, once and from then on; ORB_FAULT_RUNS=few omits allocations.
# The same under AddressSanitizer and UBSan: tests/long.sh faults_asan.
part_faults() {
  cmake --preset release -DORB_TESTS=ON >/dev/null
  cmake --build build --target orbmorphd orbmorph_interpose test_torture_core test_torture_api test_torture_store
  local program
  for program in core api store; do
    ORB_TORTURE_ALL=1 "build/bin/test_torture_$program"
  done
  ORB_FAULT_RUNS=${ORB_FAULT_RUNS:-all} ORB_INTERPOSE=build/bin/liborbmorph_interpose.so \
    node --test --test-reporter=spec tests/scenario/faults.test.mjs
}

part_faults_asan() {
  cmake --preset asan -DORB_TESTS=ON >/dev/null
  cmake --build build-asan --target orbmorphd orbmorph_interpose
  ORB_FAULT_RUNS=${ORB_FAULT_RUNS:-all} ctest --test-dir build-asan -V -R '^scenario\.faults$' --timeout 36000
}

# Mixed work for ORB_SOAK_SECONDS (600): memory, descriptors and threads stay flat.
part_soak() {
  cmake --preset release >/dev/null
  cmake --build build --target orbmorphd
  node tests/long/soak.mjs
}

# Blender loads the profile quantized of the conformance assets.
part_blender() {
  local folder
  cmake --preset release -DORB_TESTS=ON >/dev/null
  cmake --build build --target asset_fixture
  folder=$(mktemp -d)
  build/bin/asset_fixture "$folder"
  blender -b --python-exit-code 1 --python tests/long/blender.py -- "$folder"
  rm -r "$folder"
}

# The samples and real meshes, in pairs, through the studio: contact sheets to look at, build/visit/pairs.png and, of
# units and axes, units.png.
part_visit() {
  local meshes=${ORB_MESHES:-../shared/meshes}
  local list=(tests/samples/giraffe.off tests/samples/elephant.ply) name
  [ -d "$meshes" ] && for name in good/{cow.off,shrec381.off,spot.obj} weldable/box_textured.glb \
    good/{human_man.obj,human_woman.obj,koala_lr.obj,penguin.obj,round_cube.obj,bumpy_cube.obj} \
    good/{goathead.obj,busted.stl,xyz_cube.stl,thin_cylinder.stl,boat.obj,sword.obj} \
    posed/{ada-neutral.obj,ben-armsup.off}; do
    list+=("$meshes/$name")
  done
  client/web/build.sh
  cmake --preset release >/dev/null
  cmake --build build --target orbmorphd
  node tests/long/visit.mjs build/visit "${list[@]}"
  cmake --build build --target orbmorph
  node tests/long/units.mjs build/visit/units.png
}

part_load() {
  cmake --preset release >/dev/null
  cmake --build build --target orbmorphd
  node tests/bench/load.mjs
}

# 1,000 seeded adversarial meshes through the embedding; tests/bench/report.py shows what this leaves.
part_adversarial() {
  cmake --preset release -DORB_TESTS=ON >/dev/null
  cmake --build build
  build/bin/embed-adversarial 1000 1000 60000 | tee docs/bench/adversarial-1000.txt
}

# The embedding on Arm, emulated.
part_arm() {
  orb_install_packages gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user-static
  cmake --preset release -DORB_TESTS=ON >/dev/null
  cmake --build build --target embed-digest
  tests/tools/arm.sh build/bin/embed-digest
}

# Random landmarks on real meshes and every pair of them, where their folder is there: ORB_MESHES.
part_robust() {
  cmake --preset release -DORB_TESTS=ON >/dev/null
  cmake --build build
  local meshes=${ORB_MESHES:-../shared/meshes}
  if [ -d "$meshes/good" ]; then
    tests/bench/robust.py --meshes "$meshes" --merge-every 99
  else
    echo "no meshes at $meshes"
  fi
}

# Each good mesh as a template: its vertices, corners and attributes must stay. Then every pair with its landmarks: the
# target's vertices lie on the other shape, and the stated error is no less than an independent measure.
part_templates() {
  cmake --preset release -DORB_TESTS=ON >/dev/null
  cmake --build build
  ORBMORPHD="$PWD/build/bin/orbmorphd" ORB_SHARED_MESHES=$(realpath -m "${ORB_MESHES:-../shared/meshes}") \
    ORB_TEMPLATE_MOST=1000000 node --test --test-reporter=spec tests/scenario/real_templates.test.mjs \
    tests/long/template_pairs.test.mjs
}

# Every open mesh, generated and real, with every method: the rims come back.
part_holes() {
  cmake --preset release -DORB_TESTS=ON >/dev/null
  cmake --build build --target orbmorphd
  ORBMORPHD="$PWD/build/bin/orbmorphd" ORB_SHARED_MESHES=$(realpath -m "${ORB_MESHES:-../shared/meshes}") ORB_HOLES_ALL=1 \
    node --test --test-reporter=spec tests/scenario/holes.test.mjs
}

# Spheres and scans with 1 to 50 handles and tunnels stitched in, and the time that closing them takes.
part_handles() {
  cmake --preset release -DORB_TESTS=ON -DORB_SHARED_MESHES="$(realpath -m "${ORB_MESHES:-../shared/meshes}")" >/dev/null
  cmake --build build --target test_mesh_handles
  ORB_HANDLES_ALL=1 build/bin/test_mesh_handles
}

# A rigged character with new shape keys in three.js, Babylon.js and Blender: build/rigged/rigged.png.
part_rigged() {
  cmake --preset release >/dev/null
  cmake --build build --target orbmorphd
  ORB_SHOTS=$PWD/build/rigged ORBMORPHD="$PWD/build/bin/orbmorphd" \
    node --test --test-reporter=spec tests/long/rigged.test.mjs
}

# Behind nginx and Caddy, the unit's score, the dashboard's queries; as root also the package and the container.
part_deploy() {
  cmake --preset release -DORB_TESTS=ON >/dev/null
  cmake --build build --target orbmorphd orbmorph
  node --test --test-reporter=spec tests/scenario/proxy.test.mjs tests/scenario/deploy.test.mjs
  tests/long/package.sh
  tests/long/container.sh
}

if [ $# -eq 0 ]; then
  set -- tsan valgrind fuzz crash migrate cluster pgbouncer claims attacks deaths faults faults_asan soak load \
    adversarial arm robust templates holes handles rigged deploy blender visit
fi
for part in "$@"; do
  echo "== $part =="
  "part_$part"
done
