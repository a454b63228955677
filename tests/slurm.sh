#!/bin/bash
# Starts a Slurm of one node on loopback, plays a task set as a job array through assets/slurm/eval.sbatch, and compares the
# merged run with one that a single process played. Needs root, and slurmctld, slurmd, munge and sbatch (on Debian: apt-get
# install slurmctld slurmd slurm-client munge); ends with 77 and a message where they are missing.
#
#   tests/slurm.sh PROGRAM SBATCH
set -euo pipefail
program=$(readlink -f "$1") script=$(readlink -f "$2")
for tool in slurmctld slurmd munged sbatch squeue; do
    PATH=$PATH:/usr/sbin:/sbin command -v "$tool" > /dev/null || { echo "skipped: $tool is not installed"; exit 77; }
done
[ "$(id -u)" = 0 ] || { echo "skipped: slurmd needs root"; exit 77; }
PATH=$PATH:/usr/sbin:/sbin
work=$(mktemp -d)
pids=()
finish() {
    for pid in "${pids[@]}"; do kill "$pid" 2> /dev/null || true; done
    wait 2> /dev/null || true
    rm -rf "$work"
}
trap finish EXIT
host=$(hostname -s)
mkdir -p "$work"/{munge,state,spool,run}
chmod 755 "$work"
dd if=/dev/urandom of="$work/munge/key" bs=1024 count=1 2> /dev/null
chmod 700 "$work/munge"; chmod 400 "$work/munge/key"
munged --foreground --force --key-file="$work/munge/key" --socket="$work/munge.socket" \
    --pid-file="$work/munge.pid" --log-file="$work/munge.log" --seed-file="$work/munge.seed" > /dev/null 2>&1 &
pids+=($!)
ctld=$((20000 + RANDOM % 10000)) node=$((31000 + RANDOM % 10000))
cat > "$work/slurm.conf" << CONF
ClusterName=loopback
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$ctld
SlurmdPort=$node
AuthType=auth/munge
AuthInfo=socket=$work/munge.socket
CryptoType=crypto/munge
SlurmUser=root
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
SchedulerParameters=sched_interval=1,bf_interval=1
MailProg=/bin/true
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=main Nodes=$host Default=YES MaxTime=INFINITE State=UP OverSubscribe=FORCE:4
CONF
export SLURM_CONF=$work/slurm.conf
for _ in $(seq 50); do [ -S "$work/munge.socket" ] && break; sleep 0.1; done
slurmctld -D > /dev/null 2>&1 &
pids+=($!)
slurmd -D > /dev/null 2>&1 &
pids+=($!)
for _ in $(seq 150); do sinfo -h -o %T 2> /dev/null | grep -q idle && break; sleep 0.2; done
sinfo -h -o %T | grep -q idle || { echo "the node did not come up"; tail -5 "$work"/slurm*.log; exit 1; }
echo "$(sinfo --version) on $host: $(sinfo -h -o '%D node, %T')"

cd "$work"
export SPRINT_HOME=${SPRINT_HOME:-$work/home}
"$program" tasks sample tasks.json --scenes generated --length 1-2 --count 12 --seed 3
echo "$(RUN=$work/run/array SHARDS=4 SPRINT=$program SBATCH_FLAGS="--cpus-per-task=1" "$script" --tasks "$work/tasks.json" --policy expert --seeds 2)"
for _ in $(seq 600); do [ -z "$(squeue -h)" ] && break; sleep 0.2; done
cat run/array-log/merge.txt | head -9
"$program" eval --tasks tasks.json --policy expert --seeds 2 --out run/alone > /dev/null 2>&1
for file in manifest.json episodes.jsonl summary.json summary.md summary.csv; do
    cmp "run/array/$file" "run/alone/$file" || { cat run/array-log/*.txt; exit 1; }
done
echo "the merged run equals the one of a single process: $(wc -l < run/array/episodes.jsonl) episodes, byte for byte"
