#!/bin/bash
# windows.sh EXTENSION.zip: install the extension into a real Blender from the command line, and try it in windows.
#
# (--kill-after: unshare, which the chroot runs under, does not listen to a gentler signal.)
# WINDOWS_STEPS: names of steps, with commas, instead of all; main: those that matter most. WINDOWS_SECONDS: when to give up.
# Screenshots and the console go to .cache/windows. Fails if a step does, or if anything alarming is on the console.
set -euo pipefail
repository=$(cd "$(dirname "$0")/../.." && pwd)
zip=$(realpath --relative-to "$repository" "$1")
output=.cache/windows
chroot=$repository/tests/gui/blender_chroot.sh
steps=${WINDOWS_STEPS:-}

"$chroot" install
rm -rf "${repository:?}/$output"
mkdir -p "$repository/$output/user"
console=$repository/$output/console.log
user=BLENDER_USER_RESOURCES=/host/$output/user

"$chroot" run "$user" blender --command extension install-file -r user_default "/host/$zip"
# Saved preferences keep the first start's questions away; without a graphics card smooth edges take most of a redraw.
"$chroot" run "$user" blender --background --python-expr "import bpy
preferences = bpy.context.preferences
preferences.view.show_splash, preferences.view.smooth_view = False, 0
preferences.system.viewport_aa = 'OFF'
bpy.ops.wm.save_userpref()" >/dev/null

# The command line that the extension gives to Blender itself, where it is enabled; in windows a step enables it.
other=BLENDER_USER_RESOURCES=/host/$output/command_user
mkdir "$repository/$output/command_user"
"$chroot" run "$other" blender --command extension install-file -r user_default --enable "/host/$zip"
"$chroot" run "$other" blender --command perfect_bvh render /host/blend_scenes/gears.blend --size 160x90 --mode normal \
  -o "/host/$output/command.png"
test -s "$repository/$output/command.png"

status=0
timeout --kill-after=10 "${WINDOWS_SECONDS:-2700}" "$chroot" run "$user" WINDOWS_OUTPUT=/host/$output "WINDOWS_STEPS=$steps" \
  xvfb-run -a -s "-screen 0 1280x1040x24" \
  blender --gpu-backend opengl --window-geometry 0 0 1280 1040 /host/blend_scenes/tree_in_wind.blend \
  -P /host/tests/gui/steps.py >"$console" 2>&1 || status=$?

cat "$console"
if [ $status -ne 0 ] || ! grep -q "^ALL STEPS PASSED" "$console"; then
  echo "The windows' test failed (status $status); screenshots are in $output" >&2
  exit 1
fi
if ! python3 "$repository/tests/gui/console_alarms.py" "$console"; then
  echo "The console is not clean" >&2
  exit 1
fi
