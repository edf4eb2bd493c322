#!/bin/bash
# A real Blender 5.2 with windows on Debian 12: Debian sid's package in a chroot of its own under .cache. Needs root or sudo.
#
#   blender_chroot.sh install           makes it, once: about 1.5 GB
#   blender_chroot.sh run COMMAND...    runs a command inside; the repository is /host there
#   blender_chroot.sh umount            before .cache is removed: its mounts would be emptied with it
set -euo pipefail
repository=$(cd "$(dirname "$0")/../.." && pwd)
root=$repository/.cache/blender-gui
ready=$root/.ready-2
as_root=$(command -v sudo || true)
packages=(
  blender xvfb xauth xdotool imagemagick procps
  libgl1-mesa-dri libegl1 libgl1 libegl-mesa0 libglx-mesa0      # without libegl1 the gpu module aborts
  python3-numpy python3-zstandard python3-cattr python3-requests # without the last two extensions do not register
)

mirror() {
  awk '/^URIs:/ {print $2; exit} /^deb / {for (i = 2; i <= NF; i++) if ($i ~ /:\/\//) {print $i; exit}}' \
    /etc/apt/sources.list.d/debian.sources /etc/apt/sources.list 2>/dev/null
}

is_mounted() { mountpoint -q "$root/$1"; }

mount_all() {
  $as_root mkdir -p "$root/host"
  is_mounted proc || $as_root mount -t proc proc "$root/proc"
  is_mounted dev || $as_root mount --bind /dev "$root/dev"
  is_mounted host || $as_root mount --bind "$repository" "$root/host"
}

umount_all() {
  local point
  for point in host dev proc; do
    if is_mounted "$point"; then $as_root umount "$root/$point"; fi
  done
}

inside() {
  $as_root chroot "$root" env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 XDG_RUNTIME_DIR=/tmp \
    LIBGL_ALWAYS_SOFTWARE=1 PYTHONUNBUFFERED=1 "$@"
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
  mount_all
  inside DEBIAN_FRONTEND=noninteractive apt-get update -qq
  inside DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "${packages[@]}"
  inside apt-get clean
  $as_root touch "$ready"
}

case ${1:-} in
install) install ;;
run)
  shift
  mount_all
  inside "$@"
  ;;
umount) umount_all ;;
*)
  sed -n 2,6p "$0" >&2
  exit 2
  ;;
esac
