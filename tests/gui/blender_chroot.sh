#!/bin/bash
# A real Blender 5.2 with windows on Debian 12: Debian sid's package in a chroot of its own under .cache, and beside it
# Blender's module for Python 3.13. Needs root or sudo.
#
#   blender_chroot.sh install           makes it, once: about 2.5 GB
#   blender_chroot.sh run COMMAND...    runs a command inside; the repository is /host there
#
# A command sees mounts and processes of its own, which end with it: .cache may be removed at any time.
set -euo pipefail
repository=$(cd "$(dirname "$0")/../.." && pwd)
root=$repository/.cache/blender-gui
ready=$root/.ready-3
as_root=$(command -v sudo || true)
packages=(
  blender xvfb xauth xdotool imagemagick procps
  libgl1-mesa-dri libegl1 libgl1 libegl-mesa0 libglx-mesa0       # without libegl1 the gpu module aborts
  python3-numpy python3-zstandard python3-cattr python3-requests # without the last two extensions do not register
  python3.13 python3.13-venv libsm6 libxkbcommon0                # of Blender as a module
)
module=/opt/bpy-5.2 # a virtual environment

mirror() {
  awk '/^URIs:/ {print $2; exit} /^deb / {for (i = 2; i <= NF; i++) if ($i ~ /:\/\//) {print $i; exit}}' \
    /etc/apt/sources.list.d/debian.sources /etc/apt/sources.list 2>/dev/null
}

inside() {
  $as_root mkdir -p "$root/host"
  # shellcheck disable=SC2016 # the inner shell expands these
  $as_root unshare --mount --pid --fork --kill-child bash -euc '
    root=$1 repository=$2
    shift 2
    mount -t proc proc "$root/proc"
    mount --bind /dev "$root/dev"
    mount --bind "$repository" "$root/host"
    chroot "$root" env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 XDG_RUNTIME_DIR=/tmp \
      LIBGL_ALWAYS_SOFTWARE=1 PYTHONUNBUFFERED=1 "$@"
    exit 0 # this shell stays the first process: others behave oddly as that one, Xvfb tells it nothing
  ' inside "$root" "$repository" "$@"
}

install() {
  [ ! -e "$ready" ] || return 0
  command -v debootstrap >/dev/null || {
    $as_root apt-get update -qq
    $as_root apt-get install -y -qq --no-install-recommends debootstrap
  }
  if [ ! -e "$root/usr/bin/apt-get" ]; then
    mkdir -p "$repository/.cache"
    $as_root debootstrap --variant=minbase --include=ca-certificates sid "$root" "$(mirror)"
  fi
  # A mirror's stored copy of sid can be past its date. Packages must not start services.
  printf 'APT::Install-Recommends "0";\nAcquire::Check-Valid-Until "false";\n' |
    $as_root tee "$root/etc/apt/apt.conf.d/99windows" >/dev/null
  printf '#!/bin/sh\nexit 101\n' | $as_root tee "$root/usr/sbin/policy-rc.d" >/dev/null
  $as_root chmod +x "$root/usr/sbin/policy-rc.d"
  $as_root cp /etc/resolv.conf "$root/etc/resolv.conf"
  inside DEBIAN_FRONTEND=noninteractive apt-get update -qq
  inside DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "${packages[@]}"
  inside apt-get clean
  # Fetched by this machine's pip, which knows its package index and certificates.
  local wheels=.cache/wheels-3.13
  python3 -m pip download --quiet --only-binary=:all: --python-version 3.13 --platform manylinux_2_28_x86_64 \
    --platform manylinux_2_17_x86_64 --dest "$repository/$wheels" "bpy>=5.2,<5.3"
  inside python3.13 -m venv "$module"
  inside "$module/bin/pip" install --quiet --no-index --find-links "/host/$wheels" bpy
  rm -r "${repository:?}/$wheels"
  $as_root touch "$ready"
}

case ${1:-} in
install) install ;;
run)
  shift
  inside "$@"
  ;;
*)
  sed -n 2,8p "$0" >&2
  exit 2
  ;;
esac
