#!/usr/bin/env bash
# Golden outputs: what a move, a rename or a tidy-up must leave as it was, byte for byte.
#   tests/goldens.sh            makes them again and compares with tests/goldens.sha256
#   tests/goldens.sh --quick    the demo, the simulators and the small sets only
#   tests/goldens.sh --update   writes tests/goldens.sha256 (after a change of numbers that was meant)
# Binaries: $KINOISE and $RAYTRACED (the maker of concealed sets), built here when not given. What was
# made stays under $OUT (out/goldens) for a look at what differs.
set -euo pipefail
cd "$(dirname "$0")/.."
here=$PWD
sums=$here/tests/goldens.sha256
mode=${1:-}
target=${CARGO_TARGET_DIR:-$here/target}
if [ -z "${KINOISE:-}" ] || [ -z "${RAYTRACED:-}" ]; then
  cargo build --release --locked --bin kinoise --example rays
fi
KINOISE=${KINOISE:-$target/release/kinoise}
RAYTRACED=${RAYTRACED:-$target/release/examples/rays}
data=${KINOISE_DATA:-$here/../shared/data}
out=${OUT:-$here/out/goldens}
export SOURCE_DATE_EPOCH=1700000000
rm -rf "$out"
mkdir -p "$out"
cd "$out"
# Relative, so that no path of this machine gets into a file.
ln -s "$here/calib_data" calib_data

kinoise() { "$KINOISE" "$@" >/dev/null 2>>log || [ $? -eq 1 ]; }

# CELL EFFECT NATS SEED SIZE: small is 160x120 px, large 320x240.
sets() {
  cat <<'SETS'
null - - 11 large
null - - 12 small
drift - 500 13 small
single disparity-quantisation 500 21 large
single pixel-locking 150 22 small
single column-banding 500 23 large
single radial-disparity-bias 150 24 small
single lens-distortion 500 25 large
single target-bow 500 26 small
single target-motion 500 27 small
single fixed-pattern-noise 500 28 small
single edge-mixing 5000 29 large
single slope-noise 500 30 small
single vignetting 500 31 small
single intensity-dependent-noise 500 32 small
single heavy-tails 500 33 small
single frozen-noise 500 34 large
single row-noise 500 35 small
single range-dropout 500 36 small
single occlusion-shadow 5000 37 large
pair - 500 41 small
outside seam 5000 42 small
outside blob 5000 43 small
referenced - 500 44 small
SETS
}

demo() {
  kinoise demo -o demo --seed 1
}

simulators() {
  kinoise simulate formula --shrink 8 --frames 2 --seed 3
  kinoise simulate speckle --physics speckle --shrink 4 --views 2 --frames 2 --seed 3
  kinoise simulate room --room --frames 3 --seed 3
}

concealed() {
  local cell effect nats seed size
  mkdir -p sets
  sets | while read -r cell effect nats seed size; do
    [ "$1" = small ] && [ "$size" = large ] && continue
    local arguments=(--cell "$cell" --seed "$seed" --sealed)
    [ "$effect" = - ] || arguments+=(--effect "$effect")
    [ "$nats" = - ] || arguments+=(--nats "$nats")
    [ "$size" = small ] && arguments+=(--small)
    local made="sets/$seed"
    "$RAYTRACED" "$made" "${arguments[@]}" >/dev/null
    local set
    set=$(find "$made" -name recording.json -printf '%h\n')
    kinoise diagnose "$set" --model "$(find "$made" -name model.json | head -n 1)" -o "$made/diagnosis"
  done
}

herrera() {
  local recording=$data/herrera-kinect-v1/recording
  if [ ! -d "$recording" ]; then
    echo "skipped: $recording is not here; set KINOISE_DATA to the folder of real data" >&2
    return
  fi
  ln -s "$recording" recording
  kinoise calibrate recording -o herrera
  kinoise diagnose recording -o herrera-diagnosis
  kinoise correct recording --model herrera-diagnosis/model.json -o herrera-corrected
}

demo
simulators
if [ "$mode" = --quick ]; then concealed small; else concealed all; herrera; fi

# Pages and pictures are looked at, not held; the log holds times.
find . -type f ! -name '*.html' ! -name '*.svg' ! -name log ! -name stats.json ! -name SHA256SUMS -print0 |
  sort -z | xargs -0 sha256sum >SHA256SUMS
case "$mode" in
  --update)
    cp SHA256SUMS "$sums"
    echo "wrote tests/goldens.sha256: $(wc -l <SHA256SUMS) files"
    ;;
  *)
    # Both ways: a file that is no longer made is a difference too, unless it was not asked for.
    differ=$(diff <(sort -k2 "$sums") <(sort -k2 SHA256SUMS) | grep '^[<>]' | awk '{print $3}' | sort -u || true)
    if [ "$mode" = --quick ]; then
      differ=$(for f in $differ; do if [ -e "$f" ]; then echo "$f"; fi; done)
    fi
    if [ ! -e recording ]; then differ=$(printf '%s\n' "$differ" | grep -v '^\./herrera' || true); fi
    if [ -n "$differ" ]; then
      printf 'differs from tests/goldens.sha256:\n%s\n' "$differ" | head -40
      exit 1
    fi
    echo "goldens: $(wc -l <SHA256SUMS) files are as they were"
    ;;
esac
