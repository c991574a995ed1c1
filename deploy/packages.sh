# Debian packages, and how to install those that are missing. To be sourced by bash.

orb_build_packages=(
  gcc g++ cmake ninja-build pkg-config
  libqhull-dev libmeshoptimizer-dev libdraco-dev libeigen3-dev libspectra-dev
  libcjson-dev libsodium-dev libseccomp-dev libmicrohttpd-dev libgnutls28-dev libsqlite3-dev libpq-dev libcurl4-openssl-dev libpng-dev libjpeg62-turbo-dev
  zlib1g-dev libexpat1-dev libzstd-dev
)
orb_test_packages=(
  libcmocka-dev clang-format openssl sqlite3 postgresql swift-proxy swift-account swift-container swift-object zstd curl jq python3 binutils man-db mandoc zsh fish bsdutils chromium-headless-shell nginx haproxy
)
orb_fuzz_packages=(clang libclang-rt-dev lld)
orb_long_packages=(
  pgbouncer valgrind wrk blender python3-numpy caddy debootstrap lintian buildah podman runc prometheus systemd
)

# For tests/long.sh cluster on a second S3 server, if these packages exist.
orb_radosgw_packages=(radosgw ceph-osd ceph-mon)

# Installs those of its arguments that are missing, as root or through sudo; never prompts.
orb_install_packages() {
  local package missing=() as_root=()
  for package in "$@"; do
    if [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" != installed ]; then
      missing+=("$package")
    fi
  done
  [ ${#missing[@]} -gt 0 ] || return 0
  if [ "$(id -u)" -ne 0 ]; then
    if ! command -v sudo >/dev/null; then
      echo "These packages are missing, and installing them takes root or sudo: ${missing[*]}" >&2
      return 1
    fi
    as_root=(sudo)
  fi
  echo "installing ${missing[*]}"
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq update </dev/null
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -y -o Dpkg::Use-Pty=0 --no-install-recommends \
    install "${missing[@]}" </dev/null >/dev/null
}

# Installs Node and npm unless both exist, wherever they come from.
orb_install_node() {
  if ! command -v node >/dev/null || ! command -v npm >/dev/null; then
    orb_install_packages nodejs npm
  fi
}
