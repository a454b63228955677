#!/usr/bin/env bash
# Trains the methods and measures them on ALFRED's task sets, as for the README's tables of results.
# Stopped or killed at any time, the same command goes on where it was.
#
#   assets/experiments.sh DATA ENCODER OUT [METHOD ...]
#
# DATA is an import of ALFRED with labels (`sprint import alfred`, `sprint relabel`), ENCODER a checkpoint whose visual encoder
# all methods share (or `resnet18`), OUT the folder for checkpoints and runs, by seed, and for the tables. CLONING (updates of
# cloning, which methods that learn from the same words share; 0 for none), STEPS (updates after that), SEEDS (as "1 2 3"),
# PRECISION (mixed, for processors that compute with bfloat16) and JOBS may be set; HOUSES may name further datasets to learn
# from, SENTENCES another sentence encoder, SPRINT another program than target/release/sprint. SIZE names a size (`paper`); then
# CLONING is 0 and STEPS the size's own where they are not set. The paper's table:
#
#   SIZE=paper SENTENCES=all-mpnet-base-v2 SEEDS="1 2 3" assets/experiments.sh DATA resnet18 OUT
set -euo pipefail
complain() {
    echo "$1" >&2
    exit 1
}
[ $# -ge 3 ] || complain "$(sed -n '2,16s/^# \{0,1\}//p' "$0")"
data=$1 encoder=$2 out=$3
shift 3
known=(sprint iql-primitive l-bc l-bc-transformer am sprint-no-chain sprint-no-agg sprint-concat-agg l-bc-agg sprint-llm-chain)
methods=("$@")
if [ $# -eq 0 ]; then
    methods=("${known[@]}")
    # A language model ranks its pairs first: `sprint chains`.
    [ -f "$data/chains.jsonl" ] || unset 'methods[-1]'
fi
for method in "${methods[@]}"; do
    [[ " ${known[*]} " == *" $method "* ]] || complain "there is no method $method: name some of ${known[*]}"
done
read -ra seeds <<<"${SEEDS:-1}"
size=${SIZE:-}
if [ -n "$size" ]; then cloning=${CLONING:-0} steps=${STEPS:-}; else cloning=${CLONING:-15000} steps=${STEPS:-3000}; fi
sprint=${SPRINT:-target/release/sprint}
command -v "$sprint" >/dev/null || complain "there is no $sprint: \`make build\` makes it, or SPRINT names another"

# What was begun with other settings is not gone on with: tables would mix them.
settings="data=$data encoder=$encoder cloning=$cloning steps=$steps precision=${PRECISION:-full} houses=${HOUSES:-} size=$size sentences=${SENTENCES:-}"
# How the sets are told: an import without the authors' lists tells some tasks by the joined sentences of their steps.
for set in eval_100 eval_chain; do
    tasks=$data/tasks/$set.json
    [ -f "$tasks" ] || complain "there is no $tasks: \`sprint import alfred\` makes it"
    reworded=$(grep -o '"reworded": *true' "$tasks" | wc -l || true)
    settings+=" $set=$(sha256sum <"$tasks" | cut -c1-16),reworded:$reworded"
done
mkdir -p "$out"
[ -f "$out/settings" ] || echo "$settings" >"$out/settings"
[ "$settings" = "$(cat "$out/settings")" ] || complain "$out was begun with $(cat "$out/settings"), not $settings: name another OUT"

# pretrain SEED NAME METHOD STEPS [WHAT THE PRESET SAYS OTHERWISE] [OPTION ...]; valid_seen is what is held out.
pretrain() {
    local seed=$1 name=$2 checkpoint=$out/$1/$2 preset=$out/$1/presets/$2.toml options=()
    mkdir -p "$out/$seed/presets"
    printf 'extends = "%s"\nseed = %s\nhold_out = 0\nprecision = "%s"\n%s\n' "$3" "$seed" "${PRECISION:-full}" "$5" >"$preset"
    [ ! -d "$checkpoint/training" ] || options+=(--resume)
    [ "$encoder" = resnet18 ] || options+=(--visual-from "$encoder")
    [ -z "$size" ] || options+=(--size "$size")
    [ -z "${SENTENCES:-}" ] || options+=(--encoder "$SENTENCES")
    [ -z "$4" ] || options+=(--steps "$4")
    [ -f "$checkpoint/README.md" ] || "$sprint" pretrain "$data" ${HOUSES:-} --preset "$preset" --out "$checkpoint" \
        "${options[@]}" "${@:6}"
}

# A method's policy begins as a clone of what it learns from, unless CLONING is 0; the transformer is one as it is.
train() {
    local method=$1 seed=$2 clone base=l-bc-agg otherwise=''
    if [ "$cloning" = 0 ]; then
        pretrain "$seed" "$method" "$method" "$steps" ''
        return
    fi
    case $method in
    l-bc-transformer)
        pretrain "$seed" "$method" "$method" $((cloning + steps)) ''
        return
        ;;
    am) clone=clone-goals base=am otherwise=$'critic = false\niql = false\nchaining = false' ;;
    l-bc | iql-primitive | sprint-no-agg) clone=clone base=l-bc ;;
    sprint-concat-agg) clone=clone-concat otherwise=$'[data]\ncomposites = "concat"' ;;
    *) clone=clone-agg ;;
    esac
    pretrain "$seed" $clone $base "$cloning" "$otherwise"
    pretrain "$seed" "$method" "$method" "$steps" $'[training.schedule]\nlearning_rate = 3e-4' \
        --policy-from "$out/$seed/$clone"
}

# An episode that errs counts as no success (the expert has no plan for what `strict` asks of some tasks), so that exit code
# 3 is no reason to stop.
evaluate() {
    "$sprint" eval ${JOBS:+--jobs "$JOBS"} "$@" >/dev/null || [ $? -eq 3 ]
}

# Zero-shot, the likeliest action, horizons of twice the recorded actions.
measure() {
    local runs=$1 name=$2 set grader
    shift 2
    for set in eval_100 eval_chain; do
        for grader in class strict; do
            evaluate --tasks "$data/tasks/$set.json" --grader $grader --out "$runs/$name-$set-$grader" "$@"
        done
        case $name in
        sprint | l-bc)
            evaluate --tasks "$data/tasks/$set.json" --step-by-step --out "$runs/$name-$set-steps" "$@"
            ;;
        esac
    done
}

# A method's runs of all seeds as one: with commas between.
joined() {
    local runs
    runs=$(printf "$out/%s/runs/$1," "${seeds[@]}")
    echo "${runs%,}"
}

for seed in "${seeds[@]}"; do
    for method in "${methods[@]}"; do
        train "$method" "$seed"
        measure "$out/$seed/runs" "$method" --checkpoint "$out/$seed/$method"
    done
done
measure "$out/runs" random --policy random --seeds "${#seeds[@]}"
measure "$out/runs" expert --policy expert --seeds "${#seeds[@]}"
for set in eval_100 eval_chain; do
    for kind in class strict; do
        runs=()
        for method in "${methods[@]}"; do runs+=("$(joined "$method-$set-$kind")"); done
        "$sprint" compare "${runs[@]}" "$out"/runs/{random,expert}-$set-$kind
    done
    step_by_step=()
    for method in "${methods[@]}"; do
        case $method in sprint | l-bc) step_by_step+=("$(joined "$method-$set-steps")") ;; esac
    done
    [ ${#step_by_step[@]} -lt 2 ] || "$sprint" compare "${step_by_step[@]}"
done | tee "$out/tables.md"
