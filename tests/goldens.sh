#!/usr/bin/env bash
# Golden outputs, which a move, a rename or a tidy-up must leave identical byte for byte.
#   tests/goldens.sh            makes them again and compares with tests/goldens.sha256
#   tests/goldens.sh --quick    the demo, the simulators and the small sets only
#   tests/goldens.sh --update   writes tests/goldens.sha256 (after an intended change of numbers)
# Binaries: $KINOISE and $RAYTRACED (the maker of concealed sets), built here if not given. The outputs
# stay under $OUT (out/goldens) for a look at what differs.
set -euo pipefail
cd "$(dirname "$0")/.."
here=$PWD
sums=$here/tests/goldens.sha256
mode=${1:-}
target=${CARGO_TARGET_DIR:-$here/target}
if [ -z "${KINOISE:-}" ] || [ -z "${RAYTRACED:-}" ]; then
  cargo build --release --locked --bin kinoise --example trial
fi
KINOISE=${KINOISE:-$target/release/kinoise}
RAYTRACED=${RAYTRACED:-$target/release/examples/trial make}
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

# Every effect at its usual size, as listed by `kinoise effects`.
effects() {
  cat <<'EFFECTS'
disparity-quantisation:step_px=0.125
depth-rounding:step_m=0.001
pixel-locking:amplitude_px=0.05
column-banding:amplitude_px=0.0625,period_px=80
radial-disparity-bias:k_px=0.5
lens-distortion:k1=-0.05
range-not-depth:share=1
depth-scale:scale=1.035
disparity-offset:offset_px=0.1
thermal-drift:relative=0.005,time_constant_s=900
target-bow:sagitta_m=0.004,span_m=1
target-motion:velocity_mps=0.005
fixed-pattern-noise:sigma_px=0.05
edge-mixing:width_px=2
range-exponent:excess=0.5
slope-noise:sigma_lateral_px=0.8
tilt-axis-anisotropy:ratio=1.5
vignetting:growth=0.5
intensity-dependent-noise:exponent=0.5
ambient-light:ratio=0.05
heavy-tails:fraction=0.02,scale=5
spatial-correlation:length_px=9
temporal-correlation:rho=0.5
frozen-noise:fraction=0.8
row-noise:sigma_px=0.03
frame-jitter:sigma_px=0.03
grazing-dropout:share=1,theta50_deg=75,width_deg=2
range-dropout:share=1,z50_m=4,width_m=0.1
occlusion-shadow:share=1
EFFECTS
}

demo() {
  kinoise demo -o demo --seed 1
}

simulators() {
  mkdir -p effects
  kinoise simulate formula --shrink 8 --frames 2 --seed 3
  kinoise simulate speckle --physics speckle --shrink 4 --distances 0.8,1.6 --tilts 30 --frames 2 --seed 3
  kinoise simulate room --room --frames 3 --seed 3
  local effect
  effects | while read -r effect; do
    kinoise simulate "effects/${effect%%:*}" --effect "$effect" --shrink 8 --distances 1.2,2.5 --tilts 35 \
      --azimuths 20 --frames 2 --infrared --patches --seed 3
  done
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
    $RAYTRACED "$made" "${arguments[@]}" >/dev/null
    local set
    set=$(find "$made" -name recording.json -printf '%h\n')
    kinoise diagnose "$set" --model "$(find "$made/model" -name "*.json")" -o "$made/diagnosis"
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

# Pages and pictures are for inspection and are not compared, nor is the log, which holds times. Each
# result has a line of its own; the many images of a recording share one.
find . -type f ! -name '*.html' ! -name '*.svg' ! -name 'sigma*.png' ! -name log ! -name stats.json ! -name SHA256SUMS -print0 |
  sort -z | xargs -0 sha256sum >SHA256SUMS
results='/(diagnosis\.json|model\.json|measurements\.csv|trajectory\.txt|map\.ply)$'
{
  grep -E "$results" SHA256SUMS || true
  grep -vE "$results" SHA256SUMS | awk '{split($2, p, "/"); print p[2] "/" p[3]}' | sort -u |
    while read -r group; do
      printf '%s  ./%s/*\n' "$(grep -F " ./$group" SHA256SUMS | grep -vE "$results" | sha256sum | cut -d' ' -f1)" "$group"
    done
} | sort -k2 >made.sha256
case "$mode" in
  --update)
    cp made.sha256 "$sums"
    echo "wrote tests/goldens.sha256: $(wc -l <made.sha256) lines for $(wc -l <SHA256SUMS) files"
    ;;
  *)
    # A missing line is a difference too, unless it was not asked for.
    differ=$(diff "$sums" made.sha256 | grep '^[<>]' | awk '{print $3}' | sort -u || true)
    if [ "$mode" = --quick ]; then
      differ=$(for line in $differ; do if [ -e "${line%/\*}" ]; then echo "$line"; fi; done)
    fi
    if [ ! -e recording ]; then differ=$(printf '%s\n' "$differ" | grep -v '^\./herrera' || true); fi
    if [ -n "$differ" ]; then
      printf 'differs from tests/goldens.sha256:\n%s\n' "$differ" | head -40
      exit 1
    fi
    echo "goldens: $(wc -l <made.sha256) lines for $(wc -l <SHA256SUMS) files are as they were"
    ;;
esac
