#!/usr/bin/env bash
# Trains the methods and measures them on ALFRED's task sets: every row of the README's tables of results.
# Stopped or killed at any time, the same command goes on where it was.
#
#   assets/experiments.sh DATA EYES OUT [METHOD ...]
#
# DATA is an import of ALFRED with labels (`sprint import alfred`, `sprint relabel`), EYES a checkpoint whose visual encoder
# all methods share, OUT the folder for checkpoints, runs and the table. STEPS, SEED and JOBS may be set; HOUSES may name
# further datasets to learn from.
set -euo pipefail
if [ $# -lt 3 ]; then
    sed -n '2,9s/^# \{0,1\}//p' "$0"
    exit 1
fi
data=$1 eyes=$2 out=$3
shift 3
methods=("$@")
[ $# -gt 0 ] || methods=(sprint iql-primitive l-bc et am sprint-no-chain sprint-no-agg sprint-concat-agg l-bc-agg)
sprint=${SPRINT:-target/release/sprint}
mkdir -p "$out/presets" "$out/runs"

train() {
    local method=$1 checkpoint=$out/$1 resume=()
    printf 'extends = "%s"\nseed = %s\n' "$method" "${SEED:-1}" >"$out/presets/$method.toml"
    [ ! -d "$checkpoint/training" ] || resume=(--resume)
    [ -f "$checkpoint/README.md" ] || "$sprint" pretrain "$data" ${HOUSES:-} --preset "$out/presets/$method.toml" \
        --steps "${STEPS:-6000}" --visual-from "$eyes" --out "$checkpoint" "${resume[@]}"
}

# An episode that errs counts as no success (the expert has no plan for what `strict` asks of some tasks), so that exit code
# 3 is no reason to stop.
evaluate() {
    "$sprint" eval ${JOBS:+--jobs "$JOBS"} "$@" >/dev/null || [ $? -eq 3 ]
}

# Zero-shot, the likeliest action, horizons of twice the recorded actions.
measure() {
    local name=$1 set grader
    shift
    for set in eval_100 eval_chain; do
        for grader in class strict; do
            evaluate --tasks "$data/tasks/$set.json" --grader $grader --out "$out/runs/$name-$set-$grader" "$@"
        done
        case $name in
        sprint | l-bc)
            evaluate --tasks "$data/tasks/$set.json" --step-by-step --out "$out/runs/$name-$set-steps" "$@"
            ;;
        esac
    done
}

for method in "${methods[@]}"; do
    train "$method"
    measure "$method" --checkpoint "$out/$method"
done
measure random --policy random
measure expert --policy expert
for set in eval_100 eval_chain; do
    for grader in class strict; do
        "$sprint" compare "$out"/runs/{random,expert}-$set-$grader $(printf "$out/runs/%s-$set-$grader " "${methods[@]}")
    done
done | tee "$out/tables.md"
